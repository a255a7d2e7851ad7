"""A kind of sensor that each ego has: its topic, its frame, its readings and its file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.ego import Ego
from rosbridge_sim.simulator.kernel.tf_publisher import frame_prefix
from rosbridge_sim.simulator.sensors.sensor_noise import NoiseSource, SensorNoise

__all__ = ["Sensor"]


class Sensor(ABC):
    """One kind of sensor; a single object makes the readings of all egos.

    Attributes:
        title: name for people and for files.
        frame: its coordinate frame, without the prefix of an ego.
        topic: its topic, without the prefix of an ego.
        type_name: type of its messages.
    """

    title: ClassVar[str]
    frame: ClassVar[str]
    topic: ClassVar[str]
    type_name: ClassVar[str]

    def __init__(self, context: SimulatorContext, noise: SensorNoise | None) -> None:
        """Read nothing yet.

        Args:
            noise: errors of the readings; None for exact ones.
        """
        self._context = context
        self._noise = noise

    @abstractmethod
    def read(self, ego: Ego) -> Struct:
        """Return the message of the present frame, from the sensor's place on an ego."""

    @abstractmethod
    def file(self, frame: int, message: Struct) -> bytes:
        """Return the file that `/SaveSensorData` writes of a message."""

    def read_unless_lost(self, ego: Ego) -> Struct | None:
        """Return the message of the present frame; None if the sensor loses it."""
        return self.read(ego)

    def _header(self, ego: Ego) -> Struct:
        return self._context.convert.header(self._context.world.frame, frame_prefix(ego) + self.frame)

    def _source(self, noise: SensorNoise, ego: Ego) -> NoiseSource:
        world = self._context.world
        return NoiseSource(noise, world.seed, world.uid.item(ego.row), world.frame)
