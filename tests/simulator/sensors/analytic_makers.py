"""Pictures and echoes by formulas: a level ground at z = 0 and the boxes of the entities, without any library."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, rotation
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.pictures import NOBODY, USUAL, Channel, Hits, Picture, PictureChoices
from rosbridge_sim.scenery.scene_frame import SceneFrame
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, Makers, Sighting, draw

__all__ = ["AtOnceWorker", "FormulaDrawer", "ManualWorker", "make_makers"]

FAR = 1e6


def _no_mesh(_road_map: RoadMap, _name: str, _seed: int, _is_dressed: bool) -> Mesh:  # noqa: FBT001 - see `Makers`
    none = np.zeros(0)
    return Mesh(
        np.zeros(3),
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.int32),
        np.zeros((0, 3), np.uint8),
        none.astype(np.uint8),
        none.astype(np.int32),
        none.astype(bool),
    )


def _cast(
    frame: SceneFrame, origins: NDArray[np.float64], directions: NDArray[np.float64], max_range: float, without: int
) -> Hits:
    with np.errstate(divide="ignore", invalid="ignore"):
        down = -origins[:, 2] / directions[:, 2]
    ranges = np.where((directions[:, 2] < 0.0) & (down > 0.0), down, np.inf)
    labels = np.where(np.isfinite(ranges), int(Label.ASPHALT), 0)
    instances = np.zeros(len(directions), dtype=np.int64)
    normals = np.zeros((len(directions), 3))
    normals[np.isfinite(ranges), 2] = 1.0
    for i in range(len(frame)):
        if frame.ids[i] == without:
            continue
        axes = rotation(*frame.poses[i, 3:])
        away = (origins - frame.poses[i, :3]) @ axes
        look = directions @ axes
        length, width, height = frame.sizes[i]
        centre = frame.centres[i]
        low = np.array([centre - 0.5 * length, -0.5 * width, 0.0])
        high = np.array([centre + 0.5 * length, 0.5 * width, height])
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - away) / look, (high - away) / look
        enter, leave = np.fmin(a, b), np.fmax(a, b)
        axis = enter.argmax(axis=1)
        start = enter.max(axis=1)
        is_hit = (start <= leave.min(axis=1)) & (start > 0.0) & (start < ranges)
        ranges = np.where(is_hit, start, ranges)
        labels = np.where(is_hit, int(Label.VEHICLE), labels)
        instances = np.where(is_hit, frame.ids[i] + 1, instances)
        normals[is_hit] = -np.sign(look[is_hit, axis[is_hit]])[:, None] * axes.T[axis[is_hit]]
    is_lost = ranges > max_range
    ranges[is_lost], labels[is_lost], instances[is_lost], normals[is_lost] = np.inf, 0, 0, 0.0
    return Hits(
        ranges.astype(np.float32), labels.astype(np.uint8), instances.astype(np.int32), normals.astype(np.float32)
    )


class _Pictures:
    def render(
        self,
        static: Mesh,  # noqa: ARG002 - the ground is a formula
        frame: SceneFrame,
        camera: CameraModel,
        pose: Pose,
        choices: PictureChoices = USUAL,
    ) -> Picture:
        rays = camera.rays.astype(np.float64)
        directions = rays @ rotation(*pose[3:]).T
        origins = np.broadcast_to(np.array(pose[:3]), directions.shape)
        hits = _cast(frame, origins, directions, FAR, choices.without)
        channels = choices.channels
        shape = (camera.height, camera.width)
        label = hits.labels.reshape(shape)
        rgb = np.repeat(label[:, :, None] * np.uint8(10), 3, axis=2)
        return Picture(
            rgb if Channel.RGB in channels else None,
            hits.ranges.reshape(shape) if Channel.DEPTH in channels else None,  # x of the rays is 1
            label if Channel.LABEL in channels else None,
            hits.instances.reshape(shape) if Channel.INSTANCE in channels else None,
        )

    def close(self) -> None:
        pass


class _Rays:
    def cast(
        self,
        static: Mesh,
        frame: SceneFrame,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        max_range: float,
        *,
        without: int = NOBODY,
    ) -> Hits:
        away = np.broadcast_to(origins.astype(np.float64) + static.origin, directions.shape)
        return _cast(frame, away, directions.astype(np.float64), max_range, without)


def _encode(picture: NDArray[np.uint8], quality: int) -> bytes:
    """Bytes that stand for a JPEG: they differ where the picture does."""
    return bytes([quality]) + picture[:, :, 0].tobytes()


def make_makers() -> Makers:
    """What draws by formulas."""
    return Makers(_Pictures, _Rays, _encode, _no_mesh)


class FormulaDrawer:
    """A `Drawer` of this process."""

    def __init__(self, make: Callable[[], Makers] = make_makers) -> None:
        self._make = cache(make)

    def why_not(self, _specs: Sequence[DrawnSpec]) -> str:
        return ""

    def open(self, _specs: Sequence[DrawnSpec]) -> None:
        self._make()

    def draw(self, job: DrawingJob) -> Sequence[Sighting]:
        return draw(job, self._make())

    def kill(self) -> None:
        pass


class AtOnceWorker:
    """Does each job within the call."""

    is_busy = False

    def why_not(self, _specs: Sequence[DrawnSpec]) -> str:
        return ""

    def submit(self, job: DrawingJob, then: Callable[[Sequence[Sighting] | Exception, float], None]) -> None:
        then(draw(job, make_makers()), 0.0)


class ManualWorker:
    """Does jobs when a test says so.

    Attributes:
        jobs: those that wait, oldest first, with what takes the results.
    """

    def __init__(self) -> None:
        self.jobs: list[tuple[DrawingJob, Callable[[Sequence[Sighting] | Exception, float], None]]] = []

    @property
    def is_busy(self) -> bool:
        return bool(self.jobs)

    def why_not(self, _specs: Sequence[DrawnSpec]) -> str:
        return ""

    def submit(self, job: DrawingJob, then: Callable[[Sequence[Sighting] | Exception, float], None]) -> None:
        self.jobs.append((job, then))

    def finish(self, now: float = 0.0) -> None:
        """Do the oldest job."""
        job, then = self.jobs.pop(0)
        then(draw(job, make_makers()), now)

    def fail(self, now: float = 0.0) -> None:
        """End the oldest job without a result."""
        _, then = self.jobs.pop(0)
        then(RuntimeError("no GL"), now)
