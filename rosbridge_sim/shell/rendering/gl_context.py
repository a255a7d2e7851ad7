"""An OpenGL context without a window, by EGL."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError, missing_library

if TYPE_CHECKING:
    import moderngl

__all__ = ["finish_drawing", "open_context"]


@cache
def _gl_finish() -> Callable[[], None]:
    """Return OpenGL's glFinish as a function of ctypes; one that does nothing where EGL does not give it."""
    try:
        find = ctypes.CDLL("libEGL.so.1").eglGetProcAddress
    except (OSError, AttributeError):
        return _nothing
    find.restype, find.argtypes = ctypes.c_void_p, (ctypes.c_char_p,)
    address = find(b"glFinish")
    return ctypes.CFUNCTYPE(None)(address) if address else _nothing


def finish_drawing() -> None:
    """Wait until all that was drawn is there, without the interpreter lock.

    moderngl keeps the lock while it reads a picture, and reading waits for the drawing: with a software renderer the
    event loop stood for nearly the whole picture. ctypes gives the lock back meanwhile.
    """
    _gl_finish()()


def _nothing() -> None:
    """Do nothing: reading waits by itself."""


def open_context() -> moderngl.Context:
    """Return a context of OpenGL 3.3, which belongs to this thread.

    Raises:
        RenderingUnavailableError: a library is missing; the text says what to install.
    """
    try:
        # Imported here, because a server without cameras never needs it.
        import moderngl  # noqa: PLC0415
    except ImportError as error:
        raise missing_library("cameras", "moderngl") from error
    try:
        context = moderngl.create_context(require=330, standalone=True, backend="egl")
    except Exception as error:  # the library raises plain Exception
        raise RenderingUnavailableError(
            f"cameras need OpenGL 3.3 by EGL, and it cannot be opened: {error}. On Debian and Ubuntu:"
            " apt-get install libegl1 libgl1-mesa-dri"
        ) from error
    context.gc_mode = "auto"  # what Python drops is freed, also the parts of framebuffers
    return context
