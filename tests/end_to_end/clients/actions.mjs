// `node actions.mjs LIBRARY PORT ROLE NAME TYPE`: what actions.py does; and `perform`, an action of ROS 2.
import { ask, open, role, roslib, say, serve, settle, words } from './roslib.mjs'

const ENDLESS = 100
const [name, type] = words

// What is known after each step, [0, 1, 1] and [0, 1, 1, 2] and so on; an endless order stops after the first and waits.
function stepsTo(order) {
  const steps = [[0, 1, 1]]
  while (order < ENDLESS && steps.length < order - 1) {
    const last = steps.at(-1)
    steps.push([...last, last.at(-1) + last.at(-2)])
  }
  return steps
}

// ROS 1: five topics

async function performOverTopics() {
  const server = new roslib.SimpleActionServer({ ros, serverName: name, actionName: `${type}Action` })
  server.on('goal', ({ order }) => {
    const steps = stepsTo(order)
    for (const sequence of steps) server.sendFeedback({ sequence })
    if (order < ENDLESS) server.setSucceeded({ sequence: steps.at(-1) })
  })
  server.on('cancel', () => server.setPreempted())
  await settle(ros)
  say({ ready: name })
  await serve()
  ros.close()
  process.exit() // its timer would go on for ever
}

async function askOverTopics() {
  const client = new roslib.ActionClient({ ros, serverName: name, actionName: `${type}Action` })
  await ask((done) => client.statusListener.subscribe(done))
  const follow = (order, onFeedback) =>
    ask((done) => {
      const goal = new roslib.Goal({ actionClient: client, goalMessage: { order } })
      const feedback = []
      let status
      goal.on('status', (message) => (status = message.status))
      goal.on('feedback', ({ sequence }) => {
        feedback.push(sequence)
        onFeedback?.(goal)
      })
      goal.on('result', ({ sequence }) => done({ feedback, sequence, status }))
      goal.send()
    })
  const whole = await follow(5)
  const cancelled = await follow(ENDLESS, (goal) => goal.cancel())
  const cancelled_by_all = await follow(ENDLESS, () => client.cancel())
  const servers = await ask((done, failed) => ros.getActionServers(done, failed))
  client.dispose()
  await settle(ros)
  say({ whole, cancelled, cancelled_by_all, is_listed: servers.includes(name) })
}

// ROS 2: ops of their own

async function perform() {
  const action = new roslib.Action({ ros, name, actionType: type })
  action.advertise(
    ({ order }, id) => {
      if (order < 0) return action.setFailed(id)
      const steps = stepsTo(order)
      for (const sequence of steps) action.sendFeedback(id, { sequence })
      if (order < ENDLESS) action.setSucceeded(id, { sequence: steps.at(-1) })
    },
    (id) => action.setCanceled(id, { sequence: stepsTo(ENDLESS)[0] }),
  )
  await settle(ros)
  say({ ready: name })
  await serve()
  action.unadvertise()
  await settle(ros)
}

async function send() {
  const action = new roslib.Action({ ros, name, actionType: type })
  const follow = (order, onFeedback) =>
    ask((done) => {
      const feedback = []
      const id = action.sendGoal(
        { order },
        ({ sequence }) => done({ feedback, sequence }),
        ({ sequence }) => {
          feedback.push(sequence)
          onFeedback?.(id)
        },
        (error) => done({ feedback, error }),
      )
    })
  const whole = await follow(5)
  const cancelled = await follow(ENDLESS, (id) => action.cancelGoal(id))
  const cancelled_by_all = await follow(ENDLESS, () => action.cancelAllGoals())
  const failed = await follow(-1)
  const servers = await ask((done, failed) => ros.getActionServers(done, failed))
  say({ whole, cancelled, cancelled_by_all, failed, is_listed: servers.includes(name) })
}

const ros = await open()
await { perform_over_topics: performOverTopics, ask_over_topics: askOverTopics, perform, send }[role]()
ros.close()
