"""Flow control towards a rosbridge that accepts everything at once and slows no client down.

rosbridge_suite reads a socket as fast as frames come, and keeps them in a queue without a limit. So the socket never
fills, however late the server is, and neither TCP nor a ping shows the delay. But it handles the frames of one socket
in order: the answer to a cheap call comes after everything that was sent before. Such a call is a *probe*. Frames sent
after the last answered probe are in flight.

There are two kinds of frames, with a window each. *Ordered* frames are never left out (announcements, answers, the
topics of a tick); their window only keeps the bridge's queue short. *Fresh* frames are topic messages that a newer one
replaces; the age of the data in them matters. Their window follows the measured round trips of the probes: it is so
large that the bridge needs AIM to handle it. It is counted in frames and in cost, because a slow bridge may be slow
with each frame or with each byte; whatever is full first stops the sending. At least one frame is always allowed, or
else nothing would be measured.
A part of a round trip is not due to our frames: the network, a busy rosapi, other connections of the bridge. This
*latency* is the shortest round trip. The window is larger by what the bridge handles during it, and
several probes are in flight then, so that a slow rosapi does not slow the frames down. At a bridge that is always busy
with our frames, the shortest round trip would contain their queue. So the window is small for one round trip now and
then, which shows the latency again.
Large frames have a connection of their own, whose bridge works for small frames meanwhile. There the latency is that of
the other connection, and after each confirmed frame there is a rest as long as the frame took: so large frames never
take more than half of the bridge's time.
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

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

FRAME_COST = 1_500
"""Cost of a frame in addition to its bytes [bytes]."""

MAX_IN_FLIGHT = 512 * 1024
"""Cost of the ordered frames that may be in flight, and the largest window of the fresh ones, without latency [bytes].
It is FULL_TIME of rosbridge_suite's work on a core of its own, about 250 messages of an ego's state."""

FULL_TIME: Final = 0.1
"""Time in which rosbridge_suite handles MAX_IN_FLIGHT [s]."""

MAX_LATENCY: Final = 3.0
"""Longest latency for which a window grows [s], so that the frames in flight are at most 16 MB."""

AIM: Final = 0.05
"""Time that the far side should need for the fresh frames in flight [s], two or three frames of the world. With the
latency of a busy bridge, data there is less than 0.1 s old."""

NOISE: Final = 0.25
"""Differences between round trips of a long latency that say nothing about the far side's work, as its part."""

GROWTH: Final = 1.5
"""Growth of a window at an answer if the far side needs less than half of AIM for it, as TCP's slow start."""

PROBE_SPACING: Final = 0.05
"""Shortest time between two probes in flight [s]; a call of rosapi costs rosbridge_suite as much as ten messages."""

MAX_IN_AIR: Final = 4
"""Probes in flight at once: enough that a slow rosapi is not waited for, and few enough that it is not flooded."""

BASE_PERIOD: Final = 5.0
"""Time after which the latency is measured again [s]."""

PERIOD_OF_ROUND_TRIPS: Final = 10.0
"""That time in round trips, if it is longer: measuring takes one."""

