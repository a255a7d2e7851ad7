"""The map `parking`: a car park with rows of bays beside a street, and the scenario `parking` on it.

Two aisles, 6 m wide and one-way, form a loop. Cars come in from the street in the west and leave in the east, over a
stop line. The street ends in turning places, so all lanes of traffic go on.

Each bay is a link of its own, from the edge of its aisle to the back of the bay, 2.5 m wide. It is joined to no other
link: traffic does not drive into it, and it is part of the road for scores, friction and places on links. Bay `BA01`
is the most western one of the southern row A.
"""

from __future__ import annotations

import math
from typing import Any

from rosbridge_sim.scenarios.catalogue import find_model
from scripts.drawing.mgeo import LANE, MapFiles, init, json_lines
from scripts.drawing.section import Section, bend, chain, straight

BAY = 2.5  # width of a bay [m]
DEPTH = 5.0  # its length [m]
BAYS = 14  # in each row
AISLE = 6.0  # width [m]: enough for a usual car to reverse into a bay in one move
SOUTH, NORTH = 20.0, 36.0  # the lines of the aisles [m]; between them two rows stand back to back
TURN = 8.0  # radius between the aisles, and out of the street to the right [m]
SIDE = 20.0  # the aisles end at this distance from the middle [m]
GATE = SIDE + TURN  # the ways in and out lie here, west and east of the middle [m]
TURNING = 12.0  # radius of a turning place [m]
END = 60.0  # the street reaches so far from the middle [m]
STREET_KMH, AISLE_KMH, BAY_KMH = 40, 20, 10
STEP, ARC_STEP = 5.0, 1.0  # between points [m]

HALF = 0.5 * LANE
LEFT_TURN = TURN + LANE  # radius of left turns between the street and the gates [m]
STOP = HALF + TURN  # the stop line of the way out [m]

ROWS = {  # name -> where its bays begin and end, north of the street's middle [m]
    "A": (SOUTH - 0.5 * AISLE, SOUTH - 0.5 * AISLE - DEPTH),
    "B": (SOUTH + 0.5 * AISLE, SOUTH + 0.5 * AISLE + DEPTH),
    "C": (NORTH - 0.5 * AISLE, NORTH - 0.5 * AISLE - DEPTH),
    "D": (NORTH + 0.5 * AISLE, NORTH + 0.5 * AISLE + DEPTH),
}

Point = tuple[float, float]


def _points(sections: list[Section], offset: float = 0.0) -> list[Point]:
    line: list[Point] = []
    for section in sections:
        points = section.points(offset, ARC_STEP if section.curvature else STEP)
        line += points[1:] if line else points
    return line


def _bay_east(number: int) -> float:
    """Return where the middle of a bay is, counted from 1 in the west [m]."""
    return (number - 0.5 - 0.5 * BAYS) * BAY


def parking_files() -> dict[str, bytes]:
    """Return the map.

    Returns:
        File name -> content, in MGeo format.
    """
    files = MapFiles(380000.0, 4170000.0)
    _street(files)
    _car_park(files)
    for row, (near, far) in ROWS.items():
        for number in range(1, BAYS + 1):
            _bay(files, row, number, near, far)
    for i in range(BAYS + 1):
        east = (i - 0.5 * BAYS) * BAY
        for name, start, end in (("A", *ROWS["A"]), ("B", ROWS["B"][0], ROWS["C"][0]), ("D", *ROWS["D"])):
            files.border(f"L{name}{i:02}", "edge", [(east, start), (east, end)])
    return files.files()


def _lane(files: MapFiles, name: str, nodes: tuple[str, str], parts: list[Section], speed: int, **more: Any) -> None:  # noqa: ANN401
    """Add a lane along sections that are laid already."""
    files.link(name, *nodes, _points(parts), speed, **more)


