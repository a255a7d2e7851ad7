"""The scheduler of a running simulator: one timer, set for what is due next.

That is the world's next frame, the bus's next time-out or another part's turn. It is looked at anew after each frame
that a client sends, since that may have changed what is due.

An internal error in the world ends the simulator, because one that stands still and answers is worse than none. The
error is logged with its traceback, and `failure` ends with it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from rosbridge_sim.errors import RosbridgeSimError
from rosbridge_sim.graph.bus import Bus

__all__ = ["Clock", "Scheduler", "WorldFailedError"]

_log = logging.getLogger("rosbridge_sim.app")

SHORTEST_WAIT = 0.001
"""The timer's grain [s]: uvloop counts whole milliseconds, and would spin through a shorter wait."""


class WorldFailedError(RosbridgeSimError):
    """An internal error has stopped the world; its cause is the exception that was raised."""


class Clock(Protocol):
    """A part of the simulator that has work at certain times."""

    def next_due(self, now: float) -> float | None:
        """Return when `advance` has something to do next [s]; None while that depends on other parts."""

    def advance(self, now: float) -> None:
        """Do what is due by now [s]; nothing if it is too early."""


@runtime_checkable
class Endable(Protocol):
    """A clock that the rest of the simulator can do without."""

    def end(self, error: Exception) -> None:
        """End for good, because of a failure. From then on `next_due` is None, and `advance` does nothing."""


class Scheduler:
    """Calls what is due on a bus, in the world and in other clocks.

    Attributes:
        failure: ends with WorldFailedError if the world fails, and never otherwise.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, bus: Bus, clocks: Sequence[Clock], on_failure: Callable[[], None]
    ) -> None:
        """Set no timer before the first `look`.

        Args:
            loop: has the time and the timer.
            bus: its time-outs come first.
            clocks: get their turns after it, in this order.
            on_failure: called once if one of them fails.
        """
        self.failure: asyncio.Future[None] = loop.create_future()
        self._loop = loop
        self._bus = bus
        self._clocks = tuple(clocks)
        self._on_failure = on_failure
        self._timer: asyncio.TimerHandle | None = None
        self._armed_for = float("inf")
        self._is_looking = False
        self._is_stopped = False

    @property
    def is_failed(self) -> bool:
        """True once the world has failed."""
        return self.failure.done()

    def add(self, clock: Clock) -> None:
        """Add a clock."""
        self._clocks += (clock,)

    def look(self) -> None:
        """Check what is due, once for all that changes in this turn of the loop."""
        if not self._is_looking:
            self._is_looking = True
            self._loop.call_soon(self._turn)

    def turn(self) -> None:
        """Check what is due now, at the end of a pass of the loop, unless `look` was called already."""
        if not self._is_looking:
            self._turn()

    def stop(self) -> None:
        """Call nothing more."""
        self._is_stopped = True
        if self._timer is not None:
            self._timer.cancel()

    def _turn(self) -> None:
        """Do what is due, then arm the timer for what is due next."""
        self._is_looking = False
        if self._is_stopped:
            return
        now = self._loop.time()
        try:
            due = self._next_due(now)
            if due is not None and due <= now:
                self._bus.expire(now)
                for clock in self._clocks:
                    self._advance(clock, now)
                due = self._next_due(now)
        except Exception as error:  # noqa: BLE001 - our own bug, whatever it is
            self._fail(error)
        else:
            self._arm(now, due)

    def _advance(self, clock: Clock, now: float) -> None:
        """Give a clock its turn."""
        try:
            clock.advance(now)
        except Exception as error:  # noqa: BLE001 - our own bug
            self._blame(clock, error)

    def _blame(self, clock: Clock, error: Exception) -> None:
        """End a clock that has failed, if it can end alone.

        Raises:
            Exception: `error`, where it cannot: it is the world.
        """
        guard = self._bus.guard
        if isinstance(clock, Endable):
            guard.num_faults += 1
            guard.attempt("the end of a clock", clock.end, error)
        else:
            guard.blame(clock, error)

    def _next_due(self, now: float) -> float | None:
        due = self._bus.next_deadline()
        for clock in self._clocks:
            try:
                other = clock.next_due(now)
            except Exception as error:  # noqa: BLE001 - our own bug
                self._blame(clock, error)
                continue
            if due is None or (other is not None and other < due):
                due = other
        return due

    def _arm(self, now: float, due: float | None) -> None:
        if due is not None and due <= now:  # more is owed than one turn may do: the others first
            self.look()
            return
        wanted = float("inf") if due is None else max(due, now + SHORTEST_WAIT)
        if wanted == self._armed_for:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._armed_for = wanted
        self._timer = None if due is None else self._loop.call_at(wanted, self._on_timer)

    def _on_timer(self) -> None:
        self._timer = None
        self._armed_for = float("inf")
        self._turn()

    def _fail(self, error: Exception) -> None:
        self.stop()
        _log.critical("internal error: the world has failed", exc_info=error)
        failed = WorldFailedError(f"the world has failed: {error!r}")
        failed.__cause__ = error
        self.failure.set_exception(failed)
        self.failure.exception()  # so that asyncio does not log it where nothing waits for it
        self._on_failure()
