"""The parameter server: values, namespaces, and the share of one client."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph import parameters as parameters_module
from rosbridge_sim.graph.parameters import MAX_VALUE_PARTS, Parameters, merge
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from tests.graph.bus_fixture import make_bus, make_peer


class _Client(Participant):
    name = "/client"

    def notify(self, level: str, text: str) -> None:
        raise AssertionError((level, text))


def _tree(parameters: dict[str, Any]) -> dict[str, Any]:
    """The plain meaning of a namespace: each name copies what it passes through."""
    root: dict[str, Any] = {}
    for key, value in parameters.items():
        *path, last = key.split("/")
        node = root
        for part in path:
            inner = node.get(part)
            node[part] = dict(inner) if isinstance(inner, dict) else {}
            node = node[part]
        node[last] = value
    return root


_NAMES = st.lists(st.sampled_from(["a", "b", "a!", "a0", ""]), min_size=1, max_size=4).map(lambda p: "/" + "/".join(p))
_VALUES = st.recursive(
    st.integers(0, 3) | st.text("ab", max_size=2),
    lambda inner: st.dictionaries(st.sampled_from(["a", "b", ""]), inner, max_size=2),
    max_leaves=4,
)


@given(st.lists(st.tuples(_NAMES, st.none() | _VALUES), max_size=20), st.sampled_from(["/", "/a", "/a/", "/b/a", "//"]))
def test_any_order_of_changes_gives_the_tree_of_the_remaining_values(
    changes: list[tuple[str, object]], namespace: str
) -> None:
    parameters, client, kept = Parameters(), _Client(), dict[str, object]()
    for name, value in changes:
        if value is not None:
            parameters.put(name, json.dumps(value), client)
            kept[name] = value
        elif name in kept:
            parameters.remove([name])
            del kept[name]
    assert list(parameters) == sorted(kept)
    assert {name: json.loads(parameters.text(name)) for name in parameters} == kept
    prefix = namespace.rstrip("/") + "/"
    below = {name: value for name, value in kept.items() if name.startswith(prefix)}
    assert parameters.below(prefix) == sorted(below)
    assert parameters.has_below(prefix, lambda _: True) == bool(below)
    if below:
        tree = _tree({name[len(prefix) :]: value for name, value in below.items()})
        assert json.loads(parameters.tree(namespace, sorted(below))) == tree
    parameters.remove(list(parameters))
    assert parameters.num_held(client) == 0


@given(st.dictionaries(_NAMES.map(lambda name: name[1:]), _VALUES, max_size=6))
def test_merging_keeps_the_values(values: dict[str, Any]) -> None:
    before = json.dumps(values)
    assert merge(values) == _tree(values)
    assert json.dumps(values) == before


def test_existence_check_of_a_namespace_looks_at_one_name() -> None:
    parameters, client = Parameters(), _Client()
    for i in range(1_000):
        parameters.put(f"/a/{i}", "1", client)
    looked_at: list[str] = []

    def admits(name: str) -> bool:
        looked_at.append(name)
        return True

    assert parameters.has_below("/", admits)
    assert len(looked_at) == 1


def test_namespace_read_twice_is_encoded_once() -> None:
    parameters, client = Parameters(), _Client()
    parameters.put("/a/b", "1", client)
    assert parameters.tree("/", ["/a/b"]) is parameters.tree("/", ["/a/b"])
    parameters.put("/a/b", "2", client)
    assert json.loads(parameters.tree("/", ["/a/b"])) == {"a": {"b": 2}}


def test_removal_of_many_names_keeps_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parameters_module, "MAX_REMOVED_SINGLY", 2)
    parameters, client = Parameters(), _Client()
    for name in ("/a/1", "/a/2", "/a/3", "/b"):
        parameters.put(name, "1", client)
    parameters.remove(parameters.below("/a/"))
    assert list(parameters) == ["/b"]


def test_value_with_too_many_elements_is_refused_before_parsing() -> None:
    parameters, client = Parameters(), _Client()
    with pytest.raises(GraphError, match=f"expected {MAX_VALUE_PARTS} at most"):
        parameters.put("/a", "[" * (MAX_VALUE_PARTS + 1), client)  # no JSON, which parsing it would tell
    parameters.put("/csv", json.dumps("," * (MAX_VALUE_PARTS + 1)), client)
    assert list(parameters) == ["/csv"]


@pytest.mark.parametrize(
    ("bound", "value", "names", "text"),
    [
        ("MAX_PARAMETERS", 4, (["/a", "/b"], ["/c", "/d"]), "at most 2 parameters of one client"),
        ("MAX_NAMESPACES", 4, (["/a/x", "/b/x"], ["/c/x", "/d/x"]), "At most 2 namespaces of parameters of one client"),
        ("MAX_NAMESPACES", 4, (["/a/b/x"], ["/c/d/x"]), "At most 2 namespaces of parameters of one client"),
        ("MAX_PARAMETER_BYTES", 14, (["/name1"], ["/name2"]), "of one client can have at most 7 bytes, names included"),
    ],
)
def test_one_client_may_hold_half_of_the_room(
    monkeypatch: pytest.MonkeyPatch, bound: str, value: int, names: tuple[list[str], list[str]], text: str
) -> None:
    monkeypatch.setattr(parameters_module, bound, value)
    own, others = names
    parameters, client, other, third = Parameters(), _Client(), _Client(), _Client()
    for name in own:
        parameters.put(name, "1", client)
        parameters.put(name, "2", client)  # in place of the other
    held = parameters.num_held(client)
    with pytest.raises(GraphError, match=text):
        parameters.put("/z/x", "1", client)
    assert (list(parameters), parameters.num_held(client)) == (own, held)
    for name in others:
        parameters.put(name, "1", other)
    with pytest.raises(GraphError, match="together"):
        parameters.put("/z/x", "1", third)
    assert (list(parameters), parameters.num_held(third)) == (own + others, 0)


def test_a_parameter_counts_for_the_client_that_set_it_last() -> None:
    parameters, client, other = Parameters(), _Client(), _Client()
    parameters.put("/a", '"text"', client)
    assert parameters.num_held(client) > len('/a"text"')
    parameters.put("/a", "1", other)
    assert parameters.num_held(client) == 0 < parameters.num_held(other)


def test_parameters_outlive_their_client_and_no_longer_count_for_it() -> None:
    bus = make_bus()
    Rosapi(bus)
    peer, _ = make_peer(bus)
    peer.receive(
        b'{"op":"call_service","service":"/rosapi/set_param","args":{"name":"/a","value":"1"}}',
        0.0,
    )
    assert bus.parameters.num_held(peer) > 0
    peer.leave(0.0)
    assert bus.parameters.num_held(peer) == 0
    assert list(bus.parameters) == ["/a"]


def test_names_that_are_both_value_and_namespace_are_merged_up_to_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parameters_module, "MAX_MERGED", 2)
    parameters, client = Parameters(), _Client()
    parameters.put("/a", '{"x": 1}', client)
    parameters.put("/a/y", "2", client)
    assert json.loads(parameters.tree("/", list(parameters))) == {"a": {"x": 1, "y": 2}}
    parameters.put("/b", "3", client)
    with pytest.raises(GraphError, match=r"too large to merge: expected 2 parameters .* Read its parts"):
        parameters.tree("/", list(parameters))
    assert parameters.tree("/a", ["/a/y"]) == '{"y":2}'
