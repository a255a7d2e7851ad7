"""Elements of long bodies are counted before decoding."""

from __future__ import annotations

from typing import Any

import orjson
import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.skeleton import MAX_COST, Skeleton
from tests.graph.bus_fixture import make_store

STORE = make_store()


def decode(name: str, body: dict[str, Any]) -> Struct:
    return STORE.message(name).decode_json(orjson.dumps(body), 0)


def cost(name: str, body: dict[str, Any]) -> int:
    return max(Skeleton(STORE.message(name).spec).costs(orjson.dumps(body)), default=0)


def test_marker_counts_its_structs_and_colour_values() -> None:
    marker = 9 + 2 * 4  # marker, header, stamp..: time is no message
    each = cost("visualization_msgs/MarkerArray", {"markers": [{}]})
    assert each <= marker
    assert cost("visualization_msgs/MarkerArray", {"markers": [{}] * 10}) == 10 * each
    assert cost("visualization_msgs/MarkerArray", {"markers": [{"points": [{}] * 7}]}) == each + 7


def test_lists_within_single_messages_are_counted() -> None:
    body = {"joint_state": {"name": ["a"]}, "multi_dof_joint_state": {"transforms": [{}] * 3, "joint_names": []}}
    assert cost("moveit_msgs/RobotState", body) > 0 if "moveit_msgs" in STORE.packages() else True
    layout = {"layout": {"dim": [{}] * 5}, "data": []}
    assert cost("std_msgs/Float32MultiArray", layout) == 5


def test_elements_are_counted_before_the_lists_in_them() -> None:
    markers: dict[str, Any] = {"markers": [{"points": [{}] * 7}] * 2}
    flat, whole = Skeleton(STORE.message("visualization_msgs/MarkerArray").spec).costs(orjson.dumps(markers))
    assert flat == cost("visualization_msgs/MarkerArray", {"markers": [{}] * 2})
    assert whole == flat + 14


def test_type_without_lists_is_not_counted() -> None:
    assert cost("sensor_msgs/Image", {"data": "AAAA"}) == 0


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("visualization_msgs/MarkerArray", "markers"),
        ("tf2_msgs/TFMessage", "transforms"),
        ("geometry_msgs/Polygon", "points"),
        ("morai_msgs/NpcGhostCmd", "npc_list"),
    ],
)
def test_empty_elements_beyond_the_bound_are_refused(name: str, field: str) -> None:
    each = cost(name, {field: [{}]})
    assert len(getattr(decode(name, {field: [{}] * (MAX_COST // each // 10)}), field)) == MAX_COST // each // 10
    with pytest.raises(FieldError, match="expected lists that stand for at most 300,000"):
        decode(name, {field: [{}] * (MAX_COST // each + 1)})


def test_five_thousand_markers_are_accepted() -> None:
    marker = orjson.loads(
        STORE.message("visualization_msgs/Marker").encode_json(decode("visualization_msgs/Marker", {}))
    )
    marker |= {"points": [{"x": 0.5, "y": 1.5, "z": 0.0}] * 2, "colors": [{"r": 0.1, "g": 0.2, "b": 0.3, "a": 1.0}] * 2}
    assert len(decode("visualization_msgs/MarkerArray", {"markers": [marker] * 5_000}).markers) == 5_000


@pytest.mark.parametrize("rubbish", [None, 7, "x", [], [[]], {"x": []}])
def test_lists_of_wrong_elements_are_refused(rubbish: object) -> None:
    with pytest.raises(FieldError):
        decode(
            "tf2_msgs/TFMessage",
            {"transforms": [{}] * 20_000 + [rubbish]} if rubbish else {"transforms": 7, "x" * 40_000: 1},
        )
