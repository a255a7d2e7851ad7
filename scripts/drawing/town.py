"""The map `town`: four by four blocks, two-way streets, two avenues that cross in the middle, lights and crosswalks.

Streets have one lane in each direction. Avenues have two: the inner one turns left at the next crossing and has its own
arrow; the outer one goes straight on or turns right. Vehicles do not change lanes.

A crossing is named by its column and row; `22` is the middle. Its legs are named by their direction: E, N, W, S. A
vehicle that comes from the leg E drives west. Lanes of a leg count from the middle, as MORAI's `ego_lane` does.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from scripts.drawing.mgeo import LANE, MapFiles, engine_waypoints, init, json_lines, mm, pose

NUM = 5  # streets each way
PITCH = 110.0  # from street to street [m]
AVENUE = 2  # the row and the column that are avenues
BOX = 14.0  # from the middle of a crossing to its stop lines [m]
WALK = (8.5, 11.5)  # where the crosswalks lie [m]
STEP = 2.5  # between points on straights [m]
ARC_STEP = 1.0  # in turns [m]; the chord leaves the tightest arc by 1 cm
STREET_KMH, AVENUE_KMH, TURN_KMH = 40, 50, 30
YELLOW = 3

Point = tuple[float, float]

LEGS = {"E": (1, 0), "N": (0, 1), "W": (-1, 0), "S": (0, -1)}
ORDER = "ENWS"  # counter-clockwise
CAR = ("red", "yellow", "straight")
ARROW = ("red", "yellow", "left")
BOTH = ("red", "yellow", "left", "straight")
WARNING = ("yellow", "yellow", "yellow")


@dataclass(frozen=True)
class Crossing:
    """A crossing of two streets."""

    column: int
    row: int

    @property
    def name(self) -> str:
        """Its column and row."""
        return f"{self.column}{self.row}"

    @property
    def legs(self) -> str:
        """Its legs, counter-clockwise from the east."""
        return "".join(leg for leg in ORDER if {self.neighbour(leg).column, self.neighbour(leg).row} <= set(range(NUM)))

    @property
    def is_lit(self) -> bool:
        """True if it has traffic lights; a bend has none."""
        return len(self.legs) > len(("in", "out"))

    def neighbour(self, leg: str) -> Crossing:
        """Return the crossing at the other end of a leg."""
        return Crossing(self.column + LEGS[leg][0], self.row + LEGS[leg][1])

    def at(self, leg: str, away: float, left: float) -> Point:
        """Return a point on a leg.

        Args:
            away: distance from the crossing's middle [m].
            left: distance from the leg's middle line, to the left when looking away from the crossing [m].

        Returns:
            East and north [m].
        """
        dx, dy = LEGS[leg]
        x, y = (self.column - AVENUE) * PITCH, (self.row - AVENUE) * PITCH
        return x + dx * away - dy * left, y + dy * away + dx * left

    def is_avenue(self, leg: str) -> bool:
        """Return whether a leg is part of an avenue."""
        return (self.row if leg in "EW" else self.column) == AVENUE

    def num_lanes(self, leg: str) -> int:
        """Return the number of a leg's lanes in each direction."""
        return 2 if self.is_avenue(leg) else 1


CROSSINGS = [Crossing(column, row) for row in range(NUM) for column in range(NUM)]


def _offset(lane: int) -> float:
    """Return the distance of a lane's line from the middle line of its street [m]."""
    return (lane - 0.5) * LANE


def opposite(leg: str) -> str:
    """Return the leg on the other side of a crossing."""
    return ORDER[(ORDER.index(leg) + 2) % 4]


def turn_of(leg: str, to: str) -> str:
    """Return the movement from one leg to another.

    Args:
        leg: the leg that the vehicle comes from.
        to: the leg that it leaves by.

    Returns:
        "left", "straight" or "right".
    """
    return {1: "right", 2: "straight", 3: "left"}[(ORDER.index(to) - ORDER.index(leg)) % 4]


# Geometry


