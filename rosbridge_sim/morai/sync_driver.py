"""Synchronous mode of the simulator: carries out its ticks and its effects on the world.

A service call moves the frames of one time step within the call, and everything that those frames publish is in the
listeners' hands before the answer is given. Two kinds of ticks wait, and `take_turns` carries them out; their caller is
held meanwhile. One is a tick whose frames need a scenario that is still being read. The other are the ticks of a call
for many steps: they are done in turns of a few milliseconds, so that all others are served in between.

`Sync` decides, and calls the functions that are registered here. All changes of the mode go through this file.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple, Protocol

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.participant import Participant, hold
from rosbridge_sim.morai.barrier import Barrier
from rosbridge_sim.morai.barrier_table import BARRIER_ID, BarrierOutcome
from rosbridge_sim.morai.frame_stepper import FrameStepper
from rosbridge_sim.morai.hooks import Hooks
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.real_time_pacer import RealTimePacer
from rosbridge_sim.morai.scene_commands import SceneCommand
from rosbridge_sim.morai.sync import Sync
from rosbridge_sim.morai.sync_table import SyncOutcome, SyncState
from rosbridge_sim.morai.world_failure import WorldFailure
from rosbridge_sim.world.state import World

__all__ = ["ModeResult", "OnTick", "Steps", "SyncDriver", "TickResult"]

TURN_TIME: Final = 0.003
"""Longest turn of the ticks that wait, before clients have theirs [s]; a tick that has begun is finished. With a round
of clients (`ROUND_TIME` of the server, 4 ms) that is less than the 10 ms that a client may have to wait."""

_log = logging.getLogger("rosbridge_sim.morai")


class ModeResult(NamedTuple):
    """Answer to a request about the mode.

    Attributes:
        is_accepted: it is carried out.
        why: for a refusal, a text for the peer; empty otherwise.
        reason: the kind of refusal that `why` puts into words.
    """

    is_accepted: bool
    why: str
    reason: Reason


class TickResult(NamedTuple):
    """Result of a tick.

    Attributes:
        is_accepted: its frames have been computed.
        is_paused: the simulation was paused at the time of the decision.
        why: for a refusal, a text for the peer; empty otherwise.
        reason: the kind of refusal that `why` puts into words.
    """

    is_accepted: bool
    is_paused: bool
    why: str = ""
    reason: Reason = Reason.NOT_NOW


OnTick = Callable[[TickResult], None]


class Steps(Protocol):
    """A call for ticks that may wait.

    Attributes:
        num_left: ticks that are still to be carried out, the one in hand not among them.
        is_wanted: false if the caller has left or waits no longer; then the ticks that are left are given up.
    """

    num_left: int

    @property
    def is_wanted(self) -> bool:
        """See above."""

    def before_tick(self) -> None:
        """Count the tick that follows, and prepare it, such as by commands that go before its first frame."""

    def after_tick(self) -> bool:
        """Return whether the ticks that are left are to be given up, since a condition to stop is met."""

    def end(self, result: TickResult) -> None:
        """Answer the caller; called once. It is not accepted if another event has ended the call."""


class _OneTick:
    """One tick, which is carried out even if its caller has left: other clients count on it."""

    is_wanted = True

    def __init__(self, on_end: OnTick) -> None:
        self.num_left = 1
        self.end = on_end

    def before_tick(self) -> None:
        """Count the tick."""
        self.num_left = 0

    def after_tick(self) -> bool:
        """Return that nothing is left to give up."""
        return False


class _Waiting:
    """A call that waits for its turns.

    Attributes:
        steps: what is to be done.
        release: lets its caller's next op be handled; None while it is not held. It takes monotonic time [s].
        why: why the ticks that are left are refused, where that has happened within a tick of this call.
        is_over: it has been answered.
    """

    __slots__ = ("is_over", "release", "steps", "why")

    def __init__(self, steps: Steps) -> None:
        self.steps = steps
        self.release: Callable[[float], None] | None = None
        self.why: str | None = None
        self.is_over = False

    def end(self, result: TickResult, now: float) -> None:
        """Answer the caller, and let it go on."""
        self.is_over = True
        try:
            self.steps.end(result)
        finally:
            if self.release is not None:
                self.release(now)


class SyncDriver:
    """Carries out ticks, and starts, stops, pauses and resumes the world.

    Attributes:
        num_ticks: ticks carried out.
        read_clock: the time that ends a turn [s]; None has a turn end with the last tick that can be carried out. What
            is computed does not depend on it.
    """

    def __init__(
        self,
        *,
        world: World,
        sync: Sync[SceneCommand],
        barrier: Barrier,
        stepper: FrameStepper,
        pacer: RealTimePacer,
        publishers: Publishers,
        hooks: Hooks,
        failure: WorldFailure,
    ) -> None:
        """Register with `sync` and `barrier`; no tick waits.

        Args:
            world: has the frame.
            sync: decides.
            barrier: decides for those who tick together; while it has members, it is the master towards `sync`.
            stepper: computes the frames.
            pacer: counts real time.
            publishers: stop what only real time has, and publish in a pause.
            hooks: `after_move` and `on_mode_change` are called.
            failure: refuses ticks, and records a failed step.
        """
        self.num_ticks = 0
        self.read_clock: Callable[[], float] | None = None
        self._world = world
        self._sync = sync
        self._barrier = barrier
        self._ended_at = 0.0  # when a tick was last carried out or refused
        self._stepper = stepper
        self._publishers = publishers
        self._hooks = hooks
        self._failure = failure
        # The calls that wait, oldest first; `sync` has the ticks that they have left.
        self._calls: deque[_Waiting] = deque()
        self._call_in_hand: _Waiting | None = None
        sync.hooks.move.append(self._move)
        sync.hooks.refuse.append(self._refuse_ticks)
        sync.hooks.flow.append(pacer.start)
        barrier.hooks.lead.append(self._lead_for_barrier)
        barrier.hooks.end.append(self._end_for_barrier)
        barrier.hooks.lose.append(self._lose_for_barrier)
        barrier.hooks.move.append(self._tick_for_barrier)

    # The mode

    def start(self, user_id: str, step_ms: int, caller: Participant, now: float) -> ModeResult:
        """Start the mode, or change its time step; see `Sync.start` and `Barrier.start`."""
        barrier = self._barrier
        if barrier.is_on:
            return self._result_of_barrier(barrier.start(user_id, step_ms, caller, now), caller)
        outcome = self._sync.start(user_id, step_ms, caller, now)
        self._settle(now)
        return self._result_of(outcome)

    def stop(self, user_id: str, now: float) -> ModeResult:
        """End the mode, or leave the barrier; see `Sync.stop` and `Barrier.stop`."""
        if self._barrier.is_on:
            return self._result_of_barrier(self._barrier.stop(user_id, now))
        outcome = self._sync.stop(user_id, now)
        self._settle(now)
        return self._result_of(outcome)

    def _result_of(self, outcome: SyncOutcome) -> ModeResult:
        return ModeResult(outcome.is_accepted, self._sync.why(outcome), outcome.reason)

    def _result_of_barrier(self, outcome: BarrierOutcome, caller: Participant | None = None) -> ModeResult:
        return ModeResult(outcome.is_accepted, self._barrier.why(outcome, caller), outcome.reason)

    def pause(self, now: float) -> None:
        """Pause the world; the mode stays as it is."""
        self._sync.pause(now)
        self._barrier.pause(now)
        self._settle(now)

    def resume(self, now: float) -> None:
        """End the pause."""
        self._sync.resume(now)
        self._settle(now)

    def leave(self, participant: Participant, now: float) -> None:
        """Take note that a participant has left: perhaps the last one that used the master's id, or a member's."""
        self._barrier.drop(participant, now)
        self._note_loss(self._sync.leave(participant, now), now)

    def expire(self, now: float) -> None:
        """End a lease that has run out, and the wait of a barrier at its deadline."""
        self._barrier.expire(now)
        self._note_loss(self._sync.expire(now), now)

    def due(self, now: float) -> float | None:
        """When `expire` has something to do next [s]; None if never."""
        dues = (self._sync.lease_due, self._barrier.due(now))
        return min((due for due in dues if due is not None), default=None)

    def forget(self, now: float) -> None:
        """Refuse what waits for frames of the world before: it has begun anew."""
        self._sync.forget(now)
        self._barrier.reset(now)

    def _note_loss(self, lost: SyncOutcome | None, now: float) -> None:
        if lost is not None:
            _log.warning("the master of synchronous mode is lost; %s", lost.state.name)
            self._settle(now)

    def _settle(self, now: float) -> None:
        """Apply the current mode to the publishers, and tell the components."""
        if not self._sync.is_free:
            self._publishers.forget_repeats()
        self._publishers.set_paused(is_paused=self._sync.state is SyncState.FREE_PAUSED, now=now)
        for act in self._hooks.on_mode_change:
            act(now)

    # The barrier, which is the master here while it has members

    def _lead_for_barrier(self, step_ms: int, now: float) -> None:
        self._sync.mute(self._barrier)  # its members have leases of their own
        self._sync.start(BARRIER_ID, step_ms, self._barrier, now)
        self._settle(now)

    def _end_for_barrier(self, now: float) -> None:
        self._sync.unmute(self._barrier, now)
        self._sync.stop(BARRIER_ID, now)
        self._settle(now)

    def _lose_for_barrier(self, now: float) -> None:
        self._sync.unmute(self._barrier, now)
        self._note_loss(self._sync.leave(self._barrier, now), now)

    def _tick_for_barrier(self, now: float) -> None:
        """Move the world by one time step for all members."""
        sync, barrier, world = self._sync, self._barrier, self._world

        def end(result: TickResult) -> None:
            if result.is_accepted:
                barrier.moved(self._ended_at)
            else:
                barrier.not_moved(result.why, self._ended_at)

        self._ended_at = now
        wait = partial(self._calls.append, _Waiting(_OneTick(end)))
        try:
            outcome = sync.tick(BARRIER_ID, world.frame + sync.num_frames, world.frame, barrier, now, on_wait=wait)
        except GraphError as error:  # the world has failed; it is told elsewhere
            barrier.not_moved(str(error), now)
            return
        if not outcome.is_accepted:
            barrier.not_moved(sync.why(outcome), now)
        elif outcome.state is not SyncState.WAITING:
            barrier.moved(now)

    # Ticks

    def ask_tick(self, user_id: str, named: int, caller: Participant, on_end: OnTick, now: float) -> None:
        """Move the world by one time step, and publish every frame of it, if the mode allows it.

        Args:
            user_id: the master, or the member of a barrier, that the caller takes itself for.
            named: the frame that it asks for.
            caller: held for as long as its tick waits; not while it waits for other members.
            on_end: called once, perhaps before this returns.
            now: monotonic time [s].

        Raises:
            GraphError: a step has failed, now or before: the world stands still for good.
        """
        if self._barrier.is_on:
            self._ask_barrier_tick(user_id, named, caller, on_end, now)
            return
        sync = self._sync
        is_paused = sync.is_paused  # before the frames of this tick, which may bring a pause
        outcome = sync.tick(
            user_id, named, self._world.frame, caller, now, on_wait=partial(self._wait, _OneTick(on_end), caller)
        )
        if not outcome.is_accepted:
            on_end(TickResult(is_accepted=False, is_paused=is_paused, why=sync.why(outcome), reason=outcome.reason))
        elif outcome.state is not SyncState.WAITING:
            on_end(TickResult(is_accepted=True, is_paused=is_paused))

    def _ask_barrier_tick(self, user_id: str, named: int, caller: Participant, on_end: OnTick, now: float) -> None:
        sync, barrier = self._sync, self._barrier

        def end(why: str) -> None:
            on_end(TickResult(is_accepted=not why, is_paused=bool(why) and sync.is_paused, why=why))

        outcome = barrier.tick(user_id, named, self._world.frame, caller, now, on_end=end)
        if not outcome.is_accepted:
            why = barrier.why(outcome, caller)
            on_end(TickResult(is_accepted=False, is_paused=sync.is_paused, why=why, reason=outcome.reason))

    def ask_steps(self, user_id: str, steps: Steps, caller: Participant, now: float) -> None:
        """Move the world by several time steps: now as far as one turn goes, the others in later turns.

        Args:
            user_id: the master that the caller takes itself for.
            steps: what is to be done, at least one tick. Its `end` is called once, perhaps before this returns.
            caller: held until then.
            now: monotonic time [s].
        """
        sync = self._sync
        call = _Waiting(steps)
        holder: object = caller
        if self._barrier.is_on:
            result = self._result_of_barrier(self._barrier.ask_step(user_id))
            if not result.is_accepted:
                _, why, reason = result
                call.end(TickResult(is_accepted=False, is_paused=sync.is_paused, why=why, reason=reason), now)
                return
            user_id, holder = BARRIER_ID, self._barrier
        outcome = sync.step(user_id, steps.num_left, holder, now, on_wait=partial(self._calls.append, call))
        if not outcome.is_accepted:
            why = sync.why(outcome)
            call.end(TickResult(is_accepted=False, is_paused=sync.is_paused, why=why, reason=outcome.reason), now)
            return
        self.take_turns(now)
        if not call.is_over:
            call.release = self.hold(caller)

    @property
    def has_turn(self) -> bool:
        """Return whether `take_turns` has something to do now."""
        calls = self._calls
        return bool(calls) and (self._sync.has_turn(self._world.frame) or not calls[0].steps.is_wanted)

    def take_turns(self, now: float) -> None:
        """Carry out the ticks that wait, as far as what they wait for has been read, and until the turn is over.

        Call it again while `has_turn`, when all others have been served.
        """
        read_clock, sync, world, calls = self.read_clock, self._sync, self._world, self._calls
        until = None if read_clock is None else read_clock() + TURN_TIME
        while calls and not self._stepper.is_moving:
            call = calls[0]
            steps = call.steps
            if not steps.is_wanted:
                calls.popleft()
                self._finish(call, now)
            else:
                calls.popleft()
                self._call_in_hand = call
                try:
                    num_frames = sync.take_turn(world.frame, now, prepare=steps.before_tick)
                except GraphError as error:
                    calls.appendleft(call)
                    self._refuse_ticks(str(error), now)
                    return
                finally:
                    self._call_in_hand = None
                if not num_frames:
                    calls.appendleft(call)
                    return
                is_enough = steps.after_tick()
                if call.why is not None:  # the tick has brought it about
                    call.end(TickResult(is_accepted=False, is_paused=sync.is_paused, why=call.why), now)
                elif is_enough or not steps.num_left:
                    self._finish(call, now)
                else:
                    calls.appendleft(call)
            if until is not None and read_clock is not None and read_clock() >= until:
                return

    def _finish(self, call: _Waiting, now: float) -> None:
        """Answer a call; the ticks that it has left are not wanted."""
        num_left, call.steps.num_left = call.steps.num_left, 0
        if num_left:
            self._sync.give_up(num_left, now)
        call.end(TickResult(is_accepted=True, is_paused=False), now)

    def hold(self, participant: Participant) -> Callable[[float], None]:
        """Hold back a peer's input while its request is being carried out; its lease does not run out meanwhile.

        Returns:
            Releases it; takes monotonic time [s] and must be called once.
        """
        release = hold(participant)
        self._sync.mute(participant)

        def let_go(now: float) -> None:
            self._sync.unmute(participant, now)
            release()

        return let_go

    def _wait(self, steps: Steps, caller: Participant) -> None:
        call = _Waiting(steps)
        call.release = self.hold(caller)
        self._calls.append(call)

    def _move(self, num_frames: int, now: float) -> None:
        """Compute the frames of a tick.

        Raises:
            GraphError: a step has failed, now or before: the world stands still for good.
        """
        stepper, failure = self._stepper, self._failure
        if failure.why is not None:
            raise GraphError(failure.why)
        stepper.is_moving = True
        try:
            for left in range(num_frames - 1, -1, -1):
                stepper.compute(now, is_tick=True, is_last=left == 0)
        except Exception as error:
            raise GraphError(failure.note(error)) from error
        finally:
            stepper.is_moving = False
        self.num_ticks += 1
        self._ended_at = now
        for act in self._hooks.after_move:
            act(now)

    def _refuse_ticks(self, why: str, now: float) -> None:
        """Answer the ticks that wait: they will not be carried out."""
        self._ended_at = now
        if self._call_in_hand is not None:  # its tick goes on to its end, and then it is answered
            self._call_in_hand.why = why if self._call_in_hand.steps.num_left else None
        refused = list(self._calls)
        self._calls.clear()
        for call in refused:
            call.end(TickResult(is_accepted=False, is_paused=self._sync.is_paused, why=why), now)
