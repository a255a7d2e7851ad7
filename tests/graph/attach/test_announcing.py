"""A far side is told everything in order, at the time that its programs go by, and once more when it has forgotten."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, Literal

import pytest

from rosbridge_sim.graph.attach.announcing import UNREGISTER_TIME
from rosbridge_sim.graph.attach.connection import PROBE, PROBE_PATIENCE
from rosbridge_sim.graph.attach.mirror import Mirror
from rosbridge_sim.graph.attach.rosapi_watch import LOOK_PERIOD
from rosbridge_sim.graph.attach.survey import SURVEY_DELAYS
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.stamps import Stamps
from tests.graph.attach.mirror_harness import Car, FarBridge, Program, SimHarness, make_deaf
from tests.graph.bus_fixture import make_peer, make_store

# At the beginning


def test_everything_is_announced_with_services_last(harness: SimHarness) -> None:
    told = [(frame["op"], frame.get("topic") or frame.get("service")) for frame in harness.far.frames]
    assert told[:8] == [
        ("advertise", "/state"),
        ("advertise", "/plate"),
        ("subscribe", "/pedal"),
        ("call_service", "/rosapi/topics"),
        ("call_service", "/rosapi/services"),
        ("publish", "/plate"),
        ("advertise_service", "/honk"),
        ("call_service", PROBE),
    ]
    assert harness.num_attached == 1
    assert [frame["latch"] for frame in harness.far.ops("advertise")] == [False, True]
    assert {frame["type"] for frame in harness.far.ops("advertise_service")} == {"std_srvs/SetBool"}


@pytest.mark.parametrize("has_connection_each", [False, True])
def test_topic_that_the_far_side_refused_is_never_published(*, has_connection_each: bool) -> None:
    harness = SimHarness(has_connection_each=has_connection_each)
    make_deaf(harness, "/plate")
    harness.attach()
    harness.bus.advertise(harness.car, "/late", "std_msgs/Int32", is_exclusive=True)
    harness.bus.advertise(harness.car, "/good", "std_msgs/Int32", is_exclusive=True)
    make_deaf(harness, "/late")
    for connection in harness.mirror.connections.values():
        if not connection.is_open:
            harness.far.connect(harness.mirror, connection)
    for until in (0.0, sum(SURVEY_DELAYS) + 1.0):
        harness.run(until=until)
        harness.car.show("/plate", data="new")
        harness.car.show("/late", data=1)
        harness.car.show("/state", data=2)
        harness.car.show("/good", data=2)
        harness.pump()
    assert {frame["topic"] for frame in harness.far.ops("publish")} == {"/state", "/good"}


def test_topic_that_the_far_side_lists_late_is_published_from_then_on() -> None:
    harness = SimHarness()
    receive = harness.far._receive
    make_deaf(harness, "/plate")
    harness.attach()
    assert not harness.far.ops("publish")
    harness.far._receive = receive  # type: ignore[method-assign]
    Program(harness.far).send("advertise", topic="/plate", type="std_msgs/String")
    harness.run(until=sum(SURVEY_DELAYS))
    assert [frame["msg"] for frame in harness.far.ops("publish")] == [{"data": "12 GA 3456"}], "what is latched"


def test_topic_of_a_package_that_a_status_calls_unknown_is_published_no_more(harness: SimHarness) -> None:
    text = "Unable to import std_msgs.msg from package std_msgs. Caused by: no module"
    harness.receive({"op": "status", "level": "error", "msg": text, "id": "advertise:/state"})
    harness.far.frames.clear()
    harness.car.show("/state", data=1)
    harness.pump()
    assert not harness.far.ops("publish")


def test_types_are_spelled_as_in_the_ros_version() -> None:
    bus = Bus(make_store_of_ros2())
    owner = Car(bus)
    mirror = Mirror(bus, owner, "ws://far:9090")
    mirror.connected(mirror.connections[""], lambda: None, lambda: None, 0.0)
    frames = [json.loads(frame) for frame in mirror.connections[""].take(2**30, 0.0)]
    assert [frame["type"] for frame in frames if frame["op"] == "advertise"] == [
        "std_msgs/msg/Int32",
        "std_msgs/msg/String",
    ]


def make_store_of_ros2() -> Any:  # noqa: ANN401 - a store
    store = make_store()
    return type(store)(store._texts, ros=2)


def test_only_names_of_the_simulator_are_mirrored(harness: SimHarness) -> None:
    other, _ = make_peer(harness.bus)
    other.receive(b'{"op":"advertise","topic":"/mine","type":"std_msgs/String"}', 0.0)
    other.receive(b'{"op":"advertise_service","service":"/my","type":"std_srvs/Empty"}', 0.0)
    other.receive(b'{"op":"subscribe","topic":"/state"}', 0.0)
    harness.pump()
    assert harness.far.bus.find_topic("/mine") is None
    assert "/my" not in harness.far.bus.services


def test_topic_that_the_simulator_both_publishes_and_hears_is_not_subscribed() -> None:
    harness = SimHarness()
    harness.bus.subscribe(harness.car, "/state", lambda *_: None)
    harness.attach()
    assert [frame["topic"] for frame in harness.far.ops("subscribe")] == ["/pedal"]


def test_nothing_is_published_without_a_far_bridge() -> None:
    harness = SimHarness()
    assert not harness.car.state.has_listener
    harness.attach()
    assert harness.car.state.has_listener
    harness.cut()
    assert not harness.car.state.has_listener
    harness.car.show("/state", data=1)
    assert len(harness.connection.outbox) == 0


# Which time goes out


class WallClockCounter:
    """Counts how often the time of day was begun with."""

    def __init__(self) -> None:
        self.began_at: list[float] = []

    def stamps(self, choice: Literal["sim", "wall", "auto"] = "auto") -> Stamps:
        return Stamps(choice, self.began_at.append)


class StampsHarness(SimHarness):
    """A stand whose stamps may depend on its far side.

    Attributes:
        wall: what happened to the time of day.
        stamps: the choice.
    """

    def __init__(self, choice: Literal["sim", "wall", "auto"], **options: Any) -> None:  # noqa: ANN401 - of a SimHarness
        super().__init__(**options)
        self.wall = WallClockCounter()
        self.stamps = self.mirror.stamps = self.wall.stamps(choice)


def use_sim_time(harness: SimHarness, value: str) -> None:
    """Set the far side's parameter."""
    harness.far.bus.parameters.put("/use_sim_time", value, make_peer(harness.far.bus)[0])


