"""What follows when a participant has left the bus."""

from __future__ import annotations

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.context import SimulatorContext

__all__ = ["Departures"]


class Departures:
    """Tells the components and synchronous mode who has left; never within a frame, in which nobody comes or goes."""

    def __init__(self, context: SimulatorContext) -> None:
        """Watch the bus."""
        self._context = context
        self._waiting: list[Participant] = []  # those who left while frames were computed
        context.hooks.after_move.append(self._tell_waiting)
        context.bus.on_leave.append(self._leave)

    def _leave(self, participant: Participant, now: float) -> None:
        """A participant has left; perhaps within a frame, on a message of which its connection has failed."""
        context = self._context
        context.warnings.forget(participant)
        if context.failure.why is not None:
            return
        if context.stepper.is_moving:
            self._waiting.append(participant)
            return
        for act in context.hooks.on_leave:  # whatever fails here, a master that is gone must not keep the world waiting
            context.bus.guard.attempt("what follows an owner's end", act, participant, now)
        context.sync_driver.leave(participant, now)

    def _tell_waiting(self, now: float) -> None:
        if self._waiting:
            left, self._waiting = self._waiting, []
            for participant in left:
                self._leave(participant, now)
