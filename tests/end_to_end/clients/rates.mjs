// Roles: `count ENCODING TOPIC=TYPE ...`: subscribe until stdin ends; how many messages came, and how long behind the
// ego's of the same frame [ms].
import { open, role, roslib, say, settle, words } from './roslib.mjs'

const [encoding, ...topics] = words
const ros = await open()
const begun = new Map()
const heard = {}
const listen = (name, messageType, take, compression) =>
  new roslib.Topic({ ros, name, messageType, compression }).subscribe(take)

if (role !== 'count') throw new Error(`unknown role ${role}`)
listen('/Ego_topic', 'morai_msgs/EgoVehicleStatus', (message) => begun.set(message.header.seq, performance.now()), 'none')
for (const [name, type] of topics.map((each) => each.split('='))) {
  heard[name] = []
  listen(name, type, (message) => heard[name].push([message.header.seq, performance.now()]), encoding)
}
await settle(ros)
say({ ready: true })
await new Promise((resolve) => process.stdin.on('end', resolve).resume())
await settle(ros)
const of = (use) => Object.fromEntries(Object.entries(heard).map(([name, each]) => [name, use(each)]))
const times = Object.values(heard).flatMap((each) => each.map(([, at]) => at))
say({
  counts: of((each) => each.length),
  delays: of((each) => each.filter(([seq]) => begun.has(seq)).map(([seq, at]) => at - begun.get(seq))),
  seconds: times.length ? (Math.max(...times) - Math.min(...times)) / 1000 : 0,
})
ros.close()
