"""The URDF of an ego, on `/robot_description` and as a parameter."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from rosbridge_sim.simulator.egos.tf_publisher import WHEEL_FRAMES
from rosbridge_sim.simulator.robot_description import RobotDescription, find_wheels
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.world.geometry.planar import quaternion
from rosbridge_sim.world.vehicle.sensor_readings import Mounting
from tests.simulator.sensors.analytic_makers import AtOnceWorker
from tests.simulator.sim_harness import Client, SimHarness, put_egos


@pytest.fixture
def sim() -> SimHarness:
    rig = (CameraSpec(x=1.5, z=1.4, pitch=7.0, yaw=30.0), Lidar3dSpec(x=2.0, z=1.3, roll=3.0))
    return SimHarness("crowd", standard_topics=True, sensors=rig, worker=AtOnceWorker())


@pytest.fixture
def client(sim: SimHarness) -> Client:
    client = sim.client()
    client.listen("/robot_description", "/tf_static", "/tf")
    return client


def joints(text: str) -> dict[str, ET.Element]:
    """Joints by the link that hangs on them; each link but the first has one, and each parent is there."""
    robot = ET.fromstring(text)  # noqa: S314 - of our own making
    links = [link.attrib["name"] for link in robot.iter("link")]
    found = {joint.find("child").attrib["link"]: joint for joint in robot.iter("joint")}  # type: ignore[union-attr]
    assert len(links) == len(set(links)) == len(found) + 1
    assert links[1:] == list(found)
    assert {joint.find("parent").attrib["link"] for joint in found.values()} <= set(links)  # type: ignore[union-attr]
    return found


def poses(text: str) -> dict[tuple[str, str], list[float]]:
    """Parent and name of each link -> place and quaternion of its joint."""
    out = {}
    for name, joint in joints(text).items():
        origin, parent = joint.find("origin"), joint.find("parent")
        assert origin is not None
        assert parent is not None
        place = [float(value) for value in origin.attrib["xyz"].split()]
        roll, pitch, yaw = (float(value) for value in origin.attrib["rpy"].split())
        out[parent.attrib["link"], name] = [*place, *quaternion(roll, pitch, yaw)]
    return out


def transforms(message: dict[str, Any]) -> dict[tuple[str, str], list[float]]:
    return {
        (one["header"]["frame_id"], one["child_frame_id"]): [
            *one["transform"]["translation"].values(),
            *one["transform"]["rotation"].values(),
        ]
        for one in message["transforms"]
    }


def latched(sim: SimHarness, topic: str) -> dict[str, Any]:
    (message,) = sim.bus.topics[topic].latched
    found: dict[str, Any] = json.loads(message.json)
    return found


def test_links_are_the_frames_of_tf_with_the_same_poses(sim: SimHarness, client: Client) -> None:
    sim.run(0.02)
    frames = transforms(latched(sim, "/tf_static")) | transforms(client.messages("/tf")[-1])
    del frames["map", "base_link"]
    assert ("Camera", "Camera_optical") in frames
    assert poses(latched(sim, "/robot_description")["data"]) == frames


def test_wheels_have_the_size_of_the_model_and_turn_with_the_steering(sim: SimHarness, client: Client) -> None:
    client.send("/ackermann_cmd", "ackermann_msgs/AckermannDriveStamped", drive={"steering_angle": 0.4, "speed": 1.0})
    sim.run(2.0)
    body, found = sim.world.bodies[0], joints(latched(sim, "/robot_description")["data"])
    left = found["front_left_wheel"]
    limit = left.find("limit")
    assert limit is not None
    assert float(limit.attrib["upper"]) == -float(limit.attrib["lower"]) == body.max_steer
    assert left.attrib["type"] == "revolute"
    frames = transforms(client.messages("/tf")[-1])
    for name in WHEEL_FRAMES:
        x, y, z, *axes = frames["base_link", name]
        assert (x, abs(y) < body.width / 2, 0.2 < z < 0.5) == (body.wheelbase * ("front" in name), True, True)
        assert 2.0 * math.atan2(axes[2], axes[3]) == pytest.approx(0.4 * ("front" in name))


def test_it_is_published_anew_when_sensors_or_the_model_change_and_only_then(sim: SimHarness, client: Client) -> None:
    sim.run(0.1)
    assert client.messages("/robot_description") == []
    client.call("/sim/sensors", {"move": ['{"frame_id": "Camera", "z": 2.5}']})
    assert poses(latched(sim, "/robot_description")["data"])["base_link", "Camera"][2] == 2.5
    client.call("/sim/sensors", {"remove": ["Camera"]})
    assert "Camera" not in joints(latched(sim, "/robot_description")["data"])
    sim.world.bodies[0] = replace_body(sim, wheelbase=3.5)
    sim.node.context.static_tf.announce(sim.now)
    assert poses(latched(sim, "/robot_description")["data"])["base_link", "front_left_wheel"][0] == 3.5
    assert len(client.messages("/robot_description")) == 3


def replace_body(sim: SimHarness, **figures: float) -> Any:  # noqa: ANN401 - a Body
    return dataclasses.replace(sim.world.bodies[0], **figures)


@pytest.mark.parametrize(("ros", "name"), [(1, "/robot_description"), (2, "/morai_sim:robot_description")])
def test_the_parameter_is_the_text_of_the_topic(ros: Any, name: str) -> None:  # noqa: ANN401 - a literal
    sim = SimHarness(standard_topics=True, ros=ros)
    assert json.loads(sim.bus.parameters.text(name)) == latched(sim, "/robot_description")["data"]


def test_a_further_ego_has_its_own_until_it_leaves(sim: SimHarness, client: Client) -> None:
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2))
    found = joints(latched(sim, "/Ego-2/robot_description")["data"])
    assert "Ego-2/gps_link" in found
    assert "/Ego-2/robot_description" in sim.bus.parameters
    client.call("/sim/reset", {"seed": -1})
    assert not sim.bus.topics["/Ego-2/robot_description"].publishers
    assert "/Ego-2/robot_description" not in sim.bus.parameters
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2))
    assert latched(sim, "/Ego-2/robot_description")["data"].startswith("<?xml")


def test_any_name_is_valid_xml(sim: SimHarness) -> None:
    ego = sim.node.egos.first
    ego.optical_frames = ()
    ego.mountings = {'a"<&\x01\ud800>': Mounting()}
    sim.world.names[0] = "<car & 'co'>"
    text = sim.node.component(RobotDescription).describe(ego)
    assert 'a"<&__>' in joints(text)
    assert ET.fromstring(text).attrib["name"] == "<car & 'co'>"  # noqa: S314 - as above


def test_a_two_wheeler_has_no_links_of_wheels(sim: SimHarness) -> None:
    sim.world.bodies[0] = replace_body(sim, width=0.7)
    assert find_wheels(sim.world, sim.node.egos.first) == []
    text = sim.node.component(RobotDescription).describe(sim.node.egos.first)
    assert "front_left_wheel" not in joints(text)


def test_without_standard_topics_there_is_none() -> None:
    sim = SimHarness()
    assert "/robot_description" not in sim.bus.topics
    assert "/robot_description" not in sim.bus.parameters
