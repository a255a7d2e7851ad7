"""Text from a peer, made safe for errors, log lines and frames."""

from __future__ import annotations

import re

MAX_QUOTED = 200
"""Characters of a path or a type name in an error text: far more than any real one has."""

_UNSAFE = re.compile(r"[\x80-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""Control characters beyond ASCII, the line separators, and the characters that change the direction of a text (Unicode
Standard Annex 9, section 2). With the latter a client's text could reorder the words of an error around it."""


def printable(text: str, max_chars: int | None = None) -> str:
    """Return a text with unsafe characters escaped.

    These are halves of surrogate pairs, which no encoder can send, and `_UNSAFE`.

    Args:
        max_chars: shorten it to this length and end it with `...`, so that an answer is never much longer than its
            request; None keeps all of it.
    """
    if max_chars is not None and len(text) > max_chars:
        text = text[:max_chars] + "..."
    if text.isascii():
        return text
    return _UNSAFE.sub(_escape, text).encode("utf-8", "backslashreplace").decode()


def _escape(found: re.Match[str]) -> str:
    return found[0].encode("ascii", "backslashreplace").decode()
