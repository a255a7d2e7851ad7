"""An OpenGL context without a window, by EGL."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError, missing_library

if TYPE_CHECKING:
    import moderngl


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
            " apt-get install libegl1 libgl1 libgl1-mesa-dri"
        ) from error
    context.gc_mode = "auto"  # what Python drops is freed, also the parts of framebuffers
    return context
