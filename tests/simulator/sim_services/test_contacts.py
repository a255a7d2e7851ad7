"""`/sim/collisions`: one message for each new contact."""

from __future__ import annotations

import base64

import pytest

from rosbridge_sim.world.geometry import near_pairs
from rosbridge_sim.world.state import placement
from tests.simulator.sim_harness import Client, SimHarness

COLLISIONS = "/sim/collisions"


def in_sync() -> tuple[SimHarness, Client]:
    """Vehicle 7 drives with 10 m/s along y = 0 towards vehicle 8, which stands."""
    harness = SimHarness("crowd", start="sync")
    client = harness.client()
    client.start()
    client.listen(COLLISIONS)
    return harness, client


def test_contact_is_told_once_and_again_after_it_has_ended() -> None:
    harness, client = in_sync()
    world = harness.world
    moving, standing = (world.row(uid) for uid in (7, 10))
    assert world.speed[moving] == 10.0
    for expected in (1, 2):
        place = {"x": float(world.x[standing]) - 4.6, "y": 0.5, "z": 0.0, "yaw": 0.0}
        placement.teleport(world, moving, **place, speed=10.0, is_ghost=False)
        for _ in range(5):
            client.tick()
        told = client.messages(COLLISIONS)
        assert len(told) == expected
        placement.teleport(world, moving, **(place | {"y": 50.0}), speed=0.0, is_ghost=False)
        client.tick()
    assert told[0]["id"] == [7, 10]
    assert list(base64.b64decode(told[0]["kind"])) == [1, 1]
    assert told[0]["name"] == [world.names[moving], world.names[standing]]
    assert told[0]["relative_speed"] == pytest.approx(10.0)
    assert told[0]["x"] == pytest.approx(world.x[standing] - world.bodies[standing].rear_overhang, abs=0.3)
    assert told[0]["y"] == pytest.approx(0.25)
    assert told[0]["frame"] == told[0]["header"]["seq"] > 0


def test_contacts_before_a_restore_or_without_a_subscriber_are_not_told_later() -> None:
    harness = SimHarness("crowd", start="sync")
    client = harness.client()
    client.start()
    world = harness.world
    place = {"x": float(world.x[world.row(10)]) - 3.0, "y": 0.5, "z": 0.0, "yaw": 0.0}
    placement.teleport(world, world.row(7), **place, speed=0.0, is_ghost=False)
    client.tick()
    assert len(world.contacts) == 1
    client.listen(COLLISIONS)
    client.tick()
    assert client.messages(COLLISIONS) == []
    client.call("/sim/snapshot", {"id": "touching"})
    client.call("/sim/reset", {"seed": -1})
    client.tick()
    client.call("/sim/restore", {"user_id": "me", "id": "touching"})
    client.tick()
    assert len(world.contacts) == 1
    assert client.messages(COLLISIONS) == []


def test_heap_of_entities_tells_the_first_contacts_alone() -> None:
    harness, client = in_sync()
    objects = [{"model": "kia k5", "place": {"x": 500.0, "y": 500.0}}] * 20
    client.call("/sim/spawn", {"objects": objects})
    client.tick()
    assert len(harness.world.contacts) == 190
    assert len(client.messages(COLLISIONS)) == 100


def test_partial_contacts_of_a_heap_are_told_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(near_pairs, "MAX_BOX_PAIRS", 400)
    _, client = in_sync()
    few, many = ([{"model": "kia k5", "place": {"x": 500.0, "y": 500.0}}] * num for num in (3, 100))
    told = []
    for objects in (few, many, few):
        client.call("/sim/spawn", {"objects": objects})
        client.tick()
        told.append(sum("on top of one another" in record.message for record in caplog.records))
    assert told == [0, 1, 1]
