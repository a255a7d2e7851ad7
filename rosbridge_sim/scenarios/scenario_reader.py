"""Scenario documents: MORAI's JSON -> the entities to add to the world.

`model` defines the keys of a document; this module defines their meaning. A document has two coordinate frames.
Positions are ENU metres of the map, and headings are degrees counter-clockwise from east. Waypoints have the axes of
MORAI's engine, (x, y, z) = (-east, up, -north). All speeds are in km/h.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final, TypeVar

import numpy as np

from rosbridge_sim.documents.document_model import Document, fields_of, idle_keys
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import (
    BUILT_IN,
    Catalogue,
    Model,
    class_of_data_id,
    default_model,
    find_model,
    model_by_class,
)
from rosbridge_sim.scenarios.openscenario.story_records import Story
from rosbridge_sim.scenarios.scenario import Driver, PhaseStart, Scenario, Spawn
from rosbridge_sim.scenarios.scenario_model import (
    EgoVehicle,
    EnuPosition,
    Follower,
    InitPosition,
    NpcVehicle,
    Obstacle,
    Pedestrian,
    PlacedItem,
    Rotation,
    Scale,
    ScenarioDocument,
    SpawnPointItem,
    WaypointPath,
    blocks_of,
    read_scenario_document,
    start_distance,
)
from rosbridge_sim.scenarios.spawn_points import SpawnPoint, find_places, read_spawn_point
from rosbridge_sim.units import KMH_TO_MPS
from rosbridge_sim.world.drivers.lane_position import MAX_LATERAL
from rosbridge_sim.world.geometry.planar import FloatArray, arc_lengths
from rosbridge_sim.world.roads.paths import MAX_PATH_LENGTH
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.world import Body, Gear, Kind

T = TypeVar("T")
R = TypeVar("R")

MAX_SCENARIO_NOTES: Final = 20

MAX_SPAWN_TO_LANE: Final = 2.5
"""Largest distance from a lane's line for a vehicle that is on the lane [m]."""

MAX_TURN: Final = math.radians(45.0)
"""Largest angle to a lane for a vehicle that drives along it [rad]."""

USUAL_VEHICLES: Final = 1_000
"""So many vehicles are accepted on any map: most of them may stand beside its lanes."""

ROOM_PER_VEHICLE: Final = 10.0
"""Length of lane that each vehicle needs if there are more [m]: a car in a standing queue, and half as much again."""

USUAL_CARS: Final = tuple(
    model
    for model in map(find_model, ("2015_Kia_K5", "2016_Kia_Niro(HEV)", "2021_VW_Golf_GTI", "Hyundai_Ioniq_5", "Van"))
    if model is not None
)
"""Models of spawn points that choose at random."""

MIN_SCALE: Final = 0.001
MAX_SCALE: Final = 1_000.0
"""Limits of `scale`: a factor beyond them is a mistake, because a box of 60 cm would be 0.6 mm or 600 m long."""


OnMistake = Callable[[DocumentError], None]
"""Takes a mistake: it raises the error, or it returns and reading goes on without the item."""


def _refuse(error: DocumentError) -> None:
    raise error


def read_scenario(text: bytes, source: str, notify: OnMistake = _refuse, catalogue: Catalogue = BUILT_IN) -> Scenario:
    """Read a scenario document.

    Agents that start on a link have no position yet: pass the result to `place_on_roads`.

    Args:
        text: the file's bytes.
        source: its name, for errors and for the scenario's own name.
        notify: takes a mistake in a single item; by default the mistake is raised.

    Raises:
        DocumentError: one line: place, expected value, actual value.
    """
    document = read_scenario_document(text, source)
    keys = fields_of(ScenarioDocument)
    if document == ScenarioDocument() and not keys.keys() & json.loads(text.decode("utf-8-sig")).keys():
        expected = ", ".join(keys)
        raise DocumentError(f"{source}: expected a scenario with at least one of {expected}")
    return _Reader(document, source, notify, catalogue).scenario()


