"""MGeo maps: the JSON files of a map folder -> the figures of its projection and its lanes.

What is needed is `global_info.json`, `node_set.json` and `link_set.json`; other files of the folder may be handed in
too and are not looked at. Lanes are the links with geometry of their own: the two-point links that MGeo keeps for
lane changes (`lazy_init`) say that one may change, not where one drives.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from pydantic import Field, TypeAdapter

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.documents import Coordinate, Document, Flag, Number, read_document
from rosbridge_sim.world.geometry import FloatArray
from rosbridge_sim.world.roads import Roads

__all__ = ["FILES", "Projection", "RoadMap", "read_map"]

FILES: Final = ("global_info.json", "node_set.json", "link_set.json")
"""What `read_map` must be given; the shell reads at least these."""

MAX_BYTES: Final = 1 << 28
"""256 MiB for each file: ten times the link_set of a large city."""

MAX_LINKS: Final = 100_000
MAX_POINTS: Final = 5_000_000

LANE_WIDTH: Final = 3.5
"""What MGeo means where no width is forced [m]."""

KMH: Final = 1.0 / 3.6
"""One km/h [m/s]."""

Text = Annotated[str, Field(max_length=1_000)]
Point = tuple[Coordinate, Coordinate, Coordinate]


class _GlobalInfo(Document):
    global_coordinate_system: Text
    local_origin_in_global: Point = (0.0, 0.0, 0.0)


class _Node(Document):
    idx: Text


class _Link(Document):
    idx: Text
    from_node_idx: Text | None = None
    to_node_idx: Text | None = None
    points: list[tuple[float, float, float]]
    max_speed: Number | None = None
    lazy_init: Flag | None = None
    width_start: Number | None = None
    force_width_start: Flag | None = None


_GLOBAL_INFO: Final = TypeAdapter(_GlobalInfo)
_NODES: Final = TypeAdapter(Annotated[list[_Node], Field(max_length=MAX_LINKS)])
_LINKS: Final = TypeAdapter(Annotated[list[_Link], Field(max_length=MAX_LINKS)])


@dataclass(frozen=True, slots=True)
class Projection:
    """How the map's metres lie on the globe: what `MapSpec` tells.

    Attributes:
        is_tm: a transverse Mercator of its own (`plane_coordinate_system` 1) instead of a UTM zone (0).
        zone: UTM zone 1..60; 0 for a TM.
        is_south: a UTM zone of the southern half (MapSpec has no place for it).
        ellipse: e.g. "WGS84".
        central_latitude, central_meridian: of a TM [deg].
        scale_factor: of a TM, on the central meridian.
        false_easting, false_northing: of a TM [m].
        text: as the map has it.
    """

    is_tm: bool
    zone: int = 0
    is_south: bool = False
    ellipse: str = "WGS84"
    central_latitude: float = 0.0
    central_meridian: float = 0.0
    scale_factor: float = 1.0
    false_easting: float = 0.0
    false_northing: float = 0.0
    text: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class RoadMap:
    """A map.

    Attributes:
        name: of its folder.
        projection: of its plane coordinates.
        origin: east, north and up of the map's (0, 0, 0) in that projection [m].
        roads: its lanes, in the order of the file.
    """

    name: str
    projection: Projection
    origin: tuple[float, float, float]
    roads: Roads


def read_map(files: Mapping[str, bytes], source: str) -> RoadMap:
    """Read a map.

    Args:
        files: contents by file name; `FILES` must be among them.
        source: the map's folder, for errors; its last part is the map's name.

    Raises:
        DocumentError: one line: which file, where in it, what was expected, what came.
    """
    name = re.split(r"[\\/]", source.rstrip("\\/"))[-1]
    missing = next((file for file in FILES if file not in files), None)
    if missing is not None:
        raise DocumentError(f"{source}: {missing} is missing")
    where = {file: f"{name}/{file}" for file in FILES}
    info_file, node_file, link_file = FILES
    info = read_document(_GLOBAL_INFO, files[info_file], where[info_file], MAX_BYTES)
    projection = read_projection(info.global_coordinate_system, where[info_file])
    nodes = read_document(_NODES, files[node_file], where[node_file], MAX_BYTES)
    links = read_document(_LINKS, files[link_file], where[link_file], MAX_BYTES)
    roads = _roads(links, {node.idx for node in nodes}, where[link_file])
    return RoadMap(name, projection, info.local_origin_in_global, roads)


_SHORT_UTM = re.compile(r"UTM[ _-]?(?P<zone>\d{1,2})(?P<half>[NS]?)", re.IGNORECASE)


def read_projection(text: str, source: str) -> Projection:
    """The figures of a `global_coordinate_system`: proj4 text of a UTM zone or a TM, or the old "UTM52N".

    Raises:
        DocumentError: another projection, or a figure that is none.
    """
    where = f"{source}: global_coordinate_system"
    short = _SHORT_UTM.fullmatch(text.strip())
    if short:
        return Projection(
            is_tm=False, zone=_zone(short["zone"], where), is_south=short["half"].upper() == "S", text=text
        )
    terms = dict(term.lstrip("+").partition("=")[::2] for term in text.split() if term.startswith("+"))
    # A datum implies its ellipse; of those that maps use only these two have one name for both.
    ellipse = terms.get("ellps") or terms.get("datum") or "WGS84"
    kind = terms.get("proj", "").casefold()
    if kind == "utm":
        zone = _zone(terms.get("zone", ""), where)
        return Projection(is_tm=False, zone=zone, is_south="south" in terms, ellipse=ellipse, text=text)
    if kind == "tmerc":
        return Projection(
            is_tm=True,
            ellipse=ellipse,
            central_latitude=_figure(terms, "lat_0", 0.0, where),
            central_meridian=_figure(terms, "lon_0", 0.0, where),
            scale_factor=_figure(terms, "k" if "k" in terms else "k_0", 1.0, where),
            false_easting=_figure(terms, "x_0", 0.0, where),
            false_northing=_figure(terms, "y_0", 0.0, where),
            text=text,
        )
    raise DocumentError(f"{where}: expected proj4 text with +proj=utm or +proj=tmerc, or UTM52N, got {text[:80]!r}")


def _zone(text: str, where: str) -> int:
    if text.isdecimal() and len(text) <= 2 and 1 <= int(text) <= 60:  # noqa: PLR2004  # zones of 6 degrees
        return int(text)
    raise DocumentError(f"{where}: expected a UTM zone 1..60, got {text[:40]!r}")


def _figure(terms: Mapping[str, str], key: str, default: float, where: str) -> float:
    text = terms.get(key)
    if text is None:
        return default
    if _FIGURE.fullmatch(text):
        return float(text)
    raise DocumentError(f"{where}: expected a number for +{key}, got {text[:40]!r}")


_FIGURE = re.compile(r"[+-]?(\d{1,15}(\.\d*)?|\.\d+)([eE][+-]?\d{1,2})?")


def _roads(links: list[_Link], nodes: set[str], source: str) -> Roads:
    """The lanes among the links, joined where one ends at the node that another begins at."""
    lanes = [(i, link) for i, link in enumerate(links) if not link.lazy_init]
    if sum(len(link.points) for _, link in lanes) > MAX_POINTS:
        raise DocumentError(f"{source}: expected at most {MAX_POINTS:,} points")
    seen: set[str] = set()
    starts: dict[str, list[int]] = {}
    lines = []
    for row, (i, link) in enumerate(lanes):
        if link.idx in seen:
            raise DocumentError(f"{source}: [{i}].idx: {link.idx!r} stands there twice")
        seen.add(link.idx)
        for key, node in (("from_node_idx", link.from_node_idx), ("to_node_idx", link.to_node_idx)):
            if node is not None and node not in nodes:
                raise DocumentError(f"{source}: [{i}].{key}: node_set.json has no node {node!r}")
        if link.from_node_idx is not None:
            starts.setdefault(link.from_node_idx, []).append(row)
        lines.append(_line(link, f"{source}: [{i}].points"))
    return Roads(
        [link.idx for _, link in lanes],
        lines,
        [starts.get(link.to_node_idx, []) if link.to_node_idx is not None else [] for _, link in lanes],
        [_width(link) for _, link in lanes],
        [max(link.max_speed or 0.0, 0.0) * KMH for _, link in lanes],
    )


def _line(link: _Link, where: str) -> FloatArray:
    """(k, 3) the centre line [m]."""
    line = np.array(link.points, dtype=np.float64).reshape(-1, 3)
    # Checked here for all points at once: a city has a million of them.
    wild = np.flatnonzero(~(np.abs(line) <= MAX_COORDINATE).all(axis=1))
    if len(wild):
        raise DocumentError(f"{where}[{wild[0]}]: expected coordinates within {MAX_COORDINATE:,.0f} m")
    if not (line[1:, :2] != line[:1, :2]).any():
        raise DocumentError(f"{where}: expected two different points at least, got {len(line)} in one place")
    return line


MAX_COORDINATE: Final = 1e7
"""Metres from the map's own origin: no map is that large, and arc lengths stay exact to the nanometre."""


def _width(link: _Link) -> float:
    is_given = link.force_width_start and link.width_start is not None and link.width_start > 0.0
    return float(link.width_start or LANE_WIDTH) if is_given else LANE_WIDTH
