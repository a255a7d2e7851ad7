"""`rosbridge-sim layout`: the settings are what the viewers read, with the names that the topics have."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Literal

import pytest
from ruamel.yaml import YAML

from rosbridge_sim.cli.simulator.layout import VIEWERS, choose_names
from rosbridge_sim.shell.app import Simulator
from tests.cli.tool_fixture import in_the_background, run


def rviz(*words: str) -> dict[str, Any]:
    done = run("layout", "rviz", *words)
    assert (done.code, done.err) == (0, "")
    settings = YAML(typ="safe", pure=True).load(done.out)
    manager = settings["Visualization Manager"]
    assert isinstance(manager, dict)
    return manager


def classes(value: object) -> Iterator[str]:
    """All classes of plugins in a configuration."""
    if isinstance(value, dict):
        yield from (one for key, one in value.items() if key == "Class" and one)
        for one in value.values():
            yield from classes(one)
    elif isinstance(value, list):
        for one in value:
            yield from classes(one)


def test_rviz_configuration_has_displays_of_ros_1() -> None:
    manager = rviz()
    assert [display["Class"] for display in manager["Displays"]] == [
        *("rviz/Grid", "rviz/MarkerArray", "rviz/MarkerArray", "rviz/TF")
    ]
    markers = [display["Marker Topic"] for display in manager["Displays"] if display["Class"] == "rviz/MarkerArray"]
    assert markers == ["/sim/scene/map", "/sim/scene/objects"]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    assert {one.partition("/")[0] for one in classes(manager)} == {"rviz"}


def test_rviz_configuration_of_ros_2_asks_for_the_latched_map() -> None:
    manager = rviz("--ros", "2")
    map_display, objects = [one for one in manager["Displays"] if one["Class"] == "rviz_default_plugins/MarkerArray"]
    assert map_display["Topic"]["Value"] == "/sim/scene/map"
    assert map_display["Topic"]["Durability Policy"] == "Transient Local"
    assert objects["Topic"]["Durability Policy"] == "Volatile"
    assert {one.partition("/")[0] for one in classes(manager)} == {"rviz_default_plugins"}


def panels_of(tree: object) -> list[str]:
    if isinstance(tree, str):
        return [tree]
    assert isinstance(tree, dict)
    assert tree["direction"] in ("row", "column")
    assert 0 < tree["splitPercentage"] < 100
    return panels_of(tree["first"]) + panels_of(tree["second"])


@pytest.mark.parametrize("ros", ["1", "2"])
def test_lichtblick_layout_places_each_of_its_panels_once(ros: str) -> None:
    done = run("layout", "lichtblick", "--ros", ros)
    assert (done.code, done.err) == (0, "")
    layout = json.loads(done.out)
    assert sorted(panels_of(layout["layout"])) == sorted(layout["configById"])
    assert {name.partition("!")[0] for name in layout["configById"]} == {"3D", "Plot", "RawMessages", "Publish"}
    scene = layout["configById"]["3D!scene"]
    assert scene["topics"] == {"/sim/scene/map": {"visible": True}, "/sim/scene/objects": {"visible": True}}
    assert layout["configById"]["RawMessages!sync"]["topicPath"] == "/SyncModeInfo"
    drive = layout["configById"]["Publish!drive"]
    assert drive["datatype"] == ("morai_msgs/CtrlCmd" if ros == "1" else "morai_msgs/msg/CtrlCmd")
    assert json.loads(drive["value"])["velocity"] == 30.0


@pytest.mark.parametrize(("ros", "prefix"), [(1, "rviz/"), (2, "rviz_default_plugins/")])
async def test_names_and_generation_of_a_running_server_are_taken(ros: Literal[1, 2], prefix: str) -> None:
    names = {"/Ego_topic": {"name": "/ego/state"}, "/sim/scene/objects": {"name": "/view/objects"}}
    async with Simulator(port=0, ros=ros, publishers=names, scenario="loop") as sim:
        done = await in_the_background("layout", "lichtblick", url=sim.url)
        configuration = await in_the_background("layout", "rviz", url=sim.url)
    assert (done.code, done.err) == (0, "")
    panels = json.loads(done.out)["configById"]
    assert panels["Plot!speed"]["paths"][0]["value"] == "/ego/state.velocity.x"
    assert set(panels["3D!scene"]["topics"]) == {"/sim/scene/map", "/view/objects"}
    assert prefix + "MarkerArray" in configuration.out
    assert "/view/objects" in configuration.out


@pytest.mark.parametrize(("ros", "package"), [(1, "rviz"), (2, "rviz_default_plugins")])
def test_camera_and_lidar_of_a_server_have_a_display_each(ros: int, package: str) -> None:
    kind = "/msg/" if ros == 2 else "/"
    types = {
        "/Ego-2/image_jpeg/compressed": f"sensor_msgs{kind}CompressedImage",
        "/image_jpeg/compressed": f"sensor_msgs{kind}CompressedImage",
        "/lidar3D": f"sensor_msgs{kind}PointCloud2",
        "/velodyne_points": f"sensor_msgs{kind}PointCloud2",
    }
    names = choose_names(types)
    manager = YAML(typ="safe", pure=True).load(VIEWERS["rviz"](names, ros))["Visualization Manager"]
    displays = {display["Name"]: display for display in manager["Displays"]}
    camera, lidar = displays["Camera"], displays["Lidar"]
    assert (camera["Class"], lidar["Class"]) == (f"{package}/Image", f"{package}/PointCloud2")
    assert lidar["Channel Name"] == "intensity"
    if ros == 1:
        assert (camera["Image Topic"], camera["Transport Hint"]) == ("/image_jpeg", "compressed")
        assert lidar["Topic"] == "/lidar3D"
    else:
        assert camera["Topic"]["Value"] == "/image_jpeg/compressed"
        assert lidar["Topic"]["Value"] == "/lidar3D"
    layout = json.loads(VIEWERS["lichtblick"](names, ros))
    assert sorted(panels_of(layout["layout"])) == sorted(layout["configById"])
    assert layout["configById"]["Image!camera"]["imageMode"]["imageTopic"] == "/image_jpeg/compressed"
    assert layout["configById"]["3D!scene"]["topics"]["/lidar3D"]["colorField"] == "intensity"


def test_ambiguous_names_stay_the_default_ones() -> None:
    types = {"/a/Ego_topic": "morai_msgs/EgoVehicleStatus", "/b/Ego_topic": "morai_msgs/EgoVehicleStatus"}
    assert choose_names(types)["/Ego_topic"] == "/Ego_topic"


async def test_server_without_the_scene_gives_a_layout_and_says_so() -> None:
    async with Simulator(port=0, world=False) as sim:
        done = await in_the_background("layout", "rviz", url=sim.url)
    assert done.code == 0
    assert "/sim/scene/map" in done.out
    assert "the server has no /sim/scene/map" in done.err


def test_unknown_viewer_is_a_mistake() -> None:
    done = run("layout", "gazebo")
    assert done.code == 2
    assert "lichtblick" in done.complaint
