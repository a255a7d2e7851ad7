"""Standard messages of ROS beside MORAI's: where the ego is, and commands with speed and angle."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from rosbridge_sim.errors import FieldError, GraphError
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.world.state.world import Dynamics
from tests.simulator.sim_harness import Client, SimHarness

TWIST = "geometry_msgs/Twist"
ACKERMANN = "ackermann_msgs/AckermannDriveStamped"


@pytest.fixture
def sim() -> SimHarness:
    return SimHarness("crowd", standard_topics=True, dynamics=Dynamics.SINGLE_TRACK)


@pytest.fixture
def client(sim: SimHarness) -> Client:
    client = sim.client()
    client.listen("/odom", "/fix", "/gps", "/Ego_topic")
    return client


def test_odometry_is_the_ego_s_state_in_the_map(sim: SimHarness, client: Client) -> None:
    client.send("/ackermann_cmd", ACKERMANN, drive={"speed": 5.0, "steering_angle": 0.1})
    sim.run(2.0)
    odometry, ego = client.messages("/odom")[-1], client.messages("/Ego_topic")[-1]
    pose, twist = odometry["pose"]["pose"], odometry["twist"]["twist"]
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("map", "base_link")
    assert pose["position"] == ego["position"]
    assert 2.0 * math.atan2(pose["orientation"]["z"], pose["orientation"]["w"]) == pytest.approx(
        math.radians(ego["heading"]),
        abs=1e-3,  # the body leans a little
    )
    assert twist["linear"] == ego["velocity"]
    assert twist["angular"]["z"] > 0.0


def test_fix_is_what_the_gps_tells(sim: SimHarness, client: Client) -> None:
    sim.run(0.02)
    fix, gps = client.messages("/fix")[-1], client.messages("/gps")[-1]
    for name in ("header", "latitude", "longitude", "altitude"):
        assert fix[name] == gps[name]
    assert fix["status"] == {"status": 0 if gps["status"] else -1, "service": 1}


@pytest.mark.parametrize("ros", [1, 2])
def test_a_stamped_twist_is_taken_instead_if_it_was_chosen(ros: Generation) -> None:
    sim = SimHarness("crowd", standard_topics=True, cmd_vel="TwistStamped", ros=ros)
    client = sim.client()
    client.listen("/odom")
    client.send("/cmd_vel", "geometry_msgs/TwistStamped", twist={"linear": {"x": 3.0}})
    sim.run(3.0)
    assert client.messages("/odom")[-1]["twist"]["twist"]["linear"]["x"] == pytest.approx(3.0, abs=0.1)
    with pytest.raises(FieldError, match=r"TwistStamped.twist.linear.x: expected a finite number"):
        client.send("/cmd_vel", "geometry_msgs/TwistStamped", twist={"linear": {"x": math.nan}})
    with pytest.raises(GraphError, match=r"geometry_msgs/(msg/)?TwistStamped"):
        client.send("/cmd_vel", TWIST, linear={"x": 3.0})


@pytest.mark.parametrize("direction", [1, -1])
def test_a_twist_gives_speed_and_yaw_rate_also_backwards(sim: SimHarness, client: Client, direction: int) -> None:
    for _ in range(120):
        client.send("/cmd_vel", TWIST, linear={"x": 3.0 * direction}, angular={"z": 0.2})
        sim.run(0.02)
    twist = client.messages("/odom")[-1]["twist"]["twist"]
    assert twist["linear"]["x"] == pytest.approx(3.0 * direction, abs=0.1)
    assert twist["angular"]["z"] == pytest.approx(0.2, abs=0.02)


def test_the_direction_changes_after_a_stand(sim: SimHarness, client: Client) -> None:
    for speed, frames in ((4.0, 110), (-2.0, 170)):
        for _ in range(frames):
            client.send("/ackermann_cmd", ACKERMANN, drive={"speed": speed})
            sim.run(0.02)
    speeds = [message["twist"]["twist"]["linear"]["x"] for message in client.messages("/odom")]
    assert max(speeds) == pytest.approx(4.0, abs=0.2)
    assert speeds[-1] == pytest.approx(-2.0, abs=0.1)
    assert max(abs(after - before) for before, after in pairwise(speeds)) < 0.4


def test_a_command_to_stand_stops_and_keeps_the_gear(sim: SimHarness, client: Client) -> None:
    for speed, frames in ((4.0, 100), (0.0, 200)):
        client.send("/cmd_vel", TWIST, linear={"x": speed})
        sim.run(0.02 * frames)
    assert client.messages("/odom")[-1]["twist"]["twist"]["linear"]["x"] == 0.0


def test_synchronous_mode_ignores_them_and_says_so(client: Client) -> None:
    client.start()
    client.send("/cmd_vel", TWIST, linear={"x": 5.0})
    client.tick()
    assert client.messages("/odom")[-1]["twist"]["twist"]["linear"]["x"] == 0.0
    assert any("/cmd_vel is ignored in synchronous mode" in text for _, text in client.told)


@pytest.mark.parametrize(
    ("topic", "type_name", "fields"),
    [
        ("/cmd_vel", TWIST, {"linear": {"x": math.nan}}),
        ("/cmd_vel", TWIST, {"angular": {"z": math.inf}}),
        ("/ackermann_cmd", ACKERMANN, {"drive": {"steering_angle": math.nan}}),
    ],
)
def test_numbers_that_are_not_finite_are_refused(
    sim: SimHarness, client: Client, topic: str, type_name: str, fields: dict[str, dict[str, float]]
) -> None:
    with pytest.raises(FieldError, match="expected a finite number"):
        client.send(topic, type_name, **fields)
    sim.run(0.02)


def test_without_the_setting_there_are_none() -> None:
    sim = SimHarness("crowd")
    assert "/odom" not in sim.bus.topics
    assert "/cmd_vel" not in sim.bus.topics


def test_a_topic_stops_the_world_and_lets_it_go_on(sim: SimHarness, client: Client) -> None:
    client.now = sim.now
    client.send("/sim/pause", "std_msgs/Bool", data=True)
    sim.run(1.0)
    assert sim.world.frame == 0
    client.now = sim.now
    client.send("/sim/pause", "std_msgs/Bool", data=False)
    sim.run(0.1)
    assert sim.world.frame == 5


def test_a_topic_resets_the_world(sim: SimHarness, client: Client) -> None:
    sim.run(1.0)
    client.send("/sim/reset", "std_msgs/Empty")
    assert sim.world.frame == 0
