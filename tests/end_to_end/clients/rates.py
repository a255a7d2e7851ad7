"""Roles: `count TOPIC=TYPE ...`: subscribe until stdin ends; how many messages came, and how long behind the ego's.

The delay of a message is the time from `/Ego_topic` of the same frame to it.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import roslibpy

from tests.end_to_end.clients.program import run, say, serve, settle


def count(ros: roslibpy.Ros, *topics: str) -> None:
    """Messages and delays [ms] by topic, and the seconds from the first message to the last."""
    begun: dict[int, float] = {}
    heard: dict[str, list[tuple[int, float]]] = {}

    def take(name: str, message: dict[str, Any]) -> None:
        heard[name].append((message["header"]["seq"], time.perf_counter()))

    def take_ego(message: dict[str, Any]) -> None:
        begun[message["header"]["seq"]] = time.perf_counter()

    roslibpy.Topic(ros, "/Ego_topic", "morai_msgs/EgoVehicleStatus").subscribe(take_ego)
    for words in topics:
        name, _, type_name = words.partition("=")
        heard[name] = []
        roslibpy.Topic(ros, name, type_name).subscribe(partial(take, name))
    settle(ros)
    say(ready=True)
    serve()
    settle(ros)
    times = [at for each in heard.values() for _, at in each]
    say(
        counts={name: len(each) for name, each in heard.items()},
        delays={name: [1e3 * (at - begun[seq]) for seq, at in each if seq in begun] for name, each in heard.items()},
        seconds=max(times, default=0.0) - min(times, default=0.0),
    )


run(count=count)
