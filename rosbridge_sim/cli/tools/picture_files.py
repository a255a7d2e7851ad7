"""Pictures as Pillow's, and their files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.link.bridge_errors import BridgeError
from rosbridge_sim.link.terminal_text import safe

if TYPE_CHECKING:  # it is imported late, because few commands need it
    from PIL.Image import Image


def picture_of(raw: bytes, size: tuple[int, int], encoding: str) -> Image:
    """Return the picture of a sensor_msgs/Image.

    Args:
        raw: its bytes, little-endian.
        size: width and height [pixels].
        encoding: `rgb8`, `mono8`, `mono16` or `32FC1`, which is a depth [m] and becomes whole millimetres, as depth is
            kept in PNG files.

    Raises:
        BridgeError: the encoding is another one, or there are more or fewer bytes.
    """
    from PIL import Image  # noqa: PLC0415 - see above

    shape = size[::-1]
    try:
        if encoding == "rgb8":
            return Image.fromarray(np.frombuffer(raw, np.uint8).reshape(*shape, 3))
        if encoding == "mono8":
            return Image.fromarray(np.frombuffer(raw, np.uint8).reshape(shape))
        if encoding == "mono16":
            return Image.fromarray(np.frombuffer(raw, "<u2").reshape(shape))
        if encoding == "32FC1":
            depth = np.frombuffer(raw, "<f4").reshape(shape)
            return Image.fromarray(np.clip(np.nan_to_num(depth * 1000.0, posinf=0.0), 0, 65535).astype(np.uint16))
    except ValueError:
        raise BridgeError("expected as many bytes as the picture's size says") from None
    raise BridgeError(f"expected rgb8, mono8, mono16 or 32FC1, got the encoding {safe(encoding)}")


def save(path: Path, write: Callable[[], object]) -> int:
    """Write a file; return its size [bytes].

    Args:
        path: of the file, named by `--out`.

    Raises:
        DocumentError: it cannot be written, or its suffix names no format of pictures.
    """
    try:
        write()
        return path.stat().st_size
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise DocumentError(f"--out: {path} cannot be written: {why}") from None
