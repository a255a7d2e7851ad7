// `node mock.mjs LIBRARY PORT ROLE`: what a program sees of a mock that was captured from the simulator.
import { ask, call, open, say, settle, roslib } from './roslib.mjs'

const ros = await open()
const topics = await ask((done, failed) => ros.getTopics(({ topics }) => done(topics), failed))
const ego = new roslib.Topic({ ros, name: '/Ego_topic', messageType: 'morai_msgs/EgoVehicleStatus' })
const { position, header } = await ask((done) => ego.subscribe(done))
const { model } = await call(ros, '/sim/describe', 'rosbridge_sim_msgs/Describe')
await settle(ros)
say({ has_markers: topics.includes('/sim/scene/objects'), x: position.x, frame: header.frame_id, model })
ros.close()
