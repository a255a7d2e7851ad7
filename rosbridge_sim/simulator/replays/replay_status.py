"""The topic with the position of a replay: `/sim/replay`."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.state_machine import ReplayState

REPLAY: Final = "/sim/replay"

RATE: Final = 10.0
"""Messages a second of simulated time: a slider moves smoothly enough."""


class ReplayStatus:
    """Publisher of the position. It holds no state."""

    def __init__(self, process: ReplayProcess) -> None:
        """Publish nothing yet.

        Args:
            process: whether a recording moves the world.
        """
        context = self._context = process.context
        self._process = process
        self._make = context.maker("rosbridge_sim_msgs/Replay", "header state name duration position speed targets")

    def publish(self, publishers: Publishers) -> None:
        """Publish the topic."""
        publishers.add(
            REPLAY, "rosbridge_sim_msgs/Replay", self._message, rate=RATE, is_sampled=True, version=self._values
        )

    def _message(self) -> Struct:
        return self._make(self._context.convert.header(self._context.world.frame), *self._values())

    def _values(self) -> tuple[object, ...]:
        """Return the fields of the message behind the header."""
        state, playback = self._process.state, self._process.playback
        if state not in {ReplayState.REPLAYING, ReplayState.AT_END}:
            return "none", "", 0.0, 0.0, 0, 0
        word = "paused" if self._context.sync.is_paused else "playing"
        if state is ReplayState.AT_END:
            word = "ended"
        recording = playback.recording
        return (
            *(word, recording.name, recording.duration_ns / 1e9, playback.shown_ns / 1e9),
            *(playback.speed, playback.targets),
        )
