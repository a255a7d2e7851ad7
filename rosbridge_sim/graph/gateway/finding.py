"""A step of a check that tells why nodes see nothing of a server."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """The result of one step.

    Attributes:
        is_good: nothing is wrong there.
        text: what was found.
        advice: what to do; empty if nothing.
    """

    step: str
    is_good: bool
    text: str
    advice: str = ""
