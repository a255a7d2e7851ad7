"""The hilly map `hills`: a two-way road in the shape of an eight, which crosses itself on a bridge.

From the bridge the road climbs at 10 % to a crest, falls at 8 % to the road below the bridge, and climbs at 6 % past a
crosswalk with lights, in the middle of the slope. In both bends it is banked.

Distances s are along the middle line, from the middle of the bridge to the east and on to the left.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from scripts.drawing.mgeo import LANE, MapFiles, engine_waypoints, init, json_lines, pose
from scripts.drawing.section import Section

RADIUS = 80.0  # of both bends, and the length of each straight from the crossing to a bend [m]
BEND = 1.5 * math.pi * RADIUS
LENGTH = 4.0 * RADIUS + 2.0 * BEND
STEP = 1.0  # between points of a lane [m]
BORDER_STEP = 2.5  # of its edges [m]; the chord leaves the line by 1 cm in the plane and 2 mm in height
LIMIT = 50  # [km/h]; on a radius of 80 m the lateral acceleration is 2.4 m/s^2
DECK = 6.5  # height of the bridge above the road below it [m]
BANK = 0.04  # rise across the road to the outside of a bend
RUN_IN = 25.0  # length over which the bank begins and ends [m]
WALK = (RADIUS * 3.0 + BEND + 77.0, RADIUS * 3.0 + BEND + 89.0)  # s of the stop lines before the crosswalk [m]
GREEN, WALKING, YELLOW = 15, 10, 3  # [s]

GRADES = (  # s [m] and grade; in between it changes evenly
    *((0.0, 0.0), (20.0, 0.0), (60.0, 0.10), (130.0, 0.10)),
    *((190.0, -0.08), (371.25, -0.08), (411.25, 0.0)),  # over the crest, and down to the height 0
    *((600.0, 0.0), (640.0, 0.06), (760.0, 0.06), (820.0, -0.05), (844.0, -0.05), (884.0, 0.0), (LENGTH, 0.0)),
)

Point = tuple[float, float, float]

_SECTIONS = (
    Section(RADIUS, 0.0, LIMIT),
    Section(BEND, 1.0 / RADIUS, LIMIT, RADIUS, 0.0, 0.0),
    Section(2.0 * RADIUS, 0.0, LIMIT, 0.0, RADIUS, -0.5 * math.pi),
    Section(BEND, -1.0 / RADIUS, LIMIT, 0.0, -RADIUS, -0.5 * math.pi),
    Section(RADIUS, 0.0, LIMIT, -RADIUS, 0.0, 0.0),
)
_STARTS = (0.0, RADIUS, RADIUS + BEND, 3.0 * RADIUS + BEND, 3.0 * RADIUS + 2.0 * BEND)
_CUTS = (*_STARTS[:4], *WALK, _STARTS[4], LENGTH)
_CROSSING = _CUTS.index(WALK[0])  # the piece between the stop lines


def _height(s: float) -> float:
    """Return the height of the middle line [m]."""
    z = DECK
    for (start, before), (end, after) in pairwise(GRADES):
        if s <= start:
            break
        run = min(s, end) - start
        z += before * run + 0.5 * (after - before) * run * run / (end - start)
    return z


def _bank(s: float) -> float:
    """Return the rise of the road to its left for each metre: outside up in both bends."""
    for start, sign in ((_STARTS[1], -1.0), (_STARTS[3], 1.0)):
        inside = min(s - start, start + BEND - s)
        if inside > 0.0:
            return sign * BANK * min(inside / RUN_IN, 1.0)
    return 0.0


def _heading(s: float) -> float:
    """Return the direction of the middle line [rad]."""
    i = _section(s)
    return _SECTIONS[i].yaw + _SECTIONS[i].curvature * (s - _STARTS[i])


def _section(s: float) -> int:
    return max(i for i, start in enumerate(_STARTS) if start <= s)


def at(s: float, offset: float = 0.0) -> Point:
    """Return a point of the road.

    Args:
        s: along the middle line [m].
        offset: to the left of it [m].

    Returns:
        East, north, up [m].
    """
    i = _section(s)
    x, y = _SECTIONS[i].at(s - _STARTS[i], offset)
    return x, y, _height(s) + offset * _bank(s)


def _line(start: float, end: float, offset: float, step: float) -> list[Point]:
    longest = max(1.0, 1.0 - offset * _SECTIONS[_section(0.5 * (start + end))].curvature)
    num = math.ceil((end - start) * longest / step - 1e-9)
    return [at(start + (end - start) * i / num, offset) for i in range(num + 1)]


def hills_files() -> dict[str, bytes]:
    """Return the map.

    Returns:
        File name -> content, in MGeo format.
    """
    files = MapFiles(330000.0, 4120000.0, digits=4)
    num = len(_CUTS) - 1
    for way, offset in (("F", -0.5 * LANE), ("B", 0.5 * LANE)):
        stop = _CROSSING if way == "F" else _CROSSING + 1
        for i, s in enumerate(_CUTS[:-1]):
            files.node(f"N{way}{i}", at(s, offset), is_stop=i == stop)
    for i, (start, end) in enumerate(pairwise(_CUTS)):
        marks = [
            files.border(f"C{i}", "centre", _line(start, end, 0.0, BORDER_STEP)),
            files.border(f"R{i}", "edge", _line(start, end, -LANE, BORDER_STEP)),
            files.border(f"L{i}", "edge", _line(start, end, LANE, BORDER_STEP)),
        ]
        is_lit = i == _CROSSING
        more: dict[str, Any] = {"link_type": "1", "related_signal": "straight"} if is_lit else {}
        nodes = f"{i}", f"{(i + 1) % num}"
        forward, back = _line(start, end, -0.5 * LANE, STEP), _line(start, end, 0.5 * LANE, STEP)[::-1]
        for way, line, side, (a, b) in (("F", forward, 1, nodes), ("B", back, 2, nodes[::-1])):
            edges = {"lane_mark_left": [marks[0]], "lane_mark_right": [marks[side]]}
            files.link(f"{way}{i}", f"N{way}{a}", f"N{way}{b}", line, LIMIT, road_id=str(i), **edges, **more)
    _lights(files)
    return files.files()


def _lights(files: MapFiles) -> None:
    """Add the crosswalk, its lights and their schedule."""
    first, last = WALK
    middle = 0.5 * (first + last)
    files.border("SF", "stop", [at(first, 0.0), at(first, -LANE)])
    files.border("SB", "stop", [at(last, 0.0), at(last, LANE)])
    link = f"{_CROSSING}"
    yaw = math.degrees(_heading(middle))
    cars = [
        files.light("TLF", [f"F{link}"], at(last + 10.0, -0.5 * LANE), yaw + 180.0, ("red", "yellow", "straight")),
        files.light("TLB", [f"B{link}"], at(first - 10.0, 0.5 * LANE), yaw, ("red", "yellow", "straight")),
    ]
    walkers = [
        files.light("PSL", [], at(middle, LANE + 1.0), yaw - 90.0, None),
        files.light("PSR", [], at(middle, -LANE - 1.0), yaw + 90.0, None),
    ]
    sides = ((-2.0, -LANE), (2.0, -LANE), (2.0, LANE), (-2.0, LANE))
    files.crosswalk("CW0", [at(middle + along, aside) for along, aside in sides], walkers)
    groups = [*([light] for light in cars), walkers]
    for lights in groups:
        files.group("IntTL0", lights)
    files.controllers.append({"idx": "IntTL0", "TL": groups})
    states = [
        {"duration": GREEN, "lightcolor": ["SG", "SG", "R"]},
        {"duration": WALKING, "lightcolor": ["R", "R", "R"]},
    ]
    schedule = {"TLState": states, "yelloduration": [YELLOW] * len(groups), "PSState": [[1, 2, 1, 5, 4]]}
    files.schedules.append({"idx": "IntTL0", **schedule})


NPCS = (  # model, s, direction
    *(("2015_Kia_K5", 150.0, "F"), ("Truck", 300.0, "F"), ("2021_VW_Golf_GTI", 520.0, "F"), ("Bus", 660.0, "F")),
    *(("Hyundai_Ioniq_5", 40.0, "B"), ("Van", 260.0, "B"), ("2016_Kia_Niro(HEV)", 480.0, "B")),
    *(("Bus", 570.0, "B"), ("2014_Kia_K7", 800.0, "B"), ("Motorcycle", 1000.0, "B")),
)
PAVEMENT = LANE + 1.5  # from the middle line [m]


def hills_scenario() -> bytes:
    """Return the scenario: the ego before the bridge, traffic both ways, a pedestrian on the slope, a box at the crest.

    Returns:
        The document.
    """
    vehicles = []
    for uid, (model, s, way) in enumerate(NPCS, start=1):
        i = max(k for k, cut in enumerate(_CUTS) if cut <= s)
        part = (s - _CUTS[i]) / (_CUTS[i + 1] - _CUTS[i])
        part = part if way == "F" else 1.0 - part
        x, y, z = at(s, -0.5 * LANE if way == "F" else 0.5 * LANE)
        yaw = math.degrees(math.remainder(_heading(s) + (0.0 if way == "F" else math.pi), math.tau))
        at_link = {"initPositionMode": "Link", "initLink": f"{way}{i}", "initLinkRatio": round(part, 4)}
        vehicles.append(
            {
                "UNIQUEID": uid,
                "modelName": model,
                "initPosition": {**init(x, y, yaw, z), **at_link},
                "velocityType": 1,
                "currentVelocity": 30,
                "isWaypointMode": False,
            }
        )
    walker, box = len(NPCS) + 1, len(NPCS) + 2
    x, y, z = at(640.0, -PAVEMENT)
    yaw = math.degrees(_heading(640.0))
    person = {"UNIQUEID": walker, "modelName": "Man", **pose(x, y, yaw, z), "speed": 5.0, "loop": True}
    way_up = [at(s, -PAVEMENT) for s in range(640, 761, 10)]
    way_up += way_up[-2:0:-1]  # and back
    path = {"pathName": f"PedPath - {walker}", "waypointData": list(engine_waypoints(way_up))}
    x, y, z = at(160.0, -PAVEMENT)
    thing = {"UNIQUEID": box, "modelName": "Wooden_Box", **pose(x, y, math.degrees(_heading(160.0)), z)}
    x, y, z = at(LENGTH - 70.0, -0.5 * LANE)
    document = {
        "mapInfo": {"mapName": "hills"},
        "egoVehicle": {
            "UNIQUEID": -1,
            "modelName": "2016_Hyundai_Ioniq",
            "initPosition": init(x, y, 0.0, z),
            "gear": 4,
        },
        "vehicleList": vehicles,
        "pedestrianList": [person],
        "objectList": [thing],
        "waypointDataList": [path],
    }
    return json_lines(document)
