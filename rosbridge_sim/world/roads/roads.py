"""The roads of a map as lanes: which lane is here, how far along it, where it leads, which lanes lie beside it.

A lane is the smooth line through points in driving direction, see `bends`. All lanes lie end to end in one set of
arrays, so that a question about many places takes a handful of numpy calls. This module does not know where a map
comes from.

Arc length and distance are measured in the plane (east, north); the height is only carried along. On a slope of 10 %
the difference to the driven distance is 0.5 %.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from hashlib import blake2b
from typing import Any, Final, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry import bends
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, in_columns, wrap_angle
from rosbridge_sim.world.geometry.segment_search import LaneSegments, SegmentSearch

T = TypeVar("T")

Repeat: TypeAlias = "Callable[[Roads, Callable[[Roads], Any], Any], Any]"
"""Makes what copies of a map's lanes have of what the map has; see `Roads.copies`."""

LEVEL: Final = 2.5
"""An entity that is farther than this above or below a lane is on another level [m]: bridges have a clearance of 4.5 m
and more, and the ground within a few metres of a lane is not steeper than this."""


_GIVEN: Final = (
    *("ids", "points", "first", "width", "speed_limit", "left", "right", "is_stop", "border", "bank"),
    *("first_successor", "successor", "digest"),
)
"""Attributes that a pickle of a map has: all others follow from them, and may be 20 times as large."""


class LanePlaces(Record, eq=False):
    """Places of points relative to a lane near each; (n,) each, one entry for each point.

    Attributes:
        lane: int64, row of the lane; -1 where there is no road at all (the rest is then 0, `distance` inf).
        s: arc length from the lane's start to the foot point [m].
        lateral: offset from the lane's line, left positive [m].
        distance: to the foot point; more than |lateral| beyond a lane's end [m].
        yaw: direction of the lane at the foot point, counter-clockwise from east, (-pi, pi] [rad].
    """

    lane: IntArray
    s: FloatArray
    lateral: FloatArray
    distance: FloatArray
    yaw: FloatArray