def _street(files: MapFiles) -> None:
    """Add the street along the x axis with its turning places."""
    for node, at in (
        *(
            ("E0", (-END, -HALF)),
            ("E1", (-GATE - LEFT_TURN, -HALF)),
            ("E2", (GATE + LEFT_TURN, -HALF)),
            ("E3", (END, -HALF)),
        ),
        *(("W0", (END, HALF)), ("W1", (SIDE, HALF)), ("W2", (-SIDE, HALF)), ("W3", (-END, HALF))),
    ):
        files.node(node, at)
    centre = files.border("CS", "centre", [(-END, 0.0), (END, 0.0)])
    edges = {
        "E": files.border("ES", "edge", [(-END, -LANE), (END, -LANE)]),
        "W": files.border("WS", "edge", [(END, LANE), (GATE + HALF, LANE)]),
    }
    files.border("WM", "edge", [(GATE - HALF, LANE), (-GATE + HALF, LANE)])
    files.border("WE", "edge", [(-GATE - HALF, LANE), (-END, LANE)])
    for way, yaw in (("E", 0.0), ("W", math.pi)):
        for i in range(3):
            start, end = (files.nodes[f"{way}{k}"]["point"] for k in (i, i + 1))
            part = chain([straight(abs(end[0] - start[0]), 0)], start[0], start[1], yaw)
            marks = {"lane_mark_left": [centre], "lane_mark_right": [edges[way]] if way == "E" else []}
            _lane(files, f"S{way}{i}", (f"{way}{i}", f"{way}{i + 1}"), part, STREET_KMH, road_id="S", **marks)
    aside = math.degrees(math.acos((HALF + TURNING) / (2.0 * TURNING)))
    parts = [bend(TURNING, -aside, 0), bend(TURNING, 180.0 + 2.0 * aside, 0), bend(TURNING, -aside, 0)]
    for name, nodes, x, y, yaw in (("TE", ("E3", "W0"), END, -HALF, 0.0), ("TW", ("W3", "E0"), -END, HALF, math.pi)):
        loop = chain(parts, x, y, yaw)
        marks = {
            f"lane_mark_{side}": [files.border(f"{name}{side[0].upper()}", "edge", _points(loop, away))]
            for side, away in (("left", HALF), ("right", -HALF))
        }
        _lane(files, name, nodes, loop, AISLE_KMH, road_id=name, **marks)


def _car_park(files: MapFiles) -> None:
    """Add the ways in and out, and the loop of the aisles."""
    files.node("IN", (-GATE, STOP))
    files.node("OUT", (GATE, STOP), is_stop=True)
    for name, at in (("A1", (-SIDE, SOUTH)), ("A2", (SIDE, SOUTH)), ("A3", (SIDE, NORTH)), ("A4", (-SIDE, NORTH))):
        files.node(name, at)
    files.border("STOP", "stop", [(GATE + HALF, STOP), (GATE - HALF, STOP)])
    south, north, west = -0.5 * math.pi, 0.5 * math.pi, math.pi
    straight_on = SOUTH - TURN - STOP
    wide = {"width_start": AISLE, "width_end": AISLE, "force_width_start": True, "force_width_end": True}
    aisle, back = straight(2.0 * SIDE, 0), bend(TURN, 180.0, 0)
    for name, nodes, parts, start, more in (
        ("IL", ("E1", "IN"), [bend(LEFT_TURN, 90.0, 0)], (-GATE - LEFT_TURN, -HALF, 0.0), {}),
        ("IR", ("W2", "IN"), [bend(TURN, -90.0, 0)], (-SIDE, HALF, west), {}),
        ("I", ("IN", "A1"), [straight(straight_on, 0), bend(TURN, -90.0, 0)], (-GATE, STOP, north), {}),
        ("AS", ("A1", "A2"), [aisle], (-SIDE, SOUTH, 0.0), wide),
        ("AE", ("A2", "A3"), [back], (SIDE, SOUTH, 0.0), {}),
        ("AN", ("A3", "A4"), [aisle], (SIDE, NORTH, west), wide),
        ("AW", ("A4", "A1"), [back], (-SIDE, NORTH, west), {}),
        ("O", ("A2", "OUT"), [bend(TURN, -90.0, 0), straight(straight_on, 0)], (SIDE, SOUTH, 0.0), {}),
        ("OL", ("OUT", "E2"), [bend(LEFT_TURN, 90.0, 0)], (GATE, STOP, south), {}),
        ("OR", ("OUT", "W1"), [bend(TURN, -90.0, 0)], (GATE, STOP, south), {}),
    ):
        _lane(files, name, nodes, chain(parts, *start), AISLE_KMH, road_id="P", **more)


