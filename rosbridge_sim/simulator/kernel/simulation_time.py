"""Time of the simulator's stamps: simulated time, or the time of day.

Stamps are simulated time unless `use_wall_time` was called. Then the shell's clock is read once for each frame, so all
messages of the frame have one stamp. Everything except the stamps is the same in every run.
"""

from __future__ import annotations

from collections.abc import Callable

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.world.state.world import STEP_NS, World


class SimulationTime:
    """Stamps of the bus and of the simulator's messages, and the topic `/clock`."""

    def __init__(self, bus: Bus, world: World, convert: Converter, publishers: Publishers) -> None:
        """Stamp with simulated time, from the first `follow` on.

        Args:
            bus: its time and its stamp are written.
            world: its frame is the simulated time.
            convert: its stamp is written.
            publishers: take `/clock`.
        """
        self._bus = bus
        self._world = world
        self._convert = convert
        self._read_wall_ns: Callable[[], int] | None = None
        publishers.add("/clock", "rosgraph_msgs/Clock", self._clock)

    @property
    def is_wall(self) -> bool:
        """Return whether the time of day is stamped."""
        return self._read_wall_ns is not None

    def use_wall_time(self, read_ns: Callable[[], int]) -> None:
        """Stamp with the time of day from now on.

        Args:
            read_ns: returns the time of day [ns], which must never go back; called once for each frame.
        """
        self._read_wall_ns = read_ns
        self.follow()

    def follow(self) -> None:
        """Set the stamp of the world's current frame, for all messages until the next call."""
        if self._read_wall_ns is not None:
            self._convert.wall_ns = self._read_wall_ns()
        frame = self._world.frame
        self._bus.time_ns = frame * STEP_NS
        self._bus.stamp_ns = self._convert.stamp_ns(frame)

    def _clock(self) -> Struct:
        return self._convert.clock(self._world.frame)
