from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.simulator.egos.tf_publisher import TfPublisher
from rosbridge_sim.world.geometry.planar import quaternion
from rosbridge_sim.world.state import placement
from tests.simulator.sim_harness import ALL, Client, SimHarness, rates

FRAME_NS = 20_000_000


def axis_turn(axis: int, angle: float) -> npt.NDArray[np.float64]:
    """The matrix of a turn about x, y or z."""
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    m = np.eye(3)
    m[i, i] = m[j, j] = math.cos(angle)
    m[i, j], m[j, i] = -math.sin(angle), math.sin(angle)
    return m


def turned(q: tuple[float, float, float, float], vector: list[float]) -> npt.NDArray[np.float64]:
    """q v q*, by quaternions written out."""

    def times(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.array([*(a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])), a[3] * b[3] - a[:3] @ b[:3]])

    a = np.array(q)
    return times(times(a, np.array([*vector, 0.0])), a * [-1, -1, -1, 1])[:3]


@pytest.mark.parametrize(
    ("roll", "pitch", "yaw"),
    [(0, 0, 0.3), (0, 0, math.pi), (0.1, 0, 0), (0, 0.2, 0), (0.1, -0.2, 2.5), (-1.0, 1.2, -3.0)],
)
def test_orientation_is_yaw_then_pitch_then_roll(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion(roll, pitch, yaw)
    assert math.hypot(*q) == pytest.approx(1.0, abs=1e-15)
    m = axis_turn(2, yaw) @ axis_turn(1, pitch) @ axis_turn(0, roll)
    for vector in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, -2.0, 5.0]):
        np.testing.assert_allclose(turned(q, vector), m @ vector, atol=1e-14)


def only(message: dict[str, Any]) -> dict[str, Any]:
    (transform,) = message["transforms"]
    found: dict[str, Any] = transform
    return found


