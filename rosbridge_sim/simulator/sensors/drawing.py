"""Jobs of cameras and lidars at one frame for a thread, and their results.

`draw` does a job. It touches nothing of the simulator's state: a job has copies. So it may run in any thread, and the
same job gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, boxes_in_view, mount
from rosbridge_sim.scenery.lidar_models import LIDAR_MODELS
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.pictures import EXTINCTION, Channel, Picture, PictureMaker, RayMaker, Weather
from rosbridge_sim.scenery.scene_frame import SceneFrame
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.drawn_errors import disturb_echoes, disturb_picture
from rosbridge_sim.simulator.sensors.lidar_2d import Lidar2dSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.lidar_sweep import (
    FADING,
    Beams,
    Motion,
    beams_2d,
    beams_3d,
    echoes_of,
    fade,
    pack_points,
    sweep,
)
from rosbridge_sim.simulator.sensors.sensor_noise import NoiseSource
from rosbridge_sim.simulator.sensors.sensor_specs import SensorSpec

__all__ = [
    "Cloud",
    "DrawingJob",
    "DrawnSpec",
    "Makers",
    "Result",
    "Scan",
    "SensorWorker",
    "Shot",
    "Sight",
    "VisibleBoxes",
    "draw",
    "drawn_of",
    "model_of",
]

DrawnSpec: TypeAlias = CameraSpec | Lidar3dSpec | Lidar2dSpec
"""Specifications of the sensors that need the scene as triangles."""


def drawn_of(specs: Sequence[SensorSpec]) -> list[DrawnSpec]:
    """Return those of some sensors that are drawn."""
    return [spec for spec in specs if isinstance(spec, CameraSpec | Lidar3dSpec | Lidar2dSpec)]


BOX_RANGE: Final = 150.0
"""Farthest boxes in a picture [m]: a car there is 4 pixels wide at 640 pixels and 90 deg."""


class Sight(Record):
    """One sensor of a job.

    Attributes:
        spec: of the sensor.
        motion: of its vehicle.
        carrier: id of the vehicle, which the sensor does not see.
        has_boxes: the boxes of a picture are wanted, too.
        is_for_file: the bytes of a file are wanted.
        errors: of the sensor; None for none.
    """

    spec: DrawnSpec
    motion: Motion
    carrier: int
    has_boxes: bool = False
    is_for_file: bool = False
    errors: NoiseSource | None = None


class DrawingJob(Record, eq=False):
    """All that can be seen at one frame.

    Attributes:
        map_name: its name, which decides about what stands beside the roads, with the seed.
        seed: of the world.
        frame: what moves.
        sights: the sensors.
        weather: light and air.
        is_dressed: buildings, trees and posts stand beside the roads.
    """

    road_map: RoadMap
    map_name: str
    seed: int
    frame: SceneFrame
    sights: Sequence[Sight]
    weather: Weather = Weather.NOON
    is_dressed: bool = True


class VisibleBoxes(Record, eq=False):
    """Boxes of the entities of which a picture shows something; (k,) each unless told otherwise.

    Attributes:
        ids: of the entities.
        labels: classes of most of their pixels.
        bounds: (k, 4) left, top, right, bottom of the projected box [pixels].
        visibility: own pixels, as a share of those and the pixels within the bounds that something nearer covers.
        centres: (k, 3) middles in the camera's axes, x forward, y left, z up [m].
        sizes: (k, 3) length, width and height [m].
        axes: (k, 2, 3) directions of length and height in the camera's axes.
    """

    ids: list[int]
    labels: list[int]
    bounds: list[list[float]]
    visibility: list[float]
    centres: list[list[float]]
    sizes: list[list[float]]
    axes: list[list[list[float]]]


class Shot(Record, eq=False):
    """A picture.

    Attributes:
        data: JPEG, or the bytes of an Image.
        boxes: None if they were not wanted.
        file: JPEG for a file; empty if it was not wanted.
    """

    data: bytes
    boxes: VisibleBoxes | None
    file: bytes = b""


class Cloud(Record, eq=False):
    """Points of a 3D lidar.

    Attributes:
        data: of `POINT_TYPE`.
        num: points.
        file: x, y, z and intensity as float32 for a file; empty if it was not wanted.
    """

    data: bytes
    num: int
    file: bytes = b""


class Scan(Record, eq=False):
    """Ranges of a 2D lidar; inf where nothing is in range [m], and intensities."""

    ranges: list[float]
    intensities: list[float]


Result: TypeAlias = Shot | Cloud | Scan


class Makers(Record):
    """A renderer; it is made and used in one thread.

    Attributes:
        pictures: returns what draws pictures; it is made at the first call.
        rays: the same for what casts rays.
        encode_jpeg: `(picture, quality)`: returns the bytes of a JPEG.
        build: `(map, its name, seed, is_dressed)`: returns what does not move; the same object as long as these are the
            same.
        close: gives back what it holds.
    """

    pictures: Callable[[], PictureMaker]
    rays: Callable[[], RayMaker]
    encode_jpeg: Callable[[NDArray[np.uint8], int], bytes]
    build: Callable[[RoadMap, str, int, bool], Mesh]
    close: Callable[[], None] = lambda: None


class SensorWorker(Protocol):
    """Does jobs one after the other, beside the simulator."""

    @property
    def is_busy(self) -> bool:
        """True if a job waits or is being done."""

    def why_not(self, specs: Sequence[DrawnSpec]) -> str:
        """Return why it cannot draw for some sensors, and what to do; empty if it can, as far as is known."""

    def submit(self, job: DrawingJob, then: Callable[[Sequence[Result] | Exception, float], None]) -> None:
        """Do a job.

        Args:
            job: what is wanted.
            then: called once with the results in the order of the sights, or what has gone wrong, and monotonic time
                [s]; between two frames, perhaps before this method returns.
        """


def draw(job: DrawingJob, makers: Makers) -> list[Result]:
    """Return what the sensors of a job see, in their order."""
    static = makers.build(job.road_map, job.map_name, job.seed, job.is_dressed)
    return [_see(sight, static, job, makers) for sight in job.sights]


def _see(sight: Sight, static: Mesh, job: DrawingJob, makers: Makers) -> Result:
    spec = sight.spec
    if isinstance(spec, CameraSpec):
        return _shoot(spec, sight, static, job, makers)
    beams = _beams_of(spec)
    origins, directions = sweep(sight.motion, beams, static.origin)
    hits = makers.rays().cast(static, job.frame, origins, directions, spec.max_range, without=sight.carrier)
    echoes = echoes_of(hits, directions)
    if job.weather in FADING:
        echoes = fade(echoes, EXTINCTION[job.weather], spec.max_range)
    if sight.errors is not None:
        chance = sight.errors.generator(spec.frame_id)
        echoes = disturb_echoes(echoes, spec.max_range, sight.errors.noise.lidar, chance)
    if isinstance(spec, Lidar2dSpec):
        is_found = (echoes.ranges >= spec.min_range) & (echoes.ranges <= spec.max_range)
        ranges = np.where(is_found, echoes.ranges, np.float32(np.inf))
        return Scan(ranges.tolist(), np.where(is_found, echoes.intensities, np.float32(0.0)).tolist())
    data, num = pack_points(echoes, beams, spec.min_range, spec.max_range)
    file = b""
    if sight.is_for_file:
        file = np.frombuffer(data, dtype=np.uint8).reshape(num, -1)[:, :16].tobytes()
    return Cloud(data, num, file)


def _beams_of(spec: Lidar3dSpec | Lidar2dSpec) -> Beams:
    period = 1.0 / spec.rate
    if isinstance(spec, Lidar2dSpec):
        return _beams_2d(spec.num_values, spec.ahead, period)
    angles = spec.elevations if spec.model == "own" else LIDAR_MODELS[spec.model].elevations_deg
    return _beams_3d(angles, spec.num_columns, period)


@lru_cache(maxsize=4)  # 34 MB each at most
def _beams_3d(elevations_deg: tuple[float, ...], num_columns: int, period: float) -> Beams:
    return beams_3d(np.radians(elevations_deg), num_columns, period)


@lru_cache(maxsize=4)  # 34 MB each at most
def _beams_2d(num_values: int, ahead: int, period: float) -> Beams:
    return beams_2d(num_values, ahead, period)


_CHANNELS: Final = {
    "rgb": Channel.RGB,
    "depth": Channel.DEPTH,
    "semantic": Channel.LABEL,
    "instance": Channel.INSTANCE,
}


@lru_cache(maxsize=8)  # 100 MB each at most, with distortion
def model_of(spec: CameraSpec) -> CameraModel:
    """Return the geometry of a camera."""
    return CameraModel(spec.width, spec.height, spec.fov, spec.distortion)


def _shoot(spec: CameraSpec, sight: Sight, static: Mesh, job: DrawingJob, makers: Makers) -> Shot:
    camera, pose = model_of(spec), mount(sight.motion.vehicle, sight.motion.mounting)
    channels = _CHANNELS[spec.picture]
    if sight.has_boxes:
        channels |= Channel.INSTANCE | Channel.DEPTH | Channel.LABEL
    if sight.is_for_file:
        channels |= Channel.RGB
    picture = makers.pictures().render(
        *(static, job.frame, camera, pose, job.weather),
        without=sight.carrier,
        channels=channels,
        is_smooth=spec.antialiasing,
    )
    if sight.errors is not None and picture.rgb is not None:
        chance = sight.errors.generator(spec.frame_id)
        picture = replace(picture, rgb=disturb_picture(picture.rgb, sight.errors.noise.camera, chance))
    jpeg = b""
    if spec.is_jpeg or sight.is_for_file:
        assert picture.rgb is not None, "it was asked for"
        jpeg = makers.encode_jpeg(picture.rgb, spec.quality)
    data = jpeg if spec.is_jpeg else _raw(spec, picture)
    boxes = _find_boxes(job.frame, camera, pose, picture, sight.carrier) if sight.has_boxes else None
    return Shot(data, boxes, jpeg if sight.is_for_file else b"")


def _raw(spec: CameraSpec, picture: Picture) -> bytes:
    """Return the bytes of an Image, little-endian."""
    if spec.picture == "depth":
        assert picture.depth is not None, "it was asked for"
        return picture.depth.astype("<f4", copy=False).tobytes()
    if spec.picture == "semantic":
        assert picture.label is not None, "it was asked for"
        return picture.label.tobytes()
    if spec.picture == "instance":
        assert picture.instance is not None, "it was asked for"
        return np.minimum(picture.instance, np.iinfo(np.uint16).max).astype("<u2").tobytes()
    assert picture.rgb is not None, "it was asked for"
    return picture.rgb.tobytes()


def _find_boxes(frame: SceneFrame, camera: CameraModel, pose: Pose, picture: Picture, carrier: int) -> VisibleBoxes:
    """Return the boxes of the entities that a picture shows."""
    instance, depth, label = picture.instance, picture.depth, picture.label
    assert instance is not None, "all three were asked for"
    assert depth is not None
    assert label is not None
    boxes = boxes_in_view(frame, camera, pose, without=carrier, max_range=BOX_RANGE)
    found = VisibleBoxes([], [], [], [], [], [], [])
    for i, row in enumerate(boxes.rows.tolist()):
        left, top, right, bottom = boxes.bounds[i].tolist()
        window = (slice(int(top), int(np.ceil(bottom))), slice(int(left), int(np.ceil(right))))
        is_own = instance[window] == frame.ids.item(row) + 1
        num_own = int(np.count_nonzero(is_own))
        if not num_own:
            continue
        corners = boxes.corners[i]
        num_hidden = int(np.count_nonzero(~is_own & (depth[window] < corners[:, 0].min())))
        # Corners count z first, then y, then x: 0 is low right behind, 1 above it, 4 before it.
        length, height = corners[4] - corners[0], corners[1] - corners[0]
        found.ids.append(frame.ids.item(row))
        found.labels.append(int(np.bincount(label[window][is_own]).argmax()))
        found.bounds.append([left, top, right, bottom])
        found.visibility.append(num_own / (num_own + num_hidden))
        found.centres.append(corners.mean(axis=0).tolist())
        found.sizes.append(frame.sizes[row].tolist())
        found.axes.append([_unit(length), _unit(height)])
    return found


def _unit(vector: NDArray[np.float64]) -> list[float]:
    return list((vector / max(float(np.sqrt(np.square(vector).sum())), 1e-9)).tolist())
