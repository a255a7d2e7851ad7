"""A turn of a lidar: rays that are swept while the car moves, and points with intensity, noise and drop-out.

The rays of a turn start where the lidar is at their time: its pose is interpolated between the beginning and the end of
the turn. Each point is told in the axes that the lidar had at its time, as the drivers of real lidars do. What else
moves is seen where it is at the end of the turn.

Intensity follows from the material and the angle: I = 255 r (0.35 + 0.65 cos a), where r is the reflectivity of the
class and a the angle between the ray and the normal. Lidars of Velodyne report it on a scale of 0..255, where diffuse
reflectors have 0..100 and retroreflectors more. Road paint has glass beads in it, which send light back at any angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.camera_geometry import Pose, rotation
from rosbridge_sim.scenery.lidar_models import LidarModel
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.pictures import NOBODY, Hits, RayMaker
from rosbridge_sim.scenery.scene_frame import SceneFrame
from rosbridge_sim.world.geometry.planar import FloatArray

__all__ = ["LidarNoise", "PointCloud", "aim", "collect", "sweep"]

_REFLECTIVITY: Final = {
    Label.ASPHALT: 0.10,
    Label.PAINT_WHITE: 0.62,
    Label.PAINT_YELLOW: 0.48,
    Label.PAINT_BLUE: 0.36,
    Label.CROSSWALK: 0.62,
    Label.STOP_LINE: 0.62,
    Label.KERB: 0.22,
    Label.PAVEMENT: 0.18,
    Label.GROUND: 0.20,
    Label.BUILDING: 0.26,
    Label.TREE: 0.22,
    Label.POLE: 0.34,
    Label.TRAFFIC_LIGHT: 0.16,
    Label.SIGN: 1.0,
    Label.VEHICLE: 0.34,
    Label.MOTORCYCLE: 0.24,
    Label.BICYCLE: 0.24,
    Label.PEDESTRIAN: 0.24,
    Label.OBSTACLE: 0.30,
}
"""Share of the light of 905 nm that comes back; estimates on the side of public figures: asphalt 0.05..0.15, paint with
beads 0.4..0.8, vegetation 0.2..0.5, concrete 0.2..0.4."""

_IS_BEADED: Final = np.isin(
    np.arange(256),
    [Label.PAINT_WHITE, Label.PAINT_YELLOW, Label.PAINT_BLUE, Label.CROSSWALK, Label.STOP_LINE, Label.SIGN],
)

LEAST_RANGE: Final = 0.4
"""What is nearer gives no point [m]."""


@dataclass(frozen=True, slots=True)
class LidarNoise:
    """Errors of a lidar; the defaults are none.

    Attributes:
        range_sigma: standard deviation of the range [m]; 0.01 to 0.03 for real lidars.
        intensity_sigma: standard deviation of the intensity, on the scale of 0..255.
        dropout: share of points that are lost at any range.
        far_dropout: share that is lost at the greatest range beside these, from a surface of the lowest reflectivity
            and at a flat angle; less nearer by, where more light comes back.
    """

    range_sigma: float = 0.0
    intensity_sigma: float = 0.0
    dropout: float = 0.0
    far_dropout: float = 0.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: a share is not within 0..1, or a deviation is negative or not finite.
        """
        for name in ("range_sigma", "intensity_sigma"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"lidar noise: {name}: expected at least 0, got {getattr(self, name)!r}")
        for name in ("dropout", "far_dropout"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"lidar noise: {name}: expected 0..1, got {getattr(self, name)!r}")


