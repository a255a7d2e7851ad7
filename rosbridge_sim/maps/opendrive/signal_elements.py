"""Traffic lights, signs, stop lines and crosswalks of OpenDRIVE roads, placed on the lanes of the map.

A light holds for the lanes of its `validity`. Where that names none (or lane 0 alone, as CARLA writes), its orientation
counts. CARLA's files write orientations the other way round than ASAM's text, so they never count against a validity.
A light on a road within a junction controls the lanes that begin there; one on another road controls those behind its
end, or, where no junction follows, the lanes behind itself. References to a light (CARLA has one on each road within a
junction) take the place of its own place.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from rosbridge_sim.documents.xml_documents import Element
from rosbridge_sim.maps.opendrive.lane_layout import NEAR_CUT, LanePiece, frame_at
from rosbridge_sim.maps.opendrive.lane_links import find_circles
from rosbridge_sim.maps.opendrive.road_elements import MAX_LANE_ID, Road, is_stop_line
from rosbridge_sim.maps.road_map import Crosswalk, Sign
from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.signal_plan import Light

CAR_LIGHT, WALK_LIGHT = "1000001", "1000002"
"""Types of lights with three lamps and of lights for pedestrians, in the catalogue of the country "OpenDRIVE"."""

STOP_SIGNS: Final = frozenset({"205", "206", "294"})
"""German numbers, which OpenDRIVE's own catalogue has taken over: yield, stop, and the stop line."""

_COUNTRIES: Final = frozenset({"", "opendrive", "de", "deu", "germany"})

NEAR_JUNCTION: Final = 8.0
"""A stop line this far before a junction, or within one behind its edge, holds at the edge [m]."""

LOWEST: Final = 2.5
"""Lights hang at least so high above the road [m]; CARLA gives the height of the post's foot."""

LANE_HALF: Final = 1.0
"""A stop line is for the lanes whose middle is not farther beyond its ends than this [m]."""

_DEFAULT_LENGTH: Final = 4.0


class StopPlace(Record):
    """A stop line or a sign that means one.

    Attributes:
        s: distance along the road [m].
        lanes: ids; None for all of a direction.
        is_forward: it holds for lanes that are driven along the road; None for both directions.
        aside: middle and half length of a painted line [m]; then lanes and direction do not count.
    """

    s: float
    lanes: frozenset[int] | None = None
    is_forward: bool | None = None
    aside: tuple[float, float] | None = None

    def holds_for(self, lane: int, middle: float, *, is_forward: bool) -> bool:
        """Return whether it holds for a lane.

        Args:
            middle: distance of the lane's middle to the left of the reference line [m].
        """
        if self.aside is not None:
            return abs(middle - self.aside[0]) < self.aside[1] + LANE_HALF
        if self.lanes is not None:
            return lane in self.lanes
        return self.is_forward in {None, is_forward}


def find_stops(road: Road) -> list[StopPlace]:
    """Return the stop lines of a road, in any of the four ways in which files write them.

    These are signals of `STOP_SIGNS`; objects that are named StopLine; and objects of the type `roadMark` with the
    subtype `signalLines` or `stopLine`.
    """
    found = [
        _place_of(one)
        for one in road.signals
        if one.tag == "signal" and one.word("type", "") in STOP_SIGNS and one.word("country", "").lower() in _COUNTRIES
    ]
    for one in road.objects:
        if is_stop_line(one):
            length = max(one.number("length", _DEFAULT_LENGTH), one.number("width", 0.0))
            found.append(StopPlace(one.number("s"), aside=(one.number("t"), 0.5 * length - LANE_HALF)))
    return found


def find_stop_cuts(road: Road) -> set[float]:
    """Return the places at which a road is cut for its stop lines and for lights that no junction follows."""
    cuts = {
        place.s
        for place in find_stops(road)
        if not any(_is_at_junction(road, place.s, is_forward=is_forward) for is_forward in (True, False))
    }
    for one in () if road.junction else filter(is_light, road.signals):
        place = _place_of(one)
        ends = [end for end, way in ((road.after, True), (road.before, False)) if place.is_forward in {None, way}]
        if not any(end is not None and end.junction for end in ends):
            cuts.add(place.s)
    return cuts


def is_light(element: Element) -> bool:
    """Return whether an element is a traffic light of a type that is read."""
    if element.tag != "signal" or element.word("dynamic", "no") != "yes":
        return False
    return element.word("type", "") in {CAR_LIGHT, WALK_LIGHT}


def _place_of(element: Element) -> StopPlace:
    """Return the place and the lanes of a signal or a reference."""
    lanes = {
        lane
        for part in element.all("validity")
        for lane in range(part.whole("fromLane", None, MAX_LANE_ID), part.whole("toLane", None, MAX_LANE_ID) + 1)
    } - {0}
    way = element.choice("orientation", ("+", "-", "none"), "none")
    return StopPlace(element.number("s"), frozenset(lanes) if lanes else None, None if way == "none" else way == "+")


