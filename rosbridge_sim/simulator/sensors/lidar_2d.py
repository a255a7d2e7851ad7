"""2D lidars."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, ClassVar, Final

import numpy as np

from rosbridge_sim.documents.document_model import number_within
from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Beams, beams_2d
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, Makers, Sight, Sighting
from rosbridge_sim.simulator.sensors.lidar_sensor import LidarSpec
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_specs import MAX_RAYS, Cost, FrameId, Near, Range, TopicName

MAX_SCAN: Final = 4_096
"""Ranges of a LaserScan: they are numbers of a text in JSON, 0.1 us each."""

_Count = Annotated[int, number_within(1, MAX_SCAN)]
_Index = Annotated[int, number_within(0, MAX_RAYS)]


class Scan(Sighting, eq=False):
    """Ranges of a turn; inf where nothing is in range [m], and intensities."""

    ranges: list[float]
    intensities: list[float]


def _maker(store: Store) -> Callable[..., Struct]:
    return maker(
        store,
        Lidar2dSpec.type_name,
        "header angle_min angle_max angle_increment time_increment scan_time range_min range_max ranges intensities",
    )


class Lidar2dSpec(LidarSpec, frozen=True, kw_only=True):
    """A lidar with one level ring; a message is a LaserScan of a full turn.

    Attributes:
        num_values: ranges of a turn.
        ahead: index of the range that looks ahead; the angle grows to the left with the index.
        min_range, max_range: nearest and farthest echo [m].
    """

    kind: ClassVar[str] = "lidar2d"
    morai_noun: ClassVar[str] = "2D lidar"
    morai_lists: ClassVar[tuple[str, ...]] = ("Lidar2DList",)
    type_name: ClassVar[str] = "sensor_msgs/LaserScan"
    frame_id: FrameId = "lidar2D"
    topic: TopicName = "/lidar2D"
    num_values: _Count = 360
    ahead: _Index = 180
    min_range: Near = 0.1
    max_range: Range = 30.0

    @property
    def cost(self) -> Cost:
        """Rays of a turn."""
        return Cost(num_rays=self.num_values)

    def check(self) -> None:
        """Check that the options fit each other; see `SensorSpec.check`."""
        if self.ahead >= self.num_values:
            raise FieldError(
                f"{self.frame_id}.ahead: expected an index below num_values = {self.num_values}, got {self.ahead}"
            )
        super().check()

    @property
    def beams(self) -> Beams:
        """Beams of a turn."""
        return _beams(self.num_values, self.ahead, 1.0 / self.rate)

    def see(self, sight: Sight, static: Mesh, job: DrawingJob, makers: Makers) -> Scan:
        """Return the ranges of a turn; see `DrawnSpec.see`."""
        echoes = self._echoes(sight, static, job, makers)
        is_found = (echoes.ranges >= self.min_range) & (echoes.ranges <= self.max_range)
        ranges = np.where(is_found, echoes.ranges, np.float32(np.inf))
        return Scan(ranges.tolist(), np.where(is_found, echoes.intensities, np.float32(0.0)).tolist())

    def show(self, shared: SensorContext, number: int, header: Struct, result: Sighting) -> Struct | None:  # noqa: ARG002 - it has one topic
        """Return the LaserScan of a turn; see `DrawnSpec.show`."""
        assert isinstance(result, Scan), "it is of this kind"
        step = 6.283185307179586 / self.num_values
        period = 1.0 / self.rate
        first = -step * self.ahead
        return shared.once(_maker)(
            *(header, first, first + step * (self.num_values - 1), step, period / self.num_values, period),
            *(self.min_range, self.max_range, result.ranges, result.intensities),
        )


_beams = lru_cache(maxsize=4)(beams_2d)  # 34 MB each at most
