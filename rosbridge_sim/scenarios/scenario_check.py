"""Mistakes and oddities of a scenario, for its author: `rosbridge-sim scenario check`.

Loading stops at the first mistake; here all are wanted. So each value that does not fit is reported and replaced by a
harmless one, and reading goes on with the same readers. An oddity can be loaded but is probably not intended: a vehicle
off the road or against its lane, a path far from its follower, or two overlapping things.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, Final

import numpy as np

from rosbridge_sim.documents.document_model import Mistake, SortedKeys, keys_beside, sort_keys
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.extent import find_far_lanes
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.catalogue import BUILT_IN, Catalogue
from rosbridge_sim.scenarios.events import check_places
from rosbridge_sim.scenarios.scenario import Scenario, Spawn
from rosbridge_sim.scenarios.scenario_model import MAX_SCENARIO_BYTES, ScenarioDocument, find_scenario_mistakes
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, read_scenario, sort_phases
from rosbridge_sim.suggestions import find_misspelt
from rosbridge_sim.world.geometry.near_pairs import MAX_WIDE, find_near_pairs
from rosbridge_sim.world.geometry.planar import ComplexArray, FloatArray, IntArray, do_boxes_meet, nearest_on_polyline
from rosbridge_sim.world.roads.roads import Roads

AGAINST: Final = math.radians(90.0)
"""Smallest angle between a vehicle and the nearest lane for a vehicle that stands against its lane [rad]."""

FAR: Final = 10.0
"""Largest plausible distance of an entity from its path [m]."""

BEYOND: Final = 1_000.0
"""Distance from the box around all roads from which on a person or a thing is not meant for this map [m]."""

MAX_ODDITIES: Final = 50
"""Largest number of lines for one kind of oddity."""

MAX_UNKNOWN: Final = 2_000
"""Largest number of different unknown keys that are compared with the known ones, some 50 us each."""

_AT_ORIGIN: Final = {"x": 0, "y": 0}
_STAND_INS: Final[Mapping[str, Any]] = {
    "vehicleList": {"initPosition": {"pos": _AT_ORIGIN}},
    "pedestrianList": {"pos": _AT_ORIGIN},
    "objectList": {"pos": _AT_ORIGIN},
    "tlList": {"index": ""},
    "spawnPointList": {},
}
"""Replacement of an item that cannot be read, so that the items after it keep their numbers."""


class Draft(Record, eq=False):
    """A scenario as far as it can be read.

    Attributes:
        scenario: without the items that have a mistake; None if nothing can be read.
        mistakes: a line each.
        keys: number of times that each key stands in the document, by its use.
        document: as it was parsed; None if it is not JSON.
    """

    scenario: Scenario | None
    mistakes: tuple[str, ...]
    keys: SortedKeys
    document: Any = None  # a JSON value


def read_draft(text: bytes, source: str, catalogue: Catalogue = BUILT_IN) -> Draft:
    """Read as much of a scenario as possible.

    Args:
        text: the file's bytes.
        source: its name, for the lines about mistakes.
    """
    found = find_scenario_mistakes(text, source)
    lines = [mistake.text for mistake in found]
    try:
        # Decoded here, because `loads` would accept UTF-16, too. What is too long would take gigabytes.
        document = json.loads(text.decode("utf-8-sig")) if len(text) <= MAX_SCENARIO_BYTES else None
    except (ValueError, RecursionError):
        document = None
    scenario = None
    if isinstance(document, dict):
        rest, gone = _without(document, found)
        try:
            text = json.dumps(rest).encode()
            scenario = read_scenario(text, source, lambda error: lines.append(str(error)), catalogue)
        except DocumentError as error:
            if not found:
                lines.append(str(error))
        else:
            scenario = _leave_out(scenario, gone)
    return Draft(scenario, tuple(dict.fromkeys(lines)), sort_keys(ScenarioDocument, document), document)


def find_misspelt_key(path: str) -> str:
    """Return the known key of which an unknown one is surely a misspelling; an empty text if there is none.

    Args:
        path: of the unknown key, as in `Draft.keys`.
    """
    return find_misspelt(path.rpartition(".")[2].removesuffix("[]"), keys_beside(ScenarioDocument, path))


_BLOCK_PLACES: Final = "in items of vehicleList, pedestrianList and objectList, and beside these lists"


def find_misspelt_keys(keys: SortedKeys) -> list[str]:
    """Find ignored keys that are surely misspelt, and blocks of ours at a place that has none."""
    lines = []
    for path, num in islice(keys.passed_over.items(), MAX_UNKNOWN):
        meant = find_misspelt_key(path)
        times = "" if num == 1 else f" ({num:,} times)"
        if f".{path}".endswith(".rosbridge_sim"):
            lines.append(f"{path}{times} is ignored; it is read {_BLOCK_PLACES}")
        elif meant and ".rosbridge_sim." not in f".{path}":  # there an unknown key is a mistake
            lines.append(f"{path}{times} is no known key and is ignored; did you mean {meant}?")
    return _short(lines)


def _without(document: dict[str, Any], mistakes: Sequence[Mistake]) -> tuple[dict[str, Any], set[str]]:
    """Return the document without the parts that cannot be read, and the items among these (`vehicleList[2]`)."""
    rest = dict(document)
    gone = set()
    for mistake in mistakes:
        key, number = (*mistake.place, None, None)[:2]
        if isinstance(number, int) and isinstance(rest.get(str(key)), list):
            # A path keeps its name, so that its followers are not reported as mistakes too.
            item = rest[str(key)][number]
            name = item.get("pathName") if isinstance(item, dict) else None
            path = {"pathName": str(name), "waypointData": [{"pos": {"x": 0, "z": 0}}]}
            items = list(rest[str(key)])
            items[number] = _STAND_INS.get(str(key), path)
            rest[str(key)] = items
            gone.add(f"{key}[{number}]")
        elif key is not None:
            rest[str(key)] = None
    return rest, gone


def _leave_out(scenario: Scenario, gone: set[str]) -> Scenario:
    parts = {key: getattr(scenario, key) for key in ("vehicles", "pedestrians", "obstacles", "spawn_points")}
    kept = {key: tuple(each for each in part if each.where not in gone) for key, part in parts.items()}
    phases = tuple(start for i, start in enumerate(scenario.phases) if f"tlList[{i}]" not in gone)
    return replace(scenario, **kept, phases=phases)


def place_draft(scenario: Scenario, road_map: RoadMap) -> tuple[Scenario, list[str]]:
    """Place a scenario on a map.

    Returns:
        The scenario with notes about oddities on this map; and the mistakes that only the map shows.
    """
    mistakes: list[str] = []
    placed = place_on_roads(scenario, road_map.roads, lambda error: mistakes.append(str(error)))
    if placed.story is not None:
        try:
            check_places(placed.story, road_map)
        except DocumentError as error:
            mistakes.append(str(error))
    _, strange = sort_phases(placed, road_map.plan)
    return replace(placed, notes=(*placed.notes, *(f"tlList: {line}" for line in strange))), mistakes


# What looks odd


def find_oddities(scenario: Scenario, roads: Roads | None) -> list[str]:
    """Find vehicles off the road or against their lane, entities far from their path, and overlapping entities.

    Args:
        scenario: placed, if a map is known.
        roads: of the map; None skips the checks of vehicles on roads.
    """
    drivers = [spawn for spawn in (*scenario.egos, *scenario.vehicles) if spawn.is_placed]
    others = [spawn for spawn in (*scenario.pedestrians, *scenario.obstacles) if spawn.is_placed]
    has_roads = roads is not None and len(roads) > 0
    lines = list(_beside_roads(drivers, roads)) if drivers and roads is not None and has_roads else []
    lines += _beyond_map(others, roads) if roads is not None and has_roads else []
    strays = [line for line in map(_far_from_path, (*drivers, *others)) if line is not None]
    pairs, is_all = _meeting([*drivers, *others])
    meeting = [f"{a.where} ({a.name}) and {b.where} ({b.name}) overlap" for a, b in pairs]
    return [*_short(lines), *_short(strays), *_short(meeting, is_all=is_all)]


def _beside_roads(spawns: Sequence[Spawn], roads: Roads) -> Iterator[str]:
    places = roads.nearest(
        *([getattr(spawn, name) for spawn in spawns] for name in ("x", "y", "yaw", "z")),
    )
    to_left, to_right = roads.beside(places)
    beyond_end = np.sqrt(np.maximum(places.distance**2 - places.lateral**2, 0.0))
    outside = np.maximum(beyond_end, -np.minimum(to_left, to_right))
    for i, spawn in enumerate(spawns):
        lane = roads.ids[places.lane[i]]
        if outside[i] > 0.01:  # noqa: PLR2004  # on the line itself
            yield f"{spawn.where} ({spawn.name}) stands {outside[i]:.1f} m off the nearest lane, {lane!r}"
        elif abs(math.remainder(float(places.yaw[i]) - spawn.yaw, math.tau)) > AGAINST:
            yield f"{spawn.where} ({spawn.name}) stands against the direction of its lane, {lane!r}"


def _beyond_map(spawns: Sequence[Spawn], roads: Roads) -> list[str]:
    """Return a line for each person or thing that stands outside of the map's roads, as if on another map."""
    points = roads.points[~find_far_lanes(roads)[roads.lane_of_point], :2]
    (west, south), (east, north) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    away = [math.hypot(max(west - at.x, at.x - east, 0.0), max(south - at.y, at.y - north, 0.0)) for at in spawns]
    return [
        f"{spawn.where} ({spawn.name}) stands {metres / 1000.0:,.1f} km outside of the map"
        for spawn, metres in zip(spawns, away, strict=True)
        if metres > BEYOND
    ]


