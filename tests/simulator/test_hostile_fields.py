"""Hostile values in each field of each service, made from the types: the short sibling of `hostile_fields.py`."""

from __future__ import annotations

from typing import Any

import orjson
import pytest

from rosbridge_sim.graph.rosapi import Rosapi
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.graph.topics_services import Service
from rosbridge_sim.schema.definitions.message_spec import FieldSpec
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


def answer(wire: Wire, frame: bytes) -> dict[str, Any]:
    """The only answer to a call."""
    wire.peer.receive(frame, 0.0)
    (found,) = [one for one in wire.hears() if one["op"] == "service_response"]
    return found


def too_long(service: Service, field: FieldSpec) -> bytes:
    """The shortest value of a field that is too long for the service: of a list, by its number of elements."""
    assert service.limits is not None
    if field.definition.array is None:
        return b'"' + b"x" * service.limits.num_bytes + b'"'
    element = b"{}" if field.nested is not None else b'""' if field.definition.type == "string" else b"1"
    most = {b"{}": service.limits.containers, b'""': service.limits.texts, b"1": service.limits.values}[element]
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
            got = answer(wire, target.frame(wrap(path, too_long(service, field)), "c"))
            assert (got["id"], got["service"], got["result"]) == ("c", service.name, False)
            assert got["values"].startswith(f"{service.name}: expected a request of at most "), (path, got)
            num += 1
    assert num > 60


def test_each_hostile_call_gets_one_answer(stand: SimHarness) -> None:
    wire, num = Wire(stand.bus), 0
    for service in services(stand):
        target = Target("call_service", service.name, service.type.name)
        for words, body in bodies(type_of(target, stand.bus.store), sizes=(60_000,)):
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
