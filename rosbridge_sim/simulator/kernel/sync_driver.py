"""Synchronous mode of the simulator: carries out its ticks and its effects on the world.

A service call moves the frames of one time step, and everything that those frames publish is in the listeners' hands
before the answer is given. A tick of one frame is carried out within the call. All others wait, and `take_turns`
carries them out; their caller is held meanwhile. These are ticks whose frames need a scenario that is still being read,
ticks of several frames, and the ticks of a call for many steps. They are done in turns of a few milliseconds, so that
all others are served in between. A turn ends after any frame. While the gate behind a frame is closed (`FrameGate`),
there are no turns, and what has ended is not answered.

`Sync` decides, and calls the functions that are registered here. All changes of the mode go through this file.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.printable import printable
from rosbridge_sim.simulator.kernel.frame_stepper import FrameStepper
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts
from rosbridge_sim.simulator.kernel.tick_calls import ModeResult, OneTick, OnTick, TickResult, WaitingCall, WaitingTicks
from rosbridge_sim.simulator.sync.barrier_table import BARRIER_ID, BarrierOutcome, BarrierState
from rosbridge_sim.simulator.sync.sync_table import PAUSED, SyncOutcome, SyncState

TURN_TIME: Final = 0.003
"""Longest turn of the ticks that wait, before clients have theirs [s]; a frame that has begun is finished. With a round
of clients (`ROUND_TIME` of the server, 4 ms) that is less than the 10 ms that a client may have to wait."""

MAX_SHOWN_ID: Final = 60
"""Characters of a master's id in the log: a line stays a line."""

_AFTER_LOSS: Final = {
    SyncState.FREE: "the world runs in real time from now on",
    SyncState.FREE_PAUSED: "the world is paused",
    SyncState.OPEN: "the world stands and waits for a new master",
    SyncState.OPEN_PAUSED: "the world is paused and waits for a new master",
}
"""Texts for the log: state of the world after its master was lost."""

_WAS_RESET: Final = "the simulation was reset before the sensors' messages of the tick were made"

_log = logging.getLogger("rosbridge_sim.morai")


