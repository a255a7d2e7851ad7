"""The map `roundabout`: a roundabout and a crossing without lights, and the scenario `roundabout` on it.

Four arms lead to the roundabout in the west. In the east two minor streets meet a major road. The major road comes
from the northern arm and ends at the southern one, and the eastern arm is one of the minor streets. The other two
streets end in a turning place. So all lanes go on.

Nobody has a light. Stop lines lie before the roundabout and at the end of both minor streets: who comes over one gives
way to all who do not, in the roundabout and on the major road.
"""

from __future__ import annotations

import math
from typing import Any

from scripts.drawing.mgeo import LANE, MapFiles, init, json_lines
from scripts.drawing.section import Section, bend, chain, straight

RING = 20.0  # radius of the lane of the roundabout [m]: 20 km/h there at 1.5 m/s^2 to the side
MOUTH = 16.0  # radius of the curves into it and out of it [m]
CROSSING = 200.0  # from the roundabout to the crossing, to the east [m]
BOX = 14.0  # from the middle of the crossing to its stop lines [m]
TURNING = 12.0  # radius of a turning place [m]
BEND = 40.0  # of the major road [m]
WALK = (6.0, 9.0)  # where crosswalks lie, before the roundabout's stop lines [m]
STEP = 5.0  # between points on straights [m]
ARC_STEP = 1.0  # in bends [m]; the chord leaves the tightest one by 1 cm
STREET_KMH, MAJOR_KMH, RING_KMH, TURN_KMH = 40, 50, 30, 30

HALF = 0.5 * LANE
ANGLE = math.asin((HALF + MOUTH) / (RING + MOUTH))  # from an arm to where its lanes join the ring [rad]
REACH = (RING + MOUTH) * math.cos(ANGLE)  # from the middle to the stop lines [m]

Point = tuple[float, float]
ARMS = "ENWS"  # counter-clockwise
LEGS = {"E": (1, 0), "N": (0, 1), "W": (-1, 0), "S": (0, -1)}


def _arm_yaw(arm: str) -> float:
    """Return the direction of an arm or leg, away from the middle [rad]."""
    return ARMS.index(arm) * 0.5 * math.pi


def _points(sections: list[Section], offset: float) -> list[Point]:
    """Return the points of a line beside a chain of sections."""
    line: list[Point] = []
    for section in sections:
        points = section.points(offset, ARC_STEP if section.curvature else STEP)
        line += points[1:] if line else points
    return line


def _streets() -> dict[str, tuple[list[Section], str, str, int]]:
    """Return the streets: name -> middle line, beginning (R: roundabout, P: crossing, T: turning place), end, km/h."""
    up = 110.0 - BEND - REACH
    across = CROSSING - 2.0 * BEND
    down = 110.0 - BEND - BOX

    def major(turn: float) -> list[Section]:
        parts = [straight(up, 0), bend(BEND, turn, 0), straight(across, 0), bend(BEND, turn, 0), straight(down, 0)]
        side = math.copysign(1.0, -turn)
        return chain(parts, 0.0, side * REACH, side * 0.5 * math.pi)

    return {
        "E": (chain([straight(CROSSING - BOX - REACH, 0)], REACH, 0.0, 0.0), "RE", "PW", STREET_KMH),
        "N": (major(-90.0), "RN", "PN", MAJOR_KMH),
        "S": (major(90.0), "RS", "PS", MAJOR_KMH),
        "W": (chain([straight(90.0, 0)], -REACH, 0.0, math.pi), "RW", "TW", STREET_KMH),
        "F": (chain([straight(70.0, 0)], CROSSING + BOX, 0.0, 0.0), "PE", "TF", STREET_KMH),
    }


STREETS = _streets()


def roundabout_files() -> dict[str, bytes]:
    """Return the map.

    Returns:
        File name -> content, in MGeo format.
    """
    files = MapFiles(370000.0, 4160000.0)
    for name in STREETS:
        _street(files, name)
    for arm in ARMS:
        _ring(files, arm)
    for leg in ARMS:
        _turns(files, leg)
    return files.files()


def _node(place: str, way: str) -> str:
    """Return the id of the node where a lane comes in (I) to the place or goes out (O) of it."""
    return f"N{place}{way}"


