"""The population of the world and its map: loading scenarios, and adding and removing single objects.

A load is first prepared (map, links, options: everything in a document that may be wrong) and later carried out, in one
piece. If it is refused, the world is unchanged. Frames go on counting. So do the traffic lights, unless the scenario
sets their phases or has another map.

The slow reading is done before: `find_map` and `Library` do not touch the world, so another thread may call them.

Ids never repeat. A scenario's own ids (`UNIQUEID`) are kept if they cannot have been used before; a second load of the
same file gets new ids. The first ego always has the id 0, also when it is a new car.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.morai.messages.command_parsing import GhostPose
from rosbridge_sim.morai.releases import SpeedLimits
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import BUILT_IN, DEFAULT_EGO, Catalogue, Model
from rosbridge_sim.scenarios.openscenario.story_records import Story
from rosbridge_sim.scenarios.scenario import Driver, PhaseStart, Scenario, Spawn
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, sort_phases
from rosbridge_sim.simulator.scene.load import WHOLE, FoundMap, Library, Load, LoadOptions, find_map
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, FIRST_FREE_EGO, FIRST_UID, MAX_ENTITIES, MAX_FILE_UID
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.commands import speed_in_gear
from rosbridge_sim.world.state.world import DT, Body, Gear, Kind, Snapshot, World

DEFAULT_MAP: Final = "track"
"""The built-in map for scenarios that name none."""


_AT_ORIGIN: Final = Spawn(Kind.EGO, DEFAULT_EGO, DEFAULT_EGO.name, FIRST_EGO, 0.0, 0.0, 0.0, 0.0)
"""The ego for an opening scenario without one."""

_log = logging.getLogger("rosbridge_sim.morai")


class Scene:
    """The world's population and map.

    Attributes:
        world: written by `carry_out`, `add` and `remove`.
        road_map: the map in use.
        catalogue: the models that clients and recordings name.
        loaded: the load that made the current scene: the opening one, or the last one that removed all before it.
        is_replaying: a recording moves the world, so no object may be added or removed.
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
        """Load the opening scene.

        Args:
            world: empty.
            scenario: the opening scenario. If it has no ego, one is placed at the map's origin.
            ego_gear: of the ego, whatever the scenario says.
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
        self.next_uid = FIRST_UID
        self._map_name = scenario.map_name or DEFAULT_MAP
        self.road_map = _log_notes(find_map(library, self._map_name))
        opening = self.prepare(scenario, WHOLE)
        if not opening.egos:
            _log.info("scenario %s has no ego: one stands at the origin", scenario.name)
        egos = tuple([replace(ego, gear=ego_gear) for ego in opening.egos or (_AT_ORIGIN,)])
        self._opening = self.loaded = replace(opening, egos=egos)
        self.carry_out(self._opening)
        self._note_begin()

    def reset(self, seed: int | None) -> None:
        """Load the opening scene again, on its own map, at frame 0, with ids from the first one on.

        Args:
            seed: random seed; None keeps the current one.
        """
        world, begin = self.world, self._begin
        if (world.seed if seed is None else seed) == begin.seed:
            # Spawning costs ten times as much, and programs reset thousands of times.
            self.restore(begin, loaded=self._opening, found=self._begin_map, next_uid=self._begin_uid)
            return
        world.reset(seed)
        self.next_uid = FIRST_UID
        self.carry_out(self._opening)
        self._note_begin()

    def restore(self, world: Snapshot, *, loaded: Load, found: FoundMap, next_uid: int) -> None:
        """Become what was saved.

        Args:
            world: on the roads of `found`.
            next_uid: see `next_uid`.
        """
        self.world.restore(world)
        self.loaded = loaded
        self.road_map, self._map_name = found.road_map, found.name
        self.next_uid = next_uid
        self.is_replaying = False

    def _note_begin(self) -> None:
        """Keep the scene as the one that a reset leads to."""
        self._begin, self._begin_map, self._begin_uid = self.world.snapshot(), self.found_map, self.next_uid

    @property
    def found_map(self) -> FoundMap:
        """The map in use, with the name that the scenario gave it."""
        return FoundMap(self._map_name, self.road_map)

    def prepare(
        self, scenario: Scenario, options: LoadOptions, *, own_map: FoundMap | None = None, base: FoundMap | None = None
    ) -> Load:
        """Prepare a load: check everything that may be wrong.

        Args:
            own_map: the map that it names, if it was read already.
            base: the map to use if the scenario names none, or names this one; None for the map in use.

        Returns:
            The load, for `carry_out`.

        Raises:
            DocumentError: the scenario does not fit its map.
        """
        base = base or self.found_map
        map_name, road_map = base.name, base.road_map
        if scenario.map_name is not None and scenario.map_name != map_name:
            found = own_map or find_map(self._library, scenario.map_name)
            map_name, road_map = found.name, _log_notes(found)
        if scenario.story is not None:
            if options != WHOLE:
                raise DocumentError(
                    f"{scenario.name}: a story is loaded whole: expected delete_all and all load_... true"
                )
            scenario = _place_story(scenario, scenario.story, road_map)
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
        points = placed.spawn_points if options.vehicles else ()
        if points and not options.delete_all:
            _log.info("scenario %s: its spawn points are left out, because the load does not remove all", placed.name)
            points = ()
        name = scenario.name
        load = Load(name, egos, others, options.delete_all, map_name, road_map, phases, points, scenario.story)
        if scenario.story is not None:
            assert load.plan is not None  # its mistakes are told before anything moves
        return load

    def carry_out(self, load: Load) -> None:
        """Carry out a prepared load, completely or not at all.

        Args:
            load: from `prepare`.

        Raises:
            DocumentError: the world would be too full. It is unchanged.
        """
        world = self.world
        num_staying = 0 if load.is_clearing else len(world)
        if num_staying + len(load.others) + 1 > MAX_ENTITIES:
            raise DocumentError(f"{load.name}: the world holds {MAX_ENTITIES:,} at most")
        before = world.snapshot()
        try:
            is_same = not load.is_clearing and load.road_map is self.road_map  # a story keeps its controllers of lights
            plan = world.signals.plan if is_same else load.plan
            next_uid = populate(world, load, plan, self.next_uid, self._speed_limits)
        except ValueError as error:
            world.restore(before)
            raise DocumentError(f"{load.name}: {error}") from error
        self.next_uid = next_uid
        if load.is_clearing:
            self.loaded = load
        elif self.loaded.spawn_points and not self.loaded.is_on(load.road_map):
            _log.info("scenario %s: its spawn points end, because the map is another one", self.loaded.name)
            self.loaded = replace(self.loaded, spawn_points=())
        self.road_map, self._map_name = load.road_map, load.map_name
        _log.info("scenario %s: %d egos, %d others loaded", load.name, len(load.egos), len(load.others))

    def add(self, model: Model, *, x: float, y: float, z: float, yaw: float) -> int:
        """Add an object to the world, at rest.

        Args:
            x: east [m].
            y: north [m].
            z: up [m].
            yaw: counter-clockwise from east [rad].

        Raises:
            FieldError: the pose is out of range, the world is full, or a recording is replayed.
        """
        self._check_free()
        if len(self.world) >= MAX_ENTITIES:
            raise FieldError(f"{model.name}: the world holds {MAX_ENTITIES:,} at most")
        try:
            uid = self.world.spawn(model.kind, model.body, name=model.name, x=x, y=y, z=z, yaw=yaw, uid=self.next_uid)
        except ValueError as error:
            raise FieldError(f"{model.name}: {error}") from None
        self.next_uid += 1
        return uid

    def add_all(self, uids: Sequence[int], models: Sequence[Model]) -> None:
        """Add vehicles to the world under ids that a client has chosen. They must be placed before the next frame.

        Args:
            uids: (m) the ids, none of them in use.
            models: (m) their models.

        Raises:
            ValueError: an id is out of range. The world is unchanged.
        """
        self._spawn_all(models, uids, None)
        self.next_uid = max(self.next_uid, max(uids, default=-1) + 1)

    def add_vehicles(self, models: Sequence[Model], speed: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Add vehicles to the world at the origin; return their rows, (m,) int64.

        Args:
            speed: (m,) their speeds [m/s].

        Raises:
            ValueError: no ids are left, or a speed is out of range. The world is unchanged.
        """
        uids = range(self.next_uid, self.next_uid + len(models))
        rows = self._spawn_all(models, uids, speed)
        self.next_uid += len(models)
        return rows

    def _spawn_all(
        self, models: Sequence[Model], uids: Sequence[int], speed: npt.NDArray[np.float64] | None
    ) -> npt.NDArray[np.int64]:
        names, bodies = [model.name for model in models], [model.body for model in models]
        return self.world.spawn_all(Kind.VEHICLE, names, bodies, uids, speed=speed)

    def add_actor(self, uid: int, kind: Kind, body: Body, name: str, *, x: float, y: float) -> int:
        """Add an object of a recording to the world.

        Args:
            kind: VEHICLE, PEDESTRIAN or OBSTACLE.
            x: east [m].
            y: north [m].

        Returns:
            Its id; not `uid` if that is in use.

        Raises:
            ValueError: the position is out of range. The world is unchanged.
        """
        if uid in self.world or not FIRST_UID <= uid <= MAX_FILE_UID:
            uid = self.next_uid
        self.world.spawn(kind, body, name=name, x=x, y=y, uid=uid)
        self.next_uid = max(self.next_uid, uid + 1)
        return uid

    @contextmanager
    def all_or_none(self) -> Iterator[None]:
        """Return a context whose changes of the world are undone if it ends by an exception."""
        before, next_uid = self.world.snapshot(), self.next_uid
        try:
            yield
        except BaseException:
            self.world.restore(before)
            self.next_uid = next_uid
            raise

    def add_agent(self, spawn: Spawn) -> int:
        """Put an agent into the world that may move by itself; return its id.

        Args:
            spawn: placed; its own `uid` is not read.

        Raises:
            ValueError: the world refuses it. It may be there by half: see `all_or_none`.
        """
        uid = self.next_uid
        _spawn(self.world, spawn, uid, spawn.gear)
        self.next_uid += 1
        return uid

    def choose_ego_index(self, taken: Collection[int]) -> int:
        """Return the first number from 2 on that neither an ego nor an object has, and keep objects from getting it."""
        index = next(number for number in count(FIRST_FREE_EGO) if number not in taken and number not in self.world)
        self.keep_free(index)
        return index

    def keep_free(self, number: int) -> None:
        """Have no later object get this number, which an ego has; `number` is up to `MAX_FILE_UID`."""
        if number >= self.next_uid:
            self.next_uid = number + 1

    def add_ego(self, like: int, pose: GhostPose, gear: Gear, model: Model | None = None) -> int:
        """Add a further ego to the world.

        Args:
            like: id of the ego that has the same model.
            model: another model, with an engine; None for that of `like`.

        Returns:
            Its id in the world.
        """
        world = self.world
        row = world.row(like)
        body, name = world.bodies[row], world.names[row]
        if model is not None:
            body, name = _limit_speed_mode(model.body, self._speed_limits), model.name
        uid = world.spawn(
            Kind.EGO, body, name=name, x=pose.x, y=pose.y, z=pose.z, yaw=pose.yaw, uid=self.next_uid, gear=gear
        )
        self.next_uid += 1
        return uid

    def remove(self, uid: int) -> None:
        """Remove an object from the world.

        Raises:
            FieldError: there is no such object, it is an ego, or a recording is replayed.
        """
        self._check_free()
        world = self.world
        if uid not in world:
            raise FieldError(f"unique_id {uid}: there is no such object")
        if world.kind[world.row(uid)] == Kind.EGO:
            raise FieldError(f"unique_id {uid}: the ego cannot be removed")
        world.remove(uid)

    def vehicle(self, unique_id: int) -> Body | None:
        """Return the size and limits of a vehicle.

        Args:
            unique_id: its id on the wire; -1 is the first ego too.

        Returns:
            Its body; None if there is no such vehicle.
        """
        uid = FIRST_EGO if unique_id == -1 else unique_id
        if uid not in self.world:
            return None
        row = self.world.row(uid)
        return self.world.bodies[row] if self.world.kind[row] in {Kind.EGO, Kind.VEHICLE} else None

    def vehicle_ids(self) -> list[int]:
        """Return the ids of all vehicles except egos, in the order of their addition.

        Returns:
            The ids in the world.
        """
        world = self.world
        return [int(uid) for uid in world.uid[world.rows(Kind.VEHICLE)]]

    def _check_free(self) -> None:
        if self.is_replaying:
            raise FieldError("refused while a recording is replayed")


