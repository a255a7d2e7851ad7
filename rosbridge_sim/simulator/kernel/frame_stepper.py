"""One frame: the only code that moves the world.

The order is: commands that waited for the frame, one step, the stamp, the topics, `/SyncModeInfo`, and the components'
functions after a frame. Real time and synchronous mode differ only in the topics that are published.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from rosbridge_sim.simulator.kernel.real_time_pacer import ShowLimit
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts
from rosbridge_sim.simulator.scene.scene_commands import SceneCommand
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


class FrameStepper:
    """Computes frames and publishes them.

    Attributes:
        step: moves a world by one frame.
        is_moving: frames are being computed now; set by the caller that computes several.
        now: monotonic time at which the last frame was computed [s].
        num_frames: frames computed since the start; a reset of the world does not set it back.
        meter: measures each frame; None for no measurement.
        carry_out: `(command, now)`: carries out a command that has waited for the frame.
    """

    def __init__(self, parts: SimulatorParts, step: Step) -> None:
        self.step = step
        self.is_moving = False
        self.now = 0.0
        self.num_frames = 0
        self.meter: FrameMeter | None = None
        self.carry_out: Callable[[SceneCommand, float], object] = _no_executor
        self._parts = parts
        self._info_limit = ShowLimit(parts.pacer)

    def compute(self, now: float, *, is_tick: bool, is_last: bool, is_complete: bool = False) -> None:
        """Move the world by one frame and publish it.

        Args:
            is_tick: a tick asked for the frame, so every topic is published. Otherwise real time did, and rates apply.
            is_last: no other frame of the same tick follows.
            is_complete: real time asked for it, and every topic is published all the same.
        """
        parts, meter = self._parts, self.meter
        world, hooks, publishers = parts.world, parts.hooks, parts.publishers
        if meter is not None:
            meter.begin()
        if parts.sync.queue:
            for command in parts.sync.due(world.frame + 1):
                self.carry_out(command, now)
        self.step(world, self._place if hooks.place.awake else None)
        parts.egos.forget_statuses()
        parts.time.follow()
        if is_tick:
            publishers.show_every(world.frame, now)
            parts.sync_info.announce(now, may_tick=is_last)
        else:
            parts.pacer.count()
            if is_complete:
                publishers.show_every(world.frame, now)
            else:
                publishers.show_due(world.frame, parts.pacer.shown_at, now)
            if is_complete or self._info_limit.is_open(world.frame, now):
                parts.sync_info.announce(now, may_tick=is_last)
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
        for place in self._parts.hooks.place.awake:
            place()
