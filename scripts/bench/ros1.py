"""CPU time of a server that is a node of ROS 1, with real nodes of rospy on loopback.

The first tables: a node publishes pictures of 100 kB at 30 Hz, and a client of the server subscribes in each encoding;
then poses at 500 Hz, for ten clients. The floor is the server with the same subscription at the node and no client
that it writes to. The third one: a node drives in synchronous mode, by SyncModeCtrlCmd and SyncModeWaitForTick in each
tick. The last one: a camera of 30 Hz, a lidar of 10 Hz and the world's own `/Ego_topic` of 50 Hz into one node, with
both programs on one core. Pictures and clouds are made before, because drawing them takes a core of its own.

Needs ROS 1 of Debian: ./scripts/test --long installs it.

    ./.venv/bin/python scripts/bench/ros1.py [--seconds 10]
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim import Simulator
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.schema.definitions.md5 import service_md5
from rosbridge_sim.schema.definitions.typedefs import full_text
from rosbridge_sim.schema.message import Message
from scripts.bench.core import PATHS
from scripts.bench.program import machine

PEER = Path(__file__).with_name("ros1_peer.py")
PYTHON = "/usr/bin/python3"
RATES = {"picture": 30, "pose": 500}
TYPES = {"picture": "sensor_msgs/CompressedImage", "pose": "geometry_msgs/PoseStamped"}
SERVICES = ("MoraiSyncModeCmdSrv", "MoraiWaitForTickSrv", "MoraiSyncModeCtrlCmdSrv")
PICTURE, CLOUD = 100_000, 572_000
"""Size of a picture and of a cloud of the sensors of `--sensors teaching` [bytes]."""


class Camera(Participant):
    """Publishes pictures and clouds on the bus of a server."""

    name = "/camera"

    def notify(self, level: str, text: str) -> None:
        """Print a notice."""
        print(level, text, file=sys.stderr)

    async def run(self, bus: Bus, seconds: float) -> None:
        """Publish at 30 and 10 Hz."""
        loop = asyncio.get_running_loop()
        topics = {
            name: (bus.advertise(self, name, kind), size)
            for name, kind, size in (
                ("/picture", "sensor_msgs/CompressedImage", PICTURE),
                ("/cloud", "sensor_msgs/PointCloud2", CLOUD),
            )
        }
        start = loop.time()
        for i in range(int(seconds * 30)):
            await asyncio.sleep(start + i / 30 - loop.time())
            for name in ("/picture", "/cloud") if i % 3 == 0 else ("/picture",):
                topic, size = topics[name]
                bus.announce(self, topic, Message(topic.type, topic.type.check({"data": bytes(size)}, 0)), loop.time())


async def listen(url: str, subscribe: str, num: int) -> None:
    """Subscribe as some clients, until the end."""
    clients = [await connect(url, max_size=None, compression=None) for _ in range(num)]
    for client in clients:
        await client.send(subscribe)
    print("ready", flush=True)

    async def read(client: ClientConnection) -> None:
        async for _ in client:
            pass

    await asyncio.gather(*map(read, clients))


async def start(*command: str | Path, env: Mapping[str, str]) -> asyncio.subprocess.Process:
    """Start a program and wait for its first line."""
    pipe = asyncio.subprocess.PIPE
    program = await asyncio.create_subprocess_exec(*map(str, command), env=env, stdin=pipe, stdout=pipe)
    assert program.stdout is not None
    await program.stdout.readline()
    return program


async def messages_to_clients(env: Mapping[str, str], seconds: float, what: str, clients: int, encoding: str) -> float:
    """Return the server's CPU time for a message from a node to clients [ms].

    Args:
        what: `picture` of 100 kB at 30 Hz, or `pose` at 500 Hz.
        clients: number of clients.
        encoding: of their subscriptions; empty for clients that have their messages throttled away.
    """
    subscribe: dict[str, Any] = {"op": "subscribe", "topic": f"/{what}", "type": TYPES[what]}
    subscribe |= {"compression": encoding} if encoding else {"throttle_rate": 10**6}
    options: Any = {"world": False, "data_dir": env["ROS_HOME"], "ros1_master": env["ROS_MASTER_URI"]}
    async with Simulator(port=0, **options) as sim:
        programs = [await start(PYTHON, PEER, what, env=env)]
        # The clients are another process, so that the CPU time is the server's alone.
        words = ("--client", sim.url, json.dumps(subscribe), str(clients))
        programs.append(await start(sys.executable, __file__, *words, env=env))
        await asyncio.sleep(3)
        assert sim.bus is not None
        before, num = time.process_time(), sim.bus.delivery.num_published
        await asyncio.sleep(seconds)
        cpu, num = time.process_time() - before, sim.bus.delivery.num_published - num
        for program in programs:
            program.kill()
            await program.wait()
        if num < seconds * RATES[what] * 0.8:
            raise SystemExit(f"the node is too slow: {num} messages in {seconds:g} s")
        return cpu / num * 1e3


async def ticks_of_node(env: Mapping[str, str], *, is_persistent: bool) -> tuple[float, float]:
    """Return the median time of a tick by services for a node, and the server's CPU time for it [ms]."""
    options: Any = {"data_dir": env["ROS_HOME"], "ros1_master": env["ROS_MASTER_URI"], "start": "sync"}
    async with Simulator(port=0, scenario=str(PATHS), **options) as sim:
        node = sim.node
        assert sim.bus is not None
        assert node is not None
        types = Path(env["ROS_HOME"], "services.json")
        found = {name: sim.bus.store.service(f"morai_msgs/{name}") for name in SERVICES}
        texts = {
            name: [*map(full_text, parts), service_md5(*parts)]
            for name, parts in ((name, (one.request.spec, one.response.spec)) for name, one in found.items())
        }
        types.write_text(json.dumps(texts), encoding="utf-8")  # noqa: ASYNC240 - before
        peer = await start(PYTHON, PEER, "tick", types, str(int(is_persistent)), env=env)
        assert peer.stdout is not None
        before, frame = time.process_time(), node.world.frame
        told = json.loads(await peer.stdout.readline())
        cpu = time.process_time() - before
        await peer.wait()
        return told["median"] * 1e3, cpu / (node.world.frame - frame) * 1e3


