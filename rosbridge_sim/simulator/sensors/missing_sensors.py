"""Sensors that MORAI SIM has and this simulator lacks: a hint for clients that wait for their messages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.simulator.sensors.sensor_table import SENSORS

__all__ = ["advise"]

_SENSORS: Final[Mapping[str, str]] = {
    "sensor_msgs/CompressedImage": "camera",
    "sensor_msgs/Image": "camera",
    "sensor_msgs/CameraInfo": "camera",
    "sensor_msgs/PointCloud": "lidar",
    "sensor_msgs/PointCloud2": "lidar",
    "sensor_msgs/LaserScan": "lidar",
    "velodyne_msgs/VelodyneScan": "lidar",
    "morai_msgs/RadarDetections": "radar",
}
"""Type of messages -> the sensor of MORAI SIM that publishes it."""


def advise(topic: Topic) -> str:
    """Return a hint that the simulator lacks the sensor of a topic.

    Args:
        topic: a topic that a client subscribes to and nothing publishes.

    Returns:
        The end of a sentence for the client; empty for a type that belongs to none of these sensors.
    """
    name = topic.type.name
    sensor = None if any(each.type_name == name for each in SENSORS) else _SENSORS.get(name)
    known = " and ".join(each.title for each in SENSORS)
    return "" if sensor is None else f"; this simulator has no {sensor}: its sensors are {known}"
