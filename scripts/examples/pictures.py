"""The shared parts of the programs with a camera: decoding, colours as OpenCV counts them, and the bird's-eye view.

With OpenCV these are `imdecode`, `cvtColor`, `inRange`, `getPerspectiveTransform` and `warpPerspective`.
"""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Pixels = NDArray[np.uint8]
Range = tuple[tuple[int, int, int], tuple[int, int, int]]

# Lowest and highest hue (0 to 180), saturation and value of MORAI-EDU's lane programs.
WHITE: Range = ((0, 0, 185), (30, 60, 255))
YELLOW: Range = ((10, 100, 100), (40, 255, 255))


def decode(message: dict[str, Any]) -> Pixels:
    """Return the picture of a CompressedImage, (height, width, 3), red first."""
    data = message["data"]  # bytes, or base64 if the connection is JSON
    content = base64.b64decode(data) if isinstance(data, str) else data
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))


def hsv(rgb: Pixels) -> Pixels:
    """Return hue (0 to 180: half the angle), saturation and value (0 to 255) of a picture."""
    red, green, blue = np.moveaxis(rgb.astype(np.float32), -1, 0)
    value = np.maximum(np.maximum(red, green), blue)
    spread = value - np.minimum(np.minimum(red, green), blue)
    safe = np.maximum(spread, 1.0)
    hue = np.where(
        value == red,
        (green - blue) / safe % 6.0,
        np.where(value == green, (blue - red) / safe + 2.0, (red - green) / safe + 4.0),
    )
    saturation = 255.0 * spread / np.maximum(value, 1.0)
    return np.stack([30.0 * hue, saturation, value], axis=-1).round().astype(np.uint8)


def in_range(colours: Pixels, low_high: Range) -> NDArray[np.bool_]:
    """Return where all three values of `hsv` are between the lowest and the highest."""
    low, high = np.array(low_high)
    return np.asarray(((colours >= low) & (colours <= high)).all(axis=-1))


class BirdsEye:
    """The view from above: a trapezoid of the picture becomes a rectangle.

    Attributes:
        size: width and height of the view [pixels].
    """

    def __init__(self, trapezoid: list[tuple[float, float]], size: tuple[int, int]) -> None:
        """Find the mapping.

        Args:
            trapezoid: corners in the picture [pixels]: lower left, upper left, upper right, lower right.
            size: width and height of the view [pixels].
        """
        width, height = self.size = size
        rows, wanted = [], []
        for (u, v), (x, y) in zip(trapezoid, [(0, height), (0, 0), (width, 0), (width, height)], strict=True):
            rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
            wanted += [u, v]
        self._from_view = np.linalg.solve(np.array(rows, float), np.array(wanted))

    def of(self, rgb: Pixels) -> Pixels:
        """Return the view of a picture."""
        data = tuple(self._from_view.tolist())
        view = Image.fromarray(rgb).transform(self.size, Image.Transform.PERSPECTIVE, data, Image.Resampling.BILINEAR)
        return np.asarray(view)

    def in_picture(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where places of the view are in the picture, (n, 2) [pixels]."""
        a, b, c, d, e, f, g, h = self._from_view
        scale = g * x + h * y + 1.0
        return np.column_stack([(a * x + b * y + c) / scale, (d * x + e * y + f) / scale])
