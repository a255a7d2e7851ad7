"""Lanes of an OpenDRIVE road as lines: places along the road, edges of all its lanes, lanes and painted lines.

A section of lanes is laid out at *stations*, which are places along the road: where any record begins, and as close
together between these as bends and polynomials need. A section is cut into *pieces* where its lanes change in a way
that the simulator's lanes cannot (a speed limit, a stop line). A piece of a lane becomes a lane of the map, in driving
direction. Sources: ASAM OpenDRIVE 1.8, sections 9 to 11.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import numpy as np

from rosbridge_sim.maps.opendrive.plan_view import SHORT, evaluate, place_on
from rosbridge_sim.maps.opendrive.road_elements import (
    MAX_COORDINATE,
    MAX_LENGTH,
    ROADWAY,
    LaneSection,
    Road,
    RoadMark,
    error_of,
)
from rosbridge_sim.maps.road_map import Border
from rosbridge_sim.records import Record, replace
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray

BEND_STEP: Final = 0.5
"""Distance of stations in bends [m], as between the points of MORAI's maps."""

LONGEST_STEP: Final = 5.0
"""Distance of stations where all is straight [m]."""

FLATNESS: Final = 1e-3
"""Lines between stations are nearer than this to what the polynomials say [m]."""

NARROW: Final = 0.5
"""A lane begins and ends where it is as wide as this [m]: the middle of a lane of no width is the edge of its
neighbour, where no vehicle can follow it."""

NEAR_CUT: Final = 1.0
"""Pieces are longer than this [m]."""

MAX_STATIONS: Final = 2_000_000
"""Stations of a road: 1,000 km of bends."""

MAX_TILT: Final = 0.5
"""Greatest superelevation [rad]."""


class LanePiece(Record, eq=False, gc=False):
    """A lane of the map.

    Attributes:
        road: id.
        section: number of the section in its road.
        lane: id.
        piece: number of the piece in its section, from 0.
        name: `ROAD.SECTION.LANE`, and `.PIECE` for pieces after the first one.
        is_forward: it is driven along the road.
        is_cut: bool, it begins or ends, in driving direction, away from the end of its section, because it is narrow.
        line: (k, 3) its middle in driving direction [m].
        s: (k,) distance along the road of each point [m].
        aside: (k,) distance of each point to the left of the reference line [m].
        border: (k, 2) distances of its edges [m].
        bank: (k, 2) rise to the left for each metre; None for none.
        width: in its middle [m].
        speed_limit: 0 for none [m/s].
    """

    road: str
    section: int
    lane: int
    piece: int
    name: str
    is_forward: bool
    is_cut: tuple[bool, bool]
    line: FloatArray
    s: FloatArray
    aside: FloatArray
    border: FloatArray
    bank: FloatArray | None
    width: float
    speed_limit: float


class SectionLayout:
    """The stations of a section and the edges of its lanes.

    Attributes:
        s: (n,) places along the road, the section's ends among them [m].
        edges: for each lane (n,) the distance of its outer edge from the reference line, left positive [m].
        widths: for each lane (n,) [m].
    """

    def __init__(self, road: Road, section: LaneSection, cuts: Iterable[float] = ()) -> None:
        """Lay out a section.

        Args:
            cuts: places along the road that become stations [m].

        Raises:
            DocumentError: it would need too many stations.
        """
        self._road = road
        self.s = s = _lay_stations(road, section, cuts)
        along = s - section.start
        self.widths = {name: evaluate(lane.widths, along) for name, lane in section.lanes.items() if name}
        for width in self.widths.values():
            np.maximum(width, 0.0, out=width)
        self.edges = {0: evaluate(road.offset, s)}
        for side in (1, -1):
            name = side
            while name in self.widths:
                self.edges[name] = self.edges[name - side] + side * self.widths[name]
                name += side
        self._x, self._y, self._heading = place_on(road.shapes, s)
        self._height = evaluate(road.elevation, s)
        self.roll = np.clip(evaluate(road.roll, s), -MAX_TILT, MAX_TILT)

    def points(self, aside: FloatArray) -> FloatArray:
        """Return points beside the reference line, (n, 3) [m].

        Args:
            aside: (n,) distances to the left, within the plane of the road [m].
        """
        flat = aside * np.cos(self.roll)
        x, y = self._x - flat * np.sin(self._heading), self._y + flat * np.cos(self._heading)
        return np.stack([x, y, self._height + aside * np.sin(self.roll)], axis=-1)

    def middle(self, lane: int) -> FloatArray:
        """Return the distance of a lane's middle from the reference line, (n,) [m]."""
        return np.asarray(0.5 * (self.edges[lane] + self.edges[lane - (1 if lane > 0 else -1)]))


