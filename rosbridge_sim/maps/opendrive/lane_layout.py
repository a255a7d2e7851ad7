"""Lanes of an OpenDRIVE road as lines: places along the road, edges of all its lanes, lanes and painted lines.

A section of lanes is laid out at *stations*, which are places along the road: where any record begins, and as close
together between these as bends and polynomials need. A section is cut into *pieces* where its lanes change in a way
that the simulator's lanes cannot (a speed limit, a stop line). A piece of a lane becomes a lane of the map, in driving
direction. Sources: ASAM OpenDRIVE 1.8, sections 9 to 11.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive.plan_view import SHORT, Cubics, cubic_at, place_on, point_on
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
from rosbridge_sim.world.geometry.planar import FloatArray

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

MAX_POINTS: Final = 5_000_000
"""Points of all lanes, as in MGeo maps."""

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
        length: of the line [m].
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
    length: float
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
        row: for each lane, its row in `edges` and `widths`; 0 is the row of lane 0.
        edges: (k, n) distance of the lanes' outer edges from the reference line, left positive [m].
        widths: (k, n) [m].
        edge_lines: (k, n, 3) the edges [m].
        roll: (n,) superelevation [rad].
    """

    def __init__(self, road: Road, section: LaneSection, cuts: Iterable[float] = ()) -> None:
        """Lay out a section.

        Args:
            cuts: places along the road that become stations [m].

        Raises:
            DocumentError: it would need too many stations.
        """
        left, right = max(section.lanes, default=0), -min(section.lanes, default=0)
        names = [*range(1, left + 1), *range(-1, -right - 1, -1)]
        cubics = _join((road.roll, road.elevation, road.offset), section, names)
        self.row = {0: 0, **{name: row for row, name in enumerate(names, 1)}}
        self.s = s = _lay_stations(road, section, cuts, cubics)
        roll, self._height, offset, *_ = values = cubics.at(s)
        self.roll = np.clip(roll, -MAX_TILT, MAX_TILT)
        self._cos, self._sin = np.cos(self.roll), np.sin(self.roll)
        self._x, self._y, heading = place_on(road.shapes, s)
        self._ahead = np.cos(heading), np.sin(heading)
        self.widths = np.maximum(values[2:], 0.0)
        steps = np.concatenate([offset[None], self.widths[1 : left + 1], offset[None], -self.widths[left + 1 :]])
        self.edges = np.concatenate([np.cumsum(steps[: left + 1], axis=0), np.cumsum(steps[left + 1 :], axis=0)[1:]])
        self.edge_lines = self.points(self.edges)

    def points(self, aside: FloatArray) -> FloatArray:
        """Return lines beside the reference line, (k, n, 3) [m].

        Args:
            aside: (k, n) distances to the left, within the plane of the road [m].
        """
        flat = aside * self._cos
        found = np.empty((*aside.shape, 3))
        found[..., 0] = self._x - flat * self._ahead[1]
        found[..., 1] = self._y + flat * self._ahead[0]
        found[..., 2] = self._height + aside * self._sin
        return found


def _join(tables: Sequence[FloatArray], section: LaneSection, names: Iterable[int]) -> Cubics:
    """Return polynomials along the road: tables, and the widths of lanes of a section."""
    cubics = Cubics([*tables, *(section.lanes[name].widths for name in names)])
    cubics.records[cubics.heads[len(tables)] :, 0] += section.start
    return cubics


