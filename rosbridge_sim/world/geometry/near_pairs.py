"""The broad phase of collision detection: the pairs of entities that are near each other, by a grid of cells."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.block_grid import CELL_COLUMN
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray

MAX_WIDE: Final = 8
MUCH: Final = 1.5
"""Cells are as large as the usual entity needs. At most `MAX_WIDE` entities that are larger by this factor are compared
with all others instead; a single long lorry would make all cells larger."""

MAX_BOX_PAIRS: Final = 1 << 16
PAIRS_EACH: Final = 8
"""Pairs compared by their rectangles: the first number at least, and the second one for each entity. 20,000 cars in a
jam, bumper to bumper, need 90,000. More is a heap: entities on top of one another. Of a heap a part is judged: pairs of
an ego, then half as many others, those with few partners first. So a heap in one place takes no contact from entities
elsewhere, and costs no more than a jam."""

MAX_NEAR: Final = 1 << 14
NEAR_EACH: Final = 1
"""Pairs that are returned: the first number at most, or the second one for each entity if that is more. The 20,000 cars
in a jam need 20,000."""

MAX_HEAP: Final = 1 << 13
"""Pairs of egos that are returned of a heap, at most. In a heap nearly all pairs touch, and each is judged anew in each
step: so many and half as many others take 5 ms, and 10 ms while they turn."""


def find_near_pairs(place: FloatArray, span: FloatArray, is_car: BoolArray, is_ego: BoolArray) -> tuple[IntArray, bool]:
    """Return the pairs of entities whose rectangles overlap and of which at least one is a car.

    Args:
        place: (2, k) middles of the rectangles, east and north, k > `MAX_WIDE` [m].
        span: (2, k) half of their sides [m].
        is_car: (k,) bool, the entity is a car.
        is_ego: (k,) bool, the entity is an ego: where there are too many pairs, those of egos come first.

    Returns:
        (2, m) int64, indices, the lower one first, in rising order; and whether they are all: of a heap a part.
    """
    k = place.shape[1]
    most = max(MAX_BOX_PAIRS, PAIRS_EACH * k)
    widest = span.max(axis=0)
    usual = np.partition(widest, k - 1 - MAX_WIDE)[k - 1 - MAX_WIDE]
    is_wide = widest > MUCH * usual
    pairs = _near_of_both(place, span, is_car, is_wide, most)
    is_heap = pairs is None
    if pairs is None:
        is_wide[is_ego.nonzero()[0][: most // k]] = True
        pairs = _near_of_both(place, span, is_car, is_wide, most // 4, is_heap=True)
        assert pairs is not None
    most = MAX_HEAP if is_heap else max(MAX_NEAR, NEAR_EACH * k)
    is_all = not is_heap
    if pairs.shape[1] > (most // 2 if is_heap else most):
        pairs, is_all = _thin_out(pairs, is_ego, most), False
    key = np.minimum(pairs[0], pairs[1]) * k + np.maximum(pairs[0], pairs[1])
    key.sort()
    return np.stack([key // k, key % k]), is_all


def _thin_out(pairs: IntArray, is_ego: BoolArray, most: int) -> IntArray:
    """Return at most `most` pairs of egos and half as many others, those with few partners first, in given order."""
    is_kept = is_ego[pairs[0]] | is_ego[pairs[1]]
    others = (~is_kept).nonzero()[0]
    is_kept[is_kept.nonzero()[0][most:]] = False
    one, other = pairs[0].take(others), pairs[1].take(others)
    num_partners = np.bincount(one, minlength=len(is_ego)) + np.bincount(other, minlength=len(is_ego))
    crowd = num_partners.take(one) + num_partners.take(other)
    if len(others) > most // 2:
        limit = np.partition(crowd, most // 2 - 1)[most // 2 - 1]
        first = (crowd < limit).nonzero()[0]
        last = (crowd == limit).nonzero()[0][: most // 2 - len(first)]
        is_kept[others[last]] = True
        others = others[first]
    is_kept[others] = True
    kept = is_kept.nonzero()[0]
    return np.stack([pairs[0].take(kept), pairs[1].take(kept)])


def find_share(count: IntArray, most: int) -> int:
    """Return the largest share with which the sum is at most `most`, if each takes its count or the share."""
    low, high = 0, most
    while low < high:
        share = (low + high + 1) // 2
        if np.minimum(count, share).sum() <= most:
            low = share
        else:
            high = share - 1
    return low


def _near_of_both(
    place: FloatArray, span: FloatArray, is_car: BoolArray, is_wide: BoolArray, most: int, *, is_heap: bool = False
) -> IntArray | None:
    """Return the same pairs in no order: the wide ones with all others, the rest by cells; see `_near_by_cells`."""
    rest = (~is_wide).nonzero()[0]
    pairs = _near_by_cells(place[:, rest], span[:, rest], is_car[rest], most, is_heap=is_heap)
    if pairs is None:
        return None
    pairs = rest[pairs]
    wide = is_wide.nonzero()[0]
    if len(wide):
        pairs = np.concatenate([pairs, _near_of_wide(place, span, is_car, wide)], axis=1)
    return pairs


def _near_of_wide(place: FloatArray, span: FloatArray, is_car: BoolArray, wide: IntArray) -> IntArray:
    """Return the pairs of some with all others, each once."""
    is_near = (np.abs(place[:, wide, None] - place[:, None]) <= span[:, wide, None] + span[:, None]).all(axis=0)
    is_near &= is_car[wide, None] | is_car
    # Two wide ones are one pair, from the lower one on.
    is_near[:, wide] &= wide[:, None] < wide
    i, j = is_near.nonzero()
    return np.stack([wide[i], j])


def _near_by_cells(
    place: FloatArray, span: FloatArray, is_car: BoolArray, most: int, *, is_heap: bool
) -> IntArray | None:
    """Return pairs by a grid whose cells are as large as the two largest rectangles need; each pair once.

    At most `most` pairs are compared. If there are more, the result is None. In a heap, it is then as many partners of
    each as there is room for, the nearest ones in the east-west direction first, because most of a heap's cell is not
    near.
    """
    column, line = np.floor(place / (2.0 * span.max(axis=1, initial=1.0)[:, None])).astype(np.int64)
    number = column * CELL_COLUMN + line
    order = np.lexsort((place[0], number)) if is_heap else number.argsort(kind="stable")
    number = number[order]
    # Partners are those that come later in the same cell or stand in the cell north of it, and the three cells east.
    here = np.arange(len(number))
    starts = np.stack([here + 1, number.searchsorted(number + (CELL_COLUMN - 1), side="left")])
    ends = number.searchsorted(np.stack([number + 1, number + (CELL_COLUMN + 1)]), side="right")
    count = (ends - starts).ravel()
    if count.sum() > most:
        if not is_heap:
            return None
        np.minimum(count, find_share(count, most), out=count)
    total = count.cumsum()
    owner = np.tile(here, 2).repeat(count)
    partner = np.arange(len(owner)) + (starts.ravel() - (total - count)).repeat(count)
    (x, y), (x_span, y_span) = place[:, order], span[:, order]
    is_near = np.abs(x.take(owner) - x.take(partner)) <= x_span.take(owner) + x_span.take(partner)
    near = is_near.nonzero()[0]
    owner, partner = owner.take(near), partner.take(near)
    is_near = np.abs(y.take(owner) - y.take(partner)) <= y_span.take(owner) + y_span.take(partner)
    near = is_near.nonzero()[0]
    owner, partner = order.take(owner.take(near)), order.take(partner.take(near))
    if not is_car.all():
        near = (is_car.take(owner) | is_car.take(partner)).nonzero()[0]
        owner, partner = owner.take(near), partner.take(near)
    return np.stack([owner, partner])
