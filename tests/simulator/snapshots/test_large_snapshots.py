"""Snapshots of large states: a thread makes hash and bytes from a copy that is taken at once."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, TypeVar

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.snapshots import kept_snapshots, snapshots
from tests.graph.bus_fixture import make_peer
from tests.simulator.sim_harness import SimHarness

T = TypeVar("T")


class LateReader:
    """A reader that does nothing before a test says so: what it does then cannot depend on the world of the call.

    Attributes:
        waiting: what is asked for and not done.
        error: outcome of the next work, in place of its own.
    """

    def __init__(self) -> None:
        self.waiting: list[Callable[[], None]] = []
        self.error: DocumentError | None = None

    def read(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None], now: float) -> None:
        def finish() -> None:
            error, self.error = self.error, None
            then(work() if error is None else error, now)

        self.waiting.append(finish)


class Caller:
    """A client over the wire."""

    def __init__(self, harness: SimHarness) -> None:
        self.peer, self._outbox = make_peer(harness.bus)

    def call(self, service: str, **args: object) -> None:
        op = {"op": "call_service", "service": service, "args": args}
        self.peer.receive(json.dumps(op).encode(), 0.0)

    def answers(self) -> list[dict[str, Any]]:
        frames = [json.loads(frame) for frame in self._outbox.take(2**40)]
        return [frame for frame in frames if frame["op"] == "service_response"]


@pytest.fixture
def reader(monkeypatch: pytest.MonkeyPatch) -> LateReader:
    monkeypatch.setattr(snapshots, "LARGE", 0)
    return LateReader()


def test_state_of_a_snapshot_is_that_of_its_frame_though_the_world_moves_on(reader: LateReader) -> None:
    harness = SimHarness(reader=reader)
    caller = Caller(harness)
    harness.run(0.1)
    frame = harness.world.frame
    state_hash = harness.node.components[-1]._state.hash()  # type: ignore[attr-defined] # the snapshots'
    caller.call("/sim/snapshot", id="a", with_data=True)
    assert caller.peer.is_held
    assert caller.answers() == []
    harness.run(0.3)
    reader.waiting.pop()()
    assert not caller.peer.is_held
    (answer,) = caller.answers()
    assert (answer["values"]["frame"], answer["values"]["state_hash"]) == (frame, state_hash)
    twin = SimHarness()
    other = Caller(twin)
    other.call("/sim/restore", data=answer["values"]["data"])
    assert other.answers()[0]["values"]["state_hash"] == state_hash
    assert twin.world.frame == frame


def test_hash_of_a_large_state_is_that_of_the_frame_of_the_call(reader: LateReader) -> None:
    harness = SimHarness(reader=reader)
    caller = Caller(harness)
    harness.run(0.1)
    frame = harness.world.frame
    caller.call("/sim/state_hash")
    caller.call("/sim/state_hash")
    harness.run(0.1)
    for finish in reader.waiting:
        finish()
    one, other = (answer["values"] for answer in caller.answers())
    assert one == other
    assert one["frame"] == frame
    assert len(one["hash"]) == 32


def test_room_is_taken_before_the_bytes_are_made_and_given_back_if_they_are_not(
    reader: LateReader, monkeypatch: pytest.MonkeyPatch
) -> None:
    harness = SimHarness(reader=reader)
    one, other = Caller(harness), Caller(harness)
    one.call("/sim/snapshot", id="a")
    size = harness.bus.total.num_bytes
    assert size > 0
    monkeypatch.setattr(kept_snapshots, "MAX_BYTES", 2 * size - 1)
    other.call("/sim/snapshot", id="b")
    assert "remove some by /sim/snapshots" in other.answers()[0]["values"]["message"]
    monkeypatch.setattr(kept_snapshots, "MAX_SNAPSHOTS", 1)
    other.call("/sim/snapshot", id="b")
    assert "1 snapshots are kept already" in other.answers()[0]["values"]["message"]
    reader.error = DocumentError("the server failed")
    reader.waiting.pop()()
    assert [answer["result"] for answer in one.answers()] == [False]
    assert not one.peer.is_held
    assert harness.bus.total.num_bytes == 0
    other.call("/sim/snapshot", id="b")
    reader.waiting.pop()()
    assert other.answers()[0]["values"]["id"] == "b"


def test_snapshot_that_waits_is_kept_in_place_of_the_one_with_its_name(reader: LateReader) -> None:
    harness = SimHarness(reader=reader)
    callers = [Caller(harness) for _ in range(3)]
    for caller in callers[:2]:
        caller.call("/sim/snapshot", id="a")
        harness.run(0.1)
    for finish in reader.waiting:
        finish()
    frames = [caller.answers()[0]["values"]["frame"] for caller in callers[:2]]
    callers[2].call("/sim/snapshots")
    (kept,) = callers[2].answers()[0]["values"]["snapshots"]
    assert kept["frame"] == frames[1] > frames[0]
    callers[2].call("/sim/snapshots", remove=["a"])
    assert harness.bus.total.num_bytes == 0
