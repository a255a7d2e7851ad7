"""3D lidars."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple

import numpy as np
from msgspec import Meta

from rosbridge_sim.documents.document_model import number_within
from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.sensor_data.lidar_sweep import POINT_TYPE, Beams, beams_3d, pack_points
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, Makers, Sight, Sighting
from rosbridge_sim.simulator.sensors.lidar_sensor import LidarSpec
from rosbridge_sim.simulator.sensors.morai_items import Item, Reading
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_specs import MAX_RAYS, Cost, FrameId, Near, Range, TopicName


class LidarModel(NamedTuple):
    """A lidar that turns about its z axis.

    Attributes:
        elevations_deg: of each laser, positive up, the lowest first; its place is the ring [deg].
        columns: directions in a turn in which all lasers fire, at 10 turns a second.
    """

    elevations_deg: tuple[float, ...]
    columns: int


def _evenly(low: float, high: float, num: int) -> tuple[float, ...]:
    return tuple((low + (high - low) * np.arange(num) / (num - 1)).round(4).tolist())


LIDAR_MODELS: Final = {
    "VLP-16": LidarModel(_evenly(-15.0, 15.0, 16), 1800),
    "HDL-32E": LidarModel(_evenly(-30.67, 10.67, 32), 2170),
    "OS1-64": LidarModel(_evenly(-22.5, 22.5, 64), 1024),
    "OS1-128": LidarModel(_evenly(-22.5, 22.5, 128), 1024),
}
"""Models by name. At 10 turns a second a VLP-16 fires each 0.2 deg, an HDL-32E each 46.08 us."""


MAX_RINGS: Final = 256
"""Rings of one lidar."""

_NAMES: Final = ("/lidar3D", "/velodyne_points")
"""Two names for the messages of a 3D lidar: MORAI's own, and that of the velodyne driver, which most programs use."""

_VLP_16: Final = 0
"""`lidar3DType` of a VLP-16 in a saved file of MORAI."""

_FLOAT32, _UINT16 = 7, 4
"""Types of a `PointField`."""

_Elevation = Annotated[float, number_within(-90.0, 90.0)]
_Columns = Annotated[int, number_within(0, MAX_RAYS)]


class Cloud(Sighting, eq=False):
    """Points of a turn.

    Attributes:
        data: of `POINT_TYPE`.
        num: points.
        file: x, y, z and intensity as float32 for a file; empty if it was not wanted.
    """

    data: bytes
    num: int
    file: bytes = b""


def _maker(store: Store) -> Callable[[Struct, Cloud], Struct]:
    """Return a function that makes the PointCloud2 of a turn."""
    names = "header height width fields is_bigendian point_step row_step data is_dense"
    make = maker(store, Lidar3dSpec.type_name, names)
    field = maker(store, "sensor_msgs/PointField", "name offset datatype count")
    parts, step = POINT_TYPE.fields, POINT_TYPE.itemsize
    assert parts is not None, "it has fields"
    fields = [field(name, parts[name][1], _UINT16 if name == "ring" else _FLOAT32, 1) for name in parts]
    return lambda header, cloud: make(header, 1, cloud.num, fields, False, step, step * cloud.num, cloud.data, True)  # noqa: FBT003 - fields of the message


class Lidar3dSpec(LidarSpec, frozen=True, kw_only=True):
    """A lidar that turns, with one beam for each ring.

    Attributes:
        model: the product, which has the angles of the rings; `own` for `elevations`.
        elevations: angles of the rings from the lowest to the highest [deg], for the model `own`.
        columns: beams of a ring in a turn; 0 for those of the model.
        min_range, max_range: nearest and farthest echo [m].
    """

    kind: ClassVar[str] = "lidar3d"
    morai_noun: ClassVar[str] = "3D lidar"
    morai_lists: ClassVar[tuple[str, ...]] = ("Lidar3DList",)
    type_name: ClassVar[str] = "sensor_msgs/PointCloud2"
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
        return [(name, self.type_name) for name in names]

    @property
    def cost(self) -> Cost:
        """Rays and points of a turn."""
        num = self.num_rings * self.num_columns
        return Cost(num_rays=num, num_bytes=num * POINT_TYPE.itemsize)

    def check(self) -> None:
        """Check that the options fit each other; see `SensorSpec.check`."""
        where = self.frame_id
        if (self.model == "own") != bool(self.elevations):
            raise FieldError(f"{where}.elevations: expected angles for model 'own', and none for any other model")
        if any(high <= low for low, high in zip(self.elevations, self.elevations[1:], strict=False)):
            raise FieldError(f"{where}.elevations: expected angles that grow, from the lowest to the highest")
        super().check()

    def of_morai(self, item: Item, reading: Reading) -> dict[str, Any]:
        """Return the keys of a sensor in a file of MORAI; see `SensorSpec.of_morai`."""
        found, number = super().of_morai(item, reading), item.block.lidar3DType
        if number != _VLP_16:
            reading.remarks.append(
                f"{found['frame_id']}: which product lidar3DType {number} is, is not known; it is a VLP-16"
            )
        return {**found, "max_range": item.block.fireDistance}

    @property
    def beams(self) -> Beams:
        """Beams of a turn."""
        angles = self.elevations if self.model == "own" else LIDAR_MODELS[self.model].elevations_deg
        return _beams(angles, self.num_columns, 1.0 / self.rate)

    @property
    def file_name(self) -> str:
        """Name of its file in a capture; see `SensorSpec.file_name`."""
        return f"LIDAR_{self.frame_id}_{{}}.bin"

    def see(self, sight: Sight, static: Mesh, job: DrawingJob, makers: Makers) -> Cloud:
        """Return the points of a turn; see `DrawnSpec.see`."""
        echoes = self._echoes(sight, static, job, makers)
        data, num = pack_points(echoes, self.beams, self.min_range, self.max_range)
        file = b""
        if sight.is_for_file:
            file = np.frombuffer(data, dtype=np.uint8).reshape(num, POINT_TYPE.itemsize)[:, :16].tobytes()
        return Cloud(data, num, file)

    def show(self, shared: SensorContext, number: int, header: Struct, result: Sighting) -> Struct | None:  # noqa: ARG002 - all have one message
        """Return the message of a turn; see `DrawnSpec.show`."""
        assert isinstance(result, Cloud), "it is of this kind"
        return shared.once(_maker)(header, result)


@lru_cache(maxsize=4)  # 34 MB each at most
def _beams(elevations_deg: tuple[float, ...], num_columns: int, period: float) -> Beams:
    return beams_3d(np.radians(elevations_deg), num_columns, period)
