"""Actions across the graph of ROS 2: those of the bus for nodes there, and those of nodes for the bus.

ROS 1 has no such part: its actions are topics.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import Final, Protocol

from rosbridge_sim.errors import PeerError, Reason
from rosbridge_sim.graph.actions import Goal, GoalOutcome, GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarService
from rosbridge_sim.graph.gateway.far_offers import FarOffers
from rosbridge_sim.graph.participant import NodeRole
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.ros2.cdr_types import CdrActionType, CdrTypes
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.schema.message import Message

MAX_ACTIONS: Final = 1_000
"""Most actions in each direction; each has three services and two topics on the graph."""

_log = logging.getLogger(ROS2_GRAPH.logger)


class FarGoalEar:
    """Takes the progress of a goal that a node carries out."""

    def __init__(self, goal: Goal, action: CdrActionType, bus: Bus) -> None:
        self.goal = goal
        self._action = action
        self._bus = bus

    def reject(self, why: str) -> None:
        """The node has not accepted the goal, or it could not be sent."""
        self.goal.fail(why, is_rejected=True)

    def report(self, raw: bytes, now: float) -> None:
        """Pass on feedback; feedback that is none is dropped."""
        try:
            values = self._action.feedback.decode(raw, self._bus.stamp_ns)
        except PeerError as error:
            _log.info("feedback of %s is dropped: %s", self.goal.action.name, error)
            return
        self.goal.report(values, now)

    def end(self, status: int, raw: bytes) -> None:
        """End the goal with its result."""
        try:
            values = self._action.result.decode(raw, self._bus.stamp_ns)
        except PeerError as error:
            self.goal.fail(str(error))
            return
        self.goal.end(status, values)


SendGoal = Callable[[str, CdrActionType, bytes, FarGoalEar], Callable[[], None]]
"""`(name, action, goal, ear)`: send a goal in CDR to an action that a node provides, by its name on the bus. The ear is
told of its progress, in the loop. What it returns asks the node to cancel the goal."""


class NodeGoalEar(Protocol):
    """A goal of a node for an action of the bus; told by the bus."""

    def report(self, raw: bytes) -> None:
        """Take feedback in CDR."""

    def end(self, status: int, raw: bytes) -> None:
        """Take the status at the end and the result in CDR."""


class Ros2Actions(FarOffers[CdrActionType]):
    """The actions that pass, in both directions."""

    kind = "action"
    op = "send_action_goal"
    most = MAX_ACTIONS
    missing = Reason.NO_SUCH_ACTION

    def __init__(self, bus: Bus, types: CdrTypes, policy: Policy, send_goal: SendGoal) -> None:
        """Offer nothing yet.

        Args:
            bus: our bus.
            types: its types as nodes know them.
            policy: rights of all clients.
            send_goal: sends goals to nodes.
        """
        super().__init__(ROS2_GRAPH, bus, types.find_action, policy)
        self._known = bus.actions.by_name
        self._check_use = policy.check_goal
        self._send_goal = send_goal
        self._cancels: dict[Goal, Callable[[], None]] = {}

    def nodes(self, role: NodeRole, name: str) -> Iterable[str]:
        """See `Participant`."""
        return {one.node or self.name for one in self.foreign.values() if role == "any" or name.startswith(one.name)}

    # Actions of the bus, for nodes

    def send(self, name: str, raw: bytes, ear: NodeGoalEar) -> Goal | None:
        """Send a goal of a node to an action of the bus.

        Args:
            name: name of the action.
            raw: the goal in CDR.
            ear: is told of its progress, but not if it is rejected.

        Returns:
            The goal; None if it is rejected.
        """
        is_accepted = False

        def on_outcome(outcome: GoalOutcome) -> None:
            if outcome.is_ok and isinstance(outcome.values, Message):
                ear.end(outcome.status, action.result.encode(outcome.values))
            elif is_accepted:
                self._log.tell(f"a goal of a node for {name} is aborted: {outcome.values}", logging.INFO)
                default = action.result.type.default()
                ear.end(GoalStatus.ABORTED, action.result.encode(Message(action.result.type, default)))
            else:
                self._reject(name, outcome.reason, str(outcome.values))

        try:
            action = self.find(name)
            value = action.goal.decode(raw, self._bus.stamp_ns)
        except PeerError as error:
            self._reject(name, error.reason, str(error))
            return None
        request = Message(action.goal.type, value)
        goal = self._bus.actions.send(
            self, name, request, on_outcome, lambda values: ear.report(action.feedback.encode(values))
        )
        is_accepted = goal is not None
        return goal

    def _reject(self, name: str, reason: Reason | None, text: str) -> None:
        self._report(name, reason, text)
        self._log.tell(f"a goal of a node is rejected: {text}", logging.INFO)

    # Actions of nodes, for the bus

    def _provide(self, one: FarService, action: CdrActionType) -> None:
        self._bus.actions.provide(self, one.name, one.type_name, partial(self._take, one.name, action), self._cancel)

    def _withdraw(self, name: str) -> None:
        self._bus.actions.withdraw(self, name)

    def _take(self, name: str, action: CdrActionType, goal: Goal) -> None:
        for one in [one for one in self._cancels if one.is_done and one is not goal]:
            del self._cancels[one]
        raw = action.goal.encode(Message(action.goal.type, goal.request))
        self._cancels[goal] = self._send_goal(name, action, raw, FarGoalEar(goal, action, self._bus))

    def _cancel(self, goal: Goal) -> None:
        """Ask the node to cancel a goal, or to end one whose client has left."""
        cancel = self._cancels.get(goal)
        if cancel is not None:
            cancel()
