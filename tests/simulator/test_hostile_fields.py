"""Hostile values in each field of each service and input topic: the short sibling of `hostile_fields.py`."""

from __future__ import annotations

from typing import Any

import orjson
import pytest

from rosbridge_sim.graph.peers.publish_reader import LEARN_EACH
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.tf.buffer import MAX_TF_FRAMES
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.graph.topics_services import Service, Topic
from rosbridge_sim.protocol.body_limits import BodyLimits
from rosbridge_sim.schema.definitions.message_spec import FieldSpec
from rosbridge_sim.simulator.replays.network_replay import MAX_OBJECTS
from rosbridge_sim.simulator.scene.scene_limits import MAX_ENTITIES
from scripts.soak.hostile_fields import Target, bodies, paths, type_of, wrap
from tests.graph.bus_fixture import Wire
from tests.simulator.sim_harness import SimHarness

pytestmark = pytest.mark.slow

LONGEST_TEXT = 4 * 2**20
"""Bound of a text in each service but one [bytes]: the bytes of a snapshot are a text as long as a frame may be."""


@pytest.fixture(scope="module")
def stand() -> SimHarness:
    """A simulator with all nodes of a server."""
    stand = SimHarness()
    Rosapi(stand.bus)
    WebRepublisher(stand.bus)
    return stand


def services(stand: SimHarness) -> list[Service]:
    found = list(stand.bus.services.values())
    assert len(found) > 60
    return found


def inputs(stand: SimHarness) -> list[Topic]:
    """The topics that a part of the server subscribes to."""
    found = [topic for topic in stand.bus.topics.values() if any(one.is_binding for one in topic.all_subscriptions)]
    assert len(found) > 15
    return found


def answer(wire: Wire, frame: bytes) -> dict[str, Any]:
    """The only answer to a call."""
    wire.peer.receive(frame, 0.0)
    (found,) = [one for one in wire.hears() if one["op"] == "service_response"]
    return found


def too_long(limits: BodyLimits, field: FieldSpec) -> bytes:
    """The shortest value of a field that is beyond the limits: of a list, by its number of elements."""
    if field.definition.array is None:
        return b'"' + b"x" * limits.num_bytes + b'"'
    element = b"{}" if field.nested is not None else b'""' if field.definition.type == "string" else b"1"
    most = {b"{}": limits.containers, b'""': limits.texts, b"1": limits.values}[element]
    return b"[" + b",".join([element] * (most + 2)) + b"]"


def test_each_text_and_list_of_each_service_is_bounded_before_it_is_converted(stand: SimHarness) -> None:
    wire, num = Wire(stand.bus), 0
    for service in services(stand):
        target = Target("call_service", service.name, service.type.name)
        assert service.limits is not None, service.name
        for path, field in paths(type_of(target, stand.bus.store)):
            is_snapshot = service.name == "/sim/restore"
            if is_snapshot and (field.definition.array is None or field.definition.is_bytes):
                continue
            assert is_snapshot or service.limits.num_bytes <= LONGEST_TEXT
            got = answer(wire, target.frame(wrap(path, too_long(service.limits, field)), "c"))
            assert (got["id"], got["service"], got["result"]) == ("c", service.name, False)
            assert got["values"].startswith(f"{service.name}: expected a request of at most "), (path, got)
            num += 1
    assert num > 60


def test_each_text_and_list_of_each_input_topic_is_bounded_before_it_is_converted(stand: SimHarness) -> None:
    wire, num = Wire(stand.bus), 0
    for topic in inputs(stand):
        target = Target("publish", topic.name, topic.type.name)
        assert topic.limits is not None, topic.name
        for path, field in paths(type_of(target, stand.bus.store)):
            wire.peer.receive(target.frame(wrap(path, too_long(topic.limits, field)), "p"), 0.0)
            (got,) = wire.hears()
            assert (got["op"], got["level"], got["id"]) == ("status", "error", "p")
            assert got["msg"].startswith(f"{topic.name}: expected a message of at most "), (path, got)
            num += 1
    assert num > 40


def test_limits_hold_on_a_topic_that_the_client_publishes_on_often(stand: SimHarness) -> None:
    wire = Wire(stand.bus)
    target = Target("publish", "/ego_setting", "morai_msgs/MultiEgoSetting")
    for _ in range(LEARN_EACH + 1):
        wire.peer.receive(target.frame(b"{}", "p"), 0.0)
    assert not wire.hears()
    wire.peer.receive(target.frame(wrap(("gear",), b"[" + b"1," * 20_000 + b"1]"), "p"), 0.0)
    (got,) = wire.hears()
    assert (got["id"], got["msg"]) == ("p", "/ego_setting: expected a message of at most 10,000 values, got 20,000")


def test_messages_as_large_as_the_world_pass(stand: SimHarness) -> None:
    place, header = dict.fromkeys("xyz", -1234.5678901234567), {"stamp": {"secs": 1, "nsecs": 5}, "frame_id": "map"}
    npc = {"name": "2016_Hyundai_Ioniq", "position": place}
    motion = {"heading": 1.5, "velocity": place, "acceleration": place, "size": place, "type": 1}
    stamped = {"header": header, "transform": {"rotation": {**place, "w": 1.0}, "translation": place}}
    for name, message in (
        ("NpcGhost_Topic", {"npc_list": [{**npc, "rpy": place, "unique_id": i} for i in range(MAX_ENTITIES)]}),
        ("ReplayInfo_topic", {"npc_list": [{**npc, **motion, "unique_id": i} for i in range(MAX_OBJECTS)]}),
        ("tf", {"transforms": [{**stamped, "child_frame_id": f"frame_{i}"} for i in range(MAX_TF_FRAMES)]}),
    ):
        topic = stand.bus.find_topic(name)
        assert topic is not None
        assert topic.limits is not None
        topic.limits.check(name, orjson.dumps(message))


def test_each_hostile_call_gets_one_answer(stand: SimHarness) -> None:
    wire, num = Wire(stand.bus), 0
    for service in services(stand):
        target = Target("call_service", service.name, service.type.name)
        for words, body in bodies(type_of(target, stand.bus.store), sizes=(20_000,)):
            wire.peer.receive(target.frame(body, words), 0.0)
            got = [one for one in wire.hears() if one["op"] == "service_response"]
            assert [one["id"] for one in got] == [words], (service.name, got)
            num += 1
    assert num > 500


def test_call_in_a_frame_that_is_too_heavy_is_answered(stand: SimHarness) -> None:
    frame = orjson.dumps({"op": "call_service", "id": 7, "service": "/sim/sensors", "args": {"remove": [""] * 800_001}})
    got = answer(Wire(stand.bus), frame)
    assert (got["id"], got["service"], got["result"]) == (7, "/sim/sensors", False)
    assert "at most 800,000 texts are accepted" in got["values"]
