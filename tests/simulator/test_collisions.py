"""Collision topics of egos and vehicles."""

from __future__ import annotations

from typing import Any

import pytest

from tests.simulator.sim_harness import Client, SimHarness, rates

AHEAD = 90.0  # the ego of "crowd" stands at (10, 20) and looks north [deg]


def in_sync(**settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings' own fields
    harness = SimHarness(start="sync", **settings)
    client = harness.client()
    client.start()
    client.listen("/CollisionData", "/VehicleCollisionData", "/Object_topic")
    return harness, client


def add(client: Client, name: str, x: float, y: float, heading: float = 0.0) -> None:
    position = {"x": x, "y": y, "z": 0.0}
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name=name, position=position, heading=heading, frame=0)


def test_collision_topic_without_a_hit_is_empty_and_keeps_its_rate() -> None:
    harness = SimHarness("parked", network=rates({"/CollisionData": 10.0}))
    client = harness.client()
    client.listen("/CollisionData", "/VehicleCollisionData")
    harness.run(1.0)
    ego, npcs = client.messages("/CollisionData"), client.messages("/VehicleCollisionData")
    assert [message["header"]["seq"] for message in ego] == list(range(5, 55, 5))
    assert len(npcs) == 50
    assert all(message["collision_object"] == [] == npc["collisions"] for message, npc in zip(ego, npcs, strict=False))
    assert {(m["global_offset_x"], m["global_offset_y"], m["global_offset_z"]) for m in ego} == {(0.0, 0.0, 0.0)}
    assert ego[0]["header"]["frame_id"] == "base_link"
    assert npcs[0]["header"]["frame_id"] == "VehicleCollisionData"


def test_drive_through_a_box_is_reported_from_first_to_last_touch_and_stops_nothing() -> None:
    _, client = in_sync()
    add(client, "Cargo_Box", 10.0, 40.0, AHEAD)
    client.control(0, longlCmdType=2, velocity=36.0)
    y = [client.tick()["vehicle_status"]["position"]["y"] for _ in range(300)]
    hits = [bool(message["collision_object"]) for message in client.messages("/CollisionData")]
    first, num = hits.index(True), sum(hits)
    assert hits[first : first + num] == [True] * num
    # The front is 3.58 m before the rear axle, the box 0.6 m to either side of its middle.
    assert y[first] + 3.58 >= 40.0 - 0.6 > y[first - 1] + 3.58
    assert y[first + num] - 0.89 > 40.0 + 0.6
    assert y[-1] > 60.0
    hit = client.messages("/CollisionData")[first]
    assert (hit["global_offset_x"], hit["global_offset_y"], hit["global_offset_z"]) == (10.0, 40.0, 0.0)
    (what,) = hit["collision_object"]
    assert what in client.messages("/Object_topic")[first]["obstacle_list"]
    assert (what["name"], what["type"], what["heading"]) == ("Cargo_Box", 2, pytest.approx(AHEAD))


def test_all_hit_objects_are_listed_by_id_with_the_position_of_the_first() -> None:
    _, client = in_sync()
    for name, x in (("Box", 9.5), ("Man", 10.5), ("2015_Kia_K5", 10.0)):
        add(client, name, x, 22.0)
    client.tick()
    (hit,) = client.messages("/CollisionData")
    assert [(what["name"], what["type"]) for what in hit["collision_object"]] == [
        ("Box", 2),
        ("Man", 0),
        ("2015_Kia_K5", 1),
    ]
    ids = [what["unique_id"] for what in hit["collision_object"]]
    assert ids == sorted(ids)
    assert hit["global_offset_x"] == 9.5


def test_vehicle_collisions_are_pairs_without_egos_and_pedestrians() -> None:
    _, client = in_sync()
    for x in (200.0, 203.0, 206.0):
        add(client, "2015_Kia_K5", x, 0.0)
    add(client, "Man", 200.0, 0.0)
    add(client, "2015_Kia_K5", 10.0, 20.0)
    client.tick()
    (message,) = client.messages("/VehicleCollisionData")
    pairs = [[what["position"]["x"] for what in one["crashed_vehicles"]] for one in message["collisions"]]
    assert pairs == [[200.0, 203.0], [203.0, 206.0]]
    assert len(client.messages("/CollisionData")[0]["collision_object"]) == 1


def test_removed_object_is_no_longer_hit() -> None:
    _, client = in_sync()
    add(client, "Box", 10.0, 20.0)
    client.tick()
    (hit,) = client.messages("/CollisionData")[-1]["collision_object"]
    client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=hit["unique_id"], frame=0)
    client.tick()
    assert client.messages("/CollisionData")[-1]["collision_object"] == []


@pytest.mark.slow
def test_many_touching_cars_give_a_bounded_message() -> None:
    _, client = in_sync()
    for _ in range(60):
        add(client, "2015_Kia_K5", 500.0, 0.0)
    client.tick()
    assert len(client.messages("/VehicleCollisionData")[0]["collisions"]) == 1_000
