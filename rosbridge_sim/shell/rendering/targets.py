"""Memory of the graphics library that pictures of one size are drawn into and read from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import moderngl


class Targets:
    """Memory of the graphics library for the parts of a picture.

    Args:
        size: width and height [pixels].
        samples: samples a pixel of the colours; 0 draws them plain.

    Attributes:
        colours: what the colours are drawn into.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], samples: int) -> None:
        self._context, self._size = context, size
        many = min(samples, context.max_samples)
        self.colours = context.framebuffer(
            [context.renderbuffer(size, 4, samples=many)], context.depth_renderbuffer(size, samples=many)
        )
        self._smooth = context.framebuffer([context.renderbuffer(size, 4)]) if many else None
        self._textures = [
            context.texture(size, 1, dtype="u1"),
            context.texture(size, 1, dtype="i4"),
            context.texture(size, 1, dtype="f4"),
        ]
        self._classes = context.framebuffer(self._textures, context.depth_renderbuffer(size))
        # `clear` writes the same colour into all targets, so each has a view of its own to be cleared by.
        self._single = [context.framebuffer([texture]) for texture in self._textures]

    def begin_colours(self, colour: tuple[float, float, float]) -> None:
        """Fill the colours with one, and draw into them from now on."""
        self.colours.use()
        self.colours.clear(*colour)

    def begin_classes(self) -> None:
        """Clear class, instance and depth, and draw into them from now on."""
        self._classes.use()
        self._classes.clear()
        self._single[2].clear(np.inf)
        self._classes.use()

    def read_rgb(self) -> NDArray[np.uint8]:
        """Return the colours, (h, w, 3): the mean of the samples of each pixel, if it has several."""
        source = self._smooth or self.colours
        if self._smooth is not None:
            self._context.copy_framebuffer(self._smooth, self.colours)
        width, height = self._size
        data = source.read(components=3, alignment=1)
        return np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3)

    def read_label(self) -> NDArray[np.uint8]:
        """Return the classes, (h, w)."""
        width, height = self._size
        return np.frombuffer(self._textures[0].read(alignment=1), dtype=np.uint8).reshape(height, width)

    def read_instance(self) -> NDArray[np.int32]:
        """Return the instances, (h, w)."""
        width, height = self._size
        return np.frombuffer(self._textures[1].read(), dtype=np.int32).reshape(height, width)

    def read_depth(self) -> NDArray[np.float32]:
        """Return the depths, (h, w) [m]."""
        width, height = self._size
        return np.frombuffer(self._textures[2].read(), dtype=np.float32).reshape(height, width)

    def release(self) -> None:
        """Free the memory."""
        smooth = () if self._smooth is None else (self._smooth,)
        for each in (self.colours, *smooth, self._classes, *self._single, *self._textures):
            each.release()