DRAINED: Final = 0.25
"""The part of the window that is used while the latency is measured. A queue then counts for a quarter, so the measured
latency is at most AIM / 3 too long, and data does not grow old for it."""

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

    def is_used(self, part: float, *, since: float = 0.0) -> bool:
        """Return True if a part of the limit is in flight, of what was sent after `since`."""
        return self.sent - max(self.done, since) >= part * self.limit

    def forgive(self, part: float) -> None:
        """Let only half of a part of the limit be in flight, because no answer has come."""
        self.done = max(self.done, self.sent - part * self.limit / 2)

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
        latency: round trip of a probe without our own frames before it [s]: network, rosapi, other connections.
        round_trip: the last measured round trip of a probe [s]; None before the first.
    """

    def __init__(self, other_latency: Callable[[], float] | None = None) -> None:
        """Begin without probes.

        Args:
            other_latency: for large frames: returns the latency of the connection for small frames to the same bridge.
        """
        self._other_latency = other_latency
        self._rest_until: float | None = None
        self._confirmed_at = -math.inf  # when the last probe was answered
        self.is_on = True
        self.is_late = False
        self.latency = 0.0
        self._drain_after: int | None = 0  # while the window is small: number of the last probe before that
        self._drain_at = 0.0  # when it is small again [s]
        self._num_open = 0  # probes without an answer since the last time-out
        self._last_probe = -math.inf  # when the last one was sent
        self.round_trip: float | None = None
        self._ordered = _Window(MAX_IN_FLIGHT)
        self._cost = _Window(MAX_IN_FLIGHT)
        self._frames = _Window(FIRST_FRAMES)
        self._sum_time = self._sum_cost = self._sum_frames = 0.0
        self._probes: deque[_Probe] = deque(maxlen=MAX_PROBES)
        self._num_probes = self._num_refusals = 0
        self._wait = self._last_age = self._longest_age = 0.0
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
        if not self.is_on:
            return True
        if self._rest_until is not None:
            return False
        part = self._part
        return not (self._cost.is_used(part) or self._frames.is_used(part) or self._ordered.is_full)

    @property
    def _part(self) -> float:
        """The part of the windows of fresh frames that is used now."""
        return 1.0 if self._drain_after is None else DRAINED

    def wants_probe(self, now: float) -> bool:
        """Return True if a probe should be sent now, because a part of a window was sent since the last one.

        It is a half, or a quarter while another one is on its way; those have pauses between them.
        """
        if not self.is_on:
            return False
        if self._num_open:
            spacing = max(PROBE_SPACING, (self.round_trip or 0.0) / MAX_IN_AIR)
            if self._num_open >= MAX_IN_AIR or now - self._last_probe < spacing:
                return False
        part = self._part * (0.25 if self._num_open else 0.5)
        last = self._probes[-1] if self._num_open else None
        cost, frames = (0.0, 0.0) if last is None else (last.cost, last.num_frames)
        is_used = self._cost.is_used(part, since=cost) or self._frames.is_used(part, since=frames)
        return self._ordered.is_used(0.5, since=cost) or (self._wants_room and is_used)

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
        self._num_open += 1
        self._last_probe = now
        if self._due is None:
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
            self._num_open = 0
            self._due = None  # the next probe is sent soon
            return
        self.is_on = self.is_late = False
        self._probes.clear()
        self._num_open = 0
        self._due = now + self._patience
        self._patience = min(MAX_PATIENCE, 2 * self._patience)

    def note_answer(self, number: int, now: float) -> None:
        """Register the answer to a probe; all earlier probes were handled, too."""
        while self._probes and self._probes[0].number <= number:
            probe = self._probes.popleft()
            if probe.number == number:
                self._confirm(probe, now)
        self._num_open = min(self._num_open, len(self._probes))
        if not self._num_open:
            self._due = None

    def _confirm(self, probe: _Probe, now: float) -> None:
        self._ordered.done = self._cost.done = probe.cost
        self._frames.done = probe.num_frames
        self._patience = PATIENCE
        self._num_refusals = 0
        self.is_late = False
        self.round_trip = max(now - probe.sent_at, 0.0)
        if self._due is not None:
            self._due = now + self.patience
        self._note_latency(probe, self.round_trip, now)
        self._last_age = self.round_trip + probe.wait
        self._longest_age = max(self._longest_age, self._last_age)
        self._sum_time = MEMORY * self._sum_time + self.round_trip - self.latency
        self._sum_cost = MEMORY * self._sum_cost + probe.load_cost
        self._sum_frames = MEMORY * self._sum_frames + probe.num_load
        self._ordered.limit = MAX_IN_FLIGHT * (1 + self.latency / FULL_TIME)
        self._cost.limit = min(
            self._ordered.limit, max(1.0, self._better_limit(self._cost, self._sum_cost, probe.load_cost))
        )
        self._frames.limit = max(1.0, self._better_limit(self._frames, self._sum_frames, probe.num_load))

    def _better_limit(self, window: _Window, sum_load: float, load: float) -> float:
        """Return the limit with which the far side needs AIM, by the measured time for its loads.

        Where the latency is long, little is known of that time while the window is small, so it grows step by step.
        """
        full_time = self._sum_time / sum_load * window.limit
        aim = max(AIM, NOISE * self.latency)
        limit = window.limit * (aim + self.latency) / max(self.latency + full_time, 1e-6)
        if full_time < aim / 2:
            limit = max(limit, GROWTH * window.limit)
        is_known = load >= window.limit / 4  # a part that was not used is not known to be good
        return limit if is_known else min(limit, window.limit)

    def _note_latency(self, probe: _Probe, round_trip: float, now: float) -> None:
        """Keep the latency, and begin or end to measure it anew."""
        if self._drain_after is None:
            self.latency = min(self.latency, round_trip)
            is_queueing = round_trip - self.latency > AIM / 2
            if now >= self._drain_at and is_queueing:
                self._drain_after = self._num_probes
        elif probe.number > self._drain_after:
            if probe.num_load <= DRAINED * self._frames.limit + 2:
                self.latency = round_trip
            if probe.num_load <= DRAINED * self._frames.limit + 2 or probe.number > self._drain_after + MAX_IN_AIR:
                self._drain_after = None
                self._drain_at = now + max(BASE_PERIOD, PERIOD_OF_ROUND_TRIPS * round_trip)
        self.latency = min(MAX_LATENCY, self.latency)
        if self._other_latency is not None:
            self.latency = min(self.latency, self._other_latency())
            busy = min(round_trip - self.latency, now - self._confirmed_at)
            if busy > 0.0:
                self._rest_until = now + busy
        self._confirmed_at = now

    def age(self, now: float) -> float:
        """Return how old topic messages are when the far side handles them, by the last round trip [s].

        While an answer is missing, it is at least the time since the question.
        """
        if not self._probes:
            return self._last_age
        first = self._probes[0]
        return max(self._last_age, now - first.sent_at + first.wait)

    def take_longest_age(self, now: float) -> float:
        """Return the longest `age` since the last call of this method [s]."""
        longest, self._longest_age = max(self._longest_age, self.age(now)), 0.0
        return longest

    @property
    def due(self) -> float | None:
        """Return when `expire` has something to do [s]."""
        if self._due is None or self._rest_until is None:
            return self._rest_until if self._due is None else self._due
        return min(self._due, self._rest_until)

    def expire(self, now: float) -> bool:
        """End a rest, and check the time-out of the oldest probe. After a time-out, more may be sent.

        If probes were refused, they are tried again when the pause is over.

        Returns:
            True if more may be sent now.
        """
        is_rested = self._rest_until is not None and now >= self._rest_until
        if is_rested:
            self._rest_until = None
        return self._is_overdue(now) or is_rested

    def _is_overdue(self, now: float) -> bool:
        if self._due is None or now < self._due:
            return False
        self._due = None
        windows = (self._ordered, self._cost, self._frames)
        if not self.is_on:
            self.is_on = True
            for window in windows:
                window.restart()
            return False
        self._ordered.forgive(1.0)
        for window in (self._cost, self._frames):
            window.forgive(self._part)
        self._num_open = 0
        self._patience = min(MAX_PATIENCE, 2 * max(self._patience, self.patience))
        self.is_late = True
        return True