def populate(world: World, load: Load, plan: SignalPlan, next_uid: int, limits: SpeedLimits | None = None) -> int:
    """Remove and add the entities of a load, and return the next free id.

    Args:
        world: written in place.
        plan: traffic lights of its map.
        next_uid: the first free id.
        limits: of the ego's speed mode; None for those of its model.

    Raises:
        ValueError: the world refuses an entity. Half of the load is done.
    """
    if load.egos and load.is_clearing:
        world.clear()
    for uid in [int(world.uid[row]) for row in world.placed()]:
        is_ego = world.kind[world.row(uid)] == Kind.EGO
        if (uid == FIRST_EGO and load.egos) if is_ego else load.is_clearing:
            world.remove(uid)
    roads = load.road_map.roads
    has_lanes = world.roads is roads or world.roads.digest == roads.digest
    if not (has_lanes and world.signals.plan.digest == plan.digest):
        world.lay_roads(roads, plan)
    for start in load.phases:
        _set_phase(world, start)
    for ego in load.egos:
        model = replace(ego.model, body=_limit_speed_mode(ego.model.body, limits))
        _spawn(world, replace(ego, model=model), FIRST_EGO, ego.gear)
    uids, next_uid = _choose_uids(load.others, next_uid)
    starts = []
    with world.room_for(len(uids)):
        for spawn, uid in zip(load.others, uids, strict=True):
            _spawn_off_lanes(world, spawn, uid, spawn.gear)
            if spawn.driver is not None:
                starts.append(lane_start(world.row(uid), spawn, spawn.driver))
        keep_lanes(world, starts)
    return next_uid


