"""OpenDRIVE files: the pieces of a file -> the map.

A road is laid out as soon as its element is complete, and its element is dropped then. Links, lights and the rest
follow when all roads are known.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from rosbridge_sim.documents.xml_documents import Element, read_children
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.mgeo import NO_PROJECTION, read_projection
from rosbridge_sim.maps.opendrive.default_signals import plan_signals
from rosbridge_sim.maps.opendrive.lane_layout import (
    MAX_POINTS,
    LanePiece,
    RoadLayouts,
    SectionLayout,
    lay_lanes,
    paint_marks,
)
from rosbridge_sim.maps.opendrive.lane_links import (
    MAX_TOLD,
    find_cuts,
    find_followers,
    find_neighbours,
    spread_cuts,
    tell,
)
from rosbridge_sim.maps.opendrive.plan_view import Joint, find_torn_joints
from rosbridge_sim.maps.opendrive.road_elements import (
    MAX_COORDINATE,
    READ,
    ROADWAY,
    Junction,
    Road,
    count_unused,
    read_junction,
    read_road,
)
from rosbridge_sim.maps.opendrive.signal_elements import (
    LanesOfRoads,
    SignalsRead,
    find_stop_cuts,
    read_crosswalks_of,
    read_signals,
)
from rosbridge_sim.maps.road_map import Border, RoadMap
from rosbridge_sim.maps.road_positions import RoadPositions, RoadSpan
from rosbridge_sim.records import replace
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.surface import Surface

ROOT: Final = "OpenDRIVE"

MAX_LANES: Final = 100_000

MAX_METRES: Final = 1e7
"""Length of all lanes [m]: a country has as much. Lanes are compared at places a metre apart."""

MAX_KINDS: Final = 20
"""Kinds of unused elements that a note names."""


def read_opendrive(pieces: Iterable[bytes], source: str) -> RoadMap:
    """Read a map.

    Args:
        pieces: the file's bytes, in pieces of any length.
        source: path of the file, for errors; its last part without the suffix is the map's name.

    Raises:
        DocumentError: one line: file, line, element with its id, expected value, actual value.
    """
    name = re.split(r"[\\/]", source)[-1]
    reading = _Reading()
    try:
        for element in read_children(pieces, name, ROOT):
            reading.take(element)
        return reading.finish(re.sub(r"\.xodr$", "", name, flags=re.IGNORECASE), name)
    finally:
        reading.let_go()


class _Reading:
    """The parts that have been read so far."""

    def __init__(self) -> None:
        self._projection, self._origin = NO_PROJECTION, (0.0, 0.0, 0.0)
        self._roads: dict[str, Road] = {}
        self._junctions: dict[str, Junction] = {}
        self._controllers: dict[str, list[str]] = {}
        self._pieces: list[LanePiece] = []
        self._borders: list[Border] = []
        self._num_points, self._metres = 0, 0.0
        self._unused: Counter[str] = Counter()
        self._lane_types: Counter[str] = Counter()
        self._narrow: list[str] = []
        self._torn: list[tuple[Joint, str]] = []
        self._notes: list[str] = []

    def take(self, element: Element) -> None:
        """Take a child of the root."""
        count_unused(element, self._unused)
        if element.tag == "road":
            self._take_road(element)
        elif element.tag == "junction":
            junction = read_junction(element)
            if junction.id in self._junctions:
                raise element.error("id", "each junction once", junction.id)
            self._junctions[junction.id] = junction
        elif element.tag == "controller":
            signals = self._controllers.setdefault(element.word("id"), [])
            signals += (one.word("signalId") for one in element.all("control"))
        elif element.tag == "header":
            self._take_header(element)
        elif element.tag not in READ:
            self._unused[element.tag] += 1

    def finish(self, name: str, source: str) -> RoadMap:
        """Return the map."""
        pieces = self._pieces
        if not pieces:
            got = _list_kinds(self._lane_types) or "none"
            raise DocumentError(f"{source}: expected at least one lane to drive on, got {got}")
        successors, link_notes = find_followers(self._roads, self._junctions.values(), pieces)
        left, right = find_neighbours(self._roads, pieces)
        lanes = LanesOfRoads(self._roads, pieces, successors)
        stops = lanes.find_stop_rows()
        entries = lanes.find_circle_entries() - stops
        if entries:
            self._notes.append(f"{len(entries):,} lanes into roundabouts without a stop line or a sign: they give way")
        roads = Roads(
            [piece.name for piece in pieces],
            [piece.line for piece in pieces],
            successors,
            [piece.width for piece in pieces],
            [piece.speed_limit for piece in pieces],
            left=left,
            right=right,
            is_stop=[row in stops or row in entries for row in range(len(pieces))],
            borders={row: piece.border for row, piece in enumerate(pieces)},
            banks={row: piece.bank for row, piece in enumerate(pieces) if piece.bank is not None},
        )
        # The lanes have the lines now; of a piece only its direction at the start is still needed.
        pieces[:] = [replace(one, line=one.line[:2].copy(), border=np.zeros((0, 2)), bank=None) for one in pieces]
        if not roads.is_flat:
            roads.derived(Surface)  # here and not at the first step: a large map needs a second
        signals = read_signals(lanes)
        plan = plan_signals(roads, lanes, signals, self._controllers)
        self._note_signals(signals, plan)
        spans = [RoadSpan(one.road, one.lane, one.s, one.aside) for one in pieces]
        return RoadMap(
            *(name, self._projection, self._origin, roads),
            plan=plan,
            crosswalks=tuple(read_crosswalks_of(self._roads.values(), signals.lights)),
            signs=signals.signs,
            notes=(*self._notes, *link_notes, *self._final_notes()),
            borders=tuple(self._borders),
            positions=RoadPositions(roads, spans, RoadLayouts(self._roads)),
        )

    def let_go(self) -> None:
        """Free what was read bit by bit: freed at once, a map of 100 MB would hold up other threads for 50 ms."""
        for kept in (self._roads, self._junctions):
            while kept:
                kept.popitem()
        while self._pieces:
            self._pieces.pop()

    def _take_header(self, element: Element) -> None:
        offset = element.first("offset")
        if offset is not None:
            x, y, z = (offset.number(key, 0.0, -MAX_COORDINATE, MAX_COORDINATE) for key in "xyz")
            self._origin = (x, y, z)
            if offset.number("hdg", 0.0):
                self._notes.append("the header's offset has a heading, which is not used: positions of GPS are turned")
        found = element.first("geoReference")
        text = "" if found is None else found.text.strip()
        if not text:
            self._notes.append("there is no <geoReference>, so /gps has no fix")
            return
        try:
            self._projection = read_projection(text, "<geoReference>")
        except DocumentError as error:
            self._notes.append(f"no fix of /gps: {error}")

    def _take_road(self, element: Element) -> None:
        road = read_road(element)
        if road.id in self._roads:
            raise element.error("id", "each road once", road.id)
        self._roads[road.id] = road
        self._torn += ((joint, road.id) for joint in find_torn_joints(road.shapes))
        cuts = find_stop_cuts(road)
        for number, section in enumerate(road.sections):
            kept = spread_cuts(cuts | find_cuts(road, section), section)
            layout = SectionLayout(road, section, kept)
            self._num_points += layout.edges.size
            if self._num_points > MAX_POINTS:
                raise element.error("", f"a map of at most {MAX_POINTS:,} points; this road is one too many")
            own = list(lay_lanes(road, number, layout, kept))
            self._pieces += own
            self._metres += sum(one.length for one in own)
            if self._metres > MAX_METRES:
                raise element.error("", f"a map of at most {MAX_METRES / 1e3:,.0f} km of lanes; this road is too much")
            self._borders += paint_marks(road, number, layout)
            self._count_left_out(road, number, own)
            if len(self._pieces) > MAX_LANES:
                raise element.error("", f"a map of at most {MAX_LANES:,} lanes; this road is one too many")

    def _count_left_out(self, road: Road, number: int, own: Sequence[LanePiece]) -> None:
        laid = {piece.lane for piece in own}
        for name, lane in road.sections[number].lanes.items():
            if name and lane.type not in ROADWAY:
                self._lane_types[lane.type] += 1
            elif name and name not in laid:
                self._narrow.append(f"{road.id}.{number}.{name}")

    def _note_signals(self, signals: SignalsRead, plan: SignalPlan) -> None:
        if plan.lights:
            num = len(plan.controllers)
            self._notes.append(f"OpenDRIVE has no times of lights: {num:,} junctions with lights have a default plan")
        if signals.kinds:
            self._notes.append(f"lights of other types are drawn as signs: {_list_kinds(Counter(signals.kinds))}")

    def _final_notes(self) -> list[str]:
        """Return the notes about what was left out, at the end of those about mistakes."""
        notes = []
        if self._torn:
            self._torn.sort(reverse=True)
            texts = [
                f"road {name} at {joint.s:.2f} m: {100.0 * joint.gap:.0f} cm, {math.degrees(joint.kink):.0f} degrees"
                for joint, name in self._torn[: MAX_TOLD + 1]
            ]
            what = "places at which two shapes of a reference line do not meet, by more than 1 cm or 1 degree"
            notes.append(tell(what, texts, len(self._torn)))
        if self._narrow:
            notes.append(tell("lanes without width or length are left out", self._narrow))
        if self._lane_types:
            notes.append(f"lanes that are no road for vehicles are left out: {_list_kinds(self._lane_types)}")
        if self._unused:
            notes.append(f"elements that have no meaning here: {_list_kinds(self._unused, '')}")
        return notes


def _list_kinds(counted: Counter[str], what: str = "of type ") -> str:
    """Return the commonest kinds of things with their numbers."""
    shown = [f"{num:,} {what}{kind}" for kind, num in counted.most_common(MAX_KINDS)]
    return ", ".join(shown) + (", ..." if len(counted) > MAX_KINDS else "")
