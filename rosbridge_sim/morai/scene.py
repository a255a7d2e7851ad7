"""The population of the world and its map: how a scenario gets into the world, and how single objects do.

A load is prepared first (map, links, options: all that can go wrong in a document) and carried out later, at once and
wholly: whoever finds it refused finds the world as it was. Frames go on counting, and so do the traffic lights unless
the scenario says where in their cycles they are or comes with another map.

What takes long is read first: `find_map` and `Library` touch nothing of the world, so another thread may call them.

Ids never repeat. A scenario's own ids (`UNIQUEID`) are kept where nobody can have had them before; the second load of
the same file gets new ones. The first ego is 0 always: a new car under the old name.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count
from typing import Final, Protocol

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.morai.catalogue import BUILT_IN, DEFAULT_EGO, Catalogue, Model
from rosbridge_sim.morai.command_parsing import GhostPose
from rosbridge_sim.morai.maps.mgeo import RoadMap
from rosbridge_sim.morai.releases import SpeedLimits
from rosbridge_sim.morai.scenarios.reader import PhaseStart, Scenario, Spawn, place_on_roads, sort_phases
from rosbridge_sim.world.lane_position import keep_lane
from rosbridge_sim.world.state import DT, Body, Gear, Kind, World

__all__ = [
    "DEFAULT_MAP",
    "FIRST_EGO",
    "FIRST_FREE_EGO",
    "FIRST_UID",
    "MAX_EGOS",
    "MAX_ENTITIES",
    "MAX_FILE_UID",
    "WHOLE",
    "FoundMap",
    "Library",
    "Load",
    "LoadOptions",
    "Scene",
    "find_map",
]

DEFAULT_MAP: Final = "track"
"""The built-in map of scenarios that name none."""

FIRST_EGO: Final = 0
"""The first ego's id."""

FIRST_UID: Final = 1
"""The first id of anybody else."""

MAX_FILE_UID: Final = 2**30
"""A document's ids are kept up to here, so that a single one cannot use up all there are."""

FIRST_FREE_EGO: Final = 2
"""The first number of a further ego: MORAI's egos are 0, 2, 3, ..., and no program has seen a 1."""

MAX_EGOS: Final = 32
"""Egos at once. Each has a dozen topics and services of its own."""

MAX_ENTITIES: Final = 20_000
"""What may stand in the world at once: twice what one step is made for."""

_AT_ORIGIN: Final = Spawn(Kind.EGO, DEFAULT_EGO, DEFAULT_EGO.name, FIRST_EGO, 0.0, 0.0, 0.0, 0.0)
"""The ego of an opening scenario that has none."""

_log = logging.getLogger("rosbridge_sim.morai")


class Library(Protocol):
    """Where scenarios and maps come from; the shell reads them from the disk.

    Its methods may be called from several threads at once. What they return is shared: it must not be changed.
    """

    def scenario(self, name: str) -> Scenario:
        """The scenario that a client names.

        Raises:
            DocumentError: there is none, or it cannot be used.
        """

    def map(self, name: str) -> RoadMap:
        """The map of that name.

        Raises:
            DocumentError: there is none, or it cannot be used.
        """


@dataclass(frozen=True, slots=True, eq=False)
class FoundMap:
    """A map under the name that a scenario asks for.

    Attributes:
        name: as the scenario has it.
        road_map: the map, which has a name of its own where one map stands in for all.
    """

    name: str
    road_map: RoadMap


def find_map(library: Library, name: str) -> FoundMap:
    """Return the map of that name.

    No other map takes its place, because a drive on other roads than the scenario's measures nothing.

    Raises:
        DocumentError: there is none, or it cannot be used.
    """
    return FoundMap(name, library.map(name))


@dataclass(frozen=True, slots=True)
class LoadOptions:
    """What of a scenario is loaded, and what goes before.

    Attributes:
        delete_all: everybody goes first; the egos only if a new one comes.
        ego, vehicles, pedestrians, obstacles: what comes.
    """

    delete_all: bool
    ego: bool
    vehicles: bool
    pedestrians: bool
    obstacles: bool


