"""Role `watch NUMBER TOPICS`: what a client sees of the faults of a mock, until it closes the connection."""

from __future__ import annotations

import functools
import threading
import time
from typing import Any

import roslibpy

from tests.end_to_end.clients.program import PATIENCE, run, say


def watch(ros: roslibpy.Ros, number: str, *topics: str) -> None:
    """Hear so many messages of each topic, call the services, and have the connection closed."""
    heard: dict[str, list[Any]] = {topic: [] for topic in topics}
    beside: dict[str, list[Any]] = {topic: [] for topic in topics}
    has_heard_all, is_closed = threading.Event(), threading.Event()

    def listen(topic: str) -> None:
        def on_message(msg: dict[str, Any]) -> None:
            if len(heard[topic]) < int(number):
                heard[topic].append(msg["data"])
                beside[topic].append(heard["/plain"][-1] if heard["/plain"] else None)
            if all(len(each) == int(number) for each in heard.values()):
                has_heard_all.set()

        roslibpy.Topic(ros, topic, "std_msgs/Float64").subscribe(on_message)

    for topic in topics:
        listen(topic)
    sent, has_come_back = publish(ros, int(number))
    answers: dict[str, Any] = {}
    for name in ("/failing", "/slow"):
        began = time.monotonic()
        try:
            service = roslibpy.Service(ros, name, "std_srvs/Trigger")
            answers[name] = dict(service.call(roslibpy.ServiceRequest(), timeout=PATIENCE))
        except Exception as error:  # noqa: BLE001 - its class is the library's
            answers[name] = str(error)
        answers[f"{name} seconds"] = time.monotonic() - began
    assert has_heard_all.wait(PATIENCE), {topic: len(each) for topic, each in heard.items()}
    assert has_come_back.wait(PATIENCE), sent
    ros.on("close", lambda *_: is_closed.set())
    request = roslibpy.ServiceRequest({"name": "close", "active": True})
    roslibpy.Service(ros, "/mock/set_fault", "rosbridge_sim_msgs/SetMockFault").call(request, lambda _: None, print)
    assert is_closed.wait(PATIENCE), "the connection stays"
    say(heard=heard, beside=beside, sent=sent, answers=answers)


def publish(ros: roslibpy.Ros, number: int) -> tuple[dict[str, list[float]], threading.Event]:
    """Publish so many messages on two topics, and hear them; return what came and whether all has come back."""
    sent: dict[str, list[float]] = {"/lost": [], "/twice": []}
    has_come_back = threading.Event()

    def hear_own(topic: str, msg: dict[str, Any]) -> None:
        sent[topic].append(msg["data"])
        if len(sent["/twice"]) == 2 * number:
            has_come_back.set()

    for topic in sent:
        own = roslibpy.Topic(ros, topic, "std_msgs/Float64")
        own.subscribe(functools.partial(hear_own, topic))
        own.advertise()
        for value in range(number):
            own.publish(roslibpy.Message({"data": value}))
    return sent, has_come_back


run(watch=watch)
