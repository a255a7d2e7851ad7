"""Names of types and fields in both ROS generations.

Inside, a type is `pkg/Type`, and its fields have the names of their definition. ROS 2 writes the kind between
(`pkg/msg/Type`), has renamed a few packages and fields, and allows only `snake_case` for a field. Input is accepted
with the names of both generations.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Final, Literal, TypeAlias

from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.printable import MAX_QUOTED, printable

Generation: TypeAlias = Literal[1, 2]
"""A ROS generation."""

DefinitionKind: TypeAlias = Literal["msg", "srv", "action"]
"""The kind of a type."""

RENAMED_PACKAGES: Final[Mapping[str, str]] = {
    "rosapi_msgs": "rosapi",
    "tf2_web_republisher_interfaces": "tf2_web_republisher",
    "tf2_web_republisher_msgs": "tf2_web_republisher",
}
"""Package name in ROS 2 -> name here; the types are the same."""

_ROS2_PACKAGES: Final = {"rosapi": "rosapi_msgs", "tf2_web_republisher": "tf2_web_republisher_interfaces"}
"""Package name here -> name that is sent under ROS 2: of several, the one that roslib 2 uses."""

FEEDBACK_MESSAGE: Final = "_FeedbackMessage"
"""End of the name of the message by which ROS 2 sends the feedback of an action. No other message has a `_` there."""

_CAMERA_INFO: Final = {"D": "d", "K": "k", "R": "r", "P": "p"}

RENAMED_FIELDS: Final[Mapping[str, Mapping[str, str]]] = {
    "rosapi/GetParamRequest": {"default_value": "default"},
    # ROS 1 names for definitions of ROS 2; `snake_case` does the reverse
    "builtin_interfaces/Duration": {"secs": "sec", "nsecs": "nanosec"},
    "builtin_interfaces/Time": {"secs": "sec", "nsecs": "nanosec"},
    "sensor_msgs/CameraInfo": _CAMERA_INFO,
    "stereo_msgs/DisparityImage": {"T": "t"},
}
"""Type -> {name in the other generation: name here}; names that the definition lacks are ignored."""

_TYPE_NAME: Final = re.compile(r"/*([A-Za-z]\w*)/+(?:(?:msg|srv|action)/+)?([A-Za-z]\w*)/*", re.ASCII)
"""Needless slashes are ignored, as in rosbridge_suite: `/pkg/Type`, `pkg//Type` and `pkg/Type/` are one name."""

_ROS2_FIELD: Final = re.compile(r"[a-z](?:_?[a-z0-9])*")
_WORD_BORDER: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def split_name(name: str) -> tuple[str, str]:
    """Return package and type of a name, `pkg/Type` or with the kind between.

    Raises:
        TypeNameError: the name is malformed.
    """
    match = _TYPE_NAME.fullmatch(name)
    if match is None:
        more = "; name its package, too, as in std_msgs/String" if name.isidentifier() else ""
        raise TypeNameError(f"{printable(name, MAX_QUOTED)} is not a valid type string{more}")
    return match[1], match[2]


def canonical_type(name: str) -> str:
    """Return the name `pkg/Type` of a type as either generation writes it; any text is accepted."""
    package, _, rest = name.strip("/").partition("/")
    return f"{RENAMED_PACKAGES.get(package, package)}/{rest.rpartition('/')[2]}"


def spelled(name: str, kind: DefinitionKind, ros: Generation) -> str:
    """Return the name that a generation writes for a type `pkg/Type`."""
    if ros == 1:
        return name
    package, _, short = name.partition("/")
    if short.endswith(FEEDBACK_MESSAGE):
        kind = "action"
    return f"{_ROS2_PACKAGES.get(package, package)}/{kind}/{short}"


def snake_case(name: str) -> str:
    """Return a field name in the form of ROS 2, such as `fl_wheel_speed` for `FL_wheel_speed`."""
    return re.sub("__+", "_", _WORD_BORDER.sub("_", name)).strip("_").lower()


def ros2_names(names: Iterable[str]) -> dict[str, str]:
    """Return name in ROS 2 -> name, for the fields that ROS 2 must rename, without ambiguous ones."""
    taken = dict.fromkeys(names)
    found: dict[str, str] = {}
    for name in taken:
        if _ROS2_FIELD.fullmatch(name):
            continue
        other = snake_case(name)
        if other in taken or not _ROS2_FIELD.fullmatch(other):
            continue
        # If two fields get one name, neither has it.
        found[other] = "" if other in found else name
    return {other: name for other, name in found.items() if name}
