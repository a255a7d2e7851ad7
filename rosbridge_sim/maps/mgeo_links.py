"""The links of an MGeo map -> lanes: their lines, successors and neighbours.

Lanes are the links with their own geometry that vehicles may use. The two-point links that MGeo keeps for lane changes
(`lazy_init`) only tell that a lane change is allowed. They give the neighbours of lanes whose links do not name them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Final

import numpy as np
from msgspec import Meta

from rosbridge_sim.documents.document_model import (
    Document,
    DocumentType,
    KeptAsWritten,
    LenientBool,
    Number,
    text_within,
)
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.maps.road_map import Border
from rosbridge_sim.records import Record, field
from rosbridge_sim.units import KMH_TO_MPS
from rosbridge_sim.world.geometry.planar import FloatArray, nearest_on_polyline
from rosbridge_sim.world.roads.road_places import MAX_EDGE
from rosbridge_sim.world.roads.roads import Roads

MAX_MAP_BYTES: Final = 1 << 28
"""Largest size of a file: 256 MiB, ten times the link_set of a large city."""

MAX_LINKS: Final = 100_000
MAX_POINTS: Final = 5_000_000

MAX_MAP_COORDINATE: Final = 1e7
"""Largest distance from the map's own origin [m]. No map is larger, and arc lengths stay exact to a nanometre."""

LANE_WIDTH: Final = 3.5
"""Width of a lane that gives none, as in MGeo [m]."""

NO_ROADS: Final = frozenset(
    {"biking", "border", "curb", "median", "rail", "restricted", "shoulder", "sidewalk", "tram", "walking"}
)
"""Link types, in lower case, that are no road for vehicles: lane types of ASAM OpenDRIVE, whose words are kept by maps
from RoadRunner. Others are roads: numbers of the Korean survey, `Driving`, `DRIVABLE_LANE`, `Parking`, none, and words
that are unknown."""

Identifier = Annotated[str, text_within(1_000)]
Identifiers = Annotated[list[Identifier], Meta(max_length=MAX_LINKS)]


class _Node(Document, frozen=True, kw_only=True):
    idx: Identifier
    on_stop_line: LenientBool | None = None


class _Link(Document, frozen=True, kw_only=True):
    idx: Identifier
    from_node_idx: Identifier | None = None
    to_node_idx: Identifier | None = None
    points: list[tuple[Number, Number, Number]]
    max_speed: Number | None = None
    lazy_init: LenientBool | None = None
    link_type: KeptAsWritten = None
    lane_ch_link_path: Identifiers | None = None
    can_move_left_lane: LenientBool | None = None
    can_move_right_lane: LenientBool | None = None
    left_lane_change_dst_link_idx: Identifier | None = None
    right_lane_change_dst_link_idx: Identifier | None = None
    related_signal: Identifier | None = None
    width_start: Number | None = None
    force_width_start: LenientBool | None = None
    lane_mark_left: Identifiers | None = None
    lane_mark_right: Identifiers | None = None


class _Border(Document, frozen=True, kw_only=True):
    idx: Identifier
    points: list[tuple[Number, Number, Number]]
    lane_type: KeptAsWritten = None
    lane_shape: KeptAsWritten = None
    lane_color: KeptAsWritten = None


_NODES: Final = DocumentType[list[_Node]](Annotated[list[_Node], Meta(max_length=MAX_LINKS)])
_LINKS: Final = DocumentType[list[_Link]](Annotated[list[_Link], Meta(max_length=MAX_LINKS)])
_BORDERS: Final = DocumentType[list[_Border]](Annotated[list[_Border], Meta(max_length=MAX_LINKS)])
LANE_KINDS: Final[dict[str, DocumentType[Any]]] = {"nodes": _NODES, "links": _LINKS, "borders": _BORDERS}
"""Form of each kind of file with lanes."""


