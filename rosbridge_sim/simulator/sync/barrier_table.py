"""The table of the barrier: several clients move the world together, and what follows from each event in each state.

A barrier is one more way in which synchronous mode is led. Towards `SYNC_TABLE` it is the one master, with the id
`BARRIER_ID`: it starts the mode when the first member joins, sends one tick whenever its members have ticked, and ends
the mode when the last member leaves. `BARRIER_TABLE` decides what its members may do. `barrier.py` finds out which
event has happened and carries out the effects.

    EMPTY      there is no barrier: `SYNC_TABLE` alone decides
    RESTING    it has members, and none of them has ticked since the last boundary; the world stands
    GATHERING  some have ticked, the others are waited for, until the deadline at most
    MOVING     the tick of the barrier is under way: its frames are computed, or wait for a scenario that is being read

A *boundary* is where one tick of the barrier ends. While it is RESTING the world stands at a boundary, so members come
and go at once; otherwise they come and go at the next one.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, StrEnum
from typing import Final

from rosbridge_sim.errors import Reason
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.sync.sync_table import MAX_USER_ID, STEP_TERMS

BARRIER_ID: Final = "/sim/barrier"
"""The master's id while a barrier leads; it names the topic that tells more."""

DEFAULT_DEADLINE: Final = 1.0
"""Longest wait for the other members [s of wall time]."""

MIN_DEADLINE: Final = 0.01
"""The shortest one [s]: below it, the way of a tick over a network decides who is late."""

MAX_DEADLINE: Final = 60.0
"""The longest one [s]: a call that waits longer has mostly been given up by its client."""

MAX_MEMBERS: Final = 32
"""Members at once: more than a scenario has egos, and the topic that lists them stays small."""

MAX_TICKS_AHEAD: Final = 16
"""Ticks of one member that may wait at once: enough for a client that sends some ahead, and each holds a call."""


class BarrierState(IntEnum):
    """State of the barrier: the thing that its members wait for."""

    EMPTY = 0
    RESTING = 1
    GATHERING = 2
    MOVING = 3


class BarrierEvent(IntEnum):
    """Request and the user id that sent it; or a condition that has become true."""

    # /sim/barrier/join
    JOIN = 0  # by an id that is no member
    JOIN_AGAIN = 1  # by a member: from another connection, or since it does not want to leave any more
    JOIN_MISFIT = 2  # a time step, deadline or id that cannot be had
    JOIN_OTHER_TERMS = 3  # another time step or deadline than the one in force
    JOIN_SHARED = 4  # by a connection that belongs to another member
    JOIN_TAKEN = 5  # a master leads synchronous mode
    JOIN_TOO_MANY = 6
    # /sim/barrier/leave, and /SyncModeCmd
    LEAVE = 7  # a stop by a member is the same
    LEAVE_BY_OTHER = 8
    START_BY_MEMBER = 9
    START_OTHER_STEP = 10  # by a member, with another time step than the one in force
    START_BY_OTHER = 11
    STOP_BY_OTHER = 12
    STOP_BY_ANYONE = 13  # the same, where anyone may stop
    # /SyncModeWaitForTick
    TICK = 14  # by a member
    TICK_PAUSED = 15  # the same in a pause
    TICK_MISFIT = 16  # the same, for another frame than its next one, where that matters
    TICK_SHARED = 17  # the same, from a connection that belongs to another member
    TICK_TOO_MANY = 18  # the same, while too many of its ticks wait
    TICK_BY_OTHER = 19
    # What has become true
    ALL_TICKED = 20  # no member is waited for any more
    DEADLINE = 21
    STILL_TICKED = 22  # behind a boundary: ticks that came too late for it, or were sent ahead
    NONE_TICKED = 23  # those who had ticked are lost
    MOVED = 24  # the tick of the barrier has been carried out
    NOT_MOVED = 25  # it has been refused
    LOSS = 26  # the last connection of a member is gone, or it has been silent for too long
    LAST_LEFT = 27  # the last member has left; the next: it was lost
    LAST_LOST = 28
    # The world
    PAUSE = 29
    RESET = 30  # the world has begun anew
    RESTORED = 31  # the world has been set to a snapshot
    # Requests to move the world in other ways
    STEP_ALONE = 32  # /sim/step by the only member
    STEP_TOGETHER = 33  # by one of several
    STEP_BY_OTHER = 34
    RESTORE_BY_MEMBER = 35  # /sim/restore
    RESTORE_BY_OTHER = 36
    CUT = 37  # a connection of a member is gone, and others of it remain


