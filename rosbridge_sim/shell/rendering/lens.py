"""Pictures through a lens that bends lines: plane pictures, looked up pixel by pixel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.camera_geometry import MAX_FOV, MAX_PIXELS, MAX_SIDE, MIN_FOV, CameraModel
from rosbridge_sim.scenery.pictures import Picture
from rosbridge_sim.world.geometry.planar import FloatArray

MAX_GROWTH: Final = 2.0
"""The plane picture has so many times the side of the bent one at most; what lies beyond is black."""

SHARPNESS: Final = 1.3
"""Focal length of the sides of a cube, as a share of that of the fisheye: at 90 deg from its axis, where a side is
coarsest, a fisheye stretches circles around the axis by pi / 2."""

NARROW: Final = 0.45
"""Cosine of the largest angle from the axis that one plane picture shows, 63 deg: towards 90 it grows without end."""

MARGIN: Final = 1.0
"""Pixels of a plane picture beyond what is seen, so that colours can be mixed there."""

COARSER: Final = 0.98
"""Step by which the focal length of a plane picture becomes smaller until the picture is small enough."""

SIDES: Final = (
    ((0, 1, 2), (1, 1, 1)),
    ((1, 0, 2), (1, -1, 1)),
    ((1, 0, 2), (-1, 1, 1)),
    ((2, 1, 0), (1, 1, -1)),
    ((2, 1, 0), (-1, 1, 1)),
    ((0, 1, 2), (-1, -1, 1)),
)
"""Sides of a cube around the camera: ahead, left, right, up, down, back. Each has the axes of the camera that are its
own ones (forward, left, up), and their signs."""


_SIDE_OF: Final = np.array([(0, 5), (1, 2), (3, 4)])
"""For each axis the side that is ahead on it, and the one that is behind."""


class PlaneView:
    """A plane picture, and the pixels of the bent one that show it.

    Args:
        side: axes and signs, as in `SIDES`.
        place: (k, 2) where they look, column and row of the plane picture; 0 is the middle of the first pixel.
        stretch: (k,) depth of these pixels, as a share of that of the plane picture.

    Attributes:
        camera: as given.
    """

    def __init__(
        self,
        camera: CameraModel,
        side: tuple[Sequence[int], Sequence[int]],
        pixels: NDArray[np.intp] | slice,
        place: FloatArray,
        stretch: NDArray[np.float32],
    ) -> None:
        self.camera = camera
        self._order, self._signs = list(side[0]), np.array(side[1], dtype=np.float64)
        self._pixels, self._stretch = pixels, stretch
        width, height = camera.width, camera.height
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

    def axes(self, camera: FloatArray) -> FloatArray:
        """Return the axes of the plane picture, from those of the bent one: (3, 3), a column for each."""
        return np.asarray(camera[:, self._order] * self._signs)

    def mix(self, rgb: NDArray[np.uint8], into: NDArray[np.uint8]) -> None:
        """Write the colours of the pixels: those between pixels of the plane picture are mixed."""
        width = rgb.shape[1]
        flat = rgb.reshape(-1, 3)
        total = np.zeros((len(self._corner), 3), dtype=np.uint32)
        for weight, shift in zip(self._weights, (0, 1, width, width + 1), strict=True):
            total += flat[self._corner + shift] * weight[:, None]
        mixed = np.minimum((total + 128) >> 8, 255).astype(np.uint8)
        mixed[self._is_outside] = 0
        into[self._pixels] = mixed

    def pick(self, values: NDArray[Any], into: NDArray[Any], outside: float) -> None:
        """Write other values of the pixels: those of the nearest pixel of the plane picture."""
        picked = values.reshape(-1)[self._nearest]
        picked[self._is_outside] = outside
        into[self._pixels] = picked * self._stretch if values.dtype == np.float32 else picked


class Lens:
    """Composition of a picture through a lens that bends lines, from plane pictures.

    Args:
        camera: its lens bends lines.

    Attributes:
        views: the plane pictures: one with the same focal length, large enough, or those sides of a cube that are seen.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._shape = camera.height, camera.width
        rays = camera.rays.astype(np.float64)
        is_narrow = camera.is_plane or bool((rays[:, 0] > NARROW).all())
        self.views = [_one_view(camera, rays)] if is_narrow else _sides(camera, rays)

    def bend(self, pictures: Sequence[Picture]) -> Picture:
        """Return the pictures of the views as the lens shows them."""
        first = pictures[0]
        rgb = None if first.rgb is None else np.zeros((math.prod(self._shape), 3), dtype=np.uint8)
        parts: dict[str, NDArray[Any]] = {}
        for view, picture in zip(self.views, pictures, strict=True):
            if rgb is not None and picture.rgb is not None:
                view.mix(picture.rgb, rgb)
            for name, outside in (("depth", np.inf), ("label", 0), ("instance", 0)):
                values = getattr(picture, name)
                if values is not None:
                    whole = parts.setdefault(name, np.full(math.prod(self._shape), outside, dtype=values.dtype))
                    view.pick(values, whole, outside)
        found = {name: values.reshape(self._shape) for name, values in parts.items()}
        return Picture(
            None if rgb is None else rgb.reshape(*self._shape, 3),
            *(found.get(name) for name in ("depth", "label", "instance")),
        )


