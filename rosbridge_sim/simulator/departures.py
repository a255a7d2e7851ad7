"""Effects of a participant that leaves the bus."""

from __future__ import annotations

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.simulator.kernel.context import SimulatorContext

__all__ = ["Departures"]


class Departures:
    """Reports departures to the components and to synchronous mode.

    A departure during a frame is reported after it, because the population must not change within a frame.
    """

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._waiting: list[Participant] = []  # those that left while frames were computed
        context.hooks.after_move.append(self._tell_waiting)
        context.hooks.after_move.rest(self._tell_waiting)
        context.bus.on_leave.append(self._leave)

    def _leave(self, participant: Participant, now: float) -> None:
        """Report a departure, perhaps of a connection that failed on a message of the frame in progress."""
        context = self._context
        context.warnings.forget(participant)
        if context.failure.why is not None:
            return
        if context.stepper.is_moving:
            self._waiting.append(participant)
            context.hooks.after_move.wake(self._tell_waiting)
            return
        for act in context.hooks.on_leave:  # a failure here must not keep the world waiting for a lost master
            context.bus.guard.attempt("what follows an owner's end", act, participant, now)
        context.sync_driver.leave(participant, now)

    def _tell_waiting(self, now: float) -> None:
        self._context.hooks.after_move.rest(self._tell_waiting)
        left, self._waiting = self._waiting, []
        for participant in left:
            self._leave(participant, now)
