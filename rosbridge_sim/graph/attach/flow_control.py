"""Flow control towards a rosbridge that accepts everything at once and slows no client down.

rosbridge_suite reads a socket as fast as frames come, and keeps them in a queue without a limit. So the socket never
fills, however late the server is, and neither TCP nor a ping shows the delay. But it handles the frames of one socket
in order: the answer to a cheap call comes after everything that was sent before. Such a call is a *probe*. Frames sent
after the last answered probe are in flight.

There are two kinds of frames, with a window each. *Ordered* frames are never left out (announcements, answers, the
topics of a tick); their window is fixed and only keeps the bridge's queue short. *Fresh* frames are topic messages that
a newer one replaces; the age of the data in them matters. Their window follows the measured round trips of the probes:
it is so large that the bridge needs AIM to handle it. It is counted in frames and in cost, because a slow bridge may be
slow with each frame or with each byte; whatever is full first stops the sending. At least one frame is always allowed,
or else nothing would be measured.
The cost of a frame in rosbridge_suite was measured: about 0.28 ms, and 0.18 us per byte. So a frame costs its bytes
plus 1,500.
If a probe is not answered in time, another half of a window may be sent; then the waiting time doubles, and so on. So a
slow bridge is never flooded, and a bridge that answers no calls still gets a minimum rate. A late answer counts like
any other. The waiting time follows the measured round trips, too.
A bridge that *refuses* the call does not have the service: then there are no probes for a while, and only the socket
limits the rate. The probe is tried again at growing intervals, because rosapi is a separate program and may start after
the bridge. If the service was there before, a single refusal is only a time-out inside the bridge.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

__all__ = ["AIM", "FIRST_FRAMES", "FRAME_COST", "MAX_IN_FLIGHT", "MAX_PATIENCE", "PATIENCE", "FlowControl"]

FRAME_COST = 1_500
"""Cost of a frame in addition to its bytes [bytes]."""

MAX_IN_FLIGHT = 512 * 1024
"""Cost of the ordered frames that may be in flight, and the largest window of the fresh ones [bytes]. It is a tenth of
a second of rosbridge_suite's work on a core of its own, about 250 messages of an ego's state."""

AIM: Final = 0.1
"""Time that the far side should need for the fresh frames in flight [s]: five frames of the world, so that a program
there controls a car nearly as well as beside the simulator, and still several messages for each probe."""

FIRST_FRAMES: Final = 20
"""Fresh frames in flight before the first answer: one of each topic of the simulator."""

PATIENCE, MAX_PATIENCE = 2.0, 60.0
"""Waiting time for the answer to a probe: the shortest, and the longest [s]."""

ROUND_TRIPS_OF_PATIENCE: Final = 4.0
"""The waiting time in round trips: a bridge's load varies, and a bridge that is only slow is not silent."""

MEMORY: Final = 0.8
"""Weight of the former round trips at each new one: a window follows a changed bridge within about five answers."""

MAX_REFUSALS: Final = 1
"""Refused probes in a row that do not count, after an answered one."""

MAX_PROBES = 16
"""Unanswered probes that are remembered; by then the last ones are minutes apart."""


@dataclass(slots=True)
class _Window:
    """An amount that was sent, and how much of it is known to be handled.

    Attributes:
        limit: amount that may be in flight.
        sent, done: amounts since the beginning.
    """

    limit: float
    sent: float = 0.0
    done: float = 0.0

    @property
    def in_flight(self) -> float:
        return self.sent - self.done

    @property
    def is_full(self) -> bool:
        return self.in_flight >= self.limit

    @property
    def is_half_full(self) -> bool:
        return self.in_flight >= self.limit / 2

    def forgive(self) -> None:
        """Allow half a window more, because no answer has come."""
        self.done = max(self.done, self.sent - self.limit) + self.limit / 2

    def restart(self) -> None:
        """Take all as handled."""
        self.done = self.sent


class _Probe(NamedTuple):
    """A probe that is on its way.

    Attributes:
        sent_at: monotonic time [s].
        cost, num_frames: sent since the beginning, itself included.
        load_cost, num_load: in flight when it was sent, itself included.
        wait: longest time that the fresh frames since the last probe had waited before they were sent [s].
    """

    number: int
    sent_at: float
    cost: float
    num_frames: float
    load_cost: float
    num_load: float
    wait: float


