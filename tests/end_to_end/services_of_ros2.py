"""A robot's node in rclpy beside clients of a server: services both ways, as a line of JSON.

Run with the Python that has rclpy, and the URL of the server.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, TypeAlias

import cbor2
import rclpy
import roslibpy
import websockets.sync.client
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger
from test_msgs.srv import BasicTypes

from rosbridge_sim.client import AsyncClient, ServiceRefusedError

Ros: TypeAlias = Any
"""An object of rclpy or roslibpy."""

NUM_CALLS = 1_000
URL = sys.argv[1]
FIELDS = ("int64_value", "uint8_value", "float64_value", "string_value", "bool_value")


def values_of(i: int) -> dict[str, Any]:
    return dict(zip(FIELDS, (i - 2**40, i % 256, i / 7, f"text {i} \u2713", i % 2 == 0), strict=True))


def echo(request: BasicTypes.Request, response: BasicTypes.Response) -> BasicTypes.Response:
    for name in BasicTypes.Request.get_fields_and_field_types():
        setattr(response, name, getattr(request, name))
    return response


def wait_until(is_so: Callable[[], object], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.02)


def doomed() -> None:
    """A node whose service never answers."""
    rclpy.init()
    node = rclpy.create_node("doomed")
    node.create_service(Trigger, "/doomed", lambda _request, _response: time.sleep(600))
    rclpy.spin(node)


async def call_node(told: dict[str, Any]) -> None:
    async with AsyncClient(URL, timeout=30.0) as client:

        async def is_known(name: str) -> bool:
            return name in (await client.call("/rosapi/services"))["services"]

        while not (await is_known("/echo") and await is_known("/doomed")):  # noqa: ASYNC110 - no event tells it
            await asyncio.sleep(0.05)
        wrong = 0
        for i in range(NUM_CALLS):
            answer = await client.call("/echo", values_of(i))
            wrong += {name: answer[name] for name in FIELDS} != values_of(i)
        told["wrong"]["web to node"] = wrong
        answers = await asyncio.gather(*(client.call("/echo", values_of(i)) for i in range(20)))
        told["at once"]["web to node"] = sum(
            {name: answer[name] for name in FIELDS} == values_of(i) for i, answer in enumerate(answers)
        )
        told["unknown"] = await refusal(client, "/nobody")


async def refusal(client: AsyncClient, name: str) -> str:
    try:
        await client.call(name, {}, timeout=60.0)
    except ServiceRefusedError as error:
        return str(error.reason)
    return "it was answered"


async def call_doomed(told: dict[str, Any], pid: int) -> None:
    async with AsyncClient(URL, timeout=60.0) as client:
        with websockets.sync.client.connect(URL) as socket:
            call = {"op": "call_service", "service": "/doomed", "type": "std_srvs/Trigger", "timeout": 0.5}
            socket.send(json.dumps(call))
            told["hanging"] = json.loads(socket.recv(timeout=30.0))["values"]
        waiting = asyncio.create_task(refusal(client, "/doomed"))
        await asyncio.sleep(1.0)
        os.kill(pid, 9)
        told["killed"] = await waiting


def call_client(node: Ros, told: dict[str, Any]) -> None:
    """Call services of a roslibpy client from the node."""
    ros = roslibpy.Ros(*URL.removeprefix("ws://").strip("/").split(":")[:1], int(URL.rpartition(":")[2].strip("/")))
    ros.run()

    def answer(request: Ros, response: Ros) -> bool:
        response.update(request)
        return True

    def fail(_request: Ros, _response: Ros) -> bool:
        return False

    roslibpy.Service(ros, "/web_echo", "test_msgs/BasicTypes").advertise(answer)
    roslibpy.Service(ros, "/web_fails", "std_srvs/Trigger").advertise(fail)
    client = node.create_client(BasicTypes, "/web_echo")
    failing = node.create_client(Trigger, "/web_fails")
    assert client.wait_for_service(30.0)
    assert failing.wait_for_service(30.0)

    def send(i: int) -> Ros:
        return client.call_async(BasicTypes.Request(**values_of(i)))

    def is_right(i: int, future: Ros) -> bool:
        wait_until(future.done)
        return {name: getattr(future.result(), name) for name in FIELDS} == values_of(i)

    told["wrong"]["node to web"] = sum(not is_right(i, send(i)) for i in range(NUM_CALLS))
    futures = [send(i) for i in range(20)]
    told["at once"]["node to web"] = sum(is_right(i, future) for i, future in enumerate(futures))
    future = failing.call_async(Trigger.Request())
    wait_until(future.done)
    told["failed"] = [future.result().success, future.result().message]
    ros.close()


def call_by_cbor(told: dict[str, Any]) -> None:
    with websockets.sync.client.connect(URL) as socket:
        args = {"string_value": "over CBOR"}
        socket.send(cbor2.dumps({"op": "call_service", "service": "/echo", "args": args}))
        frame = socket.recv(timeout=30.0)
        answer = cbor2.loads(frame) if isinstance(frame, bytes) else json.loads(frame)
        told["cbor"] = answer["values"]["string_value"]


def main() -> None:
    if len(sys.argv) > 2:
        doomed()
        return
    victim = subprocess.Popen([sys.executable, __file__, URL, "doomed"])
    try:
        drive(victim.pid)
    finally:
        victim.kill()
    os._exit(0)  # without the threads of the libraries


def drive(victim: int) -> None:
    rclpy.init()
    node = rclpy.create_node("robot")
    node.create_service(BasicTypes, "/echo", echo)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    told: dict[str, Any] = {"wrong": {}, "at once": {}}
    asyncio.run(call_node(told))
    call_by_cbor(told)
    call_client(node, told)
    asyncio.run(call_doomed(told, victim))
    sys.stdout.write(json.dumps(told))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