def time_stand(
    value: object = None,
    *,
    choice: Literal["sim", "wall", "auto"] = "auto",
    **options: Any,  # noqa: ANN401 - as there
) -> StampsHarness:
    """A stand whose far side has this `/use_sim_time`, not attached yet."""
    harness = StampsHarness(choice, **options)
    if value is not None:
        use_sim_time(harness, json.dumps(value))
    return harness


@pytest.mark.parametrize("has_connection_each", [False, True])
@pytest.mark.parametrize(
    ("value", "is_wall"), [(True, False), (1, False), (False, True), (0, True), (None, True), ("yes", True)]
)
def test_time_source_is_known_before_announcing(
    value: object, *, is_wall: bool, has_connection_each: bool, lines: Callable[[], list[str]]
) -> None:
    harness = time_stand(value, has_connection_each=has_connection_each)
    assert harness.stamps.is_open
    harness.attach()
    assert harness.num_attached == 1
    assert harness.far.frames[0]["op"] == "call_service"
    assert harness.far.frames[0]["args"] == {"name": "/use_sim_time", "default": ""}
    assert (harness.stamps.is_open, harness.stamps.is_wall) == (False, is_wall)
    assert harness.wall.began_at == [0.0] * is_wall
    said = [line for line in lines() if "/use_sim_time" in line]
    text = "is not true: stamps are the time of day" if is_wall else "is true: stamps are simulated"
    assert said == [f"ws://far:9090: its /use_sim_time {text}"]


def test_later_change_of_use_sim_time_is_one_warning_and_changes_nothing(lines: Callable[[], list[str]]) -> None:
    harness = time_stand()
    harness.attach()
    lines()
    use_sim_time(harness, "true")
    for _ in range(3):
        harness.cut()
        harness.attach()
    assert harness.stamps.is_wall
    text = (
        "its /use_sim_time is true, and our stamps are the time of day: programs there may find no transforms;"
        " --stamps sim makes both simulated"
    )
    assert [line for line in lines() if "/use_sim_time" in line] == [f"ws://far:9090: {text}"]


def test_second_bridge_with_another_time_source_is_one_warning(lines: Callable[[], list[str]]) -> None:
    first, second = time_stand(value=True), SimHarness()
    second.mirror.stamps = first.mirror.stamps
    first.attach()
    lines()
    second.attach()
    assert not first.stamps.is_wall
    text = (
        "its /use_sim_time is not true, and our stamps are simulated time: programs there may find no transforms;"
        " --stamps wall gives the time of day, or set the parameter before they start"
    )
    assert [line for line in lines() if "/use_sim_time" in line] == [f"ws://far:9090: {text}"]


