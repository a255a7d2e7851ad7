"""The server's token masked in what clients write.

Our own lines never hold a token. But a client that has the token may write it into an op that is refused, or into a
`status` such as "connected to ws://sim:9090/?token=...", and these words are logged and told on `/sim/refusals`. So
the token is masked there, wherever it stands. A wrong token cannot be known in such words.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final
from urllib.parse import quote

__all__ = ["MIN_MASKED", "Mask", "mask_of"]

MIN_MASKED: Final = 4
"""Characters of a token from which on it is masked. The gaps in a log would tell a shorter one, such as `a`."""

Mask = Callable[[str], str]
"""Gives a text without the token."""


def mask_of(token: str | None) -> Mask:
    """Return what masks a token, as it is and as it stands in a URL; without a token, every text stays as it is."""
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
