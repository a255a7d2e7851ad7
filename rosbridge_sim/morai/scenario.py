"""Scenario documents: MORAI's JSON -> what to spawn.

The models below are the documented subset: every key they name is read, and whatever else MORAI writes (physics of
the moment, traffic generators, editor state) is passed over. Two keys are ours, since a person who writes a scenario
by hand knows neither MORAI's numbers nor its ids: `modelName`, a name of the catalogue instead of `DataID`, and
`pathName`, a path by its name instead of by the item's `UNIQUEID`. `schemas/scenario.schema.json` is made from here.

Two frames meet in one file. Positions are ENU metres of the map, headings degrees counter-clockwise from east;
waypoints are in the axes of MORAI's engine, (x, y, z) = (-east, up, -north). Speeds are km/h throughout.
"""

# ruff: noqa: N815  # the document's own spelling

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import Field, TypeAdapter, model_validator

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.catalogue import Model, default_model, find_model, model_of_data_id
from rosbridge_sim.morai.documents import Coordinate, Document, Flag, Number, Ratio, Whole, read_document
from rosbridge_sim.world.geometry import FloatArray, arc_lengths
from rosbridge_sim.world.paths import MAX_PATH_LENGTH
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.state import Gear, Kind

__all__ = ["Scenario", "Spawn", "place_on_roads", "read_scenario", "scenario_schema"]

MAX_BYTES: Final = 1 << 25
"""32 MiB: a hundred times what MORAI saves for a full scene."""

MAX_ITEMS: Final = 1_000
"""Vehicles, pedestrians, obstacles: of each, fifty times what one step is made for."""

MAX_PATHS: Final = 3 * MAX_ITEMS
MAX_WAYPOINTS: Final = 100_000
MAX_TEXT: Final = 200
MAX_NOTES: Final = 20

KMH: Final = 1.0 / 3.6
"""One km/h [m/s]."""

T = TypeVar("T")

Text = Annotated[str, Field(max_length=MAX_TEXT)]
Speed = Annotated[Number, Field(ge=-1_000.0, le=1_000.0)]
Items = Annotated[list[T], Field(max_length=MAX_ITEMS)]

# -- the document


class EnuPosition(Document):
    """A place on the map: metres east, north and up of its origin."""

    x: Coordinate
    y: Coordinate
    z: Coordinate = 0.0

    @model_validator(mode="before")
    @classmethod
    def _from_texts(cls, value: Any) -> Any:  # noqa: ANN401  # whatever stood in the document
        """MORAI writes each number twice, `x` and the text `_x`: the text serves where the number is missing."""
        if not isinstance(value, dict):
            return value
        texts = {key: value["_" + key] for key in "xyz" if value.get(key) is None and value.get("_" + key) is not None}
        return {**value, **texts}


class Rotation(Document):
    """A heading."""

    yaw: Annotated[Number, Field(description="degrees counter-clockwise from east")] = 0.0


class InitPosition(Document):
    """Where a vehicle starts: at a place, or somewhere along a link of the map."""

    initPositionMode: Annotated[Text, Field(description='"Absolute": pos and rot; "Link": initLink')] = "Absolute"
    pos: EnuPosition | None = None
    rot: Rotation | None = None
    initLink: Annotated[Text | None, Field(description="id of a link of the map")] = None
    initLinkRatio: Annotated[Ratio | None, Field(description="0 at the link's start, 1 at its end")] = None


class Item(Document):
    """What every agent has."""

    UNIQUEID: Annotated[Whole | None, Field(description="its id; without one the next free is taken")] = None
    DataID: Annotated[Whole | None, Field(description="MORAI's number of the model")] = None
    modelName: Annotated[Text | None, Field(description="name of the model, beats DataID (ours)")] = None


