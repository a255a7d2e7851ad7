"""Requests of `/sim/spawn` and `/sim/set`, read into the world's units and checked against map and catalogue.

Everything here raises before anything has changed. An error names the object's place in the list and the field.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Final

import numpy as np

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.command_parsing import check_lamps
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.catalogue import Catalogue, Model
from rosbridge_sim.simulator.egos.ego import CtrlMode
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, FIRST_FREE_EGO, MAX_FILE_UID
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.road_places import LanePlace, find_lane, place_on_lane
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_SPEED, Gear, Kind

MAX_OBJECTS: Final = 100
"""Objects in one call: drivers on lanes take 0.1 ms each, and other clients are to wait some 10 ms at most."""

MAX_PATHS: Final = 20
"""Objects of one call that have a path, which takes 0.4 ms to lay."""

MAX_POINTS: Final = 2_000
"""Points of paths and links of routes in one call: at most 4 us each."""

MAX_TO_LANE: Final = 3.0
"""A driver starts only this near to the line of a lane [m]: on the lane, or on the next one of usual width."""

MAX_TURN_TO_LANE: Final = math.radians(60.0)
"""A driver starts only with at most this angle between its heading and the lane [rad], as a self-driving ego does."""

FEWEST_POINTS: Final = 2
"""Of a path: where it begins and where it ends."""


class Behaviour(Enum):
    """Way in which an object moves by itself; the values are the words of the wire."""

    STAND = "stand"
    STRAIGHT = "straight"
    PATH = "path"
    LANE = "lane"


class Spot(Record):
    """Place for an object, in the world's units.

    Attributes:
        x, y, z: reference point [m].
        yaw: (-pi, pi] or any other angle [rad].
        lane: row of the lane that was named; None where coordinates were given.
        s: arc length on that lane [m].
        lateral: offset from its line, left positive [m].
    """

    x: float
    y: float
    z: float
    yaw: float
    lane: int | None = None
    s: float = 0.0
    lateral: float = 0.0


class ObjectMotion(Record, eq=False):
    """Motion of an object.

    Attributes:
        behaviour: which way.
        desired_speed: of a driver on lanes; inf for as fast as is allowed [m/s].
        route: rows of lanes that follow one another; empty for none.
        path: (m, 3) waypoints [m]; None without a path.
        is_loop: path or route begin again.
    """

    behaviour: Behaviour
    desired_speed: float = math.inf
    route: tuple[int, ...] = ()
    path: FloatArray | None = None
    is_loop: bool = False


class NewObject(Record, eq=False):
    """One object of `/sim/spawn`.

    Attributes:
        where: its place in the request, for errors.
        model: None for that of the first ego.
        is_ego: it is a further ego.
        ego_index: its number; 0 for the first free one.
        spot: where it stands.
        speed: at the start [m/s].
        motion: how it moves. An ego with STAND or STRAIGHT is driven by commands.
        start_within: it stands until an ego is this near [m]; 0 for at once.
    """

    where: str
    model: Model | None
    is_ego: bool
    ego_index: int
    spot: Spot
    speed: float
    motion: ObjectMotion
    start_within: float


class Change(Record, eq=False):
    """One object of `/sim/set`; None leaves a thing as it is.

    Attributes:
        where: its place in the request, for errors.
        unique_id: which object or ego.
        spot: where it is to stand.
        speed: [m/s].
        motion: how it is to move.
        gear, ctrl_mode: of an ego.
        lamps: of an ego, turn and emergency signal.
    """

    where: str
    unique_id: int
    spot: Spot | None
    speed: float | None
    motion: ObjectMotion | None
    gear: Gear | None
    ctrl_mode: CtrlMode | None
    lamps: tuple[int, int] | None


def check_size(objects: Sequence[Struct]) -> None:
    """Check that a request is done in a few milliseconds.

    Raises:
        FieldError: it has too many objects, paths, or points and links.
    """
    if len(objects) > MAX_OBJECTS:
        raise FieldError(f"objects: expected at most {MAX_OBJECTS} in one call, got {len(objects):,}")
    num_paths = sum(len(each.path) > 0 for each in objects)
    if num_paths > MAX_PATHS:
        raise FieldError(f"objects: expected at most {MAX_PATHS} with a path in one call, got {num_paths}")
    num_points = sum(len(each.path) + len(each.route) for each in objects)
    if num_points > MAX_POINTS:
        text = f"at most {MAX_POINTS:,} points of paths and links of routes in one call"
        raise FieldError(f"objects: expected {text}, got {num_points:,}")


def read_new_object(message: Struct, where: str, roads: Roads, catalogue: Catalogue) -> NewObject:
    """Read a SpawnObject.

    Args:
        where: its place in the request, for errors.
        catalogue: the models that clients name.

    Raises:
        FieldError: names the field, what was expected and what came.
    """
    model = _read_model(message, where, catalogue)
    is_ego = bool(message.is_ego)
    if is_ego and model is not None and not can_be_ego(model):
        raise FieldError(f"{where}.model: expected a vehicle with an engine for an ego, got {model.name!r}")
    index = int(message.ego_index)
    if index != 0 and not (is_ego and FIRST_FREE_EGO <= index <= MAX_FILE_UID):
        expected = f"{FIRST_FREE_EGO}..{MAX_FILE_UID} or 0" if is_ego else "0 without is_ego"
        raise FieldError(f"{where}.ego_index: expected {expected}, got {index}")
    kind = Kind.EGO if is_ego or model is None else model.kind
    speed = _speed(message.speed, f"{where}.speed")
    motion = _read_motion(message, where, roads, kind, speed)
    spot = _read_spot(message.place, f"{where}.place", roads)
    start_within = within(message.start_within, 0.0, MAX_COORDINATE, f"{where}.start_within", "m")
    is_plain = motion.behaviour in {Behaviour.STRAIGHT, Behaviour.PATH} and kind is not Kind.EGO
    if start_within > 0.0 and not is_plain:
        raise FieldError(f"{where}.start_within: expected 0 m but for straight and path, got {start_within:g}")
    return NewObject(where, model, is_ego, index, spot, speed, motion, start_within)


def read_change(message: Struct, where: str, roads: Roads, kind: Kind) -> Change:
    """Read an ObjectState. Fields whose flag is not set are not looked at.

    Args:
        where: its place in the request, for errors.

    Raises:
        FieldError: names the field, what was expected and what came.
    """
    speed = _speed(message.speed, f"{where}.speed") if message.set_speed else None
    change = Change(
        where=where,
        unique_id=FIRST_EGO if message.unique_id == -1 else message.unique_id,
        spot=_read_spot(message.place, f"{where}.place", roads) if message.set_place else None,
        speed=speed,
        motion=_read_motion(message, where, roads, kind, speed) if message.set_behaviour else None,
        gear=_read_gear(message.gear, where) if message.set_gear else None,
        ctrl_mode=_read_ctrl_mode(message.ctrl_mode, where) if message.set_ctrl_mode else None,
        lamps=_read_lamps(message, where) if message.set_lamps else None,
    )
    if kind is not Kind.EGO and (change.gear, change.ctrl_mode, change.lamps) != (None, None, None):
        raise FieldError(f"{where}: only an ego has gear, ctrl_mode and lamps; {change.unique_id} is none")
    if kind is Kind.EGO and change.motion is not None:
        if change.motion.behaviour is not Behaviour.LANE:
            text = "an ego drives by commands, or along lanes by lane"
            raise FieldError(f"{where}.behaviour: {text}; got {change.motion.behaviour.value}")
        if change.ctrl_mode not in {None, CtrlMode.AUTONOMOUS}:
            raise FieldError(f"{where}.ctrl_mode: expected 6 with behaviour lane, got {message.ctrl_mode}")
    return change


def take_lane(roads: Roads, spot: Spot, route: Sequence[int], where: str) -> tuple[int, float]:
    """Return the lane that a driver at a spot keeps to, and the arc length on it [m].

    Args:
        spot: where the driver stands.
        route: rows of lanes; the first one is its lane. Empty for none.
        where: the object's place in the request, for errors.

    Raises:
        FieldError: it stands on no lane, on another one than its route's first, or across it.
    """
    if spot.lane is not None:
        if route and route[0] != spot.lane:
            expected = roads.ids[spot.lane]
            raise FieldError(f"{where}.route[0]: expected {expected!r}, where it starts, got {roads.ids[route[0]]!r}")
        near: LanePlace | None = LanePlace(
            spot.lane, spot.s, spot.lateral, abs(spot.lateral), float(roads.at(spot.lane, spot.s)[1][0])
        )
    elif route:
        near = place_on_lane(roads, route[0], spot.x, spot.y, MAX_TO_LANE)
    else:
        near = find_lane(roads, spot.x, spot.y, spot.yaw, spot.z)
    here = f"({spot.x:g}, {spot.y:g})"
    expected = f"a place within {MAX_TO_LANE:g} m of a lane's line"
    if near is None and route:
        raise FieldError(f"{where}.place: expected {expected}, that of {roads.ids[route[0]]!r}, for lane; got {here}")
    if near is None or near.distance > MAX_TO_LANE:
        away = "the map has no lanes" if near is None else f"{here}, {near.distance:.1f} m from one"
        raise FieldError(f"{where}.place: expected {expected} for lane; got {away}")
    turn = abs(math.remainder(near.yaw - spot.yaw, math.tau))
    if turn > MAX_TURN_TO_LANE:
        text = f"at most {math.degrees(MAX_TURN_TO_LANE):.0f} deg from the lane's {math.degrees(near.yaw):.0f} deg"
        raise FieldError(f"{where}.place.heading_deg: expected {text} for lane, got {math.degrees(turn):.0f} deg")
    return near.lane, near.s


def can_be_ego(model: Model) -> bool:
    """Return whether a model has all that an ego needs."""
    body = model.body
    return model.kind is Kind.VEHICLE and min(body.wheelbase, body.max_accel, body.max_decel) > 0.0


def find_link(roads: Roads, link: str, where: str) -> int:
    """Return the row of the lane that a client names.

    Args:
        where: the field, for errors.

    Raises:
        FieldError: there is none.
    """
    try:
        return roads.row(link)
    except KeyError:
        near = hint(link[:80], roads.ids[:MAX_HINTED]) if len(roads) <= MAX_HINTED else ""
        raise FieldError(f"{where}: the map has no link {link[:80]!r}{near}") from None


MAX_HINTED: Final = 1_000
"""Links that are compared with a wrong name at most: more would take longer than an answer may."""


# The parts


def _read_model(message: Struct, where: str, catalogue: Catalogue) -> Model | None:
    if message.model:
        model = catalogue.find(message.model)
        if model is None:
            name = message.model[:80]
            raise FieldError(f"{where}.model: the catalogue has no model {name!r}{catalogue.suggest(name)}")
        return model
    if message.data_id:
        kinds = (Kind.VEHICLE,) if message.is_ego else (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE)
        models = [catalogue.of_data_id(message.data_id, kind) for kind in kinds]
        model = next((each for each in models if each is not None), None)
        if model is None:
            raise FieldError(f"{where}.data_id: the catalogue has no model {message.data_id}; /sim/catalogue lists all")
        return model
    if not message.is_ego:
        raise FieldError(f"{where}.model: expected a name of the catalogue, or a data_id; /sim/catalogue lists all")
    return None


def _read_spot(place: Struct, where: str, roads: Roads) -> Spot:
    heading = within(place.heading_deg, -MAX_COORDINATE, MAX_COORDINATE, f"{where}.heading_deg", "deg")
    heading = math.radians(math.remainder(heading, 360.0))
    if not place.link:
        x, y, z = (
            within(getattr(place, axis), -MAX_COORDINATE, MAX_COORDINATE, f"{where}.{axis}", "m") for axis in "xyz"
        )
        return Spot(x, y, z, heading)
    lane = find_link(roads, place.link, f"{where}.link")
    length = float(roads.length[lane])
    s = within(place.distance, 0.0, length, f"{where}.distance", f"m, the length of {place.link[:80]!r}")
    lateral = within(place.lateral, -MAX_COORDINATE, MAX_COORDINATE, f"{where}.lateral", "m")
    points, yaws = roads.at(lane, s)
    (x, y, z), yaw = points[0].tolist(), float(yaws[0])
    return Spot(
        x - lateral * math.sin(yaw), y + lateral * math.cos(yaw), z, yaw + heading, lane=lane, s=s, lateral=lateral
    )


def _read_motion(message: Struct, where: str, roads: Roads, kind: Kind, speed: float | None) -> ObjectMotion:
    behaviour = _read_behaviour(message, where, speed)
    is_lane, is_path = behaviour is Behaviour.LANE, behaviour is Behaviour.PATH
    for field, is_given, fits in (
        ("route", len(message.route) > 0, is_lane),
        ("path", len(message.path) > 0, is_path),
        ("desired_speed", message.desired_speed != 0.0, is_lane),
        ("loop", message.loop, is_path or (is_lane and len(message.route) > 0)),
    ):
        if is_given and not fits:
            raise FieldError(f"{where}.{field}: behaviour {behaviour.value} has no use for it; expected none")
    if is_lane and kind not in {Kind.EGO, Kind.VEHICLE}:
        raise FieldError(f"{where}.behaviour: only vehicles keep to lanes; this is a {kind.name.lower()}")
    if is_path and kind is Kind.EGO:
        raise FieldError(f"{where}.behaviour: an ego follows no path; expected stand, straight or lane")
    if speed is not None and behaviour is Behaviour.STAND and speed != 0.0:
        raise FieldError(f"{where}.speed: expected 0 m/s with behaviour stand, got {speed:g}")
    if speed is not None and speed < 0.0 and behaviour is not Behaviour.STRAIGHT:
        raise FieldError(f"{where}.speed: expected 0 m/s or more with behaviour {behaviour.value}, got {speed:g}")
    desired_speed = within(message.desired_speed, 0.0, MAX_SPEED, f"{where}.desired_speed", "m/s") or math.inf
    route = _read_route(message, where, roads)
    return ObjectMotion(
        behaviour, desired_speed, route, _read_path(message, where) if is_path else None, bool(message.loop)
    )


def _read_behaviour(message: Struct, where: str, speed: float | None) -> Behaviour:
    if message.behaviour:
        try:
            return Behaviour(message.behaviour)
        except ValueError:
            words = [each.value for each in Behaviour]
            near = hint(message.behaviour[:80], words)
            text = f"expected one of {', '.join(words)}, got {message.behaviour[:80]!r}{near}"
            raise FieldError(f"{where}.behaviour: {text}") from None
    if len(message.path):
        return Behaviour.PATH
    if len(message.route):
        return Behaviour.LANE
    if speed is None:  # a change without a speed: nothing says what it is to be
        raise FieldError(f"{where}.behaviour: expected one of {', '.join(each.value for each in Behaviour)}, got none")
    return Behaviour.STRAIGHT if speed != 0.0 else Behaviour.STAND


def _read_route(message: Struct, where: str, roads: Roads) -> tuple[int, ...]:
    rows = [find_link(roads, link, f"{where}.route[{i}]") for i, link in enumerate(message.route)]
    steps = [*rows, *rows[:1]] if message.loop else rows
    for i in range(1, len(steps)):
        if steps[i] not in roads.successors(steps[i - 1]):
            there, here = roads.ids[steps[i]], roads.ids[steps[i - 1]]
            raise FieldError(f"{where}.route[{i % len(rows)}]: {there!r} does not follow {here!r}")
    return tuple(rows)


def _read_path(message: Struct, where: str) -> FloatArray:
    points = np.array([(point.x, point.y, point.z) for point in message.path], dtype=np.float64).reshape(-1, 3)
    if len(points) < FEWEST_POINTS:
        raise FieldError(f"{where}.path: expected {FEWEST_POINTS} points or more, got {len(points)}")
    wild = np.flatnonzero(~(np.abs(points) <= MAX_COORDINATE).all(axis=1))
    if len(wild):
        raise FieldError(f"{where}.path[{wild[0]}]: expected numbers within +-{MAX_COORDINATE:g} m")
    return points


def _read_gear(number: int, where: str) -> Gear:
    try:
        return Gear(number)
    except ValueError:
        raise FieldError(f"{where}.gear: expected 1 (P), 2 (R), 3 (N) or 4 (D), got {number}") from None


def _read_ctrl_mode(number: int, where: str) -> CtrlMode:
    try:
        return CtrlMode(number)
    except ValueError:
        expected = ", ".join(f"{mode.value} ({mode.name.lower()})" for mode in CtrlMode)
        raise FieldError(f"{where}.ctrl_mode: expected {expected}, got {number}") from None


def _read_lamps(message: Struct, where: str) -> tuple[int, int]:
    turn, emergency = message.turn_signal, message.emergency_signal
    return check_lamps((f"{where}.turn_signal", turn), (f"{where}.emergency_signal", emergency))


def _speed(value: float, where: str) -> float:
    return within(value, -MAX_SPEED, MAX_SPEED, where, "m/s")


def within(value: float, low: float, high: float, where: str, unit: str) -> float:
    """Return a number that lies within bounds.

    Raises:
        FieldError: it does not, or is none.
    """
    if not low <= value <= high:
        raise FieldError(f"{where}: expected {low:g}..{high:g} {unit}, got {value:g}")
    return value