@pytest.mark.parametrize(("choice", "value"), [("sim", True), ("wall", False), ("wall", None)])
def test_bridge_that_agrees_with_the_setting_logs_nothing(
    choice: Literal["sim", "wall"], value: object, lines: Callable[[], list[str]]
) -> None:
    harness = time_stand(value, choice=choice)
    harness.attach()
    assert not [line for line in lines() if "/use_sim_time" in line]


def test_far_bridge_without_use_sim_time_delays_announcing_by_one_answer_time_out() -> None:
    harness = time_stand()
    harness.far.mute.add("/rosapi/get_param")
    harness.attach()
    assert harness.num_attached == 0
    harness.run(until=PROBE_PATIENCE)
    assert harness.num_attached == 1
    assert harness.wall.began_at == [PROBE_PATIENCE]


def test_late_rosapi_with_another_time_source_is_one_warning(lines: Callable[[], list[str]]) -> None:
    harness = time_stand(has_rosapi=False)
    harness.attach()
    assert harness.wall.began_at == [0.0]
    use_sim_time(harness, "true")
    Rosapi(harness.far.bus)
    lines()
    harness.run(until=sum(SURVEY_DELAYS))
    assert sum("--stamps sim makes both simulated" in line for line in lines()) == 1


def test_socket_lost_before_the_time_answer_decides_nothing() -> None:
    harness = time_stand(value=True)
    harness.far.connect(harness.mirror, harness.connection)
    harness.far.cut(harness.mirror, harness.connection)
    assert harness.stamps.is_open
    harness.attach()
    assert not harness.stamps.is_open
    assert harness.num_attached == 1


def test_time_answer_after_leaving_announces_nothing() -> None:
    harness = time_stand(value=True)
    harness.far.connect(harness.mirror, harness.connection)
    harness.mirror.leave(0.0)
    harness.pump()
    assert not harness.far.ops("advertise")
    assert not harness.far.ops("advertise_service")


def test_ros_2_uses_wall_clock_stamps_without_asking() -> None:
    bus = Bus(make_store_of_ros2())
    far, wall = FarBridge(), WallClockCounter()
    mirror = Mirror(bus, Car(bus), "ws://far:9090")
    mirror.stamps = wall.stamps()
    far.connect(mirror, mirror.connections[""])
    far.pump(mirror)
    assert mirror.stamps.is_wall
    assert "/use_sim_time" not in [frame["args"].get("name") for frame in far.ops("call_service")]


# What has gone and may come back


def test_service_of_a_departed_ego_stays_announced_and_gives_the_reason(harness: SimHarness) -> None:
    harness.mirror.why_gone = lambda name: "ego 2 has left" if name == "/honk" else ""
    program = Program(harness.far)
    harness.bus.withdraw(harness.car, "/honk")
    harness.pump()
    assert not harness.far.ops("unadvertise_service")
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    (answer,) = program.received("service_response")
    assert answer["result"] is False
    (told,) = harness.far.ops("service_response")
    assert told["reason"] == "Service /honk is not served: ego 2 has left"
    harness.bus.provide(harness.car, "/honk", "std_srvs/SetBool", harness.car._honk, is_exclusive=True)
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    (answer,) = program.received("service_response")
    assert answer["values"]["message"] == "beep"
    assert len(harness.far.ops("advertise_service")) == 1


def test_service_of_a_departed_ego_is_announced_again_after_a_bridge_restart() -> None:
    for has_connection_each in (False, True):
        harness = SimHarness(has_connection_each=has_connection_each)
        harness.mirror.why_gone = lambda _name: "ego 2 has left"
        harness.attach()
        harness.bus.withdraw(harness.car, "/honk")
        harness.pump()
        harness.cut()
        harness.attach()
        assert "/honk" in harness.far.bus.services
        assert harness.num_attached == 2
        harness.mirror.leave(0.0)
        harness.pump()
        assert "/honk" not in harness.far.bus.services


def test_forgotten_service_is_unadvertised_at_the_far_bridge(harness: SimHarness) -> None:
    why = "ego 2 has left"
    harness.mirror.why_gone = lambda _name: why
    harness.bus.withdraw(harness.car, "/honk")
    harness.pump()
    why = ""
    harness.bus.advertise(harness.car, "/other", "std_msgs/Int32")
    harness.pump()
    assert [frame["service"] for frame in harness.far.ops("unadvertise_service")] == ["/honk"]


# A master that is restarted behind a bridge that lives on


def lose_rosapi(harness: SimHarness, *, seconds: float = 10.0) -> float:
    """Take the far side's rosapi away for so long; when it is [s]."""
    (rosapi,) = {service.owner for name, service in harness.far.bus.services.items() if name.startswith("/rosapi/")}
    harness.far.bus.leave(rosapi, 0.0)
    harness.run(until=seconds)
    return seconds


