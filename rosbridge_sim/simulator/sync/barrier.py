"""The barrier: clients that tick together; it knows no bus and no world, and time is an argument.

The methods of `Barrier` find out which event has happened; `BARRIER_TABLE` decides; the outcome holds the effects. All
of them are carried out at once, in their order, by `Barrier` alone (`_follow`). Those that reach beyond the members
call what was registered in `BarrierHooks`.

The decisions, and why:

- A member is a user id, as the master is; its *holders* are the connections that have used the id. A connection belongs
  to one member, because a bridge is one connection, and a lost one must not hide behind another. So peers behind one
  bridge are one member.
- The deadline counts from the first tick that waits, not from the last boundary. While no member ticks, none waits, and
  the world stands.
- A member that has not ticked when the deadline passes is late. It is told, once until it ticks again. Its tick counts
  for the next boundary: a tick is always one time step, and none is lost.
- Ticks that a member sends ahead wait, one for each boundary. The caller's other requests are not held back meanwhile,
  so a member can steer, or leave, while its tick waits.
- At most one boundary is passed in one call. What could follow at once waits for `expire`, so no other client waits for
  several time steps.
- A member that leaves is not waited for from then on, and its own tick that waits still counts. A member that is lost
  goes at once, and its ticks with it.
- A pause, a reset and the end of the mode refuse the ticks that wait: the world never moves against a later word.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

from rosbridge_sim.errors import Reason
from rosbridge_sim.simulator.sync.barrier_parts import (
    BarrierHappening,
    BarrierHooks,
    BarrierMember,
    BarrierStatus,
    BarrierTick,
    OnBarrierTick,
    end_all,
)
from rosbridge_sim.simulator.sync.barrier_table import (
    BARRIER_TABLE,
    DEFAULT_DEADLINE,
    MAX_DEADLINE,
    MAX_MEMBERS,
    MAX_TICKS_AHEAD,
    MIN_DEADLINE,
    BarrierEffect,
    BarrierEvent,
    BarrierOutcome,
    BarrierState,
)
from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.simulator.sync.sync_table import FRAME_MS, MAX_STEP_MS, MAX_USER_ID

_WHILE: Final = "while the tick waited for the other members"
_WHY_REFUSED: Final = {
    BarrierEvent.PAUSE: f"the simulation was paused {_WHILE}",
    BarrierEvent.RESET: f"the simulation was reset {_WHILE}",
    BarrierEvent.RESTORED: f"a snapshot was restored {_WHILE}",
    BarrierEvent.STOP_BY_ANYONE: f"synchronous mode was stopped {_WHILE}",
    BarrierEvent.LOSS: f"the member was lost {_WHILE}",
}
"""The events that refuse ticks, and the text for their callers; NOT_MOVED brings its own."""


class Barrier:
    """The members of one world's barrier. A `holder` is whatever stands for a peer; it must be hashable.

    Attributes:
        state: where in the table we are.
        step_ms: the time step in force, or the one last in force [ms].
        deadline: longest wait for the other members, in force or last in force [s].
        hooks: what carries out the effects that reach beyond the members.
    """

    def __init__(
        self, sync: Sync[Any], *, lease: float | None = None, is_strict: bool = False, may_anyone_stop: bool = False
    ) -> None:
        """Begin without members.

        Args:
            sync: the mode that the barrier leads; only read here.
            lease: silence after which a member is taken for lost [s]; None counts departures only.
            is_strict: a tick must name the frame that it will end on.
            may_anyone_stop: take a stop from any user id.
        """
        self.state = BarrierState.EMPTY
        self.step_ms = FRAME_MS
        self.deadline = DEFAULT_DEADLINE
        self.hooks = BarrierHooks()
        self._sync = sync
        self._lease = lease
        self._is_strict = is_strict
        self._may_anyone_stop = may_anyone_stop
        self._members: dict[str, BarrierMember] = {}
        self._member_of: dict[object, BarrierMember] = {}
        self._moving: list[tuple[BarrierMember, BarrierTick]] = []  # the ticks of the boundary that the world moves to
        self._late: list[BarrierMember] = []  # those that were waited for in vain
        self._wait_until = 0.0
        self._is_last_lost = False
        self._num_ids = 0
        self._depth = 0
        self._carry_out: Final[Mapping[BarrierEffect, Callable[[BarrierHappening], object]]] = {
            BarrierEffect.LEAD: lambda happening: self.hooks.lead(self.step_ms, happening.now),
            BarrierEffect.END: lambda happening: self.hooks.end(happening.now),
            BarrierEffect.LOSE: lambda happening: self.hooks.lose(happening.now),
            BarrierEffect.ADMIT: self._admit,
            BarrierEffect.ADMIT_LATER: self._admit_later,
            BarrierEffect.HOLD: self._hold,
            BarrierEffect.REMOVE: self._remove,
            BarrierEffect.REMOVE_LATER: self._remove_later,
            BarrierEffect.CUT: self._cut,
            BarrierEffect.CLEAR: self._clear,
            BarrierEffect.QUEUE: self._queue,
            BarrierEffect.WAIT: self._wait,
            BarrierEffect.MOVE: self._move,
            BarrierEffect.SETTLE: self._settle,
            BarrierEffect.LATE: self._warn_late,
            BarrierEffect.ANSWER: self._answer,
            BarrierEffect.REFUSE: self._refuse,
            BarrierEffect.FORGET: self._forget,
            BarrierEffect.ANNOUNCE: lambda happening: self.hooks.announce(happening.now),
        }
        sync.hooks.hear = self._hear

    # To be read

    @property
    def is_on(self) -> bool:
        """True if the barrier has members, and so leads synchronous mode."""
        return self.state is not BarrierState.EMPTY

    @property
    def holders(self) -> list[object]:
        """The connections of all members, in the order in which the members joined."""
        return [holder for member in self._members.values() for holder in member.holders]

    def due(self, now: float) -> float | None:
        """Time of the next call of `expire` that is needed [s]; None if none is."""
        if self.state is BarrierState.EMPTY:
            return None
        dues = [due for due in map(self._lease_due, self._members.values()) if due is not None]
        if self.state is BarrierState.GATHERING:
            dues.append(self._wait_until if self._waited_for() else now)
        return min(dues, default=None)

    def status(self) -> BarrierStatus:
        """Return the barrier as others see it."""
        members = list(self._members.values())
        is_gathering = self.state is BarrierState.GATHERING
        moving = {member for member, _ in self._moving} if self.state is BarrierState.MOVING else set()
        return BarrierStatus(
            [member.user_id for member in members],
            [member.user_id for member in members if member.ticks or member in moving],
            [member.user_id for member in self._waited_for()] if is_gathering else [],
            [member.user_id for member in members if member.is_joining],
            [member.user_id for member in members if member.is_leaving],
            [member.num_late for member in members],
        )

    def why(self, outcome: BarrierOutcome, holder: object = None) -> str:
        """Return why an event was refused, with the values in force; call it at once.

        Args:
            outcome: of the last event; a refusal.
            holder: the peer who asked.
        """
        event_texts = BARRIER_TABLE[BarrierState.RESTING]
        if outcome.reason is Reason.NOT_MASTER:
            return f"{outcome.why}: {self._sync.master_id!r}"
        if outcome.why in {
            event_texts[BarrierEvent.JOIN_OTHER_TERMS].why,
            event_texts[BarrierEvent.START_OTHER_STEP].why,
        }:
            return f"{outcome.why}: time_step {self.step_ms} ms, deadline_s {self.deadline:g}"
        if outcome.why == event_texts[BarrierEvent.JOIN_SHARED].why:
            return f"{outcome.why}; it is {self._member_of[holder].user_id!r}"
        return outcome.why

    # Members

    def join(
        self, user_id: str, step_ms: int, deadline: float, holder: object, now: float
    ) -> tuple[BarrierOutcome, str]:
        """Somebody wants to be a member.

        Args:
            user_id: the id that it wants; empty has one made.
            step_ms: the time step [ms]; 0 takes the one in force, or one frame.
            deadline: longest wait for the others [s]; 0 takes the one in force, or the default.
            holder: the peer who asks.

        Returns:
            The outcome and, if it is accepted, the member's user id.
        """
        own = self._member_of.get(holder)
        if not user_id and own is not None:
            user_id = own.user_id
        member = self._members.get(user_id)
        is_fit = (
            step_ms % FRAME_MS == 0
            and 0 <= step_ms <= MAX_STEP_MS
            and (deadline == 0.0 or MIN_DEADLINE <= deadline <= MAX_DEADLINE)
            and len(user_id) <= MAX_USER_ID
        )
        user_id = user_id[:MAX_USER_ID]  # the answer repeats it
        if not is_fit:
            event = BarrierEvent.JOIN_MISFIT
        elif not self.is_on:
            event = BarrierEvent.JOIN_TAKEN if self._sync.master_id else BarrierEvent.JOIN
        elif own is not None and own is not member:
            event = BarrierEvent.JOIN_SHARED
        elif step_ms not in {0, self.step_ms} or deadline not in {0.0, self.deadline}:
            event = BarrierEvent.JOIN_OTHER_TERMS
        elif member is not None:
            event = BarrierEvent.JOIN_AGAIN
        else:
            event = BarrierEvent.JOIN_TOO_MANY if len(self._members) >= MAX_MEMBERS else BarrierEvent.JOIN
        if event is BarrierEvent.JOIN and not user_id:
            user_id = self._make_id()
        happening = BarrierHappening(event, now, user_id, holder, step_ms or FRAME_MS, deadline or DEFAULT_DEADLINE)
        return self._happen(happening), user_id

    def leave(self, user_id: str, now: float) -> BarrierOutcome:
        """A member does not want to be one any more."""
        event = BarrierEvent.LEAVE if user_id in self._members else BarrierEvent.LEAVE_BY_OTHER
        return self._happen(BarrierHappening(event, now, user_id, why=_LEFT))

    def start(self, user_id: str, step_ms: int, holder: object, now: float) -> BarrierOutcome:
        """Somebody wants to be master while the barrier has members; for a member it is so already.

        Args:
            step_ms: the time step that it wants [ms]; 0 takes the one in force.
            holder: the peer who asks.
        """
        if self._is_shared(user_id, holder):
            event = BarrierEvent.JOIN_SHARED
        elif not self._takes_part(user_id):
            event = BarrierEvent.START_BY_OTHER
        else:
            is_same = step_ms in {0, self.step_ms}
            event = BarrierEvent.START_BY_MEMBER if is_same else BarrierEvent.START_OTHER_STEP
        return self._happen(BarrierHappening(event, now, user_id, holder))

    def stop(self, user_id: str, now: float) -> BarrierOutcome:
        """Somebody wants synchronous mode to end while the barrier has members: a member leaves by that."""
        if user_id in self._members:
            return self.leave(user_id, now)
        is_allowed = self._may_anyone_stop and self.is_on
        event = BarrierEvent.STOP_BY_ANYONE if is_allowed else BarrierEvent.STOP_BY_OTHER
        return self._happen(BarrierHappening(event, now, user_id))

    def drop(self, holder: object, now: float) -> None:
        """A peer is gone; perhaps the last connection of its member."""
        member = self._member_of.pop(holder, None)
        if member is None:
            return
        del member.holders[holder]
        if member.holders:
            self._happen(BarrierHappening(BarrierEvent.CUT, now, member.user_id, holder))
        else:
            self._happen(BarrierHappening(BarrierEvent.LOSS, now, member.user_id, why=_CUT))

    def expire(self, now: float) -> None:
        """Time has passed: perhaps a deadline, or the lease of a silent member."""
        for member in list(self._members.values()):
            due = self._lease_due(member)
            if due is not None and now >= due:
                why = f"was silent for {self._lease:g} s"
                self._happen(BarrierHappening(BarrierEvent.LOSS, now, member.user_id, why=why), may_move=False)
        if self.state is BarrierState.GATHERING and now >= self._wait_until:
            self._happen(BarrierHappening(BarrierEvent.DEADLINE, now), may_move=False)
        else:
            self._conclude(now)

    # Ticks

    def tick(
        self, user_id: str, named: int, frame: int, holder: object, now: float, *, on_end: OnBarrierTick
    ) -> BarrierOutcome:
        """A member wants the world to move by one time step.

        Args:
            user_id: the member, as the peer believes.
            named: the frame that it asks for; without meaning unless frames are strict.
            holder: the peer who asks.
            on_end: called once if the tick is accepted, perhaps before this returns.
        """
        if self._is_shared(user_id, holder):
            event = BarrierEvent.TICK_SHARED
        elif not self._takes_part(user_id):
            event = BarrierEvent.TICK_BY_OTHER
        else:
            member = self._members[user_id]
            self._bind(member, holder, now)
            if self._sync.is_paused:
                event = BarrierEvent.TICK_PAUSED
            elif self._is_strict and named != self._end_of_next_tick(member, frame):
                event = BarrierEvent.TICK_MISFIT
            else:
                is_too_many = len(member.ticks) >= MAX_TICKS_AHEAD
                event = BarrierEvent.TICK_TOO_MANY if is_too_many else BarrierEvent.TICK
        return self._happen(BarrierHappening(event, now, user_id, holder, tick=(BarrierTick(holder, on_end),)))

    def moved(self, now: float) -> None:
        """The tick of the barrier has been carried out."""
        self._happen(BarrierHappening(BarrierEvent.MOVED, now), may_move=False)

    def not_moved(self, why: str, now: float) -> None:
        """The tick of the barrier has been refused."""
        self._happen(BarrierHappening(BarrierEvent.NOT_MOVED, now, why=why), may_move=False)

    def ask_step(self, user_id: str) -> BarrierOutcome:
        """A peer wants to move the world by itself (`/sim/step`): only the one member of a barrier may."""
        if not self._takes_part(user_id):
            event = BarrierEvent.STEP_BY_OTHER
        else:
            event = BarrierEvent.STEP_ALONE if len(self._members) == 1 else BarrierEvent.STEP_TOGETHER
        return BARRIER_TABLE[self.state][event]

    def ask_restore(self, user_id: str) -> BarrierOutcome:
        """A peer wants to restore a snapshot (`/sim/restore`): each member may. Call `restored` afterwards."""
        is_member = self._takes_part(user_id)
        event = BarrierEvent.RESTORE_BY_MEMBER if is_member else BarrierEvent.RESTORE_BY_OTHER
        return BARRIER_TABLE[self.state][event]

    # The world

    def pause(self, now: float) -> None:
        """The world is paused; the members stay."""
        self._happen(BarrierHappening(BarrierEvent.PAUSE, now))

    def reset(self, now: float) -> None:
        """The world has begun anew, and synchronous mode has been told; the members stay."""
        self._happen(BarrierHappening(BarrierEvent.RESET, now))

    def restored(self, now: float) -> None:
        """The world has been set to a snapshot, and synchronous mode has been told; the members stay."""
        self._happen(BarrierHappening(BarrierEvent.RESTORED, now))

    # The ways of the table

    def _happen(self, happening: BarrierHappening, *, may_move: bool = True) -> BarrierOutcome:
        """Follow an event, and what becomes true by it."""
        self._depth += 1
        try:
            outcome = self._follow(happening)
        finally:
            self._depth -= 1
        self._conclude(happening.now, may_move=may_move)
        return outcome

    def _follow(self, happening: BarrierHappening) -> BarrierOutcome:
        """Move along the table, and carry out all effects of the row: the one place for it."""
        outcome = BARRIER_TABLE[self.state][happening.event]
        self.state = outcome.state
        for effect in outcome.effects:
            self._carry_out[effect](happening)
        return outcome

    def _conclude(self, now: float, *, may_move: bool = True) -> None:
        """Follow what has become true; within the effects of an event nothing, for those come first."""
        if self._depth:
            return
        self._depth += 1
        try:
            while (event := self._find(may_move=may_move)) is not None:
                may_move = may_move and event is not BarrierEvent.ALL_TICKED
                self._follow(BarrierHappening(event, now))
        finally:
            self._depth -= 1

    def _find(self, *, may_move: bool) -> BarrierEvent | None:
        """Return an event that has become true by others; each leads to a state in which it is not true any more."""
        if self.state is not BarrierState.EMPTY and not self._members:
            return BarrierEvent.LAST_LOST if self._is_last_lost else BarrierEvent.LAST_LEFT
        has_ticked = self._has_ticked()
        if self.state is BarrierState.RESTING and has_ticked:
            return BarrierEvent.PAUSE if self._sync.is_paused else BarrierEvent.STILL_TICKED
        if self.state is BarrierState.GATHERING:
            if not has_ticked:
                return BarrierEvent.NONE_TICKED
            if self._sync.is_paused:
                return BarrierEvent.PAUSE
            if may_move and not self._waited_for():
                return BarrierEvent.ALL_TICKED
        return None

    def _takes_part(self, user_id: str) -> bool:
        """Return whether it is a member that has not left."""
        member = self._members.get(user_id)
        return member is not None and not member.is_leaving

    def _is_shared(self, user_id: str, holder: object) -> bool:
        """Return whether the connection belongs to another member than this one."""
        own = self._member_of.get(holder)
        return own is not None and own is not self._members.get(user_id)

    def _waited_for(self) -> list[BarrierMember]:
        """The members without which the world does not move before the deadline."""
        members = self._members.values()
        return [member for member in members if not (member.ticks or member.is_joining or member.is_leaving)]

    def _has_ticked(self) -> bool:
        """Return whether a tick waits that counts for the next boundary."""
        return any(member.ticks and not member.is_joining for member in self._members.values())

    def _end_of_next_tick(self, member: BarrierMember, frame: int) -> int:
        """The frame that the next tick of a member will end on."""
        is_later = self.state is BarrierState.MOVING or (member.is_joining and self.state is BarrierState.GATHERING)
        return frame + self.step_ms // FRAME_MS * (1 + len(member.ticks) + is_later)

    def _lease_due(self, member: BarrierMember) -> float | None:
        """Time at which a silent member counts as lost [s]; None while silence does not count."""
        if self._lease is None or member.ticks or any(member is each for each, _ in self._moving):
            return None
        if any(self._sync.is_muted(holder) for holder in member.holders):
            return None
        return member.heard_at + self._lease

    def _hear(self, holder: Any, now: float) -> None:  # noqa: ANN401 - whatever stands for a peer
        """Take note that a peer is alive."""
        member = self._member_of.get(holder)
        if member is not None:
            member.heard_at = now

    def _bind(self, member: BarrierMember, holder: object, now: float) -> None:
        member.holders[holder] = None
        member.heard_at = now
        self._member_of[holder] = member

    def _make_id(self) -> str:
        while True:
            self._num_ids += 1
            user_id = f"member-{self._num_ids}"
            if user_id not in self._members:
                return user_id

    # The effects

    def _admit(self, happening: BarrierHappening) -> None:
        if not self._members:
            self.step_ms, self.deadline = happening.step_ms, happening.deadline
        member = BarrierMember(happening.user_id, {}, happening.now)
        self._members[happening.user_id] = member
        self._bind(member, happening.holder, happening.now)

    def _admit_later(self, happening: BarrierHappening) -> None:
        self._admit(happening)
        self._members[happening.user_id].is_joining = True

    def _hold(self, happening: BarrierHappening) -> None:
        member = self._members[happening.user_id]
        self._bind(member, happening.holder, happening.now)
        member.is_leaving = False

    def _remove(self, happening: BarrierHappening) -> None:
        member = self._members[happening.user_id]
        self._is_last_lost = happening.event is BarrierEvent.LOSS
        self._take_out(member, happening.why)
        ticks = [*(tick for each, tick in self._moving if each is member), *member.ticks]
        self._moving = [entry for entry in self._moving if entry[0] is not member]
        end_all(ticks, _WHY_REFUSED[BarrierEvent.LOSS])

    def _remove_later(self, happening: BarrierHappening) -> None:
        self._members[happening.user_id].is_leaving = True

    def _take_out(self, member: BarrierMember, why: str) -> None:
        """Forget a member, and tell the others."""
        del self._members[member.user_id]
        for holder in member.holders:
            del self._member_of[holder]
        for other in list(self._members.values()):
            for holder in list(other.holders):
                self.hooks.tell(holder, f"member {member.user_id!r} {why}; the barrier goes on without it")

    def _cut(self, happening: BarrierHappening) -> None:
        member, holder = self._members[happening.user_id], happening.holder
        gone = [tick for tick in member.ticks if tick.holder is holder]
        member.ticks = deque(tick for tick in member.ticks if tick.holder is not holder)
        end_all(gone, _WHY_REFUSED[BarrierEvent.LOSS])

    def _clear(self, _happening: BarrierHappening) -> None:
        self._members.clear()
        self._member_of.clear()

    def _queue(self, happening: BarrierHappening) -> None:
        member = self._members[happening.user_id]
        member.is_warned = False
        member.ticks += happening.tick

    def _wait(self, happening: BarrierHappening) -> None:
        self._wait_until = happening.now + self.deadline

    def _move(self, happening: BarrierHappening) -> None:
        self._late = self._waited_for()
        takers = [member for member in self._members.values() if member.ticks and not member.is_joining]
        self._moving = [(member, member.ticks.popleft()) for member in takers]
        self.hooks.move(happening.now)

    def _settle(self, _happening: BarrierHappening) -> None:
        refused: list[BarrierTick] = []
        for member in list(self._members.values()):
            member.is_joining = False
            if member.is_leaving:
                self._is_last_lost = False
                refused += member.ticks  # sent ahead
                self._take_out(member, _LEFT)
        end_all(refused, "the member has left")

    def _warn_late(self, _happening: BarrierHappening) -> None:
        late, self._late = self._late, []
        for member in late:
            member.num_late += 1
            if member.is_warned or self._members.get(member.user_id) is not member:
                continue
            member.is_warned = not member.ticks
            text = (
                f"member {member.user_id!r} has not ticked within {self.deadline:g} s: the world has moved without it"
            )
            for holder in list(member.holders):
                self.hooks.warn(holder, f"{text}; its next tick counts for the next boundary", Reason.LATE_TICK)

    def _answer(self, happening: BarrierHappening) -> None:
        moving, self._moving = self._moving, []
        for member, _ in moving:
            member.heard_at = happening.now
        end_all([tick for _, tick in moving], "")

    def _refuse(self, happening: BarrierHappening) -> None:
        ticks = [tick for _, tick in self._moving]
        self._moving, self._late = [], []
        for member in self._members.values():
            ticks += member.ticks
            member.ticks.clear()
            member.heard_at = max(member.heard_at, happening.now)
        end_all(ticks, happening.why or _WHY_REFUSED[happening.event])

    def _forget(self, _happening: BarrierHappening) -> None:
        if not self._members:
            self._num_ids = 0
        for member in self._members.values():
            member.num_late = 0
            member.is_warned = False


_LEFT: Final = "has left"
_CUT: Final = "is lost, for its connection has ended"
