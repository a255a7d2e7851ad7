"""Published poses and motion: reference points, and consistency of the values."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from rosbridge_sim.morai.releases import FIELD, MANUAL, Profile
from rosbridge_sim.scenarios.catalogue import DEFAULT_EGO
from tests.simulator.sim_harness import Client, SimHarness, put_egos

DT = 0.02
LISTS = ("npc_list", "pedestrian_list", "obstacle_list")


def objects(message: dict[str, Any]) -> dict[int, dict[str, Any]]:
    """Those of an ObjectStatusList by their ids."""
    return {one["unique_id"]: one for name in LISTS for one in message[name]}


def on_map(one: dict[str, Any], field: str) -> tuple[float, float, float]:
    """A vector of an object's own frame in that of the map."""
    vector, yaw = one[field], math.radians(one["heading"])
    turned = complex(vector["x"], vector["y"]) * complex(math.cos(yaw), math.sin(yaw))
    return turned.real, turned.imag, vector["z"]


def drive(client: Client, frames: int, **command: float) -> list[dict[int, dict[str, Any]]]:
    """Tick, with ego 2 under a command, and return the objects of each frame."""
    client.listen("/Object_topic")
    client.start()
    client.ask("/Ego-2/SyncModeCtrlCmd", frame=0, command=command)  # the last command holds
    for _ in range(frames):
        client.tick()
    return [objects(message) for message in client.messages("/Object_topic")]


@pytest.mark.parametrize("profile", [MANUAL, FIELD])
def test_position_is_the_rear_axle_of_vehicles_and_the_centre_of_other_objects(profile: Profile) -> None:
    harness = SimHarness(start="sync", profile=profile)  # the ego stands at (10, 20) and looks north
    client = harness.client()
    client.start()
    client.listen("/Object_topic", "/Ego_topic")
    client.tick()
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    ((_, _, files),) = harness.drawer.saved
    listed, (ego,) = objects(client.messages("/Object_topic")[0]), client.messages("/Ego_topic")
    assert (ego["position"]["x"], ego["position"]["y"]) == (10.0, 20.0)
    lines = [[float(figure) for figure in line.split()] for line in files["BOXES_{}.txt"].splitlines()]
    assert {line[-1] for line in lines} == set(listed)
    for _, ahead, left, *_, uid in lines:
        one = listed[int(uid)]
        middle = complex(10.0 - left, 20.0 + ahead)  # of its box
        offset = middle - complex(one["position"]["x"], one["position"]["y"])
        offset *= complex(math.cos(math.radians(one["heading"])), -math.sin(math.radians(one["heading"])))
        body = DEFAULT_EGO.body
        expected = body.length / 2.0 - body.rear_overhang if one["type"] == 1 else 0.0
        assert (offset.real, offset.imag) == pytest.approx((expected, 0.0), abs=1e-3), one["name"]


@pytest.mark.slow
@pytest.mark.parametrize(("profile", "unit"), [(MANUAL, 1.0 / 3.6), (Profile(object_velocity_unit="m/s"), 1.0)])
def test_object_accelerations_are_differences_of_object_velocities(profile: Profile, unit: float) -> None:
    harness = SimHarness("crossing", start="sync", profile=profile)
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2) | {"camera_index": 0})
    frames = drive(client, 500, longlCmdType=2, velocity=20.0, steering=0.2)
    assert max(one["type"] for one in frames[0].values()) == 1
    waiting = 0
    for before, now in pairwise(frames):
        for uid in now.keys() & before.keys():
            first, second = before[uid], now[uid]
            speeds = on_map(first, "velocity"), on_map(second, "velocity")
            difference = [(b - a) * unit / DT for a, b in zip(*speeds, strict=True)]
            # An ego tells its figures of the end of the step, here as in its own topic.
            error = max(abs(a - b) for a, b in zip(on_map(second, "acceleration"), difference, strict=True))
            assert error <= (0.1 if second["type"] < 0 else 1e-6)
            if first["velocity"] == second["velocity"] == {"x": 0.0, "y": 0.0, "z": 0.0}:
                waiting += 1
                assert second["acceleration"] == {"x": 0.0, "y": 0.0, "z": 0.0}
    assert waiting > 100, "somebody waits at the light"


def test_other_egos_are_listed_as_in_their_own_status() -> None:
    harness = SimHarness("parked", start="sync")
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2) | {"camera_index": 0})
    client.listen("/Ego-2/Ego_topic")
    seen = drive(client, 200, longlCmdType=2, velocity=20.0, steering=0.2)[-1][2]
    told = client.messages("/Ego-2/Ego_topic")[-1]
    assert seen["acceleration"] == told["acceleration"]
    assert seen["acceleration"]["y"] > 1.0
    assert seen["velocity"]["x"] == pytest.approx(3.6 * told["velocity"]["x"])
    assert (seen["position"], seen["heading"]) == (told["position"], told["heading"])


@pytest.mark.parametrize("name", ["", "shot"])
def test_files_without_a_custom_name_are_named_after_their_frame(name: str) -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start()
    for _ in range(7):
        client.tick()
    client.send(
        "/SaveSensorData", "morai_msgs/SaveSensorData", is_custom_file_name=False, custom_file_name=name, file_dir=""
    )
    assert [saved[1] for saved in harness.drawer.saved] == ["frame_000007"]
