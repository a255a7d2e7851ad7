"""Roles: `drive`, `remember PARAMETER`, `serve SERVICE`, `call SERVICE`, `err` (roslibpy alone).

The programs in this folder do the same things, each with its own library, and say what they saw in lines of JSON.
"""

from __future__ import annotations

import logging
import math
import threading
from typing import Any

import roslibpy

from tests.end_to_end.clients.program import PATIENCE, run, say, serve, settle

ADD = "example_interfaces/AddTwoInts"


def drive(ros: roslibpy.Ros) -> None:
    """Look around, then drive the car in real time until it has moved two metres, and stop it."""
    topics = ros.get_topics()
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
    when = settle(ros)  # of simulation, which a client that is quick finds at 0 before the drive
    say(
        topics=topics,
        topic_type=ros.get_topic_type("/Ego_topic"),
        services=ros.get_services(),
        nodes=ros.get_nodes(),
        time=when,
        first=places[0],
        last=places[-1],
    )


def remember(ros: roslibpy.Ros, name: str) -> None:
    """Set a parameter, look at it, delete it, look again."""
    param = roslibpy.Param(ros, name)
    param.set({"text": "안녕", "list": [1, 2.5, None]}, timeout=PATIENCE)
    kept = param.get(timeout=PATIENCE)
    is_listed = name in ros.get_params()
    param.delete(timeout=PATIENCE)
    say(kept=kept, is_listed=is_listed, is_still_listed=name in ros.get_params(), gone=param.get(timeout=PATIENCE))


def add(ros: roslibpy.Ros, name: str) -> None:
    """Add numbers for others until stdin ends."""

    def answer(request: dict[str, int], response: roslibpy.ServiceResponse) -> bool:
        if request["a"] >= 0:
            response["sum"] = request["a"] + request["b"]
        return False  # as in the library's own test: a sum is an answer all the same

    service = roslibpy.Service(ros, name, ADD)
    service.advertise(answer)
    say(ready=ros.get_service_type(name))
    serve()
    service.unadvertise()
    ros.get_time()  # answered after all that was sent before it


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


def err(ros: roslibpy.Ros) -> None:
    """Make mistakes, and repeat the last line that roslibpy logs of each; then once more with a handler of its own."""
    logged: list[str] = []

    class Last(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            logged.append(str(record.exc_info[1]) if record.exc_info else record.getMessage())

    logging.getLogger("roslibpy").addHandler(Last(logging.WARNING))
    roslibpy.Topic(ros, "/Ego_topic", "std_msgs/String").subscribe(lambda _: None)
    roslibpy.Service(ros, "/not_there", "std_srvs/Triger").advertise(lambda *_: True)
    controls = roslibpy.Topic(ros, "/ctrl_cmd", "morai_msgs/CtrlCmd")
    controls.publish({"acel": 0.5})
    settle(ros)
    printed = logged.copy()

    shown: list[str] = []
    ros.factory.on_ready(lambda protocol: protocol._message_handlers.update(status=lambda s: shown.append(s["msg"])))
    ros.set_status_level("warning", "show")
    controls.publish({"acel": 0.5})
    settle(ros)
    say(printed=printed, printed_after=logged[len(printed) :], shown=shown)


run(drive=drive, remember=remember, serve=add, call=call, err=err)
