"""MGeo maps: the JSON files of a map folder -> projection, lanes, traffic lights and crosswalks.

`node_set.json` and `link_set.json` are required. The other files of `MAP_FILES` are optional: a map without them has no
georeference, or no lights, or no crosswalks, or lane edges at half the lane's width, or no signs and arrows. Other
files may be passed too; they are ignored. `links` reads the lanes, and `lights` reads the traffic lights.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.documents.document_model import Coordinate, Document, DocumentType
from rosbridge_sim.documents.document_reading import find_mistakes, read_document
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.mgeo_lights import (
    CROSSWALK_FILES,
    LIGHT_FILES,
    LIGHT_KINDS,
    read_crosswalks,
    read_lights,
    sort_files,
)
from rosbridge_sim.maps.mgeo_links import LANE_KINDS, MAX_MAP_BYTES, Identifier, read_lanes
from rosbridge_sim.maps.mgeo_markings import MARKING_FILE, SIGN_FILE, read_markings, read_signs
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.surface import Surface

FILES: Final = ("node_set.json", "link_set.json")
"""Files that `read_mgeo` requires."""

INFO_FILE: Final = "global_info.json"
"""The map's place on the globe."""

BORDER_FILES: Final = ("lane_marking_set.json", "lane_boundary_set.json")
"""Edges of lanes, by their old and their new name. If a folder has both, the old one is read."""

MAP_FILES: Final = (INFO_FILE, *FILES, *BORDER_FILES, *LIGHT_FILES, *CROSSWALK_FILES, MARKING_FILE, SIGN_FILE)
"""All files that `read_mgeo` reads."""

Point = tuple[Coordinate, Coordinate, Coordinate]


class _GlobalInfo(Document, frozen=True, kw_only=True):
    global_coordinate_system: Identifier
    local_origin_in_global: Point = (0.0, 0.0, 0.0)


_GLOBAL_INFO: Final = DocumentType[_GlobalInfo](_GlobalInfo)
KINDS: Final[dict[str, DocumentType[Any]]] = {"info": _GLOBAL_INFO, **LANE_KINDS, **LIGHT_KINDS}
"""Form of each kind of file whose mistakes refuse a map."""

NO_PROJECTION: Final = Projection(is_tm=False, ellipse="", scale_factor=0.0)
"""The projection of a map that does not tell its own."""


def read_mgeo(files: Mapping[str, bytes], source: str) -> RoadMap:
    """Read a map.

    Args:
        files: contents by file name; `FILES` are required, the others of `MAP_FILES` are optional.
        source: the map's folder, for errors; its last part is the map's name.

    Raises:
        DocumentError: one line: file, place in it, expected value, actual value.
    """
    name, known = _name_files(files, source)
    projection, origin, notes = _read_georeference(known.get("info"))
    lanes = read_lanes(known)
    if not len(lanes.roads):
        got = " and ".join(f"{len(names):,} of type {kind}" for kind, names in lanes.left_out.items()) or "none"
        raise DocumentError(f"{known['links'][1]}: expected at least one link to drive on, got {got}")
    if not lanes.roads.is_flat:
        lanes.roads.derived(Surface)  # here and not at the first step: a large city needs a second
    notes += [_no_roads_note(kind, names) for kind, names in lanes.left_out.items()]
    plan = read_lights(known, lanes, notes)
    crosswalks = read_crosswalks(known, plan)
    markings, signs = read_markings(known, notes), read_signs(known, notes)
    return RoadMap(
        *(name, projection, origin, lanes.roads),
        plan=plan if plan.lights else SignalPlan(lanes.roads),
        crosswalks=crosswalks,
        notes=tuple(_short(notes)),
        borders=lanes.borders,
        markings=markings,
        signs=signs,
    )


def find_mgeo_mistakes(files: Mapping[str, bytes], source: str) -> list[str]:
    """Return all mistakes in the values of a map; if there are none, the first mistake in their meaning.

    Args:
        files: contents by file name, as for `read_mgeo`.
        source: the map's folder, for errors.

    Returns:
        A line for each mistake.
    """
    try:
        _, known = _name_files(files, source)
        given = [(form, known[kind]) for kind, form in KINDS.items() if kind in known]
        found = [mistake for form, file in given for mistake in find_mistakes(form, *file, MAX_MAP_BYTES)]
        if not found:
            read_mgeo(files, source)
    except DocumentError as error:
        return [str(error)]
    return [mistake.text for mistake in found]


