"""Goals: long requests with feedback that can be cancelled; the third kind of communication on the bus.

Like a call, a goal ends exactly once: with the provider's result, or because the caller or the provider is gone. A
cancel goes to the provider at once and never waits behind the goal; it is only a request, and the provider still ends
the goal. If the *caller* leaves, its goals are cancelled, and their results are discarded. If the *provider* leaves,
its goals fail at once.
Each action also has the service `<action>/_action/cancel_goal`, by which ROS 2 cancels goals of all callers; roslib's
`cancelAllGoals` calls it. A goal has the UUID that its caller chose, or else its number. `action_topics.py` adds the
topics by which ROS 2 tells of goals.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Final, Generic, Protocol, TypeVar

import msgspec

from rosbridge_sim.errors import EncodingError, GraphError, PeerError, Reason
from rosbridge_sim.graph.bus_state import BusState
from rosbridge_sim.graph.participant import Participant, decode_body, resolve, size_of_body, take_over
from rosbridge_sim.graph.service_table import ServiceTable
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.graph.type_resolution import TypeResolver
from rosbridge_sim.protocol.body_limits import BodyLimits
from rosbridge_sim.protocol.ops import OpBody
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import ActionType
from rosbridge_sim.schema.opaque_types import OpaqueActionType

HIDDEN: Final = "/_action/"
"""Text between the name of an action and the names of its topics and services in ROS 2."""

CANCEL: Final = f"{HIDDEN}cancel_goal"
"""Suffix of the service that cancels goals of an action."""

_NO_ERROR, _REJECTED, _UNKNOWN_GOAL, _TERMINATED = range(4)
"""`return_code` of action_msgs/CancelGoal."""

MAX_ENDED: Final = 100
"""Ended goals of an action that are remembered."""

ENDED_GOAL_MEMORY_NS: Final = 10 * 10**9
"""Time for which an ended goal is remembered [ns]: `result_timeout` of an action server of rcl, by default."""


class GoalStatus(IntEnum):
    """Numbers of action_msgs/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


_ENDS: Final = frozenset({GoalStatus.SUCCEEDED, GoalStatus.CANCELED, GoalStatus.ABORTED})
"""Status of a goal that has ended. rosbridge_suite aborts a goal for which its provider gives another one."""


@dataclass(frozen=True, slots=True)
class GoalOutcome:
    """The end of a goal.

    Attributes:
        is_ok: `result` on the wire: the provider ended the goal, with success or not.
        status: status at the end; UNKNOWN if the provider never got the goal.
        values: the result if `is_ok`, else a text with the reason.
        reason: kind of mistake, if the caller made one.
    """

    is_ok: bool
    status: int
    values: Message | str
    reason: Reason | None = field(default=None, compare=False)


G = TypeVar("G")


class EndedGoals(Generic[G]):
    """The goals of one action that have ended a short time ago, oldest first; at most `MAX_ENDED`."""

    def __init__(self, memory: float) -> None:
        """Create an empty list.

        Args:
            memory: time for which a goal stays, in the unit of the times below.
        """
        self._memory = memory
        self._ended: deque[tuple[float, G]] = deque(maxlen=MAX_ENDED)

    def add(self, goal: G, now: float) -> None:
        """Add a goal that ends now."""
        self._ended.append((now, goal))

    def recent(self, now: float) -> list[G]:
        """Return the goals, and forget those before. A time that was set back, as by a reset, forgets those after."""
        while self._ended and not 0 <= now - self._ended[0][0] < self._memory:
            self._ended.popleft()
        return [goal for _, goal in self._ended]


@dataclass(frozen=True, slots=True)
class EndedGoal:
    """Record of an ended goal; `uuid` and `stamp_ns` are those of the `Goal`."""

    uuid: bytes
    stamp_ns: int
    status: GoalStatus


OnFeedback = Callable[[Message], None]
OnOutcome = Callable[[GoalOutcome], None]


_LIMITS: Final = BodyLimits()
"""Of a goal of an action of this server's own."""


@dataclass(eq=False, slots=True)
class Action:
    """A named action and its provider. If it is exclusive, no client may take its name.

    Attributes:
        ended: its last goals; rejected ones are not among them.
        has_had_goals: it has accepted one.
    """

    name: str
    type: ActionType | OpaqueActionType
    owner: Participant
    take: Callable[[Goal], None]
    cancel: Callable[[Goal], None]
    is_exclusive: bool = False
    goals: dict[Goal, None] = field(default_factory=dict)
    ended: EndedGoals[EndedGoal] = field(default_factory=lambda: EndedGoals(ENDED_GOAL_MEMORY_NS))
    has_had_goals: bool = False


