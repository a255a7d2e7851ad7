"""Publishers of one topic: with a rate, or latched."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from typing import Any, Final, TypedDict, Unpack

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.interface_registry import Interface, why_no_topic
from rosbridge_sim.simulator.bus.network_settings import USUAL_RATE, InterfaceKind, split_prefix

FRAME_RATE: Final = 50.0
"""Frames of a second of simulated time."""


_MAX_RATES: Final = 1_000
"""Rates that are known as fractions: settings may give each topic another one. Thirty new egos have 210 topics, and
their fractions would take a quarter of the time for all of it."""


@lru_cache(_MAX_RATES)
def in_each_frame(rate: float) -> Fraction:
    """Return the publications for each frame at a rate [Hz]."""
    return Fraction(rate).limit_denominator(10_000) / int(FRAME_RATE)


def is_due(rate: float, frame: int) -> bool:
    """Return whether a message of a rate belongs to a frame, as for all topics of the simulator.

    At 30 Hz these are the frames 2, 4, 5, 7, 9, 10, ...: 40 or 20 ms apart.

    Args:
        rate: at most `FRAME_RATE` [Hz].
    """
    return num_due(rate, frame, 1) > 0


def num_due(rate: float, frame: int, num_frames: int) -> int:
    """Return how many messages of a rate belong to the last frames up to one; see `is_due`."""
    up, down = in_each_frame(rate).as_integer_ratio()
    return frame * up // down - (frame - num_frames) * up // down


class TopicPublisher(Interface):
    """A topic that the simulator publishes.

    Attributes:
        topic: on the bus; None while it is not there.
        last: the last message that went out with a frame, and how many frames were published by then; for `Publishers`.
        shown_to: the subscriptions that the last message went to; for `Publishers`, and for topics for viewers alone.
    """

    kind = InterfaceKind.PUBLISHER

    def __init__(self, name: str, type_name: str, *, is_exclusive: bool, rate: float | None, depth: int) -> None:
        prefix, default = split_prefix(name)
        super().__init__(default, prefix, type_name, rate)
        self.topic: Topic | None = None
        self.last: tuple[int, Message] | None = None
        self.shown_to: tuple[Subscription, ...] = ()
        self._is_exclusive = is_exclusive
        self._depth = depth

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:  # noqa: ARG002 - it does not matter when
        """Advertise the topic."""
        self.topic = bus.advertise(
            owner,
            name,
            self.type_name,
            depth=self._depth,
            is_exclusive=self._is_exclusive,
            is_on_demand=not self._depth,
        )

    def release(self, owner: Participant, bus: Bus, now: float, *, is_gone: bool) -> None:
        """Unadvertise the topic, and forget its last message if the participant stays."""
        assert self.topic is not None
        bus.unadvertise(owner, self.topic.name, now)
        if not is_gone:  # a late subscriber must not get the last message of a topic that was renamed
            bus.topic_table.forget_topic(self.topic.name)
        self.topic = None

    def why_not(self, owner: Participant, bus: Bus, name: str) -> str | None:
        """Return why the topic cannot be advertised; None if it can."""
        topic = bus.find_topic(name)
        if topic is None:
            return None
        others = [other for other in topic.publishers if other is not owner and not other.gives_way(owner)]
        if others and (self._is_exclusive or topic.owner in others):
            return f"topic {name} is published by {others[0].name}"
        return why_no_topic(owner, bus, name, self.type_name)


class PublisherOptions(TypedDict, total=False):
    """Options of a `PeriodicPublisher`.

    Attributes:
        is_exclusive: no other participant may publish there; true if it is not given.
        rate: default publications a second of simulated time [Hz], `USUAL_RATE` if it is not given; the network
            settings may change it.
        is_sampled: in synchronous mode it keeps its rate in simulated time, and is not published with every frame.
        is_shown_in_pause: it is published while a pause stops real time; see the text of `publishers`.
        version: for a topic for viewers, returns a value that differs if the message would, never None; see the text of
            `publishers`. None for any other topic.
        is_in_frames: it is published with the frames, as it is if it is not given; if false, `version` alone decides
            when.
        is_second_name: another topic has the same messages; see `second_names`.
        depth: number of messages that are kept for late subscribers.
    """

    is_exclusive: bool
    rate: float
    is_sampled: bool
    is_shown_in_pause: bool
    version: Callable[[], object] | None
    is_in_frames: bool
    is_second_name: bool
    depth: int


class PeriodicPublisher(TopicPublisher):
    """A topic that is published with the frames.

    Attributes:
        takers: get each message that `Publishers.deliver` publishes, beside the subscribers; such a message is made
            while there are any.
        not_listening: `topic.subscriptions` while none of them wants the message, so that it is not made.
    """

    def __init__(self, name: str, type_name: str, make: Callable[[], Any], **options: Unpack[PublisherOptions]) -> None:
        """Describe a topic; the arguments are those of `Publishers.add`."""
        rate, depth = options.get("rate", USUAL_RATE), options.get("depth", 0)
        super().__init__(name, type_name, is_exclusive=options.get("is_exclusive", True), rate=rate, depth=depth)
        self.make = make
        self.version = options.get("version")
        self.shown_version: object = None  # of the last message
        self.is_in_frames = options.get("is_in_frames", True)
        self.is_sampled = options.get("is_sampled", False)
        self.is_second_name = options.get("is_second_name", False)
        self.is_shown_in_pause = options.get("is_shown_in_pause", False)
        self.takers: list[Callable[[Message], object]] = []
        self.not_listening: tuple[Subscription, ...] = ()
        self.free_at = -math.inf  # where wall time limits the rate: when the next message may go out [s]
        self._most: Fraction | None = None
        self._up, self._down = 1, 1
        self._real_up, self._real_down = 1, 1

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:
        """Put the topic on the bus; a latched message is published at once. See `Interface.bind`."""
        super().bind(owner, bus, name, now)
        if self._depth:
            assert self.topic is not None
            bus.announce(owner, self.topic, Message(self.topic.type, self.make()), now)

    @property
    def is_latched(self) -> bool:
        """True if its last messages are kept for late subscribers."""
        return bool(self._depth)

    def tune(self, rate: float) -> None:
        """Set the rate.

        Args:
            rate: publications a second [Hz].
        """
        each = in_each_frame(rate)
        self._up, self._down = each.numerator, each.denominator
        self.limit(self._most)

    def limit(self, most: Fraction | None) -> None:
        """Go out at most so often while real time moves the world, in simulated time [Hz]; None for no limit."""
        self._most = most
        self._real_up, self._real_down = self._up, self._down
        if most is not None:  # compared as whole numbers: fractions would take a tenth of the time of a start
            up, down = most.numerator, most.denominator * int(FRAME_RATE)
            if up * self._down < self._up * down:
                self._real_up, self._real_down = up, down

    @property
    def is_stale(self) -> bool:
        """True if the last message of a topic for viewers is not what it would be now."""
        return self.version is not None and self.version() != self.shown_version

    def note_shown(self, topic: Topic) -> None:
        """Note that a message of the present state goes to all subscribers of the topic."""
        if self.version is not None:
            self.shown_version = self.version()
            self.shown_to = topic.subscriptions

    def num_due(self, frame: int) -> int:
        """Return the number of publications of a frame at the topic's rate.

        Returns:
            0, 1 or, above 50 Hz, more.
        """
        return frame * self._up // self._down - (frame - 1) * self._up // self._down

    def num_due_in_real_time(self, frame: int) -> int:
        """Return how many publications this frame brings while real time moves the world, which may set a limit."""
        return frame * self._real_up // self._real_down - (frame - 1) * self._real_up // self._real_down


class LatchedPublisher(TopicPublisher):
    """A topic that is published when its value changes; its last message is kept for late subscribers.

    Attributes:
        value: the last message, a generated struct; None before the first one.
    """

    def __init__(self, name: str, type_name: str, *, is_exclusive: bool = True) -> None:
        """Describe a topic; the arguments are those of `Publishers.keep`."""
        super().__init__(name, type_name, is_exclusive=is_exclusive, rate=None, depth=1)
        self.value: Any = None

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:
        """Put the topic on the bus, and publish its last message there. See `Interface.bind`."""
        super().bind(owner, bus, name, now)
        if self.topic is not None and self.value is not None:
            bus.announce(owner, self.topic, Message(self.topic.type, self.value), now)
