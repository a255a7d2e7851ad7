"""`--tf-frames`: the frame `odom` of REP 105, on /tf and /odom."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from rosbridge_sim.simulator.egos.odometry import Origin, move_origin, seen_from
from tests.simulator.sim_harness import ALL, Client, SimHarness, put_egos

Pose = tuple[float, float, float]
"""x, y [m] and yaw [rad]."""

MOST_IN_A_FRAME = 0.7
"""Longest way in 20 ms of any drive here [m]."""


@pytest.fixture
def sim() -> SimHarness:
    return SimHarness("crowd", standard_topics=True, tf_frames="map-odom")


@pytest.fixture
def client(sim: SimHarness) -> Client:
    client = sim.client()
    client.listen("/tf", "/odom", "/Ego_topic")
    return client


def drive(sim: SimHarness, client: Client, seconds: float) -> None:
    client.now = sim.now
    client.send("/cmd_vel", "geometry_msgs/Twist", linear={"x": 8.0}, angular={"z": 0.5})
    sim.run(seconds)


def teleport(client: Client, **fields: float) -> None:
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0) | {n: [v] for n, v in fields.items()})


def transforms(client: Client, child: str) -> list[Pose]:
    """Poses of a frame in its parent, of all messages."""
    found = [one for message in client.messages("/tf") for one in message["transforms"]]
    return [flat(one["transform"]) for one in found if one["child_frame_id"] == child]


def flat(transform: dict[str, Any]) -> Pose:
    place = transform.get("translation") or transform["position"]
    axes = transform.get("rotation") or transform["orientation"]
    return place["x"], place["y"], 2.0 * math.atan2(axes["z"], axes["w"])


def joined(upper: Pose, lower: Pose) -> Pose:
    cos, sin = math.cos(upper[2]), math.sin(upper[2])
    x, y = cos * lower[0] - sin * lower[1], sin * lower[0] + cos * lower[1]
    return upper[0] + x, upper[1] + y, math.remainder(upper[2] + lower[2], math.tau)


def is_continuous(poses: list[Pose]) -> bool:
    return all(math.dist(a[:2], b[:2]) < MOST_IN_A_FRAME for a, b in pairwise(poses))


def test_an_ego_starts_at_zero_and_both_transforms_give_its_pose_in_the_map(sim: SimHarness, client: Client) -> None:
    sim.run(0.02)
    assert transforms(client, "base_link") == [(0.0, 0.0, 0.0)]
    drive(sim, client, 2.0)
    (fixed,) = set(transforms(client, "odom"))
    names = [(one["header"]["frame_id"], one["child_frame_id"]) for one in client.messages("/tf")[-1]["transforms"]]
    assert names[:2] == [("map", "odom"), ("odom", "base_link")]
    for pose, ego in zip(transforms(client, "base_link"), client.messages("/Ego_topic"), strict=True):
        there = ego["position"]["x"], ego["position"]["y"], math.radians(ego["heading"])
        assert joined(fixed, pose) == pytest.approx(there, abs=1e-9)
    assert math.hypot(*transforms(client, "base_link")[-1][:2]) > 1.0
    odometry = client.messages("/odom")[-1]
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("odom", "base_link")
    assert flat(odometry["pose"]["pose"]) == transforms(client, "base_link")[-1]


def test_a_teleport_a_load_and_a_far_ghost_move_odom_and_not_the_ego_in_it(sim: SimHarness, client: Client) -> None:
    drive(sim, client, 1.0)
    for jump in (
        lambda: teleport(client, global_position_x=-400.0, global_position_y=70.0, global_yaw=130.0),
        lambda: client.ask("/Service_MoraiSL", file_name="crossing", **ALL),
        lambda: client.send("/ghost_ctrl_cmd", "morai_msgs/GhostMessage", position={"x": 90.0}),
    ):
        before = transforms(client, "odom")[-1]
        jump()
        drive(sim, client, 0.6)
        assert math.dist(transforms(client, "odom")[-1][:2], before[:2]) > 10.0
    assert is_continuous(transforms(client, "base_link"))
    ego = client.messages("/Ego_topic")[-1]
    last = joined(transforms(client, "odom")[-1], transforms(client, "base_link")[-1])
    assert last[:2] == pytest.approx((ego["position"]["x"], ego["position"]["y"]), abs=1e-9)


def test_a_ghost_that_goes_on_drives_in_odom(sim: SimHarness, client: Client) -> None:
    for i in range(20):
        client.send("/ghost_ctrl_cmd", "morai_msgs/GhostMessage", position={"x": 90.0 + 0.5 * i})
        sim.run(0.02)
    poses = transforms(client, "base_link")
    assert math.dist(poses[0][:2], poses[-1][:2]) == pytest.approx(9.5)
    assert len(set(transforms(client, "odom"))) == 1


def test_reset_and_restore_give_the_same_bytes_again(sim: SimHarness, client: Client) -> None:
    def run_on() -> list[bytes]:
        client.raw.clear()
        teleport(client, global_position_x=30.0, global_yaw=40.0)
        drive(sim, client, 0.4)
        return list(client.raw)

    first = run_on()
    client.call("/sim/reset", {"seed": -1})
    assert run_on() == first
    client.call("/sim/snapshot", {"id": "here"})
    second = run_on()
    assert client.call("/sim/restore", {"id": "here", "user_id": "me"}).is_ok
    assert run_on() == second != first


def test_a_localization_of_the_user_publishes_map_to_odom_itself() -> None:
    sim = SimHarness("crowd", standard_topics=True, tf_frames="odom")
    client = sim.client()
    client.listen("/tf")
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2))
    sim.run(0.02)
    names = [(one["header"]["frame_id"], one["child_frame_id"]) for one in client.messages("/tf")[-1]["transforms"]]
    bases = [one for one in names if one[1].endswith("base_link")]
    assert bases == [("odom", "base_link"), ("Ego-2/odom", "Ego-2/base_link")]
    assert not any("map" in one for one in names)


@pytest.mark.parametrize("after", [(5.0, -3.0, 1.0, 2.0), (1e5, 2e5, -7.0, -3.1)])
def test_a_moved_origin_keeps_the_pose_in_odom(after: Origin) -> None:
    origin, before = (10.0, 20.0, 1.0, 3.0), (14.0, 17.0, 2.0, -3.0)
    assert seen_from(origin, origin) == (0.0, 0.0, 0.0, 0.0)
    pose = seen_from(origin, before)
    assert pose[3] == pytest.approx(math.tau - 6.0)
    assert seen_from(move_origin(origin, before, after), after) == pytest.approx(pose, abs=1e-9)
    assert move_origin(origin, before, before) is origin
