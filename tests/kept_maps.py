"""Maps that are read once for many programs: those of the scenes that most tests open with."""

from __future__ import annotations

from collections.abc import Mapping

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.maps.map_formats import read_map
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.assembly import make_simulator_node
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files import library
from rosbridge_sim.shell.files.definitions import read_definitions

__all__ = ["keep_maps"]

SCENES = ("demo", "town")
"""The first is the one without a flag."""


def keep_maps() -> None:
    """Read the maps; simulators of this process and of its forks find them where they would read the same bytes.

    A map never changes, and neither does what is computed of its roads when a scene begins.
    """
    kept: dict[object, RoadMap] = {}

    def keep(files: Mapping[str, bytes], source: str) -> RoadMap:
        kept[_key(files, source)] = road_map = read_map(files, source)
        return road_map

    def find(files: Mapping[str, bytes], source: str) -> RoadMap:
        return kept.get(_key(files, source)) or read_map(files, source)

    vars(library)["read_map"] = keep
    for name in SCENES:
        settings = Settings(scenario=name, start="sync")
        make_simulator_node(Bus(Store(read_definitions(settings.release))), settings, None, None)
    vars(library)["read_map"] = find


def _key(files: Mapping[str, bytes], source: str) -> object:
    return source, *sorted(files.items())
