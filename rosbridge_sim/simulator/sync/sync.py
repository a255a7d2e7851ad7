"""Synchronous mode: the client that may move the world, the time, and the number of frames. It uses no bus or world.

The methods of `Sync` find the event that has happened; `SYNC_TABLE` decides; the outcome holds the effects. `Sync`
carries out all of them at once, in their order (`_follow`). Effects beyond the mode (MOVE, REFUSE, FLOW, ANNOUNCE) call
the functions registered in `SyncHooks`. No other file changes the state or uses an outcome's effects.

The decisions, and why:

- A tick moves exactly time_step / 20 frames *whatever frame it names*. A published course sends outdated frame numbers
  and works, so the real simulator does not refuse them. `is_strict` accepts only the frame that the tick will end on,
  for users who test the counting of their own client.
- A refusal always answers the state as it is (current master, frame, time step), so that a second client can attach.
- `time_step` 0 means 20, because clients send it at start and at stop. At stop it is ignored.
- A command waits for its frame and is carried out before that frame is computed. If its frame is not in the future, it
  is carried out before the next frame. Commands of one frame keep their order of arrival. Their number and their frames
  are limited, because a peer that never ticks must not fill the memory.
- A command may have to be read from a disk first (a scenario). It takes its place in the order when it arrives, and
  is *ready* later. A tick is one whole: it waits before its first frame if a command of any of its frames is not
  ready, so it never stops in its middle for a slow disk. Ticks that come meanwhile wait behind it, each with
  the time step that was in force when it came. Commands that come meanwhile are placed as if the ticks that wait had
  been carried out: a slow disk changes nothing but the time that it takes.
- A call for many steps is as many ticks, all of which wait: they are carried out in several turns, so that others are
  served in between. If it ends early (a stop condition, a caller that has left), commands that came meanwhile move
  forward by the frames that are not computed.
- The frames of one tick can take several turns too, because the longest tick has 50. Between them others see the world
  after a whole frame, and their commands wait for a frame behind the tick, as if it had been carried out.
- A pause, the end of the mode and a reset refuse the ticks that wait, and what is left of one that has begun: the world
  never moves against a later word.
- Every client may send commands while the mode is on, because the wire's commands have no user id.
- The master is an id, not a connection: several clients may use it. They are its *holders*. The lease is theirs:
  when the last of them leaves, or when all have been silent for `lease` seconds, the mode is lost and `on_loss` says
  what becomes of the world. Commands that still waited are dropped. A holder whose input the server
  holds back cannot send, so its silence does not count.
- Ids are made from a counter, so that two runs give the same ones.
- Several clients that tick together are one master here: their barrier (`barrier.py`).
"""

from __future__ import annotations

import heapq
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from itertools import islice
from typing import Final, Literal

from rosbridge_sim.errors import Reason
from rosbridge_sim.simulator.sync.sync_parts import C, SyncHappening, SyncHooks
from rosbridge_sim.simulator.sync.sync_table import (
    FRAME_MS,
    MAX_AHEAD,
    MAX_STEP_MS,
    MAX_USER_ID,
    MAX_WAITING_COMMANDS,
    NO_MASTER,
    ON,
    PAUSED,
    SYNC_TABLE,
    SyncEffect,
    SyncEvent,
    SyncOutcome,
    SyncState,
)
from rosbridge_sim.simulator.sync.waiting_commands import WaitingCommands

_LOSS: Final = {"run": SyncEvent.LOSS_TO_RUN, "pause": SyncEvent.LOSS_TO_PAUSE, "wait": SyncEvent.LOSS_TO_WAIT}

_WHILE_IT_WAITED: Final = "while the tick waited for its turn"
_WAS_PAUSED: Final = f"the simulation was paused {_WHILE_IT_WAITED}"
_WAS_RESET: Final = f"the simulation was reset {_WHILE_IT_WAITED}"
_HAS_ENDED: Final = f"synchronous mode has ended, or its master was lost, {_WHILE_IT_WAITED}"

_WHY_REFUSED: Final = {SyncEvent.PAUSE: _WAS_PAUSED, SyncEvent.RESET: _WAS_RESET}
"""The events that refuse the ticks that wait, and the text for their callers; for all others it is `_HAS_ENDED`."""


