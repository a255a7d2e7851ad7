"""Text of a peer's as an error, a log line or a frame may repeat it."""

from __future__ import annotations

__all__ = ["MAX_QUOTED", "printable"]

MAX_QUOTED = 200
"""Characters of a path or a type name in an error text: far more than any real one has."""


def printable(text: str, max_chars: int | None = None) -> str:
    """Return a text with each half of a surrogate pair escaped, because no encoder can send one on.

    Args:
        text: of a peer's.
        max_chars: cut it there and end it in `...`, so that an answer is never much longer than its question; None
            keeps all of it.
    """
    if max_chars is not None and len(text) > max_chars:
        text = text[:max_chars] + "..."
    return text if text.isascii() else text.encode("utf-8", "backslashreplace").decode()
