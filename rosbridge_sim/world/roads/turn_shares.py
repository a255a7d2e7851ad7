"""Shares of the turns to the left, straight on and to the right, for drivers without a route.

A successor of a lane is a turn if, `LOOK` beyond the fork, it points more than `STRAIGHT` away from the direction in
which the lane ends. Turns back count by their side. The lanes of one kind divide the share of that kind evenly.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray, wrap_angle
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads

LOOK: Final = 30.0
"""Distance beyond a fork at which its lanes are compared [m]: lanes across an intersection end there, and a long road
has not yet had bends of its own."""

STRAIGHT: Final = math.radians(30.0)
"""The most that a way straight on turns [rad]: less than any street corner, more than a road that shifts by a lane."""

MAX_SHARE: Final = 1e6
"""Largest share. Any unit may be used, such as vehicles an hour."""

ONE: Final = 1 << 32
"""The sum of all shares of a lane. Shares are whole numbers of 32 bits, so all lanes fit onto one exact scale."""


@dataclass(frozen=True, slots=True)
class TurnShares:
    """Weights of the three kinds of turns; where a fork lacks a kind, the others divide all drivers.

    Attributes:
        left: 0 to `MAX_SHARE`, in any unit.
        straight: likewise.
        right: likewise.

    Raises:
        ValueError: a share is out of its bounds, or all are 0.
    """

    left: float
    straight: float
    right: float

    def __post_init__(self) -> None:
        shares = astuple(self)
        if not all(0.0 <= share <= MAX_SHARE for share in shares) or not any(shares):
            raise ValueError(f"turn shares: expected three numbers 0..{MAX_SHARE:g}, not all 0, got {shares}")


class TurnKinds:
    """The kinds of all turns of one map; get them by `roads.derived(TurnKinds)`.

    Attributes:
        lane: (k,) int64, for each successor in `LaneConflicts.onward` the lane before it.
        kind: (k,) int64, its place among the fields of `TurnShares`.
    """

    def __init__(self, roads: Roads, num_copies: int = 1) -> None:
        """Find the kinds.

        Args:
            roads: lanes of a map.
            num_copies: how often the lanes are there, as in `many_roads`; `bounds` are those of all copies.
        """
        onward = roads.derived(LaneConflicts).onward
        self._first = onward.first
        self.lane = np.repeat(np.arange(len(roads), dtype=np.int64), np.diff(onward.first))
        self.kind = np.zeros(len(self.lane), dtype=np.int64)
        if len(self.lane):
            before = roads.at(self.lane, roads.length[self.lane])[1]
            beyond = roads.at(onward.other, np.minimum(roads.length[onward.other], LOOK))[1]
            angle = wrap_angle(beyond - before)
            self.kind = np.where(angle > STRAIGHT, 0, np.where(angle < -STRAIGHT, 2, 1))
        self._bounds: tuple[TurnShares, IntArray] | None = None  # of the last shares: a world has the same for long
        self._num_copies = num_copies

    def bounds(self, shares: TurnShares) -> IntArray:
        """Return bounds for all successors, (k,) int64, rising.

        A number from 0 to below `ONE` chooses the first successor of lane `i` whose bound is above the number plus
        `i * ONE`. Where a lane has only turns with share 0, all of them are equally likely.
        """
        if self._bounds is None or self._bounds[0] != shares:
            one, num = self._find_bounds(shares), self._num_copies
            lanes_before = (np.arange(num) * (len(self._first) - 1)).repeat(len(one))
            self._bounds = shares, np.tile(one, num) + lanes_before * ONE
        return self._bounds[1]

    def _find_bounds(self, shares: TurnShares) -> IntArray:
        lane, first = self.lane, self._first[:-1]
        count = np.diff(self._first)
        if not len(lane):
            return lane
        num_alike = np.bincount(3 * lane + self.kind, minlength=3 * len(count))
        share = np.array(astuple(shares), dtype=np.float64)[self.kind] / num_alike[3 * lane + self.kind]
        total = np.bincount(lane, weights=share, minlength=len(count))
        share[total[lane] == 0.0] = 1.0
        so_far, upper = np.zeros(len(count)), np.zeros(len(lane))
        for i in range(int(count.max())):  # in order, so that a share of 0 adds exactly nothing
            has_one = np.flatnonzero(count > i)
            so_far[has_one] += share[first[has_one] + i]
            upper[first[has_one] + i] = so_far[has_one]
        return np.asarray(lane * ONE + (upper / so_far[lane] * ONE).astype(np.int64))
