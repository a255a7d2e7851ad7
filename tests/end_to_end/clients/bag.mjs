// `node bag.mjs FILE`: what Foxglove's readers find in a bag, as one line of JSON: [topic, stamp in ns as text, message].
import { open } from 'node:fs/promises'

import rosbag from '@foxglove/rosbag'
import rosbagFile from '@foxglove/rosbag/node.js'
import rosmsg from '@lichtblick/rosmsg'
import ros2 from '@lichtblick/rosmsg2-serialization'
import { McapIndexedReader } from '@mcap/core'

const [path] = process.argv.slice(2)
const seen = []

if (path.endsWith('.bag')) {
  const bag = new rosbag.Bag(new rosbagFile.FileReader(path))
  await bag.open()
  for await (const { topic, timestamp, message } of bag.messageIterator()) {
    seen.push([topic, String(BigInt(timestamp.sec) * 1_000_000_000n + BigInt(timestamp.nsec)), message])
  }
} else {
  const file = await open(path)
  const size = async () => BigInt((await file.stat()).size)
  const read = async (offset, length) => {
    const { buffer } = await file.read({ buffer: Buffer.alloc(Number(length)), position: Number(offset) })
    return new Uint8Array(buffer.buffer, buffer.byteOffset, Number(length))
  }
  const bag = await McapIndexedReader.Initialize({ readable: { size, read } })
  const readers = new Map()
  for await (const { channelId, logTime, data } of bag.readMessages()) {
    const { topic, schemaId } = bag.channelsById.get(channelId)
    if (!readers.has(schemaId)) {
      const text = new TextDecoder().decode(bag.schemasById.get(schemaId).data)
      readers.set(schemaId, new ros2.MessageReader(rosmsg.parse(text, { ros2: true })))
    }
    seen.push([topic, String(logTime), readers.get(schemaId).readMessage(data)])
  }
  await file.close()
}
console.log(JSON.stringify(seen, (_, value) => (typeof value === 'bigint' ? Number(value) : value)))
