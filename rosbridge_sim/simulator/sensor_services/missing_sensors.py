"""Hints for clients that wait for the messages of a sensor that is off, or that this simulator lacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.simulator.sensor_data.picture_messages import BOXES
from rosbridge_sim.simulator.sensor_data.vision_messages import DETECTIONS_2D, DETECTIONS_3D

_PRESETS: Final[Mapping[str, tuple[str, str]]] = {
    "sensor_msgs/CompressedImage": ("camera", "camera"),
    "sensor_msgs/Image": ("camera", "all"),
    "sensor_msgs/CameraInfo": ("camera", "camera"),
    "sensor_msgs/PointCloud2": ("lidar", "lidar"),
    "sensor_msgs/LaserScan": ("level lidar", "all"),
    "morai_msgs/RadarDetections": ("radar", "all"),
    BOXES: ("camera", "camera"),
}
"""Type of messages -> the sensor that publishes it, and a preset that has one."""

_LACKING: Final[Mapping[str, str]] = {
    "sensor_msgs/PointCloud": "its lidars publish sensor_msgs/PointCloud2",
    "velodyne_msgs/VelodyneScan": "its lidars publish sensor_msgs/PointCloud2, and no packets",
    "sensor_msgs/Range": "it has no ultrasonic sensors",
    DETECTIONS_2D: "its cameras publish them if their settings have detections = true",
    DETECTIONS_3D: "its cameras publish them if their settings have detections = true",
}
"""Type of messages of a sensor -> what this simulator has instead."""


def advise(topic: Topic, has_topic_like: Callable[[str], bool]) -> str:
    """Return a hint how to get the messages of a sensor.

    Args:
        topic: a topic that a client subscribes to and nothing publishes.
        has_topic_like: returns whether a sensor of the simulator publishes messages of a type.

    Returns:
        The end of a sentence for the client; empty for a type that belongs to no sensor, or if there is such a sensor.
    """
    name = topic.type.name
    if name in _LACKING:
        return f"; this simulator has none: {_LACKING[name]}"
    if name not in _PRESETS:
        return ""
    sensor, preset = _PRESETS[name]
    if has_topic_like(name):  # the client is told its name anyway
        return ""
    return f"; no {sensor} is on: start the server with --sensors {preset}, or with a file, or call /sim/sensors"