WHOLE: Final = LoadOptions(delete_all=True, ego=True, vehicles=True, pedestrians=True, obstacles=True)
"""A scenario as it is written."""


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """A prepared load: nothing in it can go wrong any more, but for a lack of room.

    Attributes:
        name: of the scenario.
        egos, others: what will be spawned.
        is_clearing: everybody else goes first.
        map_name: what the map was asked for as.
        road_map: the map that it is prepared for.
        phases: what its intersections are to be in; each is there and has that phase.
    """

    name: str
    egos: tuple[Spawn, ...]
    others: tuple[Spawn, ...]
    is_clearing: bool
    map_name: str
    road_map: RoadMap
    phases: tuple[PhaseStart, ...] = ()


class Scene:
    """The world's population and map.

    Attributes:
        world: written by `carry_out`, `add` and `remove`.
        road_map: the one in use.
        catalogue: the models that clients and recordings name.
        loaded: the scenario that the world has been made from: the opening one, or the last that removed all before it.
        is_replaying: a recording moves the world: no object is added or removed meanwhile.
    """

    def __init__(
        self,
        world: World,
        library: Library,
        scenario: Scenario,
        *,
        ego_gear: Gear,
        speed_limits: SpeedLimits | None = None,
        catalogue: Catalogue = BUILT_IN,
    ) -> None:
        """The opening scene.

        Args:
            world: empty.
            library: where maps come from.
            scenario: the opening scenario. Without an ego in it, one stands at the map's origin.
            ego_gear: the ego's, whatever the scenario says.
            speed_limits: of all egos; None for those of their models.
            catalogue: the models that clients and recordings name.

        Raises:
            DocumentError: the scenario does not fit its map, or the map cannot be used.
        """
        self.world = world
        self.is_replaying = False
        self.catalogue = catalogue
        self._library = library
        self._speed_limits = speed_limits
        self._next_uid = FIRST_UID
        self._map_name = scenario.map_name or DEFAULT_MAP
        self.road_map = _log_notes(find_map(library, self._map_name))
        opening = self.prepare(scenario, WHOLE)
        if not opening.egos:
            _log.info("scenario %s has no ego: one stands at the origin", scenario.name)
        egos = tuple([replace(ego, gear=ego_gear) for ego in opening.egos or (_AT_ORIGIN,)])
        self._opening = self.loaded = replace(opening, egos=egos)
        self.carry_out(self._opening)

    def reset(self, seed: int | None) -> None:
        """Begin anew: the opening scene on its own map, at frame 0, with ids from the first one on.

        Args:
            seed: of all chance; None for the one in use.
        """
        self.world.reset(seed)
        self._next_uid = FIRST_UID
        self.carry_out(self._opening)

    @property
    def found_map(self) -> FoundMap:
        """The map in use, under the name that it was asked for as."""
        return FoundMap(self._map_name, self.road_map)

    def prepare(
        self, scenario: Scenario, options: LoadOptions, *, own_map: FoundMap | None = None, base: FoundMap | None = None
    ) -> Load:
        """All that a load needs and that can go wrong.

        Args:
            scenario: what is to be loaded.
            options: what of it.
            own_map: the map that it names, if that was found already.
            base: the map that it stands on if it names none, or this one; None for the one in use.

        Raises:
            DocumentError: the scenario does not fit its map.
        """
        base = base or self.found_map
        map_name, road_map = base.name, base.road_map
        if scenario.map_name is not None and scenario.map_name != map_name:
            found = own_map or find_map(self._library, scenario.map_name)
            map_name, road_map = found.name, _log_notes(found)
        placed = place_on_roads(scenario, road_map.roads)
        for note in placed.notes:
            _log.info("scenario %s: %s", placed.name, note)
        others: tuple[Spawn, ...] = ()
        for is_wanted, spawns in (
            (options.vehicles, placed.vehicles),
            (options.pedestrians, placed.pedestrians),
            (options.obstacles, placed.obstacles),
        ):
            if is_wanted:
                others += spawns
        egos = placed.egos[:1] if options.ego else ()
        phases, strange = sort_phases(placed, road_map.plan)
        for line in strange:
            _log.info("scenario %s: %s", placed.name, line)
        return Load(scenario.name, egos, others, options.delete_all, map_name, road_map, phases)

    def carry_out(self, load: Load) -> None:
        """Do what was prepared: wholly or not at all.

        Raises:
            DocumentError: the world is too full. It is as it was.
        """
        world = self.world
        num_staying = 0 if load.is_clearing else len(world)
        if num_staying + len(load.others) + 1 > MAX_ENTITIES:
            raise DocumentError(f"{load.name}: the world holds {MAX_ENTITIES:,} at most")
        before = world.snapshot()
        try:
            next_uid = self._populate(load)
        except ValueError as error:
            world.restore(before)
            raise DocumentError(f"{load.name}: {error}") from error
        self._next_uid = next_uid
        if load.is_clearing:
            self.loaded = load
        self.road_map, self._map_name = load.road_map, load.map_name
        _log.info("scenario %s: %d egos, %d others loaded", load.name, len(load.egos), len(load.others))

    def add(self, model: Model, *, x: float, y: float, z: float, yaw: float) -> int:
        """Put a single object into the world, at rest, and return its id.

        Raises:
            FieldError: it stands beyond all bounds, or the world is full, or a recording is replayed.
        """
        self._check_free()
        if len(self.world) >= MAX_ENTITIES:
            raise FieldError(f"{model.name}: the world holds {MAX_ENTITIES:,} at most")
        try:
            uid = self.world.spawn(model.kind, model.body, name=model.name, x=x, y=y, z=z, yaw=yaw, uid=self._next_uid)
        except ValueError as error:
            raise FieldError(f"{model.name}: {error}") from None
        self._next_uid += 1
        return uid

    def add_as(self, uid: int, model: Model, *, x: float, y: float, z: float, yaw: float) -> None:
        """Put a single object into the world under an id that a client has chosen and that nobody has now.

        Raises:
            ValueError: the id or the place are beyond all bounds. The world is as it was.
        """
        self.world.spawn(model.kind, model.body, name=model.name, x=x, y=y, z=z, yaw=yaw, uid=uid)
        self._next_uid = max(self._next_uid, uid + 1)

    def add_actor(self, uid: int, kind: Kind, body: Body, name: str, *, x: float, y: float) -> int:
        """Put an actor of a recording into the world; return its id, another one than `uid` where that is taken.

        Raises:
            ValueError: the place is beyond all bounds. The world is as it was.
        """
        if uid in self.world or not FIRST_UID <= uid <= MAX_FILE_UID:
            uid = self._next_uid
        self.world.spawn(kind, body, name=name, x=x, y=y, uid=uid)
        self._next_uid = max(self._next_uid, uid + 1)
        return uid

    @contextmanager
    def all_or_none(self) -> Iterator[None]:
        """Return a context whose changes of the world are undone if it ends by an exception."""
        before, next_uid = self.world.snapshot(), self._next_uid
        try:
            yield
        except BaseException:
            self.world.restore(before)
            self._next_uid = next_uid
            raise

    def add_agent(self, spawn: Spawn) -> int:
        """Put an agent into the world that may move by itself; return its id.

        Args:
            spawn: placed; its own `uid` is not read.

        Raises:
            ValueError: the world refuses it. It may be there by half: see `all_or_none`.
        """
        uid = self._next_uid
        _spawn(self.world, spawn, uid, spawn.gear)
        self._next_uid += 1
        return uid

    def choose_ego_index(self, taken: Collection[int]) -> int:
        """Return the first number from 2 on that neither an ego nor an object has, and keep objects from getting it.

        Args:
            taken: numbers of egos.
        """
        index = next(number for number in count(FIRST_FREE_EGO) if number not in taken and number not in self.world)
        self.keep_free(index)
        return index

    def keep_free(self, number: int) -> None:
        """Have no later object get this number, which an ego has; `number` is up to `MAX_FILE_UID`."""
        if number >= self._next_uid:
            self._next_uid = number + 1

    def add_ego(self, like: int, pose: GhostPose, gear: Gear, model: Model | None = None) -> int:
        """Put a further ego into the world and return its id there.

        Args:
            like: id of the ego whose model it is to be.
            pose: where it stands.
            gear: the one it is in.
            model: another model, with an engine; None for that of `like`.
        """
        world = self.world
        row = world.row(like)
        body, name = world.bodies[row], world.names[row]
        if model is not None:
            body, name = _limit_speed_mode(model.body, self._speed_limits), model.name
        uid = world.spawn(
            Kind.EGO,
            body,
            name=name,
            x=pose.x,
            y=pose.y,
            z=pose.z,
            yaw=pose.yaw,
            uid=self._next_uid,
            gear=gear,
        )
        self._next_uid += 1
        return uid

    def remove(self, uid: int) -> None:
        """Take an object out of the world.

        Raises:
            FieldError: there is none with this id, or it is an ego, or a recording is replayed.
        """
        self._check_free()
        world = self.world
        if uid not in world:
            raise FieldError(f"unique_id {uid}: there is no such object")
        if world.kind[world.row(uid)] == Kind.EGO:
            raise FieldError(f"unique_id {uid}: the ego cannot be removed")
        world.remove(uid)

    def vehicle(self, unique_id: int) -> Body | None:
        """The figures of the vehicle that a client calls by this id (-1 is the first ego too), or None."""
        uid = FIRST_EGO if unique_id == -1 else unique_id
        if uid not in self.world:
            return None
        row = self.world.row(uid)
        return self.world.bodies[row] if self.world.kind[row] in {Kind.EGO, Kind.VEHICLE} else None

    def vehicle_ids(self) -> list[int]:
        """Return the ids of all vehicles that are no egos, in order of spawning."""
        world = self.world
        return [int(uid) for uid in world.uid[world.rows(Kind.VEHICLE)]]

    def _check_free(self) -> None:
        if self.is_replaying:
            raise FieldError("refused while a recording is replayed")

    def _populate(self, load: Load) -> int:
        """Remove and spawn; return the next id.

        Raises:
            ValueError: the world refuses somebody. Half of it is done.
        """
        world = self.world
        if load.egos and load.is_clearing:
            world.clear()
        for uid in [int(world.uid[row]) for row in world.placed()]:
            is_ego = world.kind[world.row(uid)] == Kind.EGO
            if (uid == FIRST_EGO and load.egos) if is_ego else load.is_clearing:
                world.remove(uid)
        roads = load.road_map.roads
        if world.roads is not roads:
            world.lay_roads(roads, load.road_map.plan)
        for start in load.phases:
            _set_phase(world, start)
        for ego in load.egos:
            _spawn(world, _hold_back(ego, self._speed_limits), FIRST_EGO, ego.gear)
        uids, next_uid = _choose_uids(load.others, self._next_uid)
        for spawn, uid in zip(load.others, uids, strict=True):
            _spawn(world, spawn, uid, spawn.gear)
        return next_uid


