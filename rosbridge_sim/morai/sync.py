"""Synchronous mode: who may move the world, when, and by how much; a table that knows no bus and no world.

Why a table. The published pages describe five services and say nothing of what happens when two clients want
the same thing, when a number is odd or when a client dies; every stand-in answers that somewhere, mostly by
accident. Here each answer is one row: a state, an event, and what follows. `TABLE` is what runs, what the tests
walk over and what a diagram can be drawn from.

The states are three, each with a paused twin, because a pause is somebody else's wish (the event service, a
scenario that asks for it) and must survive a change of master:

    FREE    real time drives the world
    OPEN    synchronous, nobody is master: the world stands until somebody starts (`--start sync`,
            `--sync-on-loss wait`)
    LED     synchronous, one user id is master: the world moves by that id's ticks alone

An event is what was said together with *who* said it: `TICK_BY_OTHER` rather than a tick and an `if`. The
methods of `Sync` only find out which event it is; the table decides; the outcome holds the effects. Some effects
are bookkeeping that `Sync` does at once (LEAD, RELEASE, DROP, QUEUE); the rest the caller carries out (MOVE, FLOW,
ANNOUNCE). No other file moves the state.

The decisions, and why:

- A tick moves exactly time_step / 20 frames *whatever frame it names*. A published course ticks with ever staler
  numbers and works, so the real simulator cannot be refusing them. `is_strict` accepts only the frame that the tick
  will end on, for people who test their own client's counting.
- A refusal always answers the state as it is (current master, frame, time step), so that a second client can attach.
- `time_step` 0 means 20: clients send it, at start and at stop. At stop it is ignored.
- A command waits for its frame and is carried out before that frame is computed; one whose frame is not in the
  future goes before the next one. Among those of one frame the order of arrival holds. They are bounded in number
  and in reach, because a peer that never ticks must not fill the memory.
- Anybody may send commands while the mode is on: the wire gives them no user id.
- The master is an id, not a connection: several clients may use it. They are its *holders*. The lease is theirs:
  when the last of them leaves, or when all have been silent for `lease` seconds, the mode is lost and `on_loss` says
  what becomes of the world. Whatever still waited dies with the mode it was meant for.
- Ids are made from a counter, so that two runs give the same ones.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final, Generic, Literal, TypeVar

__all__ = [
    "FRAME_MS",
    "MAX_AHEAD",
    "MAX_ID",
    "MAX_STEP_MS",
    "MAX_WAITING",
    "NO_MASTER",
    "OF_A_MASTER",
    "TABLE",
    "Effect",
    "Event",
    "Outcome",
    "State",
    "Sync",
]

FRAME_MS: Final = 20
"""One frame [ms]: the simulator's own step, of which every time step is a multiple."""

MAX_STEP_MS: Final = 1_000
"""The longest time step of one tick [ms]: fifty frames, so that one call cannot hold the process for long."""

MAX_WAITING: Final = 1_000
"""Commands that may wait at once."""

MAX_AHEAD: Final = 10_000
"""How far ahead of the world a command's frame may lie: 200 simulated seconds."""

MAX_ID: Final = 256
"""Characters of a user id; it goes out with every SyncModeInfo."""


class State(IntEnum):
    """Who moves the world, and whether somebody has paused it."""

    FREE = 0
    FREE_PAUSED = 1
    OPEN = 2
    OPEN_PAUSED = 3
    LED = 4
    LED_PAUSED = 5


NO_MASTER: Final = frozenset({State.FREE, State.FREE_PAUSED, State.OPEN, State.OPEN_PAUSED})
_ON: Final = frozenset({State.OPEN, State.OPEN_PAUSED, State.LED, State.LED_PAUSED})
_PAUSED: Final = frozenset({State.FREE_PAUSED, State.OPEN_PAUSED, State.LED_PAUSED})


class Event(IntEnum):
    """What was said, and by whom. `MASTER` is whoever names the master's id, `OTHER` everybody else."""

    START_BY_MASTER = 0
    START_BY_OTHER = 1
    START_MISFIT = 2  # a time step or an id that cannot be had
    STOP_BY_MASTER = 3  # or by anybody, where that is allowed
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


