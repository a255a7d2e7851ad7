"""What drivers know of the roads beyond their lines: how fast, where on, and where lanes lie over one another.

It is worked out once for each map, when the first driver comes, from the geometry alone: a map says which lanes follow
one another, but not which of them cross.

*Rivals* are lanes that cross, or that run into one: whoever enters the one must not meet whoever is on the other. Where
the lanes are nearer to each other than `CLEAR`, nobody is on both sides at once; a lane's `hold` is where one waits
for that. *Siblings* are lanes that part from one place: as far as they still lie over one another, whoever is on the
one is in the way of who goes into the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray, ranges, wrap_angle
from rosbridge_sim.world.roads import Roads

__all__ = ["COMFORT", "LaneConflicts", "Links"]

COMFORT: Final = 2.0
"""How hard a driver brakes for what he has seen coming [m/s^2]."""

MAX_LATERAL: Final = 2.5
"""What a driver lets a bend press him aside [m/s^2]; in traffic people take 2 to 3."""

NO_LIMIT: Final = 50.0 / 3.6
"""Where no limit is told [m/s]."""

MIN_SAFE_SPEED: Final = 1.5
"""However sharp a corner of the line is, it is gone round at a walk [m/s]."""

BEND: Final = 3.0
"""A bend is measured over so far to either side, so that rounding in a map's points makes none [m]."""

CLEAR: Final = 2.4
"""Lines nearer than this cannot be driven side by side: two cars of 1.9 m and half a metre between them. Lanes of the
usual 3 to 3.5 m beside one another are not concerned [m]."""

SWING: Final = 8.0
"""In a bend of radius R the corners of a bus (overhang 2.6 m, wheelbase 5.4 m) leave its lane by this over R, to the
outside with its nose and to the inside with its middle; each of two lines is given as much more room [m^2]."""

MAX_CLEAR: Final = 4.5
"""The most that is kept clear between two lines, however tight they are [m]."""

BRIDGE: Final = 3.0
"""Lanes whose heights differ by more do not meet [m]."""

SAMPLE: Final = 1.0
"""Distance of the places at which lanes are compared [m]."""

AT_START: Final = 25.0
"""Who crosses nothing in the first stretch of a lane waits where he will meet the other; else before the lane, where
the stop line of an intersection is [m]."""

TAIL: Final = 1.0
"""Beyond the place where the lines part, for the corners of who turns [m]."""

MAX_LANE_PAIRS: Final = 1 << 20
"""Pairs of places compared at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """For each lane some others, and a figure for each: those of lane `i` are `first[i]:first[i + 1]`.

    Attributes:
        first: (l + 1,) int64.
        other: (k,) int64, rows of lanes.
        figure: (k,) [m].
    """

    first: IntArray
    other: IntArray
    figure: FloatArray

    def of(self, lanes: IntArray) -> tuple[IntArray, IntArray]:
        """All pairs that begin at given lanes.

        Returns:
            (m,) int64, positions in `lanes`, rising, and (m,) int64, positions in `other`.
        """
        start, count = self.first[lanes], self.first[lanes + 1] - self.first[lanes]
        return np.repeat(np.arange(len(lanes)), count), ranges(start, count)


class LaneConflicts:
    """All of it for one map; `roads.derived(Network)`.

    Attributes:
        roads: the map's.
        pace: (n,) for each point of the roads the speed at which one may pass it: the limit, what the bends allow, and
            slow enough to brake for what comes on the same lane [m/s].
        legs: (n, 8) for each point the straight leg to the next one: arc length at both its ends, the place where it
            begins, east, north, up [m], and the direction, for each metre in the plane. A lane's last point has the
            leg before it.
        onward: lanes to choose from at the end of each: its successors, without those from which there is no way on
            for ever, if any other is left. (The figures mean nothing.)
        hold: (l,) how far along a lane one waits for its rivals; inf for lanes without any [m].
        out: (l,) how far along it one is in no rival's way any more; 0 without any [m].
        rivals: for each lane its rivals, and how far somebody's tail must have come on the rival [m].
        siblings: for each lane its siblings, and how far along the lane they lie over it [m].
        shared: (l,) the greatest of these, 0 without siblings [m].
    """

    __slots__ = ("clear_point", "legs", "onward", "rivals", "roads", "safe_speed", "shared", "siblings", "wait_point")

    def __init__(self, roads: Roads) -> None:
        self.roads = roads
        curvature = _curvature(roads)
        self.safe_speed = _safe_speed(roads, curvature)
        self.legs = _legs(roads)
        self.onward = _onward(roads)
        pairs = _overlaps(roads, curvature)
        is_sibling = _start_together(roads, pairs.lane, pairs.other)
        num = len(roads)
        self.siblings = _links(num, pairs.lane[is_sibling], pairs.other[is_sibling], pairs.to_s[is_sibling])
        self.shared = np.zeros(num)
        np.maximum.at(self.shared, pairs.lane[is_sibling], pairs.to_s[is_sibling])
        rival = ~is_sibling & ~_are_in_turn(roads, pairs.lane, pairs.other)
        lane, other = pairs.lane[rival], pairs.other[rival]
        self.rivals = _links(num, lane, other, pairs.other_to_s[rival] + TAIL)
        wait_point = np.full(num, np.inf)
        np.minimum.at(wait_point, lane, pairs.from_s[rival])
        self.wait_point = np.where(wait_point < AT_START, 0.0, wait_point - TAIL)
        self.clear_point = np.zeros(num)
        np.maximum.at(self.clear_point, lane, pairs.to_s[rival] + TAIL)


def _links(num: int, lane: IntArray, other: IntArray, figure: FloatArray) -> Links:
    order = np.lexsort((other, lane))
    first = np.searchsorted(lane[order], np.arange(num + 1)).astype(np.int64)
    return Links(first, other[order], figure[order])


# How fast


def _curvature(roads: Roads) -> FloatArray:
    """(n,) of the circle through three places of the line: that of the bend, whatever the points' spacing [1/m]."""
    lane = np.repeat(np.arange(len(roads), dtype=np.int64), np.diff(roads.first))
    if not len(lane):
        return np.zeros(0)
    reach = np.minimum(BEND, 0.5 * roads.length[lane])
    middle = np.clip(roads.s, reach, roads.length[lane] - reach)
    a, b, c = (roads.at(lane, middle + offset)[0][:, :2] for offset in (-reach, 0.0 * reach, reach))
    ab, bc, ac = b - a, c - b, c - a
    area = np.abs(ab[:, 0] * bc[:, 1] - ab[:, 1] * bc[:, 0])
    return np.asarray(2.0 * area / np.maximum(np.hypot(*ab.T) * np.hypot(*bc.T) * np.hypot(*ac.T), 1e-9))