def place_on_roads(scenario: Scenario, roads: Roads, notify: OnMistake = _refuse) -> Scenario:
    """Place all agents that start on a link, with their heading along it.

    A link that the map lacks is ignored if the document also gives a position (MORAI writes both).

    Args:
        notify: as for `read_scenario`.

    Returns:
        The scenario with positions, lanes and routes.

    Raises:
        DocumentError: the map has no such link, and the document has no position.
    """
    notes = list(scenario.notes)
    try:
        _check_room(scenario, roads)
    except DocumentError as error:
        notify(error)

    def place(spawn: Spawn) -> Spawn:
        if spawn.link is None:
            return spawn
        try:
            lane = roads.row(spawn.link)
        except KeyError:
            if not spawn.is_placed:
                raise DocumentError(
                    f"{scenario.name}: {spawn.where}.initPosition.initLink: the map has no link {spawn.link!r}"
                ) from None
            _note(notes, f"{spawn.where}: the map has no link {spawn.link!r}; placed by its position instead")
            return replace(spawn, link=None)
        s = spawn.link_ratio * float(roads.length[lane])
        points, yaw = roads.at(lane, s)
        x, y, z = points[0].tolist()
        driver = spawn.driver and replace(spawn.driver, lane=lane, s=s)
        return replace(spawn, x=x, y=y, z=z, yaw=float(yaw[0]), driver=driver, link=None, is_placed=True)

    def take_lane(spawn: Spawn) -> Spawn:
        driver = spawn.driver
        if driver is None:
            return spawn
        if driver.lane < 0:
            driver = _find_lane(spawn, driver, roads)
        if driver is None:
            _note(notes, f"{spawn.where}: it stands on no lane; it goes straight ahead")
            return replace(spawn, driver=None)
        where = f"{scenario.name}: {spawn.where}.route"
        route = _route(driver, roads, where, is_loop=spawn.is_loop)
        return replace(spawn, speed=max(spawn.speed, 0.0), driver=replace(driver, route=route))

    return replace(
        scenario,
        egos=tuple(_all(scenario.egos, place, notify)),
        vehicles=tuple(_all(scenario.vehicles, lambda spawn: take_lane(place(spawn)), notify)),
        spawn_points=find_places(scenario.spawn_points, roads, lambda text: _note(notes, text)),
        notes=tuple(notes),
    )


def _check_room(scenario: Scenario, roads: Roads) -> None:
    """Check that so many vehicles fit on the map.

    Raises:
        DocumentError: the map is too small for them.
    """
    num, length = len(scenario.vehicles), float(roads.length.sum())
    most = max(USUAL_VEHICLES, int(length / ROOM_PER_VEHICLE))
    if num > most:
        raise DocumentError(
            f"{scenario.name}: vehicleList: expected at most {most:,} vehicles on this map, got {num:,}: more than"
            f" {USUAL_VEHICLES:,} need {ROOM_PER_VEHICLE:g} m of lane each, because crowds of vehicles that overlap"
            f" slow each step down; the lanes have {length / 1000:,.1f} km"
        )


def _all(items: Iterable[T], work: Callable[[T], R], notify: OnMistake) -> Iterator[R]:
    """Yield the result for each item; an item with a mistake is left out, if `notify` does not raise it."""
    for item in items:
        try:
            yield work(item)
        except DocumentError as error:
            notify(error)


def sort_phases(scenario: Scenario, plan: SignalPlan) -> tuple[tuple[PhaseStart, ...], list[str]]:
    """Sort the phases of a scenario into those that a map's lights have, and others.

    An `index` that is a whole number below the number of the map's controllers is a position, as in MORAI's files. Any
    other text is a controller's id. If it could be both, the position is used, and a line tells so.

    Args:
        plan: of the map's lights.

    Returns:
        The phases that the map has, with ids of controllers; and a line for the log about each other one.
    """
    controllers = plan.controllers
    num_phases = {controller.name: len(controller.phases) for controller in controllers}
    known = []
    lines = []
    for start in scenario.phases:
        index = start.controller.strip()
        name = start.controller
        if _POSITION.fullmatch(index) and int(index) < len(controllers):
            name = controllers[int(index)].name
            if index in num_phases and index != name:
                lines.append(f"index {index!r} is a position and an id; it is used as the position, {name!r}")
        if 0 <= start.phase < num_phases.get(name, 0):
            known.append(replace(start, controller=name))
        else:
            called = name if name == start.controller else f"{name} (index {index})"
            lines.append(f"no intersection {called!r} has a phase {start.phase}; the entry is ignored")
    return tuple(known), lines


_GAUSSIAN: Final = frozenset({"2", "2.0"})
"""Values of latBiasMode, as text, with which the offsets of a spawn point's vehicles differ; 1 means a fixed one."""

_POSITION: Final = re.compile(r"[0-9]{1,9}")


