"""The scheduler of a running simulator: one timer for the next event.

Events are the world's next frame, the bus's next time-out, and the turns of other parts. The next event is computed
again after each op of a client, except a message for other clients, because it may have changed. The bus and some
clocks announce their times in the bus's `Agenda`, so they are asked when one of these has come; the others are asked
each time. One pass of the loop has one turn with work at most: the sockets are looked at between two of them, even
where the timer, a client's frame and the last turn ask for one at once.
An internal error in the world ends the simulator, because a world that stands still and answers is worse than none. The
error is logged with its traceback, and `failure` gets it.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from rosbridge_sim.errors import RosbridgeSimError
from rosbridge_sim.graph.bus import Bus

_log = logging.getLogger("rosbridge_sim.app")

SHORTEST_WAIT = 0.001
"""Resolution of the timer [s]: uvloop counts whole milliseconds, and would loop without pause for a shorter wait."""


class WorldFailedError(RosbridgeSimError):
    """An internal error has stopped the world; its cause is the original exception."""


class Clock(Protocol):
    """A part of the simulator that has work at certain times.

    If it becomes due earlier by something else than an op, a departure or a call of `advance`, it touches the agenda,
    announces the time there, or calls `look`.
    """

    def next_due(self, now: float, /) -> float | None:
        """Return when `advance` has something to do next [s]; None while that depends on other parts."""

    def advance(self, now: float, /) -> None:
        """Do everything that is due; nothing if it is too early."""


@runtime_checkable
class Endable(Protocol):
    """A clock that the rest of the simulator does not need."""

    def end(self, error: Exception) -> None:
        """End for ever because of a failure. After this, `next_due` returns None, and `advance` does nothing."""


class Scheduler:
    """Calls the bus, the world and other clocks when they are due.

    Attributes:
        failure: gets WorldFailedError if the world fails; otherwise it is never done.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        bus: Bus,
        clocks: Sequence[Clock],
        on_failure: Callable[[], None],
        announcing: Sequence[Clock] = (),
    ) -> None:
        """Create a scheduler; the first `look` sets the timer.

        Args:
            bus: its time-outs come first.
            clocks: get their turns after it, in this order.
            on_failure: called once if one of them fails.
            announcing: clocks that announce in the bus's agenda when they are due; they get their turns last.
        """
        self.failure: asyncio.Future[None] = loop.create_future()
        self._loop = loop
        self._bus = bus
        self._agenda = bus.agenda
        self._clocks = tuple(clocks)
        self._announcing = tuple(announcing)
        self._on_failure = on_failure
        self._timer: asyncio.TimerHandle | None = None
        self._armed_for = math.inf
        self._due = math.inf  # the next event
        self._is_looking = False
        self._is_resting = False  # a turn with work was in this pass of the loop
        self._is_wanted = False  # another one was asked for since
        self._is_stopped = False

    @property
    def is_failed(self) -> bool:
        """True once the world has failed."""
        return self.failure.done()

    def add(self, clock: Clock) -> None:
        """Add a clock."""
        self._clocks += (clock,)

    def look(self) -> None:
        """Ask all clocks for the next event in the next turn of the loop, once for all changes in this turn."""
        self._agenda.first = -math.inf
        self._look_soon()

    def _look_soon(self) -> None:
        if self._is_resting:
            self._is_wanted = True
        elif not self._is_looking:
            self._is_looking = True
            self._loop.call_soon(self._turn)

    def turn(self) -> None:
        """Compute the next event now, at the end of a pass of the loop, if it may have changed or has come.

        It does nothing if `look` was called already.
        """
        if not self._is_looking and (self._agenda.is_touched or self._due <= self._loop.time()):
            self._turn()

    def stop(self) -> None:
        """Stop all calls."""
        self._is_stopped = True
        if self._timer is not None:
            self._timer.cancel()

    def _turn(self) -> None:
        """Do everything that is due, then set the timer for the next event."""
        self._is_looking = False
        if self._is_stopped:
            return
        now = self._loop.time()
        try:
            due = self._next_due(now)
            if due <= now:
                if self._is_resting:
                    self._is_wanted = True
                    return
                self._is_resting = True
                self._loop.call_soon(self._end_rest)
                self._bus.expire(now)
                for clock in (*self._clocks, *self._announcing):
                    self._advance(clock, now)
                due = self._next_due(now)
        except Exception as error:  # noqa: BLE001 - any internal error
            self._fail(error)
        else:
            if not due == self._armed_for == math.inf:
                self._arm(now, due)

    def _end_rest(self) -> None:
        """Allow another turn with work, in the pass of the loop after that of the last one."""
        self._is_resting = False
        if self._is_wanted:
            self._is_wanted = False
            self._turn()

    def _advance(self, clock: Clock, now: float) -> None:
        """Give a clock its turn."""
        try:
            clock.advance(now)
        except Exception as error:  # noqa: BLE001 - an internal error
            self._blame(clock, error)

    def _blame(self, clock: Clock, error: Exception) -> None:
        """End a clock that has failed, if it can be ended alone.

        Raises:
            Exception: `error`, if it cannot be ended alone, because it is the world.
        """
        guard = self._bus.guard
        if isinstance(clock, Endable):
            guard.num_faults += 1
            guard.attempt("the end of a clock", clock.end, error)
        else:
            guard.blame(clock, error)

    def _next_due(self, now: float) -> float:
        """Return when the next event is [s]; infinity if none is to come."""
        agenda = self._agenda
        if agenda.first <= now:
            agenda.first = math.inf
            agenda.announce(self._bus.next_deadline())
            agenda.announce(self._ask(self._announcing, now))
        agenda.is_touched = False
        self._due = min(agenda.first, self._ask(self._clocks, now))
        return self._due

    def _ask(self, clocks: Sequence[Clock], now: float) -> float:
        """Return when the first of some clocks is due [s]; infinity if none is."""
        due = math.inf
        for clock in clocks:
            try:
                other = clock.next_due(now)
            except Exception as error:  # noqa: BLE001 - an internal error
                self._blame(clock, error)
                continue
            if other is not None and other < due:
                due = other
        return due

    def _arm(self, now: float, due: float) -> None:
        if due <= now:  # more is due than one turn may do: others come first
            self._look_soon()
            return
        wanted = max(due, now + SHORTEST_WAIT)
        if wanted == self._armed_for:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._armed_for = wanted
        self._timer = None if wanted == math.inf else self._loop.call_at(wanted, self._on_timer)

    def _on_timer(self) -> None:
        self._timer = None
        self._armed_for = math.inf
        self._look_soon()

    def _fail(self, error: Exception) -> None:
        self.stop()
        _log.critical("internal error: the world has failed", exc_info=error)
        failed = WorldFailedError(f"the world has failed: {error!r}")
        failed.__cause__ = error
        self.failure.set_exception(failed)
        self.failure.exception()  # so that asyncio does not log it if no task waits for it
        self._on_failure()
