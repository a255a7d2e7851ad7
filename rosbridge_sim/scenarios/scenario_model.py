"""The shape of scenario documents: the part of MORAI's scenario JSON that is read, key by key.

Keys that these models name are read. All other keys that MORAI writes (physical state, editor state) are ignored. Of
the read keys, those `WithoutEffect` have no effect yet: they are kept as they are written. Five keys are ours.
Three are for users who write scenarios by hand and do not know MORAI's numbers and ids: `modelName`, a name of the
catalogue instead of `DataID`; `pathName`, the name of a path instead of the item's `UNIQUEID`; `route`, the links that
a vehicle follows. The fourth is `yields`: the item stops for what is ahead on its path. The fifth is `rosbridge_sim`, a
block of `event_model`.
`schemas/scenario.schema.json` is generated from this module.
"""

# ruff: noqa: N815  # the document's own spelling

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Final, TypeVar

from msgspec import Meta

from rosbridge_sim.documents.document_model import (
    MAX_DOCUMENT_COORDINATE,
    Coordinate,
    Document,
    DocumentType,
    KeptAsWritten,
    LenientBool,
    Mistake,
    Number,
    Ratio,
    Whole,
    WithoutEffect,
    about,
    keys_beside,
    number_within,
    sort_keys,
    text_within,
)
from rosbridge_sim.documents.document_reading import find_mistakes, read_document
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.scenarios.event_model import ItemBlock, ScenarioBlock, VehicleBlock
from rosbridge_sim.suggestions import hint

UNTIL_EVENT: Final = 1e-6
"""`Spawn.start_within` of an item that waits for its event: no ego is ever so near [m]."""

MAX_SCENARIO_BYTES: Final = 1 << 25
"""Largest size of a document: 32 MiB, a hundred times the size that MORAI saves for a full scene."""

MAX_ITEMS: Final = 1_000
"""Largest number of pedestrians, of obstacles and of spawn points."""

MAX_VEHICLES: Final = 10_000
"""Largest number of vehicles: what one step is made for. Beyond 1,000 the map must have room; see the reader."""

MAX_PATHS: Final = 3 * MAX_ITEMS
MAX_WAYPOINTS: Final = 100_000
MAX_SCENARIO_TEXT: Final = 200

T = TypeVar("T")

ShortText = Annotated[str, text_within(MAX_SCENARIO_TEXT)]
Speed = Annotated[float, number_within(-1_000.0, 1_000.0)]
BoundedList = Annotated[list[T], Meta(max_length=MAX_ITEMS)]


ActiveDistance = Annotated[Coordinate | None, about("stands until an ego is this near [m]; 0 or less: starts at once")]


class EnuPosition(Document, frozen=True, kw_only=True):
    """A position on the map: metres east, north and up of its origin."""

    other_keys: ClassVar[frozenset[str]] = frozenset({"_x", "_y", "_z"})

    x: Coordinate
    y: Coordinate
    z: Coordinate = 0.0

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        """Use the text `_x` where the number `x` is missing, because MORAI writes each number twice."""
        if not isinstance(value, dict):
            return value
        texts = {key: value["_" + key] for key in "xyz" if value.get(key) is None and value.get("_" + key) is not None}
        return {**value, **texts}


class Rotation(Document, frozen=True, kw_only=True):
    """Heading, roll and pitch; MORAI's angles may be larger than a full turn."""

    yaw: Annotated[Number, about("degrees counter-clockwise from east")] = 0.0
    roll: Annotated[Number, about("degrees")] = 0.0
    pitch: Annotated[Number, about("degrees")] = 0.0


class Scale(Document, frozen=True, kw_only=True):
    """Size of a thing relative to its model, in the engine's axes of the thing itself."""

    x: Annotated[Number, about("of its width")] = 1.0
    y: Annotated[Number, about("of its height")] = 1.0
    z: Annotated[Number, about("of its length")] = 1.0


class InitPosition(Document, frozen=True, kw_only=True):
    """Start of a vehicle: a position, or a place along a link of the map."""

    initPositionMode: Annotated[ShortText, about('"Absolute": pos and rot; "Link": initLink')] = "Absolute"
    pos: EnuPosition | None = None
    rot: Rotation | None = None
    initLink: Annotated[ShortText | None, about("id of a link of the map")] = None
    initLinkRatio: Annotated[Ratio | None, about("0 at the link's start, 1 at its end")] = None
    gear: Annotated[Whole | None, about("of an ego; 1 P, 2 R, 3 N, 4 D")] = None


