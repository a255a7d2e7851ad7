// What the JavaScript programs share. Each is run as `node SUBJECT.mjs LIBRARY PORT ROLE [WORDS]`, where LIBRARY is
// `roslib` (2.x), `roslib1` (1.4) or Lichtblick's fork of 1.1: their classes take the same options, and plain objects for
// messages and requests.

const PATIENCE = 60_000 // [ms]

export const [library, port, role, ...words] = process.argv.slice(2)

// The fork is made for browsers and their WebSocket; roslib 2 would take that way, too, if it saw one here.
if (library === '@lichtblick/roslibjs') globalThis.WebSocket ??= (await import('ws')).WebSocket

const exported = await import(library)
export const roslib = exported.default ?? exported

export const say = (seen) => console.log(JSON.stringify(seen))

// What `start(resolve, reject)` comes to, within our patience.
export const ask = (start) =>
  new Promise((resolve, reject) => {
    setTimeout(() => reject(new Error('no answer')), PATIENCE).unref()
    start(resolve, (why) => reject(new Error(`refused: ${why}`)))
  })

export const open = () =>
  ask((done, failed) => {
    const ros = new roslib.Ros()
    ros.on('error', (error) => failed(error.message))
    ros.on('connection', () => done(ros))
    ros.connect(`ws://127.0.0.1:${port}`)
  })

export const call = (ros, name, serviceType, request = {}) =>
  ask((done, failed) => new roslib.Service({ ros, name, serviceType }).callService(request, done, failed))

// Come back once the server has handled all that was sent before.
export const settle = (ros) => call(ros, '/rosapi/get_time', 'rosapi/GetTime')

// What a message of binary frames is in JSON: bytes as base64, numbers in typed arrays as lists.
export function plain(value) {
  if (typeof value === 'bigint') return Number(value)
  if (value instanceof Uint8Array) return Buffer.from(value).toString('base64')
  if (ArrayBuffer.isView(value)) return Array.from(value, plain)
  if (Array.isArray(value)) return value.map(plain)
  if (value === null || typeof value !== 'object') return value
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, plain(inner)]))
}

// Until stdin ends.
export const serve = async () => {
  for await (const _ of process.stdin);
}