def _safe_speed(roads: Roads, curvature: FloatArray) -> FloatArray:
    lane = np.repeat(np.arange(len(roads), dtype=np.int64), np.diff(roads.first))
    limit = np.where(roads.speed_limit > 0.0, roads.speed_limit, NO_LIMIT)[lane]
    if not len(lane):
        return limit
    bend = np.sqrt(MAX_LATERAL / np.maximum(curvature, 1e-9))
    square = np.square(np.minimum(limit, np.maximum(bend, MIN_SAFE_SPEED)))
    # Slow enough for all that follows on the lane: v^2 + 2 b s never rises backwards. The lanes are set apart on the
    # scale by more than any speed is worth, so that one sweep does for all.
    along = 2.0 * COMFORT * roads.s
    apart = (1.0 + square.max() + along.max()) * lane
    lowest = np.minimum.accumulate((square + along + apart)[::-1])[::-1] - apart
    return np.asarray(np.sqrt(np.maximum(lowest - along, 0.0)))


def _legs(roads: Roads) -> FloatArray:
    legs = np.zeros((len(roads.points), 8))
    if not len(legs):
        return legs
    start = np.arange(len(roads.points))
    start[roads.first[1:] - 1] -= 1
    step = roads.points[start + 1] - roads.points[start]
    length = roads.s[start + 1] - roads.s[start]
    legs[:, 0], legs[:, 1] = roads.s[start], roads.s[start + 1]
    legs[:, 2:5] = roads.points[start]
    legs[:, 5:8] = step / length[:, None]
    return legs


def _onward(roads: Roads) -> Links:
    count = np.diff(roads.first_successor)
    lane = np.repeat(np.arange(len(roads), dtype=np.int64), count)
    other = roads.successor
    is_open = np.ones(len(roads), dtype=bool)
    while True:  # at most once for each lane, from the dead ends backwards; hardly ever more than a few times
        ways = np.bincount(lane[is_open[other]], minlength=len(roads))
        if not (is_open & (ways == 0)).any():
            break
        is_open &= ways > 0
    keeps = is_open[other] | ~is_open[lane]
    return _links(len(roads), lane[keeps], other[keeps], np.zeros(int(keeps.sum())))