def _is_at_junction(road: Road, s: float, *, is_forward: bool) -> bool:
    """Return whether a stop line for one direction is so near to a junction that it holds at the junction's edge."""
    end = road.after if is_forward else road.before
    if road.junction:  # within one: lanes begin at its edge
        return (s if is_forward else road.length - s) < NEAR_JUNCTION
    leads_in = end is not None and bool(end.junction)
    return leads_in and (road.length - s if is_forward else s) < NEAR_JUNCTION


class LanesOfRoads:
    """The lanes of the map by road, with what follows them.

    Attributes:
        stops: rows of the lanes that end at a stop line.
    """

    def __init__(
        self, roads: Mapping[str, Road], pieces: Sequence[LanePiece], successors: Sequence[Sequence[int]]
    ) -> None:
        self.roads, self.pieces, self.successors = roads, pieces, successors
        self.predecessors: list[list[int]] = [[] for _ in pieces]
        for row, after in enumerate(successors):
            for other in after:
                self.predecessors[other].append(row)
        self.of_road: dict[str, list[int]] = defaultdict(list)
        for row, piece in enumerate(pieces):
            self.of_road[piece.road].append(row)

    def find_stop_rows(self) -> set[int]:
        """Return the lanes that end at a stop line."""
        return {row for road in self.roads.values() for place in find_stops(road) for row in self._ends_at(road, place)}

    def find_circle_entries(self) -> set[int]:
        """Return the lanes that lead into a junction of a roundabout from outside: they give way, as signs would say.

        Few files have the signs. Without them the rule of the right lets in those who enter, and a circle fills up.
        """
        circles = find_circles(self.pieces, self.successors)
        entries = {entry for lane in circles for entry in self.predecessors[lane]} - circles
        within = [entry for entry in entries if self.roads[self.pieces[entry].road].junction]
        return {row for entry in within for row in self.predecessors[entry]} - circles

    def controlled(self, road: Road, place: StopPlace) -> Iterator[int]:
        """Yield the lanes that a light controls, by a place of it or of a reference to it."""
        for row in self.of_road[road.id]:
            piece = self.pieces[row]
            if not place.holds_for(piece.lane, 0.0, is_forward=piece.is_forward):
                continue
            if road.junction:
                if not any(self.pieces[before].road == road.id for before in self.predecessors[row]):
                    yield row
                continue
            end = road.after if piece.is_forward else road.before
            if end is not None and end.junction:
                yield from (after for after in self.successors[row] if self.pieces[after].road != road.id)
            elif abs(float(piece.s[0]) - place.s) < NEAR_CUT:
                yield row

    def _ends_at(self, road: Road, place: StopPlace) -> Iterator[int]:
        """Yield the lanes that end at a stop line of a road."""
        for row in self.of_road[road.id]:
            piece = self.pieces[row]
            middle = float(piece.aside[np.abs(piece.s - place.s).argmin()])
            if not (_is_at(piece, place.s) and place.holds_for(piece.lane, middle, is_forward=piece.is_forward)):
                continue
            if not _is_at_junction(road, place.s, is_forward=piece.is_forward):
                if abs(float(piece.s[-1]) - place.s) < NEAR_CUT:
                    yield row
            elif road.junction:
                yield from self.predecessors[row]
            elif not any(self.pieces[after].road == road.id for after in self.successors[row]):
                yield row


class SignalGroup(Record):
    """Lights that show the same.

    Attributes:
        lights: rows of the lights.
        lanes: rows of the lanes that they control; for pedestrians of the lanes that they cross.
        is_pedestrian: they are for pedestrians.
        width: of the road that pedestrians cross [m].
    """

    lights: tuple[int, ...]
    lanes: frozenset[int]
    is_pedestrian: bool = False
    width: float = 0.0


class SignalsRead(Record):
    """The signals of a map.

    Attributes:
        lights: all traffic lights.
        crossed: for each light for pedestrians, the lanes of the road that it stands at.
        signs: all other signals.
        kinds: types of dynamic signals that are not read.
    """

    lights: tuple[Light, ...]
    crossed: Mapping[int, frozenset[int]]
    signs: tuple[Sign, ...]
    kinds: tuple[str, ...]


def read_signals(lanes: LanesOfRoads) -> SignalsRead:
    """Return the lights and signs of a map.

    Raises:
        DocumentError: element, id and line of what cannot be used.
    """
    references: dict[str, list[tuple[Road, StopPlace]]] = defaultdict(list)
    for road, one in _signals_of(lanes.roads, "signalReference"):
        references[one.word("id")].append((road, _place_of(one)))
    lights: dict[str, Light] = {}
    crossed: dict[int, frozenset[int]] = {}
    signs, kinds = [], []
    for road, one in _signals_of(lanes.roads, "signal"):
        if not is_light(one):
            if one.word("dynamic", "no") == "yes":
                kinds.append(one.word("type", "none"))
            signs.append(_read_sign(road, one))
            continue
        name, place = one.word("id"), _place_of(one)
        if name in lights:
            raise one.error("id", "each traffic light once", name)
        served: tuple[int, ...] = ()
        if one.word("type", "") == WALK_LIGHT:
            own = (row for row in lanes.of_road[road.id] if _is_at(lanes.pieces[row], place.s))
            crossed[len(lights)] = frozenset(own)
        else:
            places = references.get(name, [(road, place)])
            served = tuple(dict.fromkeys(row for each in places for row in lanes.controlled(*each)))
        lights[name] = _make_light(road, one, lanes, served)
    return SignalsRead(tuple(lights.values()), crossed, tuple(signs), tuple(kinds))


