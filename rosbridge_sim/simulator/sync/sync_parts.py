"""Values of synchronous mode: what happens to it, and what it calls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from rosbridge_sim.simulator.sync.sync_table import FRAME_MS, SyncEvent

C = TypeVar("C")
"""Type of a command; the caller chooses it."""


def ignore(*_args: object) -> None:
    """Do nothing: a hook that is not set yet."""


@dataclass(slots=True)
class SyncHooks:
    """Functions for the effects beyond the mode; `now` is monotonic time [s].

    Attributes:
        move: `(number of frames, now)`, for MOVE; the commands of `Sync.due` are carried out before each frame. Returns
            how many frames it has computed, or None for all. Fewer are allowed only within `take_turn`.
        refuse: `(text for the callers, now)`, for REFUSE.
        flow: `(now)`, for FLOW.
        announce: `(now)`, for ANNOUNCE.
        hear: `(holder, now)`, for a command of any peer, and for the end of a time in which its input was held back.
    """

    move: Callable[[int, float], int | None] = ignore
    refuse: Callable[[str, float], object] = ignore
    flow: Callable[[float], object] = ignore
    announce: Callable[[float], object] = ignore
    hear: Callable[[object, float], object] = ignore


class SyncHappening(NamedTuple, Generic[C]):
    """An event with the data for its effects.

    Attributes:
        event: what has happened.
        user_id, step_ms, holder: of the master, for LEAD.
        num_frames: of the tick, for MOVE and WAIT.
        num_ticks: how many of these, for WAIT.
        on_wait: called by WAIT.
        command: for QUEUE; one at most.
        due: the frame that the command waits for.
        named: the frame that it names, which may be past.
        is_ready: whether the command can be carried out.
    """

    event: SyncEvent
    now: float
    num_frames: int = 0
    num_ticks: int = 1
    on_wait: Callable[[], object] | None = None
    user_id: str = ""
    step_ms: int = FRAME_MS
    holder: object = None
    command: tuple[C, ...] = ()
    due: int = 0
    named: int = 0
    is_ready: bool = True