# Where lanes lie over one another


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Lanes that come near each other, each pair twice: from where to where on the one, to where on the other [m]."""

    lane: IntArray
    other: IntArray
    from_s: FloatArray
    to_s: FloatArray
    other_to_s: FloatArray


def _overlaps(roads: Roads, curvature: FloatArray) -> _Pairs:
    count = np.maximum(np.ceil(roads.length / SAMPLE).astype(np.int64), 1) + 1
    lane = np.repeat(np.arange(len(roads), dtype=np.int64), count)
    share = ranges(np.zeros_like(count), count) / np.repeat(count - 1, count)
    s = share * roads.length[lane]
    place = roads.at(lane, s)[0] if len(lane) else np.zeros((0, 3))
    # The greater of the two beside each place: a corner's tip must not be lost between them.
    point = roads.locate(lane, s)[0] if len(lane) else np.zeros(0, dtype=np.int64)
    swing = SWING * np.maximum(curvature[point], curvature[point + 1]) if len(lane) else np.zeros(0)
    found = [np.zeros((4, 0))]
    for i, j in _near(place[:, :2]):
        apart = place[i] - place[j]
        clear = np.minimum(CLEAR + swing[i] + swing[j], MAX_CLEAR)
        is_near = (np.square(apart[:, :2]).sum(axis=1) < clear * clear) & (np.abs(apart[:, 2]) < BRIDGE)
        is_near &= lane[i] != lane[j]
        i, j = i[is_near], j[is_near]  # noqa: PLW2901  # the few that are left of many
        # The end of the one near the start of the other is how lanes follow one another.
        is_turn = (s[i] > roads.length[lane[i]] - MAX_CLEAR) & (s[j] < MAX_CLEAR)
        is_turn |= (s[j] > roads.length[lane[j]] - MAX_CLEAR) & (s[i] < MAX_CLEAR)
        i, j = i[~is_turn], j[~is_turn]  # noqa: PLW2901  # as before
        found += [np.stack((lane[i], lane[j], s[i], s[j])), np.stack((lane[j], lane[i], s[j], s[i]))]
    lanes, others, on_lane, on_other = np.concatenate(found, axis=1)
    key = lanes.astype(np.int64) * len(roads) + others.astype(np.int64)
    order = np.argsort(key, kind="stable")
    key, on_lane, on_other = key[order], on_lane[order], on_other[order]
    start = np.flatnonzero(np.diff(key, prepend=-1))
    if not len(start):
        empty, none = np.zeros(0), np.zeros(0, dtype=np.int64)
        return _Pairs(none, none, empty, empty, empty)
    lower, upper = np.minimum.reduceat(on_lane, start), np.maximum.reduceat(on_lane, start)
    return _Pairs(key[start] // len(roads), key[start] % len(roads), lower, upper, np.maximum.reduceat(on_other, start))


def _near(place: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Pairs of places that may be nearer than `MAX_CLEAR`, each once, a portion at a time."""
    if not len(place):
        return
    cell = np.floor((place - place.min(axis=0)) / MAX_CLEAR).astype(np.int64) + 1
    rows = int(cell[:, 1].max()) + 3
    key = cell[:, 0] * rows + cell[:, 1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    index = np.arange(len(key))
    # The rest of one's own cell and the one above; then three of the next column, which are neighbours on the scale.
    for low, high in ((None, 1), (rows - 1, rows + 1)):
        begin = index + 1 if low is None else key.searchsorted(key + low)
        count = np.maximum(key.searchsorted(key + high, side="right") - begin, 0)
        total = np.cumsum(count)
        at = 0
        while at < len(key):
            upto = max(int(total.searchsorted((total[at - 1] if at else 0) + MAX_LANE_PAIRS)), at + 1)
            part = slice(at, upto)
            yield order[np.repeat(index[part], count[part])], order[ranges(begin[part], count[part])]
            at = upto


def _are_in_turn(roads: Roads, lane: IntArray, other: IntArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(k,) whether one of two lanes follows the other, or lies beside it to be changed into."""
    count = np.diff(roads.first_successor)
    begin = np.repeat(np.arange(len(roads), dtype=np.int64), count)
    num = len(roads)
    known = np.concatenate([begin * num + roads.successor, roads.successor * num + begin])
    is_beside = (roads.left[lane] == other) | (roads.right[lane] == other)
    return np.asarray(np.isin(lane * num + other, known) | is_beside)


def _start_together(roads: Roads, lane: IntArray, other: IntArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(k,) whether two lanes begin at one place in one direction."""
    if not len(lane):
        return np.zeros(0, dtype=bool)
    every = np.arange(len(roads), dtype=np.int64)
    start, yaw = roads.at(every, np.zeros(len(every)))
    apart = np.hypot(*(start[lane] - start[other])[:, :2].T)
    return np.asarray((apart < 0.1) & (np.abs(wrap_angle(yaw[lane] - yaw[other])) < math.pi / 3))  # noqa: PLR2004
