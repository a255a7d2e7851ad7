"""Places by a road's own measures, for maps whose format has roads: id, distance along the road, lane, offset.

OpenSCENARIO's lane and road positions are of this kind. The map's lanes know nothing of roads; this table does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads

BEYOND: Final = 0.5
"""A place that is this far beyond the ends of a road or a lane is at its end [m]: files are rounded."""


class RoadPlace(Record):
    """A place on a lane of the map.

    Attributes:
        lane: row of the lane.
        s: arc length on it [m].
        offset: to the left of the lane's line, as the lane is driven [m].
        x, y, z: map frame [m].
        yaw: direction in which the lane is driven [rad].
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


class RoadSpan(Record, eq=False):
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
        """Whether the lane is driven along the road."""
        return bool(self.s[-1] > self.s[0])


class RoadPositions:
    """The lanes of a map by road.

    Attributes:
        spans: for each lane of the map, in its order.
    """

    def __init__(self, roads: Roads, spans: Sequence[RoadSpan]) -> None:
        self._roads, self.spans = roads, tuple(spans)
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
            offset: from the lane's middle, to the left as seen along the road [m].

        Returns:
            None where the road has no such lane.
        """
        found = self._nearest(self._rows.get(road, {}).get(lane, ()), s)
        return None if found is None else self._place(found, s, offset)

    def on_road(self, road: str, s: float, t: float) -> RoadPlace | None:
        """Return a place beside a road's reference line.

        Args:
            s: distance along the road [m].
            t: distance to the left of the reference line [m].

        Returns:
            The place, on the lane whose middle is nearest; None where the road has no lanes.
        """
        best: tuple[float, int, float] | None = None
        for own in self._rows.get(road, {}).values():
            row = self._nearest(own, s)
            if row is not None:
                away = t - self._at(self.spans[row], s, self.spans[row].aside)
                best = min(best or (math.inf, -1, 0.0), (abs(away), row, away))
        return None if best is None else self._place(best[1], s, best[2])

    def road_s(self, lane: int, s: float) -> float:
        """Return the distance along the road of a place on a lane of the map [m]."""
        part = self._points(lane)
        return float(np.interp(s, self._roads.s[part], self.spans[lane].s))

    def road_t(self, lane: int, s: float, offset: float = 0.0) -> float:
        """Return the distance to the left of the reference line of a place on a lane of the map [m]."""
        span = self.spans[lane]
        middle = float(np.interp(s, self._roads.s[self._points(lane)], span.aside))
        return middle + (offset if span.is_forward else -offset)

    def _points(self, lane: int) -> slice:
        return slice(int(self._roads.first[lane]), int(self._roads.first[lane + 1]))

    def _nearest(self, rows: Sequence[int], s: float) -> int | None:
        """Return the lane that has a place of the road, or the nearest one if it is `BEYOND` at most."""
        away = [(self._beyond(self.spans[row], s), row) for row in rows]
        best = min(away, default=(math.inf, -1))
        return best[1] if best[0] <= BEYOND else None

    @staticmethod
    def _beyond(span: RoadSpan, s: float) -> float:
        low, high = sorted((float(span.s[0]), float(span.s[-1])))
        return max(low - s, s - high, 0.0)

    @staticmethod
    def _at(span: RoadSpan, s: float, values: FloatArray) -> float:
        turned = slice(None) if span.is_forward else slice(None, None, -1)
        return float(np.interp(s, span.s[turned], values[turned]))

    def _place(self, row: int, s: float, offset: float) -> RoadPlace:
        span = self.spans[row]
        arc = self._at(span, s, self._roads.s[self._points(row)])
        (x, y, z), yaw = (each[0] for each in self._roads.at([row], [arc]))
        sign = 1.0 if span.is_forward else -1.0
        x, y = x - sign * offset * math.sin(yaw), y + sign * offset * math.cos(yaw)
        road_yaw = math.remainder(yaw + (0.0 if span.is_forward else math.pi), 2.0 * math.pi)
        return RoadPlace(row, arc, sign * offset, float(x), float(y), float(z), float(yaw), road_yaw)
