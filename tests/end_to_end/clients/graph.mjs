// `node graph.mjs LIBRARY PORT use NAME`: a client of a node of ROS 2, `beside_of_ros2.py`: a topic and a service each way.
import { ask, call, open, role, roslib, say, words } from './roslib.mjs'

const TYPE = 'std_msgs/String'

async function use(name) {
  const service = new roslib.Service({ ros, name: `/web/${name}/ask`, serviceType: 'std_srvs/Trigger' })
  service.advertise((_request, response) => {
    response.success = true
    response.message = `${name} was asked`
    return true
  })
  let known
  do known = await call(ros, '/rosapi/services', 'rosapi/Services')
  while (!known.services.includes('/robot/tell'))
  const text = await ask((done) => new roslib.Topic({ ros, name: '/robot/text', messageType: TYPE }).subscribe(done))
  const talker = new roslib.Topic({ ros, name: `/web/${name}`, messageType: TYPE })
  let answer
  do {
    talker.publish({ data: `${name} \u2713` })
    answer = await call(ros, '/robot/tell', 'test_msgs/BasicTypes', { string_value: name, float64_value: 0.1 })
  } while (!answer.bool_value)
  say({ text: text.data, answer: [answer.string_value, answer.float64_value] })
}

const ros = await open()
await { use }[role](...words)
ros.close()
