"""The policy: patterns, answered denials, and the filtered lists of rosapi."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph import parameters, topic_table
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.peers.peer import MAX_OP_ID
from rosbridge_sim.graph.policy import OPEN, Policy, Rule
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.topic_table import TYPE_MEMORY
from tests.graph.bus_fixture import Wire, make_store

Join = Callable[[Policy], Wire]


@pytest.fixture
def bus() -> Bus:
    return Bus(make_store())


@pytest.fixture
def join(bus: Bus) -> Join:
    """Wires under a policy, with a rosapi under the first one's."""
    is_first = True

    def make(policy: Policy) -> Wire:
        nonlocal is_first
        if is_first:
            Rosapi(bus, policy)
            is_first = False
        return Wire(bus, policy)

    return make


def denied(text: str, op_id: object) -> list[dict[str, Any]]:
    return [{"op": "status", "level": "error", "msg": text, "id": op_id}]


# Patterns


@pytest.mark.parametrize(
    ("allow", "deny", "name", "is_admitted"),
    [
        ((), (), "/a", True),
        (("/a",), (), "/a", True),
        (("/a",), (), "a", True),
        (("a",), (), "/a", True),
        (("/a",), (), "/a/b", False),
        (("/a*",), (), "/a/b/c", True),
        (("*/c",), (), "/a/b/c", True),
        (("/?",), (), "/ab", False),
        (("/[ab]",), (), "/b", True),
        (("[!/]*",), (), "/b", False),
        (("/a", "/b"), (), "/b", True),
        (("/A",), (), "/a", False),
        ((), ("/a",), "/a", False),
        ((), ("/a",), "/b", True),
        ((), ("*",), "/b", False),
        (("*",), ("/a/*",), "/a/b", False),
        (("*",), ("/a/*",), "/a", True),
        (("/a",), ("/a",), "/a", False),
        (("/a.b",), (), "/axb", False),
        (("/a|/b",), (), "/b", False),
        (("/a",), (), "/a\n", False),
    ],
)
def test_patterns_match_names(allow: tuple[str, ...], deny: tuple[str, ...], name: str, *, is_admitted: bool) -> None:
    if "\n" in name:
        with pytest.raises(GraphError):
            Rule(allow, deny).admits(name)
    else:
        assert Rule(allow, deny).admits(name) is is_admitted


@given(st.lists(st.text("/ab*?[]!-", min_size=1, max_size=6), max_size=3), st.text("/ab", min_size=1, max_size=8))
def test_deny_pattern_takes_precedence_over_allow_patterns(patterns: list[str], name: str) -> None:
    rule = Rule(allow=(*patterns, "*"), deny=tuple(patterns))
    assert rule.admits(name) is not rule.denies(name)


def test_policy_without_patterns_allows_everything() -> None:
    for check in (OPEN.check_publish, OPEN.check_subscribe, OPEN.check_call, OPEN.check_offer, OPEN.check_parameter):
        check("any thing, even what is no name")


# Topics


def test_denied_publishing_is_reported_at_advertise_and_at_publish(bus: Bus, join: Join) -> None:
    client = join(Policy(publish=Rule(deny=("/brake",))))
    text = "Not allowed to publish to brake"
    assert client.says(op="advertise", topic="brake", type="std_msgs/Bool", id="a") == denied(text, "a")
    assert client.says(op="publish", topic="brake", type="std_msgs/Bool", msg={}, id=2) == denied(text, 2)
    assert client.says(op="publish", topic="brake", msg={}, id=3) == denied(text, 3)
    assert "/brake" not in bus.topics
    assert client.says(op="subscribe", topic="/brake", type="std_msgs/Bool") == []
    assert client.peer.num_errors == 3


