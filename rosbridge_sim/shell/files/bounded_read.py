"""Reading of whole files, up to a length."""

from __future__ import annotations

from pathlib import Path

from rosbridge_sim.errors import DocumentError

__all__ = ["read_bounded"]

_FIRST_READ = 2**15
"""Size of the first read [bytes]: a first read of `max_bytes` would allocate that much for each of many small files."""


def read_bounded(path: Path, max_bytes: int) -> bytes:
    """Return a file's content.

    Args:
        path: path of the file.
        max_bytes: longest content.

    Raises:
        DocumentError: it cannot be read, or it is longer than `max_bytes`.
    """
    try:
        with path.open("rb") as file:
            content = file.read(_FIRST_READ)
            if len(content) == _FIRST_READ:
                content += file.read(max_bytes + 1 - _FIRST_READ)
    except OSError as error:
        raise DocumentError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > max_bytes:
        raise DocumentError(f"{path}: expected at most {max_bytes:,} bytes; it is longer")
    return content
