"""Roads and junctions of OpenDRIVE as records: the values of their XML elements, checked, without any geometry.

What a file holds beside these and the tables of `READ` has no meaning here; `Unused` counts it by name for a note.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from operator import attrgetter, itemgetter
from typing import Final

import numpy as np

from rosbridge_sim.documents.xml_documents import MAX_XML_NUMBER, Element
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive.plan_view import PlanShape
from rosbridge_sim.records import Record
from rosbridge_sim.units import KMH_TO_MPS
from rosbridge_sim.world.geometry.planar import FloatArray

MAX_COORDINATE: Final = 1e7
"""Largest distance from the file's own origin [m], as in MGeo maps."""

MAX_LENGTH: Final = 1e6
"""Longest road and shape [m]."""

MAX_CURVATURE: Final = 100.0
"""Greatest curvature of a shape [1/m]: exporters write corners of a few centimetres."""

MAX_LANE_ID: Final = 200

SHARED: Final = 4096
"""Marks and tables of polynomials that are kept for lanes with the same ones: most have. Each is an object less to make
and to free; a large map is freed at once, while the event loop waits."""

MPH_TO_MPS: Final = 0.44704
_UNITS: Final = {"m/s": 1.0, "km/h": KMH_TO_MPS, "mph": MPH_TO_MPS}
_NO_LIMIT: Final = frozenset({"no limit", "undefined", ""})

# Records of this module hold no circles, so Python's collector need not look at them: in a map of 8,000 roads they
# are a million, and a look at all of them would hold up the event loop for a second.