def _log_notes(found: FoundMap) -> RoadMap:
    """The map itself, after the log was told what is to be known of it."""
    for note in found.road_map.notes:
        _log.info("map %s: %s", found.road_map.name, note)
    return found.road_map


def _set_phase(world: World, start: PhaseStart) -> None:
    """Put an intersection into a phase; one that would be over by then is at its end."""
    signals = world.signals
    names = [controller.name for controller in signals.plan.controllers]
    controller = names.index(start.controller)
    last = signals.phase_length(controller, start.phase) - 1
    signals.set_phase(controller, start.phase, min(round(start.elapsed / DT), last))


def _hold_back(ego: Spawn, limits: SpeedLimits | None) -> Spawn:
    """The ego with these limits of its speed mode."""
    return replace(ego, model=replace(ego.model, body=_limit_speed_mode(ego.model.body, limits)))


def _limit_speed_mode(body: Body, limits: SpeedLimits | None) -> Body:
    """Return a body with these limits of its speed mode; None leaves its own."""
    if limits is None:
        return body
    up, down = limits
    return replace(body, speed_mode_accel=up, speed_mode_decel=down)


def _choose_uids(spawns: Sequence[Spawn], first: int) -> tuple[list[int], int]:
    """An id for each, its own where nobody can have had it, and the next one after all of them."""
    own = [spawn.uid if spawn.uid is not None and first <= spawn.uid <= MAX_FILE_UID else None for spawn in spawns]
    following = max([first - 1, *(uid for uid in own if uid is not None)]) + 1
    uids = []
    for uid in own:
        if uid is None:
            uid, following = following, following + 1  # noqa: PLW2901 - the id that it gets instead
        uids.append(uid)
    return uids, following


def _spawn(world: World, spawn: Spawn, uid: int, gear: Gear) -> None:
    world.spawn(
        spawn.kind,
        spawn.model.body,
        name=spawn.name,
        x=spawn.x,
        y=spawn.y,
        z=spawn.z,
        yaw=spawn.yaw,
        speed=spawn.speed,
        uid=uid,
        path=spawn.path,
        is_loop=spawn.is_loop,
        gear=gear,
        roll=spawn.roll,
        pitch=spawn.pitch,
        start_within=spawn.start_within,
    )
    driver = spawn.driver
    if driver is not None:
        keep_lane(
            world,
            world.row(uid),
            driver.lane,
            driver.s,
            desired_speed=driver.desired_speed,
            route=driver.route,
            is_loop=spawn.is_loop and len(driver.route) > 0,
        )