def test_denied_subscription_is_reported_and_delivers_nothing(bus: Bus, join: Join) -> None:
    policy = Policy(subscribe=Rule(allow=("/open/*",)))
    client, other = join(policy), join(policy)
    assert client.says(op="subscribe", topic="/secret", type="std_msgs/String", id="s") == denied(
        "Not allowed to subscribe to /secret", "s"
    )
    client.says(op="subscribe", topic="/open/t", type="std_msgs/String")
    for topic in ("/secret", "/open/t"):
        assert other.says(op="publish", topic=topic, type="std_msgs/String", msg={"data": "x"}) == []
    assert [frame["topic"] for frame in client.hears()] == ["/open/t"]
    assert not bus.topics["/secret"].has_listener


def test_malformed_name_is_reported_as_without_a_policy(join: Join) -> None:
    client = join(Policy(publish=Rule(allow=("/a",)), service=Rule(allow=("/a",))))
    (status,) = client.says(op="advertise", topic="a b", type="std_msgs/String", id=1)
    assert status["msg"] == "'a b' is not a valid graph name"
    assert client.calls("x" * 300)["result"] is False


def test_policy_does_not_apply_to_the_simulator(bus: Bus, join: Join) -> None:
    class Owner(Participant):
        name = "/sim"

        def notify(self, level: str, text: str) -> None:
            pass

    join(Policy(publish=Rule(deny=("*",)), service=Rule(deny=("*",))))
    bus.advertise(Owner(), "/ego", "std_msgs/String")
    bus.provide(Owner(), "/tick", "std_srvs/Trigger", lambda *_: None)


# Services and actions


def test_a_denied_call_is_answered(join: Join) -> None:
    policy = Policy(service=Rule(deny=("/drop",)))
    client, provider = join(policy), join(OPEN)
    provider.says(op="advertise_service", service="/drop", type="std_srvs/Trigger")
    wanted = {"op": "service_response", "values": "Not allowed to call /drop", "result": False}
    assert client.calls("/drop") == {**wanted, "service": "/drop", "id": "c"}
    assert client.says(op="call_service", service="/drop#7") == [{**wanted, "service": "/drop#7", "id": "7"}]
    assert client.says(op="call_service", service="/drop") == [{**wanted, "service": "/drop"}]
    assert provider.hears() == []


def test_advertising_a_denied_service_is_reported(bus: Bus, join: Join) -> None:
    client = join(Policy(service=Rule(allow=("/mine/*",))))
    text = "Not allowed to offer /other"
    kinds = {"service": "std_srvs/Trigger", "action": "example_interfaces/Fibonacci"}
    for kind, type_name in kinds.items():
        assert client.says(op=f"advertise_{kind}", type=type_name, id=1, **{kind: "/other"}) == denied(text, 1)
        assert client.says(op=f"advertise_{kind}", type=type_name, id=1, **{kind: "/mine/x"}) == []
    assert "/other" not in bus.services
    assert list(bus.actions.by_name) == ["/mine/x"]


def test_a_denied_goal_is_answered(join: Join) -> None:
    client, provider = join(Policy(service=Rule(deny=("/count",)))), join(OPEN)
    provider.says(op="advertise_action", action="/count", type="example_interfaces/Fibonacci")
    (end,) = client.says(op="send_action_goal", action="/count", id="g", args={"order": 3})
    assert end == {
        "op": "action_result",
        "action": "/count",
        "id": "g",
        "status": 0,
        "result": False,
        "values": "Not allowed to call /count",
    }
    assert provider.hears() == []


def test_goal_with_a_malformed_name_is_answered(join: Join) -> None:
    client, provider = join(OPEN), join(OPEN)
    provider.says(op="advertise_action", action="/count", type="example_interfaces/Fibonacci")
    for wrong in ({"action": "a b"}, {"action": "/count", "action_type": "no type"}):
        (end,) = client.says(op="send_action_goal", id="g", **wrong)
        assert (end["op"], end["result"], end["id"]) == ("action_result", False, "g")


