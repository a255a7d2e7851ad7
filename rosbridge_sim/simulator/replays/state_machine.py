"""Replay as a table of states and events: a recorded drive moves the world, from a bag or from a client's messages.

There are four states. The pause is not one of them, because it belongs to synchronous mode (see `sync`): there is one
pause for the whole simulator.

    SIMULATING   the world moves by itself
    REPLAYING    a bag moves it, frame by frame
    AT_END       the end of the bag is reached; its last moment stays, and the world is paused
    FOLLOWING    a client publishes what it replays (*network replay*), and the world follows

The decisions, and why:

- Each frame shows 20 ms of the recording (times the speed), in real time and by ticks alike. The first frame shows the
  chosen start, so the frames of a replay equal the recorded ones. Time, stamps and traffic lights are the simulation's.
- Entities are placed within the step, after all motion and before collision detection. So they collide with what they
  pass, as in the recorded drive.
- An entity that is not replayed goes on by itself: `replay_target_option` leaves it out, or the bag does not hold it.
  So vehicles from a bag meet a car that a program drives.
- A replayed ego takes no commands, and no object is added or removed during a replay.
- Stop gives the world back as it was before, paused if it was. In simulation mode, play and pause are those of the
  simulator, and stop loads the scenario again: the last one that replaced the whole scene, else the opening one.
- Play at the end begins again at the last start. At the end, nothing else ends the pause.
- A new bag is read before the old one is left, so a bag that cannot be used changes nothing.
- The simulator does not follow its own messages. A far bridge may send them back under another name, so they are
  recognised by their stamp and values.
- The source of a network replay keeps it until it unadvertises the topic or leaves. A source that a command has stopped
  is ignored until it begins anew or has been silent for a second. Otherwise its next message would undo the stop.
- A bag is in the profile of its recorder: units that its messages do not name are taken from the profile in use.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, IntEnum
from typing import Final

from rosbridge_sim.records import Record


class ReplayState(IntEnum):
    """Mover of the world."""

    SIMULATING = 0
    REPLAYING = 1
    AT_END = 2
    FOLLOWING = 3


class ReplayEvent(IntEnum):
    """Command, or change of the bag, the source or the scene."""

    LOAD = 0  # a recording has been read
    TUNE = 1  # other targets, another speed
    SEEK = 2
    PLAY = 3
    PAUSE = 4
    STOP = 5
    RUN_OUT = 6  # the last of the bag has been shown
    MESSAGE = 7  # of a client that replays over the network
    LOST = 8  # that client has stopped or left
    EVICT = 9  # a scenario or a reset changes the world


class ReplayEffect(Enum):
    """Effect of an event; carried out in the order of the row.

    LEAVE (give the world back as it was), ENTER (the recording moves the world), TUNE and SEEK (as was asked for),
    REWIND (back to the start), RESUME and HOLD (the simulator's pause), AGAIN (load the scenario again), IGNORE (the
    source is ignored from now on).
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


class ReplayOutcome(Record):
    """One row of the table.

    Attributes:
        state: the state afterwards.
        effects: in the order in which they are carried out.
        why: for a refusal, a text for the peer; empty otherwise.
    """

    state: ReplayState
    effects: tuple[ReplayEffect, ...] = ()
    why: str = ""


def _accept(state: ReplayState, *effects: ReplayEffect) -> ReplayOutcome:
    return ReplayOutcome(state, effects)


def _refuse(state: ReplayState, why: str) -> ReplayOutcome:
    return ReplayOutcome(state, why=why)


_NO_RECORDING: Final = "no recording is loaded: replay_option 1 loads one"
_CLIENT_DECIDES: Final = "a client tells what is replayed: targets, start and speed are its own"
_BAG_IS_REPLAYED: Final = "a bag is replayed already"

