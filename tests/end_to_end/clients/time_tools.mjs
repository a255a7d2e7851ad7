// `node time_tools.mjs LIBRARY PORT branch [PREFIX]`: what time_tools.py does.
import { call, open, say, words } from './roslib.mjs'

const STEP = {
  user_id: 'program',
  n: 30,
  commands: [{ ego: 0, commands: [{ longlCmdType: 1, accel: 0.8 }] }],
  topics: ['/Ego_topic'],
}

const ros = await open()
const prefix = words[0] ?? ''

const ask = (name, request = {}) => {
  const kind = name.replace(/(^|_)(.)/g, (_all, _line, letter) => letter.toUpperCase())
  return call(ros, `/sim/${name}`, `rosbridge_sim_msgs/${prefix}${kind}`, request)
}

const mode = (is_on) =>
  call(ros, '/SyncModeCmd', `morai_msgs/${prefix}MoraiSyncModeCmdSrv`, {
    request: { user_id: 'program', start_sync_mode: is_on, time_step: 20 },
  })

async function goOn() {
  const done = await ask('step', STEP)
  return [done.result, done.steps, done.frame, done.topics[0].message, (await ask('state_hash')).hash]
}

await mode(true)
await ask('reset', { seed: 0 })
await ask('score', { reset: false })
await goOn()
const saved = await ask('snapshot', { id: 'here', with_data: true })
const first = await goOn()
const restored = []
for (const id of ['nowhere', 'here']) restored.push((await ask('restore', { user_id: 'program', id })).message)
const by_name = await goOn()
restored.push((await ask('restore', { user_id: 'program', data: saved.data })).message)
const by_bytes = await goOn()
const names = (await ask('snapshots', { remove: [] })).snapshots.map((one) => one.id)
await ask('snapshots', { remove: ['here'] })
const { distance } = (await ask('score', { reset: true })).scores[0]
await mode(false)
say({ first, by_name, by_bytes, restored, names, distance })
ros.close()
