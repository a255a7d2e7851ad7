"""Pictures through a lens that bends lines: a plane picture, looked up pixel by pixel."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.camera_geometry import MAX_FOV, CameraModel
from rosbridge_sim.scenery.pictures import Picture

__all__ = ["Lens"]

MAX_GROWTH: Final = 2.0
"""The plane picture has so many times the side of the bent one at most; what lies beyond is black."""


class Lens:
    """The way from a plane picture to one of a camera with distortion.

    Args:
        camera: with distortion.

    Attributes:
        plain: the camera of the plane picture: the same focal length, and large enough.
    """

    def __init__(self, camera: CameraModel) -> None:
        flat = -camera.rays[:, 1:].astype(np.float64)  # right and down, at depth 1
        finite = np.where(np.isfinite(flat), flat, 0.0)
        reach = np.minimum(np.abs(finite).max(axis=0), math.tan(math.radians(MAX_FOV / 2.0)))
        half = reach * camera.focal + 1.0
        limit = 0.5 * MAX_GROWTH * np.array([camera.width, camera.height])
        width, height = (2 * math.ceil(min(side, most)) for side, most in zip(half, limit, strict=True))
        fov = 2.0 * math.degrees(math.atan(width / (2.0 * camera.focal)))
        self.plain = CameraModel(width, height, fov)
        self._shape = camera.height, camera.width
        place = flat * camera.focal + np.array(self.plain.center) - 0.5  # of pixels' middles
        column, row = place.T
        half_pixel = 0.5
        is_inside = (column > -half_pixel) & (column < width - half_pixel)
        self._is_outside = ~(is_inside & (row > -half_pixel) & (row < height - half_pixel))
        column = np.clip(np.nan_to_num(column), 0.0, width - 1.001)
        row = np.clip(np.nan_to_num(row), 0.0, height - 1.001)
        self._nearest = (np.rint(row).astype(np.int64) * width + np.rint(column).astype(np.int64)).astype(np.intp)
        left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
        self._corner = (top * width + left).astype(np.intp)
        u, v = column - left, row - top
        weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])
        self._weights = np.rint(256.0 * weights).astype(np.uint16)

    def bend(self, picture: Picture) -> Picture:
        """Return a plane picture as the lens shows it: colours between pixels are mixed, the rest is not."""
        return Picture(
            None if picture.rgb is None else self._mix(picture.rgb),
            None if picture.depth is None else self._pick(picture.depth, np.float32(np.inf)),
            None if picture.label is None else self._pick(picture.label, np.uint8(0)),
            None if picture.instance is None else self._pick(picture.instance, np.int32(0)),
        )

    def _mix(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        width = rgb.shape[1]
        flat = rgb.reshape(-1, 3)
        total = np.zeros((len(self._corner), 3), dtype=np.uint32)
        for weight, shift in zip(self._weights, (0, 1, width, width + 1), strict=True):
            total += flat[self._corner + shift] * weight[:, None]
        mixed = np.minimum((total + 128) >> 8, 255).astype(np.uint8)
        mixed[self._is_outside] = 0
        picture: NDArray[np.uint8] = mixed.reshape(*self._shape, 3)
        return picture

    def _pick(self, values: NDArray[np.generic], outside: np.generic) -> NDArray[Any]:
        picked = values.reshape(-1)[self._nearest]
        picked[self._is_outside] = outside
        picture: NDArray[Any] = picked.reshape(self._shape)
        return picture
