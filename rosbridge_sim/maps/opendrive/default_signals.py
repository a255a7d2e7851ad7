"""A plan for the lights of each junction, because OpenDRIVE has none: phases without conflict, and their times.

Groups of lights (a controller's, or the lights of one approach) may be green together if none of their lanes comes near
a lane of the other, as in MUTCD 2009, 4D.05: no green for conflicting movements. A left turn against oncoming traffic
has a phase of its own, since a light with three lamps shows no arrow. Each group is in the first phase in which it
conflicts with no other; phases then take in every further group that fits.

Times: yellow is 1 s of reaction and the time to stop with 3.05 m/s^2, within 3 to 6 s; all red is the time to clear the
junction with a vehicle of 6.1 m, at least 1 s (ITE, "Guidelines for Determining Traffic Signal Change and Clearance
Intervals", 2020; MUTCD 2009, 4D.26). Pedestrians have 7 s of green and then flashing for their way at 1.07 m/s (MUTCD
2009, 4E.06). A green of 20 s is a choice.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from rosbridge_sim.maps.opendrive.signal_elements import LanesOfRoads, SignalGroup, SignalsRead
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import DEFAULT_SPEED_LIMIT
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Phase, SignalPlan, Walk
from rosbridge_sim.world.state.world import in_frames

GREEN: Final = 20.0
REACTION, BRAKING = 1.0, 3.05
LEAST_YELLOW, MOST_YELLOW = 3.0, 6.0
LEAST_RED, MOST_RED, VEHICLE = 1.0, 6.0, 6.1
WALK, WALKING_SPEED = 7.0, 1.07
ALONE: Final = 10.0
"""Red of a junction with one phase, in which those without a light go [s]."""

CLEAR: Final = 2.5
"""Lanes whose middles come nearer than this conflict [m]."""

SPACING: Final = 1.0
"""Distance of the places at which lanes are compared [m]."""


def plan_signals(
    roads: Roads, lanes: LanesOfRoads, signals: SignalsRead, by_controller: Mapping[str, Sequence[str]]
) -> SignalPlan:
    """Return the plan of all lights of a map.

    Args:
        by_controller: names of the lights of each controller.
    """
    junction_of: dict[int, str] = {}
    for row, light in enumerate(signals.lights):
        near = light.lanes or tuple(sorted(signals.crossed.get(row, ())))
        names = [lanes.roads[lanes.pieces[lane].road].junction for lane in _around(lanes, near)]
        junction_of[row] = next(filter(None, names), f"signal {light.name}")
    groups: dict[str, list[SignalGroup]] = {}
    for group in _group_lights(lanes, signals, by_controller, junction_of):
        groups.setdefault(junction_of[group.lights[0]], []).append(group)
    controllers = [_plan_junction(roads, lanes, name, own) for name, own in groups.items()]
    return SignalPlan(roads, signals.lights, controllers)


def _around(lanes: LanesOfRoads, rows: Sequence[int]) -> Iterator[int]:
    """Yield lanes, those behind them and those before them."""
    yield from rows
    for row in rows:
        yield from lanes.successors[row]
        yield from lanes.predecessors[row]


def _group_lights(
    lanes: LanesOfRoads,
    signals: SignalsRead,
    by_controller: Mapping[str, Sequence[str]],
    junction_of: Mapping[int, str],
) -> Iterator[SignalGroup]:
    """Yield the groups: lights of a controller at one junction, then those that share a lane or a crossed road."""
    rows = {light.name: row for row, light in enumerate(signals.lights)}
    left = dict.fromkeys(range(len(signals.lights)))
    wanted = [[rows[name] for name in names if name in rows] for names in by_controller.values()]
    for members in [*wanted, *([row] for row in rows.values())]:
        for is_walk in (False, True):
            own = [
                row for row in dict.fromkeys(members) if row in left and signals.lights[row].is_pedestrian == is_walk
            ]
            if not own:
                continue
            served = {lane for row in own for lane in _lanes_of(signals, row)}
            own += [
                row
                for row in left
                if row not in own
                and signals.lights[row].is_pedestrian == is_walk
                and junction_of[row] == junction_of[own[0]]
                and served.intersection(_lanes_of(signals, row))
            ]
            for row in own:
                del left[row]
            served = {lane for row in own for lane in _lanes_of(signals, row)}
            # A lane that ends at the crosswalk and the one that begins there are one to cross.
            crossed = [lanes.pieces[lane] for lane in sorted(served) if is_walk]
            width = sum({(piece.road, piece.lane): piece.width for piece in crossed}.values())
            yield SignalGroup(tuple(own), frozenset(served), is_walk, width)


def _lanes_of(signals: SignalsRead, row: int) -> Sequence[int] | frozenset[int]:
    return signals.crossed.get(row, signals.lights[row].lanes)


def _plan_junction(roads: Roads, lanes: LanesOfRoads, name: str, groups: Sequence[SignalGroup]) -> Controller:
    """Return the controller of a junction with a phase for each set of groups without conflict."""
    conflict = _find_conflicts(roads, lanes, groups)
    chosen: list[list[int]] = []
    for row in range(len(groups)):
        phase = next((phase for phase in chosen if not conflict[row, phase].any()), None)
        if phase is None:
            chosen.append(phase := [])
        phase.append(row)
    for phase in chosen:
        phase += [row for row in range(len(groups)) if row not in phase and not conflict[row, phase].any()]
    yellow, red = _clearance(roads, lanes, groups)
    phases: list[Phase] = []
    walks: list[Walk] = []
    for own in chosen:
        crossing = [row for row in own if groups[row].is_pedestrian]
        times = [(WALK, groups[row].width / WALKING_SPEED) for row in crossing]
        length = max([GREEN, *map(sum, times)] if len(crossing) < len(own) else [*map(sum, times)])
        walks += [
            Walk(len(phases), row, 0, in_frames(green), in_frames(flashing))
            for row, (green, flashing) in zip(crossing, times, strict=True)
        ]
        lit = [Lamp.GREEN if row in own else Lamp.RED for row in range(len(groups))]
        phases.append(Phase(in_frames(length), tuple(map(int, lit))))
        pause = red if len(chosen) > 1 else ALONE
        phases.append(Phase(in_frames(pause), (int(Lamp.RED),) * len(groups)))
    number = re.search(r"\d+$", name)
    return Controller(
        name,
        int(number[0]) % 2**31 if number else 0,
        tuple(group.lights for group in groups),
        tuple(phases),
        tuple(in_frames(0.0 if group.is_pedestrian else yellow) for group in groups),
        tuple(walks),
    )


def _find_conflicts(roads: Roads, lanes: LanesOfRoads, groups: Sequence[SignalGroup]) -> BoolArray:
    """Return which groups may not be green together, (k, k) bool."""
    found = np.zeros((len(groups), len(groups)), dtype=bool)
    ways = [_places(roads, group) for group in groups]
    for i, one in enumerate(groups):
        for j, other in enumerate(groups[:i]):
            if one.is_pedestrian != other.is_pedestrian:
                walk, drive = (one, other) if one.is_pedestrian else (other, one)
                is_bad = bool(walk.lanes.intersection(_around(lanes, tuple(drive.lanes))))
            elif one.is_pedestrian:
                is_bad = False
            else:
                is_bad = _meet(lanes, ways[i], ways[j])
            found[i, j] = found[j, i] = is_bad
    return found


_Places = tuple[FloatArray, IntArray]


def _places(roads: Roads, group: SignalGroup) -> _Places:
    """Return places on the lanes of a group, (m, 2), and the lane of each."""
    rows = sorted(group.lanes)
    counts = [int(roads.length[row] / SPACING) + 2 for row in rows]
    lane = np.repeat(np.array(rows, dtype=np.int64), counts)
    s = np.concatenate(
        [np.zeros(0), *(np.linspace(0.0, roads.length[row], n) for row, n in zip(rows, counts, strict=True))]
    )
    return (roads.at(lane, s)[0][:, :2] if len(lane) else np.zeros((0, 2))), lane


def _meet(lanes: LanesOfRoads, one: _Places, other: _Places) -> bool:
    """Return whether lanes of two groups come near each other, but for those that begin at one place."""
    if not len(one[0]) or not len(other[0]):
        return False
    x, y = (one[0][:, None, axis] - other[0][:, axis] for axis in (0, 1))
    near = np.argwhere(x * x + y * y < CLEAR * CLEAR)
    pairs = {(int(one[1][i]), int(other[1][j])) for i, j in near.tolist()}
    return any(a != b and not set(lanes.predecessors[a]).intersection(lanes.predecessors[b]) for a, b in pairs)


def _clearance(roads: Roads, lanes: LanesOfRoads, groups: Sequence[SignalGroup]) -> tuple[float, float]:
    """Return yellow and all red of a junction, for its fastest approach and its longest way [s]."""
    driven = [lane for group in groups if not group.is_pedestrian for lane in group.lanes]
    limits = [roads.speed_limit[row] for lane in driven for row in lanes.predecessors[lane]]
    speed = max([float(limit) for limit in limits if limit > 0.0], default=DEFAULT_SPEED_LIMIT)
    way = max((float(roads.length[lane]) for lane in driven), default=0.0)
    yellow = min(max(REACTION + speed / (2.0 * BRAKING), LEAST_YELLOW), MOST_YELLOW)
    red = min(max((way + VEHICLE) / speed, LEAST_RED), MOST_RED)
    return math.ceil(10.0 * yellow) / 10.0, math.ceil(10.0 * red) / 10.0
