// `node basics.mjs LIBRARY PORT ROLE [NAME]`: what basics.py does.
import { ask, call, open, role, roslib, say, serve, settle, words } from './roslib.mjs'

const ADD = 'example_interfaces/AddTwoInts'

async function drive() {
  const { topics } = await ask((done, failed) => ros.getTopics(done, failed))
  const topic_type = await ask((done, failed) => ros.getTopicType('/Ego_topic', done, failed))
  const services = await ask((done, failed) => ros.getServices(done, failed))
  const nodes = await ask((done, failed) => ros.getNodes(done, failed))

  const ego = new roslib.Topic({ ros, name: '/Ego_topic', messageType: 'morai_msgs/EgoVehicleStatus' })
  const controls = new roslib.Topic({ ros, name: '/ctrl_cmd', messageType: 'morai_msgs/CtrlCmd' })
  const command = { longlCmdType: 1, accel: 0.6, brake: 0.0, steering: 0.02 }
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
  controls.publish({ longlCmdType: 1, brake: 1.0 })
  ego.unsubscribe()
  const { time } = await settle(ros)
  const seconds = (time.secs ?? time.sec) + (time.nsecs ?? time.nanosec) / 1e9
  say({ topics, topic_type, services, nodes, time: seconds, first, last })
}

async function remember(name) {
  const param = new roslib.Param({ ros, name })
  const get = () => ask((done, failed) => param.get(done, failed))
  const names = () => ask((done, failed) => ros.getParams(done, failed))
  await ask((done, failed) => param.set({ text: '안녕', list: [1, 2.5, null] }, done, failed))
  const kept = await get()
  const is_listed = (await names()).includes(name)
  await ask((done, failed) => param.delete(done, failed))
  const is_still_listed = (await names()).includes(name)
  say({ kept, is_listed, is_still_listed, gone: await get().catch((error) => error.message) })
}

async function add(name) {
  const service = new roslib.Service({ ros, name, serviceType: ADD })
  await service.advertise((request, response) => {
    if (request.a >= 0) response.sum = request.a + request.b
    return request.a >= 0 // roslib 2 sends no values at all where this is false
  })
  say({ ready: await ask((done, failed) => ros.getServiceType(name, done, failed)) })
  await serve()
  await service.unadvertise()
}

async function callOther(name) {
  const { sum } = await call(ros, name, ADD, { a: 20, b: 22 })
  const is_refused = await call(ros, name, ADD, { a: -1, b: 0 }).then(
    () => false,
    () => true,
  )
  say({ sum, is_refused })
}

const ros = await open()
await { drive, remember, serve: add, call: callOther }[role](...words)
ros.close()