class PlacedItem(Document, frozen=True, kw_only=True):
    """Keys of every agent."""

    UNIQUEID: Annotated[Whole | None, about("its id; without one it gets the next free one")] = None
    DataID: Annotated[Whole | None, about("MORAI's number of the model")] = None
    modelName: Annotated[ShortText | None, about("name of the model, used instead of DataID (ours)")] = None


class EgoVehicle(PlacedItem, frozen=True, kw_only=True):
    """The car that clients drive. UNIQUEID -1, as in MORAI's files, is the first ego: 0 on the wire."""

    initPosition: InitPosition
    gear: Annotated[Whole | None, about("used if initPosition has none; D if both are absent")] = None
    currentVelocity: Annotated[Speed | None, about("speed at the start [km/h]")] = None


class Follower(PlacedItem, frozen=True, kw_only=True):
    """An agent that may follow a path of waypointDataList."""

    isWaypointMode: Annotated[
        LenientBool | None, about("false: the path is not followed; true without waypoints: it stands")
    ] = None
    pathName: Annotated[
        ShortText | None, about("name of its path (ours); without it, the path whose name ends in ' - UNIQUEID'")
    ] = None


Yields = Annotated[
    LenientBool | None,
    about("true: it stops for what is ahead on its path; a pedestrian crosses by light or gap (ours)"),
]


class NpcVehicle(Follower, frozen=True, kw_only=True):
    """A vehicle: on a path at constant speed; without a path, on the lanes as a driver; otherwise straight ahead.

    It follows the lanes if it starts on a link. It also does so if it stands on a lane and `isWaypointMode` is false,
    or is absent while `currentLinkInfo` or `startPointLinkInfo` holds a link.
    """

    initPosition: InitPosition
    velocityType: Annotated[
        Whole | None, about("1: linkVelocity, on lanes the speed limit; 2: desiredVelocity, on lanes its highest speed")
    ] = None
    desiredVelocity: Annotated[Speed | None, about("its own cruise speed [km/h]")] = None
    constantVelocity: Annotated[Speed | None, about("cruise speed if desiredVelocity is absent or 0 [km/h]")] = None
    linkVelocity: Annotated[Speed | None, about("[km/h]")] = None
    currentVelocity: Annotated[Speed | None, about("speed at the start, on lanes [km/h]")] = None
    isCloseLoop: Annotated[LenientBool | None, about("the path or route begins again at its end")] = None
    route: Annotated[
        Annotated[list[ShortText], Meta(max_length=MAX_WAYPOINTS)] | None,
        about("ids of links, from its first link on (ours); after them random"),
    ] = None
    activeDistance: ActiveDistance = None
    yields: Yields = None
    rosbridge_sim: Annotated[VehicleBlock | None, about("when it starts, and events (ours)")] = None
    startPointLinkInfo: KeptAsWritten = None
    currentLinkInfo: KeptAsWritten = None
    isLaneChange: Annotated[
        JsonValue, about("false: on lanes it never changes them; absent or any other value: it may")
    ] = None
    latBiasMode: WithoutEffect = None
    latBias: Annotated[
        JsonValue, about("offset from the line of its lane, left positive, -5..5; other values count as 0 [m]")
    ] = None
    spawnPointUniqueID: WithoutEffect = None
    destinationUniqueID: WithoutEffect = None
    destinationMode: WithoutEffect = None
    endPointLinkInfo: WithoutEffect = None


class Pedestrian(Follower, frozen=True, kw_only=True):
    """A pedestrian: walks along its path; without a path, movingDistance straight ahead; otherwise straight ahead."""

    pos: EnuPosition
    rot: Rotation | None = None
    speed: Annotated[Speed | None, about("[km/h]")] = None
    loop: Annotated[LenientBool | None, about("at the end it begins again, or walks back")] = None
    movingDistance: Annotated[Coordinate | None, about("[m]")] = None
    activeDistance: ActiveDistance = None
    yields: Yields = None
    rosbridge_sim: Annotated[ItemBlock | None, about("when it starts (ours)")] = None
    active: WithoutEffect = None