def _far_from_path(spawn: Spawn) -> str | None:
    if spawn.path is None:
        return None
    away = abs(float(nearest_on_polyline(spawn.path, spawn.x, spawn.y).lateral[0]))
    if away <= FAR:
        return None
    return (
        f"{spawn.where} ({spawn.name}) stands {away:.1f} m off its path; waypoints have the axes (-east, up, -north), "
        "as in MORAI's engine"
    )


def _meeting(spawns: Sequence[Spawn]) -> tuple[list[tuple[Spawn, Spawn]], bool]:
    """Return pairs of entities whose boxes overlap, and whether they are all: a heap has millions."""
    if not spawns:
        return [], True
    bodies = [spawn.model.body for spawn in spawns]
    heading = np.exp(1j * np.array([spawn.yaw for spawn in spawns]))
    half = 0.5 * np.array([[body.length, body.width] for body in bodies])
    to_middle = half[:, 0] - np.array([body.rear_overhang for body in bodies])
    middle = np.array([complex(spawn.x, spawn.y) for spawn in spawns]) + to_middle * heading
    low = np.array([spawn.z for spawn in spawns])
    high = low + np.array([body.height for body in bodies])
    (one, other), is_all = _near(middle, heading, half)
    apart = middle[other] - middle[one]
    does_meet = do_boxes_meet(
        apart, apart, np.stack([heading[one], heading[other]]), np.stack([half[one], half[other]])
    )
    does_meet &= (low[one] < high[other]) & (low[other] < high[one])
    pairs = zip(one[does_meet].tolist(), other[does_meet].tolist(), strict=True)
    return [(spawns[first], spawns[second]) for first, second in pairs], is_all


def _near(middle: ComplexArray, heading: ComplexArray, half: FloatArray) -> tuple[IntArray, bool]:
    """Return (2, m) int64, pairs of boxes whose upright rectangles overlap, in rising order; and whether all."""
    num = len(middle)
    cos, sin = np.abs(heading.real), np.abs(heading.imag)
    span = np.stack([half[:, 0] * cos + half[:, 1] * sin, half[:, 0] * sin + half[:, 1] * cos])
    if num <= MAX_WIDE:
        return np.stack(np.triu_indices(num, 1)).astype(np.int64), True
    place = np.stack([middle.real, middle.imag])
    return find_near_pairs(place, span, np.ones(num, dtype=bool), np.zeros(num, dtype=bool))


def _short(lines: Sequence[str], *, is_all: bool = True) -> list[str]:
    num, least = len(lines) - MAX_ODDITIES, "" if is_all else "at least "
    return [*lines[:MAX_ODDITIES], *([f"... and {least}{num:,} more of that kind"] if num > 0 else [])]
