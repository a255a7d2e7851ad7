"""Nodes of ROS 2 that come and go beside a server through rclpy: it must end with what it had at the beginning.

A second program makes one node after the other, each as a program of its own on the graph, with a topic in each
direction, a service, an action and parameters. A client uses them, and the node uses a service of the client. Most
nodes leave in order; every tenth is killed. Then descriptors, threads and tasks of the server, and what its bus knows
of nodes, are compared with those after the first nodes.

    ./.venv/rclpy/bin/python scripts/soak/ros2_nodes.py [--seconds 600]
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from websockets.sync.client import connect

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim import Simulator

DOMAIN: Final = 85
WARM_UP: Final = 12
"""Nodes before the first count: caches of types and threads of the library are full then, and one was killed."""

KILLED: Final = 10
"""One of so many nodes is killed."""

FORGOTTEN: Final = 15.0
"""Longer than the server knows the type of a topic that has gone [s]."""

PATIENCE: Final = 60.0
"""Longest wait for the graph [s]: a killed node is seen to be gone after 20 s."""


def wait_until(is_so: Callable[[], object], what: str) -> None:
    """Wait for something.

    Raises:
        SystemExit: it does not come.
    """
    end = time.monotonic() + PATIENCE
    while not is_so():
        if time.monotonic() > end:
            raise SystemExit(f"waited in vain until {what}")
        time.sleep(0.03)


class Web:
    """A client of the server.

    Attributes:
        heard: messages that have come.
    """

    def __init__(self, url: str) -> None:
        self.heard: list[object] = []
        self._socket = connect(url, compression=None, legacy=True)

    def say(self, op: str, **fields: object) -> None:
        """Send a frame."""
        self._socket.send(json.dumps({"op": op, **fields}))

    def call(self, service: str, **args: object) -> dict[str, Any]:
        """Return the answer of a service, after what has come before it."""
        self.say("call_service", service=service, args=args)
        while True:
            frame = json.loads(self._socket.recv(timeout=PATIENCE))
            if frame["op"] == "service_response":
                if not frame["result"]:
                    raise SystemExit(f"{service}: {frame['values']}")
                return dict(frame["values"])
            self.heard.append(frame)

    def answer(self) -> None:
        """Answer the calls of a service until the end."""
        for text in self._socket:
            frame = json.loads(text)
            known = {"service": frame["service"], "id": frame["id"]}
            self.say("service_response", values={"success": True}, result=True, **known)

    def close(self) -> None:
        """Leave."""
        self._socket.close()


def live(url: str, num: int) -> None:
    """Be one node from its beginning to its end."""
    import rclpy  # noqa: PLC0415 - for this program alone
    from rclpy.action import ActionServer  # noqa: PLC0415
    from rclpy.executors import SingleThreadedExecutor  # noqa: PLC0415
    from std_msgs.msg import String  # noqa: PLC0415
    from std_srvs.srv import Trigger  # noqa: PLC0415
    from test_msgs.action import Fibonacci  # noqa: PLC0415

    context = rclpy.Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    name = f"life_{num % 7}"
    node = rclpy.create_node(name, context=context)
    node.declare_parameter("speed", num)
    heard: list[str] = []

    def answer(_request: object, response: Trigger.Response) -> Trigger.Response:
        response.message = str(num)
        return response

    publisher = node.create_publisher(String, f"/{name}/out", 10)
    node.create_subscription(String, f"/{name}/in", lambda message: heard.append(message.data), 10)
    node.create_service(Trigger, f"/{name}/ask", answer)
    actions = ActionServer(node, Fibonacci, f"/{name}/act", lambda goal: goal.succeed() or Fibonacci.Result())
    ask = node.create_client(Trigger, "/web_ask")
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    is_over = threading.Event()

    def spin() -> None:
        while not is_over.is_set():
            executor.spin_once(timeout_sec=0.1)

    thread = threading.Thread(target=spin)
    thread.start()
    client = Web(url)
    client.say("subscribe", topic=f"/{name}/out", type="std_msgs/String")
    client.say("advertise", topic=f"/{name}/in", type="std_msgs/String")

    def exchange() -> bool:
        publisher.publish(String(data="out"))
        client.say("publish", topic=f"/{name}/in", msg={"data": "in"})
        client.call("/rosapi/get_time")
        return bool(client.heard and heard)

    wait_until(lambda: f"/{name}/ask" in client.call("/rosapi/services")["services"], "the service is known")
    assert client.call(f"/{name}/ask")["message"] == str(num)
    assert client.call("/rosapi/get_param", name=f"/{name}:speed")["value"] == str(num)
    wait_until(exchange, "messages have come")
    wait_until(ask.service_is_ready, "the node sees the client's service")
    future = ask.call_async(Trigger.Request())
    wait_until(future.done, "the client's service has answered")
    client.close()
    if num % KILLED == KILLED - 1:
        os._exit(9)
    is_over.set()
    thread.join()
    actions.destroy()
    node.destroy_node()
    context.shutdown()


def live_on(url: str, seconds: float) -> None:
    """Be one node after the other, and write how many there were, after the warm-up and at the end."""
    provider, client = Web(url), Web(url)
    provider.say("advertise_service", service="/web_ask", type="std_srvs/Trigger")
    threading.Thread(target=provider.answer, daemon=True).start()
    end, num = time.monotonic() + seconds, 0

    def has_gone() -> bool:
        return f"/life_{num % 7}/ask" not in client.call("/rosapi/services")["services"]

    while time.monotonic() < end or num < WARM_UP + 2:
        if num % KILLED == KILLED - 1:
            subprocess.run([sys.executable, __file__, "--one", url, str(num)], check=False)  # noqa: S603 - this file
        else:
            live(url, num)
        wait_until(has_gone, "the node has gone")
        num += 1
        if num == WARM_UP:
            pause(num)
    pause(num)


def pause(num: int) -> None:
    """Wait until the server has forgotten the types of topics that have gone, and say how many nodes there were."""
    time.sleep(FORGOTTEN)
    print(num, flush=True)


def count(sim: Simulator) -> dict[str, int]:
    """Return what must not grow."""
    assert sim.bus is not None
    return {
        "descriptors": len(list(Path("/proc/self/fd").iterdir())),
        "threads": threading.active_count(),
        "threads of libraries": len(list(Path("/proc/self/task").iterdir())),
        "tasks": len(asyncio.all_tasks()),
        "topics": len(sim.bus.topics),
        "services": len(sim.bus.services),
        "actions": len(sim.bus.actions.by_name),
        "participants": len(list(sim.bus.owners())),
    }


async def soak(seconds: float) -> dict[str, Any]:
    """Return the counts at the beginning and at the end, the memory [MiB] and the number of nodes."""
    async with Simulator(port=0, world=False, ros=2, ros2_domain=DOMAIN, ros2_through="rclpy") as sim:
        own = (sys.executable, __file__, "--lives", sim.url, str(seconds))
        env = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        peer = await asyncio.create_subprocess_exec(*own, env=env, stdout=asyncio.subprocess.PIPE)
        assert peer.stdout is not None
        told: dict[str, Any] = {}
        try:
            while line := await peer.stdout.readline():
                when = "end" if "begin" in told else "begin"
                told |= {when: count(sim), f"{when} MiB": round(memory(), 1), "nodes": int(line)}
        except BaseException:
            peer.kill()
            raise
        if await peer.wait():
            raise SystemExit("the nodes did not come to their end")
        return told


def memory() -> float:
    """Return the memory of this program [MiB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def main() -> None:
    """Write the counts as JSON; the exit code is 1 if something has grown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0, help="[%(default)s]")
    parser.add_argument("--lives", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        live(arguments.one[0], int(arguments.one[1]))
    elif arguments.lives:
        live_on(arguments.lives[0], float(arguments.lives[1]))
    else:
        told = asyncio.run(soak(arguments.seconds))
        print(json.dumps(told))
        grown = {name for name, num in told["end"].items() if num > told["begin"][name]}
        sys.stdout.flush()
        os._exit(1 if grown else 0)  # without the threads of the libraries
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
