"""Frames at which sensors are due."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import Final

FRAME_RATE: Final = 50.0
"""Frames in a second of simulated time, and so the highest rate of a sensor [Hz]."""


def is_due(rate: float, frame: int) -> bool:
    """Return whether a message of a rate belongs to a frame, as for all topics of the simulator.

    At 30 Hz these are the frames 2, 4, 5, 7, 9, 10, ...: 40 or 20 ms apart.

    Args:
        rate: at most `FRAME_RATE` [Hz].
    """
    return num_due(rate, frame, 1) > 0


def num_due(rate: float, frame: int, num_frames: int) -> int:
    """Return how many messages of a rate belong to the last frames up to one; see `is_due`."""
    up, down = _step(rate)
    return frame * up // down - (frame - num_frames) * up // down


@lru_cache(maxsize=64)
def _step(rate: float) -> tuple[int, int]:
    """Return the messages of a frame, as a fraction."""
    step = Fraction(rate).limit_denominator(10_000) / int(FRAME_RATE)
    return step.numerator, step.denominator