def test_rosapi_is_callable_unless_a_deny_pattern_names_it(join: Join) -> None:
    client = join(Policy(service=Rule(allow=("/add",), deny=("/rosapi/set_param", "/rosapi/delete*"))))
    assert client.learns("has_param", name="/x") == {"exists": False}
    assert client.calls("rosapi/get_time")["result"] is True
    for name in ("/rosapi/set_param", "/rosapi/delete_param"):
        assert client.calls(name, name="/x", value="1")["values"] == f"Not allowed to call {name}"
    (status,) = client.says(op="advertise_service", service="/rosapi/mine", type="std_srvs/Trigger")
    assert status["msg"] == "Not allowed to offer /rosapi/mine"
    services = client.learns("services")["services"]
    assert "/rosapi/set_param" not in services
    assert "/rosapi/get_param" in services


# What rosapi shows


def test_lists_show_only_allowed_names(join: Join) -> None:
    policy = Policy(
        publish=Rule(allow=("/in",)), subscribe=Rule(allow=("/out", "/rosout")), service=Rule(deny=("/drop",))
    )
    client, insider = join(policy), join(OPEN)
    for topic in ("/in", "/out", "/hidden"):
        insider.says(op="advertise", topic=topic, type="std_msgs/String")
        insider.says(op="subscribe", topic=topic)
    for service in ("/drop", "/add"):
        insider.says(op="advertise_service", service=service, type="std_srvs/Trigger")
    topics = ["/in", "/out"]
    assert client.learns("topics") == {"topics": topics, "types": ["std_msgs/String"] * 2}
    assert client.learns("topics_for_type", type="std_msgs/String") == {"topics": topics}
    assert client.learns("topic_type", topic="/hidden") == {"type": ""}
    assert client.learns("topic_type", topic="/in") == {"type": "std_msgs/String"}
    assert client.learns("publishers", topic="/hidden") == {"publishers": []}
    assert client.learns("subscribers", topic="hidden") == {"subscribers": []}
    assert client.learns("service_type", service="/drop") == {"type": ""}
    assert client.learns("service_node", service="/drop") == {"node": ""}
    assert client.learns("services_for_type", type="std_srvs/Trigger") == {"services": ["/add"]}
    node = client.learns("node_details", node="/rosbridge_websocket")
    assert (node["publishing"], node["subscribing"], node["services"]) == (topics, topics, ["/add"])
    assert client.learns("topics_and_raw_types")["topics"] == topics


# Parameters


@pytest.fixture
def guarded(bus: Bus, join: Join) -> Wire:
    """A client under whose feet lies a parameter that it may not use."""
    client = join(Policy(parameter=Rule(deny=("/key", "/robot/key*"))))
    bus.parameters.put("/key", '"k"', client.peer)
    for name in ("/robot/name", "/robot/size/x"):
        client.learns("set_param", name=name, value="1")
    for name in ("/robot/key", "/robot/keys/a"):
        bus.parameters.put(name, '"k"', client.peer)
    return client


@pytest.mark.parametrize("method", ["get_param", "set_param", "has_param", "delete_param", "search_param"])
def test_a_denied_parameter_is_refused(guarded: Wire, method: str) -> None:
    args = {"value": "1"} if method == "set_param" else {}
    for name in ("/key", "key", "/robot/key", "/robot/keys/a", "/robot/keyring"):
        answer = guarded.calls(f"/rosapi/{method}", name=name, **args)
        assert (answer["result"], answer["values"]) == (False, f"Not allowed to use the parameter {name}")


def test_parameter_list_omits_denied_names(bus: Bus, guarded: Wire) -> None:
    assert guarded.learns("get_param_names") == {"names": ["/robot/name", "/robot/size/x"]}
    for name, tree in (("/robot", {"name": 1, "size": {"x": 1}}), ("/", {"robot": {"name": 1, "size": {"x": 1}}})):
        assert json.loads(guarded.learns("get_param", name=name)["value"]) == tree
    guarded.learns("delete_param", name="/robot")
    assert list(bus.parameters) == ["/key", "/robot/key", "/robot/keys/a"]
    assert guarded.learns("has_param", name="/robot") == {"exists": False}


