"""Roles: `talk MESSAGES` (JSON: a list of topic, type and msg), `burst TOPIC NUMBER`."""

from __future__ import annotations

import json
import threading
from typing import Any

import roslibpy

from tests.end_to_end.clients.program import PATIENCE, run, say, settle


def talk(ros: roslibpy.Ros, text: str) -> None:
    """Publish each message once, and hear it; roslibpy reads no other encoding than JSON."""
    messages = json.loads(text)
    heard: dict[str, Any] = {}
    has_heard_all = threading.Event()

    def listen(topic: str, type_name: str) -> None:
        def on_message(msg: dict[str, Any]) -> None:
            heard[topic] = msg
            if len(heard) == len(messages):
                has_heard_all.set()

        roslibpy.Topic(ros, topic, type_name).subscribe(on_message)

    for message in messages:
        listen(message["topic"], message["type"])
    settle(ros)
    for message in messages:
        roslibpy.Topic(ros, message["topic"], message["type"]).publish(roslibpy.Message(message["msg"]))
    assert has_heard_all.wait(PATIENCE), f"heard of {list(heard)} alone"
    say(none=[heard[message["topic"]] for message in messages])


def burst(ros: roslibpy.Ros, name: str, num: str) -> None:
    """Count, and hear what a throttled listener is left of it."""
    heard: list[int] = []
    is_over = threading.Event()

    def on_message(msg: dict[str, Any]) -> None:
        heard.append(msg["data"])
        if heard[-1] == int(num):
            is_over.set()

    roslibpy.Topic(ros, name, "std_msgs/Int32", throttle_rate=100, queue_length=3).subscribe(on_message)
    settle(ros)
    talker = roslibpy.Topic(ros, name, "std_msgs/Int32")
    for i in range(int(num)):
        talker.publish(roslibpy.Message({"data": i + 1}))
    assert is_over.wait(PATIENCE), f"heard {heard} alone"
    say(heard=heard)


run(talk=talk, burst=burst)
