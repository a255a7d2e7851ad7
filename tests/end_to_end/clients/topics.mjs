// `node topics.mjs LIBRARY PORT ROLE ...`: what topics.py does, listening in each encoding that the library reads.
import { ask, open, role, roslib, say, settle, words } from './roslib.mjs'

// Bytes as base64, and numbers in typed arrays as lists: what the same message is in JSON.
function plain(value) {
  if (typeof value === 'bigint') return Number(value)
  if (value instanceof Uint8Array) return Buffer.from(value).toString('base64')
  if (ArrayBuffer.isView(value)) return Array.from(value, plain)
  if (Array.isArray(value)) return value.map(plain)
  if (value === null || typeof value !== 'object') return value
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, plain(inner)]))
}

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