REPLAY_TABLE: Final[Mapping[ReplayState, Mapping[ReplayEvent, ReplayOutcome]]] = {
    ReplayState.SIMULATING: {
        ReplayEvent.LOAD: _accept(ReplayState.REPLAYING, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _refuse(ReplayState.SIMULATING, _NO_RECORDING),
        ReplayEvent.SEEK: _refuse(ReplayState.SIMULATING, _NO_RECORDING),
        ReplayEvent.PLAY: _accept(ReplayState.SIMULATING, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _accept(ReplayState.SIMULATING, ReplayEffect.HOLD),
        ReplayEvent.STOP: _accept(ReplayState.SIMULATING, ReplayEffect.AGAIN),
        ReplayEvent.MESSAGE: _accept(ReplayState.FOLLOWING, ReplayEffect.ENTER),
        ReplayEvent.EVICT: _accept(ReplayState.SIMULATING),
    },
    ReplayState.REPLAYING: {
        ReplayEvent.LOAD: _accept(ReplayState.REPLAYING, ReplayEffect.LEAVE, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _accept(ReplayState.REPLAYING, ReplayEffect.TUNE),
        ReplayEvent.SEEK: _accept(ReplayState.REPLAYING, ReplayEffect.SEEK),
        ReplayEvent.PLAY: _accept(ReplayState.REPLAYING, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _accept(ReplayState.REPLAYING, ReplayEffect.HOLD),
        ReplayEvent.STOP: _accept(ReplayState.SIMULATING, ReplayEffect.LEAVE),
        ReplayEvent.RUN_OUT: _accept(ReplayState.AT_END, ReplayEffect.HOLD),
        ReplayEvent.MESSAGE: _refuse(ReplayState.REPLAYING, _BAG_IS_REPLAYED),
        ReplayEvent.EVICT: _accept(ReplayState.SIMULATING, ReplayEffect.LEAVE),
    },
    ReplayState.AT_END: {
        ReplayEvent.LOAD: _accept(ReplayState.REPLAYING, ReplayEffect.LEAVE, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _accept(ReplayState.AT_END, ReplayEffect.TUNE),
        ReplayEvent.SEEK: _accept(ReplayState.REPLAYING, ReplayEffect.SEEK),
        ReplayEvent.PLAY: _accept(ReplayState.REPLAYING, ReplayEffect.REWIND, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _accept(ReplayState.AT_END, ReplayEffect.HOLD),
        ReplayEvent.STOP: _accept(ReplayState.SIMULATING, ReplayEffect.LEAVE),
        ReplayEvent.RUN_OUT: _accept(ReplayState.AT_END, ReplayEffect.HOLD),
        ReplayEvent.MESSAGE: _refuse(ReplayState.AT_END, _BAG_IS_REPLAYED),
        ReplayEvent.EVICT: _accept(ReplayState.SIMULATING, ReplayEffect.LEAVE),
    },
    ReplayState.FOLLOWING: {
        ReplayEvent.LOAD: _accept(ReplayState.REPLAYING, ReplayEffect.LEAVE, ReplayEffect.ENTER),
        ReplayEvent.TUNE: _refuse(ReplayState.FOLLOWING, _CLIENT_DECIDES),
        ReplayEvent.SEEK: _refuse(ReplayState.FOLLOWING, _CLIENT_DECIDES),
        ReplayEvent.PLAY: _accept(ReplayState.FOLLOWING, ReplayEffect.RESUME),
        ReplayEvent.PAUSE: _accept(ReplayState.FOLLOWING, ReplayEffect.HOLD),
        ReplayEvent.STOP: _accept(ReplayState.SIMULATING, ReplayEffect.LEAVE, ReplayEffect.IGNORE),
        ReplayEvent.MESSAGE: _accept(ReplayState.FOLLOWING),
        ReplayEvent.LOST: _accept(ReplayState.SIMULATING, ReplayEffect.LEAVE),
        ReplayEvent.EVICT: _accept(ReplayState.SIMULATING, ReplayEffect.LEAVE),
    },
}
"""Every state and every event that can happen in it."""