def _find_lane(spawn: Spawn, driver: Driver, roads: Roads) -> Driver | None:
    """Return the driver on the lane that the vehicle stands on; None if it stands on no lane."""
    place = roads.nearest(spawn.x, spawn.y, spawn.yaw, spawn.z)
    turn = abs(math.remainder(float(place.yaw[0]) - spawn.yaw, math.tau))
    if not (place.lane[0] >= 0 and place.distance[0] <= MAX_SPAWN_TO_LANE and turn <= MAX_TURN):
        return None
    return replace(driver, lane=int(place.lane[0]), s=float(place.s[0]))


def _route(driver: Driver, roads: Roads, where: str, *, is_loop: bool) -> tuple[int, ...]:
    """Return the lanes of a driver's route.

    Raises:
        DocumentError: the map lacks a link, or a link does not follow the one before it.
    """
    rows = []
    for i, link in enumerate(driver.links):
        try:
            rows.append(roads.row(link))
        except KeyError:
            raise DocumentError(f"{where}[{i}]: the map has no link {link!r}") from None
    if rows and rows[0] != driver.lane:
        raise DocumentError(
            f"{where}[0]: expected {roads.ids[driver.lane]!r}, where it starts, got {driver.links[0]!r}"
        )
    for i, (here, there) in enumerate(pairwise([*rows, *rows[:1]] if is_loop else rows)):
        if there not in roads.successors(here):
            raise DocumentError(f"{where}[{i}]: {roads.ids[there]!r} does not follow {roads.ids[here]!r}")
    return tuple(rows)