def _street(files: MapFiles, name: str) -> None:
    """Add both lanes of a street, `A` away from its beginning and `B` back, and the turning place at its end."""
    sections, begin, end, limit = STREETS[name]
    forth, back = _points(sections, -HALF), _points(sections, HALF)[::-1]
    for place, into, out in ((begin, back[-1], forth[0]), (end, forth[-1], back[0])):
        gives_way = place.startswith("R") or place in {"PW", "PE"}
        files.node(_node(place, "I"), into, is_stop=gives_way)
        files.node(_node(place, "O"), out)
        if gives_way:
            across = [sections[0].at(0.0, away) for away in (0.0, LANE)]
            if place == end:
                across = [sections[-1].at(sections[-1].length, away) for away in (0.0, -LANE)]
            files.border(f"S{place}", "stop", across)
    centre = files.border(f"C{name}", "centre", _points(sections, 0.0))
    for way, line, start, goal, side in (("A", forth, begin, end, -LANE), ("B", back, end, begin, LANE)):
        edge = files.border(f"E{name}{way}", "edge", _points(sections, side))
        files.link(
            f"{name}{way}",
            _node(start, "O"),
            _node(goal, "I"),
            line,
            limit,
            road_id=name,
            lane_mark_left=[centre],
            lane_mark_right=[edge],
        )
    if end.startswith("T"):
        _turning_place(files, name, end, sections[-1])


def _turning_place(files: MapFiles, name: str, end: str, street: Section) -> None:
    """Add the loop at the end of a street: right, around a circle on the line of the street, right again."""
    aside = math.degrees(math.acos((HALF + TURNING) / (2.0 * TURNING)))
    x, y = street.at(street.length, -HALF)
    parts = [bend(TURNING, -aside, 0), bend(TURNING, 180.0 + 2.0 * aside, 0), bend(TURNING, -aside, 0)]
    loop = chain(parts, x, y, street.yaw)
    marks = {
        f"lane_mark_{side}": [files.border(f"{name}T{side[0].upper()}", "edge", _points(loop, away))]
        for side, away in (("left", HALF), ("right", -HALF))
    }
    files.link(f"{name}T", _node(end, "I"), _node(end, "O"), _points(loop, 0.0), TURN_KMH, road_id=f"{name}T", **marks)


def _ring(files: MapFiles, arm: str) -> None:
    """Add the lanes of the roundabout at an arm: the way in, the way out, and the ring from there to the next arm."""
    middle = _arm_yaw(arm)
    following = ARMS[(ARMS.index(arm) + 1) % 4]
    out, into, onward = middle - ANGLE, middle + ANGLE, middle + 0.5 * math.pi - ANGLE

    def ring(start: float, end: float) -> list[Section]:
        x, y = RING * math.cos(start), RING * math.sin(start)
        return chain([bend(RING, math.degrees(end - start), 0)], x, y, start + 0.5 * math.pi)

    def mouth(angle: float, *, is_in: bool) -> list[Section]:
        turn = bend(MOUTH, -math.degrees(0.5 * math.pi - ANGLE), 0)
        if not is_in:
            return chain([turn], RING * math.cos(angle), RING * math.sin(angle), angle + 0.5 * math.pi)
        x, y = REACH * math.cos(middle), REACH * math.sin(middle)
        return chain([turn], x - HALF * math.sin(middle), y + HALF * math.cos(middle), middle + math.pi)

    files.node(f"NR{arm}1", (RING * math.cos(out), RING * math.sin(out)))
    files.node(f"NR{arm}2", (RING * math.cos(into), RING * math.sin(into)))
    for link, start, end, line in (
        (f"I{arm}", _node(f"R{arm}", "I"), f"NR{arm}2", mouth(into, is_in=True)),
        (f"O{arm}", f"NR{arm}1", _node(f"R{arm}", "O"), mouth(out, is_in=False)),
        (f"C{arm}", f"NR{arm}1", f"NR{arm}2", ring(out, into)),
        (f"G{arm}", f"NR{arm}2", f"NR{following}1", ring(into, onward)),
    ):
        marks: dict[str, Any] = {"lane_mark_left": [files.border(f"{link}L", "edge", _points(line, HALF))]}
        if not link.startswith("C"):  # there the ways in and out are open to the ring
            marks["lane_mark_right"] = [files.border(f"{link}R", "edge", _points(line, -HALF))]
        files.link(link, start, end, _points(line, 0.0), RING_KMH, road_id="R", **marks)
    near, away = (REACH + along for along in WALK)
    cos, sin = math.cos(middle), math.sin(middle)
    corners = [
        (a * cos - b * sin, a * sin + b * cos) for a, b in ((near, -LANE), (away, -LANE), (away, LANE), (near, LANE))
    ]
    files.crosswalk(f"CW{arm}", corners, [])


