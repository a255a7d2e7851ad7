// `node lichtblick.mjs @lichtblick/roslibjs PORT read TOPIC...`: what Lichtblick's source "Rosbridge (ROS 1 & 2)" does,
// with the packages that it does it with. Each topic is also heard in JSON, to compare with.
import rosmsg from '@lichtblick/rosmsg'
import ros1 from '@lichtblick/rosmsg-serialization'
import ros2 from '@lichtblick/rosmsg2-serialization'

import { ask, call, open, plain, roslib, say, words } from './roslib.mjs'

const ros = await open()
const other = await open()

// The version of ROS is that of the type of /rosout.
const { topics, types, typedefs_full_text } = await ask((done, failed) => ros.getTopicsAndRawTypes(done, failed))
const version = types.includes('rcl_interfaces/msg/Log') ? 2 : types.includes('rosgraph_msgs/Log') ? 1 : 0

const { MessageReader } = version === 2 ? ros2 : ros1
const readers = {}
const problems = {}
topics.forEach((topic, i) => {
  try {
    readers[topic] = new MessageReader(rosmsg.parse(typedefs_full_text[i], { ros2: version === 2 }))
  } catch (error) {
    problems[topic] = error.message
  }
})

const nodes = await ask((done, failed) => ros.getNodes(done, failed))
const publishers = {}
for (const node of nodes) {
  const { publishing } = await call(ros, '/rosapi/node_details', 'rosapi/NodeDetails', { node })
  for (const topic of publishing) publishers[topic] = node
}

const service = '/rosapi/topic_type'
const serviceType = await ask((done, failed) => ros.getServiceType(service, done, failed))
const answer = await call(ros, service, serviceType, { topic: words[0] })

// Times are {sec, nsec} here, whatever they are on the wire.
const SPELLINGS = { secs: 'sec', nsecs: 'nsec', nanosec: 'nsec' }
const respell = (value) =>
  JSON.parse(JSON.stringify(plain(value)), (_, inner) =>
    inner?.constructor === Object
      ? Object.fromEntries(Object.entries(inner).map(([key, item]) => [SPELLINGS[key] ?? key, item]))
      : inner,
  )
const timeOf = ({ header, clock, markers }) => JSON.stringify(header?.stamp ?? clock ?? markers.at(-1).header.stamp)

// One message that came both ways.
const compare = (name) =>
  ask((done) => {
    const raw = {}
    const json = {}
    const look = (time) => raw[time] && json[time] && done({ raw: raw[time], json: json[time] })
    new roslib.Topic({ ros, name, compression: 'cbor-raw', queue_length: 0 }).subscribe(({ bytes }) => {
      const msg = respell(readers[name].readMessage(bytes))
      raw[timeOf(msg)] = msg
      look(timeOf(msg))
    })
    new roslib.Topic({ ros: other, name }).subscribe((wire) => {
      const msg = respell(wire)
      json[timeOf(msg)] = msg
      look(timeOf(msg))
    })
  })
const messages = Object.fromEntries(await Promise.all(words.map(async (name) => [name, await compare(name)])))

const typeOf = Object.fromEntries(topics.map((topic, i) => [topic, types[i]]))
say({ version, types: typeOf, problems, publishers, serviceType, answer, messages })
ros.close()
other.close()
