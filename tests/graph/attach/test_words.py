"""A bridge that refuses null for a number is sent NaN and infinity as the words that Python reads; others get null."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable
from typing import Any

import pytest

from rosbridge_sim.graph.attach.survey import SURVEY_DELAYS
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.protocol.outbox import Outbox
from tests.graph.attach.mirror_harness import Frame, SimHarness
from tests.graph.bus_fixture import make_peer

SCAN, PLAN, MAP = "/scan", "/plan", "/map"

QUESTION = {"name": "/rosdistro", "default_value": None}
"""Request that shows if a bridge takes null."""

NO_NULL = "rosapi_msgs/GetParamRequest message requires a string for field default_value, but got a <class 'NoneType'>"
"""Answer of rosbridge_suite to it."""


def make_scanner(**options: Any) -> SimHarness:  # noqa: ANN401 - of a SimHarness
    """A car with a scan, a latched plan and a service of a map: numbers in arrays, nested, and in a response."""
    harness = SimHarness(**options)
    car, bus = harness.car, harness.bus
    bus.advertise(car, SCAN, "sensor_msgs/LaserScan", is_exclusive=True)
    bus.advertise(car, PLAN, "geometry_msgs/PoseArray", depth=1, is_exclusive=True)
    car.show(PLAN, poses=[{"position": {"x": 1.0, "y": math.nan}}])

    def give_map(call: Call, _now: float) -> None:
        grid = {"map": {"info": {"resolution": math.inf, "origin": {"position": {"x": -math.inf}}}}}
        call.answer(call.service.type.response.check(grid, 0))

    bus.provide(car, MAP, "nav_msgs/GetMap", give_map, is_exclusive=True)
    return harness


def scan(harness: SimHarness) -> None:
    harness.car.show(SCAN, ranges=[1.5, math.inf, -math.inf, math.nan], range_max=math.inf)
    harness.pump()


def last(harness: SimHarness, topic: str) -> Frame:
    """The last message of a topic that the far side was sent."""
    *_, msg = (frame["msg"] for frame in harness.far.ops("publish") if frame["topic"] == topic)
    return dict(msg)


def ask_map(harness: SimHarness) -> Frame:
    """The values of the answer to a call from there."""
    harness.receive({"op": "call_service", "service": MAP, "id": "map"})
    harness.pump()
    values: Frame = harness.far.ops("service_response")[-1]["values"]
    return values


def listen(harness: SimHarness) -> Outbox:
    """A client of our own server, beside the bridge."""
    peer, outbox = make_peer(harness.bus)
    peer.receive(json.dumps({"op": "subscribe", "topic": SCAN}).encode(), 0.0)
    return outbox


def reads_words(harness: SimHarness) -> bool:
    """What the next scan is sent as."""
    scan(harness)
    ranges = last(harness, SCAN)["ranges"]
    assert repr(ranges) in {"[1.5, inf, -inf, nan]", "[1.5, None, None, None]"}
    return None not in ranges


def refuse_null(harness: SimHarness) -> None:
    """Have the far side answer the question as rosbridge_suite does."""
    receive = harness.far._receive

    def refuse(peer: Any, frame: bytes, now: float) -> None:  # noqa: ANN401 - a peer
        op = json.loads(frame)
        if op.get("args") == QUESTION:
            answer = {"op": "service_response", "service": op["service"], "id": op["id"]}
            harness.receive({**answer, "values": NO_NULL, "result": False})
        else:
            receive(peer, frame, now)

    harness.far._receive = refuse  # type: ignore[method-assign]


# ROS 1


def test_bridge_of_ros_1_is_sent_words_in_topics_and_responses() -> None:
    harness = make_scanner()
    harness.attach()
    position = last(harness, PLAN)["poses"][0]["position"]
    assert repr(position) == "{'x': 1.0, 'y': nan, 'z': 0.0}", "a latched message, which came before all others"
    scan(harness)
    assert repr(last(harness, SCAN)["ranges"]) == "[1.5, inf, -inf, nan]"
    assert last(harness, SCAN)["range_max"] == math.inf
    info = ask_map(harness)["map"]["info"]
    assert (info["resolution"], info["origin"]["position"]["x"]) == (math.inf, -math.inf)


@pytest.mark.parametrize("is_before", [False, True])
def test_client_of_our_own_server_gets_null(*, is_before: bool) -> None:
    harness = make_scanner()
    outbox = listen(harness) if is_before else None
    harness.attach()
    outbox = outbox or listen(harness)
    scan(harness)
    (frame,) = outbox.take(2**30)
    assert json.loads(frame)["msg"]["ranges"] == [1.5, None, None, None]
    assert reads_words(harness)


# ROS 2


def test_bridge_of_ros_2_that_takes_null_is_sent_null() -> None:
    harness = make_scanner(is_ros_2=True)
    harness.attach()
    harness.run(until=sum(SURVEY_DELAYS))
    assert not reads_words(harness)
    assert ask_map(harness)["map"]["info"]["resolution"] is None
    assert [frame["args"] for frame in harness.far.ops("call_service")].count(QUESTION) == 1, "asked once"


def test_bridge_of_ros_2_that_refuses_null_is_sent_words_from_the_start(lines: Callable[[], list[str]]) -> None:
    harness = make_scanner(is_ros_2=True)
    refuse_null(harness)
    harness.attach()
    assert math.isnan(last(harness, PLAN)["poses"][0]["position"]["y"])
    assert reads_words(harness)
    harness.run(until=sum(SURVEY_DELAYS))
    assert len([line for line in lines() if "it refuses null" in line]) == 1


def test_bridge_whose_rosapi_starts_late_is_asked_again() -> None:
    harness = make_scanner(is_ros_2=True, has_rosapi=False)
    harness.attach()
    assert not reads_words(harness)
    refuse_null(harness)
    harness.run(until=sum(SURVEY_DELAYS))
    assert reads_words(harness)


def test_status_about_null_turns_to_words(lines: Callable[[], list[str]]) -> None:
    harness = make_scanner(is_ros_2=True)
    harness.attach()
    text = "LaserScan message requires a float32 for field ranges, but got a <class 'NoneType'>"
    for _ in range(2):
        harness.receive({"op": "status", "level": "error", "msg": text})
    assert reads_words(harness)
    assert len([line for line in lines() if "it refuses null" in line]) == 1


def test_next_bridge_at_the_address_is_judged_anew() -> None:
    harness = make_scanner(is_ros_2=True)
    receive = harness.far._receive
    refuse_null(harness)
    harness.attach()
    harness.cut()
    harness.far._receive = receive  # type: ignore[method-assign]
    harness.attach()
    assert not reads_words(harness)


def test_other_refusals_and_statuses_leave_null() -> None:
    harness = make_scanner(is_ros_2=True, has_rosapi=False)
    harness.attach()
    for text in ("Service /rosapi/get_param does not exist", "x" * 10**6 + " NoneType", None):
        harness.receive({"op": "status", "level": "error", "msg": text})
    assert not reads_words(harness)


# The log


def test_status_about_messages_of_a_kind_is_logged_once(lines: Callable[[], list[str]]) -> None:
    harness = make_scanner()
    harness.attach()
    lines()
    for i in range(100):
        for topic in ("/Ego_topic_1", "/Ego_topic_2"):
            text = f"publish: {topic}: field x: {i}.5 is too large, at byte {i}"
            harness.receive({"op": "status", "level": "error", "msg": text}, now=20.0 * i)
    assert lines() == [
        f"ws://far:9090: it says: [error] publish: {topic}: field x: 0.5 is too large, at byte 0"
        for topic in ("/Ego_topic_1", "/Ego_topic_2")
    ]


def test_status_that_was_left_out_of_a_full_log_is_logged_later(lines: Callable[[], list[str]]) -> None:
    harness = make_scanner()
    harness.attach()
    for i in range(30):
        harness.mirror.note(logging.WARNING, f"line {i}", 0.0)
    for now in (0.0, 20.0, 40.0):
        harness.receive({"op": "status", "level": "error", "msg": "disk full"}, now=now)
    assert len([line for line in lines() if "disk full" in line]) == 1
