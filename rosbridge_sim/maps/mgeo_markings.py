"""Markings and signs of an MGeo map, for drawings: arrows and letters on the road, and plates beside it.

`type` and `sub_type` are numbers of Korea's Road Traffic Act (Enforcement Rule, annex 6): 1 warns, 2 regulates, 3
directs, 4 adds to another sign, 5 is painted on the road, and 532 of these are crosswalks, which have files of their
own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Final

from msgspec import Meta

from rosbridge_sim.documents.document_model import Coordinate, Document, DocumentType, Number
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.mgeo_links import MAX_LINKS, MAX_MAP_BYTES, Identifier, read_line
from rosbridge_sim.maps.road_map import Marking, Sign

MARKING_FILE, SIGN_FILE = "surface_marking_set.json", "traffic_sign_set.json"

MAX_CORNERS: Final = 200
"""Most corners of a marking: a letter has thirty."""

_CROSSWALK: Final = "532"

_Point = tuple[Coordinate, Coordinate, Coordinate]


class _Marking(Document, frozen=True, kw_only=True):
    idx: Identifier
    points: list[tuple[Number, Number, Number]]
    sub_type: Identifier | None = None


class _Sign(Document, frozen=True, kw_only=True):
    idx: Identifier
    point: _Point
    heading: Number | None = None
    type: Identifier | None = None
    width: Number | None = None
    height: Number | None = None


_MARKINGS: Final = DocumentType[list[_Marking]](Annotated[list[_Marking], Meta(max_length=MAX_LINKS)])
_SIGNS: Final = DocumentType[list[_Sign]](Annotated[list[_Sign], Meta(max_length=MAX_LINKS)])


def read_markings(files: Mapping[str, tuple[bytes, str]], notes: list[str]) -> tuple[Marking, ...]:
    """Return what is painted on the roads beside lines and crosswalks; nothing drives by it.

    Args:
        files: content and name for errors, by kind; `markings` is optional.
        notes: gets a remark if the file cannot be read, or if outlines are left out.
    """
    if "markings" not in files:
        return ()
    found, num_left_out = [], 0
    try:
        entries = read_document(_MARKINGS, *files["markings"], MAX_MAP_BYTES)
        for i, entry in enumerate(entries):
            if (entry.sub_type or "").startswith(_CROSSWALK):
                continue
            if not 3 <= len(entry.points) <= MAX_CORNERS:  # noqa: PLR2004 - an area has three corners
                num_left_out += 1
                continue
            found.append(Marking(entry.idx, read_line(entry.points, f"{files['markings'][1]}: [{i}].points")))
    except DocumentError as error:
        notes.append(f"nothing is drawn of it: {error}")
        return ()
    if num_left_out:
        notes.append(f"{MARKING_FILE}: {num_left_out} markings without 3 to {MAX_CORNERS} corners are not drawn")
    return tuple(found)


def read_signs(files: Mapping[str, tuple[bytes, str]], notes: list[str]) -> tuple[Sign, ...]:
    """Return the signs beside the roads; nothing drives by them.

    Args:
        files: content and name for errors, by kind; `signs` is optional.
        notes: gets a remark if the file cannot be read.
    """
    try:
        entries = read_document(_SIGNS, *files["signs"], MAX_MAP_BYTES) if "signs" in files else []
    except DocumentError as error:
        notes.append(f"nothing is drawn of it: {error}")
        return ()
    return tuple(
        Sign(
            *(entry.idx, *entry.point, math.radians(math.remainder(entry.heading or 0.0, 360.0))),
            kind=(entry.type or "")[:1],
            width=_side(entry.width),
            height=_side(entry.height),
        )
        for entry in entries
    )


USUAL_SIDE, LARGEST_SIDE = 0.6, 8.0
"""Side of a sign that the file does not tell or that is none, and largest side that is drawn [m]."""


def _side(length: float | None) -> float:
    return min(length, LARGEST_SIDE) if length is not None and length >= 0.1 else USUAL_SIDE  # noqa: PLR2004 - metres
