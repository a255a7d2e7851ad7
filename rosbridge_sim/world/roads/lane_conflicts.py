"""Facts about the lanes that drivers need: safe speeds, where to go on, and where lanes conflict.

They are worked out once for each map, when the first driver comes, from the geometry alone: a map says which lanes
follow one another, but not which of them cross.

*Rivals* are lanes that cross or merge. A vehicle that enters one of them must not meet a vehicle on the other, so where
the lanes are nearer to each other than `CLEAR`, only one of them is used at a time. Vehicles wait for that at the wait
point of their lane. *Siblings* are lanes that fork from one place. As far as they still overlap, a vehicle on one of
them obstructs the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, is_among, ranges, wrap_angle
from rosbridge_sim.world.roads.lane_joins import find_joins
from rosbridge_sim.world.roads.roads import Roads

COMFORT: Final = 2.0
"""Comfortable deceleration of the typical driver, for what it has seen in time [m/s^2]."""

MAX_LATERAL: Final = 2.5
"""Comfortable lateral acceleration of the typical driver [m/s^2]; drivers in traffic accept 2 to 3."""

DEFAULT_SPEED_LIMIT: Final = 50.0 / 3.6
"""Speed limit of lanes for which the map gives none [m/s]: 50 km/h, as in most towns."""

MIN_SAFE_SPEED: Final = 1.5
"""The safe speed in a corner of any sharpness [m/s]: walking speed."""

SETTLING_TIME: Final = 0.6
"""Time constant with which a speed above the safe one falls to it [s]. With a lag of the acceleration of 0.3 s a
shorter one would swing around it."""

FORESIGHT: Final = 2.0 * SETTLING_TIME
"""Drivers heed limits and bends this time and their reaction ahead [s]: an eighth of the excess is left by then."""

USUAL_REACTION: Final = 0.4
"""Reaction of the slower half of the drivers [s]."""

TURNS_AHEAD: Final = 2.5
"""Bends count so far before the rear axle [m]: 1.35 m for the middle between the axles of a usual car, which turns as
its line does there, and the rest because the curvature at the ends of a bend is spread over `BEND`."""

MAX_BEND_SPEED: Final = 100.0
"""The speed of bends that are nearly straight [m/s], faster than any driver: the bends then do not matter."""

BEND: Final = 3.0
"""Curvature is measured over at least this length to either side [m], so that rounding in the map's points makes no
bend."""

MAX_BEND: Final = 12.0
"""Curvature is measured over at most this length to either side [m]: a longer one would hide corners. Where points are
farther apart than `BEND`, it is as long as they are, since the whole turn of a segment is at its end."""

CLEAR: Final = 2.4
"""Lines nearer than this cannot be used side by side [m]: two cars of 1.9 m and half a metre between them. Lanes of the
usual width of 3 to 3.5 m beside one another are farther apart, also where they begin to part."""

SWING: Final = 8.0
"""In a bend of radius R the corners of a bus (overhang 2.6 m, wheelbase 5.4 m) leave its lane by this number over R, to
the outside with its nose and to the inside with its middle. Each of two lines gets so much more room [m^2]."""

CAR_SWING: Final = 2.0
"""The same number for a car of 4.7 m with a wheelbase of 2.8 m [m^2]."""

MAX_CLEAR: Final = 4.5
"""The most that is kept clear between two lines, for any radius [m]."""

BRIDGE: Final = 3.0
"""Lanes whose heights differ by more than this do not conflict [m]: one is on a bridge."""

SAMPLE: Final = 1.0
"""Distance between the places at which lanes are compared [m]."""

AT_START: Final = 25.0
"""If a lane conflicts with others only beyond this length, the wait point is before the conflict [m]. Else it is the
start of the lane, where the stop line of an intersection is."""

ACROSS: Final = math.sin(math.radians(20.0))
"""A lane comes from the side if the sine of the angle to it is greater."""

TAIL_MARGIN: Final = 1.0
"""Length added beyond the end of a conflict, for the corners of a vehicle that turns [m]."""

ROAD_WIDTH: Final = 6.0
"""The two directions of a road begin and end side by side, so far from each other at most [m]."""

ONCOMING: Final = math.radians(45.0)
"""The headings of the two directions of a road are opposite, to this angle [rad]."""

MAX_LANE_PAIRS: Final = 1 << 20
"""Pairs of places compared at once: it bounds the memory."""


class Links(Record, eq=False):
    """For each lane some other lanes, with a number for each; those of lane `i` are at `first[i]:first[i + 1]`.

    Attributes:
        first: (l + 1,) int64.
        other: (k,) int64, rows of the other lanes.
        figure: (k,) the number, a length [m].
    """

    first: IntArray
    other: IntArray
    figure: FloatArray

    def of(self, lanes: IntArray) -> tuple[IntArray, IntArray]:
        """Return all pairs of given lanes with others.

        Args:
            lanes: (n,) int64, rows of lanes.

        Returns:
            (m,) int64, indices into `lanes`, rising, and (m,) int64, indices into `other`.
        """
        start, count = self.first[lanes], self.first[lanes + 1] - self.first[lanes]
        return np.arange(len(lanes)).repeat(count), ranges(start, count)


class LaneConflicts:
    """The facts for one map; get them by `roads.derived(LaneConflicts)`.

    Attributes:
        limit_speed: (n,) for each point of the roads the speed that the limit allows, low enough to brake with
            `COMFORT` for what comes on the same lane [m/s].
        bend_speed: (n,) the same for bends, with a lateral acceleration of `MAX_LATERAL` [m/s].
        speeds_ahead: (n, 7) arc length of each point [m], and three figures each of limit_speed and of bend_speed: the
            square of the speed, the least square from here to `foresight` ahead on the same lane, and the change of
            the latter to the next point for each metre, 0 at the last point of a lane. While drivers brake evenly,
            squares of speeds fall evenly along the way.
        safe_speed: (n,) the lower of the two, for the typical driver [m/s].
        legs: (n, 8) for each point the straight leg to the next one: arc length at its start and end [m], start point
            east, north, up [m], and direction in space, for each metre in the plane. The last point of a lane has the
            leg before it.
        onward: for each lane the lanes to choose from at its end: its successors, without those that lead to dead ends
            only, if any other is left. A lane that ends beside one that goes on is no dead end. The numbers mean
            nothing.
        wait_point: (l,) arc length at which the front bumper waits for the rivals; inf for lanes without rivals [m].
        clear_point: (l,) arc length from which a tail obstructs no rival any more; 0 without rivals [m].
        rivals: for each lane its rivals, with the arc length on the rival beyond which a tail is clear [m].
        rival_from: (k,) for each of these pairs the arc length on the lane from which it is near the rival [m].
        rival_right: (k,) bool, for each of these pairs the rival comes from the right.
        rival_passes: (k,) bool, these are the two directions of a road in a tight bend: cars pass each other there, and
            only where one of two vehicles is long are they rivals.
        rival_back: (k,) int64, for each of these pairs the index of the same pair seen from the rival.
        siblings: for each lane its siblings, with the arc length up to which they overlap the lane [m].
        shared: (l,) the greatest of the latter, 0 without siblings [m].
        gives_way: (l,) bool, a stop line lies before the lane. Rivals without one have the right of way.
        joins: pairs of lanes that become one at a small angle; they are no rivals.
    """

    def __init__(self, roads: Roads) -> None:
        self.roads = roads
        curvature = _curvature(roads)
        self.limit_speed, self.bend_speed = _safe_speeds(roads, curvature)
        self.safe_speed = np.fmin(self.limit_speed, self.bend_speed)
        reach = foresight(self.safe_speed, USUAL_REACTION)
        figures = (_foresee(roads, np.square(speed), reach) for speed in (self.limit_speed, self.bend_speed))
        self.speeds_ahead = np.stack([roads.s, *(each for three in figures for each in three)], axis=1)
        self.legs = _legs(roads)
        self.onward = _onward(roads)
        pairs = _overlaps(roads, curvature)
        is_sibling = _start_together(roads, pairs.lane, pairs.other)
        num = len(roads)
        self.siblings = make_links(num, pairs.lane[is_sibling], pairs.other[is_sibling], pairs.to_s[is_sibling])
        self.shared = np.zeros(num)
        np.maximum.at(self.shared, pairs.lane[is_sibling], pairs.to_s[is_sibling])
        self.gives_way = np.zeros(num, dtype=bool)
        self.gives_way[roads.successor[roads.is_stop[roads.predecessor]]] = True
        self.joins = find_joins(
            roads, self.gives_way, pairs.lane, pairs.other, pairs.from_s, pairs.to_s, pairs.other_to_s
        )
        rival = ~is_sibling & ~_are_in_turn(roads, pairs.lane, pairs.other)
        for one, two in self.joins.lanes:
            rival &= ~(((pairs.lane == one) & (pairs.other == two)) | ((pairs.lane == two) & (pairs.other == one)))
        lane, other = pairs.lane[rival], pairs.other[rival]
        self.rivals = make_links(num, lane, other, pairs.other_to_s[rival] + TAIL_MARGIN)
        order = np.lexsort((other, lane))
        self.rival_from = pairs.from_s[rival][order]
        self.rival_passes = (pairs.is_wide[rival] & _are_one_road(roads, lane, other))[order]
        lanes = np.repeat(np.arange(num), np.diff(self.rivals.first))
        # Both orders of a pair are here, so the pairs sorted by rival and lane are the same pairs from the other side.
        self.rival_back = np.lexsort((lanes, self.rivals.other))
        yaw = roads.at(lanes, np.zeros(len(lanes)))[1] if len(lanes) else np.zeros(0)
        other_yaw = roads.at(self.rivals.other, np.zeros(len(lanes)))[1] if len(lanes) else yaw
        self.rival_right = np.sin(other_yaw - yaw) > ACROSS
        wait_point = np.full(num, np.inf)
        np.minimum.at(wait_point, lane, pairs.from_s[rival])
        self.wait_point = np.where(wait_point < AT_START, 0.0, wait_point - TAIL_MARGIN)
        self.clear_point = np.zeros(num)
        np.maximum.at(self.clear_point, lane, pairs.to_s[rival] + TAIL_MARGIN)


def make_links(num: int, lane: IntArray, other: IntArray, figure: FloatArray | None = None) -> Links:
    """Return pairs (k,) of lanes as links, sorted by lane and other; without figures these are 0."""
    order = np.lexsort((other, lane))
    first = np.searchsorted(lane[order], np.arange(num + 1)).astype(np.int64)
    return Links(first, other[order], np.zeros(len(order)) if figure is None else figure[order])


# Safe speeds


def _curvature(roads: Roads) -> FloatArray:
    """Return the curvature of the line at each point, (n,) [1/m]: of the circle through three places of the line."""
    lane = roads.lane_of_point
    if not len(lane):
        return np.zeros(0)
    to_next = np.diff(roads.s, append=0.0)
    to_next[roads.first[1:] - 1] = np.inf
    to_last = np.roll(to_next, 1)
    to_last[roads.first[:-1]] = np.inf
    reach = np.minimum(np.clip(np.minimum(to_last, to_next), BEND, MAX_BEND), 0.5 * roads.length[lane])
    middle = np.clip(roads.s, reach, roads.length[lane] - reach)
    a, b, c = (roads.at(lane, middle + offset)[0][:, :2] for offset in (-reach, 0.0 * reach, reach))
    ab, bc, ac = b - a, c - b, c - a
    area = np.abs(ab[:, 0] * bc[:, 1] - ab[:, 1] * bc[:, 0])
    return np.asarray(2.0 * area / np.maximum(np.hypot(*ab.T) * np.hypot(*bc.T) * np.hypot(*ac.T), 1e-9))


def _safe_speeds(roads: Roads, curvature: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return `LaneConflicts.limit_speed` and `bend_speed`; `curvature` is (n,), at each point of the roads [1/m]."""
    limit = np.where(roads.speed_limit > 0.0, roads.speed_limit, DEFAULT_SPEED_LIMIT)[roads.lane_of_point]
    bend = np.fmin(np.fmax(np.sqrt(MAX_LATERAL / np.maximum(curvature, 1e-9)), MIN_SAFE_SPEED), MAX_BEND_SPEED)
    return _braking_before(roads, limit), _braking_before(roads, bend)


