"""Lines as strips of triangles: sampling, offsets to the side, and dashes."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, arc_lengths

MAX_PIECE: Final = 10.0
"""Longest piece of a strip [m]: what draws can leave out pieces that are not in view."""

MAX_TURN: Final = 0.025
"""Turn of a piece at most [rad]: with 10 m it is 3 cm beside the line at most."""

MAX_BEND: Final = 0.01
"""Change of slope within a piece at most: with 10 m it is 1 cm above the line at most."""


def sample_arcs(line: FloatArray) -> FloatArray:
    """Return the arc lengths at which a line is cut into straight pieces, rising, (k,) [m].

    Args:
        line: (n, 3) points, no two neighbours alike [m].
    """
    step = np.diff(line, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    arc = np.concatenate([[0.0], np.cumsum(length)])
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    slope = step[:, 2] / np.maximum(length, 1e-9)
    bend = np.abs(np.diff(heading)) / MAX_TURN + np.abs(np.diff(slope)) / MAX_BEND
    cost = np.cumsum(length[:-1] / MAX_PIECE + bend)
    is_kept = np.ones(len(line), dtype=bool)
    is_kept[1:-1] = np.floor(cost) > np.floor(np.concatenate([[0.0], cost[:-1]]))
    kept = arc[is_kept]
    num = np.maximum(np.ceil(np.diff(kept) / MAX_PIECE), 1.0).astype(np.int64)
    first = np.repeat(kept[:-1], num)
    share = (np.arange(num.sum()) - np.repeat(np.cumsum(num) - num, num)) / np.repeat(num, num)
    return np.append(first + share * np.repeat(np.diff(kept), num), arc[-1])


def take_at(line: FloatArray, arcs: FloatArray) -> FloatArray:
    """Return values along a line at arc lengths, (k, c).

    Args:
        line: (n, c) the first two columns are the place [m].
        arcs: (k,) [m].
    """
    own = arc_lengths(line[:, :2])
    return np.column_stack([np.interp(arcs, own, column) for column in line.T])


def across(points: FloatArray) -> FloatArray:
    """Return unit vectors to the left of a line at its points, (n, 2).

    Args:
        points: (n, 2 or more), no two neighbours alike [m].
    """
    step = np.diff(points[:, :2], axis=0)
    step /= np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]
    along = np.concatenate([step[:1], step[:-1] + step[1:], step[-1:]])
    along /= np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    return np.column_stack([-along[:, 1], along[:, 0]])


def strip(left: FloatArray, right: FloatArray) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return the strip between two lines: (2 n, 3) vertices and (2 (n - 1), 3) triangles, seen from above.

    Args:
        left: (n, 3) [m].
        right: (n, 3) [m].
    """
    at = 2 * np.arange(len(left) - 1, dtype=np.int32)[:, None, None]
    quad = np.array([[0, 1, 3], [0, 3, 2]], dtype=np.int32)
    return np.stack([left, right], axis=1).reshape(-1, 3), (at + quad).reshape(-1, 3)


def cut_dashes(length: float, dash: float, gap: float) -> FloatArray:
    """Return start and end of each dash on a line, (k, 2) [m]: it begins and ends with half a gap.

    Args:
        length: of the line [m].
        dash: length of a dash [m].
        gap: between two dashes [m].
    """
    num = max(round(length / (dash + gap)), 1)
    period = length / num
    start = period * np.arange(num) + 0.5 * period * gap / (dash + gap)
    return np.column_stack([start, start + period * dash / (dash + gap)])


def runs_of(which: BoolArray) -> list[tuple[int, int]]:
    """Return start and end of each run of two or more true values."""
    edge = np.flatnonzero(np.diff(np.concatenate([[0], which.view(np.int8), [0]])))
    return [(start, end) for start, end in edge.reshape(-1, 2).tolist() if end - start > 1]
