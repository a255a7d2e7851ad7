"""Context that the sensors of one simulator share: world, noise, and makers of messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.sensors.sensor_noise import NoiseSource, SensorNoise

T = TypeVar("T")


class SensorContext:
    """Context that the sensors of one simulator share.

    Attributes:
        simulator: its context.
        noise: errors of the readings; None for exact ones.
    """

    def __init__(self, simulator: SimulatorContext, noise: SensorNoise | None) -> None:
        self.simulator = simulator
        self.noise = noise
        self._made: dict[Callable[[Store], Any], Any] = {}

    def once(self, make: Callable[[Store], T]) -> T:
        """Return the result of a function of the simulator's types. The function is called once.

        Args:
            make: a function or class of a module.
        """
        if make not in self._made:
            self._made[make] = make(self.simulator.bus.store)
        made: T = self._made[make]
        return made

    def header(self, ego: Ego, frame_id: str) -> Struct:
        """Return the header of a message of this frame, by a sensor of an ego."""
        return self.simulator.convert.header(self.simulator.world.frame, ego.frame_prefix + frame_id)

    def errors(self, ego: Ego) -> NoiseSource | None:
        """Return the errors of an ego's sensors in this frame; None without any."""
        world = self.simulator.world
        if self.noise is None:
            return None
        return NoiseSource(self.noise, world.seed, world.uid.item(ego.row), world.frame)