class SyncDriver:
    """Carries out ticks, and starts, stops, pauses and resumes the world.

    Attributes:
        num_ticks: ticks carried out.
        calls: the calls that wait, oldest first; `sync` has the ticks that they have left.
        read_clock: the time that ends a turn [s]; None has a turn end with the last tick that can be carried out. What
            is computed does not depend on it, unless another client interferes.
    """

    def __init__(self, parts: SimulatorParts, stepper: FrameStepper) -> None:
        self.num_ticks = 0
        self.read_clock: Callable[[], float] | None = None
        self.calls: deque[WaitingCall] = deque()
        self._parts, self._world, self._stepper = parts, parts.world, stepper
        self._ended_at = 0.0  # when a tick was last carried out or refused
        # The calls that have ended behind a closed gate, oldest first.
        self._unanswered: deque[tuple[WaitingCall, TickResult]] = deque()
        self._barrier_call: WaitingCall | None = None  # the last tick of a barrier
        self._call_in_hand: WaitingCall | None = None
        self._behind_tick: deque[tuple[Callable[[float], object], Callable[[float], None]]] = deque()
        self._turn_until = math.inf
        self._is_turn_over = False
        sync, barrier = self._sync, self._barrier = parts.sync, parts.barrier
        sync.mute(barrier)  # its members have leases of their own
        sync.hooks.move = self._move
        sync.hooks.refuse = self._refuse_ticks
        sync.hooks.flow = self._parts.pacer.start
        barrier.hooks.lead = self._lead_for_barrier
        barrier.hooks.end = self._end_for_barrier
        barrier.hooks.lose = self._lose_for_barrier
        barrier.hooks.move = self._tick_for_barrier
        self._parts.gate.on_open.append(self._go_on)

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
        master = self._sync.master_id
        self._note_loss(self._sync.leave(participant, now), master, "has disconnected", now)

    def expire(self, now: float) -> None:
        """End a lease that has run out, and the wait of a barrier at its deadline."""
        self._barrier.expire(now)
        master = self._sync.master_id
        self._note_loss(self._sync.expire(now), master, "was silent for as long as --sync-lease", now)

    def forget(self, now: float) -> None:
        """Refuse what waits for frames of the world before: it has begun anew."""
        self._sync.forget(now)
        self._refuse_unanswered(now)
        self._barrier.reset(now)

    def _note_loss(self, lost: SyncOutcome | None, master: str, how: str, now: float) -> None:
        if lost is not None:
            text = "synchronous mode has lost its master: %r %s; %s"
            _log.warning(text, printable(master, MAX_SHOWN_ID), how, _AFTER_LOSS[lost.state])
            self._settle(now)

    def _settle(self, now: float) -> None:
        """Apply the current mode to the publishers, and tell the components."""
        if not self._sync.is_free:
            self._parts.publishers.forget_repeats()
        self._parts.publishers.set_paused(is_paused=self._sync.state is SyncState.FREE_PAUSED, now=now)
        for act in self._parts.hooks.on_mode_change:
            act(now)

    # The barrier, which is the master here while it has members

    def _lead_for_barrier(self, step_ms: int, now: float) -> None:
        self._sync.start(BARRIER_ID, step_ms, self._barrier, now)
        self._settle(now)

    def _end_for_barrier(self, now: float) -> None:
        self._forget_barrier_call()
        self._sync.stop(BARRIER_ID, now)
        self._settle(now)

    def _forget_barrier_call(self) -> None:
        """Answer no tick of a barrier that is no more; its members have been answered."""
        self._unanswered = deque(entry for entry in self._unanswered if entry[0] is not self._barrier_call)

    def _lose_for_barrier(self, now: float) -> None:
        self._forget_barrier_call()
        self._note_loss(self._sync.leave(self._barrier, now), BARRIER_ID, "has lost its last member", now)

    def _tick_for_barrier(self, now: float) -> None:
        """Move the world by one time step for all members."""
        sync, barrier = self._sync, self._barrier

        def end(result: TickResult) -> None:
            if result.is_accepted:
                barrier.moved(self._ended_at)
            else:
                barrier.not_moved(result.why, self._ended_at)

        call = self._barrier_call = WaitingCall(OneTick(end), sync.num_frames)
        wait = partial(self.calls.append, call)
        try:
            outcome = self._tick(BARRIER_ID, self._world.frame + sync.num_frames, barrier, wait, now)
        except GraphError as error:  # the world has failed; it is told elsewhere
            barrier.not_moved(str(error), now)
            return
        if not outcome.is_accepted:
            barrier.not_moved(sync.why(outcome), now)
        elif outcome.state is not SyncState.WAITING:
            self._answer(call, TickResult(is_accepted=True, is_paused=False), now)
        else:
            self._begin(call, now)

    # Ticks

    def ask_tick(self, user_id: str, named: int, caller: Participant, on_end: OnTick, now: float) -> None:
        """Move the world by one time step, and publish every frame of it, if the mode allows it.

        Several frames are computed as far as one turn goes, the others in later turns.

        Args:
            user_id: the master, or the member of a barrier, that the caller takes itself for.
            named: the frame that it asks for.
            caller: held for as long as its tick waits; not while it waits for other members.
            on_end: called once, perhaps before this returns.

        Raises:
            GraphError: a step has failed, now or before: the world stands still for good.
        """
        if self._barrier.state is not BarrierState.EMPTY:
            self._ask_barrier_tick(user_id, named, caller, on_end, now)
            return
        sync = self._sync
        is_paused = sync.state in PAUSED  # before the frames of this tick, which may bring a pause

        def wait() -> None:
            self.calls.append(WaitingCall(OneTick(on_end), sync.num_frames))

        outcome = self._tick(user_id, named, caller, wait, now)
        if not outcome.is_accepted:
            on_end(TickResult(is_accepted=False, is_paused=is_paused, why=sync.why(outcome), reason=outcome.reason))
            return
        if outcome.state is SyncState.WAITING:
            call = self.calls[-1]
            self._begin(call, now)
        elif self._parts.gate.is_open:
            on_end(TickResult(is_accepted=True, is_paused=is_paused))
            return
        else:
            call = WaitingCall(OneTick(on_end), sync.num_frames)
            self._answer(call, TickResult(is_accepted=True, is_paused=is_paused), now)
        if not call.is_over:
            call.release = self.hold(caller)

    def _tick(self, user_id: str, named: int, holder: object, wait: Callable[[], object], now: float) -> SyncOutcome:
        """Ask for a tick; `wait` is called if it cannot be carried out at once."""
        frame, is_held = self._world.frame, not self._parts.gate.is_open
        return self._sync.tick(user_id, named, frame, holder, now, on_wait=wait, is_in_turns=True, is_held=is_held)

    def _begin(self, call: WaitingCall, now: float) -> None:
        """Let a tick that has come have its first turn at once, unless others wait before it."""
        if self.calls[0] is call:
            self.take_turns(now)

    def _ask_barrier_tick(self, user_id: str, named: int, caller: Participant, on_end: OnTick, now: float) -> None:
        sync, barrier = self._sync, self._barrier

        def end(why: str) -> None:
            on_end(TickResult(is_accepted=not why, is_paused=bool(why) and sync.is_paused, why=why))

        outcome = barrier.tick(user_id, named, self._world.frame, caller, now, on_end=end)
        if not outcome.is_accepted:
            why = barrier.why(outcome, caller)
            on_end(TickResult(is_accepted=False, is_paused=sync.is_paused, why=why, reason=outcome.reason))

    def ask_steps(self, user_id: str, steps: WaitingTicks, caller: Participant, now: float) -> None:
        """Move the world by several time steps: now as far as one turn goes, the others in later turns.

        Args:
            user_id: the master that the caller takes itself for.
            steps: what is to be done, at least one tick. Its `end` is called once, perhaps before this returns.
            caller: held until then.
        """
        sync = self._sync
        call = WaitingCall(steps, sync.num_frames)
        holder: object = caller
        if self._barrier.is_on:
            result = self._result_of_barrier(self._barrier.ask_step(user_id))
            if not result.is_accepted:
                _, why, reason = result
                call.end(TickResult(is_accepted=False, is_paused=sync.is_paused, why=why, reason=reason), now)
                return
            user_id, holder = BARRIER_ID, self._barrier
        is_done = steps.num_left == 1 and self._parts.gate.is_open and self._step_now(user_id, call, holder, now)
        if not is_done:
            outcome = sync.step(user_id, steps.num_left, holder, now, on_wait=partial(self.calls.append, call))
            if not outcome.is_accepted:
                why = sync.why(outcome)
                call.end(TickResult(is_accepted=False, is_paused=sync.is_paused, why=why, reason=outcome.reason), now)
                return
            self.take_turns(now)
        if not call.is_over:
            call.release = self.hold(caller)

    def _step_now(self, user_id: str, call: WaitingCall, holder: object, now: float) -> bool:
        """Carry out a call for one step at once, without a queue; return false if it has to wait, or is refused."""
        steps = call.steps
        try:
            if not self._sync.step_now(user_id, self._world.frame, holder, now, prepare=steps.before_tick):
                return False
        except GraphError as error:
            self._ended_at = now
            call.end(TickResult(is_accepted=False, is_paused=self._sync.is_paused, why=str(error)), now)
        else:
            steps.after_ticks(1)
            self._answer(call, TickResult(is_accepted=True, is_paused=False), now)
        self._end_waits(now)
        return True

    @property
    def has_turn(self) -> bool:
        """Return whether `take_turns` has something to do now."""
        calls = self.calls
        return (
            bool(calls)
            and self._parts.gate.is_open
            and (self._sync.has_turn(self._world.frame) or not calls[0].steps.is_wanted)
        )

    def take_turns(self, now: float) -> None:
        """Carry out the ticks that wait, as far as what they wait for has been read, and until the turn is over.

        Call it again while `has_turn`, when all others have been served.
        """
        read_clock, sync, calls = self.read_clock, self._sync, self.calls
        if self._stepper.is_moving:
            return
        self._turn_until = math.inf if read_clock is None else read_clock() + TURN_TIME
        self._is_turn_over = False
        while calls and not self._is_turn_over and self._parts.gate.is_open:
            call = calls.popleft()
            if not call.steps.is_wanted and not sync.is_in_tick:
                self._finish(call, now)
            elif not self._carry_on(call, now):
                break
        self._end_waits(now)

    def wait_for_tick(self, caller: Participant, act: Callable[[float], object]) -> bool:
        """Have a change of the world wait until the tick that has begun is over and answered.

        Args:
            caller: held until then.
            act: makes the change; takes monotonic time [s].

        Returns:
            False if there is no such tick; then `act` is not called, and the change can be made at once.
        """
        if self._stepper.is_moving or (self._parts.gate.is_open and not self._sync.is_in_tick):
            return False
        self._behind_tick.append((act, self.hold(caller)))
        return True

    def _end_waits(self, now: float) -> None:
        """Make the changes that have waited for a tick, if it is over."""
        is_over = self._parts.failure.why is not None or not self._sync.is_in_tick
        while self._behind_tick and is_over and self._parts.gate.is_open and not self._stepper.is_moving:
            act, release = self._behind_tick.popleft()
            try:
                act(now)
            finally:
                release(now)

    def _carry_on(self, call: WaitingCall, now: float) -> bool:
        """Carry out ticks of a call that has been taken out of the queue; put it back in front if it is not over.

        Returns:
            False if no tick can be carried out now.
        """
        sync, calls, steps = self._sync, self.calls, call.steps
        num_ticks = self.num_ticks
        self._call_in_hand = call
        try:
            num_frames = sync.take_turn(self._world.frame, now, prepare=steps.before_tick, most_ticks=steps.num_at_once)
        except GraphError as error:
            calls.appendleft(call)
            self._refuse_ticks(str(error), now)
            return False
        finally:
            self._call_in_hand = None
        num_done = self.num_ticks - num_ticks
        is_enough = num_done > 0 and steps.after_ticks(num_done)
        if call.why is not None and steps.num_left:  # the tick has brought it about
            self._answer(call, TickResult(is_accepted=False, is_paused=sync.is_paused, why=call.why), now)
        elif is_enough or not steps.num_left:
            self._finish(call, now)
        else:
            calls.appendleft(call)
        return num_frames > 0

    def _finish(self, call: WaitingCall, now: float) -> None:
        """Answer a call; the ticks that it has left are not wanted."""
        num_left, call.steps.num_left = call.steps.num_left, 0
        if num_left:
            self._sync.give_up(num_left, now)
        self._answer(call, TickResult(is_accepted=True, is_paused=False), now)

    def _answer(self, call: WaitingCall, result: TickResult, now: float) -> None:
        """Answer a call whose frames have been computed: as soon as nothing of them is missing."""
        if self._parts.gate.is_open:
            call.end(result, now)
        else:
            self._unanswered.append((call, result))

    def _refuse_unanswered(self, now: float) -> None:
        """Refuse what has ended behind a closed gate: what is missing will never come."""
        unanswered, self._unanswered = self._unanswered, deque()
        for call, _ in unanswered:
            call.end(TickResult(is_accepted=False, is_paused=self._sync.is_paused, why=_WAS_RESET), now)

    def _go_on(self, now: float) -> None:
        """Answer what has ended behind the gate, which is open now, and carry out the ticks that wait."""
        self._ended_at = now
        while self._unanswered and self._parts.gate.is_open:
            call, result = self._unanswered.popleft()
            call.end(result, now)
        self.take_turns(now)

    def hold(self, participant: Participant) -> Callable[[float], None]:
        """Hold back a peer's input while its request is being carried out; its lease does not run out meanwhile.

        Returns:
            Releases it; takes monotonic time [s] and must be called once.
        """
        release = participant.hold()
        self._sync.mute(participant)

        def let_go(now: float) -> None:
            self._sync.unmute(participant, now)
            release()

        return let_go

    def _move(self, num_frames: int, now: float) -> int:
        """Compute frames of a tick, or of several ticks of one call, until the turn is over.

        Args:
            num_frames: up to the end of the last of these ticks. All of them have as many frames, the first one perhaps
                less since it has begun.

        Returns:
            How many frames have been computed, at least one.

        Raises:
            GraphError: a step has failed, now or before: the world stands still for good.
        """
        stepper, failure, call = self._stepper, self._parts.failure, self._call_in_hand
        if failure.why is not None:
            raise GraphError(failure.why)
        num_of_tick = num_frames if call is None else call.num_frames
        read_clock = None if call is None else self.read_clock
        num_left = num_frames
        stepper.is_moving = True
        try:
            while num_left:
                num_left -= 1
                is_last = num_left % num_of_tick == 0
                stepper.compute(now, is_tick=True, is_last=is_last)
                self.num_ticks += is_last
                if read_clock is not None and read_clock() >= self._turn_until:
                    self._is_turn_over = True
                if call is not None and call.why is not None:  # what a tick brings about does not stop that tick
                    if is_last:
                        break
                elif self._is_turn_over or not self._parts.gate.is_open:
                    break
        except Exception as error:
            raise GraphError(failure.note(error)) from error
        finally:
            stepper.is_moving = False
        self._ended_at = now
        for act in self._parts.hooks.after_move.awake:
            act(now)
        return num_frames - num_left

    def _refuse_ticks(self, why: str, now: float) -> None:
        """Answer the ticks that wait: they will not be carried out."""
        self._ended_at = now
        if self._call_in_hand is not None:  # its tick goes on to its end, and then it is answered
            self._call_in_hand.why = why
        refused = list(self.calls)
        self.calls.clear()
        for call in refused:
            call.end(TickResult(is_accepted=False, is_paused=self._sync.is_paused, why=why), now)
        self._end_waits(now)
