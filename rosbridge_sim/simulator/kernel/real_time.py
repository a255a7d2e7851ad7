"""Real time: the frames that the clock owes.

The shell calls `advance` whenever `next_due` says so. Nothing in here looks at a clock: `now` only says how much is
owed. So a drive over ticks alone gives the same bytes on every run.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final

from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.sync.barrier_table import BarrierState
from rosbridge_sim.simulator.sync.sync_table import SyncState

TURN_TIME: Final = 0.003
"""Longest time for which one `advance` computes frames, before clients have their turns [s]; a frame is finished."""

MAX_FAST_FRAMES: Final = 100
"""The same in frames, where the world runs as fast as possible: what the smallest scene does in `TURN_TIME`."""

MAX_FRAMES_AT_ONCE: Final = 5
"""Frames that one `advance` computes at most, so that catching up does not keep clients waiting."""

_log = logging.getLogger("rosbridge_sim.morai")


def set_real_time_factor(context: SimulatorContext, factor: float, now: float) -> None:
    """Have another real-time factor from now on.

    Args:
        factor: one of which `why_no_factor` says nothing.
    """
    context.pacer.set_factor(factor, now)
    context.publishers.set_factor(factor)


class RealTime:
    """Moves the world while no master and no pause holds it. It holds no state: that is the pacer's.

    Attributes:
        read_clock: the time that ends a turn [s]; None for turns of `MAX_FRAMES_AT_ONCE`.
    """

    def __init__(self, context: SimulatorContext) -> None:
        """Nothing is owed before the first `advance`."""
        self.read_clock: Callable[[], float] | None = None
        self._context = context
        context.hooks.on_mode_change.append(context.sync_info.announce_frame)

    def advance(self, now: float) -> None:
        """Compute what real time owes by now, a few frames at most; end a lease that has run out.

        Call it again at `next_due`.

        Raises:
            Exception: a step has failed, here or in a tick since the last call. With `on_world_failure` "serve" nothing
                is raised: the simulator stands still and refuses everything from then on.
        """
        failure = self._context.failure
        if self._context.late_work.take_turn(now):
            return
        if failure.why is None:
            try:
                self._advance(now)
            except Exception as error:  # noqa: BLE001 - our own bug, whatever it is
                failure.note(error)
        failure.raise_unless_serving()

    def next_due(self, now: float) -> float | None:
        """Return the time of the next call of `advance` [s]; None while only a service call can move the world."""
        context = self._context  # called after each op: only what can be due is asked
        if context.late_work.waiting:
            return now
        failure, publishers, driver, sync = context.failure, context.publishers, context.sync_driver, context.sync
        if failure.why is not None:
            return None if failure.is_serving_on else now
        is_free = sync.state is SyncState.FREE
        if (driver.calls and driver.has_turn) or publishers.has_viewer_to_show(is_flowing=is_free):
            return now
        dues: list[float | None] = []
        if sync.lease is not None:
            dues.append(sync.lease_due)
        if context.barrier.state is not BarrierState.EMPTY:
            dues.append(context.barrier.due(now))
        if publishers.pause_at is not None:
            dues.append(publishers.pause_due(now))
        if is_free:
            dues += (self._frame_due(now) if context.pacer.is_started else now, publishers.repeat_due)
        return min((due for due in dues if due is not None), default=None)

    def _frame_due(self, now: float) -> float | None:
        """Return when the next frame begins [s]; None if it waits for messages of the last one."""
        pacer, wait = self._context.pacer, self._context.command_wait
        if not wait.is_on:
            return pacer.due_at
        return max(pacer.due_at, wait.until(now)) if self._context.gate.is_open else None

    def _advance(self, now: float) -> None:
        context = self._context
        sync, publishers, pacer, stepper = context.sync, context.publishers, context.pacer, context.stepper
        context.sync_driver.expire(now)
        context.sync_driver.take_turns(now)
        publishers.show_in_pause(now)
        publishers.show_viewers(now, is_flowing=sync.is_free)
        if not sync.is_free:
            return
        if not pacer.is_started:
            pacer.start(now)
        wait = context.command_wait
        if wait.is_on:
            due = self._frame_due(now)
            if due is None or now < due:
                publishers.repeat(now)
                return
        given_up = pacer.forgive(now)
        if given_up:
            publishers.forget_repeats()
            level = logging.WARNING if pacer.num_stalls == 1 and not wait.is_on else logging.DEBUG
            _log.log(level, "stalled for %.2f s: the simulated clock stood meanwhile", given_up)
        stepper.is_moving = True
        read_clock = self.read_clock
        until = None if read_clock is None else read_clock() + TURN_TIME
        most = MAX_FRAMES_AT_ONCE if pacer.factor or until is None else MAX_FAST_FRAMES
        try:
            for _ in range(most):
                due = self._frame_due(now)
                if due is None or now < due or not sync.is_free:
                    break
                wait.end()
                publishers.repeat(pacer.due_at)
                stepper.compute(now, is_tick=False, is_last=True, is_complete=wait.is_on)
                if until is not None and read_clock is not None and read_clock() >= until:
                    break
        finally:
            stepper.is_moving = False
        for act in context.hooks.after_move.awake:
            act(now)
        publishers.repeat(now)
        pacer.measure(now)