def test_lost_rosapi_is_one_warning_and_its_return_repeats_all_announcements(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lines()
    num_before = len(harness.far.frames)
    lose_rosapi(harness)
    text = "rosapi there stopped answering (ROS master restarted?); all is announced again when it answers"
    assert [line for line in lines() if "rosapi" in line] == [f"ws://far:9090: {text}"]
    assert not [f for f in harness.far.frames[num_before:] if f["op"] != "call_service"], "the stream goes on as it was"
    num_before = len(harness.far.frames)
    Rosapi(harness.far.bus)
    harness.run(until=30.0)
    anew = [(f["op"], f.get("topic", f.get("service"))) for f in harness.far.frames[num_before:]]
    assert [one for one in anew if one[0] not in {"call_service", "publish"}] == [
        ("unadvertise", "/state"),
        ("advertise", "/state"),
        ("unadvertise", "/plate"),
        ("advertise", "/plate"),
        ("unsubscribe", "/pedal"),
        ("subscribe", "/pedal"),
        ("advertise_service", "/honk"),
    ]
    assert ("publish", "/plate") in anew, "what is latched"
    assert [line for line in lines() if "rosapi" in line] == [
        "ws://far:9090: rosapi answers again: everything is announced again"
    ]
    program = Program(harness.far)
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    assert program.received("service_response")[0]["values"]["message"] == "beep"


def test_topics_are_unadvertised_long_enough_for_the_bridge_to_forget_them(harness: SimHarness) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lose_rosapi(harness)
    Rosapi(harness.far.bus)
    bus, topics = harness.far.bus, harness.far.bus.topics
    forgotten = {name: topics[name] for name in ("/state", "/plate")}
    for name in forgotten:  # the new master does not know them, and what is advertised again is not registered
        del topics[name]
    make_deaf(harness, *forgotten)
    num_before = len(harness.far.frames)
    harness.run(until=10.0 + 1.0 + sum(SURVEY_DELAYS) + 1.0)
    taken = [f for f in harness.far.frames[num_before:] if f["op"] == "unadvertise"]
    assert len(taken) == 4, "at once, and for good when they were missing all the same"
    num_before = len(harness.far.frames)
    harness.car.show("/state", data=5)
    harness.pump()
    assert not [f for f in harness.far.frames[num_before:] if f["op"] == "publish"], (
        "that would register them as before"
    )
    harness.far._receive = lambda peer, frame, now: FarBridge._receive(harness.far, peer, frame, now)  # type: ignore[method-assign]
    harness.run(until=10.0 + 1.0 + sum(SURVEY_DELAYS) + UNREGISTER_TIME + 1.0)
    assert {"/state", "/plate"} <= set(bus.topics)
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    harness.car.show("/state", data=6)
    harness.pump()
    assert [f["msg"] for f in program.received("publish")] == [{"data": 6}]


def test_silent_far_bridge_has_not_lost_its_rosapi(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    harness.far.mute.add(PROBE)
    harness.run(until=60.0)
    harness.far.mute.clear()
    harness.run(until=120.0)
    assert not [line for line in lines() if "any more" in line]
    assert len(harness.far.ops("advertise")) == 2


def test_single_refusal_does_not_count_as_a_lost_rosapi(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lose_rosapi(harness, seconds=LOOK_PERIOD + 0.5)
    Rosapi(harness.far.bus)
    harness.run(until=60.0)
    assert not [line for line in lines() if "any more" in line]
    assert len(harness.far.ops("advertise")) == 2


def test_bridge_lost_after_its_rosapi_gets_one_round_of_announcements(harness: SimHarness) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lose_rosapi(harness)
    harness.cut()
    Rosapi(harness.far.bus)
    harness.attach()
    harness.run(until=60.0)
    assert len(harness.far.ops("advertise")) == 4, "two topics on each of two sockets"


def test_unadvertised_topics_return_after_a_lost_socket() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.attach()
    harness.run(until=sum(SURVEY_DELAYS))
    harness.mirror._announcer.take_back(10.0)
    harness.pump()
    assert "/state" not in {name for name, topic in harness.far.bus.topics.items() if topic.publishers}
    harness.far.cut(harness.mirror, harness.connection, 11.0)
    harness.far.connect(harness.mirror, harness.connection, 12.0)
    harness.pump()
    harness.run(until=10.0 + UNREGISTER_TIME)
    assert {name for name, topic in harness.far.bus.topics.items() if topic.publishers} >= {"/state", "/plate"}
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    harness.car.show("/state", data=6)
    harness.pump()
    assert [f["msg"] for f in program.received("publish")] == [{"data": 6}]
