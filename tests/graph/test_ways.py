"""Patterns hold for every route: aliases, the topics of an action, and the transform republisher."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import cbor2
import pytest

from rosbridge_sim.graph import ways as ways_module
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.graph.topic_table import TYPE_MEMORY
from rosbridge_sim.graph.ways import PolicyEffect, Use, Way, Ways
from rosbridge_sim.protocol.png import PngFrame
from tests.graph.bus_fixture import Wire, make_bus

FIBONACCI, STRING, TRIGGER = "example_interfaces/Fibonacci", "std_msgs/String", "std_srvs/Trigger"
GOAL, GOAL_ID = "tf2_web_republisher/TFSubscriptionActionGoal", "actionlib_msgs/GoalID"
FEEDBACK, STATUS = "tf2_web_republisher/TFSubscriptionActionFeedback", "actionlib_msgs/GoalStatusArray"
TF, WEB = "tf2_msgs/TFMessage", "/tf2_web_republisher"

Join = Callable[[Policy], Wire]


@pytest.fixture
def bus() -> Bus:
    return make_bus()


@pytest.fixture
def join(bus: Bus) -> Join:
    """Clients under a policy, beside a republisher and a client that offers the action /count."""
    WebRepublisher(bus)
    server = Wire(bus)
    server.says(op="advertise_action", action="/count", type=FIBONACCI)
    return lambda policy: Wire(bus, policy)


def make_policy(rules: dict[str, Rule]) -> Policy:
    none = Rule()
    return Policy(rules.get("publish", none), rules.get("subscribe", none), rules.get("service", none))


def deny(**patterns: str) -> Policy:
    return make_policy({use: Rule(deny=(pattern,)) for use, pattern in patterns.items()})


def allow(**patterns: str) -> Policy:
    return make_policy({use: Rule(allow=(pattern,)) for use, pattern in patterns.items()})


def publish(topic: str, type_name: str) -> dict[str, Any]:
    return {"op": "advertise", "topic": topic, "type": type_name}


def subscribe(topic: str, type_name: str) -> dict[str, Any]:
    return {"op": "subscribe", "topic": topic, "type": type_name}


def call(service: str, **args: object) -> dict[str, Any]:
    return {"op": "call_service", "service": service, "args": args}


def send(action: str, **args: object) -> dict[str, Any]:
    return {"op": "send_action_goal", "action": action, "id": "g", "args": args}


def is_refused(client: Wire, op: dict[str, Any]) -> bool:
    return any("Not allowed to" in str(frame) for frame in client.says(**op))


REPUBLISH = call("/republish_tfs", source_frames=["a"], target_frame="b")
TF_GOAL = send(WEB, source_frames=["a"], target_frame="b")


# Actions


@pytest.mark.parametrize(
    "op",
    [
        send("/count"),
        call("/count/_action/cancel_goal"),
        publish("/count/goal", "my_msgs/CountActionGoal"),
        publish("/count/goal", "my_msgs/msg/CountActionGoal"),
        {"op": "publish", "topic": "/count/cancel", "type": GOAL_ID, "msg": {}},
        subscribe("/count/feedback", "my_msgs/CountActionFeedback"),
        subscribe("/count/result", "my_msgs/CountActionResult"),
        subscribe("/count/status", STATUS),
        publish("/count/feedback", "my_msgs/CountActionFeedback"),
        subscribe("/count/_action/feedback", "my_msgs/Count_FeedbackMessage"),
        {"op": "advertise_action", "action": "/count", "type": FIBONACCI},
        {"op": "advertise_service", "service": "/count/_action/cancel_goal", "type": TRIGGER},
    ],
)
def test_denied_action_is_denied_by_every_route(join: Join, op: dict[str, Any]) -> None:
    assert is_refused(join(deny(service="/count")), op)
    assert not is_refused(join(deny(service="/other")), op)


@pytest.mark.parametrize("part", ["goal", "cancel", "status", "feedback", "result"])
def test_plain_topic_with_an_action_like_name_stays_allowed(join: Join, part: str) -> None:
    client = join(deny(service="*"))
    assert client.says(**publish(f"/battery/{part}", STRING)) == []
    assert client.says(**subscribe(f"/battery/{part}", STRING)) == []
    assert client.says(op="subscribe", topic=f"/battery/{part}", id=2) == []
    assert client.says(**subscribe(f"/{part}", STATUS)) == [], "no action has an empty name"


@pytest.mark.parametrize("slashes", ["{}/msg/{}", "/{}/{}", "{}//{}", "{}/{}/", "{}/msg//{}//"])
@pytest.mark.parametrize(
    ("part", "type_name"),
    [
        *((part, f"my_msgs/CountAction{part.title()}") for part in ("goal", "feedback", "result")),
        *(("cancel", GOAL_ID), ("status", STATUS)),
    ],
)
def test_no_type_spelling_bypasses_a_denied_action(join: Join, part: str, type_name: str, slashes: str) -> None:
    client = join(deny(service="/count"))
    spelled = slashes.format(*type_name.split("/"))
    op = publish(f"/count/{part}", spelled)
    assert is_refused(client, op)
    assert is_refused(client, op | {"op": "publish", "msg": {}})
    assert is_refused(client, op | {"op": "subscribe"})


def test_denied_goal_topic_stops_goals_by_every_route(join: Join) -> None:
    client = join(deny(publish="/count/goal"))
    (end,) = client.says(**send("/count"))
    assert end["values"] == "Not allowed to call /count, another way of publishing /count/goal"
    assert is_refused(client, publish("/count/goal", STRING))
    assert not is_refused(client, subscribe("/count/feedback", "my_msgs/CountActionFeedback"))


@pytest.mark.parametrize(
    "policy", [deny(publish="/count/cancel"), deny(service="/count/_action/cancel_goal"), deny(service="/count")]
)
def test_denied_cancel_holds_for_topic_and_service(join: Join, policy: Policy) -> None:
    client = join(policy)
    assert is_refused(client, call("/count/_action/cancel_goal"))
    assert is_refused(client, publish("/count/cancel", GOAL_ID))


def test_allowed_action_is_allowed_by_every_route(join: Join) -> None:
    client = join(allow(service="/count", publish="/x", subscribe="/x"))
    for op in (
        send("/count"),
        call("/count/_action/cancel_goal"),
        publish("/count/goal", "my_msgs/CountActionGoal"),
        subscribe("/count/feedback", "my_msgs/CountActionFeedback"),
    ):
        assert not is_refused(client, op)
    assert is_refused(client, publish("/count/goal", STRING))
    assert is_refused(client, call("/other"))


@pytest.mark.parametrize(
    ("policy", "is_open"),
    [
        (allow(service="/mine/*"), False),
        (allow(service="*"), True),
        (allow(service="/mine/*", publish="/count/*", subscribe="/count/*"), True),
        (allow(service="/mine/*", publish="*", subscribe="*"), False),
        (allow(service="*", publish="/mine/*", subscribe="/mine/*"), False),
        (allow(service="/count", publish="/mine/*", subscribe="/mine/*"), True),
    ],
)
def test_action_topics_need_the_action_to_be_allowed(join: Join, policy: Policy, *, is_open: bool) -> None:
    client = join(policy)
    for op in (
        publish("/count/goal", "my_msgs/CountActionGoal"),
        publish("/count/cancel", GOAL_ID),
        subscribe("/count/feedback", "my_msgs/CountActionFeedback"),
    ):
        assert is_refused(client, op) is not is_open


def test_denied_goal_topic_does_not_deny_a_service_of_that_name(join: Join) -> None:
    client = join(deny(publish="/count/goal"))
    assert not is_refused(client, call("/count"))


def test_subscription_without_a_type_cannot_become_a_denied_action_topic(bus: Bus, join: Join) -> None:
    """It was judged by the type that the topic had."""
    client, other, server = join(deny(service="/dig")), join(deny(service="/dig")), join(Policy())
    other.says(**subscribe("/dig/feedback", STRING))
    assert client.says(op="subscribe", topic="/dig/feedback") == []
    server.says(**publish("/dig/feedback", "my_msgs/DigActionFeedback"))
    server.says(op="publish", topic="/dig/feedback", msg={"feedback": 1})
    assert [frame["op"] for frame in (*client.hears(), *other.hears())] == ["status", "status"]
    assert bus.topics["/dig/feedback"].subscriptions == ()
    assert is_refused(join(deny(service="/dig")), {"op": "subscribe", "topic": "/dig/feedback"})


def test_rosapi_lists_neither_the_action_nor_its_topics(bus: Bus, join: Join) -> None:
    policy = deny(service="/count")
    Rosapi(bus, policy)
    client, server = join(policy), join(Policy())
    server.says(**publish("/count/status", STATUS))
    server.says(**publish("/count/other", STATUS))
    assert "/count" not in client.learns("action_servers")["action_servers"]
    assert client.learns("action_type", action="/count") == {"type": ""}
    topics = client.learns("topics")["topics"]
    assert ("/count/status" in topics, "/count/other" in topics) == (False, True)


def test_errors_and_hints_name_no_topic_of_a_denied_action(bus: Bus, join: Join) -> None:
    client, server = join(deny(service="/count")), join(Policy())
    server.says(**publish("/count/status", STATUS))
    (status,) = client.says(op="subscribe", topic="/count/statu")
    assert status["msg"] == "Cannot infer topic type for topic /count/statu as it is not yet advertised"
    client.says(op="set_level", level="info")
    assert client.says(**subscribe("/count_status", STATUS)) == []
    bus.expire(TYPE_MEMORY)
    (info,) = client.hears()
    assert info["level"] == "info"
    assert "/count/status" not in info["msg"]


# Frames


def as_json(op: bytes) -> list[bytes]:
    return [op]


def as_pieces(op: bytes) -> list[bytes]:
    half = len(op) // 2
    parts = (op[:half].decode(), op[half:].decode())
    return [json.dumps({"op": "fragment", "id": "f", "num": i, "total": 2, "data": parts[i]}).encode() for i in (0, 1)]


def as_picture(op: bytes) -> list[bytes]:
    picture = PngFrame(op)
    while not picture.work():
        pass
    assert picture.frame is not None
    return [picture.frame]


def as_cbor(op: bytes) -> list[bytes]:
    return [cbor2.dumps(json.loads(op))]


def as_glued(op: bytes) -> list[bytes]:
    return [b'{"op":"set_level","level":"warning"}' + op]


def as_pieces_in_cbor(op: bytes) -> list[bytes]:
    return [cbor2.dumps(json.loads(piece)) for piece in as_pieces(op)]


@pytest.mark.parametrize(
    "wrap", [as_json, as_pieces, as_picture, as_cbor, as_glued, as_pieces_in_cbor], ids=lambda f: f.__name__
)
@pytest.mark.parametrize("slash", ["/", ""])
def test_patterns_hold_in_every_kind_of_frame_and_for_relative_names(
    bus: Bus, join: Join, wrap: Callable[[bytes], list[bytes]], slash: str
) -> None:
    Rosapi(bus, Policy(parameter=Rule(deny=("/secret",))))
    client = join(
        Policy(
            publish=Rule(deny=("/brake",)), subscribe=Rule(deny=("/camera/*",)), service=Rule(deny=("/count", "/stop"))
        )
    )
    for op in (
        publish(f"{slash}brake", STRING),
        publish(f"{slash}brake", STRING) | {"op": "publish", "msg": {"data": "x"}},
        subscribe(f"{slash}camera/front", STRING),
        call(f"{slash}stop"),
        {"op": "call_service", "service": f"{slash}stop#id"},
        {"op": "advertise_service", "service": f"{slash}stop", "type": TRIGGER},
        {"op": "advertise_action", "action": f"{slash}count", "type": FIBONACCI},
        send(f"{slash}count", order=1),
        publish(f"{slash}count/goal", "my_msgs/CountActionGoal"),
        call("/rosapi/get_param", name=f"{slash}secret", default=""),
        call("rosapi/set_param", name=f"{slash}secret", value="1"),
    ):
        for frame in wrap(json.dumps(op).encode()):
            client.peer.receive(frame, 0.0)
        (answer,) = client.hears()
        assert "Not allowed to" in str(answer), op
    assert {"/brake", "/camera/front", "/count/goal"}.isdisjoint(bus.topics)


# Transforms


@pytest.mark.parametrize(
    "policy",
    [
        deny(subscribe="/tf"),
        deny(subscribe="/tf_static"),
        allow(subscribe="/camera/*"),
        allow(subscribe="/camera/*", service="/*republish*"),
    ],
)
@pytest.mark.parametrize(
    "op", [REPUBLISH, TF_GOAL, publish(f"{WEB}/goal", GOAL), subscribe(f"{WEB}/feedback", FEEDBACK)]
)
def test_denied_transforms_are_not_republished(join: Join, policy: Policy, op: dict[str, Any]) -> None:
    assert is_refused(join(policy), op)
    assert not is_refused(join(Policy()), op)


def test_republisher_topic_of_another_client_is_denied_too(bus: Bus, join: Join) -> None:
    insider, client = join(Policy()), join(deny(subscribe="/tf"))
    insider.says(**REPUBLISH)
    assert f"{WEB}/tf_repub_1" in bus.topics
    (status,) = client.says(op="subscribe", topic=f"{WEB}/tf_repub_1")
    assert status["msg"] == f"Not allowed to subscribe to {WEB}/tf_repub_1, since it shows what /tf does"


@pytest.mark.parametrize("policy", [allow(subscribe="/tf*"), allow(subscribe=f"{WEB}/*")])
def test_allowed_transforms_are_republished(join: Join, policy: Policy) -> None:
    client = join(policy)
    for op in (REPUBLISH, TF_GOAL, subscribe(f"{WEB}/feedback", FEEDBACK)):
        assert not is_refused(client, op)


def test_denied_republisher_is_denied_by_all_three_routes_and_leaves_tf_topics(join: Join) -> None:
    for policy in (deny(service="/republish_tfs"), deny(service=WEB)):
        client = join(policy)
        for op in (REPUBLISH, TF_GOAL, publish(f"{WEB}/goal", GOAL), subscribe(f"{WEB}/feedback", FEEDBACK)):
            assert is_refused(client, op)
        assert client.says(**subscribe("/tf", TF)) == []


# A table of a part of the server


class Tables:
    """Rows that a test can change."""

    def __init__(self) -> None:
        self.rows: dict[Way, list[Way]] = {}
        self.num_looks = 0

    def look_up(self, way: Way) -> Iterator[Way]:
        self.num_looks += 1
        yield from self.rows.get(way, [])


WHEEL, PEDAL = Way(Use.PUBLISH, "/wheel"), Way(Use.SERVICE, "/pedal")


@pytest.fixture
def tables() -> Tables:
    tables = Tables()
    tables.rows = {WHEEL: [PEDAL], PEDAL: [WHEEL]}
    return tables


def with_rows(policy: Policy, tables: Tables) -> Policy:
    policy.ways.add(lambda: (PolicyEffect("steer", (WHEEL, PEDAL, Way(Use.SERVICE, "/joystick"))),), tables.look_up)
    return policy


def test_table_row_holds_across_directions_for_deny_and_allow(join: Join, tables: Tables) -> None:
    client = join(with_rows(deny(service="/pedal"), tables))
    (status,) = client.says(**publish("/wheel", STRING))
    assert status["msg"] == "Not allowed to publish to /wheel, another way of calling /pedal"
    assert is_refused(join(with_rows(deny(publish="/wheel"), tables)), call("/pedal"))
    client = join(with_rows(allow(publish="/wheel", service="/nothing"), tables))
    assert not is_refused(client, call("/pedal"))
    assert is_refused(client, call("/joystick"))
    assert not is_refused(join(with_rows(allow(publish="/other"), tables)), call("/pedal")), "services are open"


@pytest.mark.parametrize("pattern", ["*", "/*", "**", "?*"])
def test_unmatched_pattern_holds_for_its_own_direction_only(join: Join, tables: Tables, pattern: str) -> None:
    client = join(with_rows(deny(publish=pattern), tables))
    for op in (call("/pedal"), send("/count"), call("/count/_action/cancel_goal"), subscribe("/wheel", STRING)):
        assert not is_refused(client, op)
    for topic in ("/wheel", "/count/goal", "/count/cancel", "/any"):
        assert is_refused(client, publish(topic, STRING))
    client = join(with_rows(deny(service=pattern), tables))
    assert not is_refused(client, publish("/wheel", STRING))
    assert is_refused(client, call("/pedal"))
    client = join(with_rows(allow(publish=pattern, service="/nothing"), tables))
    assert not is_refused(client, publish("/wheel", STRING))
    for op in (call("/pedal"), send("/count")):
        assert is_refused(client, op)
    client = join(with_rows(allow(service=pattern, publish="/nothing"), tables))
    assert not is_refused(client, call("/pedal"))
    for op in (publish("/wheel", STRING), publish("/count/goal", "my_msgs/CountActionGoal")):
        assert is_refused(client, op)


def test_denying_all_actions_closes_their_topics_too(join: Join) -> None:
    client = join(deny(service="*"))
    for op in (
        send("/count"),
        publish("/count/goal", "my_msgs/CountActionGoal"),
        publish("/count/cancel", GOAL_ID),
        subscribe("/count/feedback", "my_msgs/CountActionFeedback"),
    ):
        assert is_refused(client, op)


def test_names_are_checked_once_and_not_per_message(join: Join, tables: Tables) -> None:
    policy = with_rows(deny(service="/pedal"), tables)
    client = join(policy)
    client.says(**publish("/free", STRING))
    num_looks = tables.num_looks
    for _ in range(3):
        assert client.says(op="publish", topic="/free", msg={}) == []
    join(policy).says(**publish("/free", STRING))
    assert tables.num_looks == num_looks


def test_cache_of_name_checks_is_bounded(tables: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ways_module, "MAX_KNOWN_NAMES", 3)
    policy = with_rows(deny(service="/pedal"), tables)
    for i in range(20):
        policy.check_publish(f"/t{i}")
    assert len(policy.ways._known) <= 3


def test_client_loses_a_name_that_becomes_an_alias_of_a_denied_one(bus: Bus, join: Join, tables: Tables) -> None:
    """Else it could advertise first, and then have the name given to the thing."""
    policy = with_rows(deny(service="/pedal", subscribe="/secret"), tables)
    client, gone, listener = join(policy), join(policy), join(Policy())
    for each in (client, gone):
        assert each.says(**publish("drive", STRING)) == []
        assert each.says(**publish("/kept", STRING)) == []
        assert each.says(**subscribe("/ears", STRING)) == []
    gone.peer.leave(0.0)
    tables.rows[Way(Use.PUBLISH, "/drive")] = [PEDAL]
    tables.rows[Way(Use.SUBSCRIBE, "/ears")] = [Way(Use.SUBSCRIBE, "/secret")]
    policy.ways.change(0.0)
    publishing = "Not allowed to publish to drive, another way of calling /pedal"
    hearing = "Not allowed to subscribe to /ears, another way of listening to /secret"
    assert [(frame["level"], frame["msg"]) for frame in client.hears()] == [
        ("error", f"{publishing}: this client's advertisement has ended"),
        ("error", f"{hearing}: this client's subscription has ended"),
    ]
    assert (bus.topics["/drive"].publishers, bus.topics["/ears"].all_subscriptions) == ({}, ())
    assert client.peer.topics.num_held == 1
    assert is_refused(client, {"op": "publish", "topic": "drive", "type": STRING, "msg": {}})
    assert client.says(op="publish", topic="/kept", msg={}) == []
    assert gone.hears() == []
    assert listener.says(**publish("/drive", STRING)) == []
    bus.expire(TYPE_MEMORY)


def test_type_names_are_not_cached_with_the_routes(join: Join, tables: Tables) -> None:
    """A type that does not exist may be as long as a frame."""
    policy = with_rows(deny(publish="/wheel"), tables)
    client = join(policy)
    client.says(**publish("/paint", STRING))
    num_looks = tables.num_looks
    for i in range(10):
        assert client.says(**publish("/paint", f"a/{'x' * 1000}{i}")) != []
    assert tables.num_looks == num_looks


# What is left open


def test_start_log_names_routes_that_a_pattern_leaves_open(tables: Tables) -> None:
    lines = with_rows(deny(publish="/wheel"), tables).left_open()
    assert lines == ["--deny-publish /wheel leaves these ways open to steer: calling /joystick"]
    lines = with_rows(deny(service="/joy*"), tables).left_open()
    assert lines == ["--deny-service /joy* leaves these ways open to steer: publishing /wheel, calling /pedal"]
    lines = with_rows(allow(publish="/camera/*"), tables).left_open()
    assert lines == ["--allow-publish /camera/* leaves these ways open to steer: calling /pedal, /joystick"]
    lines = with_rows(deny(subscribe="/tf"), tables).left_open()
    assert lines == ["--deny-subscribe /tf leaves these ways open to learn transforms: listening to /tf_static"]
    assert with_rows(deny(service="/other"), tables).left_open() == []
    assert with_rows(Policy(parameter=Rule(deny=("*",))), tables).left_open() == []
    assert with_rows(deny(publish="*", subscribe="*", service="*"), tables).left_open() == []
    lines = with_rows(deny(publish="*"), tables).left_open()
    assert lines == ["--deny-publish * leaves these ways open to steer: calling /pedal, /joystick"]


def test_start_log_does_not_blame_a_wildcard_for_another_direction(tables: Tables) -> None:
    policy = Policy(publish=Rule(deny=("*",)), service=Rule(deny=("/pedal",)))
    policy.ways.add(lambda: (PolicyEffect("ring", (PEDAL, Way(Use.SERVICE, "/bell"))),), tables.look_up)
    assert policy.left_open() == ["--deny-service /pedal leaves these ways open to ring: calling /bell"]


def test_route_with_many_effects_is_named_but_does_not_count_alone() -> None:
    policy = deny(service="/reset")
    effect = PolicyEffect("steer", (WHEEL,), (Way(Use.SERVICE, "/reset"),))
    policy.ways.add(lambda: (effect,))
    assert policy.left_open() == []
    policy = deny(publish="/wheel")
    policy.ways.add(lambda: (effect,))
    assert policy.left_open() == ["--deny-publish /wheel leaves these ways open to steer: calling /reset"]


def test_log_line_on_open_routes_is_bounded() -> None:
    policy = deny(publish="/w*" + "*" * 500)
    names = tuple(Way(Use.SERVICE, f"/{'long' * 50}{i}") for i in range(100))
    policy.ways.add(lambda: [PolicyEffect(f"do {i}", (WHEEL, *names)) for i in range(100)])
    (line,) = policy.left_open()
    assert line.endswith("; and 97 more")
    assert "and 92 more" in line
    assert len(line) < 2_500


def test_aliases_of_a_table_have_no_aliases_themselves() -> None:
    ways = Ways()
    ways.add(tuple, lambda way: [Way(Use.ACTION, "/dig")] if way == WHEEL else [])
    assert ways.all_of(WHEEL) == (WHEEL, (Use.ACTION, "/dig"))
