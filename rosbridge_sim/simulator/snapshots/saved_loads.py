"""Prepared loads and waiting commands as plain data and back.

A load is saved whole and not by the name of its scenario: the file may have another content later, or another place,
and a restored simulator must do the same as the saved one. Its map is saved by name and digest. A load is large and
never changes, so its bytes are made once and kept with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from hashlib import blake2b
from typing import Any, Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.openscenario.story_records import Story, StoryText
from rosbridge_sim.scenarios.scenario import PhaseStart, Spawn
from rosbridge_sim.scenarios.spawn_points import SpawnPoint
from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice, InterfaceKind, NetworkSettings, read_choices
from rosbridge_sim.simulator.plain.plain_bytes import PlainData, decode
from rosbridge_sim.simulator.plain.typed_plain import as_plain, check_finite, read_as
from rosbridge_sim.simulator.scene.load import Load, MapKey, PackedLoad
from rosbridge_sim.simulator.scene.scene_commands import (
    AddObject,
    ControlEgo,
    LoadScenario,
    RemoveObject,
    SceneAction,
    ShiftEgo,
)
from rosbridge_sim.simulator.snapshots.snapshot_checks import check_load

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


Maps = Callable[[MapKey], RoadMap]
"""Returns a map; raises DocumentError where it is not at hand."""


def unpack_load(data: object, maps: Maps, known: Iterable[Load] = ()) -> Load:
    """Return the load whose `packed` was given; a known one is not read again.

    Args:
        data: the fields of a `PackedLoad`; from anywhere.
        known: loads that it may be.

    Raises:
        DocumentError: they are no load, or the map is not at hand.
    """
    packed = PackedLoad(*read_as(tuple[bytes, bytes], data, "load"))
    for load in known:
        if load.packed == packed and maps(load.map_key) is load.road_map:
            return load
    if blake2b(packed.data, digest_size=16).digest() != packed.digest:
        raise DocumentError("load: the digest is that of another one")
    fields = read_as(dict[str, Any], decode(packed.data, max_values=MAX_VALUES), "load")
    name, is_clearing = read_as(tuple[str, bool], (fields.get("name"), fields.get("is_clearing")), "load")
    key = MapKey(*read_as(tuple[str, bytes], fields.get("map"), "load.map"))
    egos, others = (read_as(tuple[Spawn, ...], fields.get(part), f"load.{part}") for part in ("egos", "others"))
    phases = read_as(tuple[PhaseStart, ...], fields.get("phases"), "load.phases")
    points = read_as(tuple[SpawnPoint, ...], fields.get("spawn_points"), "load.spawn_points")
    story = _unpack_story(fields["story"]) if "story" in fields else None
    load = Load(name, egos, others, is_clearing, key.name, maps(key), phases, points, story)
    check_load(load)
    return load


def _unpack_story(data: object) -> Story:
    from rosbridge_sim.scenarios.events import read_saved_story  # noqa: PLC0415 - few scenes have a story

    return read_saved_story(read_as(StoryText, data, "load.story"))


def pack_action(action: SceneAction) -> PlainData:
    """Return what a waiting command does as plain data."""
    if isinstance(action, LoadScenario):
        network = None if action.network is None else _plain_network(action.network)
        return (_LOAD, tuple(action.load.packed), network, action.is_pausing)
    return (_KIND_OF[type(action)], as_plain(action))


def unpack_action(data: object, maps: Maps, known: Iterable[Load] = ()) -> SceneAction:
    """Return the action that `pack_action` was given.

    Args:
        data: from anywhere.
        known: loads that it may have.

    Raises:
        DocumentError: it is no such data.
    """
    parts = read_as(tuple[Any, ...], data, "command")
    if len(parts) == 4 and parts[0] == _LOAD:  # noqa: PLR2004 - as `pack_action` writes it
        network = None if parts[2] is None else _read_network(parts[2])
        return LoadScenario(unpack_load(parts[1], maps, known), network, read_as(bool, parts[3], "command.is_pausing"))
    kind = _PLAIN_ACTIONS.get(parts[0]) if len(parts) == 2 and isinstance(parts[0], str) else None  # noqa: PLR2004
    if kind is None:
        raise DocumentError("command: expected a kind and its fields")
    action = read_as(kind, parts[1], "command")
    check_finite(parts[1], "command")
    return action


def _plain_network(settings: NetworkSettings) -> PlainData:
    """Return network settings as the tables of a file."""

    def plain(choice: InterfaceChoice) -> PlainData:
        values = {"name": choice.name, "on": choice.is_on, "rate": choice.rate}
        return {key: value for key, value in values.items() if value is not None}

    tables = ((kind.value, settings.choices(kind)) for kind in InterfaceKind)
    return {name: {default: plain(choice) for default, choice in choices.items()} for name, choices in tables}


def _read_network(data: object) -> NetworkSettings:
    tables = read_as(dict[str, Any], data, "command.network")
    return NetworkSettings(**{kind.value: read_choices(kind, tables.get(kind.value)) for kind in InterfaceKind})
