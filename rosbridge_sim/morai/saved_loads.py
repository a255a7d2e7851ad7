"""Prepared loads and waiting commands as plain data and back.

A load is saved whole and not by the name of its scenario: the file may have another content later, or another place,
and a restored simulator must do the same as the saved one. Its map is saved by name and digest. A load is large and
never changes, so its bytes are made once and kept for the last few.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from hashlib import blake2b
from typing import Any, Final, NamedTuple

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.interfaces.network_settings import InterfaceKind, NetworkSettings, read_choices
from rosbridge_sim.morai.maps.mgeo import RoadMap
from rosbridge_sim.morai.plain_bytes import PlainData, decode, encode
from rosbridge_sim.morai.scenarios.reader import PhaseStart, Spawn
from rosbridge_sim.morai.scenarios.spawn_points import MAX_AT_ONCE, SpawnPoint
from rosbridge_sim.morai.scene import Load
from rosbridge_sim.morai.scene_commands import (
    AddObject,
    ControlEgo,
    LoadScenario,
    RemoveObject,
    SceneAction,
    ShiftEgo,
)
from rosbridge_sim.morai.typed_plain import as_plain, check_finite, read_as
from rosbridge_sim.world.entity_types import MAX_COORDINATE
from rosbridge_sim.world.lane_position import MAX_LATERAL

__all__ = [
    "MapKey",
    "Maps",
    "PackedLoad",
    "digest_map",
    "key_of_map",
    "pack_action",
    "pack_load",
    "unpack_action",
    "unpack_load",
]

MAX_KEPT: Final = 8
"""Loads and maps whose bytes or digests are kept: a client that branches goes to and fro between a few."""

MAX_VALUES: Final = 3_000_000
"""Values in a prepared load: 20,000 objects have some 95 each, and the points of 200,000 pieces of paths 4 each."""

_PLAIN_ACTIONS: Final[dict[str, type[ControlEgo | ShiftEgo | AddObject | RemoveObject]]] = {
    "control": ControlEgo,
    "shift": ShiftEgo,
    "add": AddObject,
    "remove": RemoveObject,
}
_KIND_OF: Final = {action: kind for kind, action in _PLAIN_ACTIONS.items()}
_LOAD: Final = "load"


class MapKey(NamedTuple):
    """A map as snapshots name it.

    Attributes:
        name: that it was asked for as.
        digest: of its lanes, lights and projection.
    """

    name: str
    digest: bytes


Maps = Callable[[MapKey], RoadMap]
"""Returns a map; raises DocumentError where it is not at hand."""


class PackedLoad(NamedTuple):
    """A load as bytes.

    Attributes:
        data: all of it but the map.
        digest: of these bytes.
    """

    data: bytes
    digest: bytes


_unpacked: dict[bytes, Load] = {}
"""Loads by digest, the last ones: each is the same value for ever, so they may be shared."""


@lru_cache(maxsize=MAX_KEPT)
def digest_map(road_map: RoadMap) -> bytes:
    """Return 16 bytes that stand for all of a map that decides what a simulator does."""
    state = blake2b(repr((road_map.name, road_map.projection, road_map.origin)).encode(), digest_size=16)
    state.update(road_map.roads.digest)
    if road_map.plan is not None:
        state.update(road_map.plan.digest)
    return state.digest()


@lru_cache(maxsize=MAX_KEPT)
def pack_load(load: Load) -> PackedLoad:
    """Return a load as bytes."""
    data = encode(
        {
            "name": load.name,
            "egos": [as_plain(replace(spawn, kept={})) for spawn in load.egos],
            "others": [as_plain(replace(spawn, kept={})) for spawn in load.others],
            "is_clearing": load.is_clearing,
            "map": tuple(MapKey(load.map_name, digest_map(load.road_map))),
            "phases": [as_plain(start) for start in load.phases],
            "spawn_points": [as_plain(point) for point in load.spawn_points],
        }
    )
    packed = PackedLoad(data, blake2b(data, digest_size=16).digest())
    _remember(packed.digest, load)
    return packed


def key_of_map(name: str, road_map: RoadMap) -> MapKey:
    """Return how snapshots name a map."""
    return MapKey(name, digest_map(road_map))


def unpack_load(data: object, maps: Maps) -> Load:
    """Return the load that `pack_load` was given; one of the last few is not read again.

    Args:
        data: the fields of a `PackedLoad`; from anywhere.
        maps: gives its map.

    Raises:
        DocumentError: they are no load, or the map is not at hand.
    """
    packed = PackedLoad(*read_as(tuple[bytes, bytes], data, "load"))
    known = _unpacked.get(packed.digest)
    is_known = known is not None and pack_load(known).data == packed.data
    if known is not None and is_known and maps(key_of_map(known.map_name, known.road_map)) is known.road_map:
        return known
    if blake2b(packed.data, digest_size=16).digest() != packed.digest:
        raise DocumentError("load: the digest is that of another one")
    fields = read_as(dict[str, Any], decode(packed.data, max_values=MAX_VALUES), "load")
    name, is_clearing = read_as(tuple[str, bool], (fields.get("name"), fields.get("is_clearing")), "load")
    key = MapKey(*read_as(tuple[str, bytes], fields.get("map"), "load.map"))
    egos, others = (read_as(tuple[Spawn, ...], fields.get(part), f"load.{part}") for part in ("egos", "others"))
    phases = read_as(tuple[PhaseStart, ...], fields.get("phases"), "load.phases")
    points = read_as(tuple[SpawnPoint, ...], fields.get("spawn_points"), "load.spawn_points")
    load = Load(name, egos, others, is_clearing, key.name, maps(key), phases, points)
    _check(load)
    _remember(packed.digest, load)
    return load


def pack_action(action: SceneAction) -> PlainData:
    """Return what a waiting command does as plain data."""
    if isinstance(action, LoadScenario):
        network = None if action.network is None else _plain_network(action.network)
        return (_LOAD, tuple(pack_load(action.load)), network, action.is_pausing)
    return (_KIND_OF[type(action)], as_plain(action))


def unpack_action(data: object, maps: Maps) -> SceneAction:
    """Return the action that `pack_action` was given.

    Args:
        data: from anywhere.
        maps: gives the maps of loads.

    Raises:
        DocumentError: it is no such data.
    """
    parts = read_as(tuple[Any, ...], data, "command")
    if len(parts) == 4 and parts[0] == _LOAD:  # noqa: PLR2004 - as `pack_action` writes it
        network = None if parts[2] is None else _read_network(parts[2])
        return LoadScenario(unpack_load(parts[1], maps), network, read_as(bool, parts[3], "command.is_pausing"))
    kind = _PLAIN_ACTIONS.get(parts[0]) if len(parts) == 2 and isinstance(parts[0], str) else None  # noqa: PLR2004
    if kind is None:
        raise DocumentError("command: expected a kind and its fields")
    action = read_as(kind, parts[1], "command")
    check_finite(parts[1], "command")
    return action


def _remember(digest: bytes, load: Load) -> None:
    """Keep a load with those that were packed or read last."""
    _unpacked.pop(digest, None)
    _unpacked[digest] = load
    if len(_unpacked) > MAX_KEPT:
        del _unpacked[next(iter(_unpacked))]


def _plain_network(settings: NetworkSettings) -> PlainData:
    """Return network settings as the tables of a file."""
    return {
        kind.value: {
            default: {
                key: value
                for key, value in (("name", choice.name), ("on", choice.is_on), ("rate", choice.rate))
                if value is not None
            }
            for default, choice in settings.choices(kind).items()
        }
        for kind in InterfaceKind
    }


def _read_network(data: object) -> NetworkSettings:
    tables = read_as(dict[str, Any], data, "command.network")
    return NetworkSettings(**{kind.value: read_choices(kind, tables.get(kind.value)) for kind in InterfaceKind})


def _check(load: Load) -> None:
    """Check what `Scene.carry_out` relies on, because `Scene.prepare` has checked it.

    Raises:
        DocumentError: a place or a phase that the map does not have.
    """
    roads, plan = load.road_map.roads, load.road_map.plan
    for spawn in (*load.egos, *load.others):
        driver = spawn.driver
        if driver is not None and not (
            all(0 <= lane < len(roads) for lane in (driver.lane, *driver.route))
            and 0.0 <= driver.s <= roads.length[driver.lane]
            and driver.desired_speed >= 0.0
            and abs(driver.lateral) <= MAX_LATERAL
        ):
            raise DocumentError("load.driver: expected lanes of the map")
        if not spawn.is_placed or spawn.link is not None:
            raise DocumentError("load.is_placed: expected places")
    for point in load.spawn_points:
        if not (
            0 <= point.lane < len(roads)
            and -1 <= point.goal_lane < len(roads)
            and 0.0 <= point.s <= roads.length[point.lane]
            and point.models
            and 0 <= point.num <= MAX_AT_ONCE
            and all(0.0 <= low <= high for low, high in (point.period, point.speed, point.desired_speed))
            and point.period[1] <= MAX_COORDINATE
            and -1.0 <= point.wait <= MAX_COORDINATE
            and point.gap >= 0.0
            and point.time >= 0.0
            and -MAX_LATERAL <= point.lateral[0] <= point.lateral[1] <= MAX_LATERAL
        ):
            raise DocumentError("load.spawn_points: expected places and times within their bounds")
    phases: dict[str, int] = {}
    if plan is not None:
        phases = {one.name: int(num) for one, num in zip(plan.controllers, plan.num_phases, strict=True)}
    for start in load.phases:
        if not (0 <= start.phase < phases.get(start.controller, 0) and 0.0 <= start.elapsed <= MAX_COORDINATE):
            raise DocumentError("load.phases: expected phases of the map's intersections")
