"""Every error reported to a client is also recorded on the bus, with a reason."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.peers import peer as peer_module
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from tests.graph.bus_fixture import make_bus, make_peer

ADVERTISED = {"op": "advertise", "topic": "/c", "type": "geometry_msgs/Twist"}
OFFERED = {"op": "advertise_service", "service": "/add", "type": "rospy_tutorials/AddTwoInts"}
CALL = {"op": "call_service", "service": "/add"}


def refused(*frames: Any) -> list[RefusedRequest]:  # noqa: ANN401 - ops, or the texts of frames
    """What is noted while a client sends these."""
    bus = make_bus()
    noted: list[RefusedRequest] = []
    bus.on_refusal = noted.append
    peer, _ = make_peer(bus)
    for frame in frames:
        text = frame if isinstance(frame, str) else json.dumps(frame)
        peer.receive(text.encode(), 0.0)
    return noted


@pytest.mark.parametrize(
    ("frames", "reason", "op", "subject"),
    [
        (["{"], Reason.BAD_FRAME, "", ""),
        ([{"op": "publsh"}], Reason.UNKNOWN_OP, "", ""),
        ([{"topic": "/c"}], Reason.UNKNOWN_OP, "", ""),
        ([{"op": "subscribe"}], Reason.BAD_OP, "", ""),
        ([{"op": "subscribe", "topic": 3}], Reason.BAD_OP, "", ""),
        ([{"op": "set_level", "level": "loud"}], Reason.WRONG_VALUE, "set_level", ""),
        ([{"op": "subscribe", "topic": "/d"}], Reason.UNKNOWN_TOPIC, "subscribe", "/d"),
        ([{"op": "publish", "topic": "/d", "msg": {}}], Reason.UNKNOWN_TOPIC, "publish", "/d"),
        ([{"op": "advertise", "topic": "/d", "type": "std_msgs/Sting"}], Reason.UNKNOWN_TYPE, "advertise", "/d"),
        ([{"op": "advertise", "topic": "a b", "type": "std_msgs/String"}], Reason.BAD_NAME, "advertise", "a b"),
        ([ADVERTISED, ADVERTISED | {"type": "std_msgs/String"}], Reason.TYPE_CONFLICT, "advertise", "/c"),
        ([ADVERTISED, {"op": "publish", "topic": "/c", "msg": {"x": 1}}], Reason.UNKNOWN_FIELD, "publish", "/c"),
        (
            [ADVERTISED, {"op": "publish", "topic": "/c", "msg": {"linear": {"x": "1"}}}],
            Reason.WRONG_TYPE,
            "publish",
            "/c",
        ),
        ([{"op": "call_service", "service": "/ad"}], Reason.NO_SUCH_SERVICE, "call_service", "/ad"),
        ([OFFERED, CALL | {"args": {"c": 1}}], Reason.UNKNOWN_FIELD, "call_service", "/add"),
        ([OFFERED, CALL | {"args": {"a": 2**64}}], Reason.WRONG_VALUE, "call_service", "/add"),
        ([{"op": "unadvertise_service", "service": "/add"}], Reason.NOT_ADVERTISED, "unadvertise_service", "/add"),
        (
            [{"op": "service_response", "service": "/add", "id": "1", "result": True}],
            Reason.NOT_ADVERTISED,
            "service_response",
            "/add",
        ),
        (
            [OFFERED, {"op": "service_response", "service": "/add", "id": "1", "result": True}],
            Reason.STRAY_ANSWER,
            "service_response",
            "/add",
        ),
        (
            [{"op": "send_action_goal", "action": "/fib", "action_type": "a/B", "id": "1"}],
            Reason.NO_SUCH_ACTION,
            "send_action_goal",
            "/fib",
        ),
    ],
)  # fmt: skip
def test_refusal_is_recorded_once_with_its_reason(frames: list[Any], reason: Reason, op: str, subject: str) -> None:
    (noted,) = refused(*frames)
    assert (noted.reason, noted.op, noted.subject) == (reason, op, subject)
    assert noted.text


def test_unknown_fields_are_named_when_a_field_is_missing() -> None:
    (noted,) = refused({"op": "subscribe", "topc": "/c", "id": "1"})
    assert noted.text == "subscribe: Expected a topic field but none was found.  What came in place of it: topc"
    (noted,) = refused({"op": "subscribe", "id": "1"})
    assert noted.text == "subscribe: Expected a topic field but none was found."
    (noted,) = refused({"op": "subscribe", **{"x" * 1_000 + str(i): i for i in range(1_000)}})
    assert len(noted.text) < 1_000


def test_surplus_positional_arguments_are_ignored_and_noted_with_the_field_names() -> None:
    (noted,) = refused(OFFERED, CALL | {"args": [1, 2, 3]})
    assert noted.text.endswith("takes 2 values, but got 3: the rest is ignored; it has a, b")
    assert noted.subject == "/add"
    (noted,) = refused(OFFERED | {"type": "std_srvs/Empty"}, CALL | {"args": [1]})
    assert noted.text.endswith("takes 0 values, but got 1: the rest is ignored")


def test_client_without_errors_has_no_refusals() -> None:
    call = {"op": "call_service", "service": "/add", "id": "1", "args": {"a": 1}}
    answer = {"op": "service_response", "service": "/add", "id": "service_request:/add:1", "result": False}
    assert refused(ADVERTISED, {"op": "publish", "topic": "/c", "msg": {}}, OFFERED, call, answer) == []


@pytest.mark.parametrize("values", [{}, {"values": {}}, {"values": None}])
def test_provider_without_a_result_field_is_warned_and_recorded(values: dict[str, Any]) -> None:
    call = {"op": "call_service", "service": "/add", "id": "1", "args": {"a": 1}}
    answer = {"op": "service_response", "service": "/add", "id": "service_request:/add:1", **values}
    (noted,) = refused(OFFERED, call, answer)
    assert (noted.reason, noted.op, noted.subject) == (Reason.BAD_OP, "service_response", "/add")
    assert noted.text.endswith('so its call has failed. Send "result": true (with roslib, return true)')


def test_refusal_by_a_provider_is_not_recorded_against_the_caller() -> None:
    call = {"op": "call_service", "service": "/add", "id": "1", "args": {"a": 1}}
    answer = {"op": "service_response", "service": "/add", "id": "service_request:/add:1", "result": False}
    assert refused(OFFERED, call, answer | {"values": "I will not"}) == []


def test_denied_name_has_the_reason_not_allowed_and_no_suggestions() -> None:
    bus = make_bus()
    noted: list[RefusedRequest] = []
    bus.on_refusal = noted.append
    owner, _ = make_peer(bus)
    for name in ("/secret_one", "/open_one"):
        owner.receive(json.dumps(OFFERED | {"service": name}).encode(), 0.0)
        owner.receive(json.dumps(ADVERTISED | {"topic": name}).encode(), 0.0)
    secret = Rule(deny=("/secret*",))
    policy = Policy(publish=secret, subscribe=secret, service=secret)
    outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
    peer = Peer(bus, Session(outbox, lambda _due: None), policy=policy)
    for op in (
        {"op": "call_service", "service": "/secret_one"},
        {"op": "call_service", "service": "/_secret_one"},
        {"op": "subscribe", "topic": "/_secret_one"},
        {"op": "call_service", "service": "/opn_one"},
        {"op": "subscribe", "topic": "/opn_one"},
    ):
        peer.receive(json.dumps(op).encode(), 0.0)
    assert [each.reason for each in noted[:1]] == [Reason.NOT_ALLOWED]
    assert not any("did you mean /secret" in each.text for each in noted)
    assert [each.text.endswith(" (did you mean /open_one?)") for each in noted[3:]] == [True, True]


def test_status_and_recorded_refusal_have_the_same_text() -> None:
    bus = make_bus()
    noted: list[RefusedRequest] = []
    bus.on_refusal = noted.append
    peer, outbox = make_peer(bus)
    peer.receive(json.dumps(OFFERED).encode(), 0.0)
    peer.receive(b'{"op": "call_service", "service": "/ad", "id": "1"}', 0.0)
    (answer,) = [json.loads(frame) for frame in outbox.take(2**20)]
    assert answer["values"] == noted[0].text == "Service /ad does not exist (did you mean /add?)"


def test_failing_refusal_log_does_not_affect_the_client() -> None:
    bus = make_bus()

    def fail(_refusal: RefusedRequest) -> None:
        raise RuntimeError("a bug of ours")

    bus.on_refusal = fail
    peer, outbox = make_peer(bus)
    peer.receive(b'{"op": "subscribe", "topic": "/d", "id": "1"}', 0.0)
    (status,) = [json.loads(frame) for frame in outbox.take(2**20)]
    assert (status["op"], status["id"], bus.guard.num_faults) == ("status", "1", 1)


def test_status_during_an_op_is_recorded_with_that_op() -> None:
    bus = make_bus()
    noted: list[RefusedRequest] = []
    bus.on_refusal = noted.append
    first, _ = make_peer(bus)
    second, _ = make_peer(bus)
    first.receive(json.dumps(OFFERED).encode(), 0.0)
    second.receive(json.dumps(OFFERED).encode(), 0.0)
    second.notify("info", "no mistake")
    second.notify("error", "later")
    second.explain("warning", "refused", Reason.PAUSED)
    assert [(each.reason, each.op) for each in noted] == [
        (Reason.WARNING, "advertise_service"),
        (Reason.REFUSED, ""),
        (Reason.PAUSED, ""),
    ]


def test_key_that_nobody_reads_is_recorded_once_and_the_op_is_done() -> None:
    goal = {"op": "call_service", "service": "/add", "id": "1", "goal": {"a": 1}}
    (noted,) = refused(OFFERED, goal, goal)
    assert noted.reason is Reason.BAD_OP
    assert (noted.op, noted.subject) == ("call_service", "/add")
    assert noted.text == "call_service: nobody reads the field goal (did you mean args?)"


def test_keys_of_known_clients_are_no_mistake() -> None:
    extra = {"fragment_size": 5, "compression": "none", "queue_size": 3, "message_intervall": 1}
    ops_ = (
        ADVERTISED | extra,
        {"op": "publish", "topic": "/c", "msg": {}, "latch": False, **extra},
        OFFERED,
        CALL | {"type": "rospy_tutorials/AddTwoInts", "fragment_size": None, "compression": None, "timeout": 1},
        {"op": "unsubscribe", "topic": "/c", "type": "std_msgs/String", "id": "x"},
    )
    assert [each for each in refused(*ops_) if each.reason is Reason.BAD_OP] == []


def test_any_number_of_keys_gives_a_few_short_lines() -> None:
    strange = {f"{i}" + "x" * 90: i for i in range(100)}
    noted = refused({"op": "subscribe", "topic": "/c", "type": "std_msgs/String", **strange})
    assert 0 < len(noted) <= 3
    assert max(len(each.text) for each in noted) < 300


def test_key_that_is_no_text_does_no_harm() -> None:
    bus = make_bus()
    peer, _ = make_peer(bus)
    peer.receive(b'{"op":"subscribe","topic":"/c","type":"std_msgs/String","\xff":1}', 0.0)
    peer.receive(b'{"op":"subscribe","topic":"/d","type":"std_msgs/String"}', 0.0)
    assert "/d" in bus.topics


def test_messages_of_a_long_run_are_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peer_module, "LOOKS", 3)
    publish = {"op": "publish", "topic": "/c", "msg": {}}
    assert [each.text for each in refused(ADVERTISED, publish, publish, publish, publish | {"mgs": 1})] == []
    assert [each.op for each in refused(ADVERTISED, publish, publish | {"mgs": 1})] == ["publish"]
