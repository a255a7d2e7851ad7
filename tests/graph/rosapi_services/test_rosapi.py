"""rosapi reads the bus."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.rosapi_services import rosapi
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.loose_types import JsonValue
from tests.graph.bus_fixture import Wire, make_bus, make_peer, make_store
from tests.schema.strategies import shared_store


@pytest.fixture
def bus() -> Bus:
    bus = make_bus()
    Rosapi(bus)
    return bus


def ask(bus: Bus, method: str, **args: object) -> JsonValue:
    """A service's values; its refusal is an AssertionError."""
    answer = call(bus, method, **args)
    assert answer["result"] is True, answer
    return answer["values"]


def call(bus: Bus, method: str, **args: object) -> JsonValue:
    peer, outbox = make_peer(bus)
    peer.receive(json.dumps({"op": "call_service", "service": f"/rosapi/{method}", "args": args}).encode(), 0.0)
    (frame,) = outbox.take(2**30)
    peer.leave(0.0)
    return json.loads(frame)


@pytest.fixture
def busy(bus: Bus) -> Bus:
    """A bus with a publisher, a listener and a provider."""
    peer, _ = make_peer(bus)
    for op in (
        {"op": "advertise", "topic": "/b", "type": "std_msgs/msg/String"},
        {"op": "subscribe", "topic": "/a", "type": "std_msgs/Int32"},
        {"op": "advertise_service", "service": "/add", "type": "rospy_tutorials/AddTwoInts"},
    ):
        peer.receive(json.dumps(op).encode(), 0.0)
    return bus


def test_rosapi_lists_topics_and_their_types(busy: Bus) -> None:
    assert ask(busy, "topics") == {"topics": ["/a", "/b"], "types": ["std_msgs/Int32", "std_msgs/String"]}
    assert ask(busy, "topics_for_type", type="std_msgs/String") == {"topics": ["/b"]}
    assert ask(busy, "topics_for_type", type="std_msgs/msg/String") == {"topics": ["/b"]}
    assert ask(busy, "topic_type", topic="/a") == {"type": "std_msgs/Int32"}
    assert ask(busy, "topic_type", topic="/none") == {"type": ""}
    assert ask(busy, "publishers", topic="b") == {"publishers": ["/rosbridge_websocket"]}
    assert ask(busy, "publishers", topic="/a") == {"publishers": []}
    assert ask(busy, "subscribers", topic="/a") == {"subscribers": ["/rosbridge_websocket"]}


def test_rosapi_lists_services_and_their_types(busy: Bus) -> None:
    services = ask(busy, "services")["services"]
    assert services == sorted(services)
    assert {"/add", "/rosapi/topics", "/rosapi/get_time"} <= set(services)
    assert ask(busy, "services_for_type", type="rospy_tutorials/srv/AddTwoInts") == {"services": ["/add"]}
    assert ask(busy, "service_type", service="/add") == {"type": "rospy_tutorials/AddTwoInts"}
    assert ask(busy, "service_type", service="/none") == {"type": ""}
    assert ask(busy, "service_node", service="/add") == {"node": "/rosbridge_websocket"}
    assert ask(busy, "service_providers", service="rospy_tutorials/AddTwoInts") == {
        "providers": ["/rosbridge_websocket"]
    }


def test_rosapi_lists_nodes_and_their_details(busy: Bus) -> None:
    assert ask(busy, "nodes") == {"nodes": ["/rosapi", "/rosbridge_websocket"]}
    assert ask(busy, "node_details", node="/rosbridge_websocket") == {
        "subscribing": ["/a"],
        "publishing": ["/b"],
        "services": ["/add"],
    }
    assert ask(busy, "node_details", node="/none") == {"subscribing": [], "publishing": [], "services": []}


def test_rosapi_time_is_the_time_of_the_bus(bus: Bus) -> None:
    bus.stamp_ns = 12_000_000_034
    assert ask(bus, "get_time") == {"time": {"secs": 12, "nsecs": 34}}


