"""The topics `_action/status` and `_action/feedback` of actions under ROS 2."""

from __future__ import annotations

import math
from base64 import b64decode
from typing import Any

import pytest

from rosbridge_sim.graph.action_topics import MAX_TOLD
from rosbridge_sim.graph.actions import ENDED_GOAL_MEMORY_NS, MAX_ENDED
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import OPEN, Policy, Rule
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from tests.graph.bus_fixture import Wire, make_store

STATUS, FEEDBACK = "/fib/_action/status", "/fib/_action/feedback"
FIBONACCI = "example_interfaces/action/Fibonacci"
UUID = "12345678-0000-4000-8000-000000000001"
EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(2, 7)


class Action:
    """A client that provides an action, one that sends goals and one that listens."""

    def __init__(self, policy: Policy = OPEN, type_name: str = FIBONACCI) -> None:
        self.bus = Bus(make_store(2))
        self.bus.stamp_ns = 7 * 10**9 + 5
        self.bus.agenda.first = math.inf
        self.provider, self.caller, self.listener = (Wire(self.bus, policy) for _ in range(3))
        self.type_name = type_name
        self.provider.says(op="advertise_action", action="/fib", type=type_name)

    def send(self, goal_id: str = UUID, **more: object) -> None:
        args = {"order": 1} if self.type_name == FIBONACCI else {}
        self.caller.says(op="send_action_goal", action="/fib", args=args, id=goal_id, **more)

    def end(self, number: int = 1, status: int = SUCCEEDED, *, result: bool = True) -> None:
        goal = {"action": "/fib", "id": f"action_goal:/fib:{number}"}
        self.provider.says(op="action_result", **goal, values={"sequence": [1]}, status=status, result=result)

    def listen(self, topic: str = STATUS) -> list[dict[str, Any]]:
        return [frame["msg"] for frame in self.listener.says(op="subscribe", topic=topic)]

    def turn(self) -> list[list[int]]:
        """Let a turn of the loop end, and return the status messages of it, each as the status of all goals."""
        while self.bus.agenda.first <= 0.0 and self.bus.next_deadline() == 0.0:
            self.bus.agenda.first = math.inf  # as the scheduler does, which asks only then
            self.bus.expire(0.0)
        frames = [frame for frame in self.listener.hears() if frame["topic"] == STATUS]
        return [[each["status"] for each in frame["msg"]["status_list"]] for frame in frames]


def test_status_follows_a_goal_to_its_end() -> None:
    action = Action()
    assert action.listen() == []  # as in ROS 2, nothing is latched before the first goal
    action.send()
    assert action.turn() == [[EXECUTING]]
    action.caller.says(op="cancel_action_goal", action="/fib", id=UUID)
    assert action.turn() == [[CANCELING]]
    action.end(status=CANCELED)
    assert action.turn() == [[CANCELED]]
    assert action.turn() == []


def test_late_subscriber_gets_goals_with_their_ids_and_stamps() -> None:
    action = Action()
    action.send()
    (message,) = action.listen()
    (goal,) = message["status_list"]
    assert b64decode(goal["goal_info"]["goal_id"]["uuid"]).hex() == UUID.replace("-", "")
    assert (goal["goal_info"]["stamp"], goal["status"]) == ({"sec": 7, "nanosec": 5}, EXECUTING)


@pytest.mark.parametrize(
    ("status", "result", "shown"), [(4, True, SUCCEEDED), (6, True, ABORTED), (2, True, ABORTED), (4, False, ABORTED)]
)
def test_end_of_a_goal_is_a_status_of_an_end(status: int, result: object, shown: int) -> None:
    action = Action()
    action.send()
    action.end(status=status, result=bool(result))
    (message,) = action.listen()
    assert [goal["status"] for goal in message["status_list"]] == [shown]


def test_ended_goals_stay_for_ten_seconds_of_the_graph_and_at_most_a_hundred() -> None:
    action = Action()
    action.listen()
    for number in range(1, MAX_ENDED + 3):
        action.send()
        action.end(number)
    action.send()
    assert action.turn() == [[SUCCEEDED] * MAX_ENDED + [EXECUTING]]
    action.bus.stamp_ns += ENDED_GOAL_MEMORY_NS
    action.end(MAX_ENDED + 3, status=ABORTED)
    assert action.turn() == [[ABORTED]]
    action.bus.stamp_ns = 0  # the world was reset
    action.send()
    assert action.turn() == [[EXECUTING]]


def test_thousand_goals_that_end_at_once_are_one_message() -> None:
    action = Action()
    action.listen()
    for _ in range(1_000):
        action.send()
    assert len(action.turn()) == 1
    action.caller.peer.leave(0.0)
    assert action.turn() == [[CANCELED] * MAX_ENDED]


def test_goals_of_many_actions_that_end_at_once_are_told_in_turns() -> None:
    action = Action()
    names = [f"/many/{number}" for number in range(30)]
    for name in names:
        action.provider.says(op="advertise_action", action=name, type=FIBONACCI)
        action.listen(f"{name}/_action/status")
        for _ in range(MAX_ENDED):
            Wire(action.bus).says(op="send_action_goal", action=name, args={"order": 1}, id=UUID)
    action.bus.expire(0.0)
    told = [frame["topic"] for frame in action.listener.hears()]
    assert 0 < len(told) <= MAX_TOLD / MAX_ENDED
    action.bus.expire(0.0)
    told += [frame["topic"] for frame in action.listener.hears()]
    assert told == [f"{name}/_action/status" for name in names]
    assert action.bus.next_deadline() != 0.0


