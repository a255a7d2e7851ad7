"""Removal of the server's token from clients' texts.

The server's own lines never contain a token. But a client that knows the token may write it into an op that is refused,
or into a `status` such as "connected to ws://sim:9090/?token=...". These texts go to the log and to `/sim/refusals`, so
the token is masked there. A wrong token cannot be recognised in a text.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final
from urllib.parse import quote

MIN_MASKED: Final = 4
"""Shortest token that is masked [characters]. For a shorter one, such as `a`, the gaps in a log would show it."""

Mask = Callable[[str], str]
"""Returns a text without the token."""


def mask_of(token: str | None) -> Mask:
    """Return a function that masks a token, both plain and in its URL spelling; without a token it changes nothing.

    Args:
        token: the token; None if there is none.
    """
    if token is None or len(token) < MIN_MASKED:
        return _keep
    spellings = sorted({token, quote(token), quote(token, safe="")}, key=len, reverse=True)

    def mask(text: str) -> str:
        for one in spellings:
            text = text.replace(one, "...")
        return text

    return mask


def _keep(text: str) -> str:
    return text