def _lay_stations(road: Road, section: LaneSection, cuts: Iterable[float], cubics: Cubics) -> FloatArray:
    """Return the stations of a section.

    Args:
        cubics: polynomials of the superelevation, of the heights, of lane 0, and of the lanes' widths.
    """
    start, end = section.start, section.end
    curved = np.array([shape.s for shape in road.shapes])
    breaks = np.concatenate([curved, [start, end, *cuts], cubics.records[:, 0]])
    breaks = breaks[(breaks >= start) & (breaks <= end)]
    breaks.sort()
    breaks = breaks[np.append(breaks[1:] - breaks[:-1] > SHORT, True)]
    breaks[0] = start
    if len(breaks) < 2:  # noqa: PLR2004 - a section without length
        return np.array([start, end])
    num_tables = len(cubics.heads) - 1
    if len(breaks) * num_tables > MAX_POINTS:
        raise _too_many_points(road)
    low, high = breaks[:-1], breaks[1:]
    inside = low + SHORT
    s, a, b, c, d = records = cubics.holding(inside)
    away = np.array([low, high])[:, None] - s
    # The second derivative of a polynomial tells how far a chord of it is away: h^2 / 8 times as much.
    bulge = np.abs(c + 3.0 * d * away)[:, 1:].max(axis=0).sum(axis=0)
    step = np.clip(np.sqrt(4.0 * FLATNESS / np.maximum(bulge, 1e-12)), BEND_STEP, LONGEST_STEP)
    least = (a + away * (b + away * (c + away * d)))[:, 3:].min(axis=0)
    narrow = (least < NARROW) & records[2:, 3:].any(axis=0)
    bends = np.array([shape.kind != "line" for shape in road.shapes])[curved.searchsorted(inside) - 1]
    step[bends | narrow.any(axis=0) | bool(np.count_nonzero(road.roll[:, 1:]))] = BEND_STEP
    count = np.ceil((high - low) / step - SHORT)
    if count.sum() * num_tables > MAX_POINTS:
        raise _too_many_points(road)
    count = np.maximum(count, 1.0).astype(np.int64)
    number = np.arange(count.sum()) - (count.cumsum() - count).repeat(count)
    return np.append(low.repeat(count) + number * ((high - low) / count).repeat(count), end)


def _too_many_points(road: Road) -> DocumentError:
    return error_of(road, f"a road that needs at most {MAX_POINTS:,} points")


def lay_lanes(road: Road, number: int, layout: SectionLayout, cuts: Iterable[float]) -> Iterator[LanePiece]:
    """Yield the lanes of a section; those that are nowhere as wide as `NARROW` are left out.

    Args:
        number: of the section.
        layout: its layout.
        cuts: places along the road at which pieces end [m]; all are stations.

    Raises:
        DocumentError: a lane is too long or too far away.
    """
    section, s = road.sections[number], layout.s
    ends = np.array([section.start, *sorted(cuts), section.end])
    rows = np.searchsorted(s, ends - SHORT)
    rows[-1] = len(s) - 1
    names = [name for name, lane in section.lanes.items() if name and lane.type in ROADWAY]
    if not names:
        return
    outer, inner = ([layout.row[name - side * (1 if name > 0 else -1)] for name in names] for side in (0, 1))
    aside = 0.5 * (layout.edges[outer] + layout.edges[inner])
    lines = layout.points(aside)
    ahead = lines[:, 1:, :2] - lines[:, :-1, :2]
    arc = np.zeros(aside.shape)
    np.hypot(ahead[..., 0], ahead[..., 1]).cumsum(axis=1, out=arc[:, 1:])
    good = (np.abs(lines) <= MAX_COORDINATE).all(axis=(1, 2)) & (arc[:, -1] <= 2.0 * MAX_LENGTH)
    if not good.all():
        expected = f"lanes within {MAX_COORDINATE:,.0f} m and no longer than {2.0 * MAX_LENGTH:,.0f} m"
        raise error_of(road, f"{expected}; lane {names[int(good.argmin())]} of section {number} is not")
    widths = layout.widths[outer]
    wide = widths >= NARROW
    borders = _borders(lines, layout.edge_lines[outer], layout.edge_lines[inner], np.sign(names)[:, None])
    bank = np.tan(layout.roll)[:, None].repeat(2, axis=1) if np.count_nonzero(layout.roll) else None
    spans = []
    for first, last in pairwise(rows.tolist()):
        own = wide[:, first : last + 1]
        low, high = first + own.argmax(axis=1), last - own[:, ::-1].argmax(axis=1)
        high[~own.any(axis=1)] = first
        middle = 0.5 * float(s[first] + s[last])
        width = [float(np.interp(middle, s, own)) for own in widths]
        spans.append((first, last, middle, low.tolist(), high.tolist(), width))
    for i, name in enumerate(names):
        is_forward = (name < 0) != road.is_left_hand
        turned = slice(None, None, 1 if is_forward else -1)
        for piece, (first, last, middle, low, high, width) in enumerate(spans):
            length = float(arc[i, high[i]] - arc[i, low[i]])
            if length < SHORT:
                continue
            part = slice(low[i], high[i] + 1)
            cut = (low[i] > first, high[i] < last)
            border = borders[i, part][turned]
            yield LanePiece(
                road=road.id,
                section=number,
                lane=name,
                piece=piece,
                name=f"{road.id}.{number}.{name}" + (f".{piece}" if piece else ""),
                is_forward=is_forward,
                is_cut=cut if is_forward else cut[::-1],
                line=lines[i, part][turned],
                length=length,
                s=s[part][turned],
                aside=aside[i, part][turned],
                border=border[:, ::-1] if (name > 0) != is_forward else border,
                bank=None if bank is None else bank[part][turned] * (1.0 if is_forward else -1.0),
                width=width[i],
                speed_limit=find_limit(road, number, name, middle),
            )