def _lay_stations(road: Road, section: LaneSection, cuts: Iterable[float]) -> FloatArray:
    start, end = section.start, section.end
    shift = np.array([start, 0.0, 0.0, 0.0, 0.0])
    offsets = [lane.widths + shift for lane in section.lanes.values() if len(lane.widths)]
    cubics = [road.offset, road.elevation, *offsets]
    curved = np.array([shape.s for shape in road.shapes])
    records = [*cubics, road.roll]
    breaks = np.concatenate([curved, [start, end, *cuts], *(each[:, 0] for each in records)])
    breaks = np.unique(breaks[(breaks >= start) & (breaks <= end)])
    breaks = breaks[np.append(np.diff(breaks) > SHORT, True)]
    breaks[0] = start
    if len(breaks) < 2:  # noqa: PLR2004 - a section without length
        return np.array([start, end])
    low, high = breaks[:-1], breaks[1:]
    bends = np.array([shape.kind != "line" for shape in road.shapes])[np.searchsorted(curved, low + SHORT) - 1]
    # The second derivative of a polynomial tells how far a chord of it is away: h^2 / 8 times as much.
    bulge = np.zeros(len(low))
    for each in cubics:
        if len(each):
            rows = np.maximum(np.searchsorted(each[:, 0], low + SHORT) - 1, 0)
            c, d, away = each[rows, 3], each[rows, 4], np.stack([low, high]) - each[rows, 0]
            bulge += np.abs(2.0 * c + 6.0 * d * away).max(axis=0)
    step = np.clip(np.sqrt(8.0 * FLATNESS / np.maximum(bulge, 1e-12)), BEND_STEP, LONGEST_STEP)
    step[bends | (len(road.roll) > 0 and bool(road.roll[:, 1:].any())) | _narrow(offsets, low, high)] = BEND_STEP
    count = np.ceil((high - low) / step - SHORT).astype(np.int64)
    if count.sum() > MAX_STATIONS:
        raise error_of(road, f"a road that needs at most {MAX_STATIONS:,} points")
    parts = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(low, high, np.maximum(count, 1).tolist(), strict=True)]
    return np.concatenate([*parts, [end]])


def _narrow(widths: Iterable[FloatArray], low: FloatArray, high: FloatArray) -> BoolArray:
    """Return in which intervals a lane is narrower than `NARROW` at an end, (m,)."""
    found = np.zeros(len(low), dtype=bool)
    for each in widths:
        if each[:, 2:].any():
            for at in (low, high):
                rows = np.maximum(np.searchsorted(each[:, 0], low + SHORT) - 1, 0)
                start, a, b, c, d = each[rows].T
                away = at - start
                found |= a + away * (b + away * (c + away * d)) < NARROW
    return found