def _place_story(scenario: Scenario, story: Story, road_map: RoadMap) -> Scenario:
    """Return a scenario with the entities of its story at their places.

    Raises:
        DocumentError: the map lacks a place.
    """
    if story.is_of_blocks:
        from rosbridge_sim.scenarios.events import check_places  # noqa: PLC0415 - few scenes have a story

        check_places(story, road_map)
        return scenario
    from rosbridge_sim.scenarios.openscenario.entities import place_entities  # noqa: PLC0415 - few scenes have a story
    from rosbridge_sim.scenarios.openscenario.places import StoryMap  # noqa: PLC0415 - few scenes have a story

    return place_entities(scenario, StoryMap.of(road_map))


def _log_notes(found: FoundMap) -> RoadMap:
    """Log the notes of a map, and return the map."""
    for note in found.road_map.notes:
        _log.info("map %s: %s", found.road_map.name, note)
    return found.road_map


def _set_phase(world: World, start: PhaseStart) -> None:
    """Set the phase of an intersection; if its elapsed time is longer than the phase, set the end of the phase."""
    signals = world.signals
    names = [controller.name for controller in signals.plan.controllers]
    controller = names.index(start.controller)
    last = signals.phase_length(controller, start.phase) - 1
    signals.set_phase(controller, start.phase, min(round(start.elapsed / DT), last))


