"""Actions across the graph of ROS 2: those of the bus for nodes there, and those of nodes for the bus.

ROS 1 has no such part: its actions are topics.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import Final, Protocol

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import HIDDEN, Goal, GoalOutcome, GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarService
from rosbridge_sim.graph.gateway.sentences import name_some
from rosbridge_sim.graph.participant import NodeRole, OfferKind, Participant, is_guest
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.ros2.cdr_types import CdrActionType, CdrTypes
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.schema.message import Message

MAX_ACTIONS: Final = 1_000
"""Most actions in each direction; each has three services and two topics on the graph."""

MAX_LINES: Final = 200
"""Most lines of the log that are written once each."""

_log = logging.getLogger(ROS2_GRAPH.logger)


class FarGoals(Protocol):
    """Goals for actions that nodes provide, which `shell/` sends."""

    def send_goal(self, name: str, action: CdrActionType, raw: bytes, ear: FarGoalEar) -> Callable[[], None]:
        """Send a goal.

        Args:
            name: name of the action on the bus.
            action: its type.
            raw: the goal in CDR.
            ear: is told of its progress, in the loop.

        Returns:
            Asks the node to cancel the goal.
        """


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


class NodeGoalEar(Protocol):
    """A goal of a node for an action of the bus; told by the bus."""

    def report(self, raw: bytes) -> None:
        """Take feedback in CDR."""

    def end(self, status: int, raw: bytes) -> None:
        """Take the status at the end and the result in CDR."""


class Ros2Actions:
    """The actions that pass, in both directions.

    Attributes:
        name: stands for the name of a node in rosapi's lists.
        address: stands for the address of a client, in the log.
        foreign: actions of nodes that are on the bus now, by name.
    """

    name = ROS2_GRAPH.name
    address = ROS2_GRAPH.title

    def __init__(
        self,
        bus: Bus,
        types: CdrTypes,
        policy: Policy,
        far: FarGoals,
        *,
        is_offered: Callable[[str, Participant], bool] = lambda _name, _owner: True,
    ) -> None:
        """Offer nothing yet.

        Args:
            bus: our bus.
            types: its types as nodes know them.
            policy: rights of all clients.
            far: sends goals to nodes.
            is_offered: see `NodeServices`.
        """
        self.foreign: dict[str, FarService] = {}
        self._bus = bus
        self._types = types
        self._policy = policy
        self._far = far
        self._is_offered = is_offered
        self._cancels: dict[Goal, Callable[[], None]] = {}
        self._told: set[str] = set()

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus."""
        self._tell(text, logging.getLevelNamesMapping().get(level.upper(), logging.WARNING))

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Guest`: another participant provides it from now on."""
        self.foreign.pop(name, None)
        self._tell(f"{kind} {name}: {why}")

    def nodes(self, role: NodeRole, name: str) -> Iterable[str]:
        """See `Standing`."""
        return {one.node or self.name for one in self.foreign.values() if role == "any" or name.startswith(one.name)}

    def leave(self, now: float) -> None:
        """End all actions, and cancel all goals of nodes. A second call does nothing."""
        self._bus.leave(self, now)
        self.foreign.clear()

    # Actions of the bus, for nodes

    def offered(self) -> dict[str, CdrActionType]:
        """Return the actions that nodes may send goals to, by name, with their types."""
        found: dict[str, CdrActionType] = {}
        for name, action in self._bus.actions.by_name.items():
            if not self._may_offer(name, action.owner) or len(found) >= MAX_ACTIONS:
                continue
            try:
                found[name] = self._types.find_action(action.type.name)
            except PeerError as error:
                self._tell(f"action {name} does not pass: {error}", logging.INFO)
        return found

    def _may_offer(self, name: str, owner: Participant) -> bool:
        is_free = owner is not self and ROS2_GRAPH.is_name(name) and not name.startswith(ROS2_GRAPH.own_folders)
        return is_free and self._policy.may_send_goal(name) and self._is_offered(name, owner)

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
                self._tell(f"a goal of a node for {name} is aborted: {outcome.values}", logging.INFO)
                default = action.result.type.default()
                ear.end(GoalStatus.ABORTED, action.result.encode(Message(action.result.type, default)))
            else:
                self._refuse(name, outcome.reason, str(outcome.values))

        try:
            known = self._bus.actions.by_name.get(name)
            if known is None or not self._may_offer(name, known.owner):
                raise GraphError(f"action {name} is not offered to nodes", reason=Reason.NO_SUCH_ACTION)
            action = self._types.find_action(known.type.name)
            value = action.goal.decode(raw, self._bus.stamp_ns)
        except PeerError as error:
            self._refuse(name, error.reason, str(error))
            return None
        request = Message(action.goal.type, value)
        goal = self._bus.actions.send(
            self, name, request, on_outcome, lambda values: ear.report(action.feedback.encode(values))
        )
        is_accepted = goal is not None
        return goal

    def _refuse(self, name: str, reason: Reason | None, text: str) -> None:
        refusal = RefusedRequest(self.address, reason or Reason.REFUSED, "send_action_goal", name, text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)
        self._tell(f"a goal of a node is rejected: {text}", logging.INFO)

    # Actions of nodes, for the bus

    def set_foreign(self, found: Iterable[FarService]) -> None:
        """Offer on the bus what nodes provide, and end what they provide no more, whose goals fail.

        Args:
            found: all actions of nodes, in the form of services.
        """
        wanted = {one.name: one for one in found if ROS2_GRAPH.is_name(one.name) and HIDDEN not in one.name}
        for name in [name for name, one in self.foreign.items() if wanted.get(name) != one]:
            del self.foreign[name]
            self._bus.actions.withdraw(self, name)
        failed: dict[str, list[str]] = {}
        for name, one in wanted.items():
            if name in self.foreign or len(self.foreign) >= MAX_ACTIONS:
                continue
            try:
                self._provide(one)
            except PeerError as error:
                failed.setdefault(str(error), []).append(name)
                continue
            self.foreign[name] = one
        for why, names in failed.items():
            self._tell(f"action {name_some(names)} of ROS 2 cannot be used: {why}", logging.INFO)

    def _provide(self, one: FarService) -> None:
        """Offer one action on the bus.

        Raises:
            PeerError: it must not be offered, its type is not known here, or the bus has one of this name.
        """
        self._policy.check_offer(one.name)
        action = self._types.find_action(one.type_name)
        known = self._bus.actions.by_name.get(one.name)
        if known is not None and known.owner is not self:
            who = "a client of this server" if is_guest(known.owner) else known.owner.name
            raise GraphError(f"{who} provides an action of this name", reason=Reason.NAME_TAKEN)
        self._bus.actions.provide(self, one.name, one.type_name, partial(self._take, one.name, action), self._cancel)

    def _take(self, name: str, action: CdrActionType, goal: Goal) -> None:
        for one in [one for one in self._cancels if one.is_done and one is not goal]:
            del self._cancels[one]
        raw = action.goal.encode(Message(action.goal.type, goal.request))
        self._cancels[goal] = self._far.send_goal(name, action, raw, FarGoalEar(goal, action, self._bus))

    def _cancel(self, goal: Goal) -> None:
        """Ask the node to cancel a goal, or to end one whose client has left."""
        cancel = self._cancels.get(goal)
        if cancel is not None:
            cancel()

    def _tell(self, text: str, level: int = logging.WARNING) -> None:
        """Log a line once."""
        if text not in self._told and len(self._told) < MAX_LINES:
            self._told.add(text)
            _log.log(level, "%s", text)
