"""A client that waits for a camera is told that there is none."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim.graph.unpublished import UNPUBLISHED_AFTER
from tests.graph.bus_fixture import make_peer
from tests.simulator.sim_harness import SimHarness


@pytest.mark.parametrize(
    ("topic", "type_name", "word"),
    [
        ("/image_jpeg/compressed", "sensor_msgs/CompressedImage", "no camera: its sensors are GPS and IMU"),
        ("/lidar3D", "sensor_msgs/PointCloud2", "no lidar: its sensors are GPS and IMU"),
        ("/radar", "morai_msgs/RadarDetections", "no radar: its sensors are GPS and IMU"),
        ("/ego", "morai_msgs/EgoVehicleStatus", "of this type there is /Ego_topic"),
    ],
)
def test_subscriber_of_a_missing_sensor_is_notified(topic: str, type_name: str, word: str) -> None:
    harness = SimHarness()
    peer, outbox = make_peer(harness.bus)
    for op in ({"op": "set_level", "level": "info"}, {"op": "subscribe", "topic": topic, "type": type_name}):
        peer.receive(json.dumps(op).encode(), 0.0)
    harness.bus.expire(UNPUBLISHED_AFTER)
    (status,) = [json.loads(frame) for frame in outbox.take(2**20)]
    assert (status["op"], status["level"]) == ("status", "info")
    assert status["msg"].endswith(word)
