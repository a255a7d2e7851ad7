"""Pairs of places that are near each other, by a grid whose cells are as large as the reach."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.block_grid import CELL_COLUMN
from rosbridge_sim.world.geometry.near_pairs import find_share
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, ranges
from rosbridge_sim.world.geometry.world_pairs import pair_in_worlds

MAX_COMPARED: Final = 1 << 16
"""Pairs that are compared, at most: 1,000 people at 0.8 for each square metre. More is a heap (8,000 people on one spot
are 64 million pairs). Then each place has so many others of each column of cells as there is room for, the first ones
from the south."""

MAX_PAIRWISE: Final = 1 << 11
"""Up to so many pairs are all compared, without cells: 16 us in place of 45."""


def find_neighbours(  # noqa: PLR0917 - two sets of places
    x: FloatArray,
    y: FloatArray,
    other_x: FloatArray,
    other_y: FloatArray,
    reach: float | FloatArray,
    worlds: tuple[IntArray, IntArray] | None = None,
) -> tuple[IntArray, IntArray]:
    """Return the pairs of a place and another one that are within a reach of each other.

    Args:
        x: (k,) east [m].
        y: (k,) north [m].
        other_x: (m,) east of the others [m].
        other_y: (m,) north of the others [m].
        reach: positive, one for all; or (k,), for places of many worlds [m].
        worlds: (k,) and (m,) int64, the worlds of the places and the others, which see only their own; None for one.

    Returns:
        (p,) int64, indices of the places, rising, and (p,) int64, indices of the others, rising for each place. So sums
        over the pairs of one place have the same order whatever the other places are. Of a heap they are a part.
    """
    if worlds is not None:  # small ones
        place, other = pair_in_worlds(*worlds)
        away = np.square(x.take(place) - other_x.take(other)) + np.square(y.take(place) - other_y.take(other))
        reach = np.broadcast_to(np.asarray(reach), x.shape).take(place)
        near = (away < reach * reach).nonzero()[0]
        return place.take(near), other.take(near)
    if len(x) * len(other_x) <= MAX_PAIRWISE:
        away = np.square(x[:, None] - other_x) + np.square(y[:, None] - other_y)
        place, other = (away < reach * reach).nonzero()
        return place, other
    column, line = np.floor(other_x / reach).astype(np.int64), np.floor(other_y / reach).astype(np.int64)
    number = column * CELL_COLUMN + line
    order = number.argsort(kind="stable")
    number = number[order]
    here = np.floor(x / reach).astype(np.int64) * CELL_COLUMN + np.floor(y / reach).astype(np.int64)
    cells = (here[:, None] + np.array([-CELL_COLUMN, 0, CELL_COLUMN])).ravel()
    start = number.searchsorted(cells - 1, side="left")
    count = number.searchsorted(cells + 1, side="right") - start
    if count.sum() > MAX_COMPARED:
        count = np.minimum(count, find_share(count, MAX_COMPARED))
    place = np.arange(len(x)).repeat(3).repeat(count)
    other = order[ranges(start, count)]
    east, north = x.take(place) - other_x.take(other), y.take(place) - other_y.take(other)
    is_near = np.square(east) + np.square(north) < reach * reach
    near = is_near.nonzero()[0]
    num = len(other_x)
    key = place.take(near) * num + other.take(near)
    key.sort()  # of one array: a fifth of the time of an order of two
    return key // num, key % num