def test_tf_has_the_ego_pose_of_every_frame() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.listen("/tf", "/Ego_topic")
    client.start()
    client.control(1, longlCmdType=2, velocity=30.0, steering=0.3)
    for _ in range(100):
        client.tick()
    statuses, messages = client.messages("/Ego_topic"), client.messages("/tf")
    assert len(messages) == len(statuses) == 100
    for i, (status, message) in enumerate(zip(statuses, messages, strict=True), start=1):
        transform = only(message)
        secs, nsecs = divmod(i * FRAME_NS, 1_000_000_000)
        assert transform["header"] == {"seq": i, "stamp": {"secs": secs, "nsecs": nsecs}, "frame_id": "map"}
        assert transform["child_frame_id"] == "base_link"
        assert transform["transform"]["translation"] == status["position"]
        half = math.radians(status["heading"]) / 2
        rotation = transform["transform"]["rotation"]
        assert rotation == pytest.approx({"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}, abs=1e-15)
    assert math.dist([*statuses[0]["position"].values()], [*statuses[-1]["position"].values()]) > 1.0


def test_a_vehicle_on_a_slope_is_tilted_in_tf() -> None:
    harness = SimHarness()
    placement.teleport(
        harness.world, harness.world.row(0), x=1.0, y=2.0, z=3.0, yaw=0.4, speed=0.0, roll=0.1, pitch=-0.2
    )
    message = TfPublisher(harness.bus.store, harness.world, Converter(harness.bus.store)).moving(harness.node.egos)
    transform = message.transforms[0].transform
    assert (transform.translation.x, transform.translation.y, transform.translation.z) == (1.0, 2.0, 3.0)
    q = transform.rotation
    assert (q.x, q.y, q.z, q.w) == quaternion(0.1, -0.2, 0.4)


def test_tf_has_its_own_rate_and_is_not_computed_without_subscribers() -> None:
    harness = SimHarness(network=rates({"/tf": 10.0}))
    num_published = harness.bus.delivery.num_published
    harness.run(1.0)
    assert harness.bus.delivery.num_published == num_published + 50  # /SyncModeInfo alone
    client = harness.client()
    client.listen("/tf")
    harness.run(1.0)
    assert [only(message)["header"]["seq"] for message in client.messages("/tf")] == list(range(55, 101, 5))


def test_vehicle_centre_frame_is_static_and_latched() -> None:
    harness = SimHarness()
    (message,) = harness.bus.topics["/tf_static"].latched
    transform, *_ = message.value.transforms
    body = harness.world.bodies[harness.world.row(0)]
    assert (transform.header.frame_id, transform.child_frame_id) == ("base_link", "vehicle_center")
    shift = transform.transform.translation
    assert (shift.x, shift.y, shift.z) == (body.centre, 0.0, body.height / 2)
    assert transform.transform.rotation.w == 1.0


def test_static_frames_are_published_again_only_after_a_change() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/tf_static")
    harness.run(1.0)
    client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
    assert client.messages("/tf_static") == []
    settings = {"number_of_ego_vehicle": 1, "ego_index": [2], "global_position_x": [5.0], "global_position_y": [6.0]}
    arrays = {name: [0.0] for name in ("global_position_z", "global_roll", "global_pitch", "global_yaw", "velocity")}
    client.send(
        "/ego_setting", "morai_msgs/MultiEgoSetting", camera_index=0, gear=[4], ctrl_mode=[16], **settings, **arrays
    )
    client.listen("/tf")
    harness.run(0.02)
    names = [(t["header"]["frame_id"], t["child_frame_id"]) for t in client.messages("/tf_static")[-1]["transforms"]]
    assert names == [
        (f"{ego}base_link", f"{ego}{name}")
        for ego in ("", "Ego-2/")
        for name in ("vehicle_center", "gps_link", "imu_link")
    ]
    egos = client.messages("/tf")[-1]["transforms"]
    assert [(t["header"]["frame_id"], t["child_frame_id"]) for t in egos] == [
        ("map", "base_link"),
        ("map", "Ego-2/base_link"),
    ]
    assert egos[1]["transform"]["translation"] == {"x": 5.0, "y": 6.0, "z": 0.0}
    client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
    assert len(client.messages("/tf_static")) == 2
    assert client.messages("/tf_static")[-1]["transforms"][0]["child_frame_id"] == "vehicle_center"
    assert len(client.messages("/tf_static")[-1]["transforms"]) == 3


def test_empty_static_frames_are_published() -> None:
    harness = SimHarness()
    transforms = TfPublisher(harness.bus.store, harness.world, Converter(harness.bus.store))
    assert transforms.static(transforms.mounts([])).transforms == []


def test_clients_may_publish_further_frames() -> None:
    harness = SimHarness()
    camera = {"header": {"frame_id": "base_link"}, "child_frame_id": "camera", "transform": {"rotation": {"w": 1.0}}}
    harness.client().send("/tf_static", "tf2_msgs/TFMessage", transforms=[camera])
    harness.client().send("/tf", "tf2_msgs/TFMessage", transforms=[camera])
    assert len(harness.bus.topics["/tf_static"].latched) == 2
    with pytest.raises(GraphError):
        harness.client().send("/clock", "rosgraph_msgs/Clock")


def test_tf_accepts_its_old_type_name() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/tf", "tf/tfMessage", transforms=[])
    assert harness.bus.topics["/tf"].type.name == "tf2_msgs/TFMessage"


def test_latched_messages_after_a_reset_are_of_frame_0() -> None:
    harness = SimHarness()
    (before,) = harness.bus.topics["/tf_static"].latched
    harness.run(0.5)
    assert harness.client().call("/sim/reset", {"seed": -1}).is_ok
    (after,) = harness.bus.topics["/tf_static"].latched
    assert after is not before
    assert after.json == before.json


# With the republisher


def subscribe(client: Client, harness: SimHarness, *sources: str, rate: float = 0.0) -> list[Any]:
    """Feedback of a goal, as structs."""
    heard: list[Any] = []
    request = {"source_frames": list(sources), "target_frame": "map", "rate": rate}
    harness.bus.actions.send(
        client, "/tf2_web_republisher", request, heard.append, lambda message: heard.extend(message.value.transforms)
    )
    return heard


def test_republished_transforms_of_a_tick_come_before_its_answer() -> None:
    harness = SimHarness(start="sync")
    WebRepublisher(harness.bus)
    client = harness.client()
    heard = subscribe(client, harness, "base_link", "vehicle_center")
    client.start(time_step=100)
    for tick in range(1, 4):
        client.control(0, longlCmdType=2, velocity=30.0)
        client.tick()
        assert heard[-1].header.stamp == harness.bus.store.time_value(tick * 5 * FRAME_NS)
    ego, center = heard[-2:]
    assert (ego.child_frame_id, center.child_frame_id) == ("base_link", "vehicle_center")
    row = harness.world.row(0)
    assert ego.transform.translation.x == harness.world.x[row]
    offset = harness.world.bodies[row].centre
    yaw = harness.world.yaw[row]
    shift = center.transform.translation
    assert shift.x == pytest.approx(harness.world.x[row] + offset * math.cos(yaw), abs=1e-12)
    assert shift.y == pytest.approx(harness.world.y[row] + offset * math.sin(yaw), abs=1e-12)


def test_republishing_gives_the_same_bytes_at_any_speed() -> None:
    runs = []
    for pause in (0.0, 3.3):
        harness = SimHarness(start="sync")
        republisher = WebRepublisher(harness.bus)
        client = harness.client()
        heard = subscribe(client, harness, "base_link", rate=10.0)
        client.start()
        for _ in range(40):
            client.control(0, longlCmdType=1, accel=1.0, steering=0.1)
            client.tick()
            harness.now += pause
            republisher.advance(harness.now)
        runs.append([str(transform) for transform in heard])
    assert runs[0] == runs[1]
    assert len(runs[0]) == 9  # frame 1, then every fifth
