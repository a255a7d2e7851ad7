"""Fields of messages at a remote bridge, compared with ours by name and type."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.graph.attach.release_check import _differing, _fields_in
from rosbridge_sim.records import asdict
from rosbridge_sim.schema.definitions.typedefs import typedefs
from rosbridge_sim.schema.store import Store
from tests.graph.bus_fixture import make_store

NAMES = (
    "morai_msgs/EgoVehicleStatus",
    "morai_msgs/ObjectStatusList",
    "morai_msgs/CtrlCmd",
    "morai_msgs/SaveSensorData",
)
IDL = {"byte": "octet", "char": "uint8", "bool": "boolean", "float32": "float", "float64": "double"}


@pytest.fixture(scope="module")
def store() -> Store:
    return make_store()


def answer(store: Store, name: str) -> dict[str, Any]:
    """What rosapi says of a type that is ours."""
    return {"typedefs": [asdict(each) for each in typedefs(store.message(name).spec)]}


def as_ros2(values: dict[str, Any]) -> dict[str, Any]:
    """The same as rosapi of ROS 2 spells it: types of IDL, names with an underscore in front."""
    for each in values["typedefs"]:
        each["fieldnames"] = ["_" + one for one in each["fieldnames"]]
        each["fieldtypes"] = [
            {"time": "builtin_interfaces/Time"}.get(one, IDL.get(one, one)) for one in each["fieldtypes"]
        ]
        each["type"] = each["type"].replace("/", "/msg/")
    return values


@pytest.mark.parametrize("name", NAMES)
def test_same_fields_in_the_spelling_of_either_generation_are_no_difference(store: Store, name: str) -> None:
    for values in (answer(store, name), as_ros2(answer(store, name))):
        fields = {kind.replace("/msg/", "/"): each for kind, each in _fields_in(values).items()}
        assert name in fields
        assert _differing(fields, store) == []


@pytest.mark.parametrize(
    ("field", "kind", "length"),
    [("velocity", "geometry_msgs/Point", -1), ("heading", "float32", -1), ("accel", "float32", 0)],
)
def test_field_of_another_type_is_a_difference(store: Store, field: str, kind: str, length: int) -> None:
    values = answer(store, "morai_msgs/EgoVehicleStatus")
    first = values["typedefs"][0]
    at = first["fieldnames"].index(field)
    first["fieldtypes"][at], first["fieldarraylen"][at] = kind, length
    assert _differing(_fields_in(values), store) == ["morai_msgs/EgoVehicleStatus"]


def test_sequence_that_a_server_leaves_as_it_is_counts_as_a_list(store: Store) -> None:
    values = answer(store, "morai_msgs/ObjectStatusList")
    first = values["typedefs"][0]
    at = first["fieldnames"].index("npc_list")
    first["fieldtypes"][at], first["fieldarraylen"][at] = f"sequence<{first['fieldtypes'][at]}, 5>", -1
    assert _differing(_fields_in(values), store) == []


@pytest.mark.parametrize(
    "spoiled", [None, {}, {"typedefs": 3}, {"typedefs": [3]}, {"typedefs": [{"type": "morai_msgs/A"}]}]
)
def test_answer_without_fields_says_nothing(spoiled: Any) -> None:  # noqa: ANN401 - what a server may send
    assert _fields_in(spoiled) == {}
