"""Types as nodes of ROS 2 know them: bytes there and back, hashes, and bytes that do not fit."""

from __future__ import annotations

import struct
from functools import cache
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rosbridge_sim.errors import FieldError, PeerError, Reason, TypeNameError
from rosbridge_sim.graph.ros2.cdr_objects import count_objects
from rosbridge_sim.graph.ros2.cdr_types import MAX_OBJECTS, CdrTypes
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from tests.graph.bus_fixture import make_store

IMU_IN_JAZZY = "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"
"""As `ros2 topic info --verbose` shows it."""


@cache
def make_types(ros: Generation) -> tuple[Store, CdrTypes]:
    store = make_store(ros)
    return store, CdrTypes(store, make_store(2))


def test_types_go_there_and_back_to_the_byte() -> None:
    assert check_round_trip(1, ("diagnostic_msgs", "visualization_msgs")) == []


@pytest.mark.long
@pytest.mark.parametrize("ros", [1, 2])
def test_every_type_goes_there_and_back_to_the_byte(ros: Generation) -> None:
    reasons = check_round_trip(ros, ())
    assert sum("wstring" in reason for reason in reasons) == 1
    others = [reason for reason in reasons if "wstring" not in reason]
    assert all(reason.startswith("vision_msgs/") and "passes with --ros 2" in reason for reason in others)
    assert bool(others) is (ros == 1)


def test_a_type_with_other_fields_in_ros2_is_refused_before_a_message_is() -> None:
    _, types = make_types(1)
    with pytest.raises(FieldError, match="vision_msgs/BoundingBox2D has other fields in ROS 2; it passes with --ros 2"):
        types.find("vision_msgs/BoundingBox2D")
    make_types(2)[1].find("vision_msgs/BoundingBox2D")


def check_round_trip(ros: Generation, packages: tuple[str, ...]) -> list[str]:
    """Check all types of some packages, or of all; return why some were refused."""
    store, types = make_types(ros)
    refused = []
    for name in store.names("msg"):
        if packages and name.partition("/")[0] not in packages:
            continue
        try:
            cdr_type = types.find(name)
        except PeerError as error:
            refused.append(str(error))
            continue
        raw = cdr_type.encode(Message(cdr_type.type, cdr_type.type.default()))
        again = cdr_type.encode(Message(cdr_type.type, cdr_type.decode(raw, 0)))
        assert again == raw, name
    return refused


def test_both_generations_write_the_same_bytes() -> None:
    (one, types1), (two, types2) = make_types(1), make_types(2)
    pose = b'{"position":{"x":1.5},"orientation":{"w":1}}'
    body = b'{"header":{"frame_id":"map"},"child_frame_id":"car","pose":{"pose":%b}}' % pose
    raws = []
    for store, types in ((one, types1), (two, types2)):
        message_type = store.message("nav_msgs/Odometry")
        message = Message(message_type, message_type.decode_json(body, 7_000_000_001))
        raws.append(types.find("nav_msgs/Odometry").encode(message))
    assert raws[0] == raws[1]
    assert (
        one.message("nav_msgs/Odometry")
        .encode_json(types1.find("nav_msgs/Odometry").decode(raws[1], 0))
        .startswith(b'{"header":{"seq":0,"stamp":{"secs":7,"nsecs":1}')
    )


def test_hashes_are_those_of_ros2() -> None:
    store, types = make_types(2)
    assert types.find("sensor_msgs/Imu").hash == IMU_IN_JAZZY
    for name in ("visualization_msgs/MarkerArray", "shape_msgs/SolidPrimitive", "morai_msgs/EgoVehicleStatus"):
        reference = get_typestore(Stores.EMPTY)
        full_name = name.replace("/", "/msg/")
        reference.register(get_types_from_msg(store.full_text(name), full_name))
        assert types.find(name).hash == reference.hash_rihs01(full_name)


def test_pictures_and_clouds_keep_their_bytes() -> None:
    _, types = make_types(1)
    image = types.find("sensor_msgs/Image")
    value = image.type.struct_type(height=2, width=3, data=bytes(range(6)))
    assert image.decode(image.encode(Message(image.type, value)), 0).data == bytes(range(6))
    scan = types.find("sensor_msgs/LaserScan")
    value = scan.type.struct_type(ranges=np.arange(360, dtype=np.float32))
    assert list(scan.decode(scan.encode(Message(scan.type, value)), 0).ranges) == list(range(360))


def test_numbers_that_json_does_not_have_stay_what_they_are() -> None:
    for ros in (1, 2):
        store, types = make_types(ros)
        scan = types.find("sensor_msgs/LaserScan")
        value: Any = scan.type.struct_type(ranges=np.array([np.inf, np.nan, 1.5], dtype=np.float32), angle_min=-np.inf)
        found: Any = scan.decode(scan.encode(Message(scan.type, value)), 0)
        assert np.array_equal(found.ranges, value.ranges, equal_nan=True)
        assert found.angle_min == -np.inf
        assert scan.has_same_bytes is (store.ros == 2)


