"""Names of types and fields in the spelling of either ROS generation.

Inside, a type is `pkg/Type`, and its fields have the names that their definition gives them. ROS 2 puts the kind
between (`pkg/msg/Type`), has renamed a few packages and fields, and allows nothing but `snake_case` for a field. Every
such spelling is understood on the way in, whatever the personality.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Final, Literal, TypeAlias

from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.printable import MAX_QUOTED, printable

__all__ = [
    "RENAMED_FIELDS",
    "RENAMED_PACKAGES",
    "DefinitionKind",
    "Generation",
    "ros2_names",
    "snake_case",
    "spelled",
    "split_name",
]

Generation: TypeAlias = Literal[1, 2]
"""Of ROS."""

DefinitionKind: TypeAlias = Literal["msg", "srv", "action"]
"""Of a type."""

RENAMED_PACKAGES: Final[Mapping[str, str]] = {
    "rosapi_msgs": "rosapi",
    "tf2_web_republisher_interfaces": "tf2_web_republisher",
    "tf2_web_republisher_msgs": "tf2_web_republisher",
}
"""Name in ROS 2 -> name here: the types of the one serve for the other."""

_ROS2_PACKAGES: Final = {"rosapi": "rosapi_msgs", "tf2_web_republisher": "tf2_web_republisher_interfaces"}
"""What ROS 2 is told, where it has several names for a package: the one that roslib 2 uses."""

_CAMERA_INFO: Final = {"D": "d", "K": "k", "R": "r", "P": "p"}

RENAMED_FIELDS: Final[Mapping[str, Mapping[str, str]]] = {
    "rosapi/GetParamRequest": {"default_value": "default"},
    # ROS 1's names, where the definition is ROS 2's; the other way round `snake_case` does it
    "builtin_interfaces/Duration": {"secs": "sec", "nsecs": "nanosec"},
    "builtin_interfaces/Time": {"secs": "sec", "nsecs": "nanosec"},
    "sensor_msgs/CameraInfo": _CAMERA_INFO,
    "stereo_msgs/DisparityImage": {"T": "t"},
}
"""Type -> {the other generation's name: name here}; what the definition lacks means nothing."""

_TYPE_NAME: Final = re.compile(r"/*([A-Za-z]\w*)/+(?:(?:msg|srv|action)/+)?([A-Za-z]\w*)/*", re.ASCII)
"""rosbridge_suite passes over needless slashes, and so do we: `/pkg/Type`, `pkg//Type` and `pkg/Type/` are one name."""

_ROS2_FIELD: Final = re.compile(r"[a-z](?:_?[a-z0-9])*")
_WORD_BORDER: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def split_name(name: str) -> tuple[str, str]:
    """Package and type of a name, `pkg/Type` or with the kind between.

    Raises:
        TypeNameError: the name is malformed.
    """
    match = _TYPE_NAME.fullmatch(name)
    if match is None:
        raise TypeNameError(f"{printable(name, MAX_QUOTED)} is not a valid type string")
    return match[1], match[2]


def spelled(name: str, kind: DefinitionKind, ros: Generation) -> str:
    """A type `pkg/Type` as a generation writes it."""
    if ros == 1:
        return name
    package, _, short = name.partition("/")
    return f"{_ROS2_PACKAGES.get(package, package)}/{kind}/{short}"


def snake_case(name: str) -> str:
    """A field's name as ROS 2 has it: `longlCmdType` is `longl_cmd_type`, `FL_wheel_speed` is `fl_wheel_speed`."""
    return re.sub("__+", "_", _WORD_BORDER.sub("_", name)).strip("_").lower()


def ros2_names(names: Iterable[str]) -> dict[str, str]:
    """Name in ROS 2 -> name, of those fields that ROS 2 cannot have as they are; none that would be ambiguous."""
    taken = dict.fromkeys(names)
    found: dict[str, str] = {}
    for name in taken:
        if _ROS2_FIELD.fullmatch(name):
            continue
        other = snake_case(name)
        if other in taken or not _ROS2_FIELD.fullmatch(other):
            continue
        # of two that meet in one name neither has it
        found[other] = "" if other in found else name
    return {other: name for other, name in found.items() if name}
