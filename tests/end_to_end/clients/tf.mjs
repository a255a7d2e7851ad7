// `node tf.mjs LIBRARY PORT follow WAY`: what tf.py does, by the `topics` of ROS 1's action, the `service` or the `action`.
import { ask, open, roslib, role, say, settle, words } from './roslib.mjs'

const [way] = words

function makeClient() {
  const options = { ros, fixedFrame: 'map', rate: 20, transThres: 0.1 }
  if (way === 'action') return new roslib.ROS2TFClient(options)
  ros.groovyCompatibility = way === 'topics' // roslib 2 has the topics alone
  return new roslib.TFClient(options)
}

async function follow() {
  const client = makeClient()
  const places = []
  let first_center
  const controls = new roslib.Topic({ ros, name: '/ctrl_cmd', messageType: 'morai_msgs/CtrlCmd' })
  let pedal
  await ask((done) => {
    client.subscribe('vehicle_center', ({ translation }) => (first_center ??= translation))
    client.subscribe('/base_link', ({ translation: { x, y, z }, rotation }) => {
      places.push([x, y, z, rotation.x, rotation.y, rotation.z, rotation.w])
      pedal ??= setInterval(() => controls.publish({ longlCmdType: 1, accel: 0.6 }), 50)
      if (Math.hypot(x - places[0][0], y - places[0][1]) > 1) done()
    })
  })
  clearInterval(pedal)
  controls.publish({ longlCmdType: 1, brake: 1.0 })
  client.dispose()
  if (way === 'topics') client.currentGoal.cancel()
  await settle(ros)
  say({ places, first_center: [first_center.x, first_center.y, first_center.z] })
}

const ros = await open()
await { follow }[role]()
ros.close()