class Sync(WaitingCommands[C]):
    """The mode of one world. The frame count is the world's: it is an argument wherever it matters.

    A `holder` is any object that represents a peer. It must be hashable, and so must a command that is not ready.

    Attributes:
        state: the current state of the table.
        master_id: the id that may tick; empty while there is no master.
        step_ms: the time step in force, or the one last in force [ms].
        lease: silence after which the master is taken for lost [s]; None counts departures only.
        hooks: functions for the effects beyond the mode.
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
        """Start with a free world, or with `is_on` with one that waits for its first master.

        Args:
            is_on: begin in OPEN.
            on_loss: what becomes of the world when the lease ends.
            lease: silence after which the master is taken for lost [s]; None counts departures only.
            is_strict: a tick must name the frame that it will end on.
            may_anyone_stop: accept a stop from any client, not only from the master.
        """
        super().__init__()
        self.state = SyncState.OPEN if is_on else SyncState.FREE
        self.master_id = ""
        self.step_ms = FRAME_MS
        self.hooks = SyncHooks()
        self._loss = _LOSS[on_loss]
        self.lease = lease
        self._is_strict = is_strict
        self._may_anyone_stop = may_anyone_stop
        self._num_ids = 0
        self._holders: dict[object, None] = {}
        self._heard_at = 0.0
        self._ticks: deque[int] = deque()  # how many frames each tick that waits has left
        self.is_in_tick = False  # some frames of the first of them have been computed
        self._num_moved = 0  # frames that the last MOVE has computed
        # Frames of these ticks: still owed, and computed or given up since a tick last waited for none.
        self._num_owed = self._num_settled = 0
        # Commands that came while ticks waited, by the order of arrival: (the frame named, frames settled before it).
        self._delayed: dict[int, tuple[int, int]] = {}
        self._mute: Counter[object] = Counter()  # peers whose input is held back, and how often
        self._carry_out: Final[Mapping[SyncEffect, Callable[[SyncHappening[C]], object]]] = {
            SyncEffect.LEAD: self._lead,
            SyncEffect.RELEASE: self._release,
            SyncEffect.DROP: self._drop,
            SyncEffect.QUEUE: self._queue,
            SyncEffect.MOVE: self._move,
            SyncEffect.WAIT: self._wait,
            SyncEffect.REFUSE: self._refuse,
            SyncEffect.FLOW: lambda happening: self.hooks.flow(happening.now),
            SyncEffect.ANNOUNCE: lambda happening: self.hooks.announce(happening.now),
        }

    @property
    def is_on(self) -> bool:
        """True while synchronous mode is on, with or without a master."""
        return self.state in ON

    @property
    def is_paused(self) -> bool:
        """True while the world is paused."""
        return self.state in PAUSED

    @property
    def is_free(self) -> bool:
        """True while real time moves the world."""
        return self.state is SyncState.FREE

    @property
    def can_send_tick(self) -> bool:
        """True while a tick of the master would be accepted."""
        return self.state is SyncState.LED or self.state is SyncState.WAITING

    @property
    def num_frames(self) -> int:
        """Number of frames of one tick."""
        return self.step_ms // FRAME_MS

    @property
    def num_ticks(self) -> int:
        """Number of ticks that wait for their turn, or for the rest of it."""
        return len(self._ticks)

    @property
    def holders(self) -> list[object]:
        """The peers that use the master's id, in the order in which they first did."""
        return list(self._holders)

    @property
    def lease_due(self) -> float | None:
        """Time at which `expire` ends the lease of a silent master [s]; None if silence does not count now."""
        if self.lease is None or self.state in NO_MASTER:
            return None
        if any(holder in self._holders for holder in self._mute):
            return None
        return self._heard_at + self.lease

    def why(self, outcome: SyncOutcome) -> str:
        """Return the reason of a refusal, with the name of the other master if there is one; call it at once.

        Args:
            outcome: of the last event; a refusal.

        Returns:
            A text for the peer.
        """
        return f"{outcome.why}: {self.master_id!r}" if outcome.reason is Reason.NOT_MASTER else outcome.why

    def start(self, user_id: str, step_ms: int, holder: object, now: float) -> SyncOutcome:
        """Handle a request to become master, or the master's request for another time step.

        Args:
            user_id: the wanted id; with an empty one an id is made.
            step_ms: the time step [ms]; 0 means one frame.
            holder: the peer who asks.

        Returns:
            The outcome. `master_id` and `step_ms` then hold what the answer says, whether accepted or not.
        """
        step = step_ms or FRAME_MS
        if step % FRAME_MS or not 0 < step <= MAX_STEP_MS or len(user_id) > MAX_USER_ID:
            event = SyncEvent.START_MISFIT
        else:
            event = SyncEvent.START_BY_MASTER if self.is_master(user_id) else SyncEvent.START_BY_OTHER
        return self._follow(SyncHappening(event, now, user_id=user_id, step_ms=step, holder=holder))

    def stop(self, user_id: str, now: float) -> SyncOutcome:
        """Handle a request to end the mode, so that real time moves the world again. Waiting commands are dropped."""
        is_allowed = self.is_master(user_id) or (self._may_anyone_stop and self.state not in NO_MASTER)
        return self._follow(SyncHappening(SyncEvent.STOP_BY_MASTER if is_allowed else SyncEvent.STOP_BY_OTHER, now))

    def tick(
        self,
        user_id: str,
        named: int,
        frame: int,
        holder: object,
        now: float,
        *,
        on_wait: Callable[[], object] | None = None,
        is_in_turns: bool = False,
        is_held: bool = False,
    ) -> SyncOutcome:
        """Handle a request to move the world by one time step.

        Args:
            named: the frame that it asks for; without meaning unless frames are strict.
            holder: the peer who asks.
            on_wait: called if the tick waits. Then call `take_turn`, and whenever a command has become ready or was
                withdrawn.
            is_in_turns: let a tick of several frames wait, so that `take_turn` can divide it.
            is_held: let the tick wait, because something of the last frame is missing.

        Returns:
            The outcome. If it is accepted, the frames of the tick have been computed, or it waits.
        """
        if not user_id or user_id != self.master_id:
            return self._follow(SyncHappening(SyncEvent.TICK_BY_OTHER, now))
        self._hear(holder, now)
        num_frames = self.step_ms // FRAME_MS
        end = frame + self._num_owed + num_frames
        if self._is_strict and named != end:
            return self._follow(SyncHappening(SyncEvent.TICK_MISFIT, now))
        waits = is_held or (is_in_turns and num_frames > 1) or (bool(self._unready) and self._is_early(end))
        event = SyncEvent.TICK_EARLY if waits else SyncEvent.TICK_BY_MASTER
        return self._follow(SyncHappening(event, now, num_frames, on_wait=on_wait))

    def step(
        self, user_id: str, num_ticks: int, holder: object, now: float, *, on_wait: Callable[[], object]
    ) -> SyncOutcome:
        """Somebody wants the world to move by several time steps: as many ticks, all of which wait for `take_turn`.

        Args:
            user_id: the master, as the peer believes.
            holder: the peer who asks.
            on_wait: called once if the ticks wait.
        """
        if not self.is_master(user_id):
            return self._follow(SyncHappening(SyncEvent.TICK_BY_OTHER, now))
        self._hear(holder, now)
        return self._follow(SyncHappening(SyncEvent.TICK_EARLY, now, self.num_frames, num_ticks, on_wait))

    def step_now(self, user_id: str, frame: int, holder: object, now: float, *, prepare: Callable[[], object]) -> bool:
        """Carry out one tick of a single frame, if nothing is in its way: what `step` and `take_turn` would do.

        Args:
            user_id, holder: see `step`.
            prepare: called before the frame is computed; see `enter`.

        Returns:
            False if nothing has happened, because the tick has to wait, has more frames or is refused; see `step`.
        """
        is_next = self.state is SyncState.LED and self.step_ms == FRAME_MS and not self._is_early(frame + 1)
        if not is_next or not self.is_master(user_id):
            return False
        self._hear(holder, now)
        prepare()
        self._follow(SyncHappening(SyncEvent.TICK_BY_MASTER, now, 1))
        return True

    def give_up(self, num_ticks: int, now: float) -> None:
        """Forget the first ticks that wait, at least one.

        Args:
            num_ticks: how many; there must be as many.
        """
        self.is_in_tick = False
        self._give_up_frames(sum(self._ticks.popleft() for _ in range(num_ticks)))
        if not self._ticks:
            self._follow(SyncHappening(SyncEvent.LAST_DONE, now))

    def has_turn(self, frame: int) -> bool:
        """Return whether `take_turn` would carry out a tick."""
        return bool(self._ticks) and not self._is_early(frame + self._ticks[0])

    def take_turn(
        self, frame: int, now: float, *, prepare: Callable[[], object] | None = None, most_ticks: int = 1
    ) -> int:
        """Let the first tick that waits have its turn, if all commands of its frames are ready.

        Args:
            prepare: called before the first frame of the tick is computed; see `enter`.
            most_ticks: how many ticks may be carried out one after the other; there must be as many.

        Returns:
            How many frames have been computed; 0 if no tick can be carried out now.
        """
        ticks = self._ticks
        if not ticks or (self._unready and self._is_early(frame + ticks[0])):
            return 0
        if prepare is not None and not self.is_in_tick:
            prepare()
        # A command may bring a pause, which ends with the tick; so ticks are taken one by one while any waits.
        num_frames = ticks[0] if most_ticks == 1 or self.queue else sum(islice(ticks, most_ticks))
        self._num_settled += num_frames
        self._num_owed -= num_frames
        self._follow(SyncHappening(SyncEvent.TURN, now, num_frames))
        num_moved = self._num_moved
        if ticks:  # else they were refused meanwhile
            self._num_settled -= num_frames - num_moved
            self._num_owed += num_frames - num_moved
            self._take_out(num_moved)
            if not ticks:
                self._forget_delays()
                self._follow(SyncHappening(SyncEvent.LAST_DONE, now))
        return num_moved

    def _take_out(self, num_frames: int) -> None:
        """Take frames that have been computed out of the first ticks that wait."""
        ticks = self._ticks
        while num_frames and ticks[0] <= num_frames:
            num_frames -= ticks.popleft()
            self.is_in_tick = False
        if num_frames:
            ticks[0] -= num_frames
            self.is_in_tick = True

    def submit(
        self, command: C, named: int, frame: int, holder: object, now: float, *, is_ready: bool = True
    ) -> SyncOutcome:
        """Let a command wait for the frame that it names, or for the next one if that is past.

        Args:
            command: returned by `due`.
            named: the frame before whose computation it is to be carried out.
            holder: the peer that sends it; every peer may.
            is_ready: it can be carried out. Otherwise no tick computes its frame before `ready` or `withdraw`.
        """
        self._note_life(holder, now)
        frame += self._num_owed
        if named > frame + MAX_AHEAD:
            return self._follow(SyncHappening(SyncEvent.COMMAND_TOO_FAR, now))
        if len(self.queue) >= MAX_WAITING_COMMANDS:
            return self._follow(SyncHappening(SyncEvent.COMMAND_TOO_MANY, now))
        due = max(named, frame + 1)
        return self._follow(
            SyncHappening(SyncEvent.COMMAND, now, command=(command,), due=due, named=named, is_ready=is_ready)
        )

    def mute(self, holder: object) -> None:
        """Note that a peer's input is held back; its silence does not count until as many calls of `unmute`."""
        self._mute[holder] += 1

    def unmute(self, holder: object, now: float) -> None:
        """Note that a peer's input is read again."""
        self._mute[holder] -= 1
        if self._mute[holder] <= 0:
            del self._mute[holder]
        self._note_life(holder, now)

    def is_muted(self, holder: object) -> bool:
        """Return whether a peer's input is held back."""
        return holder in self._mute

    def replace_waiting(self, commands: Iterable[tuple[int, C]]) -> None:
        """Have other commands wait, all of them ready; the mode stays as it is. No tick may wait.

        Args:
            commands: with their frames, in their order.
        """
        assert not self._ticks, "ticks wait for commands that are not ready"
        self._unready.clear()
        self.queue = [(frame, i, command) for i, (frame, command) in enumerate(commands, 1)]
        self._num_arrived = len(self.queue)
        heapq.heapify(self.queue)

    def forget(self, now: float) -> SyncOutcome:
        """Drop everything that waits, because the world was reset. The mode stays as it is."""
        outcome = self._follow(SyncHappening(SyncEvent.RESET, now))
        self._num_arrived = 0
        if self.state in NO_MASTER:
            self._num_ids = 0
        return outcome

    def pause(self, now: float) -> SyncOutcome:
        """Pause the world; the mode stays as it is."""
        return self._follow(SyncHappening(SyncEvent.PAUSE, now))

    def resume(self, now: float) -> SyncOutcome:
        """End the pause."""
        return self._follow(SyncHappening(SyncEvent.RESUME, now))

    def leave(self, holder: object, now: float) -> SyncOutcome | None:
        """Note that a peer has left.

        Returns:
            The outcome if the master is lost by that, else None.
        """
        if holder not in self._holders:
            return None
        del self._holders[holder]
        return None if self._holders else self._follow(SyncHappening(self._loss, now))

    def expire(self, now: float) -> SyncOutcome | None:
        """End the lease of a master that has been silent for too long.

        Returns:
            The outcome; None if the lease has not ended.
        """
        due = self.lease_due
        return None if due is None or now < due else self._follow(SyncHappening(self._loss, now))

    def is_master(self, user_id: str) -> bool:
        """Return whether this id may tick."""
        return user_id == self.master_id and user_id != ""

    def _hear(self, holder: object, now: float) -> None:
        self._holders[holder] = None
        self._heard_at = now

    def _note_life(self, holder: object, now: float) -> None:
        """Take note that a peer is alive, with any master."""
        if holder in self._holders:
            self._heard_at = now
        self.hooks.hear(holder, now)

    def _make_id(self) -> str:
        self._num_ids += 1
        return f"sync-{self._num_ids}"

    def _follow(self, happening: SyncHappening[C]) -> SyncOutcome:
        """Change the state by the table, and carry out all effects of the row; no other code does this."""
        outcome = SYNC_TABLE[self.state][happening.event]
        self.state = outcome.state
        for effect in outcome.effects:
            self._carry_out[effect](happening)
        return outcome

    def _lead(self, happening: SyncHappening[C]) -> None:
        self.master_id = happening.user_id or self._make_id()
        self.step_ms = happening.step_ms
        self._hear(happening.holder, happening.now)

    def _release(self, _happening: SyncHappening[C]) -> None:
        self.master_id = ""
        self._holders.clear()

    def _drop(self, _happening: SyncHappening[C]) -> None:
        self.queue.clear()
        self._unready.clear()

    def _queue(self, happening: SyncHappening[C]) -> None:
        for command in happening.command:
            self._num_arrived += 1
            heapq.heappush(self.queue, (happening.due, self._num_arrived, command))
            if self._num_owed:
                self._delayed[self._num_arrived] = (happening.named, self._num_settled + self._num_owed)
            if not happening.is_ready:
                self._unready[command] = happening.due

    def _move(self, happening: SyncHappening[C]) -> None:
        num_moved = self.hooks.move(happening.num_frames, happening.now)
        self._num_moved = happening.num_frames if num_moved is None else num_moved

    def _wait(self, happening: SyncHappening[C]) -> None:
        self._ticks.extend([happening.num_frames] * happening.num_ticks)
        self._num_owed += happening.num_frames * happening.num_ticks
        if happening.on_wait is not None:
            happening.on_wait()

    def _refuse(self, happening: SyncHappening[C]) -> None:
        self._ticks.clear()
        self.is_in_tick = False
        self._give_up_frames(self._num_owed)
        self.hooks.refuse(_WHY_REFUSED.get(happening.event, _HAS_ENDED), happening.now)

    def _give_up_frames(self, num_frames: int) -> None:
        """Take note that the first frames of the ticks that wait will never be computed.

        A command that came behind them goes before the frame that it would have had without them.
        """
        start, end = self._num_settled, self._num_settled + num_frames
        if self._delayed:
            for i, (due, arrival, command) in enumerate(self.queue):
                named, num_before = self._delayed.get(arrival, (due, start))
                moved = max(named, due - max(0, min(end, num_before) - start))
                self.queue[i] = (moved, arrival, command)
                if command in self._unready:
                    self._unready[command] = moved
            heapq.heapify(self.queue)
        self._num_settled, self._num_owed = end, self._num_owed - num_frames
        if not self._num_owed:
            self._forget_delays()

    def _forget_delays(self) -> None:
        """No tick waits: commands have the frames that they will keep."""
        self._num_settled = 0
        self._delayed.clear()