def _signals_of(roads: Mapping[str, Road], tag: str) -> Iterator[tuple[Road, Element]]:
    return ((road, one) for road in roads.values() for one in road.signals if one.tag == tag)


def _read_sign(road: Road, element: Element) -> Sign:
    x, y, z, yaw = frame_at(road, element.number("s"), element.number("t", 0.0))
    is_back = element.word("orientation", "none") == "-"
    facing = yaw + element.number("hOffset", 0.0) + (0.0 if is_back else math.pi)
    kind = element.word("type", "")
    known = kind[:1] if len(kind) == 3 and kind.isdecimal() else ""  # noqa: PLR2004 - German numbers
    z += element.number("zOffset", 0.0)
    return Sign(element.word("id"), x, y, z, math.remainder(facing, 2.0 * math.pi), kind=known)


def _make_light(road: Road, element: Element, lanes: LanesOfRoads, served: tuple[int, ...]) -> Light:
    s, t = element.number("s"), element.number("t", 0.0)
    x, y, z, yaw = frame_at(road, s, t)
    z = max(z + element.number("zOffset", 0.0), frame_at(road, s, 0.0)[2] + LOWEST)
    is_walk = element.word("type", "") == WALK_LIGHT
    if is_walk:
        facing = yaw + element.number("hOffset", 0.0)
    elif served:
        line = lanes.pieces[served[0]].line
        facing = math.atan2(*(line[1] - line[0])[1::-1]) + math.pi
    else:
        facing = yaw + math.pi
    facing = math.remainder(facing, 2.0 * math.pi)
    return Light(element.word("id"), is_pedestrian=is_walk, lanes=served, x=x, y=y, z=z, yaw=facing)


def _is_at(piece: LanePiece, s: float) -> bool:
    low, high = sorted((float(piece.s[0]), float(piece.s[-1])))
    return low - NEAR_CUT <= s <= high + NEAR_CUT


# Crosswalks


def read_crosswalks_of(roads: Collection[Road], lights: Sequence[Light]) -> Iterator[Crosswalk]:
    """Yield the crosswalks of roads, with the lights for pedestrians near each."""
    for road in roads:
        for one in road.objects:
            if one.word("type", "").lower() == "crosswalk":
                outlines = tuple(each for each in _outlines(road, one) if len(each) > 2)  # noqa: PLR2004 - an area
                if outlines:
                    near = [
                        row for row, light in enumerate(lights) if light.is_pedestrian and _is_near(light, outlines)
                    ]
                    yield Crosswalk(one.word("id", ""), outlines, tuple(near))


NEAR_CROSSWALK: Final = 4.0
"""A light for pedestrians nearer than this to a corner of a crosswalk belongs to it [m]."""


def _is_near(light: Light, outlines: Iterable[FloatArray]) -> bool:
    away = min(float(np.hypot(each[:, 0] - light.x, each[:, 1] - light.y).min()) for each in outlines)
    return away < NEAR_CROSSWALK


def _outlines(road: Road, element: Element) -> Iterator[FloatArray]:
    """Yield the outlines of an object, (k, 3) [m]; that of its length and width if it has none."""
    s, t = element.number("s"), element.number("t", 0.0)
    x, y, z, heading = frame_at(road, s, t)
    turn = heading + element.number("hdg", 0.0)
    z += element.number("zOffset", 0.0)
    cos, sin = math.cos(turn), math.sin(turn)
    parts = [*element.all("outline"), *(one for all_of in element.all("outlines") for one in all_of.all("outline"))]
    if not parts:
        u, v = (0.5 * element.number(key, 0.0) for key in ("length", "width"))
        if u and v:
            corners = [(u, v), (u, -v), (-u, -v), (-u, v)]
            yield np.array([(x + cos * a - sin * b, y + sin * a + cos * b, z) for a, b in corners])
    for part in parts:
        points = []
        for corner in part.children:
            if corner.tag == "cornerLocal":
                a, b = corner.number("u"), corner.number("v")
                points.append((x + cos * a - sin * b, y + sin * a + cos * b, z + corner.number("z", 0.0)))
            elif corner.tag == "cornerRoad":
                points.append(frame_at(road, corner.number("s"), corner.number("t"))[:3])
        yield np.array(points).reshape(-1, 3)
