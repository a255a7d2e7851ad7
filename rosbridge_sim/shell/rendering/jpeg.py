"""Pictures as JPEG."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.shell.rendering.unavailable import missing_library


def encode_jpeg(rgb: NDArray[np.uint8], quality: int = 90) -> bytes:
    """Return a picture as JPEG, without subsampling of the colours, so that thin painted lines keep theirs.

    Args:
        rgb: (h, w, 3).
        quality: 1..100; MORAI's presets have 90.

    Raises:
        RenderingUnavailableError: the library is missing.
        ValueError: the quality is out of range.
    """
    if not 1 <= quality <= 100:  # noqa: PLR2004 - JPEG's own scale
        raise ValueError(f"quality: expected 1..100, got {quality!r}")
    try:
        # Imported here, because a server without cameras never needs it.
        import simplejpeg  # noqa: PLC0415
    except ImportError as error:
        raise missing_library("cameras", "simplejpeg") from error
    content: bytes = simplejpeg.encode_jpeg(np.ascontiguousarray(rgb), quality, "RGB", "444")
    return content
