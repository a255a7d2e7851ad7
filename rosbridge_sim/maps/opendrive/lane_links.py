"""Which lanes of OpenDRIVE roads follow one another, and which lie side by side.

Ids of lanes say nothing about directions: two roads can meet with both starts. So links are first read as pairs of lane
*ends* that touch; a lane then follows another one where the end of the one, in driving direction, touches the start of
the other. Files often have only one of the two records of a link; each is enough.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from rosbridge_sim.maps.opendrive.lane_layout import NEAR_CUT, LanePiece
from rosbridge_sim.maps.opendrive.plan_view import MAX_GAP
from rosbridge_sim.maps.opendrive.road_elements import (
    ROADWAY,
    Connection,
    Junction,
    LaneSection,
    Road,
    RoadEnd,
    RoadMark,
)

TORN: Final = 5.0
"""Lanes farther apart than this do not follow one another, whatever the file says [m]."""

MAX_TOLD: Final = 5
"""Examples in a note."""

MAX_CIRCLE: Final = 150.0
"""Longest way around in a roundabout of one lane [m]."""

MAX_LOOKED_AT: Final = 40
"""Lanes that are looked at for a way back to one of them."""

ROUND: Final = 0.6
"""Least area of a roundabout, as a share of that of a circle as long; two turns and a street between have 0.2."""


class LaneEnd(NamedTuple):
    """An end of a lane of a section."""

    road: str
    section: int
    lane: int
    is_start: bool


_Rows = defaultdict[tuple[str, int, int], list[int]]
"""Rows of the pieces of each lane of a section, along the road."""


class Follows(NamedTuple):
    """The rows of the lanes that follow each lane, and remarks about links."""

    successors: list[list[int]]
    notes: list[str]


def find_followers(roads: Mapping[str, Road], junctions: Collection[Junction], pieces: Sequence[LanePiece]) -> Follows:
    """Find the lanes that follow each lane.

    Args:
        pieces: all lanes of the map.
    """
    rows: _Rows = defaultdict(list)
    for row, piece in enumerate(pieces):
        rows[piece.road, piece.section, piece.lane].append(row)
    found: list[dict[int, None]] = [{} for _ in pieces]  # sets in order
    for own in rows.values():
        for before, after in pairwise(own):
            first, last = (before, after) if pieces[before].is_forward else (after, before)
            found[first][last] = None
    told: dict[str, dict[str, None]] = {what: {} for what in _REMARKS}
    for ends in _touching(roads, junctions, told[_LOST]):
        one, other = joined = _nearest_ends(roads, pieces, rows, ends)
        if not (rows[one[:3]] and rows[other[:3]]):
            continue  # a sidewalk, or a lane without a width
        if joined != ends:
            told[_TURNED][f"road {one.road} - road {other.road}"] = None
        if not _leads_on(pieces, rows, joined):
            continue
        leaves = _is_left_at(pieces, rows, one)
        first, last = (_row(rows, end) for end in (joined if leaves else joined[::-1]))
        if pieces[first].is_cut[1] or pieces[last].is_cut[0]:
            told[_NARROW][f"{pieces[first].name} -> {pieces[last].name}"] = None
        else:
            found[first][last] = None
    notes = [tell(what, list(names)) for what, names in told.items() if names]
    return Follows(*_measure_joins(pieces, [list(each) for each in found], notes))


_LOST, _TURNED, _NARROW = _REMARKS = (
    "links to roads and lanes that are not there",
    "links name the wrong end of a road; the near one is taken",
    "links at the end of a lane where it has no width are left out",
)


def _row(rows: _Rows, end: LaneEnd) -> int:
    """Return the row of the lane at an end of a lane of a section."""
    return rows[end[:3]][0 if end.is_start else -1]


def _nearest_ends(
    roads: Mapping[str, Road], pieces: Sequence[LanePiece], rows: _Rows, ends: tuple[LaneEnd, LaneEnd]
) -> tuple[LaneEnd, LaneEnd]:
    """Return the ends of a link; with the other end of one road if no vehicle could pass where they are named.

    These are far apart, or vehicles leave both lanes there, or enter both: the wrong end of a road of half a metre.
    """
    if ends[0].road == ends[1].road:
        return ends

    def apart(pair: tuple[LaneEnd, LaneEnd]) -> float:
        lines = [(pieces[_row(rows, end)], end.is_start) for end in pair]
        one, other = (piece.line[0 if piece.is_forward == is_start else -1] for piece, is_start in lines)
        return math.dist(one, other)

    turned = [ends, (_other_end(roads, ends[0]), ends[1]), (ends[0], _other_end(roads, ends[1]))]
    there = {pair: apart(pair) for pair in turned if all(rows[end[:3]] for end in pair)}
    named = there.get(ends, math.inf)
    passed = [pair for pair, gap in there.items() if gap < TORN and gap <= named and _leads_on(pieces, rows, pair)]
    # Where vehicles pass at the named ends, they do not with the other end of one road.
    return min(passed, key=lambda pair: there[pair], default=ends)


def _leads_on(pieces: Sequence[LanePiece], rows: _Rows, ends: tuple[LaneEnd, LaneEnd]) -> bool:
    """Return whether vehicles leave one lane and enter the other one at two ends."""
    return _is_left_at(pieces, rows, ends[0]) != _is_left_at(pieces, rows, ends[1])


def _is_left_at(pieces: Sequence[LanePiece], rows: _Rows, end: LaneEnd) -> bool:
    """Return whether vehicles leave a lane at an end, and do not enter it there."""
    return pieces[_row(rows, end)].is_forward != end.is_start


def _other_end(roads: Mapping[str, Road], end: LaneEnd) -> LaneEnd:
    """Return the end of the lane with the same id at the other end of the road."""
    last = len(roads[end.road].sections) - 1
    return LaneEnd(end.road, last if end.is_start else 0, end.lane, not end.is_start)


def _touching(  # noqa: C901 - records of lanes lie four levels deep
    roads: Mapping[str, Road], junctions: Collection[Junction], lost: dict[str, None]
) -> Iterator[tuple[LaneEnd, LaneEnd]]:
    """Yield the pairs of ends of lanes that the file joins; what is not there is put into `lost`."""
    for road in roads.values():
        last = len(road.sections) - 1
        for number, section in enumerate(road.sections):
            for name, lane in section.lanes.items():
                for is_start, ids in ((True, lane.predecessors), (False, lane.successors)):
                    own = LaneEnd(road.id, number, name, is_start)
                    for other in ids:
                        if number != (0 if is_start else last):
                            yield own, LaneEnd(road.id, number + (-1 if is_start else 1), other, not is_start)
                            continue
                        end = road.before if is_start else road.after
                        if far := _end_of(roads, end, other):
                            yield own, far
                        elif end is not None and end.road:
                            lost[f"road {road.id} lane {name} -> road {end.road} lane {other}"] = None
    for junction in junctions:
        for connection in junction.connections:
            yield from _connected(roads, junction, connection, lost)


def _connected(
    roads: Mapping[str, Road], junction: Junction, connection: Connection, lost: dict[str, None]
) -> Iterator[tuple[LaneEnd, LaneEnd]]:
    """Yield the pairs of ends that a connection of a junction joins."""
    incoming, connecting = roads.get(connection.incoming), roads.get(connection.connecting)
    where = f"junction {junction.id}: road {connection.incoming} -> road {connection.connecting}"
    if incoming is None or connecting is None:
        lost[where] = None
        return
    end = connecting.before if connection.is_start else connecting.after
    sides = [
        is_start
        for is_start, own in ((True, incoming.before), (False, incoming.after))
        if own is not None and own.junction == junction.id
    ]
    if end is not None and end.road == incoming.id:
        sides = [end.is_start]
    if len(sides) != 1:
        lost[where] = None
        return
    for one, other in connection.links:
        pair = [
            _end_of(roads, RoadEnd(road.id, is_start=is_start), lane)
            for road, is_start, lane in ((incoming, sides[0], one), (connecting, connection.is_start, other))
        ]
        if pair[0] and pair[1]:
            yield pair[0], pair[1]
        else:
            lost[f"{where}: lanes {one} -> {other}"] = None


def _end_of(roads: Mapping[str, Road], end: RoadEnd | None, lane: int) -> LaneEnd | None:
    """Return the end of a lane at an end of a road; None where there is no such road, or no such lane at either end."""
    road = roads.get(end.road) if end is not None else None
    if road is None or end is None:
        return None
    section = 0 if end.is_start else len(road.sections) - 1
    is_there = any(lane in road.sections[number].lanes for number in (0, -1))
    return LaneEnd(road.id, section, lane, end.is_start) if is_there else None


def _measure_joins(
    pieces: Sequence[LanePiece], successors: list[list[int]], notes: list[str]
) -> tuple[list[list[int]], list[str]]:
    """Take out the joins that are torn, and add notes about them and about gaps."""
    ends = [(row, after) for row, own in enumerate(successors) for after in own]
    # numpy's norm gives up the lock of the interpreter for each pair and takes it back before another thread wakes up:
    # an event loop would wait until the last pair.
    gaps = [math.dist(pieces[after].line[0], pieces[row].line[-1]) for row, after in ends]
    order = sorted(range(len(ends)), key=lambda i: -gaps[i])
    texts = [
        f"{pieces[ends[i][0]].name} -> {pieces[ends[i][1]].name} {gaps[i]:.2f} m" for i in order if gaps[i] > MAX_GAP
    ]
    num_torn = sum(gap > TORN for gap in gaps)
    for i in order[:num_torn]:
        row, after = ends[i]
        successors[row].remove(after)
    if num_torn:
        notes.append(
            tell(f"lanes that are linked over more than {TORN:g} m do not follow one another", texts[:num_torn])
        )
    if len(texts) > num_torn:
        notes.append(
            tell(f"lanes that follow one another over a gap of more than {100 * MAX_GAP:g} cm", texts[num_torn:])
        )
    return successors, notes


def tell(what: str, names: Sequence[str], num: int | None = None) -> str:
    """Return a note with the first examples.

    Args:
        num: number of all, where `names` are fewer.
    """
    more = ", ..." if len(names) > MAX_TOLD else ""
    return f"{len(names) if num is None else num:,} {what}: {', '.join(names[:MAX_TOLD])}{more}"


# Roundabouts


def find_circles(pieces: Sequence[LanePiece], successors: Sequence[Sequence[int]]) -> set[int]:
    """Return the lanes that lead around a roundabout, back to their own start."""
    found: set[int] = set()
    for start in range(len(pieces)):
        if start in found:
            continue
        before, away, todo = {start: -1}, {start: 0.0}, [start]
        for lane in todo:
            after_it = away[lane] + pieces[lane].length
            for after in successors[lane] if after_it < MAX_CIRCLE else ():
                if after == start:
                    way = [lane]
                    while way[-1] != start:
                        way.append(before[way[-1]])
                    if _is_round([pieces[row] for row in way[::-1]], after_it):
                        found.update(way)
                elif after not in before and len(todo) < MAX_LOOKED_AT:
                    before[after], away[after] = lane, after_it
                    todo.append(after)
    return found


def _is_round(way: Sequence[LanePiece], length: float) -> bool:
    """Return whether lanes that end where they begin enclose about a circle."""
    corners = [piece.line[row] for piece in way for row in (0, len(piece.line) // 2)]
    twice = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise([*corners, corners[0]]))
    return 2.0 * math.pi * abs(float(twice)) > ROUND * length**2


# Side by side


def find_neighbours(roads: Mapping[str, Road], pieces: Sequence[LanePiece]) -> tuple[list[int], list[int]]:
    """Return for each lane the rows of the lanes to its left and right that a vehicle may change into, or -1.

    The line between is the outer mark of the inner lane. It forbids a change where the line on the side of the vehicle
    is solid; `laneChange` does not count, because many programs write "none" everywhere.
    """
    rows = {(piece.road, piece.section, piece.lane, piece.piece): row for row, piece in enumerate(pieces)}
    left, right = [-1] * len(pieces), [-1] * len(pieces)
    for row, piece in enumerate(pieces):
        road = roads[piece.road]
        section = road.sections[piece.section]
        middle = float(piece.s[0] + piece.s[-1]) / 2.0 - section.start
        for step in (-1, 1):  # towards lane 0, and away from it
            other = piece.lane + (step if piece.lane > 0 else -step)
            beside = rows.get((piece.road, piece.section, other, piece.piece), -1)
            if beside < 0 or "parking" in {section.lanes[piece.lane].type, section.lanes[other].type}:
                continue
            inner = other if step < 0 else piece.lane
            if not forbids_change(_mark_at(section.lanes[inner].marks, middle), is_outwards=step > 0):
                side = left if (step < 0) != road.is_left_hand else right
                side[row] = beside
    return left, right


def _mark_at(marks: Sequence[RoadMark], s: float) -> str:
    """Return the type of the mark that holds at a place of a section."""
    return next((mark.type for mark in reversed(marks) if mark.s <= s), "none")


def forbids_change(mark_type: str, *, is_outwards: bool) -> bool:
    """Return whether one may not change over a mark: outwards, away from lane 0, its first word counts."""
    words = mark_type.split()
    return bool(words) and words[0 if is_outwards else -1] in {"solid", "curb"}


def find_cuts(road: Road, section: LaneSection) -> set[float]:
    """Return the places along a road at which a section is cut: its speed limits or permitted lane changes differ."""
    cuts = {s for s, _ in road.speeds}
    for name, lane in section.lanes.items():
        if name and lane.type in ROADWAY:
            cuts |= {section.start + s for s, _ in lane.speeds}
            outer = section.lanes.get(name + (1 if name > 0 else -1))
            if outer is not None and outer.type in ROADWAY:
                cuts |= {
                    section.start + after.s
                    for before, after in pairwise(lane.marks)
                    if any(
                        forbids_change(before.type, is_outwards=way) != forbids_change(after.type, is_outwards=way)
                        for way in (True, False)
                    )
                }
    return cuts


def spread_cuts(cuts: Collection[float], section: LaneSection) -> list[float]:
    """Return the cuts that lie within a section and `NEAR_CUT` apart from its ends and one another, rising."""
    kept: list[float] = [section.start]
    for cut in sorted(cuts):
        if cut - kept[-1] > NEAR_CUT and section.end - cut > NEAR_CUT:
            kept.append(cut)
    return kept[1:]