def _read_georeference(file: tuple[bytes, str] | None) -> tuple[Projection, Point, list[str]]:
    """Return the projection and the origin of a map, and a remark if it tells neither."""
    if file is None:
        return NO_PROJECTION, (0.0, 0.0, 0.0), [f"{INFO_FILE} is missing: no georeference, so /gps has no fix"]
    info = read_document(_GLOBAL_INFO, *file, MAX_MAP_BYTES)
    return read_projection(info.global_coordinate_system, file[1]), info.local_origin_in_global, []


def _name_files(files: Mapping[str, bytes], source: str) -> tuple[str, dict[str, tuple[bytes, str]]]:
    """Return the map's name, and the content and the name in errors of each file that is read, by kind.

    Raises:
        DocumentError: a required file is missing.
    """
    name = re.split(r"[\\/]", source.rstrip("\\/"))[-1]
    missing = next((file for file in FILES if file not in files), None)
    if missing is not None:
        raise DocumentError(f"{source}: {missing} is missing")
    return name, sort_map_files({file: (files[file], f"{name}/{file}") for file in MAP_FILES if file in files})


def sort_map_files(files: Mapping[str, tuple[bytes, str]]) -> dict[str, tuple[bytes, str]]:
    """Find the files that are read, by kind: those of `KINDS`, `markings` and `signs`.

    Args:
        files: content and name for errors, by file name.
    """
    border_file = next((file for file in BORDER_FILES if file in files), "")
    kinds = ("info", "nodes", "links", "borders", "stripes", "crosswalks", "markings", "signs")
    named = zip(kinds, (INFO_FILE, *FILES, border_file, *CROSSWALK_FILES, MARKING_FILE, SIGN_FILE), strict=True)
    return {**{kind: files[file] for kind, file in named if file in files}, **sort_files(files)}


def _no_roads_note(kind: str, names: Sequence[str]) -> str:
    shown = ", ".join([name[:MAX_NAME] for name in names[:MAX_NAMES]] + ["..."] * (len(names) > MAX_NAMES))
    return f"links of type {kind} are no road for vehicles and left out: {len(names):,} ({shown})"


MAX_NAMES: Final = 5
"""Links of one type that a note names."""

MAX_NAME: Final = 80
"""Characters of each that it shows."""


def _short(notes: list[str]) -> list[str]:
    """Return the first few lines of many, because a map that lacks one thing often lacks it everywhere."""
    if len(notes) <= MAX_MAP_NOTES:
        return notes
    return [*notes[:MAX_MAP_NOTES], f"... and {len(notes) - MAX_MAP_NOTES} more of that kind"]


MAX_MAP_NOTES: Final = 20

_SHORT_UTM = re.compile(r"UTM[ _-]?(?P<zone>\d{1,2})(?P<half>[NS]?)", re.IGNORECASE)


def read_projection(text: str, source: str) -> Projection:
    """Read a `global_coordinate_system`: proj4 text of a UTM zone or a TM, or the old form "UTM52N".

    Args:
        source: name of its file, for errors.

    Raises:
        DocumentError: another projection, or a value that is not a number.
    """
    where = f"{source}: global_coordinate_system"
    short = _SHORT_UTM.fullmatch(text.strip())
    if short:
        return _utm(_zone(short["zone"], where), "WGS84", text, is_south=short["half"].upper() == "S")
    terms = dict(term.lstrip("+").partition("=")[::2] for term in text.split() if term.startswith("+"))
    # A datum implies its ellipsoid. WGS84, the datum of published maps, has the same name as its ellipsoid.
    ellipse = terms.get("ellps") or terms.get("datum") or "WGS84"
    kind = terms.get("proj", "").casefold()
    if kind == "utm":
        return _utm(_zone(terms.get("zone", ""), where), ellipse, text, is_south="south" in terms)
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


def _utm(zone: int, ellipse: str, text: str, *, is_south: bool) -> Projection:
    """Return a UTM zone. Zones are 6 degrees wide, from 180 degrees west on; the other figures are the same for all."""
    return Projection(
        is_tm=False,
        zone=zone,
        is_south=is_south,
        ellipse=ellipse,
        central_meridian=6.0 * zone - 183.0,
        scale_factor=0.9996,
        false_easting=500_000.0,
        false_northing=10_000_000.0 if is_south else 0.0,
        text=text,
    )


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