class EgoVehicle(Item):
    """The car that clients drive. UNIQUEID -1, as MORAI has it, is the first ego: 0 on the wire."""

    initPosition: InitPosition
    gear: Annotated[Whole | None, Field(description="1 P, 2 R, 3 N, 4 D; otherwise D")] = None
    currentVelocity: Annotated[Speed | None, Field(description="speed at the start [km/h]")] = None


class Follower(Item):
    """What may follow a path of waypointDataList."""

    isWaypointMode: Annotated[Flag | None, Field(description="false: the path is not followed")] = None
    pathName: Annotated[
        Text | None, Field(description="which path; else the one that ends in ' - UNIQUEID' (ours)")
    ] = None


class NpcVehicle(Follower):
    """A vehicle that keeps its speed: along its path, or straight ahead without one."""

    initPosition: InitPosition
    velocityType: Annotated[Whole | None, Field(description="1: linkVelocity, 2: constantVelocity")] = None
    constantVelocity: Annotated[Speed | None, Field(description="[km/h]")] = None
    linkVelocity: Annotated[Speed | None, Field(description="[km/h]")] = None
    isCloseLoop: Annotated[Flag | None, Field(description="the path begins again at its end")] = None


class Pedestrian(Follower):
    """Somebody who walks: along the path, else movingDistance straight ahead, else straight ahead for ever."""

    pos: EnuPosition
    rot: Rotation | None = None
    speed: Annotated[Speed | None, Field(description="[km/h]")] = None
    loop: Annotated[Flag | None, Field(description="begins again at the end of the way, or walks back")] = None
    movingDistance: Annotated[Coordinate | None, Field(description="[m]")] = None


class Obstacle(Follower):
    """A thing that stands, or moves along its path."""

    pos: EnuPosition
    rot: Rotation | None = None
    moveSpeed: Annotated[Speed | None, Field(description="[km/h]")] = None


class EnginePosition(Document):
    """A waypoint's place in the engine's axes: x west, y up, z south [m]."""

    x: Coordinate
    y: Coordinate = 0.0
    z: Coordinate


class Waypoint(Document):
    """A point of a path."""

    pos: EnginePosition


class WaypointPath(Document):
    """A path."""

    pathName: Annotated[Text, Field(description='any name; "... - 7" is the path of the item with UNIQUEID 7')]
    waypointData: Annotated[list[Waypoint], Field(max_length=MAX_WAYPOINTS)]


class MapInfo(Document):
    """The map that the scenario is made for."""

    mapName: Text | None = None


class ScenarioDocument(Document):
    """A scenario: the part of MORAI's scenario files that rosbridge_sim reads. Other keys are passed over."""

    mapInfo: MapInfo | None = None
    egoVehicle: EgoVehicle | None = None
    vehicleList: Items[NpcVehicle] | None = None
    pedestrianList: Items[Pedestrian] | None = None
    objectList: Items[Obstacle] | None = None
    waypointDataList: Annotated[list[WaypointPath], Field(max_length=MAX_PATHS)] | None = None


_DOCUMENT: Final = TypeAdapter(ScenarioDocument)

# -- what it means


@dataclass(frozen=True, slots=True, eq=False)
class Spawn:
    """One agent to be put into the world.

    Attributes:
        kind, model, name: what it is; the name is the model's.
        uid: the id that the file gives, 0 for the first ego; None: the next free one.
        x, y, z: reference point, map frame [m]. 0 as long as only the link is known (`is_placed` False).
        yaw: (-pi, pi] [rad].
        speed: along the heading or the path; never negative on a path [m/s].
        path: (m, 3) waypoints, map frame, two different ones at least [m]; None: straight ahead.
        is_loop: the path is closed.
        gear: of an ego.
        link: id of the link that it starts on, until `place_on_roads`; then None.
        link_ratio: how far along that link, 0..1.
        is_placed: x, y and z are good.
        where: its place in the document, for messages.
    """

    kind: Kind
    model: Model
    name: str
    uid: int | None
    x: float
    y: float
    z: float
    yaw: float
    speed: float = 0.0
    path: FloatArray | None = None
    is_loop: bool = False
    gear: Gear = Gear.DRIVE
    link: str | None = None
    link_ratio: float = 0.0
    is_placed: bool = True
    where: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """A whole scenario, in the order of its document.

    Attributes:
        name: of the file, without `.json`.
        map_name: the map it is made for, if it says so.
        egos, vehicles, pedestrians, obstacles: what to spawn. No two have one `uid`.
        notes: what was read otherwise than written: a line each, for the log.
    """

    name: str
    map_name: str | None = None
    egos: tuple[Spawn, ...] = ()
    vehicles: tuple[Spawn, ...] = ()
    pedestrians: tuple[Spawn, ...] = ()
    obstacles: tuple[Spawn, ...] = ()
    notes: tuple[str, ...] = ()


