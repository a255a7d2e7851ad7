"""Types as nodes of ROS 1 know them: both generations of a bus, definitions of other nodes, and hostile ones."""

from __future__ import annotations

import hashlib

import pytest

from rosbridge_sim.errors import FieldError, GraphError, PeerError
from rosbridge_sim.graph.ros1.ros1_types import MAX_LEARNT, Ros1Types
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from tests.graph.bus_fixture import make_store

BORDER = f"\n{'=' * 80}\nMSG: "


def make_types(**texts: str) -> Ros1Types:
    store = Store({("p", "msg", name): text for name, text in texts.items()})
    return Ros1Types(store, store)


def sum_of(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def test_a_bus_of_ros2_speaks_to_nodes_of_ros1() -> None:
    one, two = make_store(1), make_store(2)
    types, native = Ros1Types(two, one), Ros1Types(one, one)
    body = b'{"header":{"stamp":{"sec":7,"nanosec":1},"frame_id":"map"},"child_frame_id":"car"}'
    message_type = two.message("nav_msgs/Odometry")
    raw = types.find("nav_msgs/Odometry").encode(Message(message_type, message_type.decode_json(body, 0)))
    value = native.find("nav_msgs/Odometry").decode(raw, 0)
    assert (value.header.stamp.secs, value.header.frame_id, value.child_frame_id) == (7, "map", "car")
    again = types.find("nav_msgs/Odometry").decode(raw, 0)
    assert (again.header.stamp.sec, again.child_frame_id) == (7, "car")
    assert not types.find("nav_msgs/Odometry").has_same_bytes


def test_a_type_with_other_fields_in_ros1_is_refused_before_a_message_is() -> None:
    with pytest.raises(FieldError, match="passes with --ros 1"):
        Ros1Types(make_store(2), make_store(1)).find("vision_msgs/BoundingBox2D")


def test_types_of_a_definition_are_learnt_with_those_in_it() -> None:
    types = make_types(Known="uint8 x")
    text = f"# a robot\nWheel[] wheels\np/Known known{BORDER}q/Wheel\nfloat32 speed # [m/s]{BORDER}p/Known\nuint8 x"
    wheel, known = sum_of("float32 speed"), sum_of("uint8 x")
    types.learn("q/Robot", text, sum_of(f"{wheel} wheels\n{known} known"))
    assert types.find("q/Robot").decode(b"\1\0\0\0" + bytes(4) + b"\5", 0).known.x == 5
    assert types.find("q/Wheel").md5 == wheel


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("uint8 x", "has the md5 sum"),
        ("uint8", "q/msg/Robot.msg:1"),
        ("Missing m", "no such message"),
        ("Robot r", "nested more than 50 deep"),
        ("uint8[16000000] x", "values by default"),
        (f"A[900] a{BORDER}q/A\nB[900] b{BORDER}q/B\nuint8 x", "values by default"),
        (
            "A0 a" + "".join(f"{BORDER}q/A{i}\nA{i + 1} a\nA{i + 1} b" for i in range(40)) + f"{BORDER}q/A40\nuint8 x",
            "",
        ),
        (f"A a{BORDER}../../etc\nuint8 x", ""),
        ("", "has the md5 sum"),
    ],
)
def test_a_hostile_definition_changes_nothing(text: str, why: str) -> None:
    types = make_types(Known="uint8 x")
    with pytest.raises(GraphError, match=f"the definition of q/Robot that a node sent .*{why}"):
        types.learn("q/Robot", text, "0" * 32)
    assert not types.is_known("q/Robot")
    assert not types.is_known("q/A")


def test_definitions_of_other_nodes_are_bounded() -> None:
    types = make_types()
    text = "uint8 x\n#" + "x" * (MAX_LEARNT // 2)
    types.learn("q/A", text, sum_of("uint8 x"))
    with pytest.raises(GraphError, match="characters in all"):
        types.learn("q/B", text, sum_of("uint8 x"))


def test_a_service_of_an_installation_is_found() -> None:
    store = make_store(1).with_texts({})
    types = Ros1Types(store, store, {"robots/Arm": "float64 angle\n---\nbool is_done"}.get)
    assert types.find_service("robots/Arm").hash == sum_of("float64 anglebool is_done")
    with pytest.raises(PeerError, match="robots2"):
        types.find_service("robots2/Arm")