@dataclass(eq=False, slots=True)
class Goal:
    """One goal, from its request to its end.

    Attributes:
        request: a struct of the action's goal type; None after the end, as for a `Call`.
        uuid: 16 bytes, which no other goal of the action in progress has.
        stamp_ns: time of its acceptance, as headers have it [ns].
        is_done: it has ended or was given up; later input is ignored.
        is_canceling: its provider was asked to cancel it.
    """

    action: Action
    caller: Participant
    request: object
    on_outcome: OnOutcome
    on_feedback: OnFeedback | None
    actions: Actions
    uuid: bytes
    stamp_ns: int
    is_done: bool = False
    is_canceling: bool = False
    num_bytes: int = 0

    @property
    def status(self) -> GoalStatus:
        """Its status in progress; a goal is accepted and executed at once."""
        return GoalStatus.CANCELING if self.is_canceling else GoalStatus.EXECUTING

    def report(self, values: object, now: float) -> None:
        """Send feedback to the caller, and to subscribers of the topic for it.

        Args:
            values: a struct of the action's feedback type.
        """
        if not self.is_done:
            self.actions.hand_feedback(self, Message(self.action.type.feedback, values), now)

    def end(self, status: int, values: object) -> None:
        """End the goal with a result.

        Args:
            status: number of action_msgs/GoalStatus.
            values: a struct of the action's result type.
        """
        outcome = GoalOutcome(is_ok=True, status=status, values=Message(self.action.type.result, values))
        self._end(outcome, GoalStatus(status) if status in _ENDS else GoalStatus.ABORTED)

    def fail(self, why: str, *, is_rejected: bool = False) -> None:
        """End a goal for which the provider gives no result.

        Args:
            why: reason, for the caller.
            is_rejected: the provider has not accepted it.
        """
        outcome = GoalOutcome(is_ok=False, status=GoalStatus.UNKNOWN, values=why)
        self._end(outcome, None if is_rejected else GoalStatus.ABORTED)

    def cancel(self) -> None:
        """Ask the provider to end the goal soon."""
        if not self.is_done:
            self.actions.ask_to_cancel(self)

    def abandon(self) -> None:
        """Ask the provider to end a goal whose caller is gone. The result is discarded."""
        if not self.is_done:
            self._end(None, GoalStatus.CANCELED)
            self.actions.ask_to_cancel(self)

    def _end(self, outcome: GoalOutcome | None, status: GoalStatus | None) -> None:
        if self.is_done:
            return
        self.is_done = True
        self.request = None
        self.action.goals.pop(self, None)
        self.actions.forget(self, status)
        if outcome is not None:
            self.actions.hand_over(self, outcome)


class GoalTopics(Protocol):
    """The topics by which subscribers are told about the goals of all actions."""

    @property
    def is_due(self) -> bool:
        """True if `advance` has something to publish."""

    def advance(self, now: float) -> None:
        """Publish the changes of goals."""

    def begin(self, action: Action) -> None:
        """Offer the topics of a new action."""

    def end(self, action: Action) -> None:
        """Withdraw them."""

    def note_change(self, action: Action) -> None:
        """Note that the status of a goal has changed."""

    def report(self, goal: Goal, values: Message, now: float) -> None:
        """Publish feedback for a goal."""