def lay_lanes(road: Road, number: int, layout: SectionLayout, cuts: Iterable[float]) -> Iterator[LanePiece]:
    """Yield the lanes of a section; those that are nowhere as wide as `NARROW` are left out.

    Args:
        number: of the section.
        layout: its layout.
        cuts: places along the road at which pieces end [m]; all are stations.

    Raises:
        DocumentError: a lane is too long or too far away.
    """
    section = road.sections[number]
    ends = np.array([section.start, *sorted(cuts), section.end])
    rows = np.searchsorted(layout.s, ends - SHORT)
    rows[-1] = len(layout.s) - 1
    for name, lane in section.lanes.items():
        if name == 0 or lane.type not in ROADWAY:
            continue
        is_forward = (name < 0) != road.is_left_hand
        line, wide = layout.points(layout.middle(name)), layout.widths[name] >= NARROW
        steps = np.hypot(*np.diff(line[:, :2], axis=0).T)
        if not (np.abs(line) <= MAX_COORDINATE).all() or steps.sum() > 2.0 * MAX_LENGTH:
            expected = f"lanes within {MAX_COORDINATE:,.0f} m and no longer than {2.0 * MAX_LENGTH:,.0f} m"
            raise error_of(road, f"{expected}; lane {name} of section {number} is not")
        wide[1:] &= steps > SHORT
        outer, inner = (layout.points(layout.edges[key]) for key in (name, name - (1 if name > 0 else -1)))
        border = _borders(line, *((outer, inner) if name > 0 else (inner, outer)))
        bank = np.tan(layout.roll)[:, None].repeat(2, axis=1) if layout.roll.any() else None
        for piece, (first, last) in enumerate(zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True)):
            own = first + np.flatnonzero(wide[first : last + 1])
            if len(own) < 2 or layout.s[own[-1]] - layout.s[own[0]] < SHORT:  # noqa: PLR2004 - a line's ends
                continue
            part = slice(int(own[0]), int(own[-1]) + 1)
            cut = (own[0] > first, own[-1] < last)
            middle = 0.5 * (layout.s[first] + layout.s[last])
            turned = slice(None) if is_forward else slice(None, None, -1)
            yield LanePiece(
                road=road.id,
                section=number,
                lane=name,
                piece=piece,
                name=f"{road.id}.{number}.{name}" + (f".{piece}" if piece else ""),
                is_forward=is_forward,
                is_cut=cut if is_forward else cut[::-1],
                line=line[part][turned],
                s=layout.s[part][turned],
                aside=layout.middle(name)[part][turned],
                border=border[part][turned] if is_forward else border[part][turned, ::-1],
                bank=None if bank is None else bank[part][turned] * (1.0 if is_forward else -1.0),
                width=float(np.interp(middle, layout.s, layout.widths[name])),
                speed_limit=find_limit(road, number, name, middle),
            )


def _borders(line: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
    """Return how far edges are from a line, across it, (n, 2) [m]; left and right as seen along it."""
    ahead = np.empty((len(line), 2))
    ahead[1:-1] = line[2:, :2] - line[:-2, :2]
    ahead[0], ahead[-1] = line[1, :2] - line[0, :2], line[-1, :2] - line[-2, :2]
    ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)[:, None]
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1)
    sides = [((edge - line)[:, :2] * across).sum(axis=1) for edge in (left, right)]
    return np.stack([np.maximum(sides[0], 0.0), np.maximum(-sides[1], 0.0)], axis=-1)


def find_limit(road: Road, number: int, lane: int, s: float) -> float:
    """Return the speed limit of a lane at a place; 0 for none [m/s]."""
    section = road.sections[number]
    for speeds, at in ((section.lanes[lane].speeds, s - section.start), (road.speeds, s)):
        limits = [limit for start, limit in sorted(speeds) if start <= at]
        if limits and limits[-1]:
            return limits[-1]
    return 0.0


