"""The standard packages of both generations."""

from __future__ import annotations

import subprocess
import sys

import pytest
from rosbags.typesys import Stores, get_typestore

from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.standard import PACKAGES, ros2_text, standard_names, standard_text
from rosbridge_sim.schema.store import Store
from scripts.write_standard_texts import TARGET, write

BOTH: list[Generation] = [1, 2]


def test_packages_equal_those_of_rosbags() -> None:
    ours = {"example_interfaces"}  # its messages are copies of those in std_msgs
    stores = {1: Stores.ROS1_NOETIC, 2: Stores.ROS2_JAZZY}
    theirs = {ros: set(get_typestore(store).fielddefs) for ros, store in stores.items()}
    packages = {ros: {name.split("/")[0] for name in names} for ros, names in theirs.items()}
    assert PACKAGES[1] == packages[1] - {"builtin_interfaces"} | ours
    assert PACKAGES[2] == packages[2] | ours


def test_texts_are_those_of_rosbags() -> None:
    assert TARGET.read_text(encoding="utf-8") == write(), "run python scripts/write_standard_texts.py"


def test_the_first_use_of_a_type_does_not_import_rosbags() -> None:
    code = """
import sys
from rosbridge_sim.schema.store import Store
store = Store({})
store.message("std_msgs/Float64MultiArray").default()
store.message("rcl_interfaces/Log").default()
assert "sensor_msgs/Image" in store.names("msg")
sys.exit("rosbags" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("ros", BOTH)
def test_every_standard_message_compiles(ros: Generation) -> None:
    store = Store({}, ros=ros)
    names = standard_names(ros)
    assert len(names) > 180
    assert len(set(names)) == len(names)
    assert set(names) <= set(store.names("msg"))
    for name in names:
        assert store.message(name).default() is not None


@pytest.mark.parametrize("ros", BOTH)
def test_types_of_only_the_other_ros_version_exist(ros: Generation) -> None:
    store = Store({}, ros=ros)
    for name in ("rcl_interfaces/Log", "rosgraph_msgs/Log", "std_msgs/Time", "action_msgs/GoalStatusArray"):
        assert store.message(name).default() is not None
    time = store.message("builtin_interfaces/Time")
    assert time.encode_json(time.decode_json(b'{"secs":1,"nanosec":2}', 0)) == b'{"sec":1,"nanosec":2}'


def test_each_ros_version_has_its_own_definition() -> None:
    fields = {ros: Store({}, ros=ros).message("sensor_msgs/CameraInfo").spec.fields for ros in BOTH}
    assert "K" in fields[1]
    assert "k" in fields[2]
    for ros in BOTH:
        t = Store({}, ros=ros).message("sensor_msgs/CameraInfo")
        for name in ("D", "d"):
            assert t.encode_json(t.check({name: [1]}, 0)).count(b"[1.0]") == 1


def test_headers_and_quaternions_are_those_of_ros_2() -> None:
    texts = {
        ("std_msgs", "msg", "Header"): "uint32 seq\ntime stamp\nstring frame_id",
        ("geometry_msgs", "msg", "Quaternion"): "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    }
    store = Store(texts, ros=2)
    assert list(store.message("std_msgs/Header").spec.fields) == ["stamp", "frame_id"]
    assert store.message("geometry_msgs/Pose").default().orientation.w == 1.0
    assert Store(texts).message("geometry_msgs/Pose").default().orientation.w == 0.0
    assert ros2_text("std_msgs", "String") is None


def test_bounds_are_kept() -> None:
    fields = Store({}, ros=2).message("shape_msgs/SolidPrimitive").definition.fields
    assert [f.full_type for f in fields] == ["uint8", "float64[<=3]", "geometry_msgs/Polygon"]
    assert "string<=255 type_name" in (
        standard_text(2, "type_description_interfaces", "IndividualTypeDescription") or ""
    )


def test_example_interfaces_has_the_plain_messages() -> None:
    for ros in BOTH:
        t = Store({}, ros=ros).message("example_interfaces/Int32MultiArray")
        assert t.spec.fields["layout"].definition.type == "example_interfaces/MultiArrayLayout"
        assert standard_text(ros, "example_interfaces", "Header") is None


def test_unknown_standard_type_does_not_exist() -> None:
    for ros in BOTH:
        assert standard_text(ros, "who", "Knows") is None
        assert standard_text(ros, "std_msgs", "Nothing") is None
