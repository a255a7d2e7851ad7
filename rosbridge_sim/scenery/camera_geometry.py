"""Geometry of cameras: intrinsics, mounting, projection of points, and boxes of entities in view.

The camera looks along its own x axis, y is left and z is up, as a vehicle's axes. In the *optical* frame z looks ahead,
x is right and y is down. In a picture the pixel of column i and row j covers i..i+1 and j..j+1 from the upper left
corner, and the principal point is the exact middle, (width / 2, height / 2), as in MORAI's presets. Pixels are square.

`CameraModel` is a pinhole with the plumb-bob model of lens distortion (Brown 1966). `FisheyeModel` has the equidistant
projection with the polynomial of Kannala and Brandt (2006): what is at the angle a from the optical axis is at the
distance  f a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8)  from the principal point, with the focal length f. Both are those
of OpenCV, where the second one is `cv2.fisheye`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rosbridge_sim.scenery.scene_frame import SceneFrame
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray

MIN_FOV, MAX_FOV, MAX_FISHEYE_FOV = 1.0, 170.0, 220.0
"""Bounds of the horizontal field of view [deg]: a plane picture of 180 has no width, and fisheye lenses of cars have up
to 200."""

MAX_SIDE: Final = 8_192
"""Longest side of a picture [pixels]: what OpenGL drivers have at least."""

MAX_PIXELS: Final = 8_294_400
"""Pixels of a picture: 3840 x 2160."""

NEAR: Final = 0.05
"""Distance within which a camera sees nothing [m]."""

TABLE_SIZE: Final = 20_001
"""Angles between which those of a fisheye's pixels are interpolated: a place is right to 1e-6 pixels."""

EDGE_PLACES: Final = 17
"""Places on an edge of a box, which a fisheye bends; bounds of a car beside the camera are right to 2 pixels of 640."""

UNDISTORT_ROUNDS: Final = 20
"""Fixed-point rounds of the inverse of a lens distortion: each leaves a fifth of the error for usual lenses."""


class Pose(NamedTuple):
    """Place and direction in the map frame.

    Attributes:
        x, y, z: [m].
        roll, pitch, yaw: as for vehicles: yaw counter-clockwise from east, pitch positive with the nose down [rad].
    """

    x: float
    y: float
    z: float
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