ROADWAY: Final = frozenset(
    {
        *("driving", "bidirectional", "parking", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane"),
        *("mwyEntry", "mwyExit"),
    }
)
"""Types of lanes that become lanes of the map."""


class RoadEnd(Record, gc=False):
    """The end of a road, or a junction, that a road is joined to.

    Attributes:
        road: id of the road; empty for a junction.
        junction: id of the junction; empty for a road.
        is_start: the road's start, not its end.
    """

    road: str = ""
    junction: str = ""
    is_start: bool = True


class RoadMark(Record, gc=False):
    """The line on the outer edge of a lane, from a place on.

    Attributes:
        s: distance from the section's start at which it begins [m].
        type: such as "broken"; the words of double lines go from the inner to the outer one.
        colour: as in the file; "standard" is white.
    """

    s: float
    type: str
    colour: str


class LaneElement(Record, eq=False, gc=False):
    """A lane of a section.

    Attributes:
        id: positive to the left of the reference line, negative to the right; 0 for the line between.
        type: such as "driving".
        widths: (k, 5) polynomials; s counts from the section's start.
        predecessors, successors: ids of lanes that it is linked with at the section's start and end.
        marks: by rising s; those that only repeat the one before are left out.
        speeds: distances from the section's start [m] and limits [m/s], 0 for none.
    """

    id: int
    type: str
    widths: FloatArray
    predecessors: tuple[int, ...] = ()
    successors: tuple[int, ...] = ()
    marks: tuple[RoadMark, ...] = ()
    speeds: tuple[tuple[float, float], ...] = ()


class LaneSection(Record, eq=False, gc=False):
    """A part of a road with the same lanes.

    Attributes:
        start, end: distances along the road [m].
        lanes: by id, without gaps from the outermost left one to the outermost right one.
    """

    start: float
    end: float
    lanes: Mapping[int, LaneElement]


class Road(Record, eq=False, gc=False):
    """A road.

    Attributes:
        id: as in the file, any text.
        length: [m].
        junction: id of the junction that it lies in; empty for none.
        is_left_hand: traffic keeps left.
        before, after: what its start and its end are joined to; None for nothing.
        shapes: its reference line.
        elevation, roll, offset: (k, 5) polynomials of the height [m], the superelevation [rad], and the distance of
            lane 0 from the reference line [m].
        speeds: distances [m] and limits [m/s] of the road; 0 for none.
        sections: at least one.
        element: for errors, without its children.
        signals, objects: the elements of its signals, references to signals, stop lines and crosswalks.
    """

    id: str
    length: float
    junction: str
    is_left_hand: bool
    before: RoadEnd | None
    after: RoadEnd | None
    shapes: tuple[PlanShape, ...]
    elevation: FloatArray
    roll: FloatArray
    offset: FloatArray
    speeds: tuple[tuple[float, float], ...]
    sections: tuple[LaneSection, ...]
    element: Element
    signals: tuple[Element, ...] = ()
    objects: tuple[Element, ...] = ()


class Connection(Record, gc=False):
    """A connection of a junction: the lanes of an incoming road that go on in another one.

    Attributes:
        incoming, connecting: ids of the roads; in a direct junction the second one is the linked road.
        is_start: the connecting road is joined by its start.
        links: ids of lanes of the first road and of the second one.
    """

    incoming: str
    connecting: str
    is_start: bool
    links: tuple[tuple[int, int], ...]


class Junction(Record, gc=False):
    """A junction.

    Attributes:
        id: as in the file.
        connections: in the file's order.
        controllers: ids of the controllers of its signals.
    """

    id: str
    connections: tuple[Connection, ...]
    controllers: tuple[str, ...]


READ: Final[Mapping[str, frozenset[str]]] = {
    name: frozenset(children.split())
    for name, children in {
        "OpenDRIVE": "header road junction controller",
        "header": "geoReference offset license",
        "road": "link type planView elevationProfile lateralProfile lanes objects signals",
        "type": "speed",
        "planView": "geometry",
        "geometry": "line arc spiral poly3 paramPoly3",
        "elevationProfile": "elevation",
        "lateralProfile": "superelevation",
        "lanes": "laneOffset laneSection",
        "laneSection": "left center right",
        "left": "lane",
        "center": "lane",
        "right": "lane",
        "lane": "link width roadMark speed",
        "objects": "object",
        "object": "outline outlines",
        "outlines": "outline",
        "outline": "cornerLocal cornerRoad",
        "signals": "signal signalReference",
        "signal": "validity",
        "signalReference": "validity",
        "junction": "connection controller",
        "controller": "control",
        "connection": "laneLink",
        "link": "predecessor successor",
    }.items()
}
"""Names of the children of each element that have a meaning here. Those of other elements are not counted."""

_ADDED: Final = frozenset({"userData", "dataQuality", "include"})
"""Elements that any other one may hold, for other programs."""


def count_unused(element: Element, unused: Counter[str]) -> None:
    """Count the elements within another one that nothing here reads, as parent/child."""
    known = READ.get(element.tag)
    for child in element.children:
        if known is not None and child.tag not in known:
            unused[child.tag if child.tag in _ADDED else f"{element.tag}/{child.tag}"] += 1
        elif child.tag in READ:
            count_unused(child, unused)


def read_road(element: Element) -> Road:
    """Read a road.

    Raises:
        DocumentError: element, id and line of what cannot be used.
    """
    length = element.number("length", None, 0.0, MAX_LENGTH)
    lanes, junction = _needed(element, "lanes"), element.word("junction", "-1")
    road = Road(
        id=element.word("id"),
        length=length,
        junction="" if junction == "-1" else junction,
        is_left_hand=element.choice("rule", ("RHT", "LHT"), "RHT") == "LHT",
        before=_read_end(element, "predecessor"),
        after=_read_end(element, "successor"),
        shapes=tuple(sorted(map(_read_shape, _needed(element, "planView").all("geometry")), key=_BY_S)),
        elevation=_cubics(_within(element, "elevationProfile", "elevation")),
        roll=_cubics(_within(element, "lateralProfile", "superelevation")),
        offset=_cubics(lanes.all("laneOffset")),
        speeds=tuple((one.number("s"), _read_limit(one.first("speed"))) for one in element.all("type")),
        sections=_read_sections(lanes, length),
        element=Element("road", element.attributes, element.line, element.source),
        signals=tuple(child for part in element.all("signals") for child in part.children),
        objects=tuple(filter(is_needed_object, _within(element, "objects", "object"))),
    )
    if not road.shapes:
        raise element.error("", "a <geometry> in <planView>; there is none")
    return road


def is_stop_line(element: Element) -> bool:
    """Return whether an object is a stop line."""
    name = "".join(filter(str.isalpha, element.word("name", ""))).lower()
    is_mark = element.word("type", "").lower() == "roadmark"
    return name == "stopline" or (is_mark and element.word("subtype", "").lower() in {"signallines", "stopline"})


def is_needed_object(element: Element) -> bool:
    """Return whether an object is a stop line or a crosswalk."""
    return element.word("type", "").lower() == "crosswalk" or is_stop_line(element)


def read_junction(element: Element) -> Junction:
    """Read a junction.

    Raises:
        DocumentError: as for `read_road`.
    """
    element.choice("type", ("default", "direct"), "default")  # virtual ones and crossings have another form
    connections = []
    for one in element.all("connection"):
        links = [(_lane_id(link, "from"), _lane_id(link, "to")) for link in one.all("laneLink")]
        other = "linkedRoad" if "linkedRoad" in one.attributes else "connectingRoad"
        is_start = one.choice("contactPoint", ("start", "end"), "start") == "start"
        connections.append(Connection(one.word("incomingRoad"), one.word(other), is_start, tuple(links)))
    return Junction(element.word("id"), tuple(connections), tuple(one.word("id") for one in element.all("controller")))


def _read_end(element: Element, tag: str) -> RoadEnd | None:
    link = element.first("link")
    found = None if link is None else link.first(tag)
    if found is None:
        return None
    name = found.word("elementId")
    if found.choice("elementType", ("road", "junction"), "road") == "junction":
        return RoadEnd(junction=name)
    return RoadEnd(name, is_start=found.choice("contactPoint", ("start", "end"), "start") == "start")


def _read_shape(element: Element) -> PlanShape:
    s, x, y, heading = (element.number(key, None, -MAX_COORDINATE, MAX_COORDINATE) for key in ("s", "x", "y", "hdg"))
    length = element.number("length", None, 0.0, MAX_LENGTH)
    for child in element.children:
        keys = _FIGURES.get(child.tag)
        if keys is not None:
            most = MAX_CURVATURE if child.tag in {"arc", "spiral"} else MAX_XML_NUMBER
            figures = [child.number(key, None, -most, most) for key in keys]
            if child.tag == "paramPoly3":
                is_normalized = child.choice("pRange", ("arcLength", "normalized"), "normalized") == "normalized"
                figures = [float(is_normalized), *figures]
            # A shape without length is never asked for a place; its figures need some.
            return PlanShape(s, x, y, heading, max(length, 1e-9), child.tag, tuple(figures))
    got = element.children[0].tag if element.children else "nothing"
    raise element.error("", f"one of {', '.join(_FIGURES)}", got)


_FIGURES: Final[Mapping[str, tuple[str, ...]]] = {
    "line": (),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "poly3": ("a", "b", "c", "d"),
    "paramPoly3": ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV"),
}


def _read_sections(lanes: Element, length: float) -> tuple[LaneSection, ...]:
    elements = sorted(lanes.all("laneSection"), key=lambda one: one.number("s", 0.0))
    if not elements:
        raise lanes.error("", "a <laneSection>; there is none")
    starts = [element.number("s", None, 0.0, MAX_LENGTH) for element in elements]
    sections = []
    for element, start, end in zip(elements, starts, [*starts[1:], length], strict=True):
        own = [
            lane for side in element.children if side.tag in {"left", "center", "right"} for lane in side.all("lane")
        ]
        read = {lane.id: lane for lane in map(_read_lane, own)}
        if len(read) != len(own):
            raise element.error("", "each lane id once in a section")
        for low, high in ((min(read, default=0), 0), (1, max(read, default=0) + 1)):
            gap = next((name for name in range(low, high) if name not in read and name != 0), None)
            if gap is not None:
                raise element.error("", f"lanes without gaps; lane {gap} is missing")
        sections.append(LaneSection(start, end, read))
    return tuple(sections)


def _read_lane(element: Element) -> LaneElement:
    name = _lane_id(element, "id")
    widths = list(element.all("width"))
    if name and not widths and element.first("border") is not None:
        raise element.error("border", "<width> records; lanes with <border> alone are not read")
    links = [link for part in element.all("link") for link in part.children]
    marks: list[RoadMark] = []
    for mark in sorted(map(_read_mark, element.all("roadMark")), key=_BY_S):
        if not marks or (mark.type, mark.colour) != (marks[-1].type, marks[-1].colour):
            marks.append(mark)
    return LaneElement(
        id=name,
        type=element.word("type", "none"),
        widths=_cubics(widths, "sOffset"),
        predecessors=tuple(_lane_id(link, "id") for link in links if link.tag == "predecessor"),
        successors=tuple(_lane_id(link, "id") for link in links if link.tag == "successor"),
        marks=tuple(marks),
        speeds=tuple((one.number("sOffset", 0.0), _read_limit(one)) for one in element.all("speed")),
    )


def _read_mark(element: Element) -> RoadMark:
    return _mark(element.number("sOffset", 0.0), element.word("type", "none"), element.word("color", "standard"))


_mark: Final = lru_cache(SHARED)(RoadMark)


_BY_S: Final = attrgetter("s")
"""Key of records by rising s; files have them in this order, and a few do not."""


def _lane_id(element: Element, key: str) -> int:
    return element.whole(key, None, MAX_LANE_ID)


def _read_limit(element: Element | None) -> float:
    """Return a speed limit [m/s]; 0 for none."""
    if element is None or element.word("max", "").lower() in _NO_LIMIT:
        return 0.0
    unit = element.choice("unit", tuple(_UNITS), "m/s")
    return element.number("max", None, 0.0, 1_000.0) * _UNITS[unit]


def _cubics(elements: Iterable[Element], key: str = "s") -> FloatArray:
    """Return (k, 5) polynomials by rising s."""
    rows = []
    for one in elements:
        row = one.numbers((key, "a", "b", "c", "d"))
        if not 0.0 <= row[0] <= MAX_LENGTH:
            one.number(key, 0.0, 0.0, MAX_LENGTH)  # tells it
        rows.append(tuple(row))
    rows.sort(key=itemgetter(0))
    return _table(tuple(rows))


@lru_cache(SHARED)
def _table(rows: tuple[tuple[float, ...], ...]) -> FloatArray:
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def _within(element: Element, part: str, tag: str) -> Iterator[Element]:
    return (child for each in element.all(part) for child in each.all(tag))


def _needed(element: Element, tag: str) -> Element:
    found = element.first(tag)
    if found is None:
        raise element.error("", f"a <{tag}>; there is none")
    return found


def error_of(road: Road, expected: str) -> DocumentError:
    """Return the error for a whole road."""
    return road.element.error("", expected)
