"""The simulator's own topics: what goes out with a frame, how often, and in which order.

With each frame go, in this order, `/clock` and the state topics; the node publishes `/SyncModeInfo` behind them, so
that whoever reads that one has seen the others of its frame. A message is made only if somebody listens.

Rates count in simulated frames, so what a topic carries depends on the frame alone and not on when somebody began to
listen: at R Hz frame i brings floor(i R / 50) - floor((i - 1) R / 50) publications. Below 50 Hz that is one or none.
Above, the first goes with the frame and the others are the same message again, with its own stamp, spread evenly over
the 20 ms that the frame lasts. In synchronous mode the state of every frame goes out once, at any rate: that is what a
tick is for. What is *sampled*, as a sensor is, keeps its rate there too, and comes once a frame at most.
"""

from __future__ import annotations

import heapq
import logging
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from typing import Any, Final

from rosbridge_sim.errors import DocumentError, PeerError
from rosbridge_sim.graph.bus import Bus, Owner, Topic, resolve
from rosbridge_sim.schema.store import Message
from rosbridge_sim.world.state import DT

__all__ = ["MAX_RATE", "Feed", "Outputs"]

MAX_RATE: Final = 120.0
"""What MORAI allows for a publisher [Hz]."""

_FRAME_RATE: Final = 50

_FURTHER_EGO = re.compile(r"/Ego-\d+(?=/)")

_log = logging.getLogger("rosbridge_sim.morai")


@dataclass(slots=True, eq=False)
class Feed:
    """One topic that goes out with the frames.

    Attributes:
        topic: on the bus.
        make: the struct of the world as it stands, or None while there is nothing to say; called at most once a
            frame.
        per_frame: how many publications a frame brings, on average.
        is_sampled: it keeps its rate in synchronous mode too.
    """

    topic: Topic
    make: Callable[[], Any]
    per_frame: Fraction = Fraction(1)
    is_sampled: bool = False

    def num_due(self, frame: int) -> int:
        """How many publications this frame brings at its rate."""
        up, down = self.per_frame.numerator, self.per_frame.denominator
        return frame * up // down - (frame - 1) * up // down


class Outputs:
    """The topics that `owner` publishes, most of them alone."""

    def __init__(self, owner: Owner, bus: Bus, rates: Mapping[str, float]) -> None:
        """No topics yet.

        Args:
            owner: the simulator's node.
            bus: where they are published.
            rates: topic -> publications a second of simulated time [Hz]; the others have those of `add`.
        """
        self._owner = owner
        self._bus = bus
        self._rates = {resolve(name): rate for name, rate in rates.items()}
        self._feeds: list[Feed] = []
        self._repeats: list[tuple[float, int, Topic, Message]] = []
        self._ticket = count()

    def add(
        self,
        name: str,
        type_name: str,
        make: Callable[[], Any],
        *,
        is_exclusive: bool = True,
        rate: float = _FRAME_RATE,
        is_sampled: bool = False,
    ) -> None:
        """Publish a topic with every frame, or at its rate; a further ego's at that of the first where it has none.

        Args:
            name: of the topic.
            type_name: its type.
            make: the struct of the world as it stands, or None while there is nothing to say.
            is_exclusive: nobody else may publish there.
            rate: publications a second, unless somebody has chosen another one [Hz].
            is_sampled: in synchronous mode, too, it goes out at its rate in simulated time and not with every frame.

        Raises:
            DocumentError: its rate is none.
            GraphError: somebody has given the topic another type.
        """
        rate = self._rates.get(name, self._rates.get(_of_first_ego(name), rate))
        _check_rate(name, rate)
        topic = self._bus.advertise(self._owner, name, type_name, is_exclusive=is_exclusive, is_on_demand=True)
        per_frame = Fraction(rate).limit_denominator(10_000) / _FRAME_RATE
        self._feeds.append(Feed(topic, make, per_frame, is_sampled))

    def remove(self, prefix: str, now: float) -> None:
        """Publish the topics under a prefix no longer."""
        gone = {feed.topic: None for feed in self._feeds if feed.topic.name.startswith(prefix)}
        self._feeds = [feed for feed in self._feeds if feed.topic not in gone]
        self._repeats = [repeat for repeat in self._repeats if repeat[2] not in gone]
        heapq.heapify(self._repeats)
        for topic in gone:
            self._bus.unadvertise(self._owner, topic.name, now)

    def check_rates(self) -> None:
        """Refuse rates of topics that are not there, once all are; further egos' may come.

        Raises:
            DocumentError: names the first one.
        """
        known = [feed.topic.name for feed in self._feeds]
        for name, rate in self._rates.items():
            _check_rate(name, rate)
            if _of_first_ego(name) not in known:
                raise DocumentError(
                    f"rate of {name}: the simulator publishes {', '.join(known)} at a rate of one's own"
                )

    def show_every(self, frame: int, now: float) -> None:
        """Publish the world as it stands on every topic that somebody listens to; what is sampled when its turn comes.

        Args:
            frame: the world's.
            now: monotonic time [s].
        """
        for feed in self._feeds:
            topic = feed.topic
            if not topic.has_listener or (feed.is_sampled and not feed.num_due(frame)):
                continue
            value = feed.make()
            if value is not None:
                self.publish(topic, Message(topic.type, value), now)

    def show_due(self, frame: int, shown_at: float, now: float) -> None:
        """Publish the world as it stands on the topics whose turn it is, and put what is to be repeated on the list.

        Args:
            frame: the world's.
            shown_at: when it was due [s].
            now: monotonic time [s].
        """
        for feed in self._feeds:
            num = feed.num_due(frame)
            topic = feed.topic
            if not num or not topic.has_listener:
                continue
            value = feed.make()
            if value is None:
                continue
            message = Message(topic.type, value)
            self.publish(topic, message, now)
            for i in range(1, num):
                heapq.heappush(self._repeats, (shown_at + i * DT / num, next(self._ticket), topic, message))

    @property
    def repeat_due(self) -> float | None:
        """When `repeat` has something to do next [s]."""
        return self._repeats[0][0] if self._repeats else None

    def repeat(self, now: float) -> None:
        """Publish again what is due by now."""
        while self._repeats and self._repeats[0][0] <= now:
            _, _, topic, message = heapq.heappop(self._repeats)
            if topic.has_listener:
                self.publish(topic, message, now)

    def forget_repeats(self) -> None:
        """Real time has stopped: nothing is repeated."""
        self._repeats.clear()

    def publish(self, topic: Topic, message: Message, now: float) -> None:
        """Publish one message; a listener's complaint is not the world's business."""
        try:
            self._bus.publish(self._owner, topic, message, now)
        except PeerError as error:
            _log.warning("a listener of %s refused a message: %s", topic.name, error)


def _of_first_ego(name: str) -> str:
    """The first ego's topic that is what this one is of another ego; any other name as it is."""
    return _FURTHER_EGO.sub("", name, count=1)


def _check_rate(name: str, rate: float) -> None:
    if not 0.0 < rate <= MAX_RATE:
        raise DocumentError(f"rate of {name}: expected more than 0 and at most {MAX_RATE:g} Hz; got {rate!r}")