def read_scenario(text: bytes, source: str) -> Scenario:
    """Read a scenario document.

    Agents that start on a link have no place yet: give the result to `place_on_roads`.

    Args:
        text: the file's bytes.
        source: its name, for errors and for the scenario's own name.

    Raises:
        DocumentError: one line: where, what was expected, what came.
    """
    document = read_document(_DOCUMENT, text, source, MAX_BYTES)
    if not document.model_fields_set:
        expected = ", ".join(ScenarioDocument.model_fields)
        raise DocumentError(f"{source}: expected a scenario, with some of {expected}")
    return _Reader(document, source).scenario()


def place_on_roads(scenario: Scenario, roads: Roads) -> Scenario:
    """The same scenario with everything that starts on a link put there, heading along it.

    A link that the map lacks does no harm where the document gives a place as well (MORAI writes both).

    Raises:
        DocumentError: the map has no such link and the document no place.
    """
    notes = list(scenario.notes)

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
        points, yaw = roads.at(lane, spawn.link_ratio * roads.length[lane])
        x, y, z = points[0].tolist()
        return replace(spawn, x=x, y=y, z=z, yaw=float(yaw[0]), link=None, is_placed=True)

    return replace(
        scenario,
        egos=tuple(map(place, scenario.egos)),
        vehicles=tuple(map(place, scenario.vehicles)),
        notes=tuple(notes),
    )


