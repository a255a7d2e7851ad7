"""A roslibpy program: `roslibpy_client.py TRANSPORT PORT drive|serve|call [SERVICE]`.

The programs in this folder do the same things, each with its own library, and say what they saw in lines of JSON.
"""

from __future__ import annotations

import json
import math
import sys
import threading
from collections.abc import Callable
from typing import Any

import roslibpy

PATIENCE = 20.0
ADD = "example_interfaces/AddTwoInts"


def say(**seen: object) -> None:
    print(json.dumps(seen), flush=True)  # noqa: T201 - this is a program, and its output is what the test reads


def drive(ros: roslibpy.Ros) -> None:
    """Look around, then drive the car in real time until it has moved two metres, and stop it."""
    topics = ros.get_topics()
    when = ros.get_time()
    param = roslibpy.Param(ros, "/seen_by/roslibpy")
    param.set({"text": "안녕", "list": [1, 2.5, None]}, timeout=PATIENCE)
    value = param.get(timeout=PATIENCE)

    places: list[tuple[float, float]] = []
    has_moved = threading.Event()

    def on_status(status: dict[str, Any]) -> None:
        places.append((status["position"]["x"], status["position"]["y"]))
        if math.dist(places[0], places[-1]) > 2.0:
            has_moved.set()

    ego = roslibpy.Topic(ros, "/Ego_topic", "morai_msgs/EgoVehicleStatus")
    ego.subscribe(on_status)
    controls = roslibpy.Topic(ros, "/ctrl_cmd", "morai_msgs/CtrlCmd")
    controls.advertise()
    command = {"longlCmdType": 1, "accel": 0.6, "brake": 0.0, "steering": 0.02}
    for _ in range(int(PATIENCE / 0.05)):
        controls.publish(roslibpy.Message(command))
        if has_moved.wait(0.05):
            break
    controls.publish(roslibpy.Message({"longlCmdType": 1, "brake": 1.0}))
    ego.unsubscribe()
    controls.unadvertise()
    ros.get_time()  # answered after all that was sent before it
    say(
        topics=topics,
        topic_type=ros.get_topic_type("/Ego_topic"),
        services=ros.get_services(),
        nodes=ros.get_nodes(),
        time=when.to_sec(),
        param=value,
        first=places[0],
        last=places[-1],
    )


def serve(ros: roslibpy.Ros, name: str) -> None:
    """Add numbers for others until stdin ends."""

    def add(request: dict[str, int], response: roslibpy.ServiceResponse) -> bool:
        response["sum"] = request["a"] + request["b"]
        return bool(request["a"] >= 0)

    service = roslibpy.Service(ros, name, ADD)
    service.advertise(add)
    say(ready=ros.get_service_type(name))
    sys.stdin.read()
    service.unadvertise()
    ros.get_time()


def call(ros: roslibpy.Ros, name: str) -> None:
    """Have numbers added by another; then once more, in a way that it refuses."""
    service = roslibpy.Service(ros, name, ADD)
    answer = service.call(roslibpy.ServiceRequest({"a": 20, "b": 22}), timeout=PATIENCE)
    refusal = None
    try:
        service.call(roslibpy.ServiceRequest({"a": -1, "b": 0}), timeout=PATIENCE)
    except roslibpy.core.ServiceException as error:
        refusal = str(error)
    say(sum=answer["sum"], is_refused=refusal is not None)


def main() -> None:
    transport, port, role, *rest = sys.argv[1:]
    ros = roslibpy.Ros("127.0.0.1", int(port), transport=transport)
    ros.run(timeout=PATIENCE)
    try:
        roles: dict[str, Callable[..., None]] = {"drive": drive, "serve": serve, "call": call}
        roles[role](ros, *rest)
    finally:
        ros.terminate()


main()