class Roads:
    """All lanes of a map, end to end; never changed after it is made.

    Attributes:
        ids: (l,) names of the lanes, as the map gives them.
        points: (n, 3) float64, the lanes' lines one after the other, east, north, up [m].
        first: (l + 1,) int64; lane `i` has the points `first[i]:first[i + 1]`, two or more.
        s: (n,) arc length of each point from its lane's start [m].
        curve: (n, 2) figures of the smooth line from each point to the next one, see `bends.leg_curves`; 0 at the last
            points of lanes.
        length: (l,) [m].
        width: (l,) [m].
        speed_limit: (l,) [m/s]; 0 where none is given.
        turn: (l,) angle by which the lane turns from its start to its end, left positive; more than pi for a loop
            [rad].
        left, right: (l,) int64, rows of the lanes beside that one may change into; -1 where there is none.
        is_stop: (l,) bool, a stop line lies across the lane's end.
        border: (n, 2) distances of the lane's edges to the left and to the right of each point; half a width where the
            map does not say [m].
        bank: (n, 2) rise across the lane for each metre to the left, in its left and its right half, at each point; 0
            where the map does not say.
        has_long_legs: whether smooth lines are so much longer than their legs that it matters, see `bends.is_longer`.
        last_leg, legs_per_metre: (l,) int64, the point before the last one of each lane; and its legs a metre [1/m].
        leg_end_of, segment_of_point: (n,) arc length of the next point, 0 at the last ones of lanes [m]; int64, the row
            of the segment that begins at each point.
        is_flat: whether all of it has one height.
        segments: the straight segments of all lanes.
        first_successor, successor: (l + 1,) and (k,) int64; `successor[first_successor[i]:first_successor[i + 1]]`
            are the rows of the lanes that begin where lane `i` ends.
        lane_of_point, predecessor: (n,) and (k,) int64, the lanes of `points`, and the lanes that `successor` follow.
        base, chain: (l,) and (n,) one scale for all lanes: the place `s` on lane `i` is `base[i] + s`. `chain` has the
            points' places, rising. Between two lanes there is an unused metre [m].
        digest: 16 bytes that stand for all of it.
        search: finds segments by place; None without lanes.
        kept: results of `derived`.
        repeat: makes those of copies; None for a map.
        scale_of_lane: (l,) int64, which copy of the map a lane is in, see `copies`; None for a map.
        num_copies: how often each lane of the map is there; 1 for a map.
        alone: the lanes of one copy: these roads, if they are a map.
    """

    def __init__(
        self,
        ids: Sequence[str] = (),
        lines: Sequence[FloatArray] = (),
        successors: Sequence[Sequence[int]] = (),
        width: Sequence[float] = (),
        speed_limit: Sequence[float] = (),
        *,
        left: Sequence[int] | None = None,
        right: Sequence[int] | None = None,
        is_stop: Sequence[bool] | None = None,
        borders: Mapping[int, FloatArray] | None = None,
        banks: Mapping[int, FloatArray] | None = None,
    ) -> None:
        """Make the lanes; without arguments, a map without roads.

        Args:
            ids: for each lane its name, all different.
            lines: for each lane (k, 3) points in driving direction, finite [m]. Repeated points are left out.
            successors: for each lane the rows of the lanes that go on where it ends.
            width: for each lane its width [m].
            speed_limit: for each lane its speed limit, 0 where none is given [m/s].
            left: for each lane the row of the lane to its left, or -1; None for no such lanes.
            right: for each lane the row of the lane to its right, or -1; None for no such lanes.
            is_stop: for each lane whether it ends at a stop line; None for no stop lines.
            borders: for some lanes (k, 2) the distances to the left and the right edge at each point of the line [m].
            banks: for some lanes (k, 2) the `bank` at each point of the line.

        Raises:
            ValueError: the arguments differ in length, a name comes twice or a line has no length.
        """
        if not len(ids) == len(lines) == len(successors) == len(width) == len(speed_limit):
            raise ValueError("expected a name, a line, successors, a width and a speed limit for every lane")
        num = len(ids)
        self.left = np.array([-1] * num if left is None else left, dtype=np.int64)
        self.right = np.array([-1] * num if right is None else right, dtype=np.int64)
        self.is_stop = np.array([False] * num if is_stop is None else is_stop, dtype=bool)
        if not len(self.left) == len(self.right) == len(self.is_stop) == num:
            raise ValueError("left, right and is_stop: expected one value for each lane")
        self.ids = tuple(ids)
        if len(set(self.ids)) != num:
            raise ValueError("ids: expected different names, but two lanes have the same one")
        # All lines at once: a call of numpy for each lane would hold up other threads, lane after lane.
        points = np.concatenate([np.zeros((0, 3)), *lines])
        lane = np.arange(num).repeat([len(line) for line in lines])
        is_new = np.ones(len(points), dtype=bool)
        is_new[1:] = (points[1:, :2] != points[:-1, :2]).any(axis=1) | (lane[1:] != lane[:-1])
        count = np.bincount(lane[is_new], minlength=num)
        short = (count < 2).nonzero()[0]  # noqa: PLR2004 - a line's two ends
        if len(short):
            raise ValueError(f"lane {self.ids[short[0]]!r} has no length")
        self.points = points[is_new]
        self.first = np.append(0, count.cumsum())
        self.width = np.array(width, dtype=np.float64)
        self.speed_limit = np.array(speed_limit, dtype=np.float64)
        self.first_successor = np.concatenate([[0], np.cumsum([len(row) for row in successors])]).astype(np.int64)
        self.successor = np.array([lane for row in successors for lane in row], dtype=np.int64)
        self.border = (0.5 * self.width).repeat(count)[:, None].repeat(2, axis=1)
        self.bank = np.zeros((len(self.points), 2))
        for column, tables in ((self.border, borders), (self.bank, banks)):
            if tables:
                is_told = np.isin(lane, list(tables))
                column[is_told[is_new]] = np.concatenate([tables[row] for row in sorted(tables)])[is_new[is_told]]
        self.digest = self._hash()
        self._derive()

    def __len__(self) -> int:
        return len(self.width)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a map was made of, for a copy or a pickle."""
        if self.num_copies > 1:
            raise TypeError("copies of a map's lanes cannot be pickled: pickle the map, `alone`")
        return {name: getattr(self, name) for name in _GIVEN}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Become the map that `__getstate__` has told of."""
        vars(self).update(state)
        self._derive()

    def copies(self, num: int, search: SegmentSearch | None, repeat: Repeat) -> Roads:
        """Return the lanes of a map once for each of some worlds: row w * l + i is lane i in world w, of l lanes.

        Points, lines and all that is searched by place are those of the map, shared. What is kept for each lane is
        repeated, so that drivers of different worlds never have a lane in common. The lines are not shifted: that would
        change rounding. `nearest`, `within` and `find_segments` return lanes of the map; `left`, `right`, `is_stop`
        and the successors are those of the map, too.

        Args:
            num: number of worlds.
            search: of the segments.
            repeat: returns `derived` of the copies, of the function and of what it has made of the map.
        """
        many = Roads.__new__(Roads)
        vars(many).update(vars(self))
        many.num_copies = num
        many.search, many.repeat, many.kept = search, repeat, {}
        many.scale_of_lane = np.arange(num).repeat(len(self))
        for name in ("length", "width", "speed_limit", "turn", "base", "last_leg", "legs_per_metre"):
            setattr(many, name, np.tile(getattr(self, name), num))
        many.first = np.append(np.tile(self.first[:-1], num), len(self.points))
        return many

    def in_map(self, lane: IntArray) -> IntArray:
        """Return rows of lanes as rows of `alone`; -1 stays -1."""
        return lane if self.num_copies == 1 else np.where(lane >= 0, lane % len(self.alone), -1)

    def row(self, name: str) -> int:
        """Return the row of the lane with this name.

        Raises:
            KeyError: there is no such lane.
        """
        return self._rows[name]

    def successors(self, lane: int) -> IntArray:
        """Return the lanes that begin where a lane ends.

        Returns:
            (k,) int64, rows in the map's order; empty at a dead end.
        """
        world, lane = divmod(lane, len(self.alone))
        found = self.successor[self.first_successor[lane] : self.first_successor[lane + 1]]
        return found + world * len(self.alone) if world else found

    def derived(self, make: Callable[[Roads], T]) -> T:
        """Return `make(roads)`, made at the first call and kept. For copies, it is that of the map, repeated."""
        value: T | None = self.kept.get(make)  # the key says what the value is
        if value is None:
            value = make(self) if self.repeat is None else self.repeat(self, make, self.alone.derived(make))
            self.kept[make] = value
        return value

    def at(self, lane: npt.ArrayLike, s: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return points on lanes.

        Args:
            lane: (n,) rows of lanes.
            s: (n,) arc lengths, held within the lane [m].

        Returns:
            (n, 3) points east, north, up [m] and (n,) the lanes' directions there, (-pi, pi] [rad].
        """
        if not isinstance(lane, np.ndarray) or lane.ndim == 0:
            lane = np.atleast_1d(np.asarray(lane, dtype=np.int64))
        return self.between(*self.locate(lane, np.asarray(s, dtype=np.float64)))

    def between(self, point: IntArray, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what `at` returns, for places as `locate` returns them."""
        curve, segment = self.curve.take(point, axis=0), self.segment_of_point[point]
        yaw = self.segments.angle[segment]
        if np.count_nonzero(curve):
            length = self.segments.length[segment]
            yaw = wrap_angle(yaw + np.arctan(bends.slope(curve, share * length, length)))
        return self.places(point, share), yaw

    def places(self, point: IntArray, share: FloatArray) -> FloatArray:
        """Return the points alone that `between` returns, (n, 3) [m], without their directions."""
        start, curve = self.points.take(point, axis=0), self.curve.take(point, axis=0)
        step = self.points.take(point + 1, axis=0) - start
        place = start + share[:, None] * step
        if np.count_nonzero(curve):
            length = self.segments.length[self.segment_of_point[point]]
            aside = bends.offset(curve, share * length, length) / length
            place[:, 0] -= aside * step[:, 1]
            place[:, 1] += aside * step[:, 0]
        return np.asarray(place)

    def beside(self, places: LanePlaces) -> tuple[FloatArray, FloatArray]:
        """Return how far the edges of their lanes are from given places.

        Args:
            places: from `nearest`.

        Returns:
            (n,) to the left edge and (n,) to the right one, negative beyond it; inf where there is no lane [m].
        """
        far = np.full(len(places.lane), np.inf)
        if len(self) == 0:
            return far, far.copy()
        return self.edges(*self.locate(places.lane, places.s), places.lateral)

    def edges(self, point: IntArray, share: FloatArray, lateral: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what `beside` returns, for places as `locate` returns them and offsets to the left of the line [m]."""
        border = self.border.take(point, axis=0)
        border += share[:, None] * (self.border.take(point + 1, axis=0) - border)
        return border[:, 0] - lateral, border[:, 1] + lateral

    def edge_lines(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the edges of the lanes as lines, for drawings.

        Returns:
            (n, 3) the left edge beside each of `points`, at its height, (n, 3) the right one [m], and (n, 2) unit
            vectors along the lane: those of the chord from the point before to the one behind.
        """
        points, n = self.points, len(self.points)
        before, after = np.arange(n) - 1, np.arange(n) + 1
        before[self.first[:-1]] += 1
        after[self.first[1:] - 1] -= 1
        ahead = points[after, :2] - points[before, :2]
        ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)[:, None]
        across = np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(n)], axis=-1)
        return points + self.border[:, :1] * across, points - self.border[:, 1:] * across, ahead

    def locate(self, lane: IntArray, s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return between which points of the roads given places lie.

        Args:
            lane: (n,) rows of lanes.
            s: (n,) arc lengths, held within the lane [m].

        Returns:
            (n,) int64, the row of the point before each place, and (n,) the share of the distance from it to the next
            point, 0..1.
        """
        s = np.fmin(np.fmax(s, 0.0), self.length[lane])
        first, last = self.first[lane], self.last_leg[lane]
        # Most lanes have their points at equal distances: then the place is known without a search.
        point = np.minimum(first + (s * self.legs_per_metre[lane]).astype(np.int64), last)
        start = self.s[point]
        at = ((s < start) | (s >= self.leg_end_of[point])).nonzero()[0]
        if len(at):
            found = self.chain.searchsorted(self.base[lane[at]] + s[at], side="right") - 1
            point[at] = np.minimum(np.maximum(found, first[at]), last[at])
            start = self.s[point]
        return point, (s - start) / self.segments.length[self.segment_of_point[point]]

    def nearest(
        self, x: npt.ArrayLike, y: npt.ArrayLike, yaw: npt.ArrayLike | None = None, z: npt.ArrayLike | None = None
    ) -> LanePlaces:
        """Return the lane nearest to each point, and the place on it.

        Args:
            x: (n,) east, finite [m].
            y: (n,) north, finite [m].
            yaw: (n,) headings [rad]; when given, lanes of another direction count as farther away
                (`segment_search.TURN_COST`).
            z: (n,) heights; when given, lanes above and below count as farther away (`segment_search.HEIGHT_COST`)
                [m]. On a flat map it makes no difference.

        Returns:
            (n,) places. Of equally near lanes the first in the map's order.
        """
        x, y = np.atleast_1d(np.asarray(x, np.float64)), np.atleast_1d(np.asarray(y, np.float64))
        if x.shape != y.shape:
            x, y = np.broadcast_arrays(x, y)
        place = in_columns(x, y)
        n = len(place)
        if self.search is None or n == 0:
            zero = np.zeros(n)
            return LanePlaces(np.full(n, -1, dtype=np.int64), zero, zero.copy(), np.full(n, np.inf), zero.copy())
        heading = None
        if yaw is not None:
            angle = np.asarray(yaw, dtype=np.float64)
            if angle.shape != (n,):
                angle = np.broadcast_to(angle, (n,))
            heading = in_columns(np.cos(angle), np.sin(angle))
        height = None
        if z is not None and not self.is_flat:
            height = np.broadcast_to(np.asarray(z, dtype=np.float64), (n,))
        return self._places(*self.search.place(place, heading, height))

    def find_segments(self, place: FloatArray, height: FloatArray) -> IntArray:
        """Return the nearest segment for each place, (n,) int64, rows of `segments`.

        Args:
            place: (n, 2) east and north, n >= 1 [m].
            height: (n,) segments above and below count as farther away [m].

        Raises:
            ValueError: there are no lanes.
        """
        if self.search is None:
            raise ValueError("expected roads with at least one lane")
        return self.search.nearest(place, None, height)

    def are_level(self, places: LanePlaces, z: FloatArray) -> BoolArray:
        """Return (n,) whether places on lanes are on the level of given heights, not on a bridge above or below it.

        Args:
            z: (n,) heights [m].
        """
        point, share = self.locate(places.lane, places.s)
        height = self.points[:, 2]
        return np.asarray(np.abs(height[point] + share * (height[point + 1] - height[point]) - z) < LEVEL)

    def within(self, x: FloatArray, y: FloatArray, radius: FloatArray) -> tuple[IntArray, LanePlaces]:
        """Return all lanes near each point. A point beyond the ends of a lane is not near it.

        Args:
            x: (n,) east, finite [m].
            y: (n,) north, finite [m].
            radius: (n,) how near [m].

        Returns:
            (m,) int64, index of the point, rising; and (m,) places, those of one point in the map's order. Of crowds
            beyond `segment_search.MAX_SEGMENTS` not all points are looked at.
        """
        place = in_columns(x, y)
        if self.search is None or len(place) == 0:
            none, empty = np.zeros(0, dtype=np.int64), np.zeros(0)
            return none, LanePlaces(none, empty, empty, empty, empty)
        owner, segment, projected = self.search.within(place, radius)
        return owner, self._places(segment, *projected)

    def clearance(self, x: FloatArray, y: FloatArray, most: FloatArray) -> FloatArray:
        """Return how far points are from the segments of all lanes, (n,), but at most `most`; all are (n,) [m].

        Nobody is nearer than that. It is 0 where too many segments are near.
        """
        place = in_columns(x, y)
        return most if self.search is None or len(place) == 0 else self.search.clearance(place, most)

    def _places(self, segment: IntArray, along: FloatArray, lateral: FloatArray, distance: FloatArray) -> LanePlaces:
        """Return the places of points relative to the segments chosen for them; (n,) each, see `project`."""
        segments = self.segments
        point, yaw = segments.point[segment], segments.angle[segment]
        s, curve = self.s[point] + along, self.curve.take(point, axis=0)
        if np.count_nonzero(curve):
            length = segments.length[segment]
            beyond = distance - np.abs(lateral)
            lateral = lateral - bends.offset(curve, along, length)
            distance = np.abs(lateral) + beyond
            yaw = wrap_angle(yaw + np.arctan(bends.slope(curve, along, length)))
        return LanePlaces(segments.lane[segment], s, lateral, distance, yaw)

    def _derive(self) -> None:
        """Work out all that follows from what was given."""
        num, count = len(self), np.diff(self.first)
        self.scale_of_lane: IntArray | None = None
        self.num_copies = 1
        self.alone: Roads = self
        self.repeat: Repeat | None = None
        self._rows = {name: i for i, name in enumerate(self.ids)}
        self.lane_of_point = np.arange(num).repeat(count)
        self.predecessor = np.arange(num).repeat(np.diff(self.first_successor))
        height = self.points[:, 2]
        self.is_flat = not self.bank.any() and not (height != height[:1]).any()
        self._measure()
        self.search = SegmentSearch(self.segments, num) if num else None
        self.kept: dict[object, Any] = {}

    def _measure(self) -> None:
        """Work out segments, arc lengths and turns."""
        is_last = np.zeros(len(self.points), dtype=bool)
        is_last[self.first[1:] - 1] = True
        point = (~is_last).nonzero()[0]
        lane = self.lane_of_point[point]
        start, end = self.points[point, :2], self.points[point + 1, :2]
        step = end - start
        length = np.hypot(step[:, 0], step[:, 1])
        height = self.points[:, 2]
        slope = (height[point + 1] - height[point]) / length
        self.curve = np.zeros((len(self.points), 2))
        self.has_long_legs = False
        if len(lane):
            head, tail = bends.end_angles(self.points, self.first)
            self.curve[point] = bends.leg_curves(length, head, tail)
            self.has_long_legs = bends.is_longer(length, head, tail)
        direction = step / length[:, None]
        angle = np.arctan2(direction[:, 1], direction[:, 0])
        self.segments = LaneSegments(lane, point, start, end, length, direction, angle, height[point], slope)

        # One rising scale for all lanes, with an unused metre between two of them: a single search serves them all.
        gap = np.ones(len(self.points))
        gap[point] = length
        chain_end = np.cumsum(gap)
        self.chain = chain_end - gap
        self.base = self.chain[self.first[:-1]]
        self.s = self.chain - self.base[self.lane_of_point]
        self.length: FloatArray = self.s[self.first[1:] - 1]
        self.last_leg = self.first[1:] - 2
        self.leg_end_of = np.append(self.s[1:], 0.0)
        self.segment_of_point = np.cumsum(~is_last) - 1
        num_legs = (self.last_leg + 1 - self.first[:-1]).astype(np.float64)
        # A lane of a nanometre behind many kilometres of lanes has no length here.
        self.legs_per_metre = np.divide(num_legs, self.length, out=num_legs, where=self.length > 0.0)

        yaw = self.segments.yaw(np.arange(len(lane)))
        bend = np.where(lane[1:] == lane[:-1], wrap_angle(np.diff(yaw)), 0.0)
        self.turn = np.bincount(lane[1:], weights=bend, minlength=len(self))

    def _hash(self) -> bytes:
        state = blake2b(repr(self.ids).encode(), digest_size=16)
        columns = (self.points, self.border, self.first, self.width, self.speed_limit, self.left, self.right)
        for column in (*columns, self.is_stop, self.first_successor, self.successor):
            state.update(np.ascontiguousarray(column).data)  # not copied: many points would keep other threads waiting
        if np.count_nonzero(self.bank):
            state.update(self.bank.tobytes())
        return state.digest()
