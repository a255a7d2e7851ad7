"""A node in rclpy that ticks the world by a service, and what it has heard of each tick when the answer comes, as JSON.

Run with the Python that has rclpy. The wheels lack the types of our own services for ticks, so this server offers a
`std_srvs/Trigger` that steps the world by the service for clients, in one turn of its loop.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from pathlib import Path
from typing import Any, Final

import msgspec

from rosbridge_sim import Simulator
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Answer, Call

DOMAIN: Final = 78
NUM_TICKS: Final = 200
NUM_WHOLE: Final = 5
"""Ticks in a row with all their messages, after which ticks are counted."""


class Ticker(Participant):
    """The master of synchronous mode, and the provider of `/tick`."""

    name = address = "/ticker"

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.type = bus.provide(self, "/tick", "std_srvs/Trigger", self.tick).type

    def notify(self, level: str, text: str) -> None:
        raise AssertionError(f"{level}: {text}")

    def start(self) -> None:
        command = {"user_id": "ticker", "start_sync_mode": True, "time_step": 20}
        self.call("/SyncModeCmd", {"request": command}, self.check)

    def call(self, name: str, args: dict[str, Any], on_answer: Any) -> None:  # noqa: ANN401 - see `Bus.call`
        body = msgspec.Raw(json.dumps(args).encode())
        self.bus.call(self, name, body, on_answer, now=asyncio.get_running_loop().time())

    def check(self, answer: Answer) -> None:
        assert answer.is_ok, answer.values

    def tick(self, call: Call, _now: float) -> None:
        def on_answer(answer: Answer) -> None:
            self.check(answer)
            call.answer(self.type.response.check({"success": True}, 0))

        self.call("/sim/step", {"user_id": "ticker", "n": 1}, on_answer)


async def serve() -> None:
    async with Simulator(port=0, ros2_domain=DOMAIN, ros2_through="rclpy") as sim:
        assert sim.bus is not None
        Ticker(sim.bus).start()
        own = {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        node = await asyncio.create_subprocess_exec(sys.executable, __file__, "node", env=os.environ | own)
        assert await node.wait() == 0
    os._exit(0)  # without the threads of the libraries


def node() -> None:
    import rclpy  # noqa: PLC0415 - in this program alone
    from rosgraph_msgs.msg import Clock  # noqa: PLC0415
    from sensor_msgs.msg import Imu  # noqa: PLC0415
    from std_srvs.srv import Trigger  # noqa: PLC0415

    rclpy.init()
    own = rclpy.create_node("driver")
    stamps: dict[str, list[int]] = {"/clock": [], "/imu": []}

    def hear(topic: str, stamp: Any) -> None:  # noqa: ANN401 - of rclpy
        stamps[topic].append(stamp.sec * 10**9 + stamp.nanosec)

    own.create_subscription(Clock, "/clock", lambda message: hear("/clock", message.clock), 100)
    own.create_subscription(Imu, "/imu", lambda message: hear("/imu", message.header.stamp), 100)
    tick = own.create_client(Trigger, "/tick")

    def run() -> None:
        future = tick.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(own, future)
        assert future.result().success

    def counts() -> list[int]:
        return [len(known) for known in stamps.values()]

    # The first messages may be lost and sent again, until both sides of a subscription know each other.
    num_whole = 0
    while num_whole < NUM_WHOLE:
        if tick.wait_for_service(0.1):
            before = counts()
            run()
            num_whole = num_whole + 1 if counts() == [num + 1 for num in before] else 0
    for known in stamps.values():
        known.clear()
    heard = []
    for _ in range(NUM_TICKS):
        run()
        heard.append([len(stamps["/clock"]), len(stamps["/imu"])])
    sys.stdout.write(json.dumps({"heard": heard, "stamps": stamps}))
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2]))
    node() if len(sys.argv) > 1 else asyncio.run(serve())
