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


def judge(step: str, wrong: str, advice: str, good: str) -> Finding:
    """Return a finding: what is wrong, with advice, unless that is empty; else what is good."""
    return Finding(step, not wrong, wrong or good, advice if wrong else "")
