"""The ROS graph behind the far side: topics and services by their names, as its master and rospy keep them.

A topic's messages travel apart from everything else: each topic has a queue and a task of its own, as rospy has a
socket and a thread for it. So what one client sends in order over two topics, or over a topic and an answer, may come
out in another order; only one topic's own order holds.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rosbridge_sim.schema.definitions.parse import Definition
from tests.far_side.messages import Json, RosError, Types

if TYPE_CHECKING:
    from tests.far_side.client import Client

__all__ = ["UNREGISTER_TIMEOUT", "Graph", "Service", "Settings", "Subscription", "Topic"]

UNREGISTER_TIMEOUT = 10.0
"""A publisher outlives its last advertisement, or its client, by so long [s]: a quick return does not flap."""

_QUEUE_SIZE = 100
"""rosbridge's default for a publisher; what does not fit pushes out the oldest."""


@dataclass(frozen=True)
class Settings:
    """What one subscribe asks for; milliseconds and a count."""

    throttle_ms: int = 0
    queue_length: int = 0


class Subscription:
    """What a client hears of a topic by one spelling of its name: one copy, however many ids.

    Several ids are merged: the lowest throttle, and the *lowest* queue length, whatever the specification says.
    Throttled without a queue, the first message of an interval passes and the others are lost; with a queue they wait
    in it, and the oldest is lost.
    """

    def __init__(self, client: Client, spelling: str) -> None:
        self.ids: dict[Hashable, Settings] = {}
        self._client = client
        self._spelling = spelling
        self._not_before = 0.0
        self._queue: deque[Json] = deque()
        self._is_waiting = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    @property
    def client(self) -> Client:
        return self._client

    async def give(self, msg: Json) -> None:
        """Pass a message on; comes back when the socket has taken it, if no queue stands between."""
        throttle = min(one.throttle_ms for one in self.ids.values()) / 1000
        length = min(one.queue_length for one in self.ids.values())
        if length:
            if length != self._queue.maxlen:
                self._queue = deque(self._queue, length)
            self._queue.append(msg)
            self._is_waiting.set()
            if self._task is None:
                self._task = self._client.start(self._empty_queue(throttle))
            return
        time = asyncio.get_running_loop().time()
        if throttle and time < self._not_before:
            return
        self._not_before = time + throttle
        await self._send(msg)

    def close(self) -> None:
        if self._task is not None:
            self._task.cancel()

    async def _empty_queue(self, throttle: float) -> None:
        while True:
            await self._is_waiting.wait()
            await self._send(self._queue.popleft())
            if not self._queue:
                self._is_waiting.clear()
            await asyncio.sleep(throttle)

    async def _send(self, msg: Json) -> None:
        await self._client.send({"op": "publish", "topic": self._spelling, "msg": msg})


class Topic:
    """A topic with an established type."""

    def __init__(self, name: str, definition: Definition, types: Types) -> None:
        self.name = name
        self.definition = definition
        self.publishers: dict[Client | None, set[Hashable]] = {}
        self.subscriptions: dict[tuple[Client, str], Subscription] = {}
        self.is_latched = False
        self.has_publisher = False
        self.is_registered = True
        self.task: asyncio.Task[None] | None = None
        self._types = types
        self._latched: Json | None = None
        self._seq = 0
        self._queue: deque[Json] = deque(maxlen=_QUEUE_SIZE)
        self._is_waiting = asyncio.Event()

    @property
    def is_known(self) -> bool:
        """Whether the master would still name it."""
        return self.has_publisher or bool(self.subscriptions)

    def publish(self, msg: object) -> None:
        """Send a message on its way.

        `header.seq` is the publisher's own count, whatever was sent: rospy numbers what it publishes.

        Raises:
            RosError: it does not fit the type.
        """
        filled = self._types.fill(self.definition, msg)
        if any(one.type == "std_msgs/Header" and one.name == "header" for one in self.definition.fields):
            self._seq += 1
            filled["header"]["seq"] = self._seq
        shown = self._types.show(self.definition, filled)
        if self.is_latched:
            self._latched = shown
        self._queue.append(shown)
        self._is_waiting.set()

    def greet(self, subscription: Subscription) -> None:
        """A subscribe has come: it hears the latched message, also if it is not the client's first."""
        if self._latched is not None:
            subscription.client.start(subscription.give(self._latched))

    async def carry(self) -> None:
        """Bring each message to each subscriber, one after another: a full socket holds up those behind it."""
        while True:
            await self._is_waiting.wait()
            while self._queue:
                msg = self._queue.popleft()
                for subscription in list(self.subscriptions.values()) if self.is_registered else []:
                    if subscription.ids:
                        await subscription.give(msg)
            self._is_waiting.clear()


