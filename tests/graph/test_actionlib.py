"""The action topics of ROS 1, with a provider that the test controls."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.actionlib import ENDED_GOAL_MEMORY, STATUS_PERIOD, Actionlib, ActionlibStatus
from rosbridge_sim.graph.actions import MAX_ENDED, Goal, GoalStatus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_bus

NAME = "/count"
TYPE = "actionlib_tutorials/Fibonacci"


class GoalClient(Participant):
    """Who sends goals and hears of them; or provides."""

    def __init__(self, scene: ActionFixture | None = None, name: str = "/somebody") -> None:
        self.name = name
        self.told: list[tuple[str, str]] = []
        self.heard: list[tuple[str, dict[str, Any]]] = []
        self._scene = scene

    def notify(self, level: str, text: str) -> None:
        self.told.append((level, text))

    def deliver(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.heard.append((topic.name.removeprefix(NAME + "/"), json.loads(message.json)))

    def listen(self, *names: str) -> None:
        assert self._scene is not None
        for name in names:
            self._scene.bus.subscribe(self, f"{NAME}/{name}", self.deliver)

    def publish(self, name: str, type_name: str, **fields: object) -> None:
        assert self._scene is not None
        bus = self._scene.bus
        topic = bus.advertise(self, f"{NAME}/{name}", type_name)
        bus.publish(self, topic, Message(topic.type, topic.type.check(fields, bus.stamp_ns)), self._scene.now)

    def send(self, goal_id: str = "g", order: int = 3, secs: int = 0) -> None:
        stamp = {"secs": secs, "nsecs": 0}
        self.publish("goal", f"{TYPE}ActionGoal", goal_id={"id": goal_id, "stamp": stamp}, goal={"order": order})

    def cancel(self, **fields: object) -> None:
        self.publish("cancel", "actionlib_msgs/GoalID", **fields)

    def messages(self, name: str) -> list[dict[str, Any]]:
        return [message for topic, message in self.heard if topic == name]

    def statuses(self) -> dict[str, int]:
        """Goal -> status, as of the last status message."""
        return {s["goal_id"]["id"]: s["status"] for s in self.messages("status")[-1]["status_list"]}


class ActionFixture:
    """An action with its topics."""

    def __init__(self) -> None:
        self.bus = make_bus()
        self.bus.stamp_ns = 40_000_000
        self.now = 100.0
        self.provider = GoalClient(name="/provider")
        self.goals: list[Goal] = []
        self.cancelled: list[Goal] = []
        action = self.bus.actions.provide(self.provider, NAME, TYPE, self.take, self.cancelled.append)
        self.actionlib = Actionlib(self.bus, action)

    def take(self, goal: Goal) -> None:
        if goal.request.order < 0:  # type: ignore[attr-defined] # a generated struct
            raise GraphError("there is nothing before the first number")
        self.goals.append(goal)

    def somebody(self) -> GoalClient:
        who = GoalClient(self)
        who.listen("status", "feedback", "result")
        return who

    def sequence(self, *numbers: int) -> Struct:
        return self.bus.store.action(TYPE).result.struct_type(sequence=list(numbers))

    def advance(self, seconds: float) -> int:
        """Let time pass, with turns just when they are asked for; how many."""
        end, num = self.now + seconds, 0
        while (due := self.actionlib.next_due()) is not None and due <= end:
            self.now = max(due, self.now)
            self.actionlib.advance(self.now)
            num += 1
        self.now = end
        return num


def test_goal_ends_after_its_feedback() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    who.send("mine", order=2)
    assert who.statuses() == {"mine": ActionlibStatus.ACTIVE}
    (goal,) = scene.goals
    assert goal.caller is who
    assert goal.request.order == 2  # type: ignore[attr-defined] # a generated struct
    goal.report(scene.bus.store.action(TYPE).feedback.struct_type(sequence=[0, 1]), 0.0)
    (feedback,) = who.messages("feedback")
    assert feedback["feedback"] == {"sequence": [0, 1]}
    assert feedback["status"] == {
        "goal_id": {"id": "mine", "stamp": {"secs": 0, "nsecs": 40_000_000}},
        "status": ActionlibStatus.ACTIVE,
        "text": "",
    }
    assert feedback["header"]["stamp"] == {"secs": 0, "nsecs": 40_000_000}
    goal.end(GoalStatus.SUCCEEDED, scene.sequence(0, 1, 1))
    (result,) = who.messages("result")
    assert result["result"] == {"sequence": [0, 1, 1]}
    assert result["status"]["status"] == ActionlibStatus.SUCCEEDED
    assert who.statuses() == {"mine": ActionlibStatus.SUCCEEDED}


@pytest.mark.parametrize(
    ("end", "status"),
    [
        (GoalStatus.SUCCEEDED, ActionlibStatus.SUCCEEDED),
        (GoalStatus.CANCELED, ActionlibStatus.PREEMPTED),
        (GoalStatus.ABORTED, ActionlibStatus.ABORTED),
        (GoalStatus.UNKNOWN, ActionlibStatus.ABORTED),
    ],
)
def test_goal_states_have_the_numbers_of_ros_1(end: GoalStatus, status: ActionlibStatus) -> None:
    scene = ActionFixture()
    who = scene.somebody()
    who.send()
    scene.goals[0].end(end, scene.sequence())
    assert who.messages("result")[0]["status"]["status"] == status


def test_goal_of_a_lost_provider_is_aborted_with_a_reason() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    who.send()
    scene.bus.leave(scene.provider, scene.now)
    (result,) = who.messages("result")
    assert result["status"]["status"] == ActionlibStatus.ABORTED
    assert "disconnected" in result["status"]["text"]
    assert result["result"] == {"sequence": []}


def test_refused_goal_is_rejected_with_a_status_for_its_sender() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    with pytest.raises(GraphError, match="Goal bad of /count was rejected: there is nothing before"):
        who.send("bad", order=-1)
    (result,) = who.messages("result")
    assert result["status"]["status"] == ActionlibStatus.REJECTED
    assert result["status"]["text"] == "there is nothing before the first number"
    assert who.statuses() == {"bad": ActionlibStatus.REJECTED}


def test_status_is_published_at_5_hz_while_subscribed() -> None:
    scene = ActionFixture()
    assert scene.actionlib.next_due() is None
    assert scene.advance(10.0) == 0
    who = GoalClient(scene)
    who.listen("status")
    assert scene.advance(1.1) == 5 + 1
    assert [m["status_list"] for m in who.messages("status")] == [[]] * 6
    scene.bus.leave(who, scene.now)
    assert scene.actionlib.next_due() is None


def test_early_timer_does_nothing() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    for _ in range(10):
        scene.actionlib.advance(scene.now)
    assert len(who.messages("status")) == 1


def test_ended_goal_stays_in_the_status_for_a_while() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    who.send()
    scene.goals[0].end(GoalStatus.SUCCEEDED, scene.sequence())
    scene.advance(ENDED_GOAL_MEMORY - 2 * STATUS_PERIOD)
    assert who.statuses() == {"g": ActionlibStatus.SUCCEEDED}
    scene.advance(4 * STATUS_PERIOD)
    assert who.statuses() == {}


def test_ended_goals_in_the_status_are_bounded() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    for i in range(MAX_ENDED + 5):
        who.send(f"g{i}")
        scene.goals[i].end(GoalStatus.SUCCEEDED, scene.sequence())
    assert list(who.statuses()) == [f"g{i}" for i in range(5, MAX_ENDED + 5)]


def test_missing_goal_id_and_stamp_are_generated() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    who.send("")
    who.send("")
    who.send("late", secs=9)
    ids = [s["goal_id"] for s in who.messages("status")[-1]["status_list"]]
    assert ids == [
        {"id": "/count-1", "stamp": {"secs": 0, "nsecs": 40_000_000}},
        {"id": "/count-2", "stamp": {"secs": 0, "nsecs": 40_000_000}},
        {"id": "late", "stamp": {"secs": 9, "nsecs": 0}},
    ]


def test_known_goal_is_not_started_again() -> None:
    scene = ActionFixture()
    who = scene.somebody()
    who.send()
    who.send()
    scene.goals[0].end(GoalStatus.SUCCEEDED, scene.sequence())
    who.send()
    assert len(scene.goals) == 1
    assert who.told == [("warning", "Goal g of /count is known already")] * 2
    scene.now += ENDED_GOAL_MEMORY
    who.send()
    assert len(scene.goals) == 2


def test_overlong_goal_id_is_refused() -> None:
    scene = ActionFixture()
    with pytest.raises(GraphError, match="at most 1024"):
        scene.somebody().send("x" * 1025)
    assert scene.goals == []


def test_cancel_by_id_cancels_the_goal_of_any_client() -> None:
    scene = ActionFixture()
    one, two = scene.somebody(), scene.somebody()
    one.send("a")
    one.send("b")
    two.cancel(id="a")
    two.cancel(id="nobody")
    assert scene.cancelled == [scene.goals[0]]
    scene.cancelled[0].end(GoalStatus.CANCELED, scene.sequence())
    assert one.statuses() == {"a": ActionlibStatus.PREEMPTED, "b": ActionlibStatus.ACTIVE}
    two.cancel(id="a")
    assert len(scene.cancelled) == 1


def test_cancel_without_an_id_cancels_the_senders_goals() -> None:
    scene = ActionFixture()
    one, two = scene.somebody(), scene.somebody()
    for who, name in ((one, "a"), (two, "b"), (one, "c")):
        who.send(name)
    one.cancel()
    assert scene.cancelled == [scene.goals[0], scene.goals[2]]


def test_cancel_by_time_cancels_the_senders_goals_up_to_it() -> None:
    scene = ActionFixture()
    one, two = scene.somebody(), scene.somebody()
    for i, who in enumerate((one, two, one, one)):
        who.send(f"g{i}", secs=i + 1)
    one.cancel(stamp={"secs": 3, "nsecs": 0})
    assert scene.cancelled == [scene.goals[0], scene.goals[2]]


def test_goals_of_a_client_that_leaves_are_cancelled() -> None:
    scene = ActionFixture()
    one, two = scene.somebody(), scene.somebody()
    one.send("a")
    two.send("b")
    scene.bus.leave(one, scene.now)
    assert scene.cancelled == [scene.goals[0]]
    assert two.statuses() == {"a": ActionlibStatus.PREEMPTED, "b": ActionlibStatus.ACTIVE}
    scene.cancelled[0].end(GoalStatus.CANCELED, scene.sequence())  # nobody hears of that any more
    assert len(two.messages("result")) == 1


def test_action_topics_belong_to_the_provider() -> None:
    scene = ActionFixture()
    who = GoalClient(scene)
    for name, type_name in (
        ("status", "actionlib_msgs/GoalStatusArray"),
        ("feedback", f"{TYPE}ActionFeedback"),
        ("result", f"{TYPE}ActionResult"),
    ):
        with pytest.raises(GraphError, match="alone"):
            who.publish(name, type_name)