def scenario_schema() -> dict[str, Any]:
    """The documented subset as a JSON Schema (draft 2020-12)."""
    schema = _without_noise(_DOCUMENT.json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Scenario", **schema}


def _without_noise(schema: Any) -> Any:  # noqa: ANN401  # a JSON value
    """A schema without pydantic's made-up titles and with one `type` where it writes "this or null" at length."""
    if isinstance(schema, list):
        return [_without_noise(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    plain = {
        key: _without_noise(value)
        for key, value in schema.items()
        if not (key == "title" and isinstance(value, str)) and not (key == "default" and value is None)
    }
    match plain.get("anyOf"):
        case [{"type": str() | list() as kind, **rest}, {"type": "null"}]:
            del plain["anyOf"]
            kinds = [kind] if isinstance(kind, str) else kind
            return {"type": [*kinds, "null"], **rest, **plain}
    return plain


class _Reader:
    """The passage from one document to one `Scenario`."""

    def __init__(self, document: ScenarioDocument, source: str) -> None:
        self._document = document
        self._source = source
        self._notes: list[str] = []
        self._taken: dict[int, str] = {}
        self._paths, self._paths_of = self._read_paths(document.waypointDataList or ())

    def scenario(self) -> Scenario:
        document = self._document
        # In the order of the document: of two items with one id the first keeps it.
        egos = () if document.egoVehicle is None else (self._ego(document.egoVehicle),)
        vehicles = tuple(self._vehicle(f"vehicleList[{i}]", v) for i, v in enumerate(document.vehicleList or ()))
        people = tuple(self._pedestrian(f"pedestrianList[{i}]", p) for i, p in enumerate(document.pedestrianList or ()))
        obstacles = tuple(self._obstacle(f"objectList[{i}]", o) for i, o in enumerate(document.objectList or ()))
        name = re.split(r"[\\/]", self._source)[-1].removesuffix(".json")
        map_name = (document.mapInfo.mapName or None) if document.mapInfo else None
        return Scenario(name, map_name, egos, vehicles, people, obstacles, tuple(self._notes))

    def _ego(self, item: EgoVehicle) -> Spawn:
        where = "egoVehicle"
        uid = 0 if item.UNIQUEID is None or item.UNIQUEID < 0 else item.UNIQUEID
        self._taken[uid] = where
        gear = Gear(item.gear) if item.gear in set(Gear) else Gear.DRIVE
        spawn = self._on_wheels(where, Kind.EGO, item, item.initPosition, uid)
        return replace(spawn, speed=(item.currentVelocity or 0.0) * KMH, gear=gear)

    def _vehicle(self, where: str, item: NpcVehicle) -> Spawn:
        spawn = self._on_wheels(where, Kind.VEHICLE, item, item.initPosition, self._uid(where, item))
        first, second = item.constantVelocity, item.linkVelocity
        if item.velocityType == 1:
            first, second = second, first
        speed_kmh = first if first is not None else second
        return self._follow(where, item, spawn, speed_kmh, is_loop=item.isCloseLoop)

    def _pedestrian(self, where: str, item: Pedestrian) -> Spawn:
        spawn = self._on_foot(where, Kind.PEDESTRIAN, item, item.pos, item.rot)
        return self._follow(where, item, spawn, item.speed, is_loop=item.loop, ahead=item.movingDistance or 0.0)

    def _obstacle(self, where: str, item: Obstacle) -> Spawn:
        spawn = self._on_foot(where, Kind.OBSTACLE, item, item.pos, item.rot)
        return self._follow(where, item, spawn, item.moveSpeed)

    def _on_wheels(self, where: str, kind: Kind, item: Item, start: InitPosition, uid: int | None) -> Spawn:
        is_absolute = start.initPositionMode.strip().casefold() == "absolute"
        if is_absolute and start.pos is None:
            raise DocumentError(f"{self._source}: {where}.initPosition.pos: missing")
        if not is_absolute and not start.initLink:
            raise DocumentError(f"{self._source}: {where}.initPosition.initLink: missing")
        pos = start.pos or EnuPosition(x=0.0, y=0.0)
        model = self._model(where, kind, item)
        return Spawn(
            *(kind, model, model.name, uid, pos.x, pos.y, pos.z, _yaw(start.rot)),
            link=None if is_absolute else start.initLink,
            link_ratio=start.initLinkRatio or 0.0,
            is_placed=start.pos is not None,
            where=where,
        )

    def _on_foot(self, where: str, kind: Kind, item: Item, pos: EnuPosition, rot: Rotation | None) -> Spawn:
        model = self._model(where, kind, item)
        return Spawn(
            *(kind, model, model.name, self._uid(where, item), pos.x, pos.y, pos.z, _yaw(rot)),
            where=where,
        )

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
        """Give an agent its speed and its way: its path, or `ahead` metres on from where it is."""
        speed = (speed_kmh or 0.0) * KMH
        path = self._path(where, item, spawn.kind)
        here = np.array([[spawn.x, spawn.y, spawn.z]])
        if path is None and ahead > 0.0:
            step = np.array([math.cos(spawn.yaw), math.sin(spawn.yaw), 0.0])
            path = np.concatenate([here, here + ahead * step])
        if path is None:
            return replace(spawn, speed=speed)
        if not _has_length(path):
            # One waypoint: the way leads from here to there.
            path = np.concatenate([here, path])
            if not spawn.is_placed or not _has_length(path):
                _note(self._notes, f"{where}: its path has no length; it stands still")
                return replace(spawn, speed=0.0)
        return replace(spawn, speed=max(speed, 0.0), path=path, is_loop=bool(is_loop))

    def _path(self, where: str, item: Follower, kind: Kind) -> FloatArray | None:
        if item.pathName:
            if item.pathName not in self._paths:
                raise DocumentError(f"{self._source}: {where}.pathName: waypointDataList has no path {item.pathName!r}")
            return self._paths[item.pathName]
        if item.isWaypointMode is False or item.UNIQUEID is None:
            return None
        path = self._paths_of.get((kind is Kind.PEDESTRIAN, item.UNIQUEID))
        if path is None and item.isWaypointMode:
            _note(self._notes, f"{where}: isWaypointMode, but waypointDataList has no path ' - {item.UNIQUEID}'")
        return path

    def _model(self, where: str, kind: Kind, item: Item) -> Model:
        wanted = Kind.VEHICLE if kind is Kind.EGO else kind
        if item.modelName:
            model = find_model(item.modelName)
            if model is None or model.kind is not wanted:
                raise DocumentError(
                    f"{self._source}: {where}.modelName: expected one of the catalogue's {wanted.name.lower()}s, "
                    f"got {item.modelName!r}"
                )
            return model
        if item.DataID is None:
            return default_model(kind)
        model = model_of_data_id(item.DataID, kind)
        if model is None:
            model = default_model(kind)
            text = (
                f"DataID {item.DataID} ({kind.name.lower()}) is not in the catalogue; it gets the size of {model.name}"
            )
            _note(self._notes, text)
        return model

    def _uid(self, where: str, item: Item) -> int | None:
        """The item's id if it can have it. 0 is the first ego's, and what is negative is no id."""
        uid = item.UNIQUEID
        if uid is None:
            return None
        if uid <= 0 or uid in self._taken:
            reason = f"is that of {self._taken[uid]}" if uid in self._taken else "is no id"
            _note(self._notes, f"{where}: UNIQUEID {uid} {reason}; it gets the next free one")
            return None
        self._taken[uid] = where
        return uid

    def _read_paths(
        self, paths: Sequence[WaypointPath]
    ) -> tuple[Mapping[str, FloatArray], Mapping[tuple[bool, int], FloatArray]]:
        """The paths by name, and by whose they are: (a pedestrian's, UNIQUEID)."""
        by_name: dict[str, FloatArray] = {}
        by_owner: dict[tuple[bool, int], FloatArray] = {}
        for i, path in enumerate(paths):
            where = f"{self._source}: waypointDataList[{i}]"
            if not path.waypointData:
                raise DocumentError(f"{where}.waypointData: expected at least one waypoint, got none")
            points = np.array([(-p.pos.x, -p.pos.z, p.pos.y) for p in path.waypointData])
            if arc_lengths(np.concatenate([points, points[:1]]))[-1] > MAX_PATH_LENGTH:
                raise DocumentError(f"{where}: expected a path of at most {MAX_PATH_LENGTH / 1000:,g} km")
            by_name.setdefault(path.pathName, points)
            what, _, uid = path.pathName.rpartition(" - ")  # "PedPath - 12", "ObstaclePath - 12"
            if uid.isdecimal():
                by_owner.setdefault((what.strip().casefold() == "pedpath", int(uid)), points)
        return by_name, by_owner


def _has_length(path: FloatArray) -> bool:
    return float(arc_lengths(path)[-1]) > 1e-3  # noqa: PLR2004  # a millimetre: nobody draws a shorter path


def _yaw(rotation: Rotation | None) -> float:
    """The heading within (-pi, pi] [rad]."""
    if rotation is None:
        return 0.0
    turned = math.remainder(rotation.yaw, 360.0)
    return math.radians(180.0 if turned == -180.0 else turned)  # noqa: PLR2004  # half a turn


def _note(notes: list[str], text: str) -> None:
    if text in notes:
        return
    if len(notes) < MAX_NOTES:
        notes.append(text)
    elif len(notes) == MAX_NOTES:
        notes.append("... and more of that kind")