def _one_view(camera: CameraModel, rays: FloatArray) -> PlaneView:
    flat = -rays[:, 1:] / rays[:, :1]  # right and down, at depth 1
    limit = 0.5 * MAX_GROWTH * np.array([camera.width, camera.height]) - MARGIN
    reach = np.minimum(np.abs(np.where(np.isfinite(flat), flat, 0.0)).max(axis=0), limit / camera.focal)
    plain = _plane(reach, camera.focal)
    place = flat * plain.focal + np.array(plain.center) - 0.5  # of pixels' middles
    return PlaneView(plain, SIDES[0], slice(None), place, (1.0 / rays[:, 0]).astype(np.float32))


def _sides(camera: CameraModel, rays: FloatArray) -> Sequence[PlaneView]:
    axis = np.abs(rays).argmax(axis=1)
    is_back = np.take_along_axis(rays, axis[:, None], axis=1)[:, 0] < 0.0
    nearest = np.where(np.isfinite(rays[:, 0]), _SIDE_OF[axis, is_back.astype(np.intp)], -1)

    def local(pixels: NDArray[np.intp], order: Sequence[int], signs: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        turned = rays[pixels][:, order] * np.array(signs)
        return -turned[:, 1:] / turned[:, :1], turned[:, 0]

    seen = [(np.flatnonzero(nearest == number), *side) for number, side in enumerate(SIDES)]
    seen = [one for one in seen if len(one[0])]
    # The sides have one size, so that one target serves all; a low and wide picture needs no square ones.
    plain = _plane(np.max([np.abs(local(*one)[0]).max(axis=0) for one in seen], axis=0), SHARPNESS * camera.focal)
    views = []
    for pixels, order, signs in seen:
        flat, ahead = local(pixels, order, signs)
        place = flat * plain.focal + np.array(plain.center) - 0.5
        views.append(PlaneView(plain, (order, signs), pixels, place, (1.0 / ahead).astype(np.float32)))
    return views


def _plane(reach: FloatArray, focal: float) -> CameraModel:
    """Return the camera of a plane picture that is large enough; it is coarser if it would be too large.

    Args:
        reach: (2,) what it shows to the right and down, at depth 1.
        focal: its focal length, if possible [pixels].
    """
    width, height = _size(reach, focal)
    while width * height > MAX_PIXELS or max(width, height) > MAX_SIDE:
        focal *= COARSER
        width, height = _size(reach, focal)
    fov_deg = 2.0 * math.degrees(math.atan(width / (2.0 * focal)))
    return CameraModel(width, height, min(max(fov_deg, MIN_FOV), MAX_FOV))


def _size(reach: FloatArray, focal: float) -> tuple[int, int]:
    width, height = (2 * math.ceil(tangent * focal + MARGIN) for tangent in reach.tolist())
    return width, height
