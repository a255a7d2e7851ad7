"""The state of a replay, and the effects of its table carried out on the playback and on the simulator's pause.

`state_machine` defines the effects of each event, with the reasons. Only this module changes the state.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.replays.playback import Playback
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.state_machine import (
    REPLAY_TABLE,
    ReplayEffect,
    ReplayEvent,
    ReplayOutcome,
    ReplayState,
)

_log = logging.getLogger("rosbridge_sim.replay")


class ReplayProcess:
    """The state of a replay.

    Attributes:
        context: of the simulator.
        playback: the recording.
        state: where in the table it is.
        effects: function for each effect; takes monotonic time [s]. `NetworkReplay` registers the one for IGNORE.
        on_event: called after each event with monotonic time [s].
    """

    def __init__(self, context: SimulatorContext, playback: Playback) -> None:
        """Nothing is replayed yet.

        Args:
            context: of the simulator; its pause is read and set.
        """
        self.state = ReplayState.SIMULATING
        self.on_event: list[Callable[[float], None]] = []
        self.playback = playback
        self.context = context
        self._sync = context.sync
        self._was_paused = False  # before the recording moved the world
        self.effects: dict[ReplayEffect, Callable[[float], None]] = {
            ReplayEffect.LEAVE: self._leave,
            ReplayEffect.ENTER: self._enter,
            ReplayEffect.TUNE: lambda _now: playback.retarget(),
            ReplayEffect.SEEK: lambda _now: playback.show(),
            ReplayEffect.REWIND: lambda _now: playback.rewind(),
            ReplayEffect.RESUME: context.sync_driver.resume,
            ReplayEffect.HOLD: context.sync_driver.pause,
            ReplayEffect.AGAIN: self._begin_anew,
        }

    def happen(self, event: ReplayEvent, now: float) -> ReplayOutcome:
        """Change the state as the table says, and carry out the effects.

        Args:
            event: one that the table has for this state.

        Returns:
            The row of the table; its `why` is empty unless the event is refused.

        Raises:
            DocumentError: the scenario that is to begin anew does not fit into the world.
        """
        outcome = REPLAY_TABLE[self.state][event]
        self.state = outcome.state
        for effect in outcome.effects:
            self.effects[effect](now)
        if self.state is ReplayState.SIMULATING:
            self.playback.choose(Recording(""))  # the last one may be large
        for announce in self.on_event:
            announce(now)
        return outcome

    def check_end(self, now: float) -> None:
        """Pause at the end of a bag, and again if another command has ended that pause. Called after each frame."""
        if self.state is ReplayState.REPLAYING and self.playback.is_over:
            _log.info("%s: the end is reached", self.playback.recording.name)
            self.happen(ReplayEvent.RUN_OUT, now)
        elif self.state is ReplayState.AT_END and not self._sync.is_paused:
            self.happen(ReplayEvent.RUN_OUT, now)

    def evict(self, now: float) -> None:
        """End the replay, because a scenario or a reset is about to change the world."""
        if self.state is not ReplayState.SIMULATING:
            _log.info("the replay has ended: a scenario or a reset changes the world")
        # A client that has pressed play since then wants the new scene to run.
        self._was_paused &= self._sync.is_paused
        self.happen(ReplayEvent.EVICT, now)

    def save_state(self) -> PlainData:
        """Return the state, and whether the simulator was paused before a recording moved it."""
        return (int(self.state), self._was_paused)

    def load_state(self, data: PlainData) -> None:
        """Become what was saved, without any effect: the playback is restored by itself.

        Raises:
            ValueError: it is no such data.
        """
        state, was_paused = data
        if type(state) is not int or type(was_paused) is not bool:
            raise ValueError("replay: expected a state")
        self.state, self._was_paused = ReplayState(state), was_paused

    def _enter(self, now: float) -> None:
        del now
        self._was_paused = self._sync.is_paused
        self.playback.enter()

    def _leave(self, now: float) -> None:
        self.playback.leave()
        sync = self._sync
        if sync.is_paused and not self._was_paused:
            self.context.sync_driver.resume(now)
        elif self._was_paused and not sync.is_paused:
            self.context.sync_driver.pause(now)

    def _begin_anew(self, now: float) -> None:
        context = self.context
        context.scene_changes.carry_out(context.scene.loaded, is_pausing=False, now=now)
