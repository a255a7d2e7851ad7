"""Roads with several lanes beside one another, for tests of lane changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from tests.world.road_factory import arc, line

__all__ = ["wide_ring", "wide_road"]

WIDTH = 3.5


def wide_road(num: int = 3, lengths: Sequence[float] = (1500.0,), limit: float = 25.0, ends_at: float = 0.0) -> Roads:
    """A straight to the east of some lanes; `l0` is the left one, `m0` its next part.

    Args:
        num: lanes; one may change between all of them.
        lengths: of the parts, one after the other [m].
        limit: [m/s].
        ends_at: if given, the right lane has one part alone and ends here [m].
    """
    ids: list[str] = []
    lines: list[FloatArray] = []
    left: list[int] = []
    right: list[int] = []
    successors: list[list[int]] = []
    start = 0.0
    for part, length in enumerate(lengths):
        for k in range(num):
            is_end = bool(ends_at) and k == num - 1
            if is_end and part:
                continue
            stop = ends_at if is_end else start + length
            ids.append(f"{'lmnopq'[part]}{k}")
            lines.append(line(*[(x, -WIDTH * k) for x in np.arange(start, stop + 0.5, 10.0)]))
            row = len(ids) - 1
            left.append(row - 1 if k else -1)
            right.append(row + 1 if k < num - 1 and not (part and ends_at and k == num - 2) else -1)
            has_next = part + 1 < len(lengths) and not is_end
            step = num if part == 0 else num - bool(ends_at)
            successors.append([row + step] if has_next else [])
        start += length
    return Roads(ids, lines, successors, [WIDTH] * len(ids), [limit] * len(ids), left=left, right=right)


def wide_ring(num: int = 3, radius: float = 150.0, limit: float = 25.0, *, is_woven: bool = False) -> Roads:
    """A ring of some lanes in two halves, driven to the left; `a0` is the inner lane.

    Args:
        num: lanes.
        radius: of the inner lane [m].
        limit: [m/s].
        is_woven: each lane leads also to those beside the one that continues it.
    """
    ids, lines, left, right, successors = [], [], [], [], []
    for half in range(2):
        for k in range(num):
            ids.append(f"{'ab'[half]}{k}")
            lines.append(arc(0, 0, radius + WIDTH * k, 180.0 * half, 180.0))
            row = half * num + k
            left.append(row - 1 if k else -1)
            right.append(row + 1 if k < num - 1 else -1)
            sides = [side for side in (0, -1, 1) if 0 <= k + side < num and (is_woven or not side)]
            successors.append([(1 - half) * num + k + side for side in sides])
    return Roads(ids, lines, successors, [WIDTH] * len(ids), [limit] * len(ids), left=left, right=right)
