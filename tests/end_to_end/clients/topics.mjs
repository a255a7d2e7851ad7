// `node topics.mjs LIBRARY PORT ROLE ...`: what topics.py does, listening in each encoding that the library reads.
import { ask, open, plain, role, roslib, say, settle, words } from './roslib.mjs'

// What a connection of its own hears of each topic, in one encoding.
async function listen(messages, compression) {
  const ros = await open()
  const heard = messages.map(({ topic, type }) =>
    ask((done) => new roslib.Topic({ ros, name: topic, messageType: type, compression }).subscribe(done)),
  )
  await settle(ros)
  return { heard, close: () => ros.close() }
}

async function talk(text) {
  const messages = JSON.parse(text)
  const listeners = {}
  for (const compression of ['none', 'png', 'cbor']) listeners[compression] = await listen(messages, compression)
  for (const { topic, type, msg } of messages) new roslib.Topic({ ros, name: topic, messageType: type }).publish(msg)
  const seen = {}
  for (const [compression, { heard, close }] of Object.entries(listeners)) {
    seen[compression] = plain(await Promise.all(heard))
    close()
  }
  say(seen)
}

async function burst(name, num) {
  const other = await open()
  const terms = { name, messageType: 'std_msgs/Int32', throttle_rate: 100, queue_length: 3 }
  const listener = new roslib.Topic({ ros: other, ...terms })
  const heard = []
  const isOver = ask((done) =>
    listener.subscribe(({ data }) => {
      heard.push(data)
      if (data === Number(num)) done()
    }),
  )
  await settle(other)
  const talker = new roslib.Topic({ ros, name, messageType: 'std_msgs/Int32' })
  for (let data = 1; data <= num; data++) talker.publish({ data })
  await isOver
  other.close()
  say({ heard })
}

const ros = await open()
await { talk, burst }[role](...words)
ros.close()
