"""The five topics of a ROS 1 action (actionlib), served by an action of the bus: one provider serves both generations.

    <action>/goal      from clients: pkg/<Type>ActionGoal
    <action>/cancel    from clients: actionlib_msgs/GoalID
    <action>/status    all known goals, at each change and five times a second while there is a subscriber
    <action>/feedback  pkg/<Type>ActionFeedback, about all goals, to all subscribers
    <action>/result    pkg/<Type>ActionResult, about all goals, to all subscribers

Goals and cancels from these topics are passed to the bus's actions in the sender's name, so the usual limits apply, and
goals end when their client leaves. One thing differs from actionlib: a cancel without an id, or by time, affects only
the goals of the client that sends it, not those of all clients. (The client libraries call it "cancel all goals of this
client".)
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import msgspec

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.actions import Action, EndedGoals, Goal, GoalOutcome, GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.protocol.body_limits import BodyLimits
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType

STATUS_PERIOD = 0.2
"""Time between two status messages [s], as in actionlib. roslibpy gives up after 3 s without one."""

ENDED_GOAL_MEMORY = 5.0
"""Time for which an ended goal stays in the status [s], as in actionlib."""

MAX_GOAL_ID = 1_024
"""Longest id of a goal [characters]."""


class ActionlibStatus(IntEnum):
    """Numbers of actionlib_msgs/GoalStatus that are used here."""

    ACTIVE = 1
    PREEMPTED = 2
    SUCCEEDED = 3
    ABORTED = 4
    REJECTED = 5


_ENDS = {
    GoalStatus.SUCCEEDED: ActionlibStatus.SUCCEEDED,
    GoalStatus.CANCELED: ActionlibStatus.PREEMPTED,
}
"""Status of a goal that ended on the bus; every other end is ABORTED."""


@dataclass(eq=False, slots=True)
class _Tracked:
    """A goal as its client knows it.

    Attributes:
        goal_id: a struct of actionlib_msgs/GoalID.
        goal: the goal on the bus; None until it exists.
        text: reason of its end.
    """

    goal_id: Any
    sender: Participant
    goal: Goal | None = None
    status: ActionlibStatus = ActionlibStatus.ACTIVE
    text: str = ""


class Actionlib:
    """The topics of one action, published in the name of the action's owner."""

    def __init__(self, bus: Bus, action: Action) -> None:
        """Advertise and subscribe for the whole run.

        Raises:
            GraphError: a topic already has another type.
        """
        self._bus = bus
        self._action = action
        self._owner = owner = action.owner
        self._now = 0.0
        self._num_ids = 0
        self._tracked: dict[str, _Tracked] = {}
        self._ended = EndedGoals[_Tracked](ENDED_GOAL_MEMORY)
        self._status_due = 0.0
        store = bus.store
        self._header = store.message("std_msgs/Header")
        self._goal_id = store.message("actionlib_msgs/GoalID")
        self._goal_status = store.message("actionlib_msgs/GoalStatus")

        def advertise(name: str, type_name: str) -> tuple[Topic, MessageType]:
            topic = bus.advertise(owner, f"{action.name}/{name}", type_name, is_exclusive=True)
            return topic, store.message(type_name)

        self._feedback, self._feedback_type = advertise("feedback", f"{action.type.name}ActionFeedback")
        self._result, self._result_type = advertise("result", f"{action.type.name}ActionResult")
        self._status, self._status_type = advertise("status", "actionlib_msgs/GoalStatusArray")
        for name, deliver, type_name in (
            ("goal", self._receive_goal, f"{action.type.name}ActionGoal"),
            ("cancel", self._receive_cancel, "actionlib_msgs/GoalID"),
        ):
            bus.subscribe(owner, f"{action.name}/{name}", deliver, type_name=type_name, limits=BodyLimits())
        bus.on_leave.append(self._on_leave)
        bus.on_topic.append(self._note_listener)

    def close(self) -> None:
        """Follow the bus no more; its owner has left."""
        self._bus.on_leave.remove(self._on_leave)
        self._bus.on_topic.remove(self._note_listener)

    # Time

    def _note_listener(self, topic: Topic) -> None:
        """Announce the status when it gets a subscriber."""
        if topic is self._status:
            self._bus.agenda.announce(self.next_due())

    def next_due(self) -> float | None:
        """Return when `advance` has something to do next [s]; None while the status has no subscriber."""
        return self._status_due if self._status.has_listener else None

    def advance(self, now: float) -> None:
        """Publish the status if it is due."""
        self._now = now
        if now >= self._status_due:
            self._publish_status(now)

    # From clients

    def _receive_goal(self, _topic: Topic, message: Message, sender: Participant, now: float) -> None:
        """Start a goal. Its sender is told about a mistake, both in the result and by the error."""
        self._now = now
        goal_id = self._complete(message.value.goal_id)
        key = goal_id.id
        if len(key) > MAX_GOAL_ID:
            raise GraphError(f"The id of a goal has at most {MAX_GOAL_ID} characters")
        if key in self._tracked or any(tracked.goal_id.id == key for tracked in self._ended.recent(now)):
            sender.notify("warning", f"Goal {key} of {self._action.name} is known already")
            return
        tracked = self._tracked[key] = _Tracked(goal_id, sender)

        def on_feedback(values: Message) -> None:
            self._publish(
                self._feedback,
                self._feedback_type.struct_type(
                    header=self._stamped(), status=self._describe(tracked), feedback=values.value
                ),
            )

        def on_outcome(outcome: GoalOutcome) -> None:
            if isinstance(outcome.values, Message):
                status = _ENDS.get(GoalStatus(outcome.status), ActionlibStatus.ABORTED)
                self._end(tracked, status, "", outcome.values.value)
            else:
                self._end(
                    tracked, ActionlibStatus.ABORTED if tracked.goal else ActionlibStatus.REJECTED, outcome.values
                )

        args = Message(self._action.type.goal, message.value.goal)
        tracked.goal = self._bus.actions.send(sender, self._action.name, args, on_outcome, on_feedback)
        if tracked.status is ActionlibStatus.REJECTED:
            raise GraphError(f"Goal {key} of {self._action.name} was rejected: {tracked.text}")
        if key in self._tracked:
            self._publish_status(now)

    def _receive_cancel(self, _topic: Topic, message: Message, sender: Participant, now: float) -> None:
        """Cancel the goal with the given id, all goals of the sender, or its goals up to a time."""
        self._now = now
        key, stamp = message.value.id, msgspec.structs.astuple(message.value.stamp)
        is_by_time = any(stamp)
        for tracked in list(self._tracked.values()):
            is_own = tracked.sender is sender
            is_meant = (
                tracked.goal_id.id == key
                or (is_own and not key and not is_by_time)
                or (is_own and is_by_time and msgspec.structs.astuple(tracked.goal_id.stamp) <= stamp)
            )
            if is_meant and tracked.goal is not None:
                tracked.goal.cancel()

    def _on_leave(self, owner: Participant, now: float) -> None:
        """End the goals of an owner that has left. The bus has already cancelled its active goals."""
        self._now = now
        for tracked in list(self._tracked.values()):
            if tracked.sender is owner:
                self._end(tracked, ActionlibStatus.PREEMPTED, "its client has left")

    # To clients

    def _end(self, tracked: _Tracked, status: ActionlibStatus, text: str, values: object = None) -> None:
        """Record and publish the end of a goal. Without `values` the result is empty."""
        if self._tracked.pop(tracked.goal_id.id, None) is None:
            return
        tracked.status, tracked.text = status, text
        self._ended.add(tracked, self._now)
        result = self._action.type.result.default() if values is None else values
        self._publish(
            self._result,
            self._result_type.struct_type(header=self._stamped(), status=self._describe(tracked), result=result),
        )
        self._publish_status(self._now)

    def _publish_status(self, now: float) -> None:
        self._status_due = now + STATUS_PERIOD
        if not self._status.has_listener:
            return
        known = [self._describe(tracked) for tracked in (*self._ended.recent(now), *self._tracked.values())]
        self._publish(self._status, self._status_type.struct_type(header=self._stamped(), status_list=known))

    def _publish(self, topic: Topic, value: msgspec.Struct) -> None:
        if topic.has_listener:
            self._bus.announce(self._owner, topic, Message(topic.type, value), self._now)

    def _complete(self, goal_id: Struct) -> Struct:
        """Return a goal's id with the fields filled in that its client left empty."""
        key, stamp = goal_id.id, goal_id.stamp
        if not any(msgspec.structs.astuple(stamp)):
            stamp = self._bus.store.time_value(self._bus.stamp_ns)
        if not key:
            self._num_ids += 1
            key = f"{self._action.name}-{self._num_ids}"
        return self._goal_id.struct_type(stamp=stamp, id=key)

    def _describe(self, tracked: _Tracked) -> msgspec.Struct:
        """Return its actionlib_msgs/GoalStatus."""
        return self._goal_status.struct_type(goal_id=tracked.goal_id, status=int(tracked.status), text=tracked.text)

    def _stamped(self) -> msgspec.Struct:
        """Return a header with the current time."""
        return self._header.struct_type(stamp=self._bus.store.time_value(self._bus.stamp_ns))
