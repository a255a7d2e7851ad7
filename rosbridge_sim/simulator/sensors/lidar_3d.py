"""3D lidars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar, Final, Literal

from msgspec import Meta

from rosbridge_sim.documents import number_spelling
from rosbridge_sim.errors import FieldError
from rosbridge_sim.scenery.lidar_models import LIDAR_MODELS
from rosbridge_sim.simulator.sensors.sensor_specs import (
    MAX_RAYS,
    FrameId,
    MountedSpec,
    Near,
    Range,
    TopicName,
    check_ranges,
)

__all__ = ["POINT_BYTES", "Lidar3dSpec"]

MAX_RINGS: Final = 256
"""Rings of one lidar."""

POINT_BYTES: Final = 22
"""Bytes of a point of a PointCloud2."""

_NAMES: Final = ("/lidar3D", "/velodyne_points")
"""Two names for the messages of a 3D lidar: MORAI's own, and that of the velodyne driver, which most programs use."""

_Elevation = Annotated[float, number_spelling(-90.0, 90.0), Meta(ge=-90.0, le=90.0)]
_Columns = Annotated[int, number_spelling(0, MAX_RAYS, "integer"), Meta(ge=0, le=MAX_RAYS)]


class Lidar3dSpec(MountedSpec, frozen=True, kw_only=True):
    """A lidar that turns, with one beam for each ring.

    Attributes:
        model: the product, which has the angles of the rings; `own` for `elevations`.
        elevations: angles of the rings from the lowest to the highest [deg], for the model `own`.
        columns: beams of a ring in a turn; 0 for those of the model.
        min_range, max_range: nearest and farthest echo [m].
    """

    kind: ClassVar[str] = "lidar3d"
    is_drawn: ClassVar[bool] = True
    frame_id: FrameId = "velodyne"
    topic: TopicName = "/lidar3D"
    model: Literal["VLP-16", "HDL-32E", "OS1-64", "OS1-128", "own"] = "VLP-16"
    elevations: Annotated[tuple[_Elevation, ...], Meta(max_length=MAX_RINGS)] = ()
    columns: _Columns = 0
    min_range: Near = 0.5
    max_range: Range = 100.0

    @property
    def num_rings(self) -> int:
        """Number of rings."""
        return len(self.elevations) if self.model == "own" else len(LIDAR_MODELS[self.model].elevations_deg)

    @property
    def num_columns(self) -> int:
        """Beams of a ring in a turn."""
        return self.columns or (1800 if self.model == "own" else LIDAR_MODELS[self.model].columns)

    @property
    def topics(self) -> list[tuple[str, str]]:
        """All names of its one message."""
        names = _NAMES if self.topic in _NAMES else (self.topic,)
        return [(name, "sensor_msgs/PointCloud2") for name in names]

    @property
    def second_names(self) -> Sequence[str]:
        """Names of its message beside the topic."""
        return [name for name, _ in self.topics if name != self.topic]

    @property
    def num_rays(self) -> int:
        """Rays of a turn."""
        return self.num_rings * self.num_columns

    @property
    def raw_bytes(self) -> int:
        """Bytes of all points of a turn."""
        return POINT_BYTES * self.num_rays

    def check(self) -> None:
        """Check that the options fit each other; see `SensorSpec.check`."""
        where = self.frame_id
        if (self.model == "own") != bool(self.elevations):
            raise FieldError(f"{where}.elevations: expected angles for model 'own', and none for any other model")
        if any(high <= low for low, high in zip(self.elevations, self.elevations[1:], strict=False)):
            raise FieldError(f"{where}.elevations: expected angles that grow, from the lowest to the highest")
        check_ranges(where, self.min_range, self.max_range)
