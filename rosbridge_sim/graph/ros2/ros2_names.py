"""Names of topics and types on the graph of ROS 2, and on the wire of DDS below it.

ROS 2 puts `rt` before the name of a topic: `/imu` is `rt/imu` for DDS. The type `sensor_msgs/msg/Imu` is
`sensor_msgs::msg::dds_::Imu_` there. Source: ROS 2 design, "Topic and Service name mapping to DDS".
"""

from __future__ import annotations

import re
from typing import Final

_NAME: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+", re.ASCII)
_DDS_TYPE: Final = re.compile(r"([a-z]\w*)::msg::dds_::([A-Za-z]\w*)_", re.ASCII)
_TOPIC: Final = "rt"

MAX_LENGTH: Final = 245
"""Longest name of a topic with `rt` before it [characters]: DDS takes 255, and ROS 2 keeps 10 of them for itself."""


def is_name(name: str) -> bool:
    """Return True if a topic may have a name in ROS 2: letters, digits and `_`, and no token begins with a digit.

    Args:
        name: absolute name.
    """
    return len(name) + len(_TOPIC) <= MAX_LENGTH and "__" not in name and _NAME.fullmatch(name) is not None


def dds_topic(name: str, namespace: str = "") -> str:
    """Return the name of a topic for DDS.

    Args:
        name: absolute name on the bus.
        namespace: stands before all names on the graph; empty, or absolute without a slash at its end.
    """
    return _TOPIC + namespace + name


def topic_of(dds_name: str, namespace: str = "") -> str | None:
    """Return the name on the bus of a topic of DDS; None if it is no topic of ROS 2, or not in the namespace.

    Args:
        namespace: as for `dds_topic`.
    """
    name = dds_name.removeprefix(_TOPIC + namespace)
    return name if name != dds_name and is_name(name) else None


def dds_type(name: str) -> str:
    """Return the name of a type for DDS.

    Args:
        name: `pkg/msg/Type`.
    """
    package, _, short = name.partition("/msg/")
    return f"{package}::msg::dds_::{short}_"


def type_of(dds_name: str) -> str | None:
    """Return `pkg/Type` for a type of DDS; None if it is no message of ROS 2."""
    match = _DDS_TYPE.fullmatch(dds_name)
    return None if match is None else f"{match[1]}/{match[2]}"


def guid_text(participant: bytes) -> str:
    """Return the GUID of a program, as the first half of a GID in `ros2 topic info -v`: `01.10.51.c6...`.

    Args:
        participant: identity of its participant, 16 bytes, of which the first 12 are the same in all its endpoints.
    """
    return participant[:12].hex(".")
