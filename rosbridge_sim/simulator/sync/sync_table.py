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
    """

    state: SyncState
    is_accepted: bool
    effects: tuple[SyncEffect, ...] = ()
    why: str = ""

    @property
    def reason(self) -> Reason:
        """The kind of refusal that `why` puts into words."""
        return REASONS.get(self.why, Reason.REFUSED)


def _yes(state: SyncState, *effects: SyncEffect) -> SyncOutcome:
    return SyncOutcome(state, is_accepted=True, effects=effects)


def _no(state: SyncState, why: str) -> SyncOutcome:
    return SyncOutcome(state, is_accepted=False, why=why)


_OFF: Final = "synchronous mode is off"
_TAKEN: Final = "another user id is the master"
_LEADERLESS: Final = "there is no master: start synchronous mode first"
_IS_PAUSED: Final = "the simulation is paused"
_MISFIT: Final = (
    f"time_step must be a multiple of {FRAME_MS} ms and at most {MAX_STEP_MS}, user_id at most {MAX_USER_ID} characters"
)
_NOT_NEXT: Final = "strict frames: a tick must name the frame that it will end on"
_TOO_FAR: Final = f"the frame is more than {MAX_AHEAD} frames ahead"
_TOO_MANY: Final = f"{MAX_WAITING_COMMANDS} commands are waiting already"

REASONS: Final[Mapping[str, Reason]] = {
    _OFF: Reason.SYNC_OFF,
    _TAKEN: Reason.NOT_MASTER,
    _LEADERLESS: Reason.NO_MASTER,
    _IS_PAUSED: Reason.PAUSED,
    _MISFIT: Reason.WRONG_VALUE,
    _NOT_NEXT: Reason.LATE_FRAME,
    _TOO_FAR: Reason.FAR_FRAME,
    _TOO_MANY: Reason.TOO_MUCH,
}
"""The text of a refusal -> its kind."""


_NOT_PAUSED: Final[Mapping[SyncState, Mapping[SyncEvent, SyncOutcome]]] = {
    SyncState.FREE: {
        SyncEvent.START_BY_OTHER: _yes(SyncState.LED, SyncEffect.LEAD, SyncEffect.ANNOUNCE),
        SyncEvent.START_MISFIT: _no(SyncState.FREE, _MISFIT),
        SyncEvent.STOP_BY_OTHER: _yes(SyncState.FREE),
        SyncEvent.TICK_BY_OTHER: _no(SyncState.FREE, _OFF),
        SyncEvent.COMMAND: _no(SyncState.FREE, _OFF),
        SyncEvent.COMMAND_TOO_FAR: _no(SyncState.FREE, _OFF),
        SyncEvent.COMMAND_TOO_MANY: _no(SyncState.FREE, _OFF),
        SyncEvent.PAUSE: _yes(SyncState.FREE_PAUSED),
        SyncEvent.RESUME: _yes(SyncState.FREE),
        SyncEvent.RESET: _yes(SyncState.FREE, SyncEffect.DROP),
    },
    SyncState.OPEN: {
        SyncEvent.START_BY_OTHER: _yes(SyncState.LED, SyncEffect.LEAD, SyncEffect.ANNOUNCE),
        SyncEvent.START_MISFIT: _no(SyncState.OPEN, _MISFIT),
        SyncEvent.STOP_BY_OTHER: _yes(SyncState.FREE, SyncEffect.DROP, SyncEffect.FLOW, SyncEffect.ANNOUNCE),
        SyncEvent.TICK_BY_OTHER: _no(SyncState.OPEN, _LEADERLESS),
        SyncEvent.COMMAND: _yes(SyncState.OPEN, SyncEffect.QUEUE),
        SyncEvent.COMMAND_TOO_FAR: _no(SyncState.OPEN, _TOO_FAR),
        SyncEvent.COMMAND_TOO_MANY: _no(SyncState.OPEN, _TOO_MANY),
        SyncEvent.PAUSE: _yes(SyncState.OPEN_PAUSED),
        SyncEvent.RESUME: _yes(SyncState.OPEN),
        SyncEvent.RESET: _yes(SyncState.OPEN, SyncEffect.DROP),
    },
    SyncState.LED: {
        SyncEvent.START_BY_MASTER: _yes(SyncState.LED, SyncEffect.LEAD, SyncEffect.ANNOUNCE),
        SyncEvent.START_BY_OTHER: _no(SyncState.LED, _TAKEN),
        SyncEvent.START_MISFIT: _no(SyncState.LED, _MISFIT),
        SyncEvent.STOP_BY_MASTER: _yes(
            SyncState.FREE, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.FLOW, SyncEffect.ANNOUNCE
        ),
        SyncEvent.STOP_BY_OTHER: _no(SyncState.LED, _TAKEN),
        SyncEvent.TICK_BY_MASTER: _yes(SyncState.LED, SyncEffect.MOVE),
        SyncEvent.TICK_BY_OTHER: _no(SyncState.LED, _TAKEN),
        SyncEvent.TICK_MISFIT: _no(SyncState.LED, _NOT_NEXT),
        SyncEvent.COMMAND: _yes(SyncState.LED, SyncEffect.QUEUE),
        SyncEvent.COMMAND_TOO_FAR: _no(SyncState.LED, _TOO_FAR),
        SyncEvent.COMMAND_TOO_MANY: _no(SyncState.LED, _TOO_MANY),
        SyncEvent.PAUSE: _yes(SyncState.LED_PAUSED, SyncEffect.ANNOUNCE),
        SyncEvent.RESUME: _yes(SyncState.LED),
        SyncEvent.LOSS_TO_RUN: _yes(
            SyncState.FREE, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.FLOW, SyncEffect.ANNOUNCE
        ),
        SyncEvent.LOSS_TO_PAUSE: _yes(SyncState.FREE_PAUSED, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.ANNOUNCE),
        SyncEvent.LOSS_TO_WAIT: _yes(SyncState.OPEN, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.ANNOUNCE),
        SyncEvent.TICK_EARLY: _yes(SyncState.WAITING, SyncEffect.WAIT),
        SyncEvent.RESET: _yes(SyncState.LED, SyncEffect.DROP),
    },
    SyncState.WAITING: {
        SyncEvent.START_BY_MASTER: _yes(SyncState.WAITING, SyncEffect.LEAD, SyncEffect.ANNOUNCE),
        SyncEvent.START_BY_OTHER: _no(SyncState.WAITING, _TAKEN),
        SyncEvent.START_MISFIT: _no(SyncState.WAITING, _MISFIT),
        SyncEvent.STOP_BY_MASTER: _yes(
            SyncState.FREE, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.REFUSE, SyncEffect.FLOW, SyncEffect.ANNOUNCE
        ),
        SyncEvent.STOP_BY_OTHER: _no(SyncState.WAITING, _TAKEN),
        SyncEvent.TICK_BY_MASTER: _yes(SyncState.WAITING, SyncEffect.WAIT),
        SyncEvent.TICK_BY_OTHER: _no(SyncState.WAITING, _TAKEN),
        SyncEvent.TICK_MISFIT: _no(SyncState.WAITING, _NOT_NEXT),
        SyncEvent.TICK_EARLY: _yes(SyncState.WAITING, SyncEffect.WAIT),
        SyncEvent.TURN: _yes(SyncState.WAITING, SyncEffect.MOVE),
        SyncEvent.LAST_DONE: _yes(SyncState.LED),
        SyncEvent.COMMAND: _yes(SyncState.WAITING, SyncEffect.QUEUE),
        SyncEvent.COMMAND_TOO_FAR: _no(SyncState.WAITING, _TOO_FAR),
        SyncEvent.COMMAND_TOO_MANY: _no(SyncState.WAITING, _TOO_MANY),
        SyncEvent.PAUSE: _yes(SyncState.LED_PAUSED, SyncEffect.REFUSE, SyncEffect.ANNOUNCE),
        SyncEvent.RESUME: _yes(SyncState.WAITING),
        SyncEvent.LOSS_TO_RUN: _yes(
            SyncState.FREE, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.REFUSE, SyncEffect.FLOW, SyncEffect.ANNOUNCE
        ),
        SyncEvent.LOSS_TO_PAUSE: _yes(
            SyncState.FREE_PAUSED, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.REFUSE, SyncEffect.ANNOUNCE
        ),
        SyncEvent.LOSS_TO_WAIT: _yes(
            SyncState.OPEN, SyncEffect.RELEASE, SyncEffect.DROP, SyncEffect.REFUSE, SyncEffect.ANNOUNCE
        ),
        SyncEvent.RESET: _yes(SyncState.LED, SyncEffect.DROP, SyncEffect.REFUSE),
    },
}
"""The states without a pause, and every event that can happen in them."""

_PAUSED_FORM: Final = {
    SyncState.FREE: SyncState.FREE_PAUSED,
    SyncState.OPEN: SyncState.OPEN_PAUSED,
    SyncState.LED: SyncState.LED_PAUSED,
}
_REFUSED_IN_PAUSE: Final = frozenset({SyncEvent.TICK_BY_MASTER, SyncEvent.TICK_MISFIT, SyncEvent.TICK_EARLY})


def _paused(state: SyncState, *on_resume: SyncEffect) -> dict[SyncEvent, SyncOutcome]:
    """Return the rows of a state in a pause: those without the pause, but time stands, and ticks are refused."""
    paused = _PAUSED_FORM[state]
    rows = {
        event: _no(paused, _IS_PAUSED)
        if event in _REFUSED_IN_PAUSE
        else replace(
            row,
            state=_PAUSED_FORM.get(row.state, row.state),
            effects=tuple(effect for effect in row.effects if effect is not SyncEffect.FLOW),
        )
        for event, row in _NOT_PAUSED[state].items()
    }
    return rows | {SyncEvent.PAUSE: _yes(paused), SyncEvent.RESUME: _yes(state, *on_resume)}


SYNC_TABLE: Final[Mapping[SyncState, Mapping[SyncEvent, SyncOutcome]]] = {
    SyncState.FREE: _NOT_PAUSED[SyncState.FREE],
    SyncState.FREE_PAUSED: _paused(SyncState.FREE, SyncEffect.FLOW),
    SyncState.OPEN: _NOT_PAUSED[SyncState.OPEN],
    SyncState.OPEN_PAUSED: _paused(SyncState.OPEN),
    SyncState.LED: _NOT_PAUSED[SyncState.LED],
    SyncState.LED_PAUSED: _paused(SyncState.LED, SyncEffect.ANNOUNCE),
    SyncState.WAITING: _NOT_PAUSED[SyncState.WAITING],
}
"""Every state and every event that can happen in it."""
