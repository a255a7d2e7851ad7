"""One frame: the only code that moves the world.

The order is: commands that waited for the frame, one step, the stamp, the topics, `/SyncModeInfo`, and the components'
functions after a frame. Real time and synchronous mode differ only in the topics that are published.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.kernel.egos import EgoRegistry
from rosbridge_sim.simulator.kernel.hooks import Hooks
from rosbridge_sim.simulator.kernel.real_time_pacer import RealTimePacer, ShowLimit
from rosbridge_sim.simulator.kernel.simulation_time import SimulationTime
from rosbridge_sim.simulator.kernel.sync_info import SyncInfo
from rosbridge_sim.simulator.scene.scene_commands import SceneCommand
from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.world.state.world import World

Step = Callable[[World, Callable[[], None] | None], None]
"""Moves a world by one frame, in place, and calls the second argument within the step; see `world.step`."""


class FrameMeter(Protocol):
    """Measures each frame: its step, and everything that is published with it."""

    def begin(self) -> None:
        """Start the measurement of a frame."""

    def end(self) -> None:
        """End the measurement of a frame."""


def _no_executor(command: SceneCommand, _now: float) -> None:
    """Stand for the executor that the node factory puts in place."""
    raise AssertionError(f"nothing carries out {command.action!r}")


@dataclass(eq=False, kw_only=True, slots=True)
class FrameStepper:
    """Computes frames and publishes them.

    Attributes:
        step: moves a world by one frame.
        sync: has the commands that wait for a frame.
        egos: their status messages are made anew after each step.
        hooks: `place`, `once_after_frame` and `after_frame` are called.
        sync_info: is published after all other topics.
        is_moving: frames are being computed now; set by the caller that computes several.
        now: monotonic time at which the last frame was computed [s].
        num_frames: frames computed since the start; a reset of the world does not set it back.
        meter: measures each frame; None for no measurement.
        carry_out: `(command, now)`: carries out a command that has waited for the frame.
    """

    world: World
    step: Step
    sync: Sync[SceneCommand]
    egos: EgoRegistry
    hooks: Hooks
    time: SimulationTime
    pacer: RealTimePacer
    publishers: Publishers
    sync_info: SyncInfo
    is_moving: bool = False
    now: float = 0.0
    num_frames: int = 0
    meter: FrameMeter | None = None
    carry_out: Callable[[SceneCommand, float], object] = _no_executor
    _info_limit: ShowLimit = field(init=False)

    def __post_init__(self) -> None:
        self._info_limit = ShowLimit(self.pacer)

    def compute(self, now: float, *, is_tick: bool, is_last: bool, is_complete: bool = False) -> None:
        """Move the world by one frame and publish it.

        Args:
            is_tick: a tick asked for the frame, so every topic is published. Otherwise real time did, and rates apply.
            is_last: no other frame of the same tick follows.
            is_complete: real time asked for it, and every topic is published all the same.
        """
        world, hooks, meter = self.world, self.hooks, self.meter
        if meter is not None:
            meter.begin()
        if self.sync.queue:
            for command in self.sync.due(world.frame + 1):
                self.carry_out(command, now)
        self.step(world, self._place if hooks.place.awake else None)
        self.egos.forget_statuses()
        self.time.follow()
        if is_tick:
            self.publishers.show_every(world.frame, now)
            self.sync_info.announce(now, may_tick=is_last)
        else:
            self.pacer.count()
            if is_complete:
                self.publishers.show_every(world.frame, now)
            else:
                self.publishers.show_due(world.frame, self.pacer.shown_at, now)
            if is_complete or self._info_limit.is_open(world.frame, now):
                self.sync_info.announce(now, may_tick=is_last)
        self.now = now
        while hooks.once_after_frame:
            hooks.once_after_frame.pop(0)(now)
        for act in hooks.after_frame.awake:
            act(now)
        self.num_frames += 1
        if meter is not None:
            meter.end()

    def _place(self) -> None:
        """Let the components place entities within a step."""
        for place in self.hooks.place.awake:
            place()