def rotation(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> FloatArray:
    """Return the matrix that turns x forward, y left, z up into the axes around: Rz(yaw) Ry(pitch) Rx(roll).

    Args:
        roll: about x, a number or (n,) [rad].
        pitch: about y, positive with the nose down [rad].
        yaw: about z [rad].

    Returns:
        (3, 3), or (3, 3, n).
    """
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def mount(vehicle: Pose, mounting: Pose) -> Pose:
    """Return the pose of a sensor in the map frame.

    Args:
        vehicle: of the middle of the rear axle, on the ground.
        mounting: of the sensor from there, x forward, y left, z up [m], roll, pitch, yaw [rad].
    """
    turn = rotation(*vehicle[3:])
    place = np.array(vehicle[:3]) + turn @ np.array(mounting[:3])
    both = turn @ rotation(*mounting[3:])
    pitch = math.asin(min(max(-both[2, 0], -1.0), 1.0))
    roll, yaw = math.atan2(both[2, 1], both[2, 2]), math.atan2(both[1, 0], both[0, 0])
    x, y, z = place.tolist()
    return Pose(x, y, z, roll, pitch, yaw)


@dataclass(frozen=True)
class CameraModel:
    """Size, field of view and lens of a camera.

    Attributes:
        width, height: [pixels].
        fov_deg: horizontal field of view, without distortion [deg].
        distortion: k1, k2, p1, p2, k3 of the plumb-bob model, as OpenCV and `sensor_msgs/CameraInfo` have them.

        max_fov_deg, num_coefficients: bounds of these.
        is_plane: its whole field of view fits a plane picture.

    Raises:
        ValueError: a size or an angle is out of bounds.
    """

    width: int = 640
    height: int = 480
    fov_deg: float = 90.0
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)

    max_fov_deg: ClassVar[float] = MAX_FOV
    num_coefficients: ClassVar[int] = 5
    is_plane: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the values."""
        if not (1 <= self.width <= MAX_SIDE and 1 <= self.height <= MAX_SIDE):
            raise ValueError(f"camera: expected 1..{MAX_SIDE} pixels a side, got {self.width} x {self.height}")
        if self.width * self.height > MAX_PIXELS:
            raise ValueError(f"camera: expected at most {MAX_PIXELS:,} pixels, got {self.width} x {self.height}")
        most, num = self.max_fov_deg, self.num_coefficients
        if not MIN_FOV <= self.fov_deg <= most:
            raise ValueError(f"camera: expected a field of view of {MIN_FOV}..{most} deg, got {self.fov_deg!r}")
        if len(self.distortion) != num or not all(abs(value) <= 1.0 for value in self.distortion):
            raise ValueError(f"camera: expected {num} distortion coefficients of at most 1, got {self.distortion!r}")

    @property
    def focal(self) -> float:
        """Focal length [pixels], the same in both directions."""
        return self.width / (2.0 * math.tan(math.radians(self.fov_deg) / 2.0))

    @property
    def center(self) -> tuple[float, float]:
        """Column and row of the principal point [pixels]."""
        return self.width / 2.0, self.height / 2.0

    @property
    def is_distorted(self) -> bool:
        """True if the lens bends straight lines."""
        return any(self.distortion) or not self.is_plane

    @property
    def matrix(self) -> FloatArray:
        """(3, 3) matrix K of the intrinsics, without distortion."""
        column, row = self.center
        return np.array([[self.focal, 0.0, column], [0.0, self.focal, row], [0.0, 0.0, 1.0]])

    def distort(self, flat: FloatArray) -> FloatArray:
        """Return places (n, 2) on the plane at depth 1 as the lens moves them."""
        if not self.is_distorted:
            return flat
        k1, k2, p1, p2, k3 = self.distortion
        x, y = flat[:, 0], flat[:, 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.column_stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ]
        )

    def undistort(self, bent: FloatArray) -> FloatArray:
        """Return the inverse of `distort` for (n, 2) places, by fixed-point rounds."""
        flat = bent.copy()
        for _ in range(UNDISTORT_ROUNDS if self.is_distorted else 0):
            flat = flat + bent - self.distort(flat)
        return flat

    @cached_property
    def rays(self) -> NDArray[np.float32]:
        """(h * w, 3) directions of the middles of all pixels, row by row; x forward, y left, z up.

        x = 1 if a plane can show all. Otherwise they are unit vectors, and nan where the lens shows nothing.
        """
        column, row = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        bent = (np.column_stack([column.ravel(), row.ravel()]) - np.array(self.center)) / self.focal
        with np.errstate(over="ignore", invalid="ignore"):  # the rounds diverge where a lens folds its picture
            return self._rays_of(bent).astype(np.float32)

    def _rays_of(self, bent: FloatArray) -> FloatArray:
        """Return the rays of places (n, 2) from the principal point, in focal lengths."""
        flat = self.undistort(bent)
        return np.column_stack([np.ones(len(flat)), -flat])

    def outline(self, corners: FloatArray) -> FloatArray:
        """Return places in the picture that bound boxes, (k, m, 2) [pixels]; nan where nothing is seen.

        Args:
            corners: (k, 8, 3) in the camera's axes, in the order of `box_corners` [m].
        """
        # Edges that pass the camera's plane end there.
        start, end = corners[:, _EDGES[:, 0]], corners[:, _EDGES[:, 1]]
        low, high = np.minimum(start[..., 0], end[..., 0]), np.maximum(start[..., 0], end[..., 0])
        does_cross = (low < NEAR) & (high > NEAR)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (NEAR - start[..., 0]) / (end[..., 0] - start[..., 0])
            cut = start + np.where(does_cross, share, np.nan)[..., None] * (end - start)
            every = np.concatenate([corners, cut], axis=1)
            is_ahead = every[..., 0] >= NEAR * (1.0 - 1e-9)
            flat = -every[..., 1:] / every[..., :1]
        flat = self.distort(np.where(is_ahead[..., None], flat, np.nan).reshape(-1, 2)).reshape(flat.shape)
        return np.asarray(flat * self.focal + np.array(self.center))

    def depths(self, points: FloatArray) -> FloatArray:
        """Return the depths of points (..., 3) in the camera's axes: distances along the optical axis [m]."""
        return np.asarray(points[..., 0])


