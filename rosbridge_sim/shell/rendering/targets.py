"""Memory of the graphics library that pictures of one size are drawn into and read from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.pictures import Channel

if TYPE_CHECKING:
    import moderngl


_KINDS: Final = {Channel.LABEL: "u1", Channel.INSTANCE: "i4", Channel.DEPTH: "f4"}
"""Numbers of the parts of a picture that mix no two things, as numpy and the library name them."""


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
        self._textures = {channel: context.texture(size, 1, dtype=kind) for channel, kind in _KINDS.items()}
        self._classes = context.framebuffer([*self._textures.values()], context.depth_renderbuffer(size))
        # `clear` writes the same colour into all targets, so the depths have a view of their own to be cleared by.
        self._depths = context.framebuffer([self._textures[Channel.DEPTH]])

    def begin_colours(self, colour: tuple[float, float, float]) -> None:
        """Fill the colours with one, and draw into them from now on."""
        self.colours.use()
        self.colours.clear(*colour)

    def begin_classes(self) -> None:
        """Clear class, instance and depth, and draw into them from now on."""
        self._classes.use()
        self._classes.clear()
        self._depths.clear(np.inf)
        self._classes.use()

    def read_rgb(self) -> NDArray[np.uint8]:
        """Return the colours, (h, w, 3): the mean of the samples of each pixel, if it has several."""
        source = self._smooth or self.colours
        if self._smooth is not None:
            self._context.copy_framebuffer(self._smooth, self.colours)
        width, height = self._size
        data = source.read(components=3, alignment=1)
        return np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3)

    def read(self, channel: Channel) -> NDArray[Any]:
        """Return the classes, the instances or the depths [m], (h, w)."""
        width, height = self._size
        return np.frombuffer(self._textures[channel].read(alignment=1), dtype=_KINDS[channel]).reshape(height, width)

    def release(self) -> None:
        """Free the memory."""
        smooth = () if self._smooth is None else (self._smooth,)
        for each in (self.colours, *smooth, self._classes, self._depths, *self._textures.values()):
            each.release()