OF_A_MASTER: Final = frozenset(
    {
        Event.START_BY_MASTER,
        Event.STOP_BY_MASTER,
        Event.TICK_BY_MASTER,
        Event.TICK_MISFIT,
        Event.LOSS_TO_RUN,
        Event.LOSS_TO_PAUSE,
        Event.LOSS_TO_WAIT,
    }
)
"""Events that take a master to happen: the table has no row for them in the states of `NO_MASTER`."""


class Effect(Enum):
    """What follows from an event.

    Of these `Sync` itself does: LEAD (the caller is master, with this time step), RELEASE (nobody is master), DROP
    (what waits is forgotten), QUEUE (the command waits). The caller does: MOVE (compute the frames of one tick),
    FLOW (real time counts from now on), ANNOUNCE (SyncModeInfo has changed).
    """

    LEAD = "lead"
    RELEASE = "release"
    DROP = "drop"
    QUEUE = "queue"
    MOVE = "move"
    FLOW = "flow"
    ANNOUNCE = "announce"


@dataclass(frozen=True, slots=True)
class Outcome:
    """One row of the table.

    Attributes:
        state: the state afterwards.
        is_accepted: `result` or `tick_status` on the wire.
        effects: in the order in which they are carried out.
        why: for a refusal, a text for the peer; empty otherwise.
    """

    state: State
    is_accepted: bool
    effects: tuple[Effect, ...] = ()
    why: str = ""


def _yes(state: State, *effects: Effect) -> Outcome:
    return Outcome(state, is_accepted=True, effects=effects)


def _no(state: State, why: str) -> Outcome:
    return Outcome(state, is_accepted=False, why=why)


_OFF: Final = "synchronous mode is off"
_TAKEN: Final = "another user id is the master"
_LEADERLESS: Final = "nobody is master: start synchronous mode first"
_IS_PAUSED: Final = "the simulation is paused"
_MISFIT: Final = (
    f"time_step must be a multiple of {FRAME_MS} ms and at most {MAX_STEP_MS}, user_id at most {MAX_ID} characters"
)
_NOT_NEXT: Final = "strict frames: a tick must name the frame that it will end on"
_TOO_FAR: Final = f"the frame is more than {MAX_AHEAD} frames ahead"
_TOO_MANY: Final = f"{MAX_WAITING} commands are waiting already"