def _bay(files: MapFiles, row: str, number: int, near: float, far: float) -> None:
    """Add a bay."""
    name, east = f"B{row}{number:02}", _bay_east(number)
    width: dict[str, Any] = {"width_start": BAY, "width_end": BAY, "force_width_start": True, "force_width_end": True}
    nodes = files.node(f"{name}I", (east, near)), files.node(f"{name}O", (east, far))
    files.link(name, *nodes, [(east, near), (east, far)], BAY_KMH, link_type="Parking", road_id=row, **width)


# The scene

MODELS = (
    *("2015_Kia_K5", "2016_Kia_Niro(HEV)", "2021_VW_Golf_GTI", "Hyundai_Ioniq_5", "2016_Hyundai_Ioniq", "2014_Kia_K7"),
    *("2021_VW_Golf_GTI", "2016_Genesis_DH", "2016_Kia_Niro(HEV)"),
)
FREE = {"A": (3, 9, 10), "B": (5, 8, 14), "C": (2, 7, 11, 12), "D": (1, 6, 13)}  # bays without a car
DRIVING = (
    ("2015_Kia_K5", "SE1", 0.2),
    ("Van", "SW1", 0.5),
    ("2021_VW_Golf_GTI", "AN", 0.3),
    ("2016_Genesis_DH", "SW0", 0.2),
)


def parking_scenario() -> bytes:
    """Return the scenario: the ego at the beginning of an aisle, parked cars in most bays, a few cars that drive."""
    vehicles: list[dict[str, Any]] = []
    for row, (near, far) in ROWS.items():
        for number in range(1, BAYS + 1):
            if number not in FREE[row]:
                model = MODELS[(len(vehicles) * 5 + number) % len(MODELS)]
                vehicles.append(_parked(model, _bay_east(number), near, far))
    files = MapFiles(0.0, 0.0)
    _street(files)
    _car_park(files)
    lines = {link["idx"]: link["points"] for link in files.links}
    for model, link, part in DRIVING:
        (x, y, _), (x_end, y_end, _) = lines[link][0], lines[link][-1]
        at_link = {"initPositionMode": "Link", "initLink": link, "initLinkRatio": part}
        yaw = math.degrees(math.atan2(y_end - y, x_end - x))
        vehicles.append(
            {
                "modelName": model,
                "initPosition": {**init(x + part * (x_end - x), y + part * (y_end - y), yaw), **at_link},
                "velocityType": 1,
                "currentVelocity": 10,
                "isWaypointMode": False,
            }
        )
    document = {
        "mapInfo": {"mapName": "parking"},
        "egoVehicle": {
            "UNIQUEID": -1,
            "modelName": "2016_Hyundai_Ioniq",
            "initPosition": init(-SIDE + 3.0, SOUTH, 0.0),
            "gear": 4,
        },
        "vehicleList": vehicles,
    }
    return json_lines(document)


def _parked(model: str, east: float, near: float, far: float) -> dict[str, Any]:
    """Return a car in the middle of a bay, nose first."""
    entry = find_model(model)
    if entry is None:
        raise AssertionError(f"{model} is not in the catalogue")
    ahead = math.copysign(1.0, far - near)
    to_middle = 0.5 * entry.body.length - entry.body.rear_overhang
    pose = init(east, 0.5 * (near + far) - ahead * to_middle, ahead * 90.0)
    return {"modelName": model, "initPosition": pose, "velocityType": 2, "constantVelocity": 0, "isWaypointMode": True}