class _Reader:
    """Conversion of one document into one `Scenario`."""

    def __init__(self, document: ScenarioDocument, source: str, notify: OnMistake, catalogue: Catalogue) -> None:
        self._document = document
        self._source = source
        self._tell = notify
        self._catalogue = catalogue
        self._notes: list[str] = []
        self._taken: dict[int, str] = {}
        self._paths, self._paths_of = self._read_paths(document.waypointDataList or ())

    def scenario(self) -> Scenario:
        document = self._document
        # In the order of the document: if two items have one id, the first keeps it.
        ego = () if document.egoVehicle is None else (document.egoVehicle,)
        egos = tuple(_all(ego, self._ego, self._tell))
        vehicles = self._items("vehicleList", document.vehicleList, self._vehicle)
        people = self._items("pedestrianList", document.pedestrianList, self._pedestrian)
        obstacles = self._items("objectList", document.objectList, self._obstacle)
        points = self._items("spawnPointList", document.spawnPointList, self._spawn_point)
        name = re.split(r"[\\/]", self._source)[-1].removesuffix(".json")
        map_name = (document.mapInfo.mapName or None) if document.mapInfo else None
        phases = tuple(PhaseStart(entry.index, entry.state, entry.deltaTime or 0.0) for entry in document.tlList or ())
        notes, kept = tuple(self._notes), _kept(document)
        story = next(_all((document,), self._story, self._tell), None)
        return Scenario(name, map_name, egos, vehicles, people, obstacles, phases, notes, kept, points, story)

    def _story(self, document: ScenarioDocument) -> Story | None:
        if not any(True for _ in blocks_of(document)):
            return None
        from rosbridge_sim.scenarios.events import document_story  # noqa: PLC0415 - few scenes have a story

        return document_story(document, self._source)

    def _items(self, key: str, items: Sequence[T] | None, read: Callable[[str, T], R]) -> tuple[R, ...]:
        numbered = enumerate(items or ())
        return tuple(_all(numbered, lambda entry: read(f"{key}[{entry[0]}]", entry[1]), self._tell))

    def _ego(self, item: EgoVehicle) -> Spawn:
        where = "egoVehicle"
        uid = 0 if item.UNIQUEID is None or item.UNIQUEID < 0 else item.UNIQUEID
        self._taken[uid] = where
        # Versions of MORAI write the gear into different places.
        given = [gear for gear in (item.initPosition.gear, item.gear) if gear is not None]
        gears = [gear for gear in given if gear in set(Gear)]
        gear = Gear(gears[0]) if gears else Gear.DRIVE
        if given and not gears:
            _note(self._notes, f"{where}.gear: expected 1 (P), 2 (R), 3 (N) or 4 (D), got {given[0]}; it counts as D")
        if gear is Gear.DRIVE and (item.currentVelocity or 0.0) < 0.0:
            text = f"expected 0 or more in gear 4 (D), got {item.currentVelocity:g}; it counts without its sign"
            _note(self._notes, f"{where}.currentVelocity: {text}")
        spawn = self._on_wheels(where, Kind.EGO, item, item.initPosition)
        return replace(spawn, uid=uid, speed=(item.currentVelocity or 0.0) * KMH_TO_MPS, gear=gear)

    def _vehicle(self, where: str, item: NpcVehicle) -> Spawn:
        spawn = self._on_wheels(where, Kind.VEHICLE, item, item.initPosition)
        first, second = item.desiredVelocity or item.constantVelocity, item.linkVelocity
        if first is None:
            first = item.desiredVelocity
        if item.velocityType == 1:
            first, second = second, first
        speed_kmh = first if first is not None else second
        spawn = self._follow(where, item, spawn, speed_kmh, is_loop=item.isCloseLoop)
        spawn = replace(spawn, yields=bool(item.yields), start_within=start_distance(item))
        is_on_lanes = item.isWaypointMode is False or (item.isWaypointMode is None and _names_link(item))
        if spawn.path is not None or (spawn.link is None and not is_on_lanes):
            return spawn
        # With the link's speed, or without any speed, the driver keeps to the speed limit.
        is_free = item.velocityType == 1 or speed_kmh is None
        now_kmh = speed_kmh if item.currentVelocity is None else item.currentVelocity
        driver = Driver(
            math.inf if is_free else max(spawn.speed, 0.0),
            tuple(item.route or ()),
            changes_lanes=_changes_lanes(item.isLaneChange),
            lateral=self._bias(f"{where}.latBias", item.latBias),
        )
        return replace(spawn, speed=(now_kmh or 0.0) * KMH_TO_MPS, is_loop=bool(item.isCloseLoop), driver=driver)

    def _bias(self, where: str, value: JsonValue) -> float:
        """Return a lateral offset; 0 with a remark for anything that is none."""
        if value is None:
            return 0.0
        try:
            bias = float(str(value))
        except ValueError:
            bias = math.nan
        if not abs(bias) <= MAX_LATERAL:
            _note(self._notes, f"{where}: expected -{MAX_LATERAL:g}..{MAX_LATERAL:g} m; it counts as 0")
            return 0.0
        return bias

    def _pedestrian(self, where: str, item: Pedestrian) -> Spawn:
        spawn = self._placed(where, Kind.PEDESTRIAN, item, item.pos, item.rot)
        spawn = self._follow(where, item, spawn, item.speed, is_loop=item.loop, ahead=item.movingDistance or 0.0)
        return replace(spawn, start_within=start_distance(item), yields=bool(item.yields))

    def _obstacle(self, where: str, item: Obstacle) -> Spawn:
        spawn = self._placed(where, Kind.OBSTACLE, item, item.pos, item.rot)
        if item.scale is not None:
            spawn = replace(spawn, model=self._scaled(where, spawn.model, item.scale))
        spawn = self._follow(where, item, spawn, item.moveSpeed)
        return replace(spawn, start_within=start_distance(item))

    def _spawn_point(self, where: str, item: SpawnPointItem) -> SpawnPoint:
        if item.modelName or (item.spawnVehicleTypeID is not None and item.spawnVehicleTypeID >= 0):
            wanted = PlacedItem(DataID=item.spawnVehicleTypeID, modelName=item.modelName)
            models: tuple[Model, ...] = (self._model(where, Kind.VEHICLE, wanted),)
        else:
            models = tuple(model for model in self._catalogue.own if model.kind is Kind.VEHICLE) or USUAL_CARS
        point = read_spawn_point(where, item, models)
        low, high = sorted(self._bias(f"{where}.{key}", getattr(item, key)) for key in ("MinLatBias", "MaxLatBias"))
        if str(item.latBiasMode).strip() not in _GAUSSIAN:
            low = high = 0.5 * (low + high)
        return replace(point, changes_lanes=_changes_lanes(item.isLaneChange), lateral=(low, high))

    def _on_wheels(self, where: str, kind: Kind, item: PlacedItem, start: InitPosition) -> Spawn:
        is_absolute = start.initPositionMode.strip().casefold() == "absolute"
        if is_absolute and start.pos is None:
            raise DocumentError(f"{self._source}: {where}.initPosition.pos: missing")
        if not is_absolute and not start.initLink:
            if start.initPositionMode.strip().casefold() == "link":
                raise DocumentError(f"{self._source}: {where}.initPosition.initLink: missing")
            mode = f"{where}.initPosition.initPositionMode"
            raise DocumentError(f"{self._source}: {mode}: expected Absolute or Link, got {start.initPositionMode!r}")
        spawn = self._placed(where, kind, item, start.pos or EnuPosition(x=0.0, y=0.0), start.rot)
        link = None if is_absolute else start.initLink
        return replace(spawn, link=link, link_ratio=start.initLinkRatio or 0.0, is_placed=start.pos is not None)

    def _placed(self, where: str, kind: Kind, item: PlacedItem, pos: EnuPosition, rot: Rotation | None) -> Spawn:
        uid = None if kind is Kind.EGO else self._uid(where, item)
        model, rot = self._model(where, kind, item), rot or Rotation()
        roll, pitch = _turn(rot.roll), _turn(rot.pitch)
        place = (pos.x, pos.y, pos.z, _turn(rot.yaw))
        return Spawn(kind, model, model.name, uid, *place, roll=roll, pitch=pitch, kept=_kept(item), where=where)

    def _scaled(self, where: str, model: Model, scale: Scale) -> Model:
        """Return the model in another size; in its own size if the document's factors are out of range."""
        factors = scale.z, scale.x, scale.y
        if not all(MIN_SCALE <= factor <= MAX_SCALE for factor in factors):
            _note(
                self._notes,
                f"{where}.scale: expected numbers from {MIN_SCALE:g} to {MAX_SCALE:,g}, got x {scale.x:g},"
                f" y {scale.y:g}, z {scale.z:g}; it gets its model's size",
            )
            return model
        size = model.body.length, model.body.width, model.body.height
        length, width, height = (figure * factor for figure, factor in zip(size, factors, strict=True))
        return replace(model, body=Body.box(length, width, height)) if factors != (1.0, 1.0, 1.0) else model

    def _follow(
        self,
        where: str,
        item: Follower,
        spawn: Spawn,
        speed_kmh: float | None,
        *,
        is_loop: bool | None = None,
        ahead: float = 0.0,
    ) -> Spawn:
        """Give an agent its speed and its path: the document's path, or `ahead` metres straight ahead."""
        speed = (speed_kmh or 0.0) * KMH_TO_MPS
        path = self._path(where, item, spawn.kind, is_moving=speed != 0.0)
        here = np.array([[spawn.x, spawn.y, spawn.z]])
        if path is None and ahead > 0.0:
            step = np.array([math.cos(spawn.yaw), math.sin(spawn.yaw), 0.0])
            path = np.concatenate([here, here + ahead * step])
        if path is None or not len(path):
            # In waypoint mode without waypoints it stands: MORAI saves most things that never move in this form.
            is_standing = path is not None or bool(item.isWaypointMode)
            return replace(spawn, speed=0.0 if is_standing else speed)
        if not _has_length(path):
            # One waypoint: the path leads from the start to it.
            path = np.concatenate([here, path])
            if not spawn.is_placed or not _has_length(path):
                _note(self._notes, f"{where}: its path has no length; it stands still")
                return replace(spawn, speed=0.0)
        return replace(spawn, speed=max(speed, 0.0), path=path, is_loop=bool(is_loop))

    def _path(self, where: str, item: Follower, kind: Kind, *, is_moving: bool) -> FloatArray | None:
        """Return the waypoints that an item follows, (m, 3) [m]: none if it stands, and None if it follows no path."""
        if item.pathName:
            if item.pathName not in self._paths:
                raise DocumentError(f"{self._source}: {where}.pathName: waypointDataList has no path {item.pathName!r}")
            return self._paths[item.pathName]
        if item.isWaypointMode is False or item.UNIQUEID is None:
            return None
        path = self._paths_of.get((kind is Kind.PEDESTRIAN, item.UNIQUEID))
        if path is None and item.isWaypointMode and is_moving:
            _note(self._notes, f"{where}: isWaypointMode, but waypointDataList has no path ' - {item.UNIQUEID}'")
        if path is not None and not len(path) and not item.isWaypointMode:
            return None
        return path

    def _model(self, where: str, kind: Kind, item: PlacedItem) -> Model:
        wanted = Kind.VEHICLE if kind is Kind.EGO else kind
        if item.modelName:
            model = self._catalogue.find(item.modelName)
            if model is None or model.kind is not wanted:
                near = "" if model is not None else self._catalogue.suggest(item.modelName, wanted)
                raise DocumentError(
                    f"{self._source}: {where}.modelName: expected one of the catalogue's {wanted.name.lower()}s, "
                    f"got {item.modelName!r}{near}"
                )
            return model
        if item.DataID is None:
            return default_model(kind)
        model = self._catalogue.of_data_id(item.DataID, kind)
        if model is None:
            model = model_by_class(item.DataID, kind)
            body = model.body
            other = class_of_data_id(item.DataID)
            aside = f", and its number belongs to {_A[other]}" if other is not None and other is not wanted else ""
            _note(
                self._notes,
                f"DataID {item.DataID} ({kind.name.lower()}) is not in the catalogue{aside}; it gets the ordinary size"
                f" of its class, {body.length:g} x {body.width:g} x {body.height:g} m; --catalogue FILE can define it",
            )
        return model

    def _uid(self, where: str, item: PlacedItem) -> int | None:
        """Return the item's id if it can have it: 0 is the first ego's, and negative numbers are not valid."""
        uid = item.UNIQUEID
        if uid is None:
            return None
        if uid <= 0 or uid in self._taken:
            reason = f"is in use by {self._taken[uid]}" if uid in self._taken else "is not a valid id"
            _note(self._notes, f"{where}: UNIQUEID {uid} {reason}; it gets the next free one")
            return None
        self._taken[uid] = where
        return uid

    def _read_paths(
        self, paths: Sequence[WaypointPath]
    ) -> tuple[Mapping[str, FloatArray], Mapping[tuple[bool, int], FloatArray]]:
        """Return the paths by name, and by owner: (owner is a pedestrian, UNIQUEID)."""
        by_name: dict[str, FloatArray] = {}
        by_owner: dict[tuple[bool, int], FloatArray] = {}
        for i, path in enumerate(paths):
            try:
                points = _waypoints(path, f"{self._source}: waypointDataList[{i}]")
            except DocumentError as error:
                self._tell(error)
                points = np.zeros((1, 3))  # so that its followers are not reported as mistakes too
            by_name.setdefault(path.pathName, points)
            what, _, uid = path.pathName.rpartition(" - ")  # "PedPath - 12", "ObstaclePath - 12"
            if uid.isdecimal():
                by_owner.setdefault((what.strip().casefold() == "pedpath", int(uid)), points)
        return by_name, by_owner