def test_definitions_beyond_a_bound_are_left_out(busy: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = ask(busy, "topics_and_raw_types")
    monkeypatch.setattr(rosapi, "MAX_RAW_CHARS", len(whole["typedefs_full_text"][0]))
    short = ask(busy, "topics_and_raw_types")
    assert (short["topics"], short["types"]) == (whole["topics"], whole["types"])
    first, second = short["typedefs_full_text"]
    assert first == whole["typedefs_full_text"][0]
    assert second.startswith("# omitted")


def test_an_unset_parameter_is_an_empty_text_in_ros_2() -> None:
    bus = Bus(shared_store(2))
    Rosapi(bus)
    unset = {"value": '""', "successful": False, "reason": "Parameter /x is not set"}
    assert ask(bus, "get_param", name="/x") == unset


def test_parameters_of_a_roscore_are_set_in_ros_1_alone() -> None:
    bus = make_bus()
    Rosapi(bus, run_id="7")
    wire = Wire(bus)
    assert wire.learns("get_param", name="/rosdistro") == {"value": '"noetic\\n"', "successful": True, "reason": ""}
    assert wire.learns("get_param_names") == {"names": ["/rosdistro", "/rosversion", "/run_id"]}
    assert wire.learns("has_param", name="run_id") == {"exists": True}
    hidden = make_bus()
    policy = Policy(parameter=Rule(deny=("/run_*",)))
    Rosapi(hidden, policy, run_id="7")
    assert Wire(hidden, policy).learns("get_param_names") == {"names": ["/rosdistro", "/rosversion"]}
    newer = Bus(make_store(2))
    Rosapi(newer, run_id="7")
    assert Wire(newer).learns("get_param_names") == {"names": []}


def test_rosapi_sets_gets_and_lists_parameters(bus: Bus) -> None:
    assert ask(bus, "get_param", name="/a/x", default="7")["value"] == "7"
    assert ask(bus, "get_param", name="/a/x", default="seven")["value"] == '"seven"'
    unset = {"value": "null", "successful": False, "reason": "Parameter /a/x is not set"}
    assert ask(bus, "get_param", name="/a/x") == unset
    assert ask(bus, "has_param", name="/a/x") == {"exists": False}
    ask(bus, "set_param", name="a/x", value="[1, null]")
    ask(bus, "set_param", name="/a/y", value='"text"')
    assert ask(bus, "get_param", name="/a/x", default="7")["value"] == "[1,null]"
    assert json.loads(ask(bus, "get_param", name="/a")["value"]) == {"x": [1, None], "y": "text"}
    assert ask(bus, "get_param_names") == {"names": ["/a/x", "/a/y"]}
    assert ask(bus, "has_param", name="/a") == {"exists": True}
    assert ask(bus, "search_param", name="a/x") == {"global_name": "/a/x"}
    assert ask(bus, "search_param", name="z") == {"global_name": ""}
    ask(bus, "delete_param", name="/a/x")
    assert ask(bus, "get_param_names") == {"names": ["/a/y"]}


def test_parameter_that_is_not_json_is_refused_in_the_words_of_rosapi(bus: Bus) -> None:
    answer = call(bus, "set_param", name="/a", value="text")
    assert answer["result"] is False
    assert "must be a JSON-formatted string" in answer["values"]
    assert len(bus.parameters) == 0


def test_deleting_a_missing_parameter_is_refused(bus: Bus) -> None:
    assert call(bus, "delete_param", name="/a")["values"] == "Parameter /a is not set"


def test_rosapi_gives_the_full_text_of_types(busy: Bus) -> None:
    values = ask(busy, "topics_and_raw_types")
    assert values["topics"] == ["/a", "/b"]
    assert values["types"] == ["std_msgs/Int32", "std_msgs/String"]
    fields = [text.splitlines()[-1].partition("#")[0].strip() for text in values["typedefs_full_text"]]
    assert fields == ["int32 data", "string data"]


def test_unknown_type_has_a_comment_as_its_text(bus: Bus) -> None:
    peer, _ = make_peer(bus)
    peer.receive(b'{"op":"advertise","topic":"/x","type":"my_msgs/Thing"}', 0.0)
    (text,) = ask(bus, "topics_and_raw_types")["typedefs_full_text"]
    assert text.startswith("# failed to get full definition text for my_msgs/Thing: ")


def test_rosapi_gives_details_of_messages_services_and_actions(bus: Bus) -> None:
    twist, vector = ask(bus, "message_details", type="geometry_msgs/msg/Twist")["typedefs"]
    assert (twist["type"], vector["type"]) == ("geometry_msgs/Twist", "geometry_msgs/Vector3")
    assert (twist["fieldnames"], twist["fieldarraylen"]) == (["linear", "angular"], [-1, -1])
    (request,) = ask(bus, "service_request_details", type="rospy_tutorials/AddTwoInts")["typedefs"]
    (response,) = ask(bus, "service_response_details", type="rospy_tutorials/srv/AddTwoInts")["typedefs"]
    assert (request["fieldnames"], response["fieldnames"]) == (["a", "b"], ["sum"])
    for part, field in (("goal", "order"), ("result", "sequence"), ("feedback", "sequence")):
        (typedef,) = ask(bus, f"action_{part}_details", type="example_interfaces/action/Fibonacci")["typedefs"]
        assert typedef["fieldnames"] == [field]
    assert call(bus, "message_details", type="my_msgs/Thing")["result"] is False


def test_rosapi_gives_the_text_of_each_part_of_a_type_with_its_comments(bus: Bus) -> None:
    text = ask(bus, "definition", type="geometry_msgs/msg/Twist")["text"]
    head, vector = text.split("=" * 80)
    assert "geometry_msgs/Vector3 linear" in head
    assert vector.startswith("\nMSG: geometry_msgs/Vector3\n")
    assert "float64 x" in vector
    for type_name, part, line in (
        ("std_srvs/SetBool", "request", "bool data"),
        ("std_srvs/SetBool", "response", "string message"),
        ("example_interfaces/Fibonacci", "goal", "int32 order"),
        ("example_interfaces/Fibonacci", "feedback", "int32[] sequence"),
    ):
        assert line in ask(bus, "definition", type=type_name, part=part)["text"]
    assert "# " in ask(bus, "definition", type="rosbridge_sim_msgs/Spawn", part="request")["text"]


@pytest.mark.parametrize(
    ("type_name", "part", "reason"),
    [
        ("my_msgs/Thing", "", "my_msgs"),
        ("std_srvs/SetBool", "message", "SetBool"),
        ("std_msgs/String", "goal", "String"),
        ("std_msgs/String", "text", "part: expected one of message, request"),
    ],
)
def test_rosapi_refuses_the_text_of_what_is_not_there(bus: Bus, type_name: str, part: str, reason: str) -> None:
    answer = call(bus, "definition", type=type_name, part=part)
    assert answer["result"] is False
    assert reason in answer["values"]


def test_rosapi_lists_action_servers_of_both_ros_versions(bus: Bus) -> None:
    peer, _ = make_peer(bus)
    for part in ("goal", "cancel", "feedback", "result", "status"):
        frame = {"op": "advertise", "topic": f"/old/{part}", "type": "std_msgs/String"}
        peer.receive(json.dumps(frame).encode(), 0.0)
    peer.receive(b'{"op":"advertise","topic":"/half/goal","type":"std_msgs/String"}', 0.0)
    peer.receive(b'{"op":"advertise_action","action":"/new","type":"example_interfaces/Fibonacci"}', 0.0)
    assert ask(bus, "action_servers") == {"action_servers": ["/new", "/old"]}
    assert ask(bus, "action_type", action="new") == {"type": "example_interfaces/Fibonacci"}
    assert ask(bus, "action_type", action="/old") == {"type": ""}


def test_remaining_rosapi_services_answer(busy: Bus) -> None:
    assert ask(busy, "get_ros_version") == {"version": 1, "distro": "noetic"}
    assert ask(busy, "service_host", service="/add") == {"host": "localhost"}
    assert ask(busy, "service_host", service="/none") == {"host": ""}
    interfaces = ask(busy, "interfaces")["interfaces"]
    assert {"std_msgs/String", "rosapi/Topics", "morai_msgs/CtrlCmd"} <= set(interfaces)
    assert interfaces == sorted(set(interfaces))
