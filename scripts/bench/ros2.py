"""CPU time of a server that is a node of ROS 2, with real nodes of rclpy on loopback.

A node publishes pictures of 100 kB at 30 Hz, and a client of the server subscribes in each encoding. The floor is the
server with the same subscription at the node and no client that it writes to. Then a node publishes a pose at 500 Hz
for ten clients. Each row through rclpy and through the DDS library.

Needs rclpy: ./scripts/test --long installs it.

    ./.venv/rclpy/bin/python scripts/bench/ros2.py [--seconds 10] [--rounds 3]
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import statistics
import sys
import time
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim import Simulator
from scripts.bench.program import machine
from scripts.bench.ros1 import listen, start

DOMAIN: Final = 83
PICTURE: Final = 100_000
"""Size of a picture [bytes]."""

Row = tuple[str, str, str, float, int]
ROWS: Final[tuple[Row, ...]] = (
    ("picture, no client", "/picture", "", 30.0, 1),
    ("picture, JSON", "/picture", "none", 30.0, 1),
    ("picture, CBOR", "/picture", "cbor", 30.0, 1),
    ("picture, cbor-raw", "/picture", "cbor-raw", 30.0, 1),
    ("pose at 500 Hz, ten clients, JSON", "/pose", "none", 500.0, 10),
    ("pose at 500 Hz, ten clients, CBOR", "/pose", "cbor", 500.0, 10),
)
"""Name, topic, compression of the clients (empty: their messages are throttled away), rate [Hz], number of clients."""


def publish(topic: str, rate: float) -> None:
    """Publish in a node until the end."""
    import rclpy  # noqa: PLC0415 - for this program alone
    from geometry_msgs.msg import PoseStamped  # noqa: PLC0415
    from sensor_msgs.msg import CompressedImage  # noqa: PLC0415

    rclpy.init()
    node = rclpy.create_node("peer")
    message = PoseStamped() if topic == "/pose" else CompressedImage(format="jpeg", data=bytes(PICTURE))
    message.header.frame_id = "map"
    publisher = node.create_publisher(type(message), topic, 10)
    print("ready", flush=True)
    begin, num = time.monotonic(), 0
    while True:
        num += 1
        time.sleep(max(0.0, begin + num / rate - time.monotonic()))
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)


async def cost(through: Any, row: Row, seconds: float) -> float:  # noqa: ANN401 - "rclpy" or "dds"
    """Return the server's CPU time for a message [ms]."""
    _, topic, compression, rate, num_clients = row
    kind = "geometry_msgs/PoseStamped" if topic == "/pose" else "sensor_msgs/CompressedImage"
    subscribe: dict[str, Any] = {"op": "subscribe", "topic": topic, "type": kind}
    subscribe |= {"compression": compression} if compression else {"throttle_rate": 10**6}
    env = os.environ | {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    async with Simulator(port=0, world=False, ros=2, ros2_domain=DOMAIN, ros2_through=through) as sim:
        assert sim.bus is not None
        own = sys.executable, __file__
        programs = [await start(*own, "--peer", topic, str(rate), env=env)]
        # The clients are other processes, so that the CPU time is the server's alone.
        words = ("--clients", str(num_clients), sim.url, json.dumps(subscribe))
        programs.append(await start(*own, *words, env=env))
        await asyncio.sleep(3)
        before, num = time.process_time(), sim.bus.delivery.num_published
        await asyncio.sleep(seconds)
        cpu, num = time.process_time() - before, sim.bus.delivery.num_published - num
        for program in programs:
            program.kill()
            await program.wait()
    if num < seconds * rate * 0.8:
        raise SystemExit(f"the node is too slow: {num} messages in {seconds:g} s")
    return cpu / num * 1e3


async def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement [%(default)s]")
    parser.add_argument("--rounds", type=int, default=3, help="of which the median is told [%(default)s]")
    parser.add_argument("--only", default="", help="rows whose name has this text")
    parser.add_argument("--through", default="rclpy,dds", help="[%(default)s]")
    parser.add_argument("--peer", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--clients", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.peer:
        publish(arguments.peer[0], float(arguments.peer[1]))
    if arguments.clients:
        num, url, subscribe = arguments.clients
        await listen(url, subscribe, int(num))
        return
    ways = arguments.through.split(",")
    print(f"{machine()}\n\n| server's CPU for each message [ms] | {' | '.join(ways)} |\n|---|{'---|' * len(ways)}")
    for row in ROWS:
        if arguments.only in row[0]:
            rounds = [[await cost(way, row, arguments.seconds) for way in ways] for _ in range(arguments.rounds)]
            told = (statistics.median(one) for one in zip(*rounds, strict=True))
            print(f"| {row[0]} | {' | '.join(f'{one:.2f}' for one in told)} |", flush=True)
    sys.stdout.flush()
    os._exit(0)  # without the threads of the libraries


if __name__ == "__main__":
    asyncio.run(main())