class BarrierEffect(StrEnum):
    """Consequence of an event.

    LEAD: synchronous mode begins, with the barrier as its master. END: synchronous mode ends. LOSE: the master of
    synchronous mode is lost. ADMIT: the caller is a member. ADMIT_LATER: it becomes one at the boundary. HOLD: another
    connection belongs to the member. REMOVE: the member is gone. REMOVE_LATER: it goes at the boundary, and is not
    waited for. CUT: the ticks of a connection are gone. CLEAR: all members are gone. QUEUE: the tick waits. WAIT: the
    deadline counts from now on. MOVE: the barrier ticks. SETTLE: members come and go. LATE: members that were waited
    for in vain are counted and told. ANSWER: the ticks of this boundary are answered. REFUSE: the ticks that wait are
    refused. FORGET: no member was ever late. ANNOUNCE: `/sim/barrier` has changed.
    """

    LEAD = "lead"
    END = "end"
    LOSE = "lose"
    ADMIT = "admit"
    ADMIT_LATER = "admit later"
    HOLD = "hold"
    REMOVE = "remove"
    REMOVE_LATER = "remove later"
    CUT = "cut"
    CLEAR = "clear"
    QUEUE = "queue"
    WAIT = "wait"
    MOVE = "move"
    SETTLE = "settle"
    LATE = "late"
    ANSWER = "answer"
    REFUSE = "refuse"
    FORGET = "forget"
    ANNOUNCE = "announce"


class BarrierOutcome(Record):
    """One row of the table.

    Attributes:
        state: the state afterwards.
        is_accepted: whether the request is carried out.
        effects: in the order in which they are carried out.
        why: for a refusal, a text for the peer; empty otherwise.
        reason: the kind of refusal that `why` puts into words.
    """

    state: BarrierState
    is_accepted: bool
    effects: tuple[BarrierEffect, ...] = ()
    why: str = ""
    reason: Reason = Reason.REFUSED


In, On, Do = BarrierState, BarrierEvent, BarrierEffect  # short names, as words of the rows below


def _yes(state: BarrierState, *effects: BarrierEffect) -> BarrierOutcome:
    return BarrierOutcome(state, is_accepted=True, effects=effects)


def _no(state: BarrierState, why: tuple[str, Reason]) -> BarrierOutcome:
    return BarrierOutcome(state, is_accepted=False, why=why[0], reason=why[1])


_MISFIT: Final = (
    f"{STEP_TERMS}, deadline_s from {MIN_DEADLINE:g} to {MAX_DEADLINE:g} s, user_id at most {MAX_USER_ID} characters",
    Reason.WRONG_VALUE,
)
_OTHER_TERMS: Final = ("the first member has chosen other terms; 0 takes those in force", Reason.WRONG_VALUE)
_OTHER_STEP: Final = ("the barrier has another time step; leave and join to change it", Reason.WRONG_VALUE)
_SHARED: Final = (
    "this connection belongs to another member: peers behind one bridge are one member",
    Reason.NAME_TAKEN,
)
_TAKEN: Final = (
    "another user id is the master; a barrier can be joined when it has stopped synchronous mode",
    Reason.NOT_MASTER,
)
_TOO_MANY_MEMBERS: Final = (f"the barrier has {MAX_MEMBERS} members already", Reason.TOO_MUCH)
_NOT_MEMBER: Final = (
    "a barrier leads synchronous mode, and this user id is no member; join it by /sim/barrier/join",
    Reason.NOT_MEMBER,
)
_NO_BARRIER: Final = ("there is no barrier; /sim/barrier/join begins one", Reason.NOT_MEMBER)
_IS_PAUSED: Final = ("the simulation is paused", Reason.PAUSED)
_NOT_NEXT: Final = ("strict frames: a tick must name the frame that it will end on", Reason.LATE_FRAME)
_TOO_MANY_TICKS: Final = (
    f"{MAX_TICKS_AHEAD} ticks of this member are waiting already; wait for an answer",
    Reason.TOO_MUCH,
)
_TOGETHER: Final = (
    "the barrier has other members, which must agree to each step; use /SyncModeWaitForTick",
    Reason.NOT_NOW,
)
_IS_MOVING: Final = ("a tick of the barrier is under way", Reason.NOT_NOW)