def _turns(files: MapFiles, leg: str) -> None:
    """Add the links inside the crossing for vehicles that come from a leg."""
    dx, dy = LEGS[leg]
    yaw = _arm_yaw(leg) + math.pi
    x, y = CROSSING + BOX * dx - HALF * dy, BOX * dy + HALF * dx
    for steps, part in ((1, bend(BOX - HALF, -90.0, 0)), (2, straight(2.0 * BOX, 0)), (3, bend(BOX + HALF, 90.0, 0))):
        to = ARMS[(ARMS.index(leg) + steps) % 4]
        limit = TURN_KMH if part.curvature else MAJOR_KMH if leg in "NS" else STREET_KMH
        line = _points(chain([part], x, y, yaw), 0.0)
        files.link(f"J{leg}{to}", _node(f"P{leg}", "I"), _node(f"P{to}", "O"), line, limit, road_id="P")


# The scene

NPCS = (  # model, link, how far along it
    *(("2015_Kia_K5", "NA", 0.25), ("Bus", "NA", 0.55), ("2021_VW_Golf_GTI", "NA", 0.80), ("Truck", "NB", 0.35)),
    *(("Hyundai_Ioniq_5", "NB", 0.10), ("2014_Kia_K7", "NB", 0.70), ("Van", "SA", 0.30)),
    *(("2016_Kia_Niro(HEV)", "SA", 0.65), ("2016_Genesis_DH", "SB", 0.20), ("Motorcycle", "SB", 0.50)),
    *(("2020_Kia_Stinger", "SB", 0.85), ("2015_Kia_K5", "EA", 0.50), ("Van", "EB", 0.40)),
    *(("2016_Hyundai_Ioniq", "WA", 0.60), ("2021_VW_Golf_GTI", "FA", 0.50), ("2014_Kia_K7", "FB", 0.30)),
)
EGO = 30.0  # from the turning place in the west [m]


def roundabout_scenario() -> bytes:
    """Return the scenario: the ego before the roundabout, in the west, and traffic on all streets."""
    vehicles = []
    for model, link, part in NPCS:
        x, y, yaw = _at(link, part)
        at_link = {"initPositionMode": "Link", "initLink": link, "initLinkRatio": part}
        vehicles.append(
            {
                "modelName": model,
                "initPosition": {**init(x, y, math.degrees(yaw)), **at_link},
                "velocityType": 1,
                "currentVelocity": 25,
                "isWaypointMode": False,
            }
        )
    street = STREETS["W"][0][-1]
    x, y = street.at(street.length - EGO, HALF)
    document = {
        "mapInfo": {"mapName": "roundabout"},
        "egoVehicle": {"UNIQUEID": -1, "modelName": "2016_Hyundai_Ioniq", "initPosition": init(x, y, 0.0), "gear": 4},
        "vehicleList": vehicles,
    }
    return json_lines(document)


def _at(link: str, part: float) -> tuple[float, float, float]:
    """Return a place on a lane of a street: east, north [m], heading [rad]."""
    sections, side, turn = STREETS[link[0]][0], -HALF, 0.0
    lengths = [section.length * (1.0 - side * section.curvature) for section in sections]
    if link[1] == "B":
        side, turn = HALF, math.pi
        lengths = [section.length * (1.0 - side * section.curvature) for section in sections]
        part = 1.0 - part
    s = part * sum(lengths)
    i = 0
    while s > lengths[i]:
        s -= lengths[i]
        i += 1
    along = s / lengths[i] * sections[i].length
    yaw = sections[i].yaw + sections[i].curvature * along + turn
    return *sections[i].at(along, side), math.remainder(yaw, math.tau)
