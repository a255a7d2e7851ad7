"""Actions between the bus and a graph of ROS 2 in memory: goals, feedback, results, cancelling and rejection."""

from __future__ import annotations

import logging
from collections.abc import Callable

import pytest

from rosbridge_sim.graph.actions import Goal, GoalOutcome
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarService
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.ros2.cdr_types import CdrActionType, CdrTypes
from rosbridge_sim.graph.ros2.ros2_actions import FarGoalEar, Ros2Actions
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from tests.graph.participants import Somebody

COUNT = "own_msgs/Count"
TEXTS = {
    ("own_msgs", "action", "Count"): "int32 to\n---\nint32[] counted\n---\nint32 now\n",
    ("action_msgs", "srv", "CancelGoal"): "GoalInfo goal_info\n---\nint8 return_code\nGoalInfo[] goals_canceling\n",
}


class ActionsInMemory:
    """Actions between a bus and nodes that remember their goals; and a goal of a node, see `NodeGoalEar`."""

    def __init__(self, policy: Policy | None = None) -> None:
        store = Store(TEXTS, ros=2)
        self.bus = Bus(store, max_calls=1)
        self.refusals: list[RefusedRequest] = []
        self.bus.on_refusal = self.refusals.append
        self.types = CdrTypes(store, store)
        self.sent: list[tuple[bytes, FarGoalEar]] = []
        self.num_cancels = 0
        self.told: list[tuple[object, ...]] = []
        self.outcomes: list[GoalOutcome] = []
        self.feedback: list[Message] = []
        self.taken: list[Goal] = []
        self.actions = Ros2Actions(self.bus, self.types, policy or Policy(), self.send_goal)

    def send_goal(self, name: str, action: CdrActionType, raw: bytes, ear: FarGoalEar) -> Callable[[], None]:
        assert (name, action.name) == ("/count", "own_msgs/action/Count")
        self.sent.append((raw, ear))

        def cancel() -> None:
            self.num_cancels += 1

        return cancel

    def report(self, raw: bytes) -> None:
        self.told.append(("feedback", raw))

    def end(self, status: int, raw: bytes) -> None:
        self.told.append(("end", status, raw))

    def send(self, caller: Somebody) -> Goal | None:
        return self.bus.actions.send(caller, "/count", {"to": 3}, self.outcomes.append, self.feedback.append)

    def cdr(self, part: str, **fields: object) -> bytes:
        found = getattr(self.types.find_action(COUNT), part)
        return bytes(found.encode(Message(found.type, found.type.check(fields, 0))))

    def provide(self) -> Somebody:
        owner = Somebody()
        self.bus.actions.provide(owner, "/count", COUNT, self.taken.append, lambda _goal: None)
        return owner


@pytest.fixture
def far() -> ActionsInMemory:
    """A bus with an action of a node."""
    one = ActionsInMemory()
    one.actions.set_foreign([FarService("/count", COUNT, "/robot")])
    return one


def test_a_goal_reaches_a_node_and_feedback_and_result_come_back(far: ActionsInMemory) -> None:
    far.send(Somebody())
    ((raw, ear),) = far.sent
    assert raw == far.cdr("goal", to=3)
    ear.report(far.cdr("feedback", now=1), 0.0)
    ear.report(b"", 0.0)
    ear.end(4, far.cdr("result", counted=[1, 2, 3]))
    assert [one.json for one in far.feedback] == [b'{"now":1}']
    (outcome,) = far.outcomes
    assert isinstance(outcome.values, Message)
    assert (outcome.is_ok, outcome.status, outcome.values.json) == (True, 4, b'{"counted":[1,2,3]}')


def test_goals_fail_that_a_node_rejects_or_answers_with_rubbish_or_leaves(far: ActionsInMemory) -> None:
    for end in (lambda ear: ear.reject("no"), lambda ear: ear.end(4, b"\0"), lambda _ear: far.actions.set_foreign([])):
        far.send(Somebody())
        end(far.sent[-1][1])
    assert [outcome.is_ok for outcome in far.outcomes] == [False] * 3
    assert far.outcomes[0].values == "no"
    assert far.outcomes[2].values == "Action /count was unadvertised"


def test_a_client_that_leaves_cancels_its_goals(far: ActionsInMemory) -> None:
    client = Somebody()
    goal = far.send(client)
    assert goal is not None
    goal.cancel()
    assert far.num_cancels == 1
    far.bus.leave(client, 0.0)
    assert far.num_cancels == 2
    far.sent[0][1].end(5, far.cdr("result"))
    assert far.outcomes == []


def test_a_node_s_goal_is_carried_out_by_the_bus() -> None:
    one = ActionsInMemory()
    one.provide()
    assert list(one.actions.offered()) == ["/count"]
    assert one.actions.send("/count", one.cdr("goal", to=3), one) is not None
    (goal,) = one.taken
    types = goal.action.type
    goal.report(types.feedback.struct_type(now=2), 0.0)
    goal.end(4, types.result.check({"counted": [1]}, 0))
    assert one.told == [("feedback", one.cdr("feedback", now=2)), ("end", 4, one.cdr("result", counted=[1]))]


def test_a_node_s_goal_is_aborted_when_its_provider_leaves() -> None:
    one = ActionsInMemory()
    owner = one.provide()
    one.actions.send("/count", one.cdr("goal"), one)
    one.bus.leave(owner, 0.0)
    assert one.told == [("end", 6, one.cdr("result"))]


def test_goals_of_nodes_beyond_the_limit_and_those_that_are_none_are_rejected_and_told() -> None:
    one = ActionsInMemory()
    one.provide()
    one.actions.send("/count", one.cdr("goal"), one)
    assert one.actions.send("/count", one.cdr("goal"), one) is None
    assert one.actions.send("/count", b"", one) is None
    assert one.actions.send("/nothing", one.cdr("goal"), one) is None
    assert one.told == []
    assert [refusal.op for refusal in one.refusals] == ["send_action_goal"] * 3


def test_what_is_denied_passes_in_neither_direction(caplog: pytest.LogCaptureFixture) -> None:
    one = ActionsInMemory(Policy(service=Rule(deny=("/count",))))
    with caplog.at_level(logging.INFO):
        one.actions.set_foreign([FarService("/count", COUNT)])
    assert one.actions.foreign == {}
    assert "action /count of ROS 2 cannot be used: Not allowed to offer /count" in caplog.text
    one.provide()
    assert one.actions.offered() == {}
    assert one.actions.send("/count", one.cdr("goal"), one) is None
    assert one.taken == []


def test_an_action_of_the_bus_wins_over_that_of_a_node(far: ActionsInMemory) -> None:
    owner = far.provide()
    assert far.actions.foreign == {}
    far.actions.set_foreign([FarService("/count", COUNT)])
    assert far.bus.actions.by_name["/count"].owner is owner
    far.bus.leave(owner, 0.0)
    far.actions.set_foreign([FarService("/count", COUNT, "/robot")])
    assert list(far.actions.nodes("any", "")) == ["/robot"]
    far.actions.leave(0.0)
    assert far.bus.actions.by_name == {}