class Obstacle(Follower, frozen=True, kw_only=True):
    """A thing that stands, or moves along its path."""

    pos: EnuPosition
    rot: Rotation | None = None
    moveSpeed: Annotated[Speed | None, about("[km/h]")] = None
    activeDistance: ActiveDistance = None
    rosbridge_sim: Annotated[ItemBlock | None, about("when it starts (ours)")] = None
    scale: Annotated[Scale | None, about("of the model's size")] = None


class LinkInfo(Document, frozen=True, kw_only=True):
    """A place on a link of the map."""

    linkIdx: Annotated[ShortText | None, about("id of the link")] = None
    pointIdx: Annotated[Whole | None, about("number of the point of the link, from 0")] = None


Seconds = Annotated[float, number_within(0.0, 1e6)] | None
Kmh = Annotated[float, number_within(0.0, 1_000.0)] | None
Count = Annotated[int, number_within(0, 2**31 - 1)]


class SpawnPointItem(Document, frozen=True, kw_only=True):
    """A point where vehicles appear, drive along the lanes to their destination, and leave there."""

    UNIQUEID: Annotated[Whole | None, about("its id, for the destinations of other points")] = None
    modelName: Annotated[ShortText | None, about("name of the model of its vehicles (ours)")] = None
    spawnVehicleTypeID: Annotated[Whole | None, about("MORAI's number of the model; -1: random")] = None
    pos: Annotated[EnuPosition | None, about("used if startLinkInfo names no link of the map")] = None
    startLinkInfo: Annotated[LinkInfo | None, about("where vehicles appear")] = None
    endLinkInfo: Annotated[LinkInfo | None, about("where they leave; without it they turn at random")] = None
    destinationObjUniqueID: Annotated[
        Whole | None, about("id of the spawn point where they leave, if endLinkInfo names no link")
    ] = None
    maximumSpawnVehicle: Annotated[Count | None, about("its vehicles in the world at the same time, at most 999")] = (
        None
    )
    minSpawnPeriod: Annotated[Seconds, about("least time between two vehicles [s]; 5 if both are absent")] = None
    maxSpawnPeriod: Annotated[Seconds, about("greatest time [s]; 10 if both are absent")] = None
    waitSpawnTime: Annotated[Seconds, about("time until the first vehicle [s]; else a period")] = None
    SpawnVelocityType: Annotated[Whole | None, about("2: Min/MaxSpawnVelocity_Custom; else the link's speed")] = None
    MinSpawnVelocity_Custom: Annotated[Kmh, about("least speed at the start [km/h]")] = None
    MaxSpawnVelocity_Custom: Annotated[Kmh, about("greatest speed at the start [km/h]")] = None
    DesiredVelocityType: Annotated[Whole | None, about("2: Min/MaxDesiredVelocity_Custom; else the link's speed")] = (
        None
    )
    MinDesiredVelocity_Custom: Annotated[Kmh, about("least cruise speed [km/h]")] = None
    MaxDesiredVelocity_Custom: Annotated[Kmh, about("greatest cruise speed [km/h]")] = None
    SafetyDist: Annotated[
        Annotated[float, number_within(0.0, MAX_DOCUMENT_COORDINATE)] | None,
        about("room before and behind a new vehicle [m]; 5 if absent"),
    ] = None
    TTC: Annotated[Seconds, about("least time to a collision of a new vehicle [s]; 1 if absent")] = None
    isLaneChange: Annotated[
        JsonValue, about("false: its vehicles never change lanes; absent or any other value: they may")
    ] = None
    latBiasMode: Annotated[
        JsonValue, about("2: offsets have a bell-shaped distribution between both bounds; else the middle")
    ] = None
    MinLatBias: Annotated[
        JsonValue, about("least offset from the line of the lane, left positive, -5..5; other values count as 0 [m]")
    ] = None
    MaxLatBias: Annotated[JsonValue, about("greatest offset [m]")] = None
    listVehicleLengthType: WithoutEffect = None
    isCloseLoop: WithoutEffect = None
    isSpawning: WithoutEffect = None
    spawnedVehiclesCount: WithoutEffect = None
    DestinationMode: WithoutEffect = None
    NPCSpawnType: WithoutEffect = None


class EnginePosition(Document, frozen=True, kw_only=True):
    """Position of a waypoint in the engine's axes: x west, y up, z south [m]."""

    x: Coordinate
    y: Coordinate = 0.0
    z: Coordinate