_REFUSED: Final[Mapping[BarrierEvent, tuple[str, Reason]]] = {
    On.JOIN_MISFIT: _MISFIT,
    On.JOIN_OTHER_TERMS: _OTHER_TERMS,
    On.JOIN_SHARED: _SHARED,
    On.JOIN_TOO_MANY: _TOO_MANY_MEMBERS,
    On.LEAVE_BY_OTHER: _NOT_MEMBER,
    On.START_OTHER_STEP: _OTHER_STEP,
    On.START_BY_OTHER: _NOT_MEMBER,
    On.STOP_BY_OTHER: _NOT_MEMBER,
    On.TICK_PAUSED: _IS_PAUSED,
    On.TICK_MISFIT: _NOT_NEXT,
    On.TICK_SHARED: _SHARED,
    On.TICK_TOO_MANY: _TOO_MANY_TICKS,
    On.TICK_BY_OTHER: _NOT_MEMBER,
    On.STEP_TOGETHER: _TOGETHER,
    On.STEP_BY_OTHER: _NOT_MEMBER,
    On.RESTORE_BY_OTHER: _NOT_MEMBER,
}
"""Events that are refused in each state with members, and why."""

_EMPTY_REFUSED: Final[Mapping[BarrierEvent, tuple[str, Reason]]] = {
    On.JOIN_MISFIT: _MISFIT,
    On.JOIN_TAKEN: _TAKEN,
    On.LEAVE_BY_OTHER: _NO_BARRIER,
    On.START_BY_OTHER: _NO_BARRIER,
    On.STOP_BY_OTHER: _NO_BARRIER,
    On.TICK_BY_OTHER: _NO_BARRIER,
    On.STEP_BY_OTHER: _NO_BARRIER,
    On.RESTORE_BY_OTHER: _NO_BARRIER,
}
"""Events that are refused where there is no barrier; `SyncDriver` asks `SYNC_TABLE` then, except for the first two."""


def _while_ticks_wait(state: BarrierState) -> dict[BarrierEvent, BarrierOutcome]:
    """Return the rows of a state in which ticks wait: who comes or leaves counts from the next boundary on."""
    return {
        On.JOIN: _yes(state, Do.ADMIT_LATER, Do.ANNOUNCE),
        On.JOIN_AGAIN: _yes(state, Do.HOLD, Do.ANNOUNCE),
        On.START_BY_MEMBER: _yes(state, Do.HOLD, Do.ANNOUNCE),
        On.LEAVE: _yes(state, Do.REMOVE_LATER, Do.ANNOUNCE),
        On.CUT: _yes(state, Do.CUT, Do.ANNOUNCE),
        On.LOSS: _yes(state, Do.REMOVE, Do.ANNOUNCE),
        On.LAST_LOST: _yes(In.EMPTY, Do.LOSE, Do.ANNOUNCE),
        On.STOP_BY_ANYONE: _yes(In.EMPTY, Do.REFUSE, Do.CLEAR, Do.END, Do.ANNOUNCE),
        On.TICK: _yes(state, Do.QUEUE, Do.ANNOUNCE),
        On.STEP_ALONE: _no(state, _IS_MOVING),
        On.RESTORE_BY_MEMBER: _yes(state),
        **{event: _no(state, why) for event, why in _REFUSED.items()},
    }


