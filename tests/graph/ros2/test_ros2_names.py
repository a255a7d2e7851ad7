"""Names of topics and types for DDS, as ROS 2's own programs write them."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.ros2.ros2_names import dds_topic, dds_type, is_name, topic_of, type_of


@pytest.mark.parametrize("name", ["/imu", "/a/b_2/C", "/_x", "/" + "n" * 242])
def test_names_of_ros2_are_recognized(name: str) -> None:
    assert is_name(name)
    assert topic_of(dds_topic(name)) == name


@pytest.mark.parametrize(
    "name", ["/Ego-2/ctrl_cmd", "/2d", "imu", "/a//b", "/a/", "/a__b", "/é", "/", "", "/" + "n" * 243]
)
def test_other_names_are_not(name: str) -> None:
    assert not is_name(name)


def test_a_namespace_stands_before_every_name() -> None:
    assert dds_topic("/imu", "/sim1") == "rt/sim1/imu"
    assert topic_of("rt/sim1/imu", "/sim1") == "/imu"
    assert topic_of("rt/imu", "/sim1") is None
    assert topic_of("rt/sim12/imu", "/sim1") is None


@pytest.mark.parametrize("name", ["rq/add/Request", "rr/add/Reply", "ros_discovery_info", "rt", ""])
def test_services_and_other_topics_of_dds_are_no_topics(name: str) -> None:
    assert topic_of(name) is None


def test_types_are_spelled_as_the_compilers_of_ros2_do() -> None:
    assert dds_type("sensor_msgs/msg/Imu") == "sensor_msgs::msg::dds_::Imu_"
    assert type_of("sensor_msgs::msg::dds_::Imu_") == "sensor_msgs/Imu"
    assert type_of("rcl_interfaces::srv::dds_::GetParameters_Request_") is None
    assert type_of("Imu") is None
