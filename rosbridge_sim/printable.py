"""Text from a peer, made safe for errors, log lines and frames."""

from __future__ import annotations

__all__ = ["MAX_QUOTED", "printable"]

MAX_QUOTED = 200
"""Characters of a path or a type name in an error text: far more than any real one has."""


def printable(text: str, max_chars: int | None = None) -> str:
    """Return a text with each half of a surrogate pair escaped, because no encoder can send a half.

    Args:
        text: text from a peer.
        max_chars: shorten it to this length and end it with `...`, so that an answer is never much longer than its
            request; None keeps all of it.
    """
    if max_chars is not None and len(text) > max_chars:
        text = text[:max_chars] + "..."
    return text if text.isascii() else text.encode("utf-8", "backslashreplace").decode()
