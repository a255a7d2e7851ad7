"""The simulator's own topics: what goes out with a frame, how often, and in which order.

With each frame go, in this order, `/clock` and the state topics; the node publishes `/SyncModeInfo` behind them, so
that a client that reads it has seen the others of its frame. A message is made only if somebody listens.

Rates count in simulated frames, so what a topic carries depends on the frame alone and not on when somebody began to
listen: at R Hz frame i brings floor(i R / 50) - floor((i - 1) R / 50) publications. Below 50 Hz that is one or none.
Above, the first goes with the frame and the others are the same message again, with its own stamp, spread evenly over
the 20 ms that the frame lasts. In synchronous mode the state of every frame goes out once, at any rate: that is what a
tick is for. What is *sampled*, as a sensor is, keeps its rate there too, and comes once a frame at most.

Where simulated time runs faster than the clock, a topic goes out at most 120 times in a second of wall time: rates are
lowered to that, evenly over the frames; where the world runs as fast as possible, the clock chooses the frames.

While a pause stops real time nothing moves, and a client that joins would see nothing. So some topics are *shown in a
pause*: once a second, and at once to a new subscriber, as the world stands and with the number of its last frame.
Where the world waits for ticks they are not: there each message belongs to a tick. Recordings do not get them.

Components speak of topics by their default names; what they are called, whether they are there and at which rate they
go out, the network settings say.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import count
from typing import Any, Final

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant, gives_way
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.interfaces.network_settings import USUAL_RATE, InterfaceKind, split_prefix
from rosbridge_sim.morai.interfaces.registry import Interface, InterfaceRegistry, why_no_topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.state import DT

__all__ = ["MAX_WALL_RATE", "LatchedPublisher", "PeriodicPublisher", "Publishers"]

_FRAME_RATE: Final = 50

MAX_WALL_RATE: Final = 120
"""Messages of a topic in a second of wall time at most: more than a screen shows, and the highest rate in settings."""

PAUSE_PERIOD: Final = 1.0
"""Between two showings in a pause [s]: soon enough for a person who looks on, and no load."""


class _Publisher(Interface):
    """A topic of the simulator's.

    Attributes:
        topic: on the bus; None while it is not there.
        last: the last message that went out with a frame, and how many frames were published by then; for `Publishers`.
    """

    kind = InterfaceKind.PUBLISHER

    def __init__(self, name: str, type_name: str, *, is_exclusive: bool, rate: float | None, depth: int) -> None:
        prefix, default = split_prefix(name)
        super().__init__(default, prefix, type_name, rate)
        self.topic: Topic | None = None
        self.last: tuple[int, Message] | None = None
        self._is_exclusive = is_exclusive
        self._depth = depth

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:  # noqa: ARG002 - it does not matter when
        self.topic = bus.advertise(
            owner,
            name,
            self.type_name,
            depth=self._depth,
            is_exclusive=self._is_exclusive,
            is_on_demand=not self._depth,
        )

    def release(self, owner: Participant, bus: Bus, now: float, *, is_gone: bool) -> None:
        assert self.topic is not None
        bus.unadvertise(owner, self.topic.name, now)
        if not is_gone:  # who comes late is not to find the last message of a topic that has another name
            bus.forget_topic(self.topic.name)
        self.topic = None

    def why_not(self, owner: Participant, bus: Bus, name: str) -> str | None:
        topic = bus.find_topic(name)
        if topic is None:
            return None
        others = [other for other in topic.publishers if other is not owner and not gives_way(other, owner)]
        if others and (self._is_exclusive or topic.owner in others):
            return f"topic {name} is published by {others[0].name}"
        return why_no_topic(owner, bus, name, self.type_name)


class PeriodicPublisher(_Publisher):
    """One topic that goes out with the frames."""

    def __init__(
        self,
        name: str,
        type_name: str,
        make: Callable[[], Any],
        *,
        is_exclusive: bool = True,
        rate: float = USUAL_RATE,
        is_sampled: bool = False,
        is_shown_in_pause: bool = False,
        depth: int = 0,
    ) -> None:
        """A topic; the arguments are those of `Publishers.add`."""
        super().__init__(name, type_name, is_exclusive=is_exclusive, rate=rate, depth=depth)
        self.make = make
        self.is_sampled = is_sampled
        self.is_shown_in_pause = is_shown_in_pause
        self.free_at = -math.inf  # where wall time limits the rate: when the next message may go out [s]
        self._rate = Fraction(1)
        self._most: Fraction | None = None
        self._up, self._down = 1, 1
        self._real_up, self._real_down = 1, 1

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:
        """Be on the bus under this name; what is kept there for others is there from the start."""
        super().bind(owner, bus, name, now)
        if self._depth:
            assert self.topic is not None
            bus.announce(owner, self.topic, Message(self.topic.type, self.make()), now)

    @property
    def is_latched(self) -> bool:
        """Return whether its last message is kept for those who come late."""
        return bool(self._depth)

    def tune(self, rate: float) -> None:
        """Go out so often [Hz]."""
        self._rate = Fraction(rate).limit_denominator(10_000) / _FRAME_RATE
        self._up, self._down = self._rate.numerator, self._rate.denominator
        self.limit(self._most)

    def limit(self, most: Fraction | None) -> None:
        """Go out at most so often while real time moves the world, in simulated time [Hz]; None for no limit."""
        self._most = most
        rate = self._rate if most is None else min(self._rate, most / _FRAME_RATE)
        self._real_up, self._real_down = rate.numerator, rate.denominator

    def num_due(self, frame: int) -> int:
        """How many publications this frame brings at its rate."""
        return frame * self._up // self._down - (frame - 1) * self._up // self._down

    def num_due_in_real_time(self, frame: int) -> int:
        """How many publications this frame brings while real time moves the world, which may set a limit."""
        return frame * self._real_up // self._real_down - (frame - 1) * self._real_up // self._real_down


class LatchedPublisher(_Publisher):
    """One topic that goes out whenever there is news, and whose last message waits for those who come late.

    Attributes:
        value: what it says, a generated struct; None before it has said anything.
    """

    def __init__(self, name: str, type_name: str, *, is_exclusive: bool = True) -> None:
        """A topic; the arguments are those of `Publishers.keep`."""
        super().__init__(name, type_name, is_exclusive=is_exclusive, rate=None, depth=1)
        self.value: Any = None

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:
        """Be on the bus under this name, and say there what was said last."""
        super().bind(owner, bus, name, now)
        if self.topic is not None and self.value is not None:
            bus.announce(owner, self.topic, Message(self.topic.type, self.value), now)


class Publishers:
    """The topics that `owner` publishes, most of them alone."""

    def __init__(self, owner: Participant, bus: Bus, items: InterfaceRegistry) -> None:
        """No topics yet.

        Args:
            owner: the simulator.
            bus: where they are published.
            items: all that the owner has on the bus.
        """
        self._owner = owner
        self._bus = bus
        self._items = items
        self._periodic: list[PeriodicPublisher] = []
        self._latched: list[LatchedPublisher] = []
        self._num_shown = 0  # frames published; unlike the world's frame it never goes back
        self._repeats: list[tuple[float, int, PeriodicPublisher, Message]] = []
        self._ticket = count()
        self._factor = 1.0
        # In a pause: when to show the world next, who has been shown it, and whether somebody has come since.
        self._pause_at: float | None = None
        self._shown_to: set[Subscription] = set()
        self._has_newcomer = False
        bus.on_topic.append(self._note_newcomer)

    def add(
        self,
        name: str,
        type_name: str,
        make: Callable[[], Any],
        *,
        is_exclusive: bool = True,
        rate: float = USUAL_RATE,
        is_sampled: bool = False,
        is_shown_in_pause: bool = False,
        is_everywhere: bool = True,
        depth: int = 0,
    ) -> PeriodicPublisher:
        """Publish a topic with every frame, or at its rate; a further ego's at that of the first.

        Args:
            name: of the topic, by default.
            type_name: its type.
            make: the struct of the world as it stands, or None while there is nothing to say; called at most once a
                frame.
            is_exclusive: nobody else may publish there.
            rate: publications a second of simulated time, unless somebody has chosen another one [Hz].
            is_sampled: in synchronous mode, too, it goes out at its rate in simulated time and not with every frame.
            is_shown_in_pause: it goes out while a pause stops real time, see above.
            is_everywhere: every release has the type. Where one does not, nothing is published.
            depth: how many messages are kept for those who come late.

        Returns:
            What goes out, for `show_now`.

        Raises:
            GraphError: somebody has given the topic another type.
        """
        publisher = PeriodicPublisher(
            name,
            type_name,
            make,
            is_exclusive=is_exclusive,
            rate=rate,
            is_sampled=is_sampled,
            is_shown_in_pause=is_shown_in_pause,
            depth=depth,
        )
        publisher.limit(_max_rate(self._factor))
        self._items.add(publisher, is_everywhere=is_everywhere)
        self._periodic.append(publisher)
        return publisher

    def keep(self, name: str, type_name: str, *, is_exclusive: bool = True) -> LatchedPublisher:
        """Have a topic that goes out whenever there is news, and is kept for those who come late; see `update`.

        Args:
            name: of the topic, by default.
            type_name: its type.
            is_exclusive: nobody else may publish there.

        Raises:
            GraphError: somebody has given the topic another type.
        """
        publisher = LatchedPublisher(name, type_name, is_exclusive=is_exclusive)
        self._items.add(publisher)
        self._latched.append(publisher)
        return publisher

    def update(self, publisher: LatchedPublisher, value: Struct, now: float) -> None:
        """There is news for a topic that `keep` has made."""
        publisher.value = value
        if publisher.topic is not None:
            self._bus.announce(self._owner, publisher.topic, Message(publisher.topic.type, value), now)

    def remove(self, prefix: str, now: float) -> None:
        """Publish the topics under a further ego's prefix no longer."""
        gone = [publisher for publisher in self._periodic if publisher.prefix == prefix]
        self._periodic = [publisher for publisher in self._periodic if publisher.prefix != prefix]
        self._repeats = [repeat for repeat in self._repeats if repeat[2].prefix != prefix]
        heapq.heapify(self._repeats)
        self._items.remove(gone, now)

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
        """Publish the world as it stands on every topic that somebody listens to; what is sampled when its turn comes.

        Args:
            frame: the world's.
            now: monotonic time [s].
        """
        self._num_shown += 1
        for publisher in self._periodic:
            topic = publisher.topic
            if topic is None or not topic.subscriptions:  # most topics at each frame: no call for those
                continue
            if not topic.has_listener or (publisher.is_sampled and not publisher.num_due(frame)):
                continue
            value = publisher.make()
            if value is not None:
                message = Message(topic.type, value)
                publisher.last = self._num_shown, message
                self._bus.announce(self._owner, topic, message, now)

    def show_due(self, frame: int, shown_at: float, now: float) -> None:
        """Publish the world as it stands on the topics whose turn it is, and put what is to be repeated on the list.

        Args:
            frame: the world's.
            shown_at: when it was due [s].
            now: monotonic time [s].
        """
        self._num_shown += 1
        for publisher in self._periodic:
            topic = publisher.topic
            if topic is None or not topic.subscriptions:  # as above
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
            self._bus.announce(self._owner, topic, message, now)
            for i in range(1, num):
                heapq.heappush(
                    self._repeats, (shown_at + i * DT / (self._factor * num), next(self._ticket), publisher, message)
                )

    def show_now(self, publisher: PeriodicPublisher, now: float) -> None:
        """Publish one topic between frames, since there is news; it must have something to say."""
        if publisher.topic is not None:
            self._bus.announce(self._owner, publisher.topic, Message(publisher.topic.type, publisher.make()), now)

    def show_latched(self, now: float) -> None:
        """Publish anew what is kept for those who come late: it is stamped otherwise from now on."""
        for publisher in self._periodic:
            if publisher.is_latched:
                self.show_now(publisher, now)

    @property
    def names(self) -> list[str]:
        """Return the names of all topics that are there."""
        publishers: tuple[_Publisher, ...] = (*self._periodic, *self._latched)
        return [publisher.topic.name for publisher in publishers if publisher.topic is not None]

    def find(self, name: str) -> PeriodicPublisher | LatchedPublisher | None:
        """Return what publishes the topic of that absolute name; None where it is not one of these, or not there."""
        publishers: tuple[PeriodicPublisher | LatchedPublisher, ...] = (*self._periodic, *self._latched)
        for publisher in publishers:
            if publisher.topic is not None and publisher.topic.name == name:
                return publisher
        return None

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

    def current(self) -> Iterator[tuple[Topic, Message]]:
        """Yield each topic that has something to say, with the message that would go out now; nothing is published."""
        for publisher in self._periodic:
            value = None if publisher.topic is None else publisher.make()
            if publisher.topic is not None and value is not None:
                yield publisher.topic, Message(publisher.topic.type, value)

    def set_paused(self, *, is_paused: bool, now: float) -> None:
        """Begin or end to show the world in a pause; twice is no error.

        Args:
            is_paused: a pause stops real time; not where the world waits for ticks.
            now: monotonic time [s].
        """
        if not is_paused:
            self._pause_at = None
            self._shown_to.clear()
        elif self._pause_at is None:
            self._pause_at = now + PAUSE_PERIOD
            self._shown_to = self._listeners_in_pause()
            self._has_newcomer = False

    def pause_due(self, now: float) -> float | None:
        """Return when `show_in_pause` has something to do next [s]."""
        if self._pause_at is None:
            return None
        if self._has_newcomer:
            return now
        return self._pause_at if self._listeners_in_pause() else None

    def show_in_pause(self, now: float) -> None:
        """Show the world as it stands: to all if it is time to, else to those who have come since; or do nothing."""
        if self._pause_at is None:
            return
        is_time = now >= self._pause_at
        if not is_time and not self._has_newcomer:
            return
        if is_time:
            self._pause_at = now + PAUSE_PERIOD
        shown_to = set() if is_time else self._shown_to
        self._has_newcomer = False
        self._shown_to = self._listeners_in_pause()
        for publisher in self._periodic:
            listeners = [one for one in _listeners_in_pause(publisher) if one not in shown_to]
            value = publisher.make() if listeners else None
            if value is not None:
                assert publisher.topic is not None
                self._bus.show(self._owner, publisher.topic, Message(publisher.topic.type, value), listeners, now)

    def _listeners_in_pause(self) -> set[Subscription]:
        return {one for publisher in self._periodic for one in _listeners_in_pause(publisher)}

    def _note_newcomer(self, _topic: Topic) -> None:
        """Note that somebody has begun to listen, perhaps to a topic of these."""
        if self._pause_at is not None:
            self._has_newcomer = True

    @property
    def repeat_due(self) -> float | None:
        """When `repeat` has something to do next [s]."""
        return self._repeats[0][0] if self._repeats else None

    def repeat(self, now: float) -> None:
        """Publish again what is due by now."""
        while self._repeats and self._repeats[0][0] <= now:
            _, _, publisher, message = heapq.heappop(self._repeats)
            topic = publisher.topic
            if topic is not None and topic.has_listener:
                self._bus.announce(self._owner, topic, message, now)

    def forget_repeats(self) -> None:
        """Real time has stopped: nothing is repeated."""
        self._repeats.clear()


def _max_rate(factor: float) -> Fraction | None:
    """Return how often a topic may go out in a second of simulated time; None where wall time alone says it."""
    return MAX_WALL_RATE / Fraction(factor).limit_denominator(10_000) if factor else None


def _listeners_in_pause(publisher: PeriodicPublisher) -> list[Subscription]:
    """The listeners that a topic is shown to in a pause."""
    if not publisher.is_shown_in_pause or publisher.topic is None:
        return []
    return [one for one in publisher.topic.subscriptions if not one.is_idle and not one.is_recording]