def foresight(speed: FloatArray, reaction: FloatArray | float) -> FloatArray:
    """Return how far ahead drivers heed limits and bends, (k,) [m].

    Speeds follow with a delay, so drivers act so much earlier.

    Args:
        speed: (k,) [m/s].
        reaction: (k,) time constant of the acceleration [s].
    """
    return np.asarray(speed * (FORESIGHT + reaction) + TURNS_AHEAD)


def _foresee(roads: Roads, value: FloatArray, reach: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values at the points of the roads with two figures of each, (n,); see `LaneConflicts.speeds_ahead`.

    Args:
        value: (n,) at the points.
        reach: (n,) how far ahead it counts [m].
    """
    if not len(value):
        return value, value, value
    lane = roads.lane_of_point
    end = roads.base[lane] + np.fmin(roads.s + reach, roads.length[lane])
    point = np.arange(len(value))
    beyond = np.fmax(roads.chain.searchsorted(end, side="right"), point + 1)
    least = np.minimum.reduceat(np.append(value, np.inf), np.stack([point, beyond], axis=1).ravel())[::2]
    least = np.fmin(least, np.interp(end, roads.chain, value))
    slope = np.zeros(len(value))
    at = (np.diff(roads.s) > 0.0).nonzero()[0]
    slope[at] = np.diff(least)[at] / np.diff(roads.s)[at]
    return value, least, slope


def _braking_before(roads: Roads, speed: FloatArray) -> FloatArray:
    """Return speeds at the points of the roads, (n,), low enough to brake with `COMFORT` to those that come [m/s].

    Args:
        lane: (n,) int64, the lane of each point.
        speed: (n,) the greatest speed at each point [m/s].
    """
    if not len(speed):
        return speed
    square = np.square(speed)
    # Slow enough for all that follows on the lane: v^2 + 2 b s never rises backwards. The lanes are set apart on the
    # scale by more than any speed amounts to, so that one sweep does for all lanes.
    along = 2.0 * COMFORT * roads.s
    apart = (1.0 + square.max() + along.max()) * roads.lane_of_point
    lowest = np.minimum.accumulate((square + along + apart)[::-1])[::-1] - apart
    return np.asarray(np.sqrt(np.maximum(lowest - along, 0.0)))


def _legs(roads: Roads) -> FloatArray:
    """Return `LaneConflicts.legs`."""
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
    """Return `LaneConflicts.onward`."""
    lane, other = roads.predecessor, roads.successor
    is_open = np.ones(len(roads), dtype=bool)
    while True:  # from the dead ends backwards: at most once for each lane, usually a few times
        leads_on = _spread(roads, np.bincount(lane[is_open[other]], minlength=len(roads)) > 0)
        if not (is_open & ~leads_on).any():
            break
        is_open &= leads_on
    keeps = is_open[other] | ~is_open[lane]
    return make_links(len(roads), lane[keeps], other[keeps])


def _spread(roads: Roads, leads_on: BoolArray) -> BoolArray:
    """Return (l,) which lanes lead on, if one changes lanes; `leads_on` is (l,), which do so without."""
    while True:  # once for each lane of the widest road
        wider = leads_on.copy()
        for beside in (roads.left, roads.right):
            wider |= (beside >= 0) & leads_on[beside]
        if (wider == leads_on).all():
            return wider
        leads_on = wider


# Conflicts


class _Pairs(Record, eq=False):
    """Lanes that come near each other, each pair in both orders; (k,) each.

    Attributes:
        lane, other: int64, rows of the lanes.
        from_s, to_s: arc lengths on `lane` between which they are near [m].
        other_to_s: arc length on `other` up to which they are near [m].
        is_wide: bool, cars can pass each other there.
    """

    lane: IntArray
    other: IntArray
    from_s: FloatArray
    to_s: FloatArray
    other_to_s: FloatArray
    is_wide: BoolArray


def _overlaps(roads: Roads, curvature: FloatArray) -> _Pairs:
    """Return the pairs of lanes that come near each other; arguments as for `_safe_speeds`."""
    count = np.maximum(np.ceil(roads.length / SAMPLE).astype(np.int64), 1) + 1
    lane = np.repeat(np.arange(len(roads), dtype=np.int64), count)
    share = ranges(np.zeros_like(count), count) / np.repeat(count - 1, count)
    s = share * roads.length[lane]
    place = roads.at(lane, s)[0] if len(lane) else np.zeros((0, 3))
    # The greater curvature of the two points beside each place: the tip of a corner must not be lost between them.
    point = roads.locate(lane, s)[0] if len(lane) else np.zeros(0, dtype=np.int64)
    swing = SWING * np.maximum(curvature[point], curvature[point + 1]) if len(lane) else np.zeros(0)
    found = [np.zeros((5, 0))]
    for i, j in _near(place[:, :2]):
        apart, both = place[i] - place[j], swing[i] + swing[j]
        clear = np.minimum(CLEAR + both, MAX_CLEAR)
        square = np.square(apart[:, :2]).sum(axis=1)
        is_near = (square < clear * clear) & (np.abs(apart[:, 2]) < BRIDGE)
        is_near &= lane[i] != lane[j]
        wide = square >= np.square(CLEAR + CAR_SWING / SWING * both)
        i, j = i[is_near], j[is_near]  # noqa: PLW2901  # the few that are left
        # The end of one lane near the start of the other only means that they follow one another.
        is_turn = (s[i] > roads.length[lane[i]] - MAX_CLEAR) & (s[j] < MAX_CLEAR)
        is_turn |= (s[j] > roads.length[lane[j]] - MAX_CLEAR) & (s[i] < MAX_CLEAR)
        i, j = i[~is_turn], j[~is_turn]  # noqa: PLW2901  # as before
        wide = wide[is_near][~is_turn]
        found += [np.stack((lane[i], lane[j], s[i], s[j], wide)), np.stack((lane[j], lane[i], s[j], s[i], wide))]
    lanes, others, on_lane, on_other, is_wide = np.concatenate(found, axis=1)
    key = lanes.astype(np.int64) * len(roads) + others.astype(np.int64)
    order = np.argsort(key, kind="stable")
    key, on_lane, on_other, is_wide = key[order], on_lane[order], on_other[order], is_wide[order]
    start = np.diff(key, prepend=-1).nonzero()[0]
    if not len(start):
        empty, none = np.zeros(0), np.zeros(0, dtype=np.int64)
        return _Pairs(none, none, empty, empty, empty, none.astype(bool))
    lower, upper = np.minimum.reduceat(on_lane, start), np.maximum.reduceat(on_lane, start)
    other_upper, all_wide = np.maximum.reduceat(on_other, start), np.minimum.reduceat(is_wide, start) > 0.0
    return _Pairs(key[start] // len(roads), key[start] % len(roads), lower, upper, other_upper, all_wide)


def _near(place: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield pairs of places (n, 2) that may be nearer than `MAX_CLEAR`, as indices, each pair once, in portions."""
    if not len(place):
        return
    cell = np.floor((place - place.min(axis=0)) / MAX_CLEAR).astype(np.int64) + 1
    rows = int(cell[:, 1].max()) + 3
    key = cell[:, 0] * rows + cell[:, 1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    index = np.arange(len(key))
    # The rest of the same cell and the cell north of it; then the three cells east, which are neighbours on the scale.
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
    """Return for pairs of lanes (k,) whether one follows the other, or one may change from one to the other."""
    num, before, after = len(roads), roads.predecessor, roads.successor
    known = np.concatenate([before * num + after, after * num + before])
    is_beside = (roads.left[lane] == other) | (roads.right[lane] == other)
    is_beside |= (roads.left[other] == lane) | (roads.right[other] == lane)  # in maps that name it on one side only
    return np.asarray(is_among(lane * num + other, known) | is_beside)


def _are_one_road(roads: Roads, lane: IntArray, other: IntArray) -> BoolArray:
    """Return for pairs of lanes (k,) whether they are the two directions of a road outside of crossings."""
    is_one: BoolArray = (roads.length[lane] > AT_START) & (roads.length[other] > AT_START)
    if len(lane):
        every = np.arange(len(roads), dtype=np.int64)
        (start, yaw), (end, end_yaw) = roads.at(every, 0.0 * roads.length), roads.at(every, roads.length)
        for one, two in ((lane, other), (other, lane)):
            is_one &= np.hypot(*(start[one] - end[two])[:, :2].T) < ROAD_WIDTH
            is_one &= np.abs(wrap_angle(yaw[one] - end_yaw[two])) > math.pi - ONCOMING
    return is_one


def _start_together(roads: Roads, lane: IntArray, other: IntArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return for pairs of lanes (k,) whether they begin at one place in one direction."""
    if not len(lane):
        return np.zeros(0, dtype=bool)
    every = np.arange(len(roads), dtype=np.int64)
    start, yaw = roads.at(every, np.zeros(len(every)))
    apart = np.hypot(*(start[lane] - start[other])[:, :2].T)
    return np.asarray((apart < 0.1) & (np.abs(wrap_angle(yaw[lane] - yaw[other])) < math.pi / 3))  # noqa: PLR2004
