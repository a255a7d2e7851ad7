"""2D lidars."""

from __future__ import annotations

from typing import Annotated, ClassVar, Final

from msgspec import Meta

from rosbridge_sim.documents import number_spelling
from rosbridge_sim.errors import FieldError
from rosbridge_sim.simulator.sensors.sensor_specs import (
    MAX_RAYS,
    FrameId,
    MountedSpec,
    Near,
    Range,
    TopicName,
    check_ranges,
)

__all__ = ["Lidar2dSpec"]

MAX_SCAN: Final = 4_096
"""Ranges of a LaserScan: they are numbers of a text in JSON, 0.1 us each."""

_Count = Annotated[int, number_spelling(1, MAX_SCAN, "integer"), Meta(ge=1, le=MAX_SCAN)]
_Index = Annotated[int, number_spelling(0, MAX_RAYS, "integer"), Meta(ge=0, le=MAX_RAYS)]


class Lidar2dSpec(MountedSpec, frozen=True, kw_only=True):
    """A lidar with one level ring; a message is a LaserScan of a full turn.

    Attributes:
        num_values: ranges of a turn.
        ahead: index of the range that looks ahead; the angle grows to the left with the index.
        min_range, max_range: nearest and farthest echo [m].
    """

    kind: ClassVar[str] = "lidar2d"
    is_drawn: ClassVar[bool] = True
    frame_id: FrameId = "lidar2D"
    topic: TopicName = "/lidar2D"
    num_values: _Count = 360
    ahead: _Index = 180
    min_range: Near = 0.1
    max_range: Range = 30.0

    @property
    def topics(self) -> list[tuple[str, str]]:
        """Its one topic."""
        return [(self.topic, "sensor_msgs/LaserScan")]

    @property
    def num_rays(self) -> int:
        """Rays of a turn."""
        return self.num_values

    def check(self) -> None:
        """Check that the options fit each other; see `SensorSpec.check`."""
        if self.ahead >= self.num_values:
            raise FieldError(
                f"{self.frame_id}.ahead: expected an index below num_values = {self.num_values}, got {self.ahead}"
            )
        check_ranges(self.frame_id, self.min_range, self.max_range)
