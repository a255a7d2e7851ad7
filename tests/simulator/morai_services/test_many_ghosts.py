"""Thousands of ghosts in one message: they are placed in turns of their own, all at once, in the order of messages."""

from __future__ import annotations

import json
from collections import deque
from typing import Any

import pytest

from rosbridge_sim.morai.messages import command_parsing
from rosbridge_sim.simulator.kernel.late_work import MAX_WAITING
from rosbridge_sim.simulator.morai_services import command_topics
from tests.graph.bus_fixture import make_peer
from tests.simulator.sim_harness import ALL, SimHarness, put_egos


class Publisher:
    """A client over the wire that publishes ghosts, and waits where it is held."""

    def __init__(self, harness: SimHarness) -> None:
        self.peer, self._outbox = make_peer(harness.bus)
        self.peer.on_released = self._go_on
        self._backlog: deque[bytes] = deque()

    def place(self, *places: tuple[int, float], name: str = "Bus") -> None:
        npcs = [{"unique_id": uid, "name": name, "position": {"x": x, "y": 60.0}} for uid, x in places]
        op = {"op": "publish", "topic": "/NpcGhost_Topic", "type": "morai_msgs/NpcGhostCmd", "msg": {"npc_list": npcs}}
        self._backlog.append(json.dumps(op).encode())
        self._go_on()

    def told(self) -> list[dict[str, Any]]:
        return [json.loads(frame) for frame in self._outbox.take(2**40)]

    def _go_on(self) -> None:
        while self._backlog and not self.peer.is_held:
            self.peer.receive(self._backlog.popleft(), 0.0)


@pytest.fixture
def harness(monkeypatch: pytest.MonkeyPatch) -> SimHarness:
    monkeypatch.setattr(command_topics, "MANY_GHOSTS", 2)
    harness = SimHarness("empty", start="sync")
    harness.node.limit_turns(lambda: 0.0)
    return harness


def turn(harness: SimHarness) -> None:
    assert harness.node.next_due(0.0) == 0.0, "a turn is wanted at once"
    harness.node.advance(0.0)
    harness.node.advance(0.0)  # the world's turn


def xs(harness: SimHarness, *uids: int) -> list[float]:
    return [harness.world.x.item(harness.world.row(uid)) for uid in uids if uid in harness.world]


def test_many_ghosts_appear_all_at_once_in_a_later_turn(harness: SimHarness) -> None:
    publisher, num = Publisher(harness), len(harness.world)
    publisher.place((50, 1.0), (51, 2.0), (52, 3.0))
    assert len(harness.world) == num
    turn(harness)
    assert len(harness.world) == num, "the first turn reads"
    turn(harness)
    assert xs(harness, 50, 51, 52) == [1.0, 2.0, 3.0]
    assert harness.node.next_due(0.0) is None


def test_next_message_of_the_client_waits_and_others_do_not(harness: SimHarness) -> None:
    publisher, other = Publisher(harness), Publisher(harness)
    publisher.place((50, 1.0), (51, 2.0), (52, 3.0))
    publisher.place((50, 9.0))
    other.place((70, 5.0))
    assert xs(harness, 50, 70) == [5.0]
    turn(harness)
    turn(harness)
    assert xs(harness, 50, 51, 52, 70) == [9.0, 2.0, 3.0, 5.0]


def test_world_moves_in_every_second_turn_whatever_waits() -> None:
    harness = SimHarness("empty")
    harness.node.limit_turns(lambda: 0.0)
    harness.run(0.1)
    places = [(100 + i, float(i)) for i in range(command_topics.MANY_GHOSTS + 1)]
    for _ in range(4):
        Publisher(harness).place(*places)
    moved = []
    for _ in range(8):
        frame = harness.world.frame
        harness.now += 0.02
        harness.node.advance(harness.now)
        moved.append(harness.world.frame > frame)
    assert moved == [False, True] * 4


def test_message_beyond_those_that_wait_is_carried_out_at_once(harness: SimHarness) -> None:
    waiting = [Publisher(harness) for _ in range(MAX_WAITING)]
    for i, publisher in enumerate(waiting):
        publisher.place((50, float(i)), (51, 2.0), (52, 3.0))
    assert xs(harness, 50) == []
    last = Publisher(harness)
    last.place((70, 1.0), (71, 2.0), (72, 3.0))
    assert xs(harness, 70) == [1.0]
    assert not last.peer.is_held
    last.place((70, 1.0), (71, 1e300), (72, 3.0))
    assert "expected finite numbers" in last.told()[-1]["msg"]
    for _ in range(2 * MAX_WAITING):
        turn(harness)
    assert xs(harness, 50) == [MAX_WAITING - 1.0]
    assert not any(publisher.peer.is_held for publisher in waiting)


@pytest.mark.parametrize("what", ["leaves", "reset", "load", "ego"])
def test_what_happens_between_the_turns_of_a_message_meets_it_whole(harness: SimHarness, what: str) -> None:
    publisher, client = Publisher(harness), harness.client()
    publisher.place((50, 1.0), (51, 2.0), (52, 3.0))
    turn(harness)
    if what == "leaves":
        publisher.peer.leave(0.0)
    elif what == "reset":
        harness.node.reset(None, 0.0)
    elif what == "load":
        client.ask("/Service_MoraiSL", file_name="parked", **ALL)
    else:
        client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 51))
    num = len(harness.world)
    turn(harness)
    assert len(harness.world) == (num if what == "ego" else num + 3)
    assert not publisher.peer.is_held
    assert harness.bus.guard.num_faults == 0
    if what == "ego":
        assert "it is an ego's" in publisher.told()[-1]["msg"]


def test_mistake_among_many_ghosts_is_told_and_moves_nothing(harness: SimHarness) -> None:
    publisher, before = Publisher(harness), harness.world.digest()
    publisher.place((50, 1.0), (51, 1e300), (52, 3.0))
    publisher.place((50, 1.0), (51, 2.0), (0, 3.0))
    for _ in range(4):
        if harness.node.next_due(0.0) is not None:
            turn(harness)
    (bad, ego) = [told["msg"] for told in publisher.told() if told["op"] == "status"]
    assert "npc_list[1]: expected finite numbers" in bad
    assert "an ego's" in ego
    assert harness.world.digest() == before
    assert not publisher.peer.is_held


def test_internal_error_ends_the_work_and_releases_its_client(
    harness: SimHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command_parsing, "MAX_COORDINATE", None)  # a bug: no number can be compared with it
    publisher = Publisher(harness)
    publisher.place((50, 1.0), (51, 2.0), (52, 3.0))
    turn(harness)
    assert harness.bus.guard.num_faults == 1
    assert not publisher.peer.is_held
    assert harness.node.context.failure.why is None


def test_ghosts_of_a_failed_world_are_refused(harness: SimHarness) -> None:
    publisher, num = Publisher(harness), len(harness.world)
    publisher.place((50, 1.0), (51, 2.0), (52, 3.0))
    turn(harness)
    harness.node.interfaces.why_closed = "the world has failed"
    turn(harness)
    assert len(harness.world) == num
    assert "the world has failed" in publisher.told()[-1]["msg"]