def test_reading_a_namespace_leaves_the_parameters_as_they_are(bus: Bus, join: Join) -> None:
    client = join(OPEN)
    client.learns("set_param", name="/a/b", value='{"c": {"d": 1}}')
    client.learns("set_param", name="/a/b/c/e", value="2")
    assert json.loads(client.learns("get_param", name="/a")["value"]) == {"b": {"c": {"d": 1, "e": 2}}}
    assert [(name, json.loads(bus.parameters.text(name))) for name in bus.parameters] == [
        ("/a/b", {"c": {"d": 1}}),
        ("/a/b/c/e", 2),
    ]


# Limits


def test_parameter_value_that_cannot_be_encoded_is_refused(bus: Bus, join: Join) -> None:
    client = join(OPEN)
    for depth in (255, 1_000, 2_000):
        answer = client.calls("/rosapi/set_param", name="/deep", value="[" * depth + "]" * depth)
        assert answer["result"] is False
    client.learns("set_param", name="/" + "a/" * 100 + "b", value="[" * 200 + "]" * 200)
    assert client.learns("get_param", name="/a")["value"] == '{"a":' * 99 + '{"b":' + "[" * 200 + "]" * 200 + "}" * 100
    client.learns("delete_param", name="/a")
    client.learns("set_param", name="/" + "a/" * 99 + "a", value="{}")  # has to be merged with its namespace
    client.learns("set_param", name="/" + "a/" * 100 + "b", value="[" * 200 + "]" * 200)
    assert client.calls("/rosapi/get_param", name="/a")["values"] == "The value is nested too deeply"
    assert len(bus.parameters) == 2


def test_parameters_together_are_bounded(join: Join, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parameters, "MAX_PARAMETER_BYTES", 1_000)
    client, other, third = join(OPEN), join(OPEN), join(OPEN)
    half = json.dumps("x" * 490)
    client.learns("set_param", name="/a", value=half)
    client.learns("set_param", name="/a", value=half)  # in place of the other
    assert "of one client can have at most" in client.calls("/rosapi/set_param", name="/b", value=half)["values"]
    other.learns("set_param", name="/b", value=half)
    assert "together can have at most" in third.calls("/rosapi/set_param", name="/c", value=half)["values"]
    client.learns("delete_param", name="/a")
    third.learns("set_param", name="/c", value=half)


def test_unencodable_failure_values_still_end_the_call(join: Join) -> None:
    provider, caller = join(OPEN), join(OPEN)
    provider.says(op="advertise_service", service="/s", type="std_srvs/Trigger")
    caller.says(op="call_service", service="/s")
    (call,) = provider.hears()
    deep = "[" * 400 + "]" * 400
    provider.peer.receive(
        f'{{"op":"service_response","service":"/s","id":"{call["id"]}","result":false,"values":{deep}}}'.encode(), 0.0
    )
    (answer,) = caller.hears()
    assert (answer["result"], "too deeply" in answer["values"]) == (False, True)


def test_name_beyond_the_limit_is_refused_with_a_status(join: Join) -> None:
    client = join(Policy(max_held=4))
    for op in (
        {"op": "advertise", "topic": "/t", "type": "std_msgs/String", "id": 1},
        {"op": "advertise", "topic": "/t", "type": "std_msgs/String", "id": 2},
        {"op": "subscribe", "topic": "/t", "id": 1},
        {"op": "subscribe", "topic": "t", "id": 1},
        {"op": "subscribe", "topic": "t", "id": 1, "throttle_rate": 5},  # the same one again
    ):
        assert client.says(**op) == []
    text = "At most 4 topics, services and actions can be held by one client"
    for op in (
        {"op": "subscribe", "topic": "/t", "id": 2},
        {"op": "subscribe", "topic": "/u", "type": "std_msgs/String", "id": 2},
        {"op": "advertise", "topic": "/u", "type": "std_msgs/String", "id": 2},
        {"op": "publish", "topic": "/u", "type": "std_msgs/String", "id": 2},
        {"op": "advertise_service", "service": "/s", "type": "std_srvs/Trigger", "id": 2},
        {"op": "advertise_action", "action": "/s", "type": "example_interfaces/Fibonacci", "id": 2},
    ):
        assert client.says(**op) == denied(text, 2)