def test_objects_are_counted_in_lists_of_fixed_and_of_any_length_and_behind_messages_without_fields() -> None:
    fields = "uint8 x\nPart[2] two\nint16 y\nPart[] any\nEmpty e\nfloat64[3] f\nbool[] g\nstring[<=4] names\nint8 z"
    texts = {
        ("x_msgs", "msg", "Empty"): "",
        ("x_msgs", "msg", "Part"): "uint8 a\nstring b\nfloat64 c",
        ("x_msgs", "msg", "Whole"): fields,
    }
    store = Store(texts, ros=2)
    whole = CdrTypes(store, store).find("x_msgs/Whole")
    part = store.message("x_msgs/Part").struct_type
    value = whole.type.struct_type(
        two=[part(b="abc"), part(b="")], any=[part(b="x" * i) for i in range(3)], g=[True] * 5, names=["one", "two"]
    )
    raw = whole.encode(Message(whole.type, value))
    assert whole.decode(raw, 0) == value
    # Two and three parts with a text each, one message without fields, and two names.
    assert count_objects(raw, whole.name, whole.definitions, 100) == (2 * 2 + 2 * 3 + 1 + 2, len(raw))
    assert count_objects(raw, whole.name, whole.definitions, 13) == (13, len(raw))
    assert count_objects(raw, whole.name, whole.definitions, 5)[0] > 5
    for length in (4, 20, len(raw) - 12):
        with pytest.raises((struct.error, IndexError)):
            count_objects(raw[:length], whole.name, whole.definitions, 100)


def test_text_of_wide_characters_is_refused_before_a_message_is() -> None:
    with pytest.raises(PeerError, match="wstring"):
        make_types(2)[1].find("example_interfaces/WString")


@pytest.mark.parametrize("raw", [b"", b"\0\1\0\0", b"\0\1\0\0\xff\xff\xff\x7fab", b"\0\1\0\0\4\0\0\0\xff\xfe\xfd\0"])
def test_bytes_that_do_not_fit_are_refused_in_words(raw: bytes) -> None:
    _, types = make_types(1)
    with pytest.raises(FieldError, match="std_msgs/msg/String: the bytes are not a message of this type"):
        types.find("std_msgs/String").decode(raw, 0)


def test_messages_of_many_small_parts_are_bounded_and_large_clouds_are_not() -> None:
    store, types = make_types(1)
    many = types.find("tf2_msgs/TFMessage")
    one = store.message("geometry_msgs/TransformStamped").struct_type()
    raw = many.encode(Message(many.type, many.type.struct_type(transforms=[one] * MAX_OBJECTS)))
    with pytest.raises(FieldError, match="at most 4,000 messages and texts") as refusal:
        many.decode(raw, 0)
    assert refusal.value.reason is Reason.TOO_MUCH
    cloud = types.find("sensor_msgs/PointCloud2")
    field = store.message("sensor_msgs/PointField").struct_type(name="x")
    value = cloud.type.struct_type(fields=[field] * 6, data=bytes(400_000))
    assert len(cloud.decode(cloud.encode(Message(cloud.type, value)), 0).data) == 400_000


def test_message_of_just_as_many_texts_as_are_read_is_read() -> None:
    joints = make_types(1)[1].find("sensor_msgs/JointState")
    make = joints.type.struct_type
    for num, is_read in (
        (MAX_OBJECTS - 3, True),
        (MAX_OBJECTS - 2, False),
    ):  # the header with stamp and text counts, too
        raw = joints.encode(Message(joints.type, make(name=["j"] * num)))
        if is_read:
            assert joints.decode(raw, 0).name == ["j"] * num
        else:
            with pytest.raises(FieldError, match="at most 4,000 messages and texts"):
                joints.decode(raw, 0)


def test_parts_of_services_and_actions_are_made_once() -> None:
    _, types = make_types(1)
    first, again = (types.find_service("std_srvs/SetBool") for _ in range(2))
    assert first.request is again.request
    assert first.response is again.response
    one, other = (types.find_action("example_interfaces/Fibonacci") for _ in range(2))
    assert one.goal is other.goal
    assert one.feedback is other.feedback


def test_types_that_ros2_does_not_have_are_refused_each_time() -> None:
    _, types = make_types(1)
    for _ in range(2):
        with pytest.raises(TypeNameError):
            types.find("nowhere_msgs/Nothing")


def test_what_the_buffer_of_rclpy_has_behind_a_message_is_ignored() -> None:
    _, types = make_types(2)
    service = types.find_service("rcl_interfaces/GetParameters")
    value = service.response.type.check({"values": [{"type": 3, "double_value": 1.5}]}, 0)
    raw = service.response.encode(Message(service.response.type, value))
    assert service.response.decode(raw + b"of another time", 0) == value
