"""The parameter services of ROS 2 nodes, on a bus in memory."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.parameters import MAX_PARAMETER_BYTES
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.rosapi_services.node_parameters import (
    MAX_LISTED,
    MAX_NAMES,
    MAX_TEXT,
    MAX_VALUES,
    provide_node_parameters,
)
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from tests.graph.bus_fixture import Wire, make_bus, make_store

NODE = "/rosapi"


def node(policy: Policy | None = None) -> Wire:
    """A client of a bus with one node that has parameters."""
    bus = Bus(make_store(2))
    policy = Policy() if policy is None else policy
    Rosapi(bus, policy)
    provide_node_parameters(bus, policy, is_simulated=True)
    return Wire(bus, policy)


def ask(wire: Wire, method: str, /, **args: object) -> dict[str, Any]:
    answer = wire.calls(f"{NODE}/{method}", **args)
    assert answer["result"] is True, answer
    values: dict[str, Any] = answer["values"]
    return values


def put(wire: Wire, name: str, value: str) -> None:
    assert wire.calls("/rosapi/set_param", name=f"{NODE}:{name}", value=value)["result"] is True


def test_each_node_says_that_its_stamps_are_simulated_time() -> None:
    wire = node()
    assert ask(wire, "list_parameters")["result"] == {"names": ["use_sim_time"], "prefixes": []}
    (value,) = ask(wire, "get_parameters", names=["use_sim_time"])["values"]
    assert (value["type"], value["bool_value"]) == (1, True)
    assert wire.learns("get_param", name=f"{NODE}:use_sim_time")["value"] == "true"
    (result,) = ask(wire, "set_parameters", parameters=[{"name": "use_sim_time", "value": {"type": 1}}])["results"]
    assert result == {"successful": False, "reason": "parameter 'use_sim_time' cannot be set because it is read-only"}
    (described,) = ask(wire, "describe_parameters", names=["use_sim_time"])["descriptors"]
    assert (described["name"], described["type"], described["read_only"]) == ("use_sim_time", 1, True)


def test_ros_1_has_no_such_services() -> None:
    bus = make_bus()
    Rosapi(bus)
    provide_node_parameters(bus, Policy(), is_simulated=True)
    assert [name for name in bus.services if "parameters" in name] == []


@pytest.mark.parametrize(
    ("text", "kind", "field", "value"),
    [
        ("7", 2, "integer_value", 7),
        ("0.5", 3, "double_value", 0.5),
        ('"a"', 4, "string_value", "a"),
        ("[true,false]", 6, "bool_array_value", [True, False]),
        ("[1,2]", 7, "integer_array_value", [1, 2]),
        ("[1,2.5]", 8, "double_array_value", [1.0, 2.5]),
        ('["a"]', 9, "string_array_value", ["a"]),
        ('{"x":1}', 4, "string_value", '{"x":1}'),
        ('[1,"a"]', 4, "string_value", '[1,"a"]'),
        ("null", 4, "string_value", "null"),
        ("[[1]]", 4, "string_value", "[[1]]"),
    ],
)
def test_values_have_the_types_of_ros_2(text: str, kind: int, field: str, value: object) -> None:
    wire = node()
    put(wire, "x", text)
    (got, unset) = ask(wire, "get_parameters", names=["x", "y"])["values"]
    assert (got["type"], got[field]) == (kind, value)
    assert unset["type"] == 0
    assert ask(wire, "get_parameter_types", names=["x", "y"])["types"] == [kind, 0]
    again = ask(wire, "set_parameters", parameters=[{"name": "z", "value": got}])["results"]
    assert again == [{"successful": True, "reason": ""}]
    assert ask(wire, "get_parameters", names=["z"])["values"] == [got]


def test_lists_have_prefixes_and_depths() -> None:
    wire = node()
    for name in ("a.b", "a.b.c", "ab", "d"):
        put(wire, name, "1")

    def listed(**args: object) -> list[str]:
        names: list[str] = ask(wire, "list_parameters", **args)["result"]["names"]
        return [name for name in names if name != "use_sim_time"]

    assert listed() == ["a.b", "a.b.c", "ab", "d"]
    assert listed(depth=1) == ["ab", "d"]
    assert listed(prefixes=["a"]) == ["a.b", "a.b.c"]
    assert listed(prefixes=["a"], depth=1) == ["a.b"]
    assert listed(prefixes=["a.b", "d"]) == ["a.b", "a.b.c", "d"]
    assert ask(wire, "list_parameters")["result"]["prefixes"] == ["a", "a.b"]


def test_parameters_are_set_together_or_not_at_all_and_type_0_removes_one() -> None:
    wire = node()
    put(wire, "x", "1")
    two = {"type": 2, "integer_value": 2}
    bad = [{"name": "x", "value": two}, {"name": "y", "value": two}, {"name": "use_sim_time", "value": two}]
    assert ask(wire, "set_parameters_atomically", parameters=bad)["result"]["successful"] is False
    assert [value["type"] for value in ask(wire, "get_parameters", names=["x", "y"])["values"]] == [2, 0]
    assert ask(wire, "get_parameters", names=["x"])["values"][0]["integer_value"] == 1
    assert ask(wire, "set_parameters_atomically", parameters=bad[:2])["result"]["successful"] is True
    assert ask(wire, "get_parameters", names=["y"])["values"][0]["integer_value"] == 2
    ask(wire, "set_parameters", parameters=[{"name": "y", "value": {"type": 0}}])
    assert wire.learns("has_param", name=f"{NODE}:y") == {"exists": False}
    (wrong,) = ask(wire, "set_parameters", parameters=[{"name": "y", "value": {"type": 77}}])["results"]
    assert wrong["successful"] is False


@pytest.mark.parametrize(
    ("denied", "refused"),
    [
        ("/rosapi/set_param", {"set_parameters", "set_parameters_atomically"}),
        ("/rosapi/get_param", {"get_parameters", "get_parameter_types", "describe_parameters"}),
        ("/rosapi/get_param_names", {"list_parameters"}),
        (f"{NODE}/list_parameters", {"list_parameters"}),
    ],
)
def test_patterns_for_rosapi_hold_for_the_services_of_nodes(denied: str, refused: set[str]) -> None:
    wire = node(Policy(service=Rule(deny=(denied,))))
    methods = ["set_parameters", "set_parameters_atomically", "get_parameters", "get_parameter_types"]
    methods += ["describe_parameters", "list_parameters"]
    assert {method for method in methods if not wire.calls(f"{NODE}/{method}")["result"]} == refused


def test_patterns_for_parameters_hold_for_the_parameters_of_nodes() -> None:
    wire = node(Policy(parameter=Rule(deny=(f"{NODE}:secret*",))))
    assert "Not allowed" in wire.calls(f"{NODE}/get_parameters", names=["secret"])["values"]
    (result,) = ask(wire, "set_parameters", parameters=[{"name": "secret", "value": {"type": 2}}])["results"]
    assert result["successful"] is False
    assert ask(wire, "list_parameters")["result"]["names"] == ["use_sim_time"]


def test_requests_are_bounded() -> None:
    wire = node()
    assert "at most" in wire.calls(f"{NODE}/get_parameters", names=["x"] * (MAX_NAMES + 1))["values"]
    put(wire, "x", '"' + "a" * (MAX_TEXT // 2) + '"')
    assert "read fewer" in wire.calls(f"{NODE}/get_parameters", names=["x"] * 3)["values"]


def test_a_list_of_many_prefixes_looks_at_a_bounded_number_of_names() -> None:
    wire = node()
    for i in range(MAX_LISTED - 1):  # with `use_sim_time`, as many as are allowed
        wire.peer.bus.parameters.put(f"{NODE}:a.b{i}", "1", wire.peer)
    assert len(ask(wire, "list_parameters")["result"]["names"]) == MAX_LISTED
    prefixes = [f"none{i}" for i in range(MAX_NAMES)]
    assert ask(wire, "list_parameters", prefixes=prefixes)["result"]["names"] == []
    assert len(ask(wire, "list_parameters", prefixes=["a"] * MAX_NAMES)["result"]["names"]) == MAX_LISTED - 1
    put(wire, "one_more", "1")
    assert "list fewer" in wire.calls(f"{NODE}/list_parameters")["values"]
    assert ask(wire, "list_parameters", prefixes=["one_more"])["result"]["names"] == ["one_more"]


def test_values_of_many_elements_are_not_read_at_once() -> None:
    wire = node()
    put(wire, "x", str([1] * (MAX_VALUES // 2)))
    assert len(ask(wire, "get_parameters", names=["x", "x"])["values"]) == 2
    assert "read fewer" in wire.calls(f"{NODE}/get_parameters", names=["x"] * 3)["values"]


@pytest.mark.parametrize(
    "value",
    [
        '{"type": 3, "double_value": NaN}',
        '{"type": 3, "double_value": -Infinity}',
        '{"type": 8, "double_array_value": [1.0, Infinity]}',
    ],
)
def test_what_json_cannot_keep_is_refused(value: str) -> None:
    wire = node()
    put(wire, "x", "1.5")
    (result,) = ask(wire, "set_parameters", parameters=[{"name": "x", "value": json.loads(value)}])["results"]
    assert result == {"successful": False, "reason": "NaN and infinity cannot be kept as a parameter"}
    assert wire.learns("get_param", name=f"{NODE}:x")["value"] == "1.5"


def test_a_refused_change_gives_back_what_another_client_has_set_whatever_the_limits() -> None:
    bus = Bus(make_store(2))
    policy = Policy()
    Rosapi(bus, policy)
    provide_node_parameters(bus, policy, is_simulated=True)
    wire, other = Wire(bus), Wire(bus)
    most = MAX_PARAMETER_BYTES // 2
    text = '"' + "a" * (most - 20_000) + '"'
    bus.parameters.put(f"{NODE}:x", text, other.peer)
    bus.parameters.put(f"{NODE}:own", text, wire.peer)
    held = (bus.parameters.num_held(other.peer), bus.parameters.num_held(wire.peer))
    changes = [
        {"name": "x", "value": {"type": 4, "string_value": ""}},
        {"name": "y", "value": {"type": 4, "string_value": "a" * 30_000}},
    ]
    result = ask(wire, "set_parameters_atomically", parameters=changes)["result"]
    assert result["successful"] is False
    assert "at most" in result["reason"]
    assert bus.parameters.text(f"{NODE}:x") == text
    assert f"{NODE}:y" not in bus.parameters
    assert held == (bus.parameters.num_held(other.peer), bus.parameters.num_held(wire.peer))
