"""The table of synchronous mode: states, events, and what follows from each event in each state.

The reason for a table: the published pages describe five services. They do not describe two clients that want the same
thing, a wrong number, or a client that crashes. Here each such case is one row: a state, an event, and the effects.
`sync.py` runs `SYNC_TABLE`, the tests check all of it, and the diagram of the documentation is drawn from it.

There are four states. Three of them also exist paused, because a pause comes from other requests (the event service, a
scenario) and must survive a change of master:

    FREE     real time moves the world
    OPEN     synchronous without a master: the world stands until a client starts the mode (`--start sync`,
             `--sync-on-loss wait`)
    LED      synchronous, one user id is master: the world moves by that id's ticks alone
    WAITING  as LED, and ticks of the master wait: for a command of their frames that is still being read, or, if they
             have several frames or belong to a call for many steps, for their turn

An event includes its sender: there is `TICK_BY_OTHER` rather than a tick and an `if`. `Sync` finds the event, and
carries out the effects of its row.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, StrEnum
from typing import Final

from rosbridge_sim.errors import Reason
from rosbridge_sim.records import Record, replace

FRAME_MS: Final = 20
"""One frame [ms]: the simulator's own step, of which every time step is a multiple."""

MAX_STEP_MS: Final = 1_000
"""The longest time step of one tick [ms]: fifty frames, so that a tick is soon over."""

MAX_WAITING_COMMANDS: Final = 1_000
"""Largest number of commands that wait at one time."""

MAX_AHEAD: Final = 10_000
"""Largest distance of a command's frame from the world's frame: 200 simulated seconds."""

MAX_USER_ID: Final = 256
"""Longest user id [characters], because every SyncModeInfo contains it."""


class SyncState(IntEnum):
    """Mover of the world, and the pause."""

    FREE = 0
    FREE_PAUSED = 1
    OPEN = 2
    OPEN_PAUSED = 3
    LED = 4
    LED_PAUSED = 5
    WAITING = 6


NO_MASTER: Final = frozenset({SyncState.FREE, SyncState.FREE_PAUSED, SyncState.OPEN, SyncState.OPEN_PAUSED})
ON: Final = frozenset(SyncState) - {SyncState.FREE, SyncState.FREE_PAUSED}
PAUSED: Final = frozenset({SyncState.FREE_PAUSED, SyncState.OPEN_PAUSED, SyncState.LED_PAUSED})


class SyncEvent(IntEnum):
    """Request or condition, with its sender: `MASTER` is a peer with the master's id, `OTHER` any other peer."""

    START_BY_MASTER = 0
    START_BY_OTHER = 1
    START_MISFIT = 2  # a time step or an id that is not valid
    STOP_BY_MASTER = 3  # or by any client, where that is allowed
    STOP_BY_OTHER = 4
    TICK_BY_MASTER = 5
    TICK_BY_OTHER = 6
    TICK_MISFIT = 7  # the master's, for another frame than the next one, where that matters
    COMMAND = 8
    COMMAND_TOO_FAR = 9
    COMMAND_TOO_MANY = 10
    PAUSE = 11
    RESUME = 12
    LOSS_TO_RUN = 13  # the lease has ended; the world is to run, pause, or wait for the next master
    LOSS_TO_PAUSE = 14
    LOSS_TO_WAIT = 15
    TICK_EARLY = 16  # the master's, and it has to wait: a command of its frames is not ready, or it takes turns
    TURN = 17  # frames of the first tick that waits can be computed
    RESET = 18  # the world has begun anew
    LAST_DONE = 19  # no tick waits any more: the last one has been carried out, or is not wanted


class SyncEffect(StrEnum):
    """Effect of an event.

    LEAD: the caller is master, with this time step. RELEASE: there is no master. DROP: the commands that wait are
    forgotten. QUEUE: the command waits. MOVE: the frames of a tick are computed. WAIT: the tick waits for its turn,
    see `take_turn`. REFUSE: the ticks that wait are refused. FLOW: real time counts from now on. ANNOUNCE: SyncModeInfo
    has changed.
    """

    LEAD = "lead"
    RELEASE = "release"
    DROP = "drop"
    QUEUE = "queue"
    MOVE = "move"
    WAIT = "wait"
    REFUSE = "refuse"
    FLOW = "flow"
    ANNOUNCE = "announce"


