"""The bus of one process: topics, services, actions and parameters, in one synchronous table.

Everything that talks is a `Participant`: a WebSocket client's `Peer`, the simulator's node, rosapi, later a
recorder or a far bridge. The bus calls listeners and providers directly and in a fixed order, so one
incoming frame is carried to its end before the next: that is our transaction. It has never heard of
frames, sockets or JSON text; message bodies reach it as `Message` values of the store.

What belongs to an owner hangs on that owner, and `leave` takes all of it away: publishers, subscriptions,
services (whose waiting callers get an answer at once) and calls (whose answers nobody waits for any more).

Time comes as an argument: `now` is monotonic seconds. `time_ns` is the simulation's time, and `stamp_ns` the time that
messages are stamped with: the same one, or the time of day. The node sets both at each frame.

This file ties the parts, each of which has a file of its own: `topic_table.py`, `delivery.py`, `service_table.py`,
`actions.py` and `parameters.py`, over the shared `bus_state.py`.
"""

from __future__ import annotations

from rosbridge_sim.graph.actions import Actions
from rosbridge_sim.graph.bus_state import BusState
from rosbridge_sim.graph.delivery import Delivery
from rosbridge_sim.graph.parameters import Parameters
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.service_table import MAX_CALLS, ServiceTable
from rosbridge_sim.graph.topic_table import TopicTable
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.graph.type_resolution import TypeResolver
from rosbridge_sim.schema.store import Store

__all__ = ["Bus"]


class Bus(BusState):
    """Topics, services, actions and parameters of one process.

    Attributes:
        topics: all topics, by absolute name; to be read and not changed.
        services: the same for services.
        actions: the third way of talking.
        parameters: the parameter server.
        unpublished: subscriptions to topics that nobody publishes.
        max_calls: calls that one caller may have in flight, and as many goals.
        advertise, unadvertise, subscribe, unsubscribe, retype, find_topic, forget_topic, forget_latched,
            forget_orphans, type_conflict, type_to_publish: see `TopicTable`.
        publish, announce, show: see `Delivery`.
        provide, withdraw, call: see `ServiceTable`.
    """

    def __init__(
        self,
        store: Store,
        *,
        is_strict: bool = False,
        service_timeout: float | None = None,
        max_calls: int = MAX_CALLS,
    ) -> None:
        """A bus without participants.

        Args:
            store: the types.
            is_strict: refuse types of packages that nobody knows, in place of relaying them unchecked.
            service_timeout: give a call up after so long by default [s]; None waits for ever.
            max_calls: see above.
        """
        super().__init__(store)
        self.topics: dict[str, Topic] = {}
        types = TypeResolver(store, lambda: (topic.type for topic in self.topics.values()), is_strict=is_strict)
        topics = self._topic_table = TopicTable(self, types, self.topics)
        services = self._service_table = ServiceTable(self, types, timeout=service_timeout, max_calls=max_calls)
        delivery = Delivery(self)
        self.services = services.by_name
        self.actions = Actions(self, types, services, max_calls)
        self.parameters = Parameters()
        self.unpublished = topics.unpublished
        self.max_calls = max_calls
        # The methods of the parts are the bus's own: a call costs no second one on the way.
        self.advertise = topics.advertise
        self.unadvertise = topics.unadvertise
        self.subscribe = topics.subscribe
        self.unsubscribe = topics.unsubscribe
        self.retype = topics.retype
        self.find_topic = topics.find_topic
        self.forget_topic = topics.forget_topic
        self.forget_latched = topics.forget_latched
        self.forget_orphans = topics.forget_orphans
        self.type_conflict = topics.type_conflict
        self.type_to_publish = topics.type_to_publish
        self.publish = delivery.publish
        self.announce = delivery.announce
        self.show = delivery.show
        self.provide = services.provide
        self.withdraw = services.withdraw
        self.call = services.call

    def next_deadline(self) -> float | None:
        """Return when `expire` has something to do next [s]; None if never."""
        call, topic = self._service_table.next_deadline(), self._topic_table.next_deadline()
        if call is None or topic is None:
            return topic if call is None else call
        return min(call, topic)

    def expire(self, now: float) -> None:
        """Give up the calls whose time is over and forget the topics that nobody has held for a while.

        A listener that has waited for a while for a topic without a publisher is told.
        """
        self._service_table.expire(now)
        self._topic_table.expire(now)

    def leave(self, owner: Participant, now: float) -> None:
        """Take away all that `owner` holds, answer those who wait for it, call `on_leave`. Twice is no error."""
        attempt = self.guard.attempt
        attempt("the end of an owner's goals", self.actions.leave, owner)
        self._service_table.abandon_calls(owner)
        self._topic_table.leave(owner, now)
        self._service_table.leave(owner)
        self.forget_owner(owner)
        for hook in tuple(self.on_leave):
            attempt("what follows an owner's end", hook, owner, now)
