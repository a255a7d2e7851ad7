"""The standard packages as definition texts of both ROS generations.

The texts are those of rosbags (`standard_texts.py`). rosbags itself is not imported, because that takes 160 ms of a
client's first request. A type that only the other generation has is found too (such as `rcl_interfaces/Log` under ROS
1), because its clients connect as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.standard_texts import OF_BOTH, OF_ROS1, OF_ROS2

_SHARED: Final = frozenset(
    {"actionlib_msgs", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "rosgraph_msgs", "sensor_msgs", "shape_msgs"}
    | {"std_msgs", "stereo_msgs", "trajectory_msgs", "visualization_msgs", "example_interfaces"}
)

PACKAGES: Final[Mapping[Generation, frozenset[str]]] = {
    1: _SHARED | {"actionlib", "bond", "dynamic_reconfigure", "roscpp"},
    2: _SHARED
    | {"action_msgs", "builtin_interfaces", "lifecycle_msgs", "rcl_interfaces", "rmw_dds_common", "rosbag2_interfaces"}
    | {"service_msgs", "statistics_msgs", "tf2_msgs", "type_description_interfaces", "unique_identifier_msgs"},
}
"""The packages of each generation. A test compares them with rosbags."""

WITHOUT_SERVICES: Final = frozenset({"rosbag2_interfaces"})
"""Packages whose services exist but are not in `schemas/`; they count as unknown."""

_TEXTS_OF_ROS2: Final[Mapping[str, str]] = {
    "std_msgs/Header": "# When and where a message was made.\n\n"
    "builtin_interfaces/Time stamp  # when [s, ns]\nstring frame_id                # the frame of what is in it\n",
    # rosbags leaves default values out; these are the only ones in a package of everyday
    "geometry_msgs/Quaternion": "# An orientation.\n\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "visualization_msgs/Marker": OF_ROS2["visualization_msgs/Marker"],
    # vision_msgs 4, as in Humble and later
    "vision_msgs/BoundingBox2D": "# A box in a picture.\n\n"
    "vision_msgs/Pose2D center  # its middle, and its turn\n"
    "float64 size_x             # width before it is turned [px]\n"
    "float64 size_y             # height, the same [px]\n",
    "vision_msgs/ObjectHypothesis": "# What an object may be.\n\n"
    "string class_id  # its class: the number in the table in docs/reference/sensors.md\n"
    "float64 score    # how sure that is, 0 to 1\n",
    "vision_msgs/ObjectHypothesisWithPose": "# What an object may be, and where.\n\n"
    "vision_msgs/ObjectHypothesis hypothesis\n"
    "geometry_msgs/PoseWithCovariance pose    # its middle and its axes\n",
    "vision_msgs/Detection2D": "# An object in a picture.\n\nstd_msgs/Header header\n"
    "vision_msgs/ObjectHypothesisWithPose[] results  # what it may be\n"
    "vision_msgs/BoundingBox2D bbox                  # its box in the picture\n"
    "string id                                       # of the object, the same in each message\n",
    "vision_msgs/Detection3D": "# An object in space.\n\nstd_msgs/Header header\n"
    "vision_msgs/ObjectHypothesisWithPose[] results  # what it may be\n"
    "vision_msgs/BoundingBox3D bbox                  # its box\n"
    "string id                                       # of the object, the same in each message\n",
}
"""Texts of ROS 2 that count instead of the ROS 1 texts in `schemas/`."""

_EXAMPLES: Final = "example_interfaces"
"""A package with copies of the messages in std_msgs, which the tutorials of ROS 2 use."""

_NOT_EXAMPLES: Final = frozenset({"ColorRGBA", "Duration", "Header", "Time"})


def standard_text(ros: Generation, package: str, name: str) -> str | None:
    """Return the definition text of a standard message; None if there is no such message."""
    for generation in (ros, _OTHER[ros]):
        if package in PACKAGES[generation]:
            text = _text(generation, package, name)
            if text is not None:
                return text
    return None


def ros2_text(package: str, name: str) -> str | None:
    """Return the ROS 2 text of a message that differs from the one in `schemas/`; None for all others."""
    return _TEXTS_OF_ROS2.get(f"{package}/{name}")


def standard_names(ros: Generation) -> list[str]:
    """Return the names, `pkg/Type`, of all standard messages of a generation."""
    found = [name for texts in (OF_BOTH, _OWN[ros]) for name in texts]
    copied = [name.removeprefix("std_msgs/") for name in found if name.startswith("std_msgs/")]
    return found + [f"{_EXAMPLES}/{name}" for name in copied if name not in _NOT_EXAMPLES]


_OTHER: Final[Mapping[Generation, Generation]] = {1: 2, 2: 1}
_OWN: Final[Mapping[Generation, Mapping[str, str]]] = {1: OF_ROS1, 2: OF_ROS2}


def _text(ros: Generation, package: str, name: str) -> str | None:
    if package == _EXAMPLES and name not in _NOT_EXAMPLES:
        text = _text(ros, "std_msgs", name)
        return text and text.replace("std_msgs/", f"{_EXAMPLES}/")
    full = f"{package}/{name}"
    return _OWN[ros].get(full, OF_BOTH.get(full))