TABLE: Final[Mapping[State, Mapping[Event, Outcome]]] = {
    State.FREE: {
        Event.START_BY_OTHER: _yes(State.LED, Effect.LEAD, Effect.ANNOUNCE),
        Event.START_MISFIT: _no(State.FREE, _MISFIT),
        Event.STOP_BY_OTHER: _yes(State.FREE),
        Event.TICK_BY_OTHER: _no(State.FREE, _OFF),
        Event.COMMAND: _no(State.FREE, _OFF),
        Event.COMMAND_TOO_FAR: _no(State.FREE, _OFF),
        Event.COMMAND_TOO_MANY: _no(State.FREE, _OFF),
        Event.PAUSE: _yes(State.FREE_PAUSED),
        Event.RESUME: _yes(State.FREE),
    },
    State.FREE_PAUSED: {
        Event.START_BY_OTHER: _yes(State.LED_PAUSED, Effect.LEAD, Effect.ANNOUNCE),
        Event.START_MISFIT: _no(State.FREE_PAUSED, _MISFIT),
        Event.STOP_BY_OTHER: _yes(State.FREE_PAUSED),
        Event.TICK_BY_OTHER: _no(State.FREE_PAUSED, _OFF),
        Event.COMMAND: _no(State.FREE_PAUSED, _OFF),
        Event.COMMAND_TOO_FAR: _no(State.FREE_PAUSED, _OFF),
        Event.COMMAND_TOO_MANY: _no(State.FREE_PAUSED, _OFF),
        Event.PAUSE: _yes(State.FREE_PAUSED),
        Event.RESUME: _yes(State.FREE, Effect.FLOW),
    },
    State.OPEN: {
        Event.START_BY_OTHER: _yes(State.LED, Effect.LEAD, Effect.ANNOUNCE),
        Event.START_MISFIT: _no(State.OPEN, _MISFIT),
        Event.STOP_BY_OTHER: _yes(State.FREE, Effect.DROP, Effect.FLOW, Effect.ANNOUNCE),
        Event.TICK_BY_OTHER: _no(State.OPEN, _LEADERLESS),
        Event.COMMAND: _yes(State.OPEN, Effect.QUEUE),
        Event.COMMAND_TOO_FAR: _no(State.OPEN, _TOO_FAR),
        Event.COMMAND_TOO_MANY: _no(State.OPEN, _TOO_MANY),
        Event.PAUSE: _yes(State.OPEN_PAUSED),
        Event.RESUME: _yes(State.OPEN),
    },
    State.OPEN_PAUSED: {
        Event.START_BY_OTHER: _yes(State.LED_PAUSED, Effect.LEAD, Effect.ANNOUNCE),
        Event.START_MISFIT: _no(State.OPEN_PAUSED, _MISFIT),
        Event.STOP_BY_OTHER: _yes(State.FREE_PAUSED, Effect.DROP, Effect.ANNOUNCE),
        Event.TICK_BY_OTHER: _no(State.OPEN_PAUSED, _LEADERLESS),
        Event.COMMAND: _yes(State.OPEN_PAUSED, Effect.QUEUE),
        Event.COMMAND_TOO_FAR: _no(State.OPEN_PAUSED, _TOO_FAR),
        Event.COMMAND_TOO_MANY: _no(State.OPEN_PAUSED, _TOO_MANY),
        Event.PAUSE: _yes(State.OPEN_PAUSED),
        Event.RESUME: _yes(State.OPEN),
    },
    State.LED: {
        Event.START_BY_MASTER: _yes(State.LED, Effect.LEAD, Effect.ANNOUNCE),
        Event.START_BY_OTHER: _no(State.LED, _TAKEN),
        Event.START_MISFIT: _no(State.LED, _MISFIT),
        Event.STOP_BY_MASTER: _yes(State.FREE, Effect.RELEASE, Effect.DROP, Effect.FLOW, Effect.ANNOUNCE),
        Event.STOP_BY_OTHER: _no(State.LED, _TAKEN),
        Event.TICK_BY_MASTER: _yes(State.LED, Effect.MOVE),
        Event.TICK_BY_OTHER: _no(State.LED, _TAKEN),
        Event.TICK_MISFIT: _no(State.LED, _NOT_NEXT),
        Event.COMMAND: _yes(State.LED, Effect.QUEUE),
        Event.COMMAND_TOO_FAR: _no(State.LED, _TOO_FAR),
        Event.COMMAND_TOO_MANY: _no(State.LED, _TOO_MANY),
        Event.PAUSE: _yes(State.LED_PAUSED, Effect.ANNOUNCE),
        Event.RESUME: _yes(State.LED),
        Event.LOSS_TO_RUN: _yes(State.FREE, Effect.RELEASE, Effect.DROP, Effect.FLOW, Effect.ANNOUNCE),
        Event.LOSS_TO_PAUSE: _yes(State.FREE_PAUSED, Effect.RELEASE, Effect.DROP, Effect.ANNOUNCE),
        Event.LOSS_TO_WAIT: _yes(State.OPEN, Effect.RELEASE, Effect.DROP, Effect.ANNOUNCE),
    },
    State.LED_PAUSED: {
        Event.START_BY_MASTER: _yes(State.LED_PAUSED, Effect.LEAD, Effect.ANNOUNCE),
        Event.START_BY_OTHER: _no(State.LED_PAUSED, _TAKEN),
        Event.START_MISFIT: _no(State.LED_PAUSED, _MISFIT),
        Event.STOP_BY_MASTER: _yes(State.FREE_PAUSED, Effect.RELEASE, Effect.DROP, Effect.ANNOUNCE),
        Event.STOP_BY_OTHER: _no(State.LED_PAUSED, _TAKEN),
        Event.TICK_BY_MASTER: _no(State.LED_PAUSED, _IS_PAUSED),
        Event.TICK_BY_OTHER: _no(State.LED_PAUSED, _TAKEN),
        Event.TICK_MISFIT: _no(State.LED_PAUSED, _IS_PAUSED),
        Event.COMMAND: _yes(State.LED_PAUSED, Effect.QUEUE),
        Event.COMMAND_TOO_FAR: _no(State.LED_PAUSED, _TOO_FAR),
        Event.COMMAND_TOO_MANY: _no(State.LED_PAUSED, _TOO_MANY),
        Event.PAUSE: _yes(State.LED_PAUSED),
        Event.RESUME: _yes(State.LED, Effect.ANNOUNCE),
        Event.LOSS_TO_RUN: _yes(State.FREE_PAUSED, Effect.RELEASE, Effect.DROP, Effect.ANNOUNCE),
        Event.LOSS_TO_PAUSE: _yes(State.FREE_PAUSED, Effect.RELEASE, Effect.DROP, Effect.ANNOUNCE),
        Event.LOSS_TO_WAIT: _yes(State.OPEN_PAUSED, Effect.RELEASE, Effect.DROP, Effect.ANNOUNCE),
    },
}
"""Every state and every event that can happen in it."""