class Actions:
    """The actions of one bus.

    Attributes:
        by_name: all actions, by absolute name.
        max_goals: goals that one caller may have in progress.
        topics: tells subscribers about goals; None under ROS 1.
    """

    def __init__(self, state: BusState, types: TypeResolver, services: ServiceTable, max_goals: int) -> None:
        """Create an empty table.

        Args:
            state: shared with the other parts of the bus.
            services: takes the services that cancel goals.
            max_goals: goals that one caller may have in progress.
        """
        self._state = state
        self._types = types
        self._services = services
        self.max_goals = max_goals
        self.by_name: dict[str, Action] = {}
        self.topics: GoalTopics | None = None
        self._num_goals = 0
        self._goals: dict[Participant, dict[Goal, None]] = {}
        self._provided: dict[Participant, dict[Action, None]] = {}

    def provide(
        self,
        owner: Participant,
        name: str,
        type_name: str,
        take: Callable[[Goal], None],
        cancel: Callable[[Goal], None],
        *,
        is_exclusive: bool = False,
    ) -> Action:
        """Offer an action. The last owner to offer a name gets it.

        Args:
            name: name of the action; may be relative.
            take: gets each goal; a PeerError that it raises fails the goal.
            cancel: gets each goal that should be cancelled.
            is_exclusive: no client may take the name, neither now nor later.

        Raises:
            GraphError: another owner has the action, or its service for cancelling, exclusively.
            TypeNameError: the type does not exist.
        """
        name = resolve(name)
        action = Action(name, self._types.action(type_name), owner, take, cancel, is_exclusive)
        old = self.by_name.get(name)
        self._check_cancel(name, owner, old)
        if old is not None and old.owner is not owner:
            if old.is_exclusive and not old.owner.gives_way(owner):
                raise GraphError(f"Action {name} is provided by {old.owner.name} alone", reason=Reason.NAME_TAKEN)
            owner.notify("warning", f"Duplicate action advertised. Overwriting {name}.")
            self._state.guard.attempt("the loss of an action", take_over, old.owner, "action", name, owner)
        if old is not None:
            self._drop(old, f"Action {name} was unadvertised")
        self._services.provide(
            *(owner, name + CANCEL, "action_msgs/CancelGoal", lambda call, _: self._cancel(action, call)),
            is_exclusive=True,
        )
        self.by_name[name] = action
        self._provided.setdefault(owner, {})[action] = None
        if self.topics is not None:
            self.topics.begin(action)
        return action

    def withdraw(self, owner: Participant, name: str) -> None:
        """Stop offering an action.

        Args:
            name: name of the action; may be relative.

        Raises:
            GraphError: `owner` does not offer it.
        """
        action = self.by_name.get(resolve(name))
        if action is None or action.owner is not owner:
            text = f"Action {name} has not been advertised via rosbridge, can't unadvertise."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        self._drop(action, f"Action {action.name} was unadvertised")

    def send(
        self,
        caller: Participant,
        name: str,
        args: OpBody | Message,
        on_outcome: OnOutcome,
        on_feedback: OnFeedback | None,
        *,
        uuid: bytes = b"",
    ) -> Goal | None:
        """Send a goal. `on_outcome` is called exactly once, unless the caller leaves first.

        Args:
            name: name of the action; may be relative.
            args: fields by name, by position, or none; or a goal message that is already checked.
            on_outcome: gets the end.
            on_feedback: gets feedback; None if none is wanted.
            uuid: 16 bytes by which the goal can be cancelled; others are made if there are none or a goal has them.

        Returns:
            The goal; None if it has already ended.
        """
        try:
            action = self.by_name.get(resolve(name))
            if action is None:
                raise GraphError(f"Action {name} does not exist", reason=Reason.NO_SUCH_ACTION)
            if isinstance(args, Message):
                request = args.value
            else:
                if action.is_exclusive:
                    _LIMITS.check(action.name, args)
                request = decode_body(action.type.goal, args, self._state.stamp_ns, caller)
            held = self._goals.setdefault(caller, {})
            if len(held) >= self.max_goals:
                raise GraphError(f"Too many goals under way: at most {self.max_goals}", reason=Reason.TOO_MUCH)
            size = size_of_body(request, args)
            if size and not self._state.account_of(caller).take(size):
                text = "Too much under way: this client makes the server hold too much"
                raise GraphError(text, reason=Reason.TOO_MUCH)
        except PeerError as error:
            on_outcome(GoalOutcome(is_ok=False, status=GoalStatus.UNKNOWN, values=str(error), reason=error.reason))
            return None
        uuid = self._free_uuid(action, uuid)
        stamp_ns = self._state.stamp_ns
        goal = Goal(action, caller, request, on_outcome, on_feedback, self, uuid, stamp_ns, num_bytes=size)
        action.goals[goal] = None
        held[goal] = None
        try:
            action.take(goal)
            self._note_change(action)
        except PeerError as error:
            if isinstance(error, EncodingError):
                self._state.guard.note_encoding(action.name, error)
            goal.fail(str(error), is_rejected=True)
        except Exception as error:  # noqa: BLE001 - an internal error in the provider's own state
            goal.fail("The provider failed; the server's log says why")
            self._state.guard.blame(action.owner, error)
        return None if goal.is_done else goal

    def _free_uuid(self, action: Action, uuid: bytes) -> bytes:
        """Return the bytes if no goal of the action in progress has them; else the next number that none has."""
        while not any(uuid) or any(goal.uuid == uuid for goal in action.goals):
            self._num_goals += 1
            uuid = self._num_goals.to_bytes(16, "big")
        return uuid

    def forget(self, goal: Goal, status: GoalStatus | None) -> None:
        """Remove an ended goal from its caller's list (for `Goal` alone).

        Args:
            status: its status at the end; None if it was rejected.
        """
        if status is not None:
            goal.action.ended.add(EndedGoal(goal.uuid, goal.stamp_ns, status), self._state.stamp_ns)
            self._note_change(goal.action)
        if goal.num_bytes:
            self._state.account_of(goal.caller).give(goal.num_bytes)
        held = self._goals.get(goal.caller)
        if held is not None:
            held.pop(goal, None)
            if not held:
                del self._goals[goal.caller]

    def hand_feedback(self, goal: Goal, values: Message, now: float) -> None:
        """Give feedback to a goal's caller, if it wants any, and to all subscribers (for `Goal` alone)."""
        if self.topics is not None:
            self.topics.report(goal, values, now)
        try:
            if goal.on_feedback is not None:
                goal.on_feedback(values)
        except EncodingError as error:
            self._note_encoding(goal.action, error)
        except Exception as error:  # noqa: BLE001 - an internal error in the caller's own state
            self._state.guard.contain(goal.caller, error)

    def hand_over(self, goal: Goal, outcome: GoalOutcome) -> None:
        """Give a goal's end to its caller (for `Goal` alone). If it cannot be encoded, the goal fails."""
        try:
            goal.on_outcome(outcome)
        except Exception as error:  # noqa: BLE001 - as above
            if isinstance(error, EncodingError) and outcome.is_ok:
                self._note_encoding(goal.action, error)
                self.hand_over(goal, GoalOutcome(is_ok=False, status=GoalStatus.UNKNOWN, values=str(error)))
            else:
                self._state.guard.contain(goal.caller, error)

    def ask_to_cancel(self, goal: Goal) -> None:
        """Ask a goal's provider to cancel it (for `Goal` alone)."""
        goal.is_canceling = True
        self._note_change(goal.action)
        try:
            goal.action.cancel(goal)
        except Exception as error:  # noqa: BLE001 - an internal error in the provider's own state
            self._state.guard.contain(goal.action.owner, error)

    def leave(self, owner: Participant) -> None:
        """Cancel the goals that an owner sent, and fail the goals that were sent to it."""
        attempt = self._state.guard.attempt
        for goal in list(self._goals.pop(owner, ())):
            attempt("the end of a goal", goal.abandon)
        for action in list(self._provided.get(owner, ())):
            why = f"Action {action.name} was unadvertised: its provider disconnected"
            attempt("the end of an action", self._drop, action, why)

    def _note_encoding(self, action: Action, error: EncodingError) -> None:
        """Log that a message of an action cannot be encoded, and tell its provider."""
        guard = self._state.guard
        guard.note_encoding(action.name, error)
        guard.attempt("a remark to a provider", action.owner.notify, "error", f"{action.name}: {error}")

    def _cancel(self, action: Action, call: Call) -> None:
        """Answer a call of the service for cancelling, by the rules of action_msgs/CancelGoal.

        Without an id and a stamp all goals are meant; otherwise the one with the id, and those up to the stamp.
        """
        request: Any = call.request
        info = request.goal_info
        wanted = bytes(info.goal_id.uuid)
        seconds, nanoseconds = msgspec.structs.astuple(info.stamp)
        stamp_ns = seconds * 10**9 + nanoseconds
        has_id = any(wanted)
        is_all = not has_id and not stamp_ns
        meant = [
            goal
            for goal in action.goals
            if is_all or (has_id and goal.uuid == wanted) or (stamp_ns and goal.stamp_ns <= stamp_ns)
        ]
        goals = [goal for goal in meant if not goal.is_canceling]
        code = _NO_ERROR if goals else _REJECTED
        if has_id and not meant:
            is_ended = any(goal.uuid == wanted for goal in action.ended.recent(self._state.stamp_ns))
            code = _TERMINATED if is_ended else _UNKNOWN_GOAL
        time_value = self._state.store.time_value
        infos = [type(info)(type(info.goal_id)(goal.uuid), time_value(goal.stamp_ns)) for goal in goals]
        call.respond(code, infos)
        for goal in goals:
            goal.cancel()

    def _check_cancel(self, name: str, owner: Participant, old: Action | None) -> None:
        """Raise GraphError if a third owner has the action's service for cancelling exclusively."""
        service = self._services.by_name.get(name + CANCEL)
        if service is None or not service.is_exclusive or service.owner is owner or service.owner.gives_way(owner):
            return
        if old is None or service.owner is not old.owner:
            raise GraphError(
                f"Service {service.name} is provided by {service.owner.name} alone", reason=Reason.NAME_TAKEN
            )

    def _note_change(self, action: Action) -> None:
        """Announce to subscribers that the status of a goal has changed."""
        action.has_had_goals = True
        if self.topics is not None:
            self.topics.note_change(action)

    def _drop(self, action: Action, why: str) -> None:
        provided = self._provided.get(action.owner, {})
        provided.pop(action, None)
        if not provided:
            self._provided.pop(action.owner, None)
        if self.by_name.get(action.name) is action:
            del self.by_name[action.name]
            with suppress(GraphError):  # the provider may have withdrawn it itself
                self._services.withdraw(action.owner, action.name + CANCEL)
        for goal in list(action.goals):
            goal.fail(why)
        if self.topics is not None:
            self.topics.end(action)
