"""Poses on hills: every topic with a pose has height, pitch and roll of the ground."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.geometry.planar import quaternion, rotate
from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.state.world import Dynamics
from tests.simulator.sim_harness import Client, SimHarness
from tests.world.road_factory import line, make

SLOPE = 0.08
TILT = quaternion(0.0, -math.atan(SLOPE), 0.0)


def on_slope() -> tuple[SimHarness, Client]:
    """A simulator on a road to the east that rises, with one ego; it has just been put there."""
    harness = SimHarness("parked", start="sync", dynamics=Dynamics.SINGLE_TRACK)
    points = line((-1000.0, 0.0), (1000.0, 0.0))
    points[:, 2] = SLOPE * points[:, 0]
    harness.world.lay_roads(make(a=(points, "")))
    client = harness.client()
    client.start()
    return harness, client


def last(client: Client, topic: str) -> dict[str, Any]:
    return client.messages(topic)[-1]


def done(client: Client, service: str, **request: object) -> dict[str, Any]:
    answer = client.call(service, request)
    assert isinstance(answer.values, Message)
    values: dict[str, Any] = json.loads(answer.values.json)
    assert values["result"], values["message"]
    return values


def test_all_topics_with_a_pose_have_that_of_the_slope() -> None:
    _, client = on_slope()
    client.listen("/Ego_topic", "/Object_topic", "/tf", "/imu", "/gps")
    number = done(client, "/sim/spawn", objects=[{"model": "2015_Kia_K5", "place": {"x": 50.0, "y": 1.0}}])[
        "unique_ids"
    ][0]
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **teleport_to(20.0))
    for _ in range(5):
        client.tick()
    ego = last(client, "/Ego_topic")["position"]
    assert (ego["x"], ego["z"]) == (20.0, pytest.approx(20.0 * SLOPE))
    (other,) = [each for each in last(client, "/Object_topic")["npc_list"] if each["unique_id"] == number]
    assert other["position"]["z"] == pytest.approx(50.0 * SLOPE)
    (transform,) = (each["transform"] for each in last(client, "/tf")["transforms"])
    assert transform["translation"]["z"] == pytest.approx(20.0 * SLOPE)
    turn = transform["rotation"]
    assert [turn[axis] for axis in "xyzw"] == pytest.approx(TILT, abs=1e-9)
    imu = last(client, "/imu")
    assert [imu["orientation"][axis] for axis in "xyzw"] == pytest.approx(TILT, abs=1e-9)
    felt = imu["linear_acceleration"]
    assert (felt["x"], felt["z"]) == pytest.approx(
        (GRAVITY * math.sin(math.atan(SLOPE)), GRAVITY * math.cos(math.atan(SLOPE)))
    )
    assert last(client, "/gps")["altitude"] == pytest.approx(20.0 * SLOPE + 5.0)


def teleport_to(x: float) -> dict[str, Any]:
    zeros = [0.0]
    return {
        "number_of_ego_vehicle": 1,
        "camera_index": 0,
        "ego_index": [0],
        "global_position_x": [x],
        "global_position_y": zeros,
        "global_position_z": zeros,
        "global_roll": zeros,
        "global_pitch": zeros,
        "global_yaw": zeros,
        "velocity": zeros,
        "gear": [4],
        "ctrl_mode": [16],
    }


def test_drive_uphill_keeps_height_and_orientation_together() -> None:
    harness, client = on_slope()
    client.listen("/Ego_topic", "/tf")
    client.control(1, longlCmdType=2, velocity=50.0)
    for _ in range(60):
        client.tick()
        ego = last(client, "/Ego_topic")["position"]
        assert ego["z"] == pytest.approx(SLOPE * ego["x"], abs=1e-6)
    turn = last(client, "/tf")["transforms"][0]["transform"]["rotation"]
    ahead = rotate(tuple(turn[axis] for axis in "xyzw"), (1.0, 0.0, 0.0))
    body = -harness.world.lean_pitch.item(0)
    assert math.asin(ahead[2]) == pytest.approx(math.atan(SLOPE) + body, abs=1e-6)
    assert body > 0.0, "it accelerates, so the nose is up"


def test_topics_tell_how_fast_the_ego_climbs() -> None:
    harness, client = on_slope()
    client.listen("/Ego_topic", "/imu", "/ReplayInfo_topic")
    client.control(1, longlCmdType=2, velocity=50.0)
    heights = []
    for _ in range(60):
        client.tick()
        ego = last(client, "/Ego_topic")
        heights.append(ego["position"]["z"])
    assert ego["velocity"]["z"] == pytest.approx(SLOPE * ego["velocity"]["x"], rel=1e-6)
    assert ego["velocity"]["z"] == pytest.approx((heights[-1] - heights[-2]) / 0.02, rel=0.03)
    assert ego["acceleration"]["z"] == pytest.approx(SLOPE * ego["acceleration"]["x"], abs=1e-6)
    assert ego["acceleration"]["z"] > 0.1
    assert last(client, "/ReplayInfo_topic")["linear_acceleration"]["z"] == ego["acceleration"]["z"]
    felt = last(client, "/imu")["linear_acceleration"]
    up = rotate(quaternion(harness.world.roll.item(0), harness.world.pitch.item(0), 0.0), tuple(felt.values()))[2]
    assert up == pytest.approx(GRAVITY + ego["acceleration"]["z"], abs=1e-6)


def test_snapshot_keeps_height_pitch_and_roll() -> None:
    harness, client = on_slope()
    client.control(1, longlCmdType=2, velocity=50.0)
    for _ in range(20):
        client.tick()
    pose = harness.world.block("pitch", "roll").copy(), harness.world.z.copy()
    digest = harness.world.digest()
    done(client, "/sim/snapshot", id="hill")
    for _ in range(20):
        client.tick()
    done(client, "/sim/restore", id="hill", user_id="me")
    assert harness.world.digest() == digest
    assert np.array_equal(harness.world.block("pitch", "roll"), pose[0])
    assert np.array_equal(harness.world.z, pose[1])