_LOSS: Final = {"run": Event.LOSS_TO_RUN, "pause": Event.LOSS_TO_PAUSE, "wait": Event.LOSS_TO_WAIT}

C = TypeVar("C")
"""What a command is; the caller's business."""


class Sync(Generic[C]):
    """The mode of one world. The frame count is the world's: it is an argument wherever it matters.

    A `holder` is whatever stands for a peer; it must be hashable.

    Attributes:
        state: where in the table we are.
        master_id: the id that may tick; empty while nobody may.
        step_ms: the time step in force, or the one last in force [ms].
    """

    def __init__(
        self,
        *,
        is_on: bool = False,
        on_loss: Literal["run", "pause", "wait"] = "run",
        lease: float | None = None,
        is_strict: bool = False,
        may_anyone_stop: bool = False,
    ) -> None:
        """A world that runs free, or with `is_on` one that waits for its first master.

        Args:
            is_on: begin in OPEN.
            on_loss: what becomes of the world when the lease ends.
            lease: silence after which the master is taken for lost [s]; None counts departures only.
            is_strict: a tick must name the frame that it will end on.
            may_anyone_stop: take a stop from anybody, not from the master alone.
        """
        self.state = State.OPEN if is_on else State.FREE
        self.master_id = ""
        self.step_ms = FRAME_MS
        self._loss = _LOSS[on_loss]
        self._lease = lease
        self._is_strict = is_strict
        self._may_anyone_stop = may_anyone_stop
        self._num_ids = 0
        self._holders: dict[object, None] = {}
        self._heard_at = 0.0
        self._waiting: list[tuple[int, int, C]] = []  # a heap of (frame, order of arrival, command)
        self._num_arrived = 0

    @property
    def is_on(self) -> bool:
        """Whether synchronous mode is on, with a master or without."""
        return self.state in _ON

    @property
    def is_paused(self) -> bool:
        """Whether somebody has paused the world."""
        return self.state in _PAUSED

    @property
    def is_free(self) -> bool:
        """Whether real time moves the world now."""
        return self.state is State.FREE

    @property
    def can_send_tick(self) -> bool:
        """Whether a tick of the master would be carried out now."""
        return self.state is State.LED

    @property
    def num_frames(self) -> int:
        """How many frames one tick moves."""
        return self.step_ms // FRAME_MS

    @property
    def num_waiting(self) -> int:
        """How many commands wait for their frame."""
        return len(self._waiting)

    @property
    def num_holders(self) -> int:
        """How many peers have used the master's id."""
        return len(self._holders)

    @property
    def lease_due(self) -> float | None:
        """When `expire` would find the master silent for too long [s]; None if silence does not matter now."""
        if self._lease is None or self.state in NO_MASTER:
            return None
        return self._heard_at + self._lease

    def start(self, user_id: str, step_ms: int, holder: object, now: float) -> Outcome:
        """Somebody wants to be master, or the master wants another time step.

        Args:
            user_id: whom it wants to be; empty has an id made.
            step_ms: the time step [ms]; 0 means one frame.
            holder: the peer who asks.
            now: monotonic time [s].

        Returns:
            The outcome. `master_id` and `step_ms` then hold what the answer says, whether accepted or not.
        """
        step = step_ms or FRAME_MS
        if step % FRAME_MS or not 0 < step <= MAX_STEP_MS or len(user_id) > MAX_ID:
            event = Event.START_MISFIT
        else:
            event = Event.START_BY_MASTER if self._is_master(user_id) else Event.START_BY_OTHER
        outcome = self._follow(event)
        if Effect.LEAD in outcome.effects:
            self.master_id = user_id or self._make_id()
            self.step_ms = step
            self._hear(holder, now)
        return outcome

    def stop(self, user_id: str) -> Outcome:
        """Somebody wants the world to run by itself again. What still waited is dropped."""
        is_allowed = self._is_master(user_id) or (self._may_anyone_stop and self.state not in NO_MASTER)
        return self._follow(Event.STOP_BY_MASTER if is_allowed else Event.STOP_BY_OTHER)

    def tick(self, user_id: str, named: int, frame: int, holder: object, now: float) -> Outcome:
        """Somebody wants the world to move by one time step.

        Args:
            user_id: whom the peer takes for the master.
            named: the frame that it asks for; without meaning unless frames are strict.
            frame: the world's.
            holder: the peer who asks.
            now: monotonic time [s].

        Returns:
            The outcome; with MOVE in its effects compute `num_frames` frames, each after what `due` gives for it.
        """
        if not self._is_master(user_id):
            return self._follow(Event.TICK_BY_OTHER)
        self._hear(holder, now)
        if self._is_strict and named != frame + self.num_frames:
            return self._follow(Event.TICK_MISFIT)
        return self._follow(Event.TICK_BY_MASTER)

    def submit(self, command: C, named: int, frame: int, holder: object, now: float) -> Outcome:
        """Have a command wait for the frame it names, or for the next one if that is past.

        Args:
            command: what `due` gives back.
            named: the frame before whose computation it is to be carried out.
            frame: the world's.
            holder: the peer who sends it; anybody may.
            now: monotonic time [s].
        """
        if holder in self._holders:
            self._heard_at = now
        if named > frame + MAX_AHEAD:
            return self._follow(Event.COMMAND_TOO_FAR)
        if len(self._waiting) >= MAX_WAITING:
            return self._follow(Event.COMMAND_TOO_MANY)
        outcome = self._follow(Event.COMMAND)
        if Effect.QUEUE in outcome.effects:
            self._num_arrived += 1
            heapq.heappush(self._waiting, (max(named, frame + 1), self._num_arrived, command))
        return outcome

    def due(self, frame: int) -> list[C]:
        """Take out the commands to be carried out before `frame` is computed, in their order."""
        due: list[C] = []
        while self._waiting and self._waiting[0][0] <= frame:
            due.append(heapq.heappop(self._waiting)[2])
        return due

    def forget(self) -> None:
        """The world has begun anew: what waits was meant for frames of the old one. The mode stays as it is."""
        self._waiting.clear()
        self._num_arrived = 0
        if self.state in NO_MASTER:
            self._num_ids = 0

    def pause(self) -> Outcome:
        """Stand still; the mode stays as it is."""
        return self._follow(Event.PAUSE)

    def resume(self) -> Outcome:
        """End the pause."""
        return self._follow(Event.RESUME)

    def leave(self, holder: object) -> Outcome | None:
        """A peer is gone. The outcome if the master went with it, else None."""
        if holder not in self._holders:
            return None
        del self._holders[holder]
        return None if self._holders else self._follow(self._loss)

    def expire(self, now: float) -> Outcome | None:
        """Time has passed. The outcome if the master has been silent for too long, else None."""
        due = self.lease_due
        return None if due is None or now < due else self._follow(self._loss)

    def _is_master(self, user_id: str) -> bool:
        return user_id == self.master_id and user_id != ""

    def _hear(self, holder: object, now: float) -> None:
        self._holders[holder] = None
        self._heard_at = now

    def _make_id(self) -> str:
        self._num_ids += 1
        return f"sync-{self._num_ids}"

    def _follow(self, event: Event) -> Outcome:
        outcome = TABLE[self.state][event]
        self.state = outcome.state
        if Effect.RELEASE in outcome.effects:
            self.master_id = ""
            self._holders.clear()
        if Effect.DROP in outcome.effects:
            self._waiting.clear()
        return outcome
