"""Values of the barrier: its members, their ticks, what happens to it, and what it tells."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rosbridge_sim.errors import Reason
from rosbridge_sim.simulator.sync.barrier_table import BarrierEvent
from rosbridge_sim.simulator.sync.sync_parts import ignore

OnBarrierTick = Callable[[str], None]
"""Takes why the tick was refused; an empty text says that it was carried out."""


@dataclass(slots=True)
class BarrierHooks:
    """Functions that carry out the effects beyond the members; `now` is monotonic time [s].

    Attributes:
        lead: `(time step [ms], now)`, for LEAD.
        end: `(now)`, for END.
        lose: `(now)`, for LOSE.
        move: `(now)`, for MOVE; calls `moved` or `not_moved` once, now or later.
        tell: `(holder, text)`: what other members do.
        warn: `(holder, text, reason)`: that its member is late.
        announce: `(now)`, for ANNOUNCE.
    """

    lead: Callable[[int, float], object] = ignore
    end: Callable[[float], object] = ignore
    lose: Callable[[float], object] = ignore
    move: Callable[[float], object] = ignore
    tell: Callable[[Any, str], object] = ignore
    warn: Callable[[Any, str, Reason], object] = ignore
    announce: Callable[[float], object] = ignore


class BarrierStatus(NamedTuple):
    """The barrier as others see it; members in the order in which they joined.

    Attributes:
        members: user ids of all members, also of those that join or leave at the next boundary.
        ticked: members with a tick that waits.
        waited_for: members that the others wait for.
        joining, leaving: members that come or go at the next boundary.
        late_counts: of each of `members`, at how many boundaries it was late.
    """

    members: list[str]
    ticked: list[str]
    waited_for: list[str]
    joining: list[str]
    leaving: list[str]
    late_counts: list[int]


class BarrierTick(NamedTuple):
    """A tick that waits.

    Attributes:
        holder: the connection that sent it.
        on_end: called once.
    """

    holder: object
    on_end: OnBarrierTick


@dataclass(eq=False, slots=True)
class BarrierMember:
    """One member.

    Attributes:
        holders: the connections that use it.
        heard_at: when one of them last spoke [s].
        is_joining, is_leaving: it comes or goes at the next boundary.
        ticks: those that wait, one for each boundary.
        num_late: boundaries at which it was late.
        is_warned: it has been told that it is late, and has not ticked since.
    """

    user_id: str
    holders: dict[object, None]
    heard_at: float
    is_joining: bool = False
    is_leaving: bool = False
    ticks: deque[BarrierTick] = field(default_factory=deque)
    num_late: int = 0
    is_warned: bool = False


class BarrierHappening(NamedTuple):
    """An event with what its effects need.

    Attributes:
        event: what has happened.
        user_id: the member that it is about.
        holder: the connection that asks.
        step_ms: time step of a first member [ms].
        deadline: longest wait that a first member chooses [s].
        tick: for QUEUE; one at most.
        why: why a tick was refused, or a member is gone.
    """

    event: BarrierEvent
    now: float
    user_id: str = ""
    holder: object = None
    step_ms: int = 0
    deadline: float = 0.0
    tick: tuple[BarrierTick, ...] = ()
    why: str = ""


def end_all(ticks: list[BarrierTick], why: str) -> None:
    """End all waiting ticks for the same reason."""
    for tick in ticks:
        tick.on_end(why)
