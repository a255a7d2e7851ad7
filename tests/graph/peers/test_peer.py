"""Ops of one client, beyond the vectors."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.service_table import MAX_CALLS
from rosbridge_sim.graph.topic_table import TYPE_MEMORY
from rosbridge_sim.protocol.outbox import Outbox
from tests.graph.bus_fixture import Wire, make_bus, make_peer


def do(peer: Peer, now: float = 0.0, /, **op: object) -> None:
    peer.receive(json.dumps(op).encode(), now)


def got(outbox: Outbox) -> list[dict[str, Any]]:
    return [json.loads(frame) for frame in outbox.take(2**40)]


WRONG = {"op": "publish", "topic": "/t", "type": "std_msgs/String", "msg": {"dat": 1}}
NO_TYPE = {"op": "advertise_service", "service": "/s", "type": "std_srvs/Triger"}


@pytest.mark.parametrize(
    ("ops", "answers"),
    [
        ([{**WRONG, "id": "publish:/t:2"}], ["status error: Message type"]),
        ([{**WRONG, "id": "publish:/t:2"}, NO_TYPE], ["status error: Message type", "status error: Unable to"]),
        ([WRONG], ["status"]),  # Autobahn, and none of roslibpy's ids
        ([{**WRONG, "id": "publish:/t:x"}], ["status"]),
        ([{**WRONG, "id": 3}], ["status"]),
        ([{**WRONG, "id": "mine"}, {**WRONG, "id": "publish:/t:2"}], ["status", "status"]),
        ([NO_TYPE], ["status", "status error: Unable to"]),  # roslibpy gives it no id, so it may be either
        ([NO_TYPE, WRONG], ["status", "status error: Unable to", "status"]),
        ([{"op": "set_level", "level": "warning", "id": "l"}, {**WRONG, "id": "publish:/t:2"}], ["status"]),
    ],
)
def test_roslibpy_gets_the_reason_in_the_op_and_other_clients_get_a_status(
    ops: list[dict[str, Any]], answers: list[str]
) -> None:
    peer, outbox = make_peer(make_bus())
    peer.session.is_roslibpy = None  # as a handshake of Autobahn
    for op in ops:
        do(peer, **op)
    frames = got(outbox)
    assert [frame["op"][: len(answer)] for frame, answer in zip(frames, answers, strict=True)] == answers
    assert all(frame["level"] == "error" for frame in frames)


def test_roslibpy_gets_json_where_it_asks_for_pictures_that_it_cannot_read() -> None:
    peer, outbox = make_peer(make_bus())
    peer.session.is_roslibpy = None
    terms = {"topic": "/t", "type": "std_msgs/String", "compression": "png"}
    do(peer, op="subscribe", id="subscribe:/t:1", **terms)
    do(peer, op="publish", topic="/t", msg={"data": "hi"})
    assert got(outbox) == [{"op": "publish", "topic": "/t", "msg": {"data": "hi"}}]


def test_call_with_a_time_out_ends_and_its_late_answer_is_not_an_error() -> None:
    bus = make_bus()
    (provider, calls), (caller, answers) = make_peer(bus), make_peer(bus)
    do(provider, op="set_level", level="info")
    do(provider, op="advertise_service", service="/add", type="rospy_tutorials/AddTwoInts")
    do(caller, op="call_service", service="/add", id="1", timeout=3)
    bus.expire(3.0)
    (answer,) = got(answers)
    assert answer["result"] is False
    assert answer["values"] == "Timeout exceeded while waiting for service response"
    (call,) = got(calls)
    do(provider, op="service_response", service="/add", id=call["id"], values={"sum": 0}, result=True)
    assert got(calls) == []
    assert got(answers) == []


def test_many_values_by_position_are_refused_by_their_weight() -> None:
    bus = make_bus()
    (provider, calls), (caller, answers) = make_peer(bus), make_peer(bus)
    do(provider, op="advertise_service", service="/add", type="rospy_tutorials/AddTwoInts")
    do(caller, op="call_service", service="/add", args=[3, 4])
    assert got(calls)[0]["args"] == {"a": 3, "b": 4}
    do(caller, op="call_service", service="/add", args=[1] * 400_000)
    (answer,) = got(answers)
    assert answer["result"] is False
    assert "name the fields" in answer["values"]
    assert "at most 320,000 values" in answer["values"]


def test_call_without_a_time_out_never_expires() -> None:
    bus = make_bus()
    (provider, _), (caller, answers) = make_peer(bus), make_peer(bus)
    do(provider, op="advertise_service", service="/add", type="rospy_tutorials/AddTwoInts")
    do(caller, op="call_service", service="/add")
    do(caller, op="call_service", service="/add", timeout=0)
    bus.expire(1e9)
    assert got(answers) == []


def test_a_provider_that_never_answers_holds_a_bounded_number_of_calls() -> None:
    bus = make_bus()
    provider, calls = make_peer(bus)
    do(provider, op="advertise_service", service="/add", type="rospy_tutorials/AddTwoInts")
    for round_number in range(3):  # callers come, call, and go
        caller, answers = make_peer(bus)
        for _ in range(MAX_CALLS):
            do(caller, op="call_service", service="/add")
        assert len(got(calls)) == MAX_CALLS, round_number
        assert got(answers) == []
        caller.leave(0.0)
    (first, waits), (second, refused) = make_peer(bus), make_peer(bus)
    for _ in range(MAX_CALLS):
        do(first, op="call_service", service="/add")
    do(second, op="call_service", service="/add")
    assert got(waits) == []
    assert "calls waiting already" in got(refused)[0]["values"]


def test_a_provider_that_never_ends_its_goals_holds_a_bounded_number_of_them() -> None:
    bus = make_bus()
    provider, goals = make_peer(bus)
    do(provider, op="advertise_action", action="/count", type="action_tutorials_interfaces/Fibonacci")
    goal: dict[str, Any] = {
        "op": "send_action_goal",
        "action": "/count",
        "action_type": "action_tutorials_interfaces/Fibonacci",
    }
    for _ in range(2):  # callers come, ask, and go
        caller, answers = make_peer(bus)
        for i in range(MAX_CALLS):
            do(caller, **goal, id=str(i))
        assert len(got(goals)) == MAX_CALLS
        assert got(answers) == []
        do(caller, op="cancel_action_goal", action="/count", id="3")
        assert [frame["op"] for frame in got(goals)] == ["cancel_action_goal"]
        caller.leave(0.0)
        assert [frame["op"] for frame in got(goals)] == ["cancel_action_goal"] * MAX_CALLS
    (first, waits), (second, refused) = make_peer(bus), make_peer(bus)
    for i in range(MAX_CALLS):
        do(first, **goal, id=str(i))
    do(second, **goal)
    assert got(waits) == []
    assert "goals under way already" in got(refused)[0]["values"]


def test_an_unadvertised_topic_is_found_under_both_of_its_spellings() -> None:
    bus = make_bus()
    peer, outbox = make_peer(bus)
    for spelling in ("/t", "t", "/other"):
        do(peer, op="advertise", topic=spelling, type="std_msgs/String", id="a")
    do(peer, op="unadvertise", topic="t", id="a")
    assert peer not in bus.topics["/t"].publishers
    for spelling in ("/t", "t", "/other"):
        do(peer, op="publish", topic=spelling, msg={"data": "x"})
    assert got(outbox) == []
    assert [peer in bus.topics[name].publishers for name in ("/t", "/other")] == [True, True]


@pytest.mark.parametrize("values", ['{"sum": 3}', '{ "sum" :3}'])
def test_glued_and_plain_answers_with_result_false_are_treated_alike(values: str) -> None:
    bus = make_bus()
    (provider, calls), (caller, answers) = make_peer(bus), make_peer(bus)
    do(provider, op="advertise_service", service="/add", type="rospy_tutorials/AddTwoInts")
    for glue in ("", '{"op":"status","level":"info","msg":"x"}'):
        for body, is_ok in ((values, True), ("{ \n}", False), ("[3]", False), ("3", False), ("null", False)):
            do(caller, op="call_service", service="/add", id="1")
            call_id = got(calls)[0]["id"]
            answer = f'{{"op":"service_response","service":"/add","id":"{call_id}","values":{body},"result":false}}'
            provider.receive((glue + answer).encode(), 0.0)
            (answered,) = got(answers)
            assert answered["result"] is is_ok
            assert (answered["values"] == {"sum": 3}) is is_ok


@pytest.mark.parametrize(
    "answer",
    [
        '{"op":"service_response","service":"/add","id":ID,"values":{"sum":1,},"result":true}',
        '{"op": "service_response", "service": "/add", "values": {"sum": tru}, "result": true, "id" : ID}',
        '{"op":"service_response","service":"/add","id":ID,"values":{"sum":',
        '{"op":"service_response","service":"/add","id":ID,"values":{"sum":1},"result":"yes"}',
        '{"op":"service_response","id":ID,"values":{"sum":1},"result":true}',
        '{"op":"service_response","service":"/add","id":ID,"result":true,"values":' + "[" * 100_000,
        '{"op":"service_response","service":"/add\xff","id":ID,"values":{"sum":1},"result":true}',
    ],
)
def test_a_call_whose_answer_cannot_be_read_fails(answer: str) -> None:
    bus = make_bus()
    (provider, calls), (caller, answers) = make_peer(bus), make_peer(bus)
    do(provider, op="advertise_service", service="/add", type="rospy_tutorials/AddTwoInts")
    do(caller, op="call_service", service="/add", id="1")
    do(caller, op="call_service", service="/add", id="2")
    call_id = got(calls)[1]["id"]
    provider.receive(answer.replace("ID", json.dumps(call_id)).encode("latin-1"), 0.0)
    (answered,) = got(answers)
    assert (answered["id"], answered["result"]) == ("2", False)
    assert "The provider's answer cannot be read" in answered["values"]
    assert [frame["op"] for frame in got(calls)] == ["status"]


@pytest.mark.parametrize(
    "answer",
    [
        '{"op":"action_result","action":"/count","id":ID,"status":4,"result":true,"values":{"sequence":[1,]}}',
        '{"op":"action_result","action":"/count","id":ID,"status":4,"values":{"sequence":[1]}}',
        '{"op":"action_result","action":"/count","status":4,"result":true,"values":{"sequence":[1',
    ],
)
def test_a_goal_whose_result_cannot_be_read_fails(answer: str) -> None:
    bus = make_bus()
    (provider, goals), (caller, answers) = make_peer(bus), make_peer(bus)
    action_type = "action_tutorials_interfaces/Fibonacci"
    do(provider, op="advertise_action", action="count", type=action_type)
    do(caller, op="send_action_goal", action="/count", action_type=action_type, id="1")
    goal_id = got(goals)[0]["id"]
    provider.receive(answer.replace("ID", json.dumps(goal_id)).encode(), 0.0)
    (ended,) = got(answers)
    assert (ended["op"], ended["id"], ended["result"]) == ("action_result", "1", False)
    assert "The provider's answer cannot be read" in ended["values"]


def test_answer_without_an_id_fails_the_only_pending_call() -> None:
    bus = make_bus()
    (provider, _), (caller, answers) = make_peer(bus), make_peer(bus)
    for name in ("/add", "/subtract"):
        do(provider, op="advertise_service", service=name, type="rospy_tutorials/AddTwoInts")
        do(caller, op="call_service", service=name, id=name)
    torn = b'{"op":"service_response","service":"/add","values":{"sum":'
    provider.receive(torn, 0.0)
    assert got(answers) == []  # two wait
    bus.withdraw(provider, "/subtract")
    assert len(got(answers)) == 1
    provider.receive(torn.replace(b"service_response", b"publish"), 0.0)
    assert got(answers) == []
    provider.receive(torn, 0.0)
    assert [answer["id"] for answer in got(answers)] == ["/add"]


def test_an_unreadable_frame_fails_no_call_of_another_provider() -> None:
    bus = make_bus()
    (provider, calls), (caller, answers), (stranger, _) = make_peer(bus), make_peer(bus), make_peer(bus)
    do(provider, op="advertise_service", service="/add", type="rospy_tutorials/AddTwoInts")
    do(caller, op="call_service", service="/add", id="1")
    call_id = got(calls)[0]["id"]
    for frame in ({"op": "service_response", "service": "/add", "id": call_id}, {"op": "service_response"}):
        do(stranger, **frame)
    assert got(answers) == []


def test_names_held_by_one_client_are_bounded() -> None:
    bus = make_bus()
    client = Wire(bus, Policy(max_held=1_000))
    for i in range(1_000):
        assert client.says(op="subscribe", topic=f"/t{i}", type="std_msgs/String") == []
    (status,) = client.says(op="advertise", topic="/one_more", type="std_msgs/String", id=1)
    assert (status["op"], status["id"]) == ("status", 1)
    client.peer.leave(0.0)
    bus.expire(TYPE_MEMORY)
    assert bus.topics == {}


def test_errors_of_a_client_are_counted() -> None:
    bus = make_bus()
    peer, _ = make_peer(bus)
    do(peer, op="publish", topic="/t")
    assert peer.num_errors == 1


def test_leaving_twice_is_harmless() -> None:
    bus = make_bus()
    peer, _ = make_peer(bus)
    do(peer, op="advertise", topic="/t", type="std_msgs/String")
    peer.leave(0.0)
    peer.leave(0.0)
    assert bus.owners() == []


def test_publisher_can_publish_again_after_unadvertise() -> None:
    bus = make_bus()
    (peer, _), (listener, outbox) = make_peer(bus), make_peer(bus)
    do(peer, op="advertise", topic="/t", type="std_msgs/String")
    do(listener, op="subscribe", topic="/t")
    do(peer, op="unadvertise", topic="/t")
    assert bus.topics["/t"].publishers == {}
    do(peer, op="publish", topic="/t", msg={"data": "x"})
    assert list(bus.topics["/t"].publishers) == [peer]
    assert len(got(outbox)) == 1


def test_held_client_is_released_after_all_holds_end() -> None:
    peer, _ = make_peer(make_bus())
    released: list[bool] = []
    peer.on_released = lambda: released.append(peer.is_held)
    first, second = peer.hold(), peer.hold()
    assert peer.is_held
    first()
    first()
    assert peer.is_held
    assert released == []
    second()
    second()
    assert not peer.is_held
    assert released == [False]


def test_release_of_a_client_that_left_does_nothing() -> None:
    peer, _ = make_peer(make_bus())
    released: list[bool] = []
    peer.on_released = lambda: released.append(True)
    release = peer.hold()
    peer.leave(0.0)
    release()
    assert (peer.is_held, released) == (False, [])


def test_participant_that_cannot_be_held_goes_on() -> None:
    class Plain(Participant):
        name = "/plain"

        def __init__(self) -> None:
            self.told: list[tuple[str, str]] = []

        def notify(self, level: str, text: str) -> None:
            self.told.append((level, text))

    plain = Plain()
    release = plain.hold()
    release()
    release()
    plain.notifier()("error", "late")
    assert plain.told == [("error", "late")]


def test_late_status_has_the_id_of_its_op() -> None:
    bus = make_bus()
    (peer, told), late = make_peer(bus), []
    other = make_peer(bus)[0]
    bus.subscribe(
        other, "/news", lambda _topic, _message, sender, _now: late.append(sender.notifier()), type_name="std_msgs/Bool"
    )
    do(peer, op="publish", topic="/news", id="first", msg={"data": True})
    do(peer, op="publish", topic="/news", id="second", msg={"data": True})
    for notify in late:
        notify("error", "no")
    assert [status["id"] for status in got(told)] == ["first", "second"]
    assert peer.num_errors == 2
