"""A client that waits for a camera is told how to get one."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim.graph.unpublished import UNPUBLISHED_AFTER
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import PRESETS
from tests.graph.bus_fixture import make_peer
from tests.simulator.sensors.analytic_makers import AtOnceWorker
from tests.simulator.sim_harness import SimHarness


@pytest.mark.parametrize(
    ("topic", "type_name", "word"),
    [
        (
            "/image_jpeg/compressed",
            "sensor_msgs/CompressedImage",
            "no camera is on: start the server with --sensors camera, or with a file, or call /sim/sensors",
        ),
        (
            "/lidar3D",
            "sensor_msgs/PointCloud2",
            "no lidar is on: start the server with --sensors lidar, or with a file, or call /sim/sensors",
        ),
        (
            "/radar",
            "morai_msgs/RadarDetections",
            "no radar is on: start the server with --sensors all, or with a file, or call /sim/sensors",
        ),
        ("/packets", "velodyne_msgs/VelodyneScan", "its lidars publish sensor_msgs/PointCloud2, and no packets"),
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


def test_subscriber_of_another_topic_is_told_where_the_sensor_publishes() -> None:
    harness = SimHarness(sensors=PRESETS["teaching"], worker=AtOnceWorker())
    peer, outbox = make_peer(harness.bus)
    wanted = {"topic": "/points", "type": "sensor_msgs/PointCloud2"}
    for op in ({"op": "set_level", "level": "info"}, {"op": "subscribe", **wanted}):
        peer.receive(json.dumps(op).encode(), 0.0)
    harness.bus.expire(UNPUBLISHED_AFTER)
    (status,) = [json.loads(frame) for frame in outbox.take(2**20)]
    assert "of this type there is /lidar3D" in status["msg"]
    assert "--sensors" not in status["msg"]