@pytest.mark.parametrize(
    "back",
    [
        {"op": "unadvertise", "topic": "/t", "id": 1},
        {"op": "unadvertise", "topic": "/t"},
        {"op": "unsubscribe", "topic": "/t", "id": 1},
        {"op": "unsubscribe", "topic": "/t"},
        {"op": "unadvertise_service", "service": "/s"},
        {"op": "unadvertise_action", "action": "/s"},
    ],
)
def test_released_name_makes_room_once(join: Join, back: dict[str, object]) -> None:
    client = join(Policy(max_held=6))
    for op_id in (1, 2):
        client.says(op="advertise", topic="/t", type="std_msgs/String", id=op_id)
        client.says(op="subscribe", topic="/t", id=op_id)
    client.says(op="advertise_service", service="/s", type="std_srvs/Trigger")
    client.says(op="advertise_action", action="/s", type="example_interfaces/Fibonacci")
    client.says(**back)
    client.says(**back)
    num_free = 1 if "id" in back or str(back["op"]).startswith("unadvertise_") else 2
    for i in range(num_free):
        assert client.says(op="subscribe", topic=f"/free{i}", type="std_msgs/String") == []
    assert client.says(op="subscribe", topic="/more", type="std_msgs/String") != []


def test_overlong_id_is_refused(join: Join) -> None:
    client = join(OPEN)
    op_id = "x" * (MAX_OP_ID + 1)
    for op in ("advertise", "subscribe"):
        (status,) = client.says(op=op, topic="/t", type="std_msgs/String", id=op_id)
        assert (status["op"], status["id"]) == ("status", op_id)
        assert client.says(op=op, topic="/t", type="std_msgs/String", id=op_id[1:]) == []


def test_calls_and_goals_in_flight_are_bounded() -> None:
    bus = Bus(make_store(), max_calls=2)
    provider, caller = Wire(bus, OPEN), Wire(bus, OPEN)
    provider.says(op="advertise_service", service="/s", type="std_srvs/Trigger")
    provider.says(op="advertise_action", action="/a", type="example_interfaces/Fibonacci")
    for i in range(2):
        assert caller.says(op="call_service", service="/s", id=i) == []
        assert caller.says(op="send_action_goal", action="/a", id=f"g{i}") == []
    (answer,) = caller.says(op="call_service", service="/s", id=2)
    assert (answer["result"], answer["values"], answer["id"]) == (False, "Too many calls in flight: at most 2", 2)
    (end,) = caller.says(op="send_action_goal", action="/a", id="g2")
    assert (end["result"], end["values"]) == (False, "Too many goals under way: at most 2")


def test_unused_topics_and_types_are_bounded(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topic_table, "MAX_REMEMBERED_TOPICS", 5)
    client = Wire(bus, OPEN)
    client.says(op="subscribe", topic="/kept", type="strange_msgs/Kept")
    for i in range(20):
        assert client.says(op="advertise", topic=f"/t{i}", type=f"strange_msgs/T{i}") == []
        client.says(op="unadvertise", topic=f"/t{i}")
    assert list(bus.topics) == ["/kept", *(f"/t{i}" for i in range(15, 20))]
    bus.expire(TYPE_MEMORY)
    assert list(bus.topics) == ["/kept"]


def test_name_of_an_unknown_type_is_bounded(bus: Bus) -> None:
    client = Wire(bus, OPEN)
    (status,) = client.says(op="advertise", topic="/t", type="strange_msgs/" + "T" * 300, id=1)
    assert status["id"] == 1
    assert bus.topics == {}
