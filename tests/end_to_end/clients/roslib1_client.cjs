// A roslib 1 program: `node roslib1_client.cjs PORT drive|serve|call [SERVICE]`. See roslibpy_client.py.
const ROSLIB = require('roslib1')

const PATIENCE = 20_000
const ADD = 'example_interfaces/AddTwoInts'
const [port, role, name] = process.argv.slice(2)

const say = (seen) => console.log(JSON.stringify(seen))
const ask = (start) =>
  new Promise((resolve, reject) => {
    setTimeout(() => reject(new Error('no answer')), PATIENCE).unref()
    start(resolve, (why) => reject(new Error(`refused: ${why}`)))
  })
const call = (service, type, request = {}) =>
  ask((done, failed) =>
    new ROSLIB.Service({ ros, name: service, serviceType: type }).callService(
      new ROSLIB.ServiceRequest(request),
      done,
      failed,
    ),
  )

async function drive() {
  const { topics } = await ask((done, failed) => ros.getTopics(done, failed))
  const topic_type = await ask((done, failed) => ros.getTopicType('/Ego_topic', done, failed))
  const services = await ask((done, failed) => ros.getServices(done, failed))
  const nodes = await ask((done, failed) => ros.getNodes(done, failed))
  const { time } = await call('/rosapi/get_time', 'rosapi/GetTime')
  const param = new ROSLIB.Param({ ros, name: '/seen_by/roslib1' })
  await ask((done, failed) => param.set({ text: '안녕', list: [1, 2.5, null] }, done, failed))
  const value = await ask((done, failed) => param.get(done, failed))

  const ego = new ROSLIB.Topic({ ros, name: '/Ego_topic', messageType: 'morai_msgs/EgoVehicleStatus' })
  const controls = new ROSLIB.Topic({ ros, name: '/ctrl_cmd', messageType: 'morai_msgs/CtrlCmd' })
  const command = new ROSLIB.Message({ longlCmdType: 1, accel: 0.6, brake: 0.0, steering: 0.02 })
  const pedal = setInterval(() => controls.publish(command), 50)
  let first, last
  await ask((done) =>
    ego.subscribe(({ position: { x, y } }) => {
      first ??= [x, y]
      last = [x, y]
      if (Math.hypot(x - first[0], y - first[1]) > 2) done()
    }),
  )
  clearInterval(pedal)
  controls.publish(new ROSLIB.Message({ longlCmdType: 1, brake: 1.0 }))
  ego.unsubscribe()
  await call('/rosapi/get_time', 'rosapi/GetTime') // answered after all that was sent before it
  say({ topics, topic_type, services, nodes, time: time.secs + time.nsecs / 1e9, param: value, first, last })
}

async function serve() {
  const service = new ROSLIB.Service({ ros, name, serviceType: ADD })
  service.advertise((request, response) => {
    response.sum = request.a + request.b
    return request.a >= 0
  })
  say({ ready: await ask((done, failed) => ros.getServiceType(name, done, failed)) })
  for await (const _ of process.stdin);
  service.unadvertise()
}

async function callOther() {
  const { sum } = await call(name, ADD, { a: 20, b: 22 })
  const is_refused = await call(name, ADD, { a: -1, b: 0 }).then(
    () => false,
    () => true,
  )
  say({ sum, is_refused })
}

const ros = new ROSLIB.Ros()
ros.on('error', (error) => {
  throw error
})
ros.on('connection', async () => {
  await { drive, serve, call: callOther }[role]()
  ros.close()
})
ros.connect(`ws://127.0.0.1:${port}`)