def _line(start: Point, end: Point, step: float) -> list[Point]:
    num = max(1, math.ceil(math.dist(start, end) / step - 1e-9))
    (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    return [(x + dx * i / num, y + dy * i / num) for i in range(num + 1)]


def _corner(start: Point, middle: Point, end: Point) -> list[Point]:
    """Return a right-angled turn: a straight, an arc as wide as possible, a straight."""
    before, after = math.dist(start, middle), math.dist(middle, end)
    radius = min(before, after)
    into = ((middle[0] - start[0]) / before, (middle[1] - start[1]) / before)
    out = ((end[0] - middle[0]) / after, (end[1] - middle[1]) / after)
    begin = (middle[0] - into[0] * radius, middle[1] - into[1] * radius)
    num = math.ceil(radius * math.pi / 2 / ARC_STEP)
    points = [*_line(start, begin, STEP)] if before > radius + 1e-9 else [start]
    for i in range(1, num + 1):
        angle = math.pi / 2 * i / num
        along, aside = radius * math.sin(angle), radius * (1.0 - math.cos(angle))
        points.append((begin[0] + into[0] * along + out[0] * aside, begin[1] + into[1] * along + out[1] * aside))
    return points + (_line(points[-1], end, STEP)[1:] if after > radius + 1e-9 else [])


# The map


def town_files() -> dict[str, bytes]:
    """Return the map.

    Returns:
        File name -> content, in MGeo format.
    """
    files = MapFiles(340000.0, 4130000.0)
    arms = [(crossing, leg) for crossing in CROSSINGS for leg in crossing.legs]
    for crossing, leg in arms:
        for lane in range(1, crossing.num_lanes(leg) + 1):
            offset = _offset(lane)
            files.node(_node(crossing, leg, "I", lane), crossing.at(leg, BOX, offset), is_stop=crossing.is_lit)
            files.node(_node(crossing, leg, "O", lane), crossing.at(leg, BOX, -offset))
    for crossing, leg in arms:
        if leg in "EN":
            _street(files, crossing, leg)
    for crossing in CROSSINGS:
        if len(crossing.legs) == 2:
            _bend_marks(files, crossing)
    for crossing, leg in arms:
        _turns(files, crossing, leg)
    for i, crossing in enumerate(crossing for crossing in CROSSINGS if crossing.is_lit):
        _lights(files, crossing, f"IntTL{i}")
    corner = CROSSINGS[-1]  # the bend in the north-east has a warning light
    for leg in corner.legs:
        _light(files, corner, leg, WARNING)
    return files.files()


def _node(crossing: Crossing, leg: str, way: str, lane: int) -> str:
    """Return the id of the node where a lane comes in (I) or goes out (O)."""
    return f"N{crossing.name}{leg}{way}{lane}"


def _road(crossing: Crossing, leg: str, lane: int) -> str:
    """Return the id of the link that leaves a crossing by a leg."""
    return f"R{crossing.name}{crossing.neighbour(leg).name}L{lane}"


def _turn(crossing: Crossing, leg: str, lane: int, to: str) -> str:
    return f"J{crossing.name}{leg}{lane}{to}"


def _street(files: MapFiles, crossing: Crossing, leg: str) -> None:
    """Add both directions of the street that leaves a crossing by a leg, with its markings."""
    other, back = crossing.neighbour(leg), opposite(leg)
    num = crossing.num_lanes(leg)
    name = f"{crossing.name}{other.name}"
    edge = num * LANE

    def across(left: float) -> list[Point]:
        return [crossing.at(leg, BOX, left), crossing.at(leg, PITCH - BOX, left)]

    centre = files.border(f"C{name}", "centre", across(0.0))
    for start, end, out, into, side in ((crossing, other, leg, back, -1.0), (other, crossing, back, leg, 1.0)):
        way = f"{start.name}{end.name}"
        marks = [centre]
        if num > 1:
            marks.append(files.border(f"M{way}", "lane", across(side * LANE)))
        marks.append(files.border(f"E{way}", "edge", across(side * edge)))
        if end.is_lit:
            files.border(f"S{way}", "stop", [end.at(into, BOX, 0.0), end.at(into, BOX, edge)])
        for lane in range(1, num + 1):
            files.link(
                _road(start, out, lane),
                _node(start, out, "O", lane),
                _node(end, into, "I", lane),
                _line(start.at(out, BOX, -_offset(lane)), end.at(into, BOX, _offset(lane)), STEP),
                AVENUE_KMH if num > 1 else STREET_KMH,
                left_lane_change_dst_link_idx=_road(start, out, lane - 1) if lane > 1 else None,
                right_lane_change_dst_link_idx=_road(start, out, lane + 1) if lane < num else None,
                road_id=way,
                ego_lane=lane,
                lane_mark_left=[marks[lane - 1]],
                lane_mark_right=[marks[lane]],
            )


def _ways(crossing: Crossing, leg: str) -> Iterator[tuple[int, str, int, str]]:
    """Yield (lane, leg out, lane there, movement) of each movement for vehicles that come from a leg."""
    num = crossing.num_lanes(leg)
    for to in crossing.legs:
        if to == leg:
            continue
        movement = turn_of(leg, to)
        lane = 1 if movement == "left" else num
        lane_out = 1 if movement == "left" else crossing.num_lanes(to)
        if movement == "straight":
            lane_out = lane
        yield lane, to, lane_out, movement


def _turns(files: MapFiles, crossing: Crossing, leg: str) -> None:
    """Add the links inside a crossing that come from a leg."""
    for lane, to, lane_out, movement in _ways(crossing, leg):
        start, end = crossing.at(leg, BOX, _offset(lane)), crossing.at(to, BOX, -_offset(lane_out))
        if movement == "straight":
            points = _line(start, end, STEP)
        else:
            points = _corner(start, (start[0], end[1]) if leg in "NS" else (end[0], start[1]), end)
        files.link(
            _turn(crossing, leg, lane, to),
            _node(crossing, leg, "I", lane),
            _node(crossing, to, "O", lane_out),
            points,
            TURN_KMH if movement != "straight" else AVENUE_KMH if crossing.is_avenue(leg) else STREET_KMH,
            link_type="1" if crossing.is_lit else "Driving",
            related_signal=movement if crossing.is_lit else None,
            road_id=crossing.name,
            ego_lane=lane,
        )


def _bend_marks(files: MapFiles, crossing: Crossing) -> None:
    """Add the lines of a bend: they join those of its two streets."""
    leg, to = tuple(crossing.legs)
    edge = crossing.num_lanes(leg) * LANE
    for name, kind, left in (("C", "centre", 0.0), ("E", "edge", edge), ("F", "edge", -edge)):
        start, end = crossing.at(leg, BOX, left), crossing.at(to, BOX, -left)
        middle = (start[0], end[1]) if leg in "NS" else (end[0], start[1])
        files.border(f"{name}{crossing.name}", kind, _corner(start, middle, end))


# Lights


def _light(files: MapFiles, crossing: Crossing, leg: str, lamps: tuple[str, ...]) -> str:
    """Add a light for vehicles that come from a leg: on the far side, above their lane."""
    wanted = {"left"} if lamps is ARROW else {"straight", "right"} if lamps is CAR else {"straight", "right", "left"}
    links = [_turn(crossing, leg, lane, to) for lane, to, _, movement in _ways(crossing, leg) if movement in wanted]
    name = f"TL{crossing.name}{leg}" + ("L" if lamps is ARROW else "")
    dx, dy = LEGS[leg]
    at = crossing.at(opposite(leg), BOX - 1.0, -_offset(2 if lamps is CAR else 1))
    return files.light(name, links, at, math.degrees(math.atan2(dy, dx)), lamps)


def _lights(files: MapFiles, crossing: Crossing, controller: str) -> None:
    """Add the lights, crosswalks and the schedule of a crossing."""
    groups: list[tuple[str, str]] = []  # leg and kind: both, through, arrow, walk
    names: list[list[str]] = []
    for leg in crossing.legs:
        movements = {movement for *_, movement in _ways(crossing, leg)}
        if crossing.is_avenue(leg) and movements == {"left", "straight", "right"}:
            names += [[_light(files, crossing, leg, CAR)], [_light(files, crossing, leg, ARROW)]]
            groups += [(leg, "through"), (leg, "arrow")]
        else:
            names.append([_light(files, crossing, leg, BOTH)])
            groups.append((leg, "both"))
    if len(crossing.legs) == 4:
        for leg in crossing.legs:
            names.append(_crosswalk(files, crossing, leg))
            groups.append((leg, "walk"))
    for lights in names:
        files.group(controller, lights)
    files.controllers.append({"idx": controller, "TL": names})
    files.schedules.append({"idx": controller, **_schedule(crossing, groups)})


def _crosswalk(files: MapFiles, crossing: Crossing, leg: str) -> list[str]:
    """Add the crosswalk over a leg and the lights at its two ends; each faces the street."""
    edge = crossing.num_lanes(leg) * LANE
    near, away = WALK
    dx, dy = LEGS[leg]
    lights = []
    for i, side in enumerate((1.0, -1.0), start=1):
        at = crossing.at(leg, 0.5 * (near + away), side * (edge + 0.7))
        heading = math.degrees(math.atan2(-side * dx, side * dy))
        lights.append(files.light(f"PS{crossing.name}{leg}{i}", [], at, heading, None))
    corners = [crossing.at(leg, a, b) for a, b in ((near, -edge), (away, -edge), (away, edge), (near, edge))]
    files.crosswalk(f"CW{crossing.name}{leg}", corners, lights)
    return lights


def _schedule(crossing: Crossing, groups: list[tuple[str, str]]) -> dict[str, Any]:
    """Return the schedule: one leg after the other; opposite legs of an avenue together, first straight on, then left.

    Pedestrians walk while no vehicle turns left over their crosswalk: over the leg on the right of the green leg, and
    over both legs beside an avenue.
    """
    phases: list[tuple[int, dict[tuple[str, str], str], str]] = []  # seconds, colours, legs with walking pedestrians
    done: set[str] = set()
    for leg in crossing.legs:
        if leg in done:
            continue
        right = ORDER[(ORDER.index(leg) + 1) % 4]
        if (leg, "arrow") in groups:
            pair = [leg, opposite(leg)]
            done.update(pair)
            phases.append((18, {(one, "through"): "SG" for one in pair}, "".join(sorted((right, opposite(right))))))
            phases.append((8, {(one, "arrow"): "R_with_GLeft" for one in pair}, ""))
        else:
            phases.append((12, {(leg, "both"): "G_with_GLeft"}, right))
    states = [
        {"duration": seconds, "lightcolor": [green.get(group, "R") for group in groups]} for seconds, green, _ in phases
    ]
    walks = [
        [i, groups.index((leg, "walk")), 1, 5 if seconds < 15 else 8, 5 if seconds < 15 else 8]
        for i, (seconds, _, legs) in enumerate(phases)
        for leg in legs
        if (leg, "walk") in groups
    ]
    return {"TLState": states, "yelloduration": [YELLOW] * len(groups), "PSState": walks}


# The scene

MODELS = (
    *("2015_Kia_K5", "2016_Kia_Niro(HEV)", "Van", "2021_VW_Golf_GTI", "Hyundai_Ioniq_5", "2016_Genesis_DH", "Truck"),
    *("2014_Kia_K7", "2016_Hyundai_Ioniq", "Bus"),
)
STARTS: tuple[tuple[int, int, str, int], ...] = (  # column, row and leg of the crossing that they left, lane
    *((0, 0, "E", 1), (0, 0, "N", 1), (1, 0, "N", 1), (2, 0, "W", 1), (3, 0, "E", 1), (4, 0, "N", 1)),
    *((0, 1, "E", 1), (1, 1, "W", 1), (2, 1, "N", 1), (2, 1, "N", 2), (3, 1, "S", 1), (4, 1, "W", 1)),
    *((0, 2, "E", 1), (0, 2, "E", 2), (1, 2, "N", 1), (3, 2, "W", 2), (3, 2, "E", 1), (4, 2, "S", 1)),
    *((0, 3, "N", 1), (1, 3, "E", 1), (2, 3, "S", 2), (3, 3, "N", 1), (4, 3, "W", 1), (2, 4, "W", 1)),
)
WALKERS = ("Man", "Woman", "Child", "Pedestrian", "Woman", "Man")
WALKER_KMH = (5.0, 4.6, 4.0, 5.4, 4.3, 4.8)  # mean 1.3 m/s, as Helbing and Molnar have it
NUM_WALKERS = 40
KERB = 2.2  # from the edge of a street to the line on which people walk [m]


def town_scenario() -> bytes:
    """Return the scenario: the ego on the avenue, traffic on all streets, pedestrians who cross them."""
    ids = iter(range(1, 1000))
    vehicles = []
    for i, (column, row, leg, lane) in enumerate(STARTS):
        vehicles.append({"UNIQUEID": next(ids), **_npc(i, Crossing(column, row), leg, lane)})
    people, paths = [], []
    for i, (start, line) in zip(range(NUM_WALKERS), _walks(), strict=False):
        uid = next(ids)
        yaw = math.degrees(math.atan2(line[0][1] - start[1], line[0][0] - start[0]))
        who = {"UNIQUEID": uid, "modelName": WALKERS[i % len(WALKERS)], **pose(*start, yaw)}
        people.append({**who, "speed": WALKER_KMH[i % len(WALKER_KMH)], "loop": True, "yields": True})
        paths.append({"pathName": f"PedPath - {uid}", "waypointData": list(engine_waypoints(line))})
    ego = Crossing(1, 2).at("E", BOX + 10.0, -_offset(2))
    document = {
        "mapInfo": {"mapName": "town"},
        "egoVehicle": {"UNIQUEID": -1, "modelName": "2016_Hyundai_Ioniq", "initPosition": init(*ego, 0.0), "gear": 4},
        "vehicleList": vehicles,
        "pedestrianList": people,
        "waypointDataList": paths,
        "tlList": [{"index": f"IntTL{i}", "state": i % 3, "deltaTime": 0.0} for i in range(NUM * NUM - 4)],
    }
    return json_lines(document)


def _walks() -> Iterator[tuple[Point, list[Point]]]:
    """Yield places to start at, and closed paths that cross streets on crosswalks.

    A path leads along both pavements of a street and over the crosswalks at its two ends, or once around a crossing.
    """
    middle = 0.5 * (WALK[0] + WALK[1])
    lit = [crossing for crossing in CROSSINGS if len(crossing.legs) == 4]
    for turn in range(NUM):
        for i, crossing in enumerate(lit):
            if (i + turn) % 3 == 0:
                corners = [crossing.at("E", a, b) for a, b in itertools.product((middle, -middle), repeat=2)]
                around = [corners[0], corners[2], corners[3], corners[1]]
                around = around[turn % 4 :] + around[: turn % 4]
                line = around if turn % 2 else around[::-1]
            else:
                leg = "EN"[(i + turn) % 2]
                other, back = crossing.neighbour(leg), opposite(leg)
                if len(other.legs) < len(ORDER):
                    leg, other, back = back, crossing.neighbour(back), leg
                if len(other.legs) < len(ORDER):
                    continue
                aside = crossing.num_lanes(leg) * LANE + KERB
                near, far = crossing.at(leg, middle, aside), other.at(back, middle, -aside)
                line = [near, far, other.at(back, middle, aside), crossing.at(leg, middle, -aside)]
                line = line if turn % 2 else line[::-1]
            share = (0.13 + 0.31 * i + 0.17 * turn) % 1.0
            (x, y), (to_x, to_y) = line[-1], line[0]
            start = (mm(x + share * (to_x - x)), mm(y + share * (to_y - y)))
            yield start, line


def _npc(i: int, crossing: Crossing, leg: str, lane: int) -> dict[str, Any]:
    """Return a vehicle that follows the lanes, on a street."""
    part = mm(0.15 + 0.1 * (i * 7 % 6))
    x, y = crossing.at(leg, BOX + part * (PITCH - 2 * BOX), -_offset(lane))
    dx, dy = LEGS[leg]
    at_link = {"initPositionMode": "Link", "initLink": _road(crossing, leg, lane), "initLinkRatio": part}
    return {
        "modelName": MODELS[i % len(MODELS)],
        "initPosition": {**init(x, y, math.degrees(math.atan2(dy, dx))), **at_link},
        "velocityType": 1,
        "currentVelocity": 20,
        "isWaypointMode": False,
    }