class RoadLayouts:
    """Places beside the reference lines of roads; a `road_positions.RoadFrames`."""

    def __init__(self, roads: Mapping[str, Road]) -> None:
        # Without the elements of signals and objects, which have much text.
        self._roads = {name: replace(road, signals=(), objects=()) for name, road in roads.items()}

    def middle(self, road: str, s: float, lane: int) -> float | None:
        """See `RoadFrames`."""
        own = self._roads.get(road)
        if own is None or not -NARROW <= s <= own.length + NARROW:
            return None
        section = next((each for each in reversed(own.sections) if each.start <= s), own.sections[0])
        if lane and lane not in section.lanes:
            return None
        aside = float(evaluate(own.offset, np.array([s]))[0])
        side = 1 if lane > 0 else -1
        for name in range(side, lane + side, side) if lane else ():
            width = max(float(evaluate(section.lanes[name].widths, np.array([s - section.start]))[0]), 0.0)
            aside += side * (width if name != lane else 0.5 * width)
        return aside

    def point(self, road: str, s: float, t: float) -> tuple[float, float, float, float]:
        """See `RoadFrames`."""
        return frame_at(self._roads[road], s, t)

    def is_forward(self, road: str, lane: int) -> bool:
        """See `RoadFrames`."""
        return (lane < 0) != self._roads[road].is_left_hand


def frame_at(road: Road, s: float, t: float) -> tuple[float, float, float, float]:
    """Return x, y, z [m] of a place beside a road's reference line, and the direction of the road there [rad]."""
    at = np.array([s])
    x, y, heading = (float(each[0]) for each in place_on(road.shapes, at))
    z, roll = float(evaluate(road.elevation, at)[0]), float(evaluate(road.roll, at)[0])
    flat = t * math.cos(roll)
    return x - flat * math.sin(heading), y + flat * math.cos(heading), z + t * math.sin(roll), heading


# Painted lines

CENTRE_LINE, LANE_LINE, EDGE_LINE, KERB = 501, 503, 505, 599
"""MGeo's types of lines; drawings know them."""

_WORDS: Final = {"solid": "Solid", "broken": "Broken", "botts": "Broken"}
"""Words of `roadMark` types -> shapes, as MGeo spells them."""

NO_LINE: Final = frozenset({"none", "edge", "grass"})
"""Types of marks that are not painted."""


def mark_shapes(mark: RoadMark) -> tuple[str, ...]:
    """Return the shapes of a mark's lines, from left to right along the road on its right side, or inner to outer."""
    return tuple(_WORDS.get(word, "Solid") for word in mark.type.split()[:2])


def paint_marks(road: Road, number: int, layout: SectionLayout) -> Iterator[Border]:
    """Yield the painted lines and kerbs of a section, along the road."""
    section = road.sections[number]
    outermost: Mapping[bool, int] = {
        is_left: max(
            (abs(name) for name, lane in section.lanes.items() if (name > 0) == is_left and lane.type in ROADWAY),
            default=0,
        )
        for is_left in (True, False)
    }
    for name, lane in section.lanes.items():
        ends = [*(mark.s for mark in lane.marks[1:]), np.inf][: len(lane.marks)]
        for row, (mark, end) in enumerate(zip(lane.marks, ends, strict=True)):
            low, high = section.start + mark.s, min(section.start + end, section.end)
            if mark.type in NO_LINE or high - low < SHORT:
                continue
            kind = KERB if mark.type == "curb" else CENTRE_LINE if name == 0 else LANE_LINE
            if kind == LANE_LINE and abs(name) >= outermost[name > 0]:
                kind = EDGE_LINE
            shapes = mark_shapes(mark)
            yield Border(
                f"{road.id}.{number}.{name}" + (f".{row}" if row else ""),
                _between(layout, layout.points(layout.edges[name]), low, high),
                kind,
                shapes[::-1] if name > 0 else shapes,
                ("white" if mark.colour == "standard" else mark.colour,),
            )


def _between(layout: SectionLayout, line: FloatArray, low: float, high: float) -> FloatArray:
    """Return a part of a line of a section, with its ends exactly there."""
    inner = layout.s[(layout.s > low + SHORT) & (layout.s < high - SHORT)]
    at = np.concatenate([[low], inner, [high]])
    return np.stack([np.interp(at, layout.s, column) for column in line.T], axis=-1)
