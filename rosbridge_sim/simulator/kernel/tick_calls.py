"""Calls for ticks: what waits for its turn in `sync_driver`, and the results that callers get."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from rosbridge_sim.errors import Reason


class ModeResult(NamedTuple):
    """Answer to a request about the mode.

    Attributes:
        is_accepted: it is carried out.
        why: for a refusal, a text for the peer; empty otherwise.
        reason: the kind of refusal that `why` puts into words.
    """

    is_accepted: bool
    why: str
    reason: Reason


class TickResult(NamedTuple):
    """Result of a tick.

    Attributes:
        is_accepted: its frames have been computed.
        is_paused: the simulation was paused at the time of the decision.
        why: for a refusal, a text for the peer; empty otherwise.
        reason: the kind of refusal that `why` puts into words.
    """

    is_accepted: bool
    is_paused: bool
    why: str = ""
    reason: Reason = Reason.NOT_NOW


OnTick = Callable[[TickResult], None]


class WaitingTicks(Protocol):
    """A call for ticks that may wait.

    Attributes:
        num_left: ticks that are still to be carried out, with one that has begun.
        num_at_once: how many of them may be carried out before `after_ticks` and the next `before_tick`, at least 1.
        is_wanted: false if the caller has left or waits no longer; then the ticks that are left are given up, except
            one that has begun.
    """

    num_left: int

    @property
    def num_at_once(self) -> int:
        """See above."""

    @property
    def is_wanted(self) -> bool:
        """See above."""

    def before_tick(self) -> None:
        """Prepare the tick that follows, such as by commands that go before its first frame."""

    def after_ticks(self, num: int) -> bool:
        """Count ticks as done; return whether those that are left are to be given up: a condition to stop is met."""

    def end(self, result: TickResult) -> None:
        """Answer the caller; called once. It is not accepted if another event has ended the call.

        A tick may have begun and not be done.
        """


class OneTick:
    """One tick, which is carried out even if its caller has left: other clients count on it."""

    is_wanted = True
    num_at_once = 1

    def __init__(self, on_end: OnTick) -> None:
        self.num_left = 1
        self.end = on_end

    def before_tick(self) -> None:
        """Do nothing: its commands wait already."""

    def after_ticks(self, num: int) -> bool:
        """Count the tick; nothing is left to give up."""
        self.num_left -= num
        return False


class WaitingCall:
    """A call that waits for its turns.

    Attributes:
        steps: what is to be done.
        num_frames: of each tick.
        release: lets its caller's next op be handled; None while it is not held. It takes monotonic time [s].
        why: why the ticks that are left are refused, where that has happened within a tick of this call.
        is_over: it has been answered.
    """

    __slots__ = ("is_over", "num_frames", "release", "steps", "why")

    def __init__(self, steps: WaitingTicks, num_frames: int) -> None:
        self.steps = steps
        self.num_frames = num_frames
        self.release: Callable[[float], None] | None = None
        self.why: str | None = None
        self.is_over = False

    def end(self, result: TickResult, now: float) -> None:
        """Answer the caller, and let it go on."""
        self.is_over = True
        try:
            self.steps.end(result)
        finally:
            if self.release is not None:
                self.release(now)
