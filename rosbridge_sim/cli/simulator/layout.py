"""`layout`: settings of viewers that show the simulator: a layout for Lichtblick, a configuration for RViz."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, Final

import orjson

from rosbridge_sim.cli.tools.text import note, put
from rosbridge_sim.cli.tools.tool_client import Bridge
from rosbridge_sim.cli.tools.topic import types_of_topics
from rosbridge_sim.packaged import read_packaged

TOPICS: Final = {
    "/sim/scene/map": "visualization_msgs/MarkerArray",
    "/sim/scene/objects": "visualization_msgs/MarkerArray",
    "/Ego_topic": "morai_msgs/EgoVehicleStatus",
    "/SyncModeInfo": "morai_msgs/SyncModeInfo",
    "/ctrl_cmd": "morai_msgs/CtrlCmd",
}
"""Default name and type of the topics in a layout, whose names the network settings may change."""

CAMERA_TYPE, LIDAR_TYPE = "sensor_msgs/CompressedImage", "sensor_msgs/PointCloud2"
"""Types of the sensors in a layout: one camera and one lidar, if the server has them."""

_Json = dict[str, Any]  # a JSON object

Names = Mapping[str, str]
"""Default name of a topic -> its name."""


async def print_layout_of(bridge: Bridge, viewer: str, ros: int | None) -> None:
    """Print a layout with the names of the topics on a server, by default for its generation of ROS.

    Raises:
        RefusedError: it has no rosapi.
        BridgeError: there is no answer.
    """
    types = await types_of_topics(bridge)
    names = choose_names(types)
    for default in TOPICS:
        if names[default] not in types:
            note(f"the server has no {default}; it stands in the layout all the same")
    print_layout(viewer, ros or (2 if any("/msg/" in one for one in types.values()) else 1), names)


def choose_names(types: Mapping[str, str]) -> dict[str, str]:
    """Return default name -> name of the topics in a layout; of a camera and a lidar the type stands for the default.

    A topic with another name is found by its type, and by the end of its name where several have that type.

    Args:
        types: name of each topic of a server -> its type.
    """
    names = {}
    for default, type_name in TOPICS.items():
        alike = [name for name, one in types.items() if one.replace("/msg/", "/") == type_name and name not in TOPICS]
        alike = [name for name in alike if name.endswith(default.rpartition("/")[2])] or alike
        is_known = default in types or len(alike) != 1
        names[default] = default if is_known else alike[0]
    for sensor_type in (CAMERA_TYPE, LIDAR_TYPE):
        topics = [name for name, one in types.items() if one.replace("/msg/", "/") == sensor_type]
        if topics:
            names[sensor_type] = min(topics, key=lambda name: (name.count("/"), name))  # the first ego has no prefix
    return names


def print_layout(viewer: str, ros: int | None, names: Names | None) -> None:
    """Print a layout.

    Args:
        viewer: one of `VIEWERS`.
        ros: 1 or 2; None is 1.
        names: see `choose_names`; None for the default names.
    """
    put(VIEWERS[viewer](names or choose_names({}), ros or 1).rstrip("\n"))


# Lichtblick


def lichtblick(names: Names, ros: int) -> str:
    """Return a layout for Lichtblick, as JSON: `lichtblick.json` with these names.

    Releases differ in the field of the steering angle, so the plot has both; the one that is not there stays empty.

    Args:
        names: see `choose_names`.
        ros: 1 or 2.
    """
    text = read_packaged("cli/simulator/lichtblick.json")
    if ros == 2:  # noqa: PLR2004 - ROS 2
        text = text.replace("morai_msgs/CtrlCmd", "morai_msgs/msg/CtrlCmd")
    layout = orjson.loads(re.sub("|".join(TOPICS), lambda default: _quoted(names[default[0]])[1:-1], text))
    panels: _Json = layout["configById"]
    if CAMERA_TYPE in names:
        panels["Image!camera"] = {"imageMode": {"imageTopic": names[CAMERA_TYPE]}}
        layout["layout"]["first"] = {
            "direction": "column",
            "first": "3D!scene",
            "second": "Image!camera",
            "splitPercentage": 60,
        }
    if LIDAR_TYPE in names:
        colours = {"colorMode": "colormap", "colorMap": "turbo", "colorField": "intensity"}
        panels["3D!scene"]["topics"][names[LIDAR_TYPE]] = {"visible": True, "pointSize": 2, **colours}
    return orjson.dumps(layout, option=orjson.OPT_INDENT_2).decode()


# RViz


def rviz(names: Names, ros: int) -> str:
    """Return a configuration for RViz, or for RViz 2, as YAML.

    Args:
        names: see `choose_names`.
        ros: 1 or 2.
    """

    def topic_of(name: str, title: str = "Topic", more: str = "Queue Size: 2", *, is_latched: bool = False) -> str:
        """Return the lines about a topic; in ROS 1 every subscriber gets a latched message."""
        if ros == 1:
            return f"      {title}: {_quoted(name)}\n      {more}\n"
        durability = "Transient Local" if is_latched else "Volatile"
        return _template("topic", topic=_quoted(name), durability=durability)

    package = "rviz" if ros == 1 else "rviz_default_plugins"
    common = "rviz" if ros == 1 else "rviz_common"
    markers = sensors = ""
    for title, name in (("Map", "/sim/scene/map"), ("Objects", "/sim/scene/objects")):
        topic = topic_of(names[name], "Marker Topic", "Queue Size: 100", is_latched=title == "Map")
        markers += _template("markers", package=package, name=title, topic=topic)
    if CAMERA_TYPE in names:
        name = names[CAMERA_TYPE]
        name = name.removesuffix("/compressed") if ros == 1 else name  # its display takes it without the transport
        topic = topic_of(name, "Image Topic", "Transport Hint: compressed")
        sensors += _template("camera", package=package, topic=topic)
    if LIDAR_TYPE in names:
        sensors += _template("lidar", package=package, topic=topic_of(names[LIDAR_TYPE]))
    return _template("config", package=package, common=common, markers=markers, sensors=sensors)


def _template(part: str, **words: str) -> str:
    """Return a part of the configuration from its file in `rviz/`."""
    return read_packaged(f"cli/simulator/rviz/{part}.yaml").format(**words)


def _quoted(text: str) -> str:
    """Return a text in the quotes of JSON, which are YAML's, too."""
    return orjson.dumps(text).decode()


VIEWERS: Final[Mapping[str, Callable[[Names, int], str]]] = {"lichtblick": lichtblick, "rviz": rviz}
"""Name of a viewer -> function that makes its settings."""