def _borders(lines: FloatArray, outer: FloatArray, inner: FloatArray, side: FloatArray) -> FloatArray:
    """Return how far the outer and the inner edges of lanes are from their lines, across these, (k, n, 2) [m].

    Args:
        lines, outer, inner: (k, n, 3) along the road [m].
        side: (k, 1) 1 for lanes to the left of lane 0, -1 for others.
    """
    ahead = np.empty((*lines.shape[:2], 2))
    ahead[:, 1:-1] = lines[:, 2:, :2] - lines[:, :-2, :2]
    ahead[:, 0], ahead[:, -1] = lines[:, 1, :2] - lines[:, 0, :2], lines[:, -1, :2] - lines[:, -2, :2]
    ahead *= (side / np.maximum(np.hypot(ahead[..., 0], ahead[..., 1]), 1e-9))[..., None]
    found = np.empty(ahead.shape)
    for column, way, edge in ((0, 1.0, outer), (1, -1.0, inner)):
        away = edge[..., :2] - lines[..., :2]
        across = way * (away[..., 1] * ahead[..., 0] - away[..., 0] * ahead[..., 1])
        np.maximum(across, 0.0, out=found[..., column])
    return found


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
        side = 1 if lane > 0 else -1
        names = range(side, lane + side, side) if lane else ()
        aside: float
        aside, *widths = _join((own.offset,), section, names).at(np.array([s]))[:, 0].tolist()
        for name, width in zip(names, widths, strict=True):
            aside += side * max(width, 0.0) * (1.0 if name != lane else 0.5)
        return aside

    def point(self, road: str, s: float, t: float) -> tuple[float, float, float, float]:
        """See `RoadFrames`."""
        return frame_at(self._roads[road], s, t)

    def is_forward(self, road: str, lane: int) -> bool:
        """See `RoadFrames`."""
        return (lane < 0) != self._roads[road].is_left_hand


def frame_at(road: Road, s: float, t: float) -> tuple[float, float, float, float]:
    """Return x, y, z [m] of a place beside a road's reference line, and the direction of the road there [rad]."""
    x, y, heading = point_on(road.shapes, s)
    z, roll = cubic_at(road.elevation, s), cubic_at(road.roll, s)
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
                _between(layout.s, layout.edge_lines[layout.row[name]], low, high),
                kind,
                shapes[::-1] if name > 0 else shapes,
                ("white" if mark.colour == "standard" else mark.colour,),
            )


def _between(s: FloatArray, line: FloatArray, low: float, high: float) -> FloatArray:
    """Return a part of a line with points at places `s`, with its ends exactly at two of these or between them."""
    ends = np.array([low, high])
    at = s.searchsorted([low + SHORT, high - SHORT])
    found = line[at[0] - 1 : at[1] + 1].copy()
    share = (ends - s[at - 1]) / (s[at] - s[at - 1])
    found[[0, -1]] = line[at - 1] + share[:, None] * (line[at] - line[at - 1])
    return found
