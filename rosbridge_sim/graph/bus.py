"""The bus of one process: topics, services, actions and parameters, in one synchronous table.

Every user of the bus is a `Participant`: the `Peer` of a WebSocket client, the simulator's node, rosapi, a recorder or
a remote bridge. The bus calls subscribers and providers directly and in a fixed order, so one incoming frame is handled
completely before the next one, like a transaction. It does not know frames, sockets or JSON text; message bodies reach
it as `Message` values of the store.
`leave` removes all that belongs to an owner: publishers, subscriptions, services (waiting callers get an answer at
once) and calls (their answers are discarded).
Time is an argument: `now` is monotonic time in seconds. `time_ns` is simulation time. `stamp_ns` is the time for
stamps: simulation time or the time of day. The node sets both at each frame.
This file connects the parts: `topic_table.py`, `delivery.py`, `service_table.py`, `actions.py` with `action_topics.py`,
and `parameters.py`, with the shared state of `bus_state.py`.
"""

from __future__ import annotations

from rosbridge_sim.graph.action_topics import ActionTopics
from rosbridge_sim.graph.actions import Actions
from rosbridge_sim.graph.bus_state import BusState, earliest
from rosbridge_sim.graph.delivery import Delivery
from rosbridge_sim.graph.parameters import Parameters
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.service_table import MAX_CALLS, ServiceTable
from rosbridge_sim.graph.topic_table import TopicTable
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.graph.type_resolution import TypeResolver
from rosbridge_sim.schema.store import Store


class Bus(BusState):
    """Topics, services, actions and parameters of one process.

    Attributes:
        delivery: delivers messages and counts them.
        topics: all topics by absolute name; read only.
        topic_table: rare operations on topics.
        services: all services by absolute name; read only.
        parameters: the parameter server.
        unpublished: subscriptions to topics without a publisher.
        unheard: advertisements of clients without a subscriber.
        advertise, unadvertise, subscribe: see `TopicTable`.
        publish, announce, show: see `Delivery`.
        provide, call: see `ServiceTable`.
    """

    def __init__(
        self,
        store: Store,
        *,
        is_strict: bool = False,
        service_timeout: float | None = None,
        max_calls: int = MAX_CALLS,
    ) -> None:
        """Create a bus without participants.

        Args:
            is_strict: refuse types of unknown packages; otherwise their messages are relayed unchecked.
            service_timeout: default time-out of a call [s]; None waits for ever.
            max_calls: calls that one caller may have in flight.
        """
        super().__init__(store)
        self.topics: dict[str, Topic] = {}
        types = TypeResolver(store, lambda: (topic.type for topic in self.topics.values()), is_strict=is_strict)
        topics = self.topic_table = TopicTable(self, types, self.topics)
        services = self._service_table = ServiceTable(self, types, timeout=service_timeout, max_calls=max_calls)
        delivery = self.delivery = Delivery(self)
        self.services = services.by_name
        self.actions = Actions(self, types, services, max_calls)
        if store.ros != 1:
            self.actions.topics = ActionTopics(self, topics, delivery)
        self.parameters = Parameters()
        self.unpublished = topics.unpublished
        self.unheard = topics.unheard
        # Only methods with many arguments are attributes here; the others are methods below. CPython 3.11 reads
        # objects with more than 30 attributes more slowly, and each message reads `stamp_ns` several times.
        self.advertise = topics.advertise
        self.unadvertise = topics.unadvertise
        self.subscribe = topics.subscribe
        self.publish = delivery.publish
        self.announce = delivery.announce
        self.show = delivery.show
        self.provide = services.provide
        self.call = services.call

    # Topics

    def unsubscribe(self, subscription: Subscription, now: float) -> None:
        """End a subscription. See `TopicTable.unsubscribe`."""
        self.topic_table.unsubscribe(subscription, now)

    def find_topic(self, name: str) -> Topic | None:
        """Return a topic by name, or None. See `TopicTable.find_topic`."""
        return self.topic_table.find_topic(name)

    # Services

    def withdraw(self, owner: Participant, name: str, *, answers_calls: bool = False) -> None:
        """Stop offering a service. See `ServiceTable.withdraw`."""
        self._service_table.withdraw(owner, name, answers_calls=answers_calls)

    @property
    def max_calls(self) -> int:
        """Calls that one caller may have in flight; the same limit applies to goals."""
        return self._service_table.max_calls

    # Time and departure

    def next_deadline(self) -> float | None:
        """Return when `expire` has something to do next [s]; None if never."""
        if self.actions.topics is not None and self.actions.topics.is_due:
            return 0.0
        return earliest(self._service_table.next_deadline(), self.topic_table.next_deadline())

    def expire(self, now: float) -> None:
        """Give up calls after their time-out, forget topics that are unused for a while, publish changes of goals.

        Subscribers that have waited for some time for a publisher are told.
        """
        self._service_table.expire(now)
        self.topic_table.expire(now)
        if self.actions.topics is not None:
            self.actions.topics.advance(now)

    def leave(self, owner: Participant, now: float) -> None:
        """Remove everything of `owner`, answer its waiting callers, call `on_leave`. A second call does nothing."""
        self.agenda.is_touched = True
        attempt = self.guard.attempt
        attempt("the end of an owner's goals", self.actions.leave, owner)
        self._service_table.abandon_calls(owner)
        self.topic_table.leave(owner, now)
        self._service_table.leave(owner)
        self.forget_owner(owner)
        for hook in tuple(self.on_leave):
            attempt("what follows an owner's end", hook, owner, now)