def _limit_speed_mode(body: Body, limits: SpeedLimits | None) -> Body:
    """Return a body with these limits of its speed mode; None leaves its own."""
    if limits is None:
        return body
    up, down = limits
    return replace(body, speed_mode_accel=up, speed_mode_decel=down)


def _choose_uids(spawns: Sequence[Spawn], first: int) -> tuple[list[int], int]:
    """Return an id for each entity, and the next free id.

    An entity keeps its own id if that cannot have been used before.
    """
    own = [spawn.uid if spawn.uid is not None and first <= spawn.uid <= MAX_FILE_UID else None for spawn in spawns]
    following = max([first - 1, *(uid for uid in own if uid is not None)]) + 1
    uids = []
    for uid in own:
        if uid is None:
            uid, following = following, following + 1  # noqa: PLW2901 - the id that it gets instead
        uids.append(uid)
    return uids, following


def _spawn(world: World, spawn: Spawn, uid: int, gear: Gear) -> None:
    """Add an entity to the world, on its lane if it has one."""
    _spawn_off_lanes(world, spawn, uid, gear)
    if spawn.driver is not None:
        keep_lanes(world, [lane_start(world.row(uid), spawn, spawn.driver)])


def lane_start(row: int, spawn: Spawn, driver: Driver) -> LaneStart:
    """Return how a vehicle of a scenario begins to follow lanes."""
    is_loop = spawn.is_loop and len(driver.route) > 0
    return LaneStart(
        *(row, driver.lane, driver.s, driver.desired_speed, driver.route, is_loop),
        changes_lanes=driver.changes_lanes,
        lateral=driver.lateral,
        start_within=spawn.start_within,
    )


def _spawn_off_lanes(world: World, spawn: Spawn, uid: int, gear: Gear) -> None:
    """Add an entity to the world that gets its lane afterwards."""
    world.spawn(
        spawn.kind,
        spawn.model.body,
        name=spawn.name,
        x=spawn.x,
        y=spawn.y,
        z=spawn.z,
        yaw=spawn.yaw,
        speed=speed_in_gear(abs(spawn.speed), gear) if spawn.kind is Kind.EGO else spawn.speed,
        uid=uid,
        path=spawn.path,
        is_loop=spawn.is_loop,
        gear=gear,
        roll=spawn.roll,
        pitch=spawn.pitch,
        start_within=spawn.start_within if spawn.driver is None else 0.0,  # with its lane it gets this too
        yields=spawn.yields,
    )
