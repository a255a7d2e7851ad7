"""Synchronous mode of the simulator: carries out its ticks and its effects on the world.

A service call moves the frames of one time step within the call, and everything that those frames publish is in the
listeners' hands before the answer is given. Only a tick whose frames need a scenario that is still being read waits;
its caller is held meanwhile, and `take_turns` carries it out.

`Sync` decides, and calls the functions that are registered here. All changes of the mode go through this file.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.participant import Participant, hold
from rosbridge_sim.morai.frame_stepper import FrameStepper
from rosbridge_sim.morai.hooks import Hooks
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.real_time_pacer import RealTimePacer
from rosbridge_sim.morai.sync import SceneCommand, Sync
from rosbridge_sim.morai.sync_table import SyncOutcome, SyncState
from rosbridge_sim.morai.world_failure import WorldFailure
from rosbridge_sim.world.state import World

__all__ = ["OnTick", "SyncDriver", "TickResult"]

_log = logging.getLogger("rosbridge_sim.morai")


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


class SyncDriver:
    """Carries out ticks, and starts, stops, pauses and resumes the world.

    Attributes:
        num_ticks: ticks carried out.
    """

    def __init__(
        self,
        *,
        world: World,
        sync: Sync[SceneCommand],
        stepper: FrameStepper,
        pacer: RealTimePacer,
        publishers: Publishers,
        hooks: Hooks,
        failure: WorldFailure,
    ) -> None:
        """Register with `sync`; no tick waits.

        Args:
            world: has the frame.
            sync: decides.
            stepper: computes the frames.
            pacer: counts real time.
            publishers: stop what only real time has, and publish in a pause.
            hooks: `after_move` and `on_mode_change` are called.
            failure: refuses ticks, and records a failed step.
        """
        self.num_ticks = 0
        self._world = world
        self._sync = sync
        self._stepper = stepper
        self._publishers = publishers
        self._hooks = hooks
        self._failure = failure
        # Those that wait, each with what releases its caller; `sync` has as many.
        self._ticks: deque[tuple[OnTick, Callable[[float], None]]] = deque()
        sync.hooks.move.append(self._move)
        sync.hooks.refuse.append(self._refuse_ticks)
        sync.hooks.flow.append(pacer.start)

    # The mode

    def start(self, user_id: str, step_ms: int, caller: Participant, now: float) -> SyncOutcome:
        """Start the mode, or change its time step; see `Sync.start`."""
        outcome = self._sync.start(user_id, step_ms, caller, now)
        self._settle(now)
        return outcome

    def stop(self, user_id: str, now: float) -> SyncOutcome:
        """End the mode; see `Sync.stop`."""
        outcome = self._sync.stop(user_id, now)
        self._settle(now)
        return outcome

    def pause(self, now: float) -> None:
        """Pause the world; the mode stays as it is."""
        self._sync.pause(now)
        self._settle(now)

    def resume(self, now: float) -> None:
        """End the pause."""
        self._sync.resume(now)
        self._settle(now)

    def leave(self, participant: Participant, now: float) -> None:
        """Note that a participant has left; it may be the last one that used the master's id."""
        self._note_loss(self._sync.leave(participant, now), now)

    def expire(self, now: float) -> None:
        """End a lease that has run out."""
        self._note_loss(self._sync.expire(now), now)

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

    # Ticks

    def ask_tick(self, user_id: str, named: int, caller: Participant, on_end: OnTick, now: float) -> None:
        """Move the world by one time step, and publish every frame of it, if the mode allows it.

        Args:
            user_id: the id that the caller ticks with.
            named: the frame that it asks for.
            caller: held for as long as its tick waits.
            on_end: called once, perhaps before this returns.
            now: monotonic time [s].

        Raises:
            GraphError: a step has failed, now or before: the world stands still for good.
        """
        sync = self._sync
        is_paused = sync.is_paused  # before the frames of this tick, which may bring a pause
        outcome = sync.tick(user_id, named, self._world.frame, caller, now, on_wait=partial(self._wait, caller, on_end))
        if not outcome.is_accepted:
            on_end(TickResult(is_accepted=False, is_paused=is_paused, why=sync.why(outcome), reason=outcome.reason))
        elif outcome.state is not SyncState.WAITING:
            on_end(TickResult(is_accepted=True, is_paused=is_paused))

    def take_turns(self, now: float) -> None:
        """Carry out the ticks that wait, as far as what they wait for has been read."""
        while self._ticks and not self._stepper.is_moving:
            on_end, release = first = self._ticks.popleft()
            try:
                if not self._sync.take_turn(self._world.frame, now):
                    self._ticks.appendleft(first)
                    return
            except GraphError as error:
                self._ticks.appendleft(first)
                self._refuse_ticks(str(error), now)
                return
            try:
                on_end(TickResult(is_accepted=True, is_paused=False))
            finally:
                release(now)

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

    def _wait(self, caller: Participant, on_end: OnTick) -> None:
        self._ticks.append((on_end, self.hold(caller)))

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
        for act in self._hooks.after_move:
            act(now)

    def _refuse_ticks(self, why: str, now: float) -> None:
        """Answer the ticks that wait: they will not be carried out."""
        refused = list(self._ticks)
        self._ticks.clear()
        for on_end, release in refused:
            on_end(TickResult(is_accepted=False, is_paused=self._sync.is_paused, why=why))
            release(now)