@dataclass
class Service:
    """A service: of a client, or of a node of the far side itself.

    Attributes:
        provider: who serves it by rosbridge; None for a node.
        handler: a node's answer to a request.
        waiting: calls on their way to the client, by the id that it got.
    """

    name: str
    type: str
    request: Definition
    response: Definition
    provider: Client | None = None
    handler: Callable[[Json], Json] | None = None
    waiting: dict[str, asyncio.Future[Json]] = field(default_factory=dict)
    num_calls: int = 0

    async def ask(self, args: Json) -> Json:
        """What the client answers; never, if its client never does, *also when that is gone*: nobody looks after it.

        Raises:
            RosError: it was torn down meanwhile.
        """
        assert self.provider is not None
        self.num_calls += 1
        mark = f"service_request:{self.name}:{self.num_calls}"
        answer: asyncio.Future[Json] = asyncio.get_running_loop().create_future()
        self.waiting[mark] = answer
        await self.provider.send({"op": "call_service", "id": mark, "service": self.name, "args": args})
        return await answer

    def tear_down(self) -> None:
        """End it; whoever waits for it fails."""
        for answer in self.waiting.values():
            if not answer.done():
                answer.set_exception(RosError(f"Service {self.name} was unadvertised"))
        self.waiting.clear()


class Graph:
    """All topics and services, and the parameters.

    Attributes:
        parameters: by name, with its slash.
    """

    def __init__(self, types: Types, start: Callable[..., asyncio.Task[None]]) -> None:
        self.types = types
        self.services: dict[str, Service] = {}
        self.parameters: dict[str, object] = {}
        self._topics: dict[str, Topic] = {}
        self._start = start

    @property
    def topics(self) -> dict[str, Topic]:
        """Those which somebody publishes or hears."""
        return {name: topic for name, topic in self._topics.items() if topic.is_known}

    @property
    def registered(self) -> dict[str, Topic]:
        """Those of `topics` that the master knows."""
        return {name: topic for name, topic in self.topics.items() if topic.is_registered}

    def topic(self, name: str, type_name: object) -> Topic:
        """The topic of this name; a new one, if nobody has it and the type is known.

        Raises:
            RosError: no type, an unknown one, or another one than the established.
        """
        topic = self._topics.get(name)
        if topic is not None and topic.is_known:
            if type_name is not None and type_name != topic.definition.name:
                established = f"but it is already established with type {topic.definition.name}"
                raise RosError(f"Tried to register topic {name} with type {type_name} {established}")
            return topic
        if type_name is None:
            raise RosError(f"Cannot infer topic type for topic {name} as it is not yet advertised")
        topic = Topic(name, self.types.message(str(type_name)), self.types)
        topic.task = self._start(topic.carry())
        if name in self._topics:
            self.forget(self._topics[name])
        self._topics[name] = topic
        return topic

    def advertise(self, topic: Topic, client: Client | None, mark: Hashable, *, is_latched: bool) -> None:
        """Somebody publishes; only the first of them decides whether it is latched."""
        if not topic.has_publisher:
            topic.is_latched = is_latched
            topic.is_registered = True
        topic.has_publisher = True
        topic.publishers.setdefault(client, set()).add(mark)

    def unadvertise(self, topic: Topic, client: Client, mark: Hashable = None) -> None:
        """A client takes one advertisement back, or all of its; the last one's publisher lives on for a while."""
        marks = topic.publishers.get(client, set())
        if mark is None:
            marks.clear()
        marks.discard(mark)
        if not marks and topic.publishers.pop(client, None) is not None and not topic.publishers:
            asyncio.get_running_loop().call_later(UNREGISTER_TIMEOUT, self._unregister, topic)

    def forget_registrations(self) -> None:
        """The master was restarted: it knows nobody, and rospy registers nothing that it has registered once.

        So a publisher that lives on is found by nobody, and its messages reach nobody. A service or a subscription that
        is made anew is registered.
        """
        for service in self.services.values():
            service.tear_down()
        self.services.clear()
        for topic in self._topics.values():
            topic.is_registered = False
            topic.subscriptions.clear()

    def forget(self, topic: Topic) -> None:
        """Nobody has it any more."""
        if topic.task is not None:
            topic.task.cancel()
        del self._topics[topic.name]

    def _unregister(self, topic: Topic) -> None:
        if not topic.publishers:
            topic.has_publisher = False
            if not topic.is_known and self._topics.get(topic.name) is topic:
                self.forget(topic)
