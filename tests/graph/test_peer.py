"""What one client's ops mean, where a vector cannot say it."""

from __future__ import annotations

import json
from typing import Any

from rosbridge_sim.graph.bus import MAX_CALLS, TYPE_MEMORY
from rosbridge_sim.graph.peer import Peer
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.protocol.flow import Outbox
from tests.graph.room import make_bus, make_peer


def do(peer: Peer, now: float = 0.0, **op: object) -> None:
    peer.receive(json.dumps(op).encode(), now)


def got(outbox: Outbox) -> list[dict[str, Any]]:
    return [json.loads(frame) for frame in outbox.take(2**40)]


def test_a_call_with_a_timeout_is_given_up_and_its_late_answer_is_no_mistake() -> None:
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


def test_calls_without_a_timeout_wait_for_ever() -> None:
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
    for _ in range(3):  # callers come, ask, and go
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


def test_one_client_cannot_hold_the_whole_graph() -> None:
    bus = make_bus()
    peer, outbox = make_peer(bus)
    for i in range(Policy().max_held):
        do(peer, op="subscribe", topic=f"/t{i}", type="std_msgs/String")
    assert got(outbox) == []
    do(peer, op="advertise", topic="/one_more", type="std_msgs/String", id=1)
    (status,) = got(outbox)
    assert (status["op"], status["id"]) == ("status", 1)
    peer.leave(0.0)
    bus.expire(TYPE_MEMORY)
    assert bus.topics == {}


def test_mistakes_are_counted() -> None:
    bus = make_bus()
    peer, _ = make_peer(bus)
    do(peer, op="publish", topic="/t")
    assert peer.num_errors == 1


def test_leaving_twice_is_no_error() -> None:
    bus = make_bus()
    peer, _ = make_peer(bus)
    do(peer, op="advertise", topic="/t", type="std_msgs/String")
    peer.leave(0.0)
    peer.leave(0.0)
    assert bus.owners() == []


def test_a_publisher_that_was_dropped_by_unadvertise_publishes_anew() -> None:
    bus = make_bus()
    (peer, _), (listener, outbox) = make_peer(bus), make_peer(bus)
    do(peer, op="advertise", topic="/t", type="std_msgs/String")
    do(listener, op="subscribe", topic="/t")
    do(peer, op="unadvertise", topic="/t")
    assert bus.topics["/t"].publishers == {}
    do(peer, op="publish", topic="/t", msg={"data": "x"})
    assert list(bus.topics["/t"].publishers) == [peer]
    assert len(got(outbox)) == 1
