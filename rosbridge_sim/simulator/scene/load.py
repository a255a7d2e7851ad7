"""Prepared loads of scenarios, and the library that scenarios and maps come from.

A load is prepared outside of the world, where all mistakes of a document are found, and carried out in one piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Final, NamedTuple, Protocol

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.openscenario.story_records import Story
from rosbridge_sim.scenarios.scenario import PhaseStart, Scenario, Spawn
from rosbridge_sim.scenarios.spawn_points import SpawnPoint
from rosbridge_sim.simulator.plain.plain_bytes import encode
from rosbridge_sim.simulator.plain.typed_plain import as_plain
from rosbridge_sim.world.roads.signal_plan import SignalPlan


class Library(Protocol):
    """Source of scenarios and maps; the shell reads them from the disk.

    Its methods may be called from several threads at once. Their results are shared, so they must not be changed.
    """

    def scenario(self, name: str) -> Scenario:
        """Return a scenario.

        Args:
            name: as a client or a setting gives it.

        Raises:
            DocumentError: it does not exist, or it cannot be used.
        """

    def map(self, name: str) -> RoadMap:
        """Return a map.

        Raises:
            DocumentError: it does not exist, or it cannot be used.
        """


class FoundMap(Record, eq=False):
    """A map with the name that a scenario gives it.

    Attributes:
        name: in the scenario.
        road_map: the map. Its own name may differ, where one map replaces all others.
    """

    name: str
    road_map: RoadMap

    @property
    def key(self) -> MapKey:
        """Name and digest of the map in snapshots."""
        return MapKey(self.name, self.road_map.digest)


def find_map(library: Library, name: str) -> FoundMap:
    """Return a map. No other map replaces a missing one, because a drive on other roads is not the scenario's drive.

    Raises:
        DocumentError: it does not exist, or it cannot be used.
    """
    return FoundMap(name, library.map(name))


class LoadOptions(Record):
    """Parts of a scenario to load, and entities to remove first.

    Attributes:
        delete_all: first remove all entities; the egos only if the scenario's ego is loaded.
        ego, vehicles, pedestrians, obstacles: parts to load.
    """

    delete_all: bool
    ego: bool
    vehicles: bool
    pedestrians: bool
    obstacles: bool


WHOLE: Final = LoadOptions(delete_all=True, ego=True, vehicles=True, pedestrians=True, obstacles=True)
"""A whole scenario that replaces the current scene."""


class MapKey(NamedTuple):
    """A map as snapshots name it.

    Attributes:
        name: that it was asked for as.
        digest: of its lanes, lights and projection.
    """

    name: str
    digest: bytes


class PackedLoad(NamedTuple):
    """A load as bytes.

    Attributes:
        data: all of it but the map.
        digest: of these bytes.
    """

    data: bytes
    digest: bytes


@dataclass(frozen=True, eq=False)  # without slots, because its bytes are kept
class Load:
    """A prepared load. Carrying it out can fail only if the world is full.

    Attributes:
        name: of the scenario.
        egos, others: entities to add.
        is_clearing: remove all other entities first.
        map_name: the map's name in the scenario.
        road_map: the map that it is prepared for.
        phases: phases to set; each intersection exists and has that phase.
        spawn_points: places where vehicles appear from then on.
        story: triggers and actions; None for none.
    """

    name: str
    egos: tuple[Spawn, ...]
    others: tuple[Spawn, ...]
    is_clearing: bool
    map_name: str
    road_map: RoadMap
    phases: tuple[PhaseStart, ...] = ()
    spawn_points: tuple[SpawnPoint, ...] = ()
    story: Story | None = None

    @property
    def map_key(self) -> MapKey:
        """Name and digest of its map in snapshots."""
        return MapKey(self.map_name, self.road_map.digest)

    @cached_property
    def plan(self) -> SignalPlan:
        """The traffic lights: those of the map, with the controllers of the story.

        Raises:
            DocumentError: the map has no light that the story controls.
        """
        if self.story is None:
            return self.road_map.plan
        from rosbridge_sim.scenarios.openscenario.story_signals import make_signal_plan  # noqa: PLC0415 - few scenes have a story

        return make_signal_plan(self.story.controllers, self.road_map)

    def is_on(self, road_map: RoadMap) -> bool:
        """Return True if its places on lanes are places of this map, too: it has the same lanes."""
        own = self.road_map.roads
        return own is road_map.roads or own.digest == road_map.roads.digest

    @cached_property
    def packed(self) -> PackedLoad:
        """All of it as bytes, but the map: `saved_loads.unpack_load` reads them."""
        data = encode(
            {
                "name": self.name,
                "egos": [as_plain(replace(spawn, kept={})) for spawn in self.egos],
                "others": [as_plain(replace(spawn, kept={})) for spawn in self.others],
                "is_clearing": self.is_clearing,
                "map": tuple(self.map_key),
                "phases": [as_plain(start) for start in self.phases],
                "spawn_points": [as_plain(point) for point in self.spawn_points],
                **({} if self.story is None else {"story": as_plain(self.story.text)}),
            }
        )
        return PackedLoad(data, blake2b(data, digest_size=16).digest())
