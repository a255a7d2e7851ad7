// `node faults.mjs LIBRARY PORT watch NUMBER TOPICS`: what faults.py does.
import { ask, call, open, roslib, say, words } from './roslib.mjs'

const [number, ...topics] = words
const ros = await open()
const heard = Object.fromEntries(topics.map((topic) => [topic, []]))
const beside = Object.fromEntries(topics.map((topic) => [topic, []]))

const all = ask((done) => {
  for (const name of topics) {
    new roslib.Topic({ ros, name, messageType: 'std_msgs/Float64' }).subscribe(({ data }) => {
      if (heard[name].length < Number(number)) {
        heard[name].push(data)
        beside[name].push(heard['/plain'].at(-1) ?? null)
      }
      if (topics.every((topic) => heard[topic].length === Number(number))) done()
    })
  }
})

const sent = { '/lost': [], '/twice': [] }
const back = ask((done) => {
  for (const name in sent) {
    const own = new roslib.Topic({ ros, name, messageType: 'std_msgs/Float64' })
    own.subscribe(({ data }) => {
      sent[name].push(data)
      if (sent['/twice'].length === 2 * Number(number)) done()
    })
    for (let data = 0; data < Number(number); data++) own.publish({ data })
  }
})

const answers = {}
for (const name of ['/failing', '/slow']) {
  const began = performance.now()
  answers[name] = await call(ros, name, 'std_srvs/Trigger').catch((error) => error.message)
  answers[`${name} seconds`] = (performance.now() - began) / 1000
}
await all
await back
const closed = ask((done) => ros.on('close', done))
call(ros, '/mock/set_fault', 'rosbridge_sim_msgs/SetMockFault', { name: 'close', active: true }).catch(() => {})
const { code, reason } = await closed
say({ heard, beside, sent, answers, closed: { code: code ?? null, reason: String(reason ?? '') } })
process.exit()