class SyncOutcome(Record):
    """One row of the table.

    Attributes:
        state: the state afterwards.
        is_accepted: `result` or `tick_status` on the wire.
        effects: in the order in which they are carried out.
        why: for a refusal, a text for the peer; empty otherwise.
        reason: the kind of refusal that `why` puts into words.
    """

    state: SyncState
    is_accepted: bool
    effects: tuple[SyncEffect, ...] = ()
    why: str = ""
    reason: Reason = Reason.REFUSED


In, On, Do = SyncState, SyncEvent, SyncEffect  # short names, as words of the rows below


def _yes(state: SyncState, *effects: SyncEffect) -> SyncOutcome:
    return SyncOutcome(state, is_accepted=True, effects=effects)


def _no(state: SyncState, why: tuple[str, Reason]) -> SyncOutcome:
    return SyncOutcome(state, is_accepted=False, why=why[0], reason=why[1])


STEP_TERMS: Final = f"time_step must be a multiple of {FRAME_MS} ms and at most {MAX_STEP_MS}"
_OFF: Final = ("synchronous mode is off", Reason.SYNC_OFF)
_TAKEN: Final = ("another user id is the master", Reason.NOT_MASTER)
_LEADERLESS: Final = ("there is no master: start synchronous mode first", Reason.NO_MASTER)
_IS_PAUSED: Final = ("the simulation is paused", Reason.PAUSED)
_MISFIT: Final = (f"{STEP_TERMS}, user_id at most {MAX_USER_ID} characters", Reason.WRONG_VALUE)
_NOT_NEXT: Final = ("strict frames: a tick must name the frame that it will end on", Reason.LATE_FRAME)
_TOO_FAR: Final = (f"the frame is more than {MAX_AHEAD} frames ahead", Reason.FAR_FRAME)
_TOO_MANY: Final = (f"{MAX_WAITING_COMMANDS} commands are waiting already", Reason.TOO_MUCH)