def _changes_lanes(value: JsonValue) -> bool:
    """Return the meaning of `isLaneChange`."""
    return str(value).strip().casefold() not in {"false", "0"}


def _waypoints(path: WaypointPath, where: str) -> FloatArray:
    """Return the points of a path on the map, (m, 3) [m].

    Raises:
        DocumentError: the path is too long.
    """
    if not path.waypointData:
        return np.zeros((0, 3))
    points = np.array([(-p.pos.x, -p.pos.z, p.pos.y) for p in path.waypointData])
    if arc_lengths(np.concatenate([points, points[:1]]))[-1] > MAX_PATH_LENGTH:
        raise DocumentError(f"{where}: expected a path of at most {MAX_PATH_LENGTH / 1000:,g} km")
    return points


def _has_length(path: FloatArray) -> bool:
    return float(arc_lengths(path)[-1]) > 1e-3  # noqa: PLR2004  # a millimetre: no user draws a shorter path


def _turn(degrees: float) -> float:
    """Return an angle within (-pi, pi] [rad]."""
    turned = math.remainder(degrees, 360.0)
    return math.radians(180.0 if turned == -180.0 else turned)  # noqa: PLR2004  # half a turn


def _kept(item: Document) -> dict[str, Any]:
    """Return the keys of a part of a document that have no effect yet, in the order of its model."""
    found = {key: getattr(item, key) for key in idle_keys(type(item))}
    return {key: value for key, value in found.items() if value is not None}


def _names_link(item: NpcVehicle) -> bool:
    """Return whether the file gives the link that the vehicle was on."""
    infos = (item.currentLinkInfo, item.startPointLinkInfo)
    return any(isinstance(info, dict) and bool(info.get("linkIdx")) for info in infos)


_A: Final = {Kind.VEHICLE: "a vehicle", Kind.PEDESTRIAN: "a pedestrian", Kind.OBSTACLE: "an obstacle"}


def _note(notes: list[str], text: str) -> None:
    if text in notes:
        return
    if len(notes) < MAX_SCENARIO_NOTES:
        notes.append(text)
    elif len(notes) == MAX_SCENARIO_NOTES:
        notes.append("... and more of that kind")