NO_NOISE: Final = LidarNoise()


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points of a turn in the order of firing, (k,) each.

    Attributes:
        x, y, z: float32, in the axes of the lidar at the time of the point [m].
        intensity: float32, 0..255.
        ring: uint16, number of the laser, 0 for the lowest.
        time: float32, after the beginning of the turn [s].
        label: uint8, see `mesh.Label`; for checks and for teaching networks, no field of a message.
        instance: int32, id of the entity plus 1; 0 for what is none.
    """

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    z: NDArray[np.float32]
    intensity: NDArray[np.float32]
    ring: NDArray[np.uint16]
    time: NDArray[np.float32]
    label: NDArray[np.uint8]
    instance: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.x)


def sweep(
    caster: RayMaker,
    static: Mesh,
    frame: SceneFrame,
    model: LidarModel,
    *,
    start: Pose,
    end: Pose,
    period: float,
    without: int = NOBODY,
    noise: LidarNoise = NO_NOISE,
    rng: np.random.Generator | None = None,
) -> PointCloud:
    """Return the points of one turn.

    Args:
        caster: casts the rays.
        static: what does not move.
        frame: what moves, at the end of the turn.
        model: of the lidar.
        start: pose of the lidar at the beginning of the turn, in the map frame.
        end: and at its end.
        period: of a turn [s].
        without: id of the entity that carries the lidar.
        noise: errors.
        rng: chance for these; needed if there are any.
    """
    origins, directions = aim(model, start, end, static.origin)
    hits = caster.cast(static, frame, origins, directions, model.max_range, without=without)
    return collect(model, hits, directions, period, noise=noise, rng=rng)


def aim(
    model: LidarModel, start: Pose, end: Pose, origin: FloatArray
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return origins and directions of the rays of a turn, (rays, 3) each, or (1, 3) origins for a lidar that stands.

    Args:
        model: of the lidar.
        start: its pose at the beginning of the turn.
        end: and at its end.
        origin: (3,) of the mesh, from which the origins of rays count [m].
    """
    if start == end:
        place = (np.array([start[:3]]) - origin).astype(np.float32)
        return place, (model.directions @ rotation(*start[3:]).T).astype(np.float32)
    share = (np.arange(model.columns) + 0.5) / model.columns
    change = np.array(end) - np.array(start)
    change[3:] = np.arctan2(np.sin(change[3:]), np.cos(change[3:]))  # the shorter way round
    poses = np.array(start) + share[:, None] * change
    lasers = len(model.elevations_deg)
    turns = rotation(*poses[:, 3:].T)
    local = model.directions.reshape(model.columns, lasers, 3)
    directions = (local @ turns.transpose(2, 1, 0)).reshape(-1, 3)
    places = np.repeat(poses[:, :3] - origin, lasers, axis=0)
    return places.astype(np.float32), directions.astype(np.float32)


def collect(
    model: LidarModel,
    hits: Hits,
    directions: NDArray[np.float32],
    period: float,
    *,
    noise: LidarNoise = NO_NOISE,
    rng: np.random.Generator | None = None,
) -> PointCloud:
    """Return the points of the rays that have met something.

    Args:
        model: of the lidar.
        hits: of its rays.
        directions: (rays, 3) of the rays in the map frame.
        period: of a turn [s].
        noise: errors.
        rng: chance for these; needed if there are any.

    Raises:
        ValueError: there is noise and no chance.
    """
    kept = np.flatnonzero((hits.ranges >= LEAST_RANGE) & (hits.ranges <= model.max_range))
    ranges, labels = hits.ranges[kept], hits.labels[kept]
    facing = np.abs(np.einsum("ij,ij->i", directions[kept], hits.normals[kept]))
    strength = _TABLE[labels] * np.where(_IS_BEADED[labels], 0.8 + 0.2 * facing, 0.35 + 0.65 * facing)
    intensity = 255.0 * strength
    if noise != NO_NOISE:
        if rng is None:
            raise ValueError("rng: expected a generator, because the lidar has noise")
        # A number for each ray and not for each point: one more hit then changes no other point.
        chance = rng.random(model.num_rays)[kept]
        bell = rng.standard_normal((2, model.num_rays))[:, kept]
        weak = (ranges / model.max_range) ** 2 * (1.0 - np.minimum(strength / 0.5, 1.0))
        is_lost = chance < noise.dropout + noise.far_dropout * weak
        ranges = ranges + (noise.range_sigma * bell[0]).astype(np.float32)
        intensity = np.clip(intensity + noise.intensity_sigma * bell[1], 0.0, 255.0)
        kept, ranges, intensity, labels = (v[~is_lost] for v in (kept, ranges, intensity, labels))
    x, y, z = (model.directions[kept] * ranges[:, None]).astype(np.float32).T
    return PointCloud(
        *(x, y, z),
        intensity.astype(np.float32),
        model.rings[kept],
        model.times(period)[kept],
        labels,
        hits.instances[kept],
    )


_TABLE: Final = np.array([_REFLECTIVITY.get(Label(i), 0.2) if i <= max(Label) else 0.2 for i in range(256)])
"""Reflectivity by class."""