@dataclass(frozen=True)
class FisheyeModel(CameraModel):
    """Size, field of view and lens of a fisheye camera.

    It sees up to 90 deg from the optical axis, or half of its field of view if that is more; what lies beyond is black.

    Attributes:
        distortion: k1, k2, k3, k4; see the head of this file.
    """

    max_fov_deg: ClassVar[float] = MAX_FISHEYE_FOV
    num_coefficients: ClassVar[int] = 4
    is_plane: ClassVar[bool] = False
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    @property
    def focal(self) -> float:
        """Focal length [pixels]: pixels for each radian in the middle."""
        return self.width / math.radians(self.fov_deg)

    @property
    def reach_deg(self) -> float:
        """Largest angle from the optical axis that is seen [deg]."""
        return max(90.0, 0.5 * self.fov_deg)

    @property
    def is_one_to_one(self) -> bool:
        """True if each place in the picture shows one angle: the distance from the middle grows with it."""
        return bool((np.diff(self._bend(self._table)) > 0.0).all())

    @property
    def _table(self) -> FloatArray:
        return np.linspace(0.0, math.radians(self.reach_deg), TABLE_SIZE)

    def _bend(self, angle: FloatArray) -> FloatArray:
        """Return distances from the principal point, in focal lengths."""
        k1, k2, k3, k4 = self.distortion
        square = angle * angle
        return angle * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))))

    def _rays_of(self, bent: FloatArray) -> FloatArray:
        away = np.hypot(bent[:, 0], bent[:, 1])
        table = self._table
        angle = np.interp(away, self._bend(table), table, right=np.nan)
        side = np.sin(angle) / np.maximum(away, 1e-12)
        return np.column_stack([np.cos(angle), -bent * side[:, None]])

    def outline(self, corners: FloatArray) -> FloatArray:
        """Return places on the edges of boxes; see `CameraModel.outline`."""
        start, end = corners[:, _EDGES[:, 0], None], corners[:, _EDGES[:, 1], None]
        share = np.linspace(0.0, 1.0, EDGE_PLACES)[:, None]
        shape = (len(corners), len(_EDGES) * EDGE_PLACES, 3)
        x, y, z = np.moveaxis((start + share * (end - start)).reshape(shape), -1, 0)
        aside = np.hypot(y, z)
        angle = np.arctan2(aside, x)
        away = np.where(angle <= self._table[-1], self._bend(angle), np.nan) / np.maximum(aside, 1e-12)
        return np.asarray(np.stack([-y * away, -z * away], axis=-1) * self.focal + np.array(self.center))

    def depths(self, points: FloatArray) -> FloatArray:
        """Return the depths of points (..., 3) in the camera's axes: distances from the camera [m]."""
        return np.asarray(np.linalg.norm(points, axis=-1))


class Box2D(NamedTuple):
    """Boxes of entities in view, (k,) each unless told otherwise.

    Attributes:
        rows: int64, rows of the entities in the `SceneFrame`.
        bounds: (k, 4) left, top, right, bottom [pixels], within the picture.
        corners: (k, 8, 3) corners of the box in the camera's axes, x forward [m], in the order of `box_corners`.
    """

    rows: NDArray[np.int64]
    bounds: FloatArray
    corners: FloatArray


_CORNERS: Final = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
"""Corners of a box as shares of length, width and height: z changes first, then y, then x."""

_EDGES: Final = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b) in {1, 2, 4}])
"""Pairs of corners that an edge joins."""


def box_corners(frame: SceneFrame) -> FloatArray:
    """Return the corners of the boxes of all entities in the map frame, (n, 8, 3) [m]."""
    local = _CORNERS[None] * frame.sizes[:, None, :]
    local[:, :, 0] += frame.centres[:, None]
    turn = rotation(*frame.poses[:, 3:].T)
    return np.asarray(np.einsum("ijn,nkj->nki", turn, local) + frame.poses[:, None, :3])


def boxes_in_view(
    frame: SceneFrame, camera: CameraModel, pose: Pose, *, without: int = -1, max_range: float = 150.0
) -> Box2D:
    """Return the boxes of all entities that reach into a picture; what stands before them does not count.

    Args:
        camera: its intrinsics. The bounds are those of the box's corners, moved by the lens.
        without: id of the entity that is left out.
        max_range: what is farther is left out [m].
    """
    corners = (box_corners(frame) - np.array(pose[:3])) @ rotation(*pose[3:])
    middle = corners.mean(axis=1)
    is_near: BoolArray = (np.linalg.norm(middle, axis=1) <= max_range) & (frame.ids != without)
    rows = np.flatnonzero(is_near)
    place = camera.outline(corners[rows])
    is_any = np.isfinite(place).any(axis=(1, 2))
    rows, place = rows[is_any], place[is_any]
    limit = np.array([camera.width, camera.height], dtype=np.float64)
    low, high = (np.clip(bound(place, axis=1), 0.0, limit) for bound in (np.nanmin, np.nanmax))
    is_seen = (high > low).all(axis=1)
    bounds = np.concatenate([low, high], axis=1)
    return Box2D(rows[is_seen], bounds[is_seen], corners[rows][is_seen])
