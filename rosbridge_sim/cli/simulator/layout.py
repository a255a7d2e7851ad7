"""`layout`: settings of viewers that show the simulator: a layout for Lichtblick, a configuration for RViz."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import orjson

from rosbridge_sim.cli.tools.text import note, put
from rosbridge_sim.cli.tools.tool_client import Bridge, words

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
    answer = await bridge.ask("topics")
    types = dict(zip(words(answer, "topics"), words(answer, "types"), strict=False))
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
    """Return a layout for Lichtblick, as JSON.

    Args:
        names: see `choose_names`.
        ros: 1 or 2.
    """
    ego, control = names["/Ego_topic"], names["/ctrl_cmd"]
    panels: _Json = {
        "3D!scene": _scene(names),
        "Plot!speed": _plot("Speed [m/s]", {f"{ego}.velocity.x": "speed"}),
        # Releases differ in the field of the steering angle; the one that is not there stays empty.
        "Plot!steering": _plot(
            "Steering", {f"{ego}.wheel_angle": "steering [rad]", f"{ego}.front_steer_angle": "steering [deg]"}
        ),
        "RawMessages!sync": {
            "diffEnabled": False,
            "diffMethod": "custom",
            "diffTopicPath": "",
            "showFullMessageForDiff": False,
            "topicPath": names["/SyncModeInfo"],
        },
        "Publish!drive": _publish("Drive 30 km/h", control, ros, longlCmdType=2, velocity=30.0),
        "Publish!stop": _publish("Brake", control, ros, longlCmdType=1, brake=1.0),
    }
    scene: object = "3D!scene"
    if CAMERA_TYPE in names:
        panels["Image!camera"] = {"imageMode": {"imageTopic": names[CAMERA_TYPE]}}
        scene = _column("3D!scene", "Image!camera", 60)
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _row(
            scene,
            _column(
                _column("Plot!speed", "Plot!steering", 50),
                _column("RawMessages!sync", _row("Publish!drive", "Publish!stop", 50), 60),
                55,
            ),
            65,
        ),
    }
    return orjson.dumps(layout, option=orjson.OPT_INDENT_2).decode()


def _row(first: object, second: object, percentage: int) -> _Json:
    return {"direction": "row", "first": first, "second": second, "splitPercentage": percentage}


def _column(first: object, second: object, percentage: int) -> _Json:
    return {"direction": "column", "first": first, "second": second, "splitPercentage": percentage}


def _scene(names: Names) -> _Json:
    topics: _Json = {names[topic]: {"visible": True} for topic in ("/sim/scene/map", "/sim/scene/objects")}
    if LIDAR_TYPE in names:
        colours = {"colorMode": "colormap", "colorMap": "turbo", "colorField": "intensity"}
        topics[names[LIDAR_TYPE]] = {"visible": True, "pointSize": 2, **colours}
    return {
        "cameraState": {
            "perspective": True,
            "distance": 60.0,
            "phi": 55.0,
            "thetaOffset": 90.0,
            "targetOffset": [0.0, 0.0, 0.0],
            "target": [0.0, 0.0, 0.0],
            "targetOrientation": [0.0, 0.0, 0.0, 1.0],
            "fovy": 45.0,
            "near": 0.5,
            "far": 5_000.0,
        },
        "followMode": "follow-pose",
        "followTf": "base_link",
        "scene": {"transforms": {"showLabel": False, "axisScale": 1.0}},
        "transforms": {},
        "topics": topics,
        "layers": {},
        "publish": {},
        "imageMode": {},
    }


def _plot(title: str, paths: Mapping[str, str]) -> _Json:
    """Return a plot of message paths, each with its label."""
    return {
        "foxglovePanelTitle": title,
        "paths": [
            {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
            for path, label in paths.items()
        ],
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
        "followingViewWidth": 60,
    }


def _publish(text: str, topic: str, ros: int, **fields: float) -> _Json:
    usual = {"longlCmdType": 1, "accel": 0.0, "brake": 0.0, "steering": 0.0, "velocity": 0.0, "acceleration": 0.0}
    return {
        "buttonText": text,
        "buttonTooltip": f"Publish on {topic}",
        "buttonColor": "#0a7d32" if "velocity" in fields else "#c4161c",
        "advancedView": False,
        "topicName": topic,
        "datatype": "morai_msgs/msg/CtrlCmd" if ros == 2 else "morai_msgs/CtrlCmd",  # noqa: PLR2004 - ROS 2
        "value": orjson.dumps({**usual, **fields}, option=orjson.OPT_INDENT_2).decode(),
    }


# RViz


def rviz(names: Names, ros: int) -> str:
    """Return a configuration for RViz, or for RViz 2, as YAML.

    Args:
        names: see `choose_names`.
        ros: 1 or 2.
    """
    package = "rviz" if ros == 1 else "rviz_default_plugins"
    marker_topic = _marker_topic_1 if ros == 1 else _topic_2
    markers = _template("markers", package, name="Map", topic=marker_topic(names["/sim/scene/map"], is_latched=True))
    markers += _template("markers", package, name="Objects", topic=marker_topic(names["/sim/scene/objects"]))
    sensors = ""
    if CAMERA_TYPE in names:
        name = names[CAMERA_TYPE]
        if ros == 1:  # its display takes the topic without the transport
            topic = f"      Image Topic: {_yaml(name.removesuffix('/compressed'))}\n      Transport Hint: compressed\n"
        else:
            topic = _topic_2(name)
        sensors += _template("camera", package, topic=topic)
    if LIDAR_TYPE in names:
        name = names[LIDAR_TYPE]
        sensors += _template("lidar", package, topic=_topic_1(name) if ros == 1 else _topic_2(name))
    common = "rviz" if ros == 1 else "rviz_common"
    return _template("config", package, common=common, markers=markers, sensors=sensors)


def _template(part: str, package: str, **words: str) -> str:
    """Return a part of the configuration from its file in `rviz/`."""
    text = (Path(__file__).parent / "rviz" / f"{part}.yaml").read_text("utf-8")
    return text.format(package=package, **words)


def _marker_topic_1(name: str, *, is_latched: bool = False) -> str:
    del is_latched  # in ROS 1 every subscriber gets a latched message
    return f"      Marker Topic: {_yaml(name)}\n      Queue Size: 100\n"


def _topic_1(name: str) -> str:
    return f"      Topic: {_yaml(name)}\n      Queue Size: 2\n"


def _topic_2(name: str, *, is_latched: bool = False) -> str:
    durability = "Transient Local" if is_latched else "Volatile"
    return f"""\
      Topic:
        Depth: 5
        Durability Policy: {durability}
        History Policy: Keep Last
        Reliability Policy: Reliable
        Value: {_yaml(name)}
"""


def _yaml(text: str) -> str:
    """Return a text as a scalar of YAML; JSON's quotes are YAML's, too."""
    return orjson.dumps(text).decode()


VIEWERS: Final[Mapping[str, Callable[[Names, int], str]]] = {"lichtblick": lichtblick, "rviz": rviz}
"""Name of a viewer -> function that makes its settings."""
