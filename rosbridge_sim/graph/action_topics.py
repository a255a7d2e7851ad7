"""The two topics by which ROS 2 tells subscribers about the goals of an action.

    <action>/_action/status     action_msgs/GoalStatusArray, latched: goals in progress, and those that have just ended
    <action>/_action/feedback   pkg/<Type>_FeedbackMessage, about all goals

They are those of rcl_action: the status is reliable and transient local with depth 1, an accepted goal is in it until
`result_timeout` (10 s) after its end, a rejected one never. Its stamps are the time at which goals were accepted, as
headers have it. A goal is executed as soon as it is accepted, so `STATUS_ACCEPTED` does not occur.
A status is made only for subscribers, at the end of the turn in which goals have changed. So it costs the same if a
client with a thousand goals leaves. As in ROS 2, it may leave out a state that lasted for less than that.
The owner of the action publishes. A topic that another publisher has with another type is left to it.
"""

from __future__ import annotations

from base64 import b64encode
from typing import Any, Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.actions import HIDDEN, Action, EndedGoal, Goal
from rosbridge_sim.graph.bus_state import BusState
from rosbridge_sim.graph.delivery import Delivery
from rosbridge_sim.graph.topic_table import TopicTable
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType

_STATUS: Final = f"{HIDDEN}status"
_FEEDBACK: Final = f"{HIDDEN}feedback"

MAX_TOLD: Final = 2_000
"""Goals and messages after which a turn publishes no further status; about 5 ms. The next turn goes on."""


class ActionTopics:
    """The topics of all actions of one bus; see `GoalTopics`."""

    def __init__(self, state: BusState, topics: TopicTable, delivery: Delivery) -> None:
        """Create topics for no action yet; the arguments are parts of the bus."""
        self._state = state
        self._topics = topics
        self._delivery = delivery
        self._status: dict[Action, Topic] = {}
        self._feedback: dict[Action, Topic] = {}
        self._by_topic: dict[Topic, Action] = {}  # of the topics of `_status`
        self._changed: dict[Action, None] = {}
        state.on_topic.append(self._latch)

    @property
    def is_due(self) -> bool:
        """See `GoalTopics`."""
        return bool(self._changed)

    def begin(self, action: Action) -> None:
        """See `GoalTopics`."""
        status = self._advertise(action, _STATUS, "action_msgs/GoalStatusArray", depth=1)
        if status is not None:
            self._status[action] = status
            self._by_topic[status] = action
        feedback = self._advertise(action, _FEEDBACK, f"{action.type.name}_FeedbackMessage")
        if feedback is not None:
            self._feedback[action] = feedback

    def end(self, action: Action) -> None:
        """See `GoalTopics`. The next provider may bring another type, so the topics' types are forgotten at once."""
        self._changed.pop(action, None)
        for topic in (self._status.pop(action, None), self._feedback.pop(action, None)):
            if topic is not None:
                self._by_topic.pop(topic, None)
                self._topics.unadvertise(action.owner, topic.name, 0.0, key=action)
                self._topics.forget_topic(topic.name)

    def note_change(self, action: Action) -> None:
        """See `GoalTopics`."""
        topic = self._status.get(action)
        if topic is not None and topic.has_listener:
            self._changed[action] = None
            self._state.agenda.announce(0.0)  # at once

    def report(self, goal: Goal, values: Message, now: float) -> None:
        """See `GoalTopics`."""
        topic = self._feedback.get(goal.action)
        if topic is not None and topic.has_listener:
            value = topic.type.struct_type(goal_id=self._goal_id(topic, goal.uuid), feedback=values.value)
            self._delivery.announce(goal.action.owner, topic, Message(topic.type, value), now)

    def advance(self, now: float) -> None:
        """See `GoalTopics`."""
        num_told = 0
        while self._changed and num_told < MAX_TOLD:
            action = next(iter(self._changed))
            del self._changed[action]
            topic = self._status[action]
            message = self._describe(action, topic)
            num_told += 1 + len(message.value.status_list)
            self._delivery.announce(action.owner, topic, message, now)

    def _advertise(self, action: Action, suffix: str, type_name: str, *, depth: int = 0) -> Topic | None:
        """Advertise a topic; tell the owner of the action if that is not possible."""
        name = action.name + suffix
        try:
            return self._topics.advertise(
                action.owner, name, type_name, depth=depth, key=action, is_exclusive=action.is_exclusive
            )
        except GraphError as error:
            action.owner.notify("warning", f"{action.name} goes without {name}: {error}")
            return None

    def _latch(self, topic: Topic) -> None:
        """Latch the present status for a subscriber that has just come: without one, no status was made."""
        action = self._by_topic.get(topic)
        if action is not None and action.has_had_goals:
            topic.keep(action.owner, self._describe(action, topic), self._state.accounts.get(action.owner))

    def _describe(self, action: Action, topic: Topic) -> Message:
        """Return the status of an action."""
        store = self._state.store
        info, status = (store.message(f"action_msgs/Goal{part}").struct_type for part in ("Info", "Status"))
        goals: list[Goal | EndedGoal] = [*action.ended.recent(self._state.stamp_ns), *action.goals]
        known = [
            status(info(self._goal_id(topic, goal.uuid), store.time_value(goal.stamp_ns)), int(goal.status))
            for goal in goals
        ]
        return Message(topic.type, topic.type.struct_type(known))

    def _goal_id(self, topic: Topic, uuid: bytes) -> Any:  # noqa: ANN401 - a struct of a generated type, or a dict
        if isinstance(topic.type, MessageType):
            return self._state.store.message("unique_identifier_msgs/UUID").struct_type(uuid)
        return {"uuid": b64encode(uuid).decode()}  # of an unknown package: as it is in JSON