async def sensors_to_node(env: Mapping[str, str], seconds: float) -> tuple[dict[str, float], float, float]:
    """Return the rates in a node [Hz] and the shares of a core that the server and the node take."""
    core = min(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    options: Any = {"data_dir": env["ROS_HOME"], "ros1_master": env["ROS_MASTER_URI"]}
    async with Simulator(port=0, **options) as sim:
        bus = sim.bus
        assert bus is not None
        types = Path(env["ROS_HOME"], "ego.txt")
        types.write_text(bus.store.full_text("morai_msgs/EgoVehicleStatus"), encoding="utf-8")  # noqa: ASYNC240 - before
        peer = await start("taskset", "-c", str(core), PYTHON, PEER, "count", types, env=env)
        assert peer.stdin is not None
        assert peer.stdout is not None
        camera = asyncio.create_task(Camera().run(bus, seconds + 6))
        await asyncio.sleep(4)
        seen = []
        for pause in (seconds, 0.0):
            peer.stdin.write(b"\n")
            seen.append((json.loads(await peer.stdout.readline()), time.process_time(), time.monotonic()))
            await asyncio.sleep(pause)
        peer.kill()
        await peer.wait()
        camera.cancel()
    (first, cpu1, t1), (last, cpu2, t2) = seen
    rates = {topic: (last["counts"][topic] - num) / (t2 - t1) for topic, num in first["counts"].items()}
    return rates, (cpu2 - cpu1) / (t2 - t1), (last["cpu"] - first["cpu"]) / (t2 - t1)


async def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement [%(default)s]")
    parser.add_argument("--client", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.client:
        url, subscribe, num = arguments.client
        await listen(url, subscribe, int(num))
        return
    seconds = arguments.seconds
    print(machine())
    with tempfile.TemporaryDirectory() as folder, socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
        probe.close()
        own = {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": folder}
        env = {**os.environ, **own, "ROS_LOG_DIR": folder}
        master = await asyncio.create_subprocess_exec("rosmaster", "--core", "-p", str(port), env=env)
        await asyncio.sleep(2)
        try:
            for what, clients in (("picture", 1), ("pose", 10)):
                print(f"\n| {what} at {RATES[what]} Hz, node to {clients} | server's CPU for each [ms] |\n|---|---|")
                for name, encoding in (("no client", ""), ("JSON", "none"), ("CBOR", "cbor"), ("cbor-raw", "cbor-raw")):
                    cpu = await messages_to_clients(env, seconds, what, clients, encoding)
                    print(f"| {name} | {cpu:.3f} |", flush=True)
            print("\n| tick by services, rospy | median [ms] | server's CPU [ms] |\n|---|---|---|")
            for name, is_persistent in (("persistent", True), ("a connection for each call", False)):
                median, cpu = await ticks_of_node(env, is_persistent=is_persistent)
                print(f"| {name} | {median:.2f} | {cpu:.2f} |", flush=True)
            rates, server, node = await sensors_to_node(env, seconds)
            print("\n| into one node, one core for both | Hz |\n|---|---|")
            for topic, rate in rates.items():
                print(f"| `{topic}` | {rate:.1f} |")
            print(f"\nserver {server:.0%} of the core, node {node:.0%}")
        finally:
            master.terminate()
            await master.wait()


if __name__ == "__main__":
    asyncio.run(main())