_NOT_PAUSED: Final[Mapping[SyncState, Mapping[SyncEvent, SyncOutcome]]] = {
    In.FREE: {
        On.START_BY_OTHER: _yes(In.LED, Do.LEAD, Do.ANNOUNCE),
        On.START_MISFIT: _no(In.FREE, _MISFIT),
        On.STOP_BY_OTHER: _yes(In.FREE),
        On.TICK_BY_OTHER: _no(In.FREE, _OFF),
        On.COMMAND: _no(In.FREE, _OFF),
        On.COMMAND_TOO_FAR: _no(In.FREE, _OFF),
        On.COMMAND_TOO_MANY: _no(In.FREE, _OFF),
        On.PAUSE: _yes(In.FREE_PAUSED),
        On.RESUME: _yes(In.FREE),
        On.RESET: _yes(In.FREE, Do.DROP),
    },
    In.OPEN: {
        On.START_BY_OTHER: _yes(In.LED, Do.LEAD, Do.ANNOUNCE),
        On.START_MISFIT: _no(In.OPEN, _MISFIT),
        On.STOP_BY_OTHER: _yes(In.FREE, Do.DROP, Do.FLOW, Do.ANNOUNCE),
        On.TICK_BY_OTHER: _no(In.OPEN, _LEADERLESS),
        On.COMMAND: _yes(In.OPEN, Do.QUEUE),
        On.COMMAND_TOO_FAR: _no(In.OPEN, _TOO_FAR),
        On.COMMAND_TOO_MANY: _no(In.OPEN, _TOO_MANY),
        On.PAUSE: _yes(In.OPEN_PAUSED),
        On.RESUME: _yes(In.OPEN),
        On.RESET: _yes(In.OPEN, Do.DROP),
    },
    In.LED: {
        On.START_BY_MASTER: _yes(In.LED, Do.LEAD, Do.ANNOUNCE),
        On.START_BY_OTHER: _no(In.LED, _TAKEN),
        On.START_MISFIT: _no(In.LED, _MISFIT),
        On.STOP_BY_MASTER: _yes(In.FREE, Do.RELEASE, Do.DROP, Do.FLOW, Do.ANNOUNCE),
        On.STOP_BY_OTHER: _no(In.LED, _TAKEN),
        On.TICK_BY_MASTER: _yes(In.LED, Do.MOVE),
        On.TICK_BY_OTHER: _no(In.LED, _TAKEN),
        On.TICK_MISFIT: _no(In.LED, _NOT_NEXT),
        On.COMMAND: _yes(In.LED, Do.QUEUE),
        On.COMMAND_TOO_FAR: _no(In.LED, _TOO_FAR),
        On.COMMAND_TOO_MANY: _no(In.LED, _TOO_MANY),
        On.PAUSE: _yes(In.LED_PAUSED, Do.ANNOUNCE),
        On.RESUME: _yes(In.LED),
        On.LOSS_TO_RUN: _yes(In.FREE, Do.RELEASE, Do.DROP, Do.FLOW, Do.ANNOUNCE),
        On.LOSS_TO_PAUSE: _yes(In.FREE_PAUSED, Do.RELEASE, Do.DROP, Do.ANNOUNCE),
        On.LOSS_TO_WAIT: _yes(In.OPEN, Do.RELEASE, Do.DROP, Do.ANNOUNCE),
        On.TICK_EARLY: _yes(In.WAITING, Do.WAIT),
        On.RESET: _yes(In.LED, Do.DROP),
    },
    In.WAITING: {
        On.START_BY_MASTER: _yes(In.WAITING, Do.LEAD, Do.ANNOUNCE),
        On.START_BY_OTHER: _no(In.WAITING, _TAKEN),
        On.START_MISFIT: _no(In.WAITING, _MISFIT),
        On.STOP_BY_MASTER: _yes(In.FREE, Do.RELEASE, Do.DROP, Do.REFUSE, Do.FLOW, Do.ANNOUNCE),
        On.STOP_BY_OTHER: _no(In.WAITING, _TAKEN),
        On.TICK_BY_MASTER: _yes(In.WAITING, Do.WAIT),
        On.TICK_BY_OTHER: _no(In.WAITING, _TAKEN),
        On.TICK_MISFIT: _no(In.WAITING, _NOT_NEXT),
        On.TICK_EARLY: _yes(In.WAITING, Do.WAIT),
        On.TURN: _yes(In.WAITING, Do.MOVE),
        On.LAST_DONE: _yes(In.LED),
        On.COMMAND: _yes(In.WAITING, Do.QUEUE),
        On.COMMAND_TOO_FAR: _no(In.WAITING, _TOO_FAR),
        On.COMMAND_TOO_MANY: _no(In.WAITING, _TOO_MANY),
        On.PAUSE: _yes(In.LED_PAUSED, Do.REFUSE, Do.ANNOUNCE),
        On.RESUME: _yes(In.WAITING),
        On.LOSS_TO_RUN: _yes(In.FREE, Do.RELEASE, Do.DROP, Do.REFUSE, Do.FLOW, Do.ANNOUNCE),
        On.LOSS_TO_PAUSE: _yes(In.FREE_PAUSED, Do.RELEASE, Do.DROP, Do.REFUSE, Do.ANNOUNCE),
        On.LOSS_TO_WAIT: _yes(In.OPEN, Do.RELEASE, Do.DROP, Do.REFUSE, Do.ANNOUNCE),
        On.RESET: _yes(In.LED, Do.DROP, Do.REFUSE),
    },
}
"""The states without a pause, and every event that can happen in them."""

_PAUSED_FORM: Final = {In.FREE: In.FREE_PAUSED, In.OPEN: In.OPEN_PAUSED, In.LED: In.LED_PAUSED}
_REFUSED_IN_PAUSE: Final = frozenset({On.TICK_BY_MASTER, On.TICK_MISFIT, On.TICK_EARLY})


def _paused(state: SyncState, *on_resume: SyncEffect) -> dict[SyncEvent, SyncOutcome]:
    """Return the rows of a state in a pause: those without the pause, but time stands, and ticks are refused."""
    paused = _PAUSED_FORM[state]
    rows = {
        event: _no(paused, _IS_PAUSED)
        if event in _REFUSED_IN_PAUSE
        else replace(
            row,
            state=_PAUSED_FORM.get(row.state, row.state),
            effects=tuple(effect for effect in row.effects if effect is not Do.FLOW),
        )
        for event, row in _NOT_PAUSED[state].items()
    }
    return rows | {On.PAUSE: _yes(paused), On.RESUME: _yes(state, *on_resume)}


SYNC_TABLE: Final[Mapping[SyncState, Mapping[SyncEvent, SyncOutcome]]] = {
    In.FREE: _NOT_PAUSED[In.FREE],
    In.FREE_PAUSED: _paused(In.FREE, Do.FLOW),
    In.OPEN: _NOT_PAUSED[In.OPEN],
    In.OPEN_PAUSED: _paused(In.OPEN),
    In.LED: _NOT_PAUSED[In.LED],
    In.LED_PAUSED: _paused(In.LED, Do.ANNOUNCE),
    In.WAITING: _NOT_PAUSED[In.WAITING],
}
"""Every state and every event that can happen in it."""
