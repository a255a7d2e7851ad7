"""Frames at which sensors are due."""

from __future__ import annotations

from rosbridge_sim.simulator.bus.publisher_kinds import in_each_frame


def is_due(rate: float, frame: int) -> bool:
    """Return whether a message of a rate belongs to a frame, as for all topics of the simulator.

    At 30 Hz these are the frames 2, 4, 5, 7, 9, 10, ...: 40 or 20 ms apart.

    Args:
        rate: at most `FRAME_RATE` [Hz].
    """
    return num_due(rate, frame, 1) > 0


def num_due(rate: float, frame: int, num_frames: int) -> int:
    """Return how many messages of a rate belong to the last frames up to one; see `is_due`."""
    up, down = in_each_frame(rate).as_integer_ratio()
    return frame * up // down - (frame - num_frames) * up // down