class Lanes(Record, eq=False):
    """The lanes of a map, with data that the world's `Roads` does not hold.

    Attributes:
        roads: the lanes, in the order of the file.
        related_signal: movement that each lane's light is for ("straight", "left_unprotected", ...), or "".
        borders: painted lines and kerbs, in the order of the file.
        left_out: for each of `NO_ROADS` that the map has, the ids of its links; they are no lanes.
    """

    roads: Roads
    related_signal: tuple[str, ...]
    borders: tuple[Border, ...] = ()
    left_out: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def read_lanes(files: Mapping[str, tuple[bytes, str]]) -> Lanes:
    """Read the lanes of a map.

    Args:
        files: content and name for errors, by kind: `nodes`, `links` and `borders`. Without the last one the edges are
            half a width from the lanes' lines.

    Raises:
        DocumentError: one line: file, place in it, expected value, actual value.
    """
    nodes = read_document(_NODES, *files["nodes"], MAX_MAP_BYTES)
    links = read_document(_LINKS, *files["links"], MAX_MAP_BYTES)
    borders = _read_borders(files.get("borders"))
    source = files["links"][1]
    stops = {node.idx: bool(node.on_stop_line) for node in nodes}
    lanes = [(i, link) for i, link in enumerate(links) if not link.lazy_init and _no_road(link) is None]
    if sum(len(link.points) for _, link in lanes) > MAX_POINTS:
        raise DocumentError(f"{source}: expected at most {MAX_POINTS:,} points")
    rows: dict[str, int] = {}
    starts: dict[str, list[int]] = {}
    lines = []
    for row, (i, link) in enumerate(lanes):
        if link.idx in rows:
            raise DocumentError(f"{source}: [{i}].idx: expected each id once, got {link.idx!r} twice")
        rows[link.idx] = row
        for key, node in (("from_node_idx", link.from_node_idx), ("to_node_idx", link.to_node_idx)):
            if node is not None and node not in stops:
                raise DocumentError(f"{source}: [{i}].{key}: node_set.json has no node {node!r}")
        if link.from_node_idx is not None:
            starts.setdefault(link.from_node_idx, []).append(row)
        lines.append(read_line(link.points, f"{source}: [{i}].points"))
    only = [link for _, link in lanes]
    left, right = _neighbours(only, rows, lines, [link for link in links if link.lazy_init])
    beside = dict(_edges(only, lines, {name: border.line for name, border in borders.items()}))
    roads = Roads(
        [link.idx for link in only],
        lines,
        [starts.get(link.to_node_idx, []) if link.to_node_idx is not None else [] for link in only],
        [_width(link) for link in only],
        [max(link.max_speed or 0.0, 0.0) * KMH_TO_MPS for link in only],
        left=left,
        right=right,
        is_stop=[link.to_node_idx is not None and stops[link.to_node_idx] for link in only],
        borders={row: edges[:, :2] for row, edges in beside.items()},
        banks={row: edges[:, 2:] for row, edges in beside.items() if edges[:, 2:].any()},
    )
    signals = tuple((link.related_signal or "").strip().lower() for link in only)
    return Lanes(roads, signals, tuple(borders.values()), _left_out(links))


def read_line(points: Sequence[tuple[float, float, float]], where: str) -> FloatArray:
    """Return a polyline with some length, without points that repeat the one before.

    Args:
        points: x, y, z of each [m].
        where: place in the file, for errors.

    Returns:
        (k, 3) float64 [m].

    Raises:
        DocumentError: a coordinate out of range, or all points in one place.
    """
    line = np.array(points, dtype=np.float64).reshape(-1, 3)
    # All points are checked at once for speed: a city has a million of them.
    wild = np.flatnonzero(~(np.abs(line) <= MAX_MAP_COORDINATE).all(axis=1))
    if len(wild):
        raise DocumentError(f"{where}[{wild[0]}]: expected coordinates within {MAX_MAP_COORDINATE:,.0f} m")
    if not (line[1:, :2] != line[:1, :2]).any():
        raise DocumentError(f"{where}: expected two different points at least, got {len(line)} in one place")
    is_new = (line[1:, :2] != line[:-1, :2]).any(axis=1)
    return np.asarray(line[np.concatenate([[True], is_new])])


def _no_road(link: _Link) -> str | None:
    """Return which of `NO_ROADS` a link is; None for a road."""
    kind = link.link_type.strip().lower() if isinstance(link.link_type, str) else ""
    return kind if kind in NO_ROADS else None


def _left_out(links: Sequence[_Link]) -> dict[str, tuple[str, ...]]:
    found: dict[str, list[str]] = {}
    for link in links:
        kind = _no_road(link)
        if kind is not None and not link.lazy_init:
            found.setdefault(kind, []).append(link.idx)
    return {kind: tuple(names) for kind, names in found.items()}


def _width(link: _Link) -> float:
    is_given = link.force_width_start and link.width_start is not None and link.width_start > 0.0
    return float(link.width_start or LANE_WIDTH) if is_given else LANE_WIDTH


# Beside


