"""The map `motorway`: three one-way lanes on a ring with exits and entries, and two scenarios on it.

A fourth lane on the right leads to each exit: it forks from lane 3 and lies beside it. A service road with one lane
leads from the exit to the next entry. There a fourth lane lies beside lane 3 again, and ends by joining it. So every
lane goes on, and a driver that changes no lanes can take an exit and an entry, too.

All lines are given by their place along the ring and their distance from its middle lane.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

from scripts.drawing.mgeo import LANE, MapFiles, init, json_lines
from scripts.drawing.section import Section, bend, lay, straight

OFFSETS = (LANE, 0.0, -LANE)  # lane 1 is the innermost, as everywhere [m]
BESIDE = -2.0 * LANE  # lane 4
SERVICE = -2.0 * LANE - 18.0  # the service road: 12 m of grass lie between it and the motorway
STEP, STRAIGHT_STEP = 1.0, 50.0  # between points of a lane, in bends and on straights [m]
BORDER_STEP = 10.0  # of its edges [m]; on the tightest bend the chord leaves the arc by 3 cm
RAMP_BORDER_STEP = 5.0  # of the edges of a lane that moves sideways [m]
LIMIT, BESIDE_LIMIT, ENTRY_LIMIT, SERVICE_LIMIT = 120, 100, 80, 60  # [km/h]

Point = tuple[float, float]
Offset = Callable[[float], float]
"""Place along the ring -> distance to the left of its middle lane [m]."""


class Interchange(NamedTuple):
    """An exit and the entry behind it: places along the ring [m]."""

    fork: float  # lane 4 begins to leave lane 3
    exit_lane: float  # it is beside lane 3
    exit_ramp: float  # it leaves the motorway
    service: float
    entry_ramp: float
    entry_lane: float  # the ramp is beside lane 3
    join: float  # lane 4 begins to join lane 3
    end: float


def motorway() -> list[Section]:
    """Return the sections of the middle lane, 6.0 km.

    At 120 km/h the lateral acceleration on a radius of 500 m is 2.2 m/s^2.

    Returns:
        The sections, in order.
    """
    way = [
        straight(1400, LIMIT),  # 0 start
        bend(500, 90, LIMIT),
        straight(150, LIMIT),
        bend(500, 90, LIMIT),
        straight(100, LIMIT),
        bend(600, -35, LIMIT),  # 5 the S
        bend(600, 35, LIMIT),
        straight(0, LIMIT),  # 7 to the west
        bend(500, 90, LIMIT),
        straight(0, LIMIT),  # 9 to the south
        bend(500, 90, LIMIT),
    ]
    return lay(way, to_west=7, to_south=9)


_SECTIONS = motorway()
_STARTS = tuple(accumulate((section.length for section in _SECTIONS), initial=0.0))
LENGTH = _STARTS[-1]

# A fork of 80 m and a join of 100 m can be driven at 100 km/h with less than 2.1 m/s^2 to the side. Lane 4 is as long
# as guidelines want it: 150 to 250 m to slow down, 250 m to come up to speed.
INTERCHANGES = (
    Interchange(120.0, 200.0, 400.0, 560.0, 760.0, 920.0, 1200.0, 1300.0),
    # The second one lies in bends: its exit before the S, its entry behind it.
    Interchange(*(_STARTS[3] + away for away in (500.0, 580.0, 780.0, 940.0, 1540.0, 1700.0, 1980.0, 2080.0))),
)


def _section(s: float) -> int:
    return min(bisect_right(_STARTS, s + 1e-9), len(_SECTIONS)) - 1


def at(s: float, offset: float) -> Point:
    """Return a point of the map.

    Args:
        s: along the middle lane [m].
        offset: to the left of it [m].

    Returns:
        East and north [m].
    """
    i = _section(s)
    return _SECTIONS[i].at(s - _STARTS[i], offset)


def _heading(s: float) -> float:
    """Return the direction of the middle lane [rad]."""
    i = _section(s)
    return _SECTIONS[i].yaw + _SECTIONS[i].curvature * (s - _STARTS[i])


def _line(start: float, end: float, offset: float | Offset, step: float) -> list[Point]:
    num = max(1, math.ceil((end - start) / step - 1e-9))
    places = [start + (end - start) * i / num for i in range(num + 1)]
    return [at(s, offset if isinstance(offset, float) else offset(s)) for s in places]


def _lane(start: float, end: float, offset: float | Offset) -> list[Point]:
    """Return the points of a lane: close together where it bends, far apart where it is straight."""
    cuts = [start, *(s for s in _STARTS if start + 1e-6 < s < end - 1e-6), end]
    points = []
    for low, high in pairwise(cuts):
        curvature = _SECTIONS[_section(low)].curvature
        is_straight = curvature == 0.0 and isinstance(offset, float)
        # A lane on the outside of a bend is longer than the middle one; where it moves sideways, by 2 % more.
        longest = max(1.0, 1.0 - offset * curvature) if isinstance(offset, float) else 1.02 - SERVICE * abs(curvature)
        points += _line(low, high, offset, STRAIGHT_STEP if is_straight else STEP / longest)[:-1]
    return [*points, at(end, offset if isinstance(offset, float) else offset(end))]


def _sideways(start: float, end: float, before: float, after: float) -> Offset:
    """Return a line that moves sideways as half a cosine wave does."""
    return lambda s: before + (after - before) * 0.5 * (1.0 - math.cos(math.pi * (s - start) / (end - start)))


def _cuts() -> list[float]:
    """Return where the lanes of the motorway are cut into links [m]: at bends, and where a fourth lane comes or goes.

    A bend that begins within 30 m of another cut gets none of its own.
    """
    fixed = [place for each in INTERCHANGES for place in (*each[:3], *each[5:])]
    near = 30.0
    bends = [s for s in _STARTS[:-1] if all(abs(s - place) > near for place in fixed)]
    return [*sorted([*fixed, *bends]), LENGTH]


_CUTS = _cuts()


def _piece(s: float) -> int:
    """Return the number of the links at a place."""
    return min(bisect_right(_CUTS, s + 1e-9), len(_CUTS) - 1) - 1


def motorway_files() -> dict[str, bytes]:
    """Return the map.

    Returns:
        File name -> content, in MGeo format.
    """
    files = MapFiles(360000.0, 4150000.0, digits=4)
    num = len(_CUTS) - 1
    beside = {_piece(start) for each in INTERCHANGES for start in (each.exit_lane, each.entry_lane)}
    open_right = beside | {_piece(start) for each in INTERCHANGES for start in (each.fork, each.join)}
    for i, s in enumerate(_CUTS[:-1]):
        for lane, offset in enumerate(OFFSETS, start=1):
            files.node(f"N{lane}_{i:02}", at(s, offset))
    for i, (start, end) in enumerate(pairwise(_CUTS)):
        kinds = ("edge", "lane", "lane", "lane" if i in open_right else "edge")
        is_straight = _section(start) == _section(end - 1.0) and _SECTIONS[_section(start)].curvature == 0.0
        for border, kind in enumerate(kinds):
            files.border(
                f"B{border}_{i:02}",
                kind,
                _line(start, end, (1.5 - border) * LANE, math.inf if is_straight else BORDER_STEP),
            )
        for lane, offset in enumerate(OFFSETS, start=1):
            is_rightmost = lane == len(OFFSETS) and i not in beside
            files.link(
                f"L{lane}_{i:02}",
                f"N{lane}_{i:02}",
                f"N{lane}_{(i + 1) % num:02}",
                _lane(start, end, offset),
                LIMIT,
                left_lane_change_dst_link_idx=f"L{lane - 1}_{i:02}" if lane > 1 else None,
                right_lane_change_dst_link_idx=None if is_rightmost else f"L{lane + 1}_{i:02}",
                road_id=str(i),
                ego_lane=lane,
                lane_mark_left=[f"B{lane - 1}_{i:02}"],
                lane_mark_right=[f"B{lane}_{i:02}"],
            )
    for number, interchange in enumerate(INTERCHANGES):
        _ramps(files, number, interchange)
    return files.files()


def _ramps(files: MapFiles, number: int, places: Interchange) -> None:
    """Add the links of an exit, of the service road behind it, and of the entry."""
    out, into = _piece(places.exit_lane), _piece(places.entry_lane)
    fork, join = _piece(places.fork), _piece(places.join)
    names = ("F", f"L4_{out:02}", "X", "S", "E", f"L4_{into:02}", "J")  # fork, exit lane, exit, service, entry, ...
    offsets: tuple[float | Offset, ...] = (
        _sideways(places.fork, places.exit_lane, OFFSETS[2], BESIDE),
        BESIDE,
        _sideways(places.exit_ramp, places.service, BESIDE, SERVICE),
        SERVICE,
        _sideways(places.entry_ramp, places.entry_lane, SERVICE, BESIDE),
        BESIDE,
        _sideways(places.join, places.end, BESIDE, OFFSETS[2]),
    )
    limits = (BESIDE_LIMIT, BESIDE_LIMIT, SERVICE_LIMIT, SERVICE_LIMIT, ENTRY_LIMIT, BESIDE_LIMIT, BESIDE_LIMIT)
    nodes = [f"N3_{fork:02}", *(f"N{number}_{name}" for name in "ABCDEF"), f"N3_{join + 1:02}"]
    for node, place, offset in zip(nodes[1:-1], places[1:-1], offsets[1:], strict=True):
        files.node(node, at(place, offset if isinstance(offset, float) else offset(place)))
    for k, (start, end) in enumerate(pairwise(places)):
        name, offset = names[k], offsets[k]
        is_lane = isinstance(offset, float)
        link = name if name.startswith("L4") else f"{name}{number}"
        step = BORDER_STEP if is_lane else RAMP_BORDER_STEP
        sides = {
            side: (offset + away if isinstance(offset, float) else _beside(offset, away))
            for side, away in (("L", 0.5 * LANE), ("R", -0.5 * LANE))
        }
        piece = {0: fork, 1: out, 5: into, 6: join}.get(k)
        left = (
            f"B3_{piece:02}"
            if piece is not None
            else files.border(f"{link}L", "edge", _line(start, end, sides["L"], step))
        )
        right = files.border(f"{link}R", "edge", _line(start, end, sides["R"], step))
        files.link(
            link,
            nodes[k],
            nodes[k + 1],
            _lane(start, end, offset),
            limits[k],
            left_lane_change_dst_link_idx=f"L3_{piece:02}" if name.startswith("L4") else None,
            road_id=f"{piece}" if piece is not None else f"S{number}",
            ego_lane=1 if piece is None else 4,
            lane_mark_left=[left],
            lane_mark_right=[right],
        )


def _beside(offset: Offset, away: float) -> Offset:
    return lambda s: offset(s) + away


# The scene

FAST = ("2020_Kia_Stinger", "2016_Genesis_DH", "2015_Kia_K5", "2021_VW_Golf_GTI", "2014_Kia_K7")
CALM = ("2016_Kia_Niro(HEV)", "Hyundai_Ioniq_5", "Van", "2016_Hyundai_Ioniq", "2015_Kia_K5")
SLOW = ("Truck", "Bus", "Truck", "Van")
TRAFFIC = (  # models, lane, first place and distance along the ring, number, km/h of the slowest and the fastest
    (FAST, 1, 260.0, 430.0, 13, 115, 130),
    (CALM, 2, 90.0, 370.0, 15, 98, 112),
    (SLOW, 3, 330.0, 470.0, 12, 78, 88),
)
ON_SERVICE = (("2021_VW_Golf_GTI", 0, 600.0), ("Van", 0, 690.0), ("2016_Genesis_DH", 1, 1100.0), ("Truck", 1, 1300.0))
EGO = 20.0  # place of the ego on lane 3 [m]: 100 m before the first exit
RUSH_HOUR_EGO = 700.0  # on lane 1, beside the first service road: most others keep right of it [m]
LEAVE, COME_IN = 0.4, 0.6  # parts of a service road: those that come in do so beyond the place where others leave


def motorway_scenario() -> bytes:
    """Return the scenario: the ego before an exit, mixed traffic on all lanes, some of it on the service roads."""
    vehicles: list[dict[str, Any]] = []
    for models, lane, first, apart, num, slowest, fastest in TRAFFIC:
        for k in range(num):
            s = (first + apart * k) % LENGTH
            i = _piece(s)
            start, end = _CUTS[i], _CUTS[i + 1]
            speed = slowest + (fastest - slowest) * (k * 5 % num) // num
            link = f"L{lane}_{i:02}", (s - start) / (end - start)
            vehicles.append(_npc(models[k % len(models)], (s, OFFSETS[lane - 1]), link, speed, 80))
    for model, number, away in ON_SERVICE:
        places = INTERCHANGES[number]
        s = away if number == 0 else _STARTS[3] + away
        part = (s - places.service) / (places.entry_ramp - places.service)
        vehicles.append(_npc(model, (s, SERVICE), (f"S{number}", part), None, 50))
    return json_lines({**_opening(EGO, 3), "vehicleList": vehicles})


def rush_hour_scenario() -> bytes:
    """Return the scenario: vehicles come in at both entries and leave at the other exit; the ego stands on lane 1."""
    points = [
        {
            "UNIQUEID": 1 + number,
            "startLinkInfo": {"linkIdx": f"S{number}", "pointIdx": _service_point(number, COME_IN)},
            "endLinkInfo": {"linkIdx": f"S{1 - number}", "pointIdx": _service_point(1 - number, LEAVE)},
            "minSpawnPeriod": 3.0,
            "maxSpawnPeriod": 6.0,
            "waitSpawnTime": 1.0,
            "maximumSpawnVehicle": 60,
            "SpawnVelocityType": 2,
            "MinSpawnVelocity_Custom": 40,
            "MaxSpawnVelocity_Custom": 50,
            "DesiredVelocityType": 2,
            "MinDesiredVelocity_Custom": 95,
            "MaxDesiredVelocity_Custom": 130,
        }
        for number in range(len(INTERCHANGES))
    ]
    return json_lines({**_opening(RUSH_HOUR_EGO, 1), "spawnPointList": points})


def _opening(ego: float, lane: int) -> dict[str, Any]:
    """Return the map and the ego of a scenario; `ego` is its place along the ring [m]."""
    return {
        "mapInfo": {"mapName": "motorway"},
        "egoVehicle": {
            "UNIQUEID": -1,
            "modelName": "2016_Hyundai_Ioniq",
            "initPosition": init(*at(ego, OFFSETS[lane - 1]), math.degrees(math.remainder(_heading(ego), math.tau))),
            "gear": 4,
        },
    }


def _service_point(number: int, part: float) -> int:
    """Return a point of a service road, by the part of its length, 0..1."""
    places = INTERCHANGES[number]
    there = at(places.service + part * (places.entry_ramp - places.service), SERVICE)
    line = _lane(places.service, places.entry_ramp, SERVICE)
    return min(range(len(line)), key=lambda i: math.dist(line[i], there))


def _npc(model: str, place: Point, link: tuple[str, float], speed: int | None, now: int) -> dict[str, Any]:
    """Return a vehicle that follows the lanes.

    Args:
        model: name in the catalogue.
        place: along the ring, and to the left of its middle lane [m].
        link: the link there, and how far along it, 0..1.
        speed: the greatest [km/h]; None for the speed limits.
        now: speed at the start [km/h].

    Returns:
        The item of `vehicleList`.
    """
    yaw = math.degrees(math.remainder(_heading(place[0]), math.tau))
    at_link = {"initPositionMode": "Link", "initLink": link[0], "initLinkRatio": round(link[1], 4)}
    return {
        "modelName": model,
        "initPosition": {**init(*at(*place), yaw), **at_link},
        "velocityType": 1 if speed is None else 2,
        "constantVelocity": speed or LIMIT,
        "currentVelocity": now,
        "isWaypointMode": False,
    }