BARRIER_TABLE: Final[Mapping[BarrierState, Mapping[BarrierEvent, BarrierOutcome]]] = {
    In.EMPTY: {
        On.JOIN: _yes(In.RESTING, Do.ADMIT, Do.LEAD, Do.ANNOUNCE),
        On.NOT_MOVED: _yes(In.EMPTY),  # the mode has ended, and the tick that waited with it
        On.PAUSE: _yes(In.EMPTY),
        On.RESET: _yes(In.EMPTY, Do.FORGET, Do.ANNOUNCE),
        On.RESTORED: _yes(In.EMPTY, Do.ANNOUNCE),
        **{event: _no(In.EMPTY, why) for event, why in _EMPTY_REFUSED.items()},
    },
    In.RESTING: {
        On.JOIN: _yes(In.RESTING, Do.ADMIT, Do.ANNOUNCE),
        On.JOIN_AGAIN: _yes(In.RESTING, Do.HOLD),
        On.START_BY_MEMBER: _yes(In.RESTING, Do.HOLD),
        On.LEAVE: _yes(In.RESTING, Do.REMOVE, Do.ANNOUNCE),
        On.CUT: _yes(In.RESTING, Do.CUT, Do.ANNOUNCE),
        On.LOSS: _yes(In.RESTING, Do.REMOVE, Do.ANNOUNCE),
        On.LAST_LEFT: _yes(In.EMPTY, Do.END, Do.ANNOUNCE),
        On.LAST_LOST: _yes(In.EMPTY, Do.LOSE, Do.ANNOUNCE),
        On.STOP_BY_ANYONE: _yes(In.EMPTY, Do.REFUSE, Do.CLEAR, Do.END, Do.ANNOUNCE),
        On.TICK: _yes(In.GATHERING, Do.QUEUE, Do.WAIT, Do.ANNOUNCE),
        On.STILL_TICKED: _yes(In.GATHERING, Do.WAIT, Do.ANNOUNCE),
        On.PAUSE: _yes(In.RESTING, Do.REFUSE, Do.ANNOUNCE),
        On.RESET: _yes(In.RESTING, Do.FORGET, Do.REFUSE, Do.ANNOUNCE),
        On.RESTORED: _yes(In.RESTING, Do.REFUSE, Do.ANNOUNCE),
        On.STEP_ALONE: _yes(In.RESTING),
        On.RESTORE_BY_MEMBER: _yes(In.RESTING),
        **{event: _no(In.RESTING, why) for event, why in _REFUSED.items()},
    },
    In.GATHERING: {
        **_while_ticks_wait(In.GATHERING),
        On.ALL_TICKED: _yes(In.MOVING, Do.MOVE),
        On.DEADLINE: _yes(In.MOVING, Do.MOVE),
        On.NONE_TICKED: _yes(In.RESTING, Do.SETTLE, Do.ANNOUNCE),
        On.PAUSE: _yes(In.RESTING, Do.SETTLE, Do.REFUSE, Do.ANNOUNCE),
        On.RESET: _yes(In.RESTING, Do.SETTLE, Do.FORGET, Do.REFUSE, Do.ANNOUNCE),
        On.RESTORED: _yes(In.RESTING, Do.SETTLE, Do.REFUSE, Do.ANNOUNCE),
    },
    In.MOVING: {
        **_while_ticks_wait(In.MOVING),
        On.MOVED: _yes(In.RESTING, Do.SETTLE, Do.LATE, Do.ANNOUNCE, Do.ANSWER),
        On.NOT_MOVED: _yes(In.RESTING, Do.SETTLE, Do.REFUSE, Do.ANNOUNCE),
        On.PAUSE: _yes(In.MOVING),  # from within the tick, which is one whole
    },
}
"""Every state and every event that can happen in it."""
