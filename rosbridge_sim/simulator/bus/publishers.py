"""Output topics of the simulator: the topics of each frame, their rates, and their order.

With each frame `/clock` and then the state topics are published. The node publishes `/SyncModeInfo` after them, so a
client that gets it has received the other topics of its frame. A message is made only if its topic has subscribers.

Rates count in simulated frames, so the messages of a topic depend on the frame alone, and not on the time of the
subscription: at R Hz frame i has floor(i R / 50) - floor((i - 1) R / 50) publications. Below 50 Hz that is one or none.
Above 50 Hz the first is published with the frame; the others are the same message again, with the same stamp, spread
evenly over the 20 ms of the frame. In synchronous mode the state of every frame is published once, at any rate, because
a tick is made for that. *Sampled* topics, such as sensors, keep their rate there too, with at most one message a frame.

Where simulated time runs faster than the clock, a topic goes out at most 120 times in a second of wall time: rates are
lowered to that, evenly over the frames; where the world runs as fast as possible, the clock chooses the frames.

While a pause stops real time nothing moves, and a client that joins would get no messages. So some topics are *shown in
a pause*: once a second, and at once to a new subscriber, with the current state and the number of the last frame. While
the world waits for ticks they are not shown, because each message there belongs to a tick. Recordings do not get them.

A topic for viewers has a *version*, which differs if the message would. While ticks or a pause hold the world, it goes
out to a new subscriber at once, and to all of them after a change. One that does not go out with frames does so at any
time, and is latched: the kept message is brought up to date as a subscriber comes, so that nothing is made while there
is none. Recordings do not get these messages either.

Components use the default names of topics; the network settings give their names on the bus, turn them on or off, and
set their rates.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import count
from typing import Any, Final, Unpack

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.publisher_kinds import LatchedPublisher, PeriodicPublisher, PublisherOptions
from rosbridge_sim.world.state.world import DT

MAX_WALL_RATE: Final = 120
"""Messages of a topic in a second of wall time at most: more than a screen shows, and the highest rate in settings."""

PAUSE_PERIOD: Final = 1.0
"""Period of the messages in a pause [s]: short enough for a person who watches, and no load."""


class Publishers:
    """All topics that `owner` publishes; most of them may have no other publisher.

    Attributes:
        pause_at: time of the next message in a pause [s]; None without a pause.
    """

    def __init__(self, owner: Participant, bus: Bus, items: InterfaceRegistry) -> None:
        """Start without topics.

        Args:
            owner: the simulator.
        """
        self._owner = owner
        self._bus = bus
        self._items = items
        self._periodic: list[PeriodicPublisher] = []
        self._latched: list[LatchedPublisher] = []
        self._for_viewers: list[PeriodicPublisher] = []
        self._num_shown = 0  # frames published; unlike the world's frame it never goes back
        self._repeats: list[tuple[float, int, PeriodicPublisher, Message]] = []
        self._ticket = count()
        self._factor = 1.0
        # In a pause: subscriptions that got the last message, and whether one was added since.
        self.pause_at: float | None = None
        self._shown_to: set[Subscription] = set()
        self._has_newcomer = False
        bus.on_topic.append(self._note_newcomer)

    def add(
        self, name: str, type_name: str, make: Callable[[], Any], **options: Unpack[PublisherOptions]
    ) -> PeriodicPublisher:
        """Publish a topic with every frame, or at a rate; a further ego's topic has the rate of the first ego's.

        Args:
            name: default name.
            make: returns the struct of the world's current state, or None if there is nothing to publish; called at
                most once a frame.
            options: see there.

        Returns:
            The publisher, for `show_now`.

        Raises:
            GraphError: a client has given the topic another type.
        """
        publisher = PeriodicPublisher(name, type_name, make, **options)
        publisher.limit(_max_rate(self._factor))
        self._items.add(publisher)
        if publisher.version is not None:
            self._for_viewers.append(publisher)
        if publisher.is_in_frames:
            self._periodic.append(publisher)
        return publisher

    def keep(self, name: str, type_name: str, *, is_exclusive: bool = True) -> LatchedPublisher:
        """Create a latched topic, which is published when its value changes; see `update`.

        Args:
            name: default name.
            is_exclusive: no other participant may publish there.

        Returns:
            The publisher, for `update`.

        Raises:
            GraphError: a client has given the topic another type.
        """
        publisher = LatchedPublisher(name, type_name, is_exclusive=is_exclusive)
        self._items.add(publisher)
        self._latched.append(publisher)
        return publisher

    def update(self, publisher: LatchedPublisher, value: Struct, now: float) -> None:
        """Publish a new value of a latched topic.

        Args:
            publisher: from `keep`.
            value: a generated struct of its type.
        """
        publisher.value = value
        if publisher.topic is not None:
            self._bus.announce(self._owner, publisher.topic, Message(publisher.topic.type, value), now)

    def forget(self, publisher: LatchedPublisher) -> None:
        """Forget the value of a latched topic; late subscribers get nothing before the next `update`."""
        publisher.value = None
        if publisher.topic is not None:
            publisher.topic.forget_messages_of(self._owner)

    def remove(self, prefix: str, now: float) -> None:
        """Stop to publish the topics of a further ego."""
        gone = [publisher for publisher in (*self._periodic, *self._latched) if publisher.prefix == prefix]
        self._periodic = [publisher for publisher in self._periodic if publisher.prefix != prefix]
        self._latched = [publisher for publisher in self._latched if publisher.prefix != prefix]
        self._repeats = [repeat for repeat in self._repeats if repeat[2].prefix != prefix]
        heapq.heapify(self._repeats)
        self._items.remove(gone, now)

    def order(self, prefixes: Sequence[str]) -> None:
        """Publish the topics of further egos in an order of theirs, whenever they were added.

        Args:
            prefixes: of their topics, the first one first.
        """
        ranks = {prefix: rank for rank, prefix in enumerate(prefixes)}
        places = [i for i, publisher in enumerate(self._periodic) if publisher.prefix in ranks]
        ranked = sorted([self._periodic[i] for i in places], key=lambda publisher: ranks[publisher.prefix])
        for i, publisher in zip(places, ranked, strict=True):
            self._periodic[i] = publisher

    def set_factor(self, factor: float) -> None:
        """Take note of the real-time factor, and forget what was to be repeated.

        Args:
            factor: see `RealTimePacer`.
        """
        self._factor = factor
        self.forget_repeats()
        for publisher in self._periodic:
            publisher.limit(_max_rate(factor))

    def show_every(self, frame: int, now: float) -> None:
        """Publish the world's current state on every topic with subscribers; sampled topics only if they are due."""
        self._num_shown += 1
        for publisher in self._periodic:
            topic = publisher.topic
            # The first two are true for most topics at each frame: saves the calls.
            if topic is None or not topic.subscriptions or topic.subscriptions is publisher.not_listening:
                continue
            if not topic.has_listener or (publisher.is_sampled and not publisher.num_due(frame)):
                continue
            value = publisher.make()
            if value is not None:
                message = Message(topic.type, value)
                publisher.last = self._num_shown, message
                publisher.note_shown(topic)
                self._bus.announce(self._owner, topic, message, now)

    def show_due(self, frame: int, shown_at: float, now: float) -> None:
        """Publish the world's current state on the topics that are due, and schedule their repetitions.

        Args:
            shown_at: monotonic time at which the frame was due [s].
        """
        self._num_shown += 1
        for publisher in self._periodic:
            topic = publisher.topic
            if topic is None or not topic.subscriptions or topic.subscriptions is publisher.not_listening:  # as above
                continue
            num = publisher.num_due_in_real_time(frame)
            if not num or not topic.has_listener:
                continue
            if not self._factor:
                if now < publisher.free_at:
                    continue
                num, publisher.free_at = 1, now + 1.0 / MAX_WALL_RATE
            value = publisher.make()
            if value is None:
                continue
            message = Message(topic.type, value)
            publisher.last = self._num_shown, message
            publisher.note_shown(topic)
            self._bus.announce(self._owner, topic, message, now)
            for i in range(1, num):
                heapq.heappush(
                    self._repeats, (shown_at + i * DT / (self._factor * num), next(self._ticket), publisher, message)
                )

    def show_now(self, publisher: PeriodicPublisher, now: float) -> None:
        """Publish one topic between frames, because its value has changed.

        Args:
            publisher: from `add`; its `make` must return a message now.
        """
        if publisher.topic is not None:
            self._bus.announce(self._owner, publisher.topic, Message(publisher.topic.type, publisher.make()), now)

    def deliver(self, publisher: PeriodicPublisher, value: Struct, now: float) -> None:
        """Publish a message of a frame that was made behind it, such as a picture.

        Args:
            publisher: from `add`; its `make` returns None, so that nothing goes out with the frame.
            value: a generated struct of its type.
        """
        if publisher.topic is None:
            return
        message = Message(publisher.topic.type, value)
        for take in publisher.takers:
            take(message)
        self._bus.announce(self._owner, publisher.topic, message, now)

    def drop(self, publisher: PeriodicPublisher, now: float) -> None:
        """Stop to publish a topic.

        Args:
            publisher: from `add`.
        """
        self._periodic.remove(publisher)
        self._items.remove([publisher], now)

    def show_latched(self, now: float) -> None:
        """Publish all latched topics anew, because their stamp has changed."""
        for publisher in self._periodic:
            if publisher.is_latched:
                self.show_now(publisher, now)

    @property
    def types(self) -> list[tuple[str, str]]:
        """Return name and type of all topics that are there."""
        return [(one.topic.name, one.type_name) for one in self._all() if one.topic is not None]

    def find(self, name: str) -> PeriodicPublisher | LatchedPublisher | None:
        """Return what publishes the topic of that absolute name; None where it is not one of these, or not there."""
        for publisher in self._all():
            if publisher.topic is not None and publisher.topic.name == name:
                return publisher
        return None

    def _all(self) -> list[PeriodicPublisher | LatchedPublisher]:
        others = [publisher for publisher in self._for_viewers if not publisher.is_in_frames]
        return [*self._periodic, *others, *self._latched]

    def sample(self, publisher: PeriodicPublisher | LatchedPublisher) -> Message | None:
        """Return what a topic says of the last frame, or was kept there for those who come late; nothing is published.

        A message that went out with the frame is not made again. None where the topic has nothing to say.
        """
        topic, last = publisher.topic, publisher.last
        if topic is None:
            return None
        if isinstance(publisher, LatchedPublisher):
            value = publisher.value
        elif last is not None and last[0] == self._num_shown:
            return last[1]
        else:
            value = publisher.make()
        return None if value is None else Message(topic.type, value)

    def second_names(self) -> tuple[str, ...]:
        """Return the present names of topics with the messages of another one, which a user has chosen by its name."""
        return tuple([one.topic.name for one in self._periodic if one.is_second_name and one.topic is not None])

    def current(self) -> Iterator[tuple[Topic, Message]]:
        """Yield the message that each topic would publish now; nothing is published.

        Yields:
            Each topic that has a message, with the message.
        """
        for publisher in self._all():
            if isinstance(publisher, LatchedPublisher):
                continue
            value = None if publisher.topic is None else publisher.make()
            if publisher.topic is not None and value is not None:
                yield publisher.topic, Message(publisher.topic.type, value)

    def set_paused(self, *, is_paused: bool, now: float) -> None:
        """Start or stop the messages in a pause; a second call with the same value is no error.

        Args:
            is_paused: a pause stops real time; false while the world waits for ticks.
        """
        if not is_paused:
            self.pause_at = None
            self._shown_to.clear()
        elif self.pause_at is None:
            self.pause_at = now + PAUSE_PERIOD
            self._shown_to = self._listeners_in_pause()
            self._has_newcomer = False

    def pause_due(self, now: float) -> float | None:
        """Return the time of the next call of `show_in_pause`.

        Returns:
            Monotonic time [s]; None if there is nothing to show.
        """
        if self.pause_at is None:
            return None
        if self._has_newcomer:
            return now
        return self.pause_at if self._listeners_in_pause() else None

    def show_in_pause(self, now: float) -> None:
        """Publish the world's current state in a pause: to all subscribers once a period, and to new ones at once."""
        if self.pause_at is None:
            return
        is_time = now >= self.pause_at
        if not is_time and not self._has_newcomer:
            return
        if is_time:
            self.pause_at = now + PAUSE_PERIOD
        shown_to = set() if is_time else self._shown_to
        self._has_newcomer = False
        self._shown_to = self._listeners_in_pause()
        for publisher in self._periodic:
            listeners = [one for one in _listeners_in_pause(publisher) if one not in shown_to]
            value = publisher.make() if listeners else None
            if value is not None:
                assert publisher.topic is not None
                self._bus.show(self._owner, publisher.topic, Message(publisher.topic.type, value), listeners, now)

    def has_viewer_to_show(self, *, is_flowing: bool) -> bool:
        """Tell whether `show_viewers` has something to do.

        Args:
            is_flowing: real time moves the world, so the next frame brings what goes out with frames.
        """
        for publisher in self._for_viewers:  # called after each op, so without a further call where nobody listens
            topic = publisher.topic
            if topic is None or not topic.subscriptions or (is_flowing and publisher.is_in_frames):
                continue
            if _viewers_to_show(publisher, topic):
                return True
        return False

    def show_viewers(self, now: float, *, is_flowing: bool) -> None:
        """Publish the current state on topics for viewers: to new subscribers, and to all after a change.

        Args:
            is_flowing: see `has_viewer_to_show`.
        """
        for publisher in self._for_viewers:
            topic = publisher.topic
            if topic is None or not topic.subscriptions or (is_flowing and publisher.is_in_frames):
                continue
            listeners = _viewers_to_show(publisher, topic)
            if listeners:
                value = publisher.make()
                publisher.note_shown(topic)
                if value is None:
                    continue
                message = Message(topic.type, value)
                if publisher.is_latched:
                    topic.keep(self._owner, message, None)
                self._bus.show(self._owner, topic, message, listeners, now)

    def _listeners_in_pause(self) -> set[Subscription]:
        return {one for publisher in self._periodic for one in _listeners_in_pause(publisher)}

    def _note_newcomer(self, topic: Topic) -> None:
        """Note that a subscriber has joined, perhaps to one of these topics."""
        if self.pause_at is not None:
            self._has_newcomer = True
        for publisher in self._for_viewers:
            if publisher.topic is topic and publisher.is_latched and topic.subscriptions:
                self._refresh(publisher, topic)

    def _refresh(self, publisher: PeriodicPublisher, topic: Topic) -> None:
        """Have the message that a new subscriber is about to get be the present one; the others get it next."""
        if publisher.is_stale:
            topic.keep(self._owner, Message(topic.type, publisher.make()), None)
            publisher.note_shown(topic)
            publisher.shown_to = topic.subscriptions[-1:]
        else:
            publisher.shown_to = (*publisher.shown_to, topic.subscriptions[-1])

    @property
    def repeat_due(self) -> float | None:
        """Time of the next call of `repeat` [s]; None if nothing is to be repeated."""
        return self._repeats[0][0] if self._repeats else None

    def repeat(self, now: float) -> None:
        """Publish the repetitions that are due."""
        while self._repeats and self._repeats[0][0] <= now:
            _, _, publisher, message = heapq.heappop(self._repeats)
            topic = publisher.topic
            if topic is not None and topic.has_listener:
                self._bus.announce(self._owner, topic, message, now)

    def forget_repeats(self) -> None:
        """Cancel all repetitions, because real time has stopped."""
        self._repeats.clear()


@lru_cache(16)  # each topic asks for that of the same factor
def _max_rate(factor: float) -> Fraction | None:
    """Return how often a topic may go out in a second of simulated time; None where wall time alone says it."""
    return MAX_WALL_RATE / Fraction(factor).limit_denominator(10_000) if factor else None


def _viewers_to_show(publisher: PeriodicPublisher, topic: Topic) -> list[Subscription]:
    """Return the subscriptions that lack the current state of a topic for viewers."""
    listeners = [one for one in topic.subscriptions if not one.is_idle and not one.is_recording]
    # A far bridge without a subscriber is idle; the subscriber that ends this has seen nothing.
    if any(one.is_idle for one in publisher.shown_to):
        publisher.shown_to = tuple([one for one in publisher.shown_to if not one.is_idle])
    if not listeners or publisher.is_stale:
        return listeners
    seen = publisher.shown_to
    return [] if seen is topic.subscriptions else [one for one in listeners if one not in seen]


def _listeners_in_pause(publisher: PeriodicPublisher) -> list[Subscription]:
    """Return the subscriptions that get the topic in a pause."""
    if not publisher.is_shown_in_pause or publisher.topic is None:
        return []
    return [one for one in publisher.topic.subscriptions if not one.is_idle and not one.is_recording]
