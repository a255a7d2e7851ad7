"""Replay: a recorded drive shown again, from a bag or as somebody tells it; who moves the world; a table.

The states are four. Whether the world stands is not among them: a pause is synchronous mode's (see `sync`), one for
the whole simulator, whoever asks for it.

    SIMULATING   the world is its own
    REPLAYING    a bag moves it, frame by frame
    AT_END       the bag is over; the last of it stays, and the world is paused
    FOLLOWING    a client publishes what it replays (*network replay*), and the world follows

The decisions, and why:

- What is recorded is shown with frames, 20 ms of it with each (times the speed), in real time and by ticks alike. The
  first frame shows the place that was asked for, so frame for frame comes out what was recorded. Time, stamps and
  traffic lights are the simulation's own.
- Rows are placed within the step, behind all motion and before contacts: whom they pass they meet, as in the drive.
- Who is not replayed (by `replay_target_option`, or since the bag does not hold him) goes on by himself. So vehicles
  from a bag meet a car that a program drives.
- Nobody commands whom a recording moves, and nobody else comes or goes meanwhile.
- Stop gives the world back as it was before, paused if it was. In simulation mode play and pause are those of the
  simulator, and stop begins the scenario anew: the last one that was loaded onto a cleared stage, else the opening one.
- Play at the end begins again where the last start was. At the end nothing else ends the pause.
- A new bag is read before the old one goes; what cannot be used changes nothing.
- What we publish ourselves is not what a client replays, not even when a far bridge, which does not know who is who,
  gives it back: it is known by its stamp and figures.
- A source of network replay holds the stage until it stops publishing there, or leaves. Who was stopped by a command
  stays unheard until it begins anew or has been silent for a second, else its next message would undo the stop.
- A bag comes with the mode of its own recorder: units that its messages do not name are those of this profile.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final

__all__ = ["OF_A_BAG", "OF_A_SOURCE", "REPLAY_TABLE", "ReplayEffect", "ReplayEvent", "ReplayOutcome", "ReplayState"]


class ReplayState(IntEnum):
    """Who moves the world."""

    SIMULATING = 0
    REPLAYING = 1
    AT_END = 2
    FOLLOWING = 3


class ReplayEvent(IntEnum):
    """What was asked for, or has happened."""

    LOAD = 0  # a recording has been read
    TUNE = 1  # other targets, another speed
    SEEK = 2
    PLAY = 3
    PAUSE = 4
    STOP = 5
    RUN_OUT = 6  # the last of the bag has been shown
    MESSAGE = 7  # a client tells what it replays
    LOST = 8  # ... and will not go on
    EVICT = 9  # a scenario or a reset takes the stage


OF_A_BAG: Final = frozenset({ReplayEvent.RUN_OUT})
"""Events that take a bag to happen: the table has no row for them in the other states."""

OF_A_SOURCE: Final = frozenset({ReplayEvent.LOST})
"""Events that take a source of network replay."""


class ReplayEffect(Enum):
    """What follows from an event; carried out in the order of the row.

    LEAVE (the world is as it was before), ENTER (the recording takes the stage), TUNE and SEEK (as was asked for),
    REWIND (back to the start), RESUME and HOLD (the simulator's pause), AGAIN (the scenario anew), IGNORE (the source
    is unheard from now on).
    """

    LEAVE = "leave"
    ENTER = "enter"
    TUNE = "tune"
    SEEK = "seek"
    REWIND = "rewind"
    RESUME = "resume"
    HOLD = "hold"
    AGAIN = "again"
    IGNORE = "ignore"


@dataclass(frozen=True, slots=True)
class ReplayOutcome:
    """One row of the table.

    Attributes:
        state: the state afterwards.
        effects: in the order in which they are carried out.
        why: for a refusal, a text for the peer; empty otherwise.
    """

    state: ReplayState
    effects: tuple[ReplayEffect, ...] = ()
    why: str = ""


def _yes(state: ReplayState, *effects: ReplayEffect) -> ReplayOutcome:
    return ReplayOutcome(state, effects)


def _no(state: ReplayState, why: str) -> ReplayOutcome:
    return ReplayOutcome(state, why=why)


_NONE: Final = "no recording is loaded: replay_option 1 loads one"
_TOLD: Final = "a client tells what is replayed: targets, start and speed are its own"
_TAKEN: Final = "a bag is replayed already"

REPLAY_TABLE: Final[Mapping[ReplayState, Mapping[ReplayEvent, ReplayOutcome]]] = {
    ReplayState.SIMULATING: {
        ReplayEvent.LOAD: _yes(ReplayState.REPLAYING, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _no(ReplayState.SIMULATING, _NONE),
        ReplayEvent.SEEK: _no(ReplayState.SIMULATING, _NONE),
        ReplayEvent.PLAY: _yes(ReplayState.SIMULATING, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _yes(ReplayState.SIMULATING, ReplayEffect.HOLD),
        ReplayEvent.STOP: _yes(ReplayState.SIMULATING, ReplayEffect.AGAIN),
        ReplayEvent.MESSAGE: _yes(ReplayState.FOLLOWING, ReplayEffect.ENTER),
        ReplayEvent.EVICT: _yes(ReplayState.SIMULATING),
    },
    ReplayState.REPLAYING: {
        ReplayEvent.LOAD: _yes(ReplayState.REPLAYING, ReplayEffect.LEAVE, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _yes(ReplayState.REPLAYING, ReplayEffect.TUNE),
        ReplayEvent.SEEK: _yes(ReplayState.REPLAYING, ReplayEffect.SEEK),
        ReplayEvent.PLAY: _yes(ReplayState.REPLAYING, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _yes(ReplayState.REPLAYING, ReplayEffect.HOLD),
        ReplayEvent.STOP: _yes(ReplayState.SIMULATING, ReplayEffect.LEAVE),
        ReplayEvent.RUN_OUT: _yes(ReplayState.AT_END, ReplayEffect.HOLD),
        ReplayEvent.MESSAGE: _no(ReplayState.REPLAYING, _TAKEN),
        ReplayEvent.EVICT: _yes(ReplayState.SIMULATING, ReplayEffect.LEAVE),
    },
    ReplayState.AT_END: {
        ReplayEvent.LOAD: _yes(ReplayState.REPLAYING, ReplayEffect.LEAVE, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _yes(ReplayState.AT_END, ReplayEffect.TUNE),
        ReplayEvent.SEEK: _yes(ReplayState.REPLAYING, ReplayEffect.SEEK),
        ReplayEvent.PLAY: _yes(ReplayState.REPLAYING, ReplayEffect.REWIND, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _yes(ReplayState.AT_END, ReplayEffect.HOLD),
        ReplayEvent.STOP: _yes(ReplayState.SIMULATING, ReplayEffect.LEAVE),
        ReplayEvent.RUN_OUT: _yes(ReplayState.AT_END, ReplayEffect.HOLD),
        ReplayEvent.MESSAGE: _no(ReplayState.AT_END, _TAKEN),
        ReplayEvent.EVICT: _yes(ReplayState.SIMULATING, ReplayEffect.LEAVE),
    },
    ReplayState.FOLLOWING: {
        ReplayEvent.LOAD: _yes(ReplayState.REPLAYING, ReplayEffect.LEAVE, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _no(ReplayState.FOLLOWING, _TOLD),
        ReplayEvent.SEEK: _no(ReplayState.FOLLOWING, _TOLD),
        ReplayEvent.PLAY: _yes(ReplayState.FOLLOWING, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _yes(ReplayState.FOLLOWING, ReplayEffect.HOLD),
        ReplayEvent.STOP: _yes(ReplayState.SIMULATING, ReplayEffect.LEAVE, ReplayEffect.IGNORE),
        ReplayEvent.MESSAGE: _yes(ReplayState.FOLLOWING),
        ReplayEvent.LOST: _yes(ReplayState.SIMULATING, ReplayEffect.LEAVE),
        ReplayEvent.EVICT: _yes(ReplayState.SIMULATING, ReplayEffect.LEAVE),
    },
}
"""Every state and every event that can happen in it."""
