"""Places by a road's own measures, for maps whose format has roads: id, distance along the road, lane, offset.

OpenSCENARIO's lane and road positions are of this kind. The map's lanes know nothing of roads; this table does. A place
may be on any lane of the file, a sidewalk too; only those that vehicles drive on are lanes of the map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, Protocol

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads

BEYOND: Final = 0.5
"""A place that is this far beyond the ends of a road or a lane is at its end [m]: files are rounded."""


class RoadFrames(Protocol):
    """The roads of a file; the reader of the format makes them."""

    def middle(self, road: str, s: float, lane: int) -> float | None:
        """Return the distance of a lane's middle to the left of the reference line [m]; None if there is none.

        Args:
            s: distance along the road [m].
            lane: id of any lane, or 0 for the line between both sides.
        """
        ...

    def point(self, road: str, s: float, t: float) -> tuple[float, float, float, float]:
        """Return x, y, z [m] of a place beside the reference line, and the direction of the road there [rad]."""
        ...

    def is_forward(self, road: str, lane: int) -> bool:
        """Return whether a lane is driven along the road."""
        ...


class RoadPlace(Record):
    """A place on a road.

    Attributes:
        lane: row of the lane of the map that it is on or, for a sidewalk, beside; -1 if the road has none there.
        s: arc length on it [m].
        offset: to the left of the lane's line, as the lane is driven [m].
        x, y, z: map frame [m].
        yaw: direction of traffic, on the lane that was asked for [rad].
        road_yaw: direction along the road, in which its s rises [rad].
    """

    lane: int
    s: float
    offset: float
    x: float
    y: float
    z: float
    yaw: float
    road_yaw: float


class RoadSpan(Record, eq=False, gc=False):
    """A lane of the map as a part of a road.

    Attributes:
        road, lane: ids in the file.
        s: (k,) distance along the road of each point of the lane's line, rising or falling [m].
        aside: (k,) distance of the points to the left of the road's reference line [m].
    """

    road: str
    lane: int
    s: FloatArray
    aside: FloatArray

    @property
    def is_forward(self) -> bool:
        """True if vehicles drive along the road on this lane, false if against it."""
        return bool(self.s[-1] > self.s[0])


class RoadPositions:
    """The lanes of a map by road.

    Attributes:
        spans: for each lane of the map, in its order.
    """

    def __init__(self, roads: Roads, spans: Sequence[RoadSpan], frames: RoadFrames) -> None:
        self._roads, self._frames, self.spans = roads, frames, tuple(spans)
        rows: dict[str, dict[int, list[int]]] = {}
        for row, span in enumerate(spans):
            rows.setdefault(span.road, {}).setdefault(span.lane, []).append(row)
        self._rows: Mapping[str, Mapping[int, list[int]]] = rows

    def road_ids(self) -> Iterable[str]:
        """Return the ids of the roads that have lanes to drive on."""
        return self._rows.keys()

    def lane_ids(self, road: str) -> list[int]:
        """Return the ids of the lanes of a road that vehicles drive on, rising; none for an unknown road."""
        return sorted(self._rows.get(road, {}))

    def on_lane(self, road: str, s: float, lane: int, offset: float = 0.0) -> RoadPlace | None:
        """Return a place on a lane of a road.

        Args:
            s: distance along the road [m].
            lane: id of any lane of the file.
            offset: from the lane's middle, to the left as seen along the road [m].

        Returns:
            None where the road has no such lane.
        """
        middle = self._frames.middle(road, s, lane)
        return None if middle is None else self._place(road, s, middle + offset, lane)

    def on_road(self, road: str, s: float, t: float) -> RoadPlace | None:
        """Return a place beside a road's reference line.

        Args:
            s: distance along the road [m].
            t: distance to the left of the reference line [m].

        Returns:
            The place, on the lane whose middle is nearest; None where there is no such road.
        """
        return None if self._frames.middle(road, s, 0) is None else self._place(road, s, t, None)

    def road_s(self, lane: int, s: float) -> float:
        """Return the distance along the road of a place on a lane of the map [m]."""
        part = self._points(lane)
        return float(np.interp(s, self._roads.s[part], self.spans[lane].s))

    def _points(self, lane: int) -> slice:
        return slice(int(self._roads.first[lane]), int(self._roads.first[lane + 1]))

    def _find(self, road: str, s: float, t: float, lane: int | None) -> int:
        """Return the row of the given lane, or else of the one that is nearest to a place of a road; -1 for none."""
        there = self._rows.get(road, {})
        own = there.get(lane, ()) if lane is not None else ()
        for rows in (own, [row for each in there.values() for row in each]):
            near = [row for row in rows if self._beyond(self.spans[row], s) <= BEYOND]
            if near:
                return min(near, key=lambda row: (self._beyond(self.spans[row], s), abs(t - self._aside(row, s))))
        return -1

    @staticmethod
    def _beyond(span: RoadSpan, s: float) -> float:
        low, high = sorted((float(span.s[0]), float(span.s[-1])))
        return max(low - s, s - high, 0.0)

    def _aside(self, row: int, s: float) -> float:
        return self._at(row, s, self.spans[row].aside)

    def _at(self, row: int, s: float, values: FloatArray) -> float:
        """Return one of the values at a lane's points, at a place along its road."""
        span = self.spans[row]
        turned = slice(None) if span.is_forward else slice(None, None, -1)
        return float(np.interp(s, span.s[turned], values[turned]))

    def _place(self, road: str, s: float, t: float, lane: int | None) -> RoadPlace:
        x, y, z, heading = self._frames.point(road, s, t)
        row = self._find(road, s, t, lane)
        arc = offset = 0.0
        if row >= 0:
            arc = self._at(row, s, self._roads.s[self._points(row)])
            offset = (t - self._aside(row, s)) * (1.0 if self.spans[row].is_forward else -1.0)
            lane = self.spans[row].lane if lane is None else lane
        is_along = self._frames.is_forward(road, -1 if lane is None else lane)
        ahead, yaw = (math.remainder(heading + turn, 2.0 * math.pi) for turn in (0.0, 0.0 if is_along else math.pi))
        return RoadPlace(row, arc, offset, x, y, z, yaw, ahead)
