"""Base of lidars with one ring and with many."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from rosbridge_sim.errors import FieldError
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.pictures import EXTINCTION
from rosbridge_sim.simulator.sensor_data.lidar_sweep import FADING, Beams, Echoes, echoes_of, fade, sweep
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, Makers, Sight
from rosbridge_sim.simulator.sensors.drawn_errors import disturb_echoes


class LidarSpec(DrawnSpec, frozen=True, kw_only=True):
    """A lidar of any kind."""

    maker: ClassVar[Literal["", "pictures", "rays"]] = "rays"
    noise_key: ClassVar[str] = "lidar"

    if TYPE_CHECKING:  # fields of each kind, behind its own
        min_range: float
        max_range: float

    @property
    def beams(self) -> Beams:
        """Beams of a turn."""
        raise NotImplementedError

    def check(self) -> None:
        """Check that there is something between the nearest and the farthest echo; see `SensorSpec.check`."""
        if self.min_range >= self.max_range:
            raise FieldError(
                f"{self.frame_id}.min_range: expected less than max_range = {self.max_range:g}, got {self.min_range:g}"
            )

    def _echoes(self, sight: Sight, static: Mesh, job: DrawingJob, makers: Makers) -> Echoes:
        """Return the echoes of a turn."""
        origins, directions = sweep(sight.motion, self.beams, static.origin)
        hits = makers.rays().cast(static, job.frame, origins, directions, self.max_range, without=sight.carrier)
        echoes = echoes_of(hits, directions)
        if job.weather in FADING:
            echoes = fade(echoes, EXTINCTION[job.weather], self.max_range)
        if sight.errors is not None:
            chance = sight.errors.generator(self.frame_id)
            echoes = disturb_echoes(echoes, self.max_range, sight.errors.noise.lidar, chance)
        return echoes
