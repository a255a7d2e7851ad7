"""The standard packages as definition texts of both ROS generations.

The texts are those of rosbags: `scripts/write_standard_texts.py` writes them into `standard.msgs`. rosbags itself is
not imported, because that takes 160 ms of a client's first request. Most messages are the same in both generations.
Texts of ROS 2 that count instead of the ROS 1 texts in `schemas/` are in `ros2.msgs`, with those of vision_msgs 4, as
in Humble and later. A type that only the other generation has is found too (such as `rcl_interfaces/Log` under ROS 1),
because its clients connect as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from rosbridge_sim.packaged import read_packaged
from rosbridge_sim.schema.definitions.names import Generation

WITHOUT_SERVICES: Final = frozenset({"rosbag2_interfaces"})
"""Packages whose services exist but are not in `schemas/`; they count as unknown."""

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
    full = f"{package}/{name}"
    # rosbags leaves default values out; those of the quaternion are the only ones in a package of everyday
    return _OF_ROS2[full] if full == "visualization_msgs/Marker" else _INSTEAD.get(full)


def standard_names(ros: Generation) -> list[str]:
    """Return the names, `pkg/Type`, of all standard messages of a generation."""
    found = [name for texts in (_OF_BOTH, _OWN[ros]) for name in texts]
    copied = [name.removeprefix("std_msgs/") for name in found if name.startswith("std_msgs/")]
    return found + [f"{_EXAMPLES}/{name}" for name in copied if name not in _NOT_EXAMPLES]


def _texts_of(group: str, file: str = "standard") -> dict[str, str]:
    """Return the texts below heads such as `=== ros1 pkg/Type` in a file, by `pkg/Type`."""
    parts = read_packaged(f"schema/definitions/{file}.msgs").split(f"=== {group} ")[1:]
    found = (part.partition("=== ")[0].partition("\n") for part in parts)
    return {name: text for name, _, text in found}


_OF_BOTH: Final = _texts_of("both")
_OF_ROS2: Final = _texts_of("ros2")
_INSTEAD: Final = _texts_of("instead", "ros2")
_OTHER: Final[Mapping[Generation, Generation]] = {1: 2, 2: 1}
_OWN: Final[Mapping[Generation, Mapping[str, str]]] = {1: _texts_of("ros1"), 2: _OF_ROS2}

PACKAGES: Final[Mapping[Generation, frozenset[str]]] = {
    ros: frozenset(name.partition("/")[0] for name in (_EXAMPLES, *_OF_BOTH, *texts)) for ros, texts in _OWN.items()
}
"""The packages of each generation. A test compares them with rosbags."""


def _text(ros: Generation, package: str, name: str) -> str | None:
    if package == _EXAMPLES and name not in _NOT_EXAMPLES:
        text = _text(ros, "std_msgs", name)
        return text and text.replace("std_msgs/", f"{_EXAMPLES}/")
    full = f"{package}/{name}"
    return _OWN[ros].get(full, _OF_BOTH.get(full))