class FlowControl:
    """The frames that may still be sent on one socket.

    Attributes:
        is_on: the far side answers probes, as far as we know. If not, everything may be sent.
        is_late: the last probe was not answered in time.
        latency: time of the network alone, there and back [s]; it is no delay of the bridge.
        round_trip: the last measured round trip of a probe [s]; None before the first.
    """

    __slots__ = (
        "_cost",
        "_due",
        "_frames",
        "_last_age",
        "_num_probes",
        "_num_refusals",
        "_ordered",
        "_patience",
        "_probes",
        "_sum_cost",
        "_sum_frames",
        "_sum_time",
        "_wait",
        "_wants_room",
        "is_late",
        "is_on",
        "latency",
        "round_trip",
    )

    def __init__(self) -> None:
        self.is_on = True
        self.is_late = False
        self.latency = 0.0
        self.round_trip: float | None = None
        self._ordered = _Window(MAX_IN_FLIGHT)
        self._cost = _Window(MAX_IN_FLIGHT)
        self._frames = _Window(FIRST_FRAMES)
        self._sum_time = self._sum_cost = self._sum_frames = 0.0
        self._probes: deque[_Probe] = deque(maxlen=MAX_PROBES)
        self._num_probes = self._num_refusals = 0
        self._wait = self._last_age = 0.0
        self._wants_room = False
        self._due: float | None = None
        self._patience = PATIENCE

    # What may be sent

    @property
    def is_full(self) -> bool:
        """True if no ordered frame may be sent now; a probe is on its way or needed then."""
        return self.is_on and self._ordered.is_full

    @property
    def has_room(self) -> bool:
        """True if a fresh frame may be sent now."""
        return not self.is_on or not (self._cost.is_full or self._frames.is_full or self._ordered.is_full)

    @property
    def wants_probe(self) -> bool:
        """True if a probe should be sent now: none is on its way, and a half of a window is used."""
        if not self.is_on or self._due is not None:
            return False
        is_half_used = self._cost.is_half_full or self._frames.is_half_full
        return self._ordered.is_half_full or (self._wants_room and is_half_used)

    @property
    def num_in_flight(self) -> float:
        """Frames that the far side has not handled yet, as far as we know."""
        return self._frames.in_flight

    def note_sent(self, size: int, *, wait: float | None = None) -> None:
        """Count a frame that was sent.

        Args:
            size: its length [bytes].
            wait: time for which a fresh frame has waited here [s]; None for an ordered frame.
        """
        self._count(size + FRAME_COST)
        if wait is not None:
            self._wants_room = True
            self._wait = max(self._wait, wait)

    def _count(self, cost: float) -> None:
        self._ordered.sent += cost
        self._cost.sent += cost
        self._frames.sent += 1

    def note_waiting(self) -> None:
        """Note that a fresh frame waits for room, so that a probe is sent even if only ordered frames are in flight."""
        self._wants_room = True

    # Probes

    def probe(self, now: float) -> int:
        """Register a probe that is sent now."""
        self._num_probes += 1
        self._count(FRAME_COST)
        cost, frames = self._cost, self._frames
        load = max(cost.in_flight, FRAME_COST), max(frames.in_flight, 1.0)
        self._probes.append(_Probe(self._num_probes, now, cost.sent, frames.sent, *load, self._wait))
        self._due = now + max(self._patience, self.patience)
        self._wait, self._wants_room = 0.0, False
        return self._num_probes

    @property
    def patience(self) -> float:
        """Time in which an answer should come, by the measured round trips [s]."""
        return min(MAX_PATIENCE, max(PATIENCE, ROUND_TRIPS_OF_PATIENCE * (self.round_trip or 0.0)))

    def note_refusal(self, now: float) -> None:
        """Pause probes for a while, because one was refused."""
        self._num_refusals += 1
        if self.round_trip is not None and self._num_refusals <= MAX_REFUSALS:
            self._probes.clear()
            self._due = None  # the next probe is sent soon
            return
        self.is_on = self.is_late = False
        self._probes.clear()
        self._due = now + self._patience
        self._patience = min(MAX_PATIENCE, 2 * self._patience)

    def note_answer(self, number: int, now: float) -> None:
        """Register the answer to a probe; all earlier probes were handled, too.

        Args:
            number: number of the probe.
        """
        while self._probes and self._probes[0].number <= number:
            probe = self._probes.popleft()
            if probe.number == number:
                self._confirm(probe, now)
        if not self._probes:
            self._due = None

    def _confirm(self, probe: _Probe, now: float) -> None:
        self._ordered.done = self._cost.done = probe.cost
        self._frames.done = probe.num_frames
        self._patience = PATIENCE
        self._num_refusals = 0
        self.is_late = False
        self.round_trip = max(now - probe.sent_at, 0.0)
        self._last_age = self.round_trip + probe.wait
        self._sum_time = MEMORY * self._sum_time + self.round_trip
        self._sum_cost = MEMORY * self._sum_cost + probe.load_cost
        self._sum_frames = MEMORY * self._sum_frames + probe.num_load
        if self._sum_time > 0.0:
            share = (AIM + self.latency) / self._sum_time
            self._cost.limit = min(MAX_IN_FLIGHT, max(1.0, self._sum_cost * share))
            self._frames.limit = max(1.0, self._sum_frames * share)

    def age(self, now: float) -> float:
        """Return how old topic messages are when the far side handles them, by the last round trip [s].

        While an answer is missing, it is at least the time since the question.
        """
        if not self._probes:
            return self._last_age
        first = self._probes[0]
        return max(self._last_age, now - first.sent_at + first.wait)

    @property
    def due(self) -> float | None:
        """Return when `expire` has something to do [s]."""
        return self._due

    def expire(self, now: float) -> bool:
        """Check the time-out of the last probe. After a time-out, more may be sent.

        If probes were refused, they are tried again when the pause is over.

        Returns:
            True if the answer is overdue.
        """
        if self._due is None or now < self._due:
            return False
        self._due = None
        windows = (self._ordered, self._cost, self._frames)
        if not self.is_on:
            self.is_on = True
            for window in windows:
                window.restart()
            return False
        for window in windows:
            window.forgive()
        self._patience = min(MAX_PATIENCE, 2 * max(self._patience, self.patience))
        self.is_late = True
        return True
