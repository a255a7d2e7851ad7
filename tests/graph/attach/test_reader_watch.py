"""Pictures and clouds at a far bridge: only where they are read, once, and beside the small topics."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim.graph.attach.mirror_registry import BULK
from rosbridge_sim.graph.attach.reader_watch import READERS_PERIOD, RETRY_PERIOD
from tests.graph.attach.mirror_harness import Program, SimHarness

CAMERA, SECOND = "/camera", "/camera_again"


@pytest.fixture
def harness() -> SimHarness:
    harness = SimHarness(cameras=(CAMERA, SECOND))
    harness.attach()
    harness.run(until=0.0)
    return harness


def subscribed(harness: SimHarness, *names: str) -> Program:
    program = Program(harness.far)
    for name in names:
        program.send("subscribe", topic=name)
    return program


def shown(harness: SimHarness, connection: str | None = None) -> list[str]:
    """Publish a picture under both names and a state, and return the topics that have arrived at the bridge."""
    harness.far.frames.clear()
    harness.far.frames_of.clear()
    for name in (CAMERA, SECOND):
        harness.car.show(name, format="jpeg", data=b"a picture")
    harness.car.show("/state", data=1)
    harness.pump()
    frames = harness.far.frames if connection is None else harness.far.frames_of.get(connection, [])
    return [frame["topic"] for frame in frames if frame["op"] == "publish"]


def has_listener(harness: SimHarness, name: str) -> bool:
    return harness.bus.topics[name].has_listener


def test_picture_without_readers_is_neither_sent_nor_made(harness: SimHarness) -> None:
    assert shown(harness) == ["/state"]
    assert not has_listener(harness, CAMERA)


def test_picture_goes_to_the_names_that_are_read_and_no_longer_when_they_are_not(harness: SimHarness) -> None:
    program = subscribed(harness, SECOND)
    harness.run(until=READERS_PERIOD + 1.0)
    assert sorted(shown(harness)) == [SECOND, "/state"]
    assert (has_listener(harness, CAMERA), has_listener(harness, SECOND)) == (False, True)
    program.send("subscribe", topic=CAMERA)
    harness.run(until=2 * READERS_PERIOD + 2.0)
    assert sorted(shown(harness)) == [CAMERA, SECOND, "/state"]
    program.send("unsubscribe", topic=SECOND)
    harness.run(until=3 * READERS_PERIOD + 3.0)
    assert sorted(shown(harness)) == [CAMERA, "/state"]


def test_one_question_for_readers_is_asked_at_a_time() -> None:
    harness = SimHarness(cameras=[f"/camera{i}" for i in range(5)])
    harness.far.mute.add("/rosapi/subscribers")
    harness.attach()
    harness.run(until=1.0)
    calls = [call for call in harness.far.ops("call_service") if call["service"] == "/rosapi/subscribers"]
    assert len(calls) == 1


def test_bridge_without_rosapi_gets_pictures_under_the_chosen_name_alone() -> None:
    harness = SimHarness(has_rosapi=False, cameras=(CAMERA, SECOND))
    harness.attach()
    harness.run(until=4 * RETRY_PERIOD)
    assert sorted(shown(harness)) == [CAMERA, "/state"]


def test_rosapi_that_fails_once_changes_nothing(harness: SimHarness) -> None:
    program = subscribed(harness, CAMERA)
    harness.run(until=READERS_PERIOD + 0.5)
    harness.far.mute.add("/rosapi/subscribers")
    harness.run(until=2 * READERS_PERIOD + 2.0)
    assert sorted(shown(harness)) == [CAMERA, "/state"]
    assert program.received()


def test_pictures_have_a_connection_of_their_own(harness: SimHarness) -> None:
    subscribed(harness, CAMERA)
    harness.run(until=READERS_PERIOD + 1.0)
    assert shown(harness, BULK) == [CAMERA]
    assert shown(harness, "") == ["/state"]


def test_there_is_no_second_connection_without_pictures() -> None:
    assert list(SimHarness().mirror.connections) == [""]
    each = SimHarness(has_connection_each=True, cameras=[CAMERA])
    assert BULK not in each.mirror.connections


def test_first_connection_carries_pictures_while_the_other_is_lost(harness: SimHarness) -> None:
    subscribed(harness, CAMERA)
    harness.run(until=READERS_PERIOD + 1.0)
    bulk = harness.mirror.connections[BULK]
    harness.far.cut(harness.mirror, bulk, 5.0)
    assert sorted(shown(harness, "")) == [CAMERA, "/state"]
    assert harness.mirror._announcer.is_attached
    harness.far.connect(harness.mirror, bulk, 6.0)
    harness.pump(6.0)
    assert shown(harness, BULK) == [CAMERA]


def test_all_is_attached_without_the_connection_for_pictures() -> None:
    harness = SimHarness(cameras=[CAMERA])
    harness.far.connect(harness.mirror, harness.connection)
    harness.pump()
    assert harness.num_attached == 1


def test_second_connection_ends_with_the_last_camera(harness: SimHarness) -> None:
    for name in (CAMERA, SECOND):
        harness.bus.unadvertise(harness.car, name, 1.0)
    assert list(harness.mirror.connections) == [""]


def test_picture_of_a_tick_comes_before_its_answer(harness: SimHarness) -> None:
    harness.is_synchronous = True
    harness.car.on_call = lambda _call: harness.car.show(CAMERA, format="jpeg", data=b"of this tick")
    program = Program(harness.far)
    program.send("subscribe", topic=CAMERA)  # too late for any question before the tick
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    ops = [(op["op"], op.get("topic")) for op in harness.far.frames_of[""] if op["op"] != "call_service"]
    assert ops.index(("publish", CAMERA)) < ops.index(("service_response", None))
    assert BULK not in {name for name, frames in harness.far.frames_of.items() if json.dumps(frames).count("of this")}


def test_synchronous_mode_sends_pictures_until_it_is_known_that_nobody_reads_them(harness: SimHarness) -> None:
    program = Program(harness.far)
    harness.is_synchronous = True
    program.send("call_service", service="/honk", args={"data": True})
    harness.far.pump(harness.mirror, 1.0)
    assert has_listener(harness, CAMERA)
    harness.run(until=2.0)
    assert not has_listener(harness, CAMERA)


def test_camera_that_comes_later_is_asked_for_at_once(harness: SimHarness) -> None:
    harness.run(until=1.0)
    harness.car.add_camera("/late")
    harness.pump(1.0)
    subscribed(harness, "/late")
    harness.mirror.advance(1.1)
    harness.pump(1.1)
    assert has_listener(harness, "/late")