def _neighbours(
    lanes: Sequence[_Link], rows: Mapping[str, int], lines: Sequence[FloatArray], changes: Collection[_Link]
) -> tuple[list[int], list[int]]:
    """Return for each lane the rows of the lanes to its left and right that a vehicle may change into, or -1.

    A link usually names its neighbours itself. Other maps have links for lane changes, whose `lane_ch_link_path` holds
    two or more lanes. The line of the second lane then tells on which side it lies.
    """
    left, right = [-1] * len(lanes), [-1] * len(lanes)
    for row, link in enumerate(lanes):
        if link.can_move_left_lane is not False and link.left_lane_change_dst_link_idx is not None:
            left[row] = rows.get(link.left_lane_change_dst_link_idx, -1)
        if link.can_move_right_lane is not False and link.right_lane_change_dst_link_idx is not None:
            right[row] = rows.get(link.right_lane_change_dst_link_idx, -1)
    for change in changes:
        for source, target in pairwise(change.lane_ch_link_path or ()):
            here, there = rows.get(source, -1), rows.get(target, -1)
            if here < 0 or there < 0 or here == there:
                continue
            middle = lines[there][len(lines[there]) // 2]
            side = left if nearest_on_polyline(lines[here], middle[0], middle[1]).lateral[0] > 0.0 else right
            may_change = lanes[here].can_move_left_lane if side is left else lanes[here].can_move_right_lane
            if side[here] < 0 and may_change is not False:
                side[here] = there
    return left, right


def _read_borders(border_file: tuple[bytes, str] | None) -> dict[str, Border]:
    """Return the edges of lanes by name; an edge without length is left out."""
    if border_file is None:
        return {}
    entries = read_document(_BORDERS, *border_file, MAX_MAP_BYTES)
    if sum(len(entry.points) for entry in entries) > MAX_POINTS:
        raise DocumentError(f"{border_file[1]}: expected at most {MAX_POINTS:,} points")
    borders = {}
    for i, entry in enumerate(entries):
        if any(point[:2] != entry.points[0][:2] for point in entry.points):
            line = read_line(entry.points, f"{border_file[1]}: [{i}].points")
            borders[entry.idx] = Border(
                entry.idx, line, _number_of(entry.lane_type), _words_of(entry.lane_shape), _words_of(entry.lane_color)
            )
    return borders


MAX_WORDS: Final = 8
"""Words about one border that are kept: a double line has two."""

MAX_WORD: Final = 40
"""Characters of such a word."""


def _number_of(value: JsonValue) -> int:
    """Return a number that a map writes as one, as text or, for several, as a list; 0 where it is none of these."""
    if isinstance(value, list):
        value = value[0] if value else 0
    text = str(value)
    return int(text) if text.isdecimal() and len(text) <= MAX_DIGITS else 0


MAX_DIGITS: Final = 9
"""Of a border's type: it fits an int32."""


def _words_of(value: JsonValue) -> tuple[str, ...]:
    """Return the words that a map writes as text or as a list."""
    words = value if isinstance(value, list) else [value]
    return tuple(word[:MAX_WORD] for word in words[:MAX_WORDS] if isinstance(word, str) and word)


MAX_BANK: Final = 0.15
"""Greatest rise across a lane for each metre: roads have at most 0.08 to 0.1. More is a kerb, or a border without
heights, and counts as none."""


def _edges(
    lanes: Sequence[_Link], lines: Sequence[FloatArray], borders: Mapping[str, FloatArray]
) -> Iterator[tuple[int, FloatArray]]:
    """Yield the row of each lane whose edges the map draws, and (k, 4) figures of its points.

    They are the distances to the left and right edge [m], and the rise to the left for each metre in both halves.
    """
    for row, (link, line) in enumerate(zip(lanes, lines, strict=True)):
        marks = [
            [borders[name] for name in names or () if name in borders]
            for names in (link.lane_mark_left, link.lane_mark_right)
        ]
        if not any(marks):
            continue
        step = np.gradient(line[:, :2], axis=0)
        length = np.hypot(step[:, 0], step[:, 1])
        # To the left; a line that turns back on itself has no direction at that point.
        normal = np.stack((-step[:, 1], step[:, 0]), axis=-1) / np.where(length > 0.0, length, 1.0)[:, None]
        half = 0.5 * _width(link)
        sides = (normal, -normal)
        (left, up), (right, down) = (_edge(line, n, edge, half) for n, edge in zip(sides, marks, strict=True))
        yield row, np.stack([left, right, up, -down], axis=-1)


def _edge(
    line: FloatArray, normal: FloatArray, marks: Sequence[FloatArray], otherwise: float
) -> tuple[FloatArray, FloatArray]:
    """Return the nearest mark along its normal from each point of a line.

    Returns:
        (k,) distances, `otherwise` where there is no mark [m], and (k,) rises to the marks for each metre.
    """
    best, rise = np.full(len(line), np.inf), np.zeros(len(line))
    for mark in marks:
        near = nearest_on_polyline(mark, line[:, 0], line[:, 1])
        away = np.stack((near.x, near.y), axis=-1) - line[:, :2]
        across = (away * normal).sum(axis=1)
        along = np.abs(away[:, 1] * normal[:, 0] - away[:, 0] * normal[:, 1])
        # Only a mark beside the point counts, not the end of a mark that begins farther along.
        is_beside = (across > 0.0) & (along < 0.5 * across) & (across <= MAX_EDGE)
        is_nearer = is_beside & (across < best)
        best[is_nearer] = across[is_nearer]
        start, end = mark[near.segment], mark[near.segment + 1]
        share = np.hypot(near.x - start[:, 0], near.y - start[:, 1]) / np.hypot(*(end - start)[:, :2].T)
        height = start[:, 2] + share * (end[:, 2] - start[:, 2])
        rise[is_nearer] = (height - line[:, 2])[is_nearer] / across[is_nearer]
    rise[np.abs(rise) > MAX_BANK] = 0.0
    return np.where(np.isfinite(best), best, otherwise), rise