def test_listener_that_ends_an_action_meets_no_trouble() -> None:
    action = Action()
    action.provider.says(op="advertise_action", action="/other", type=FIBONACCI)
    other = "/other"

    def end(*_: object) -> None:
        action.bus.actions.withdraw(action.provider.peer, other)

    action.bus.subscribe(action.listener.peer, STATUS, end)
    action.listen("/other/_action/status")
    action.send()
    action.caller.says(op="send_action_goal", action=other, args={"order": 1}, id="g")
    action.bus.expire(0.0)
    assert other not in action.bus.actions.by_name
    assert action.listener.hears() == []


def test_feedback_reaches_subscribers_with_the_id_of_its_goal_though_the_caller_wants_none() -> None:
    action = Action()
    action.listen(FEEDBACK)
    action.send()
    goal = {"action": "/fib", "id": "action_goal:/fib:1"}
    action.provider.says(op="action_feedback", **goal, values={"sequence": [0, 1]})
    (frame,) = action.listener.hears()
    assert frame["topic"] == FEEDBACK
    assert frame["msg"]["feedback"] == {"sequence": [0, 1]}
    assert b64decode(frame["msg"]["goal_id"]["uuid"]).hex() == UUID.replace("-", "")
    assert action.caller.hears() == []


def test_action_of_an_unknown_package_has_both_topics_too() -> None:
    action = Action(type_name="my_msgs/action/Count")
    action.listen(FEEDBACK)
    action.listen()
    action.send()
    goal = {"action": "/fib", "id": "action_goal:/fib:1"}
    action.provider.says(op="action_feedback", **goal, values={"sequence": [0, 1]})
    (frame,) = action.listener.hears()
    assert frame["msg"]["feedback"] == {"sequence": [0, 1]}
    assert action.turn() == [[EXECUTING]]


def test_nothing_is_made_while_nobody_listens() -> None:
    action = Action()
    action.send()
    action.end()
    published = action.bus.delivery.num_published
    assert action.turn() == []
    assert action.bus.delivery.num_published == published
    assert action.bus.topics[STATUS].latched == []


def test_both_topics_are_hidden_and_have_the_types_of_ros2() -> None:
    action = Action()
    Rosapi(action.bus)
    assert action.caller.learns("topics") == {"topics": [], "types": []}
    assert action.caller.learns("topic_type", topic=STATUS) == {"type": "action_msgs/msg/GoalStatusArray"}
    assert action.caller.learns("topic_type", topic=FEEDBACK) == {"type": f"{FIBONACCI}_FeedbackMessage"}
    (fields, *_) = action.caller.learns("message_details", type=f"{FIBONACCI}_FeedbackMessage")["typedefs"]
    assert fields["fieldnames"] == ["goal_id", "feedback"]


def test_action_of_the_server_has_both_topics_and_no_client_may_publish_there() -> None:
    action = Action()
    WebRepublisher(action.bus)
    topic = "/tf2_web_republisher/_action/status"
    (told,) = action.caller.says(op="publish", topic=topic, type="action_msgs/msg/GoalStatusArray", msg={})
    assert "is published by /tf2_web_republisher alone" in told["msg"]
    goal = {"source_frames": ["a"], "target_frame": "b"}
    action.caller.says(op="send_action_goal", action="/tf2_web_republisher", args=goal, id="g")
    (message,) = action.listen(topic)
    assert [goal["status"] for goal in message["status_list"]] == [EXECUTING]


@pytest.mark.parametrize("deny", [{"subscribe": Rule(deny=("/fib/_action/*",))}, {"service": Rule(deny=("/fib",))}])
def test_client_that_may_not_read_an_action_gets_neither_topic(deny: dict[str, Rule]) -> None:
    action = Action()
    action.send()
    other = Wire(action.bus, Policy(**deny))  # type: ignore[arg-type] # rules
    for topic in (STATUS, FEEDBACK):
        (told,) = other.says(op="subscribe", topic=topic)
        assert told["msg"].startswith(f"Not allowed to subscribe to {topic}")


def test_next_provider_may_bring_another_type() -> None:
    action = Action()
    action.listen(FEEDBACK)
    action.provider.says(op="unadvertise_action", action="/fib")
    assert STATUS not in action.bus.topics
    assert action.caller.says(op="advertise_action", action="/fib", type="action_tutorials_interfaces/Fibonacci") == []
    assert action.bus.topics[FEEDBACK].type.name == "action_tutorials_interfaces/Fibonacci_FeedbackMessage"
    Wire(action.bus).says(op="advertise_action", action="/fib", type=FIBONACCI)
    assert action.bus.topics[FEEDBACK].type.name == "example_interfaces/Fibonacci_FeedbackMessage"


def test_topic_of_another_client_does_not_stop_an_action() -> None:
    action = Action()
    action.caller.says(op="advertise", topic="/other/_action/status", type="std_msgs/msg/String")
    action.provider.says(op="set_level", level="warning")
    (told,) = action.provider.says(op="advertise_action", action="/other", type=FIBONACCI)
    assert told["level"] == "warning"
    assert told["msg"].startswith("/other goes without /other/_action/status: Tried to register topic")
    action.caller.says(op="send_action_goal", action="/other", args={"order": 1}, id="g")
    assert len(action.bus.actions.by_name["/other"].goals) == 1
    assert action.bus.topics["/other/_action/feedback"].publishers


def test_rejected_goal_was_never_there() -> None:
    action = Action()
    action.bus.actions.max_goals = 1
    action.send()
    Wire(action.bus).says(op="send_action_goal", action="/fib", args={"order": 1}, id="g")
    (message,) = action.listen()
    assert [goal["status"] for goal in message["status_list"]] == [EXECUTING]


def test_ros1_has_no_such_topics() -> None:
    bus = Bus(make_store(1))
    Wire(bus).says(op="advertise_action", action="/fib", type=FIBONACCI)
    assert list(bus.topics) == []