class Waypoint(Document, frozen=True, kw_only=True):
    """A point of a path."""

    pos: EnginePosition


class WaypointPath(Document, frozen=True, kw_only=True):
    """A path of waypoints, for the items that name it."""

    pathName: Annotated[ShortText, about('any name; "... - 7" is the path of the item with UNIQUEID 7')]
    waypointData: Annotated[list[Waypoint], Meta(max_length=MAX_WAYPOINTS)]


class IntersectionState(Document, frozen=True, kw_only=True):
    """Phase of an intersection at the start."""

    index: Annotated[ShortText, about("index of its controller among the map's, from 0; any other text is its id")]
    state: Annotated[Whole, about("number of the phase, from 0")] = 0
    deltaTime: Annotated[Annotated[float, number_within(0.0, 1e12)] | None, about("time since the phase began [s]")] = (
        None
    )


class MapInfo(Document, frozen=True, kw_only=True):
    """The map of the scenario."""

    mapName: ShortText | None = None


class ScenarioDocument(Document, frozen=True, kw_only=True):
    """A scenario: the part of MORAI's scenario files that rosbridge_sim reads. Other keys are ignored."""

    mapInfo: MapInfo | None = None
    egoVehicle: EgoVehicle | None = None
    vehicleList: Annotated[list[NpcVehicle], Meta(max_length=MAX_VEHICLES)] | None = None
    pedestrianList: BoundedList[Pedestrian] | None = None
    objectList: BoundedList[Obstacle] | None = None
    waypointDataList: Annotated[list[WaypointPath], Meta(max_length=MAX_PATHS)] | None = None
    tlList: Annotated[list[IntersectionState], Meta(max_length=MAX_PATHS)] | None = None
    spawnPointList: BoundedList[SpawnPointItem] | None = None
    rosbridge_sim: Annotated[ScenarioBlock | None, about("events of lights (ours)")] = None
    pedspawnPointList: WithoutEffect = None
    frictionChangeMaterialList: WithoutEffect = None
    shadedAreaList: WithoutEffect = None


SCENARIO: Final = DocumentType[ScenarioDocument](ScenarioDocument)


def read_scenario_document(text: bytes, source: str) -> ScenarioDocument:
    """Read and check a scenario document.

    Args:
        text: the file's bytes.
        source: its name, for errors.

    Raises:
        DocumentError: one line: place, expected value, actual value.
    """
    return read_document(SCENARIO, text, source, MAX_SCENARIO_BYTES)


def find_scenario_mistakes(text: bytes, source: str) -> list[Mistake]:
    """Return all values of a scenario document that do not fit.

    Args:
        text: the file's bytes.
        source: its name, for errors.

    Returns:
        The mistakes, in the document's order.
    """
    return find_mistakes(SCENARIO, text, source, MAX_SCENARIO_BYTES)


def why_without_effect(path: Sequence[str | int]) -> str:
    """Return why nothing reads a place of scenario documents; an empty text if it is read.

    Args:
        path: keys, and indices of lists.
    """
    value: Any = None
    for part in reversed(path):
        value = [value] if isinstance(part, int) else {part: value}
    keys = sort_keys(ScenarioDocument, value)
    for place in keys.passed_over:
        known = keys_beside(ScenarioDocument, place)
        return f"expected one of {', '.join(known)}{hint(place.rpartition('.')[2], known)}"
    return "this key has no effect yet" if keys.idle else ""


def start_distance(item: NpcVehicle | Pedestrian | Obstacle) -> float:
    """Return how near an ego must be before an item starts [m]; 0 for at once."""
    block: ItemBlock = item.rosbridge_sim or ItemBlock()
    if block.start_when is not None:
        return UNTIL_EVENT
    return max(item.activeDistance or 0.0, 0.0) if block.start_within is None else block.start_within


def blocks_of(document: ScenarioDocument) -> Iterator[tuple[str, ItemBlock | ScenarioBlock]]:
    """Yield the blocks of a document, by the places of their items; that of the whole document has none."""
    if document.rosbridge_sim is not None:
        yield "", document.rosbridge_sim
    for key in ("vehicleList", "pedestrianList", "objectList"):
        items: list[NpcVehicle | Pedestrian | Obstacle] = getattr(document, key) or []
        for number, item in enumerate(items):
            if item.rosbridge_sim is not None:
                yield f"{key}[{number}]", item.rosbridge_sim
