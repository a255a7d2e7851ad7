"""The actors of a story: where they are on lanes and in the map frame, and how they move by default.

An actor is moved by the story (a ghost that this module places), by the user's program (the ego), or by a driver of the
world (lane following). By default an actor of the story keeps its speed and its offset from the line of its lane. Where
it moves sideways, its way is the hypotenuse, so its speed is what the story says.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import compress
from typing import Final

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.openscenario.places import MapPlace, OnLane, StoryMap
from rosbridge_sim.world.drivers.lane_position import MAX_LATERAL, LaneStart, keep_lanes
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.lane_changes.lane_change_motion import shift
from rosbridge_sim.world.state.placement import place_ghost, show_ghosts, teleport
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_SPEED, Body, Kind, World

STORY: Final = "story"
PROGRAM: Final = "program"
DRIVER: Final = "driver"
MODES: Final = frozenset({STORY, PROGRAM, DRIVER})

STANDS: Final = 0.01
"""A lower speed counts as standing [m/s]."""

ON_LINE: Final = 0.01
"""An offset that differs by less from that of the driver is the driver's [m]."""

STORY_STEP: Final = 0.05
"""Length of a step of a story [s]: that of the runs of esmini and CARLA that files are written and checked with."""

POSE: Final = ("x", "y", "z", "roll", "pitch", "yaw", "speed")
"""Figures of an actor that change evenly within a step."""

_COLUMNS: Final = (*POSE, "accel", "yaw_rate")
_YAW, _SPEED = POSE.index("yaw"), POSE.index("speed")


@dataclass(slots=True)
class StoryActor:
    """An entity of a story.

    Attributes:
        uid: id in the world; -1 while it is not there.
        mode: what moves it: STORY, PROGRAM or DRIVER.
        lane, s, offset, turned: where it is on a lane, see `OnLane`.
        x, y, z, yaw, roll, pitch: where it is in the map frame [m, rad].
        speed, way_speed: along its heading, and with which it moves in this step [m/s].
        told_speed: the speed that an action has given it last; None before [m/s].
        accel: [m/s^2].
        aside: speed to the left of its lane [m/s].
        travelled: way since the start [m].
        still, at_end, off_road: for how long it stands, is at the end of a road, is on no lane [s].
        route: rows of lanes that it takes where lanes fork.
        waiting: the speed that it will have when an ego is near; None if it does not wait [m/s].
        is_placed: an action has placed it in this step.
        shown: its `POSE` at the begin of the step; empty unless the story moves it.
        is_changing_lane: from the end of this step on it follows the line of the lane that it is on then.
        is_lane_old: the world has moved it since its place on a lane was looked up, see `StoryActors.on_lane`.
    """

    uid: int = -1
    mode: str = STORY
    lane: int = -1
    s: float = 0.0
    offset: float = 0.0
    turned: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    speed: float = 0.0
    way_speed: float | None = None
    told_speed: float | None = None
    accel: float = 0.0
    aside: float = 0.0
    travelled: float = 0.0
    still: float = 0.0
    at_end: float = 0.0
    off_road: float = 0.0
    route: tuple[int, ...] = ()
    waiting: float | None = None
    is_placed: bool = False
    shown: list[float] = field(default_factory=list)
    is_changing_lane: bool = False
    is_lane_old: bool = False

    @property
    def place(self) -> MapPlace:
        """Return its place in the map frame."""
        return MapPlace(self.x, self.y, self.z, self.yaw, self.roll, self.pitch)

    @property
    def lane_place(self) -> OnLane:
        """Return its place on a lane."""
        return OnLane(self.lane, self.s, self.offset, self.turned)

    @property
    def direction(self) -> float:
        """1 if it drives along its lane, -1 against it."""
        return -1.0 if math.cos(self.turned) < 0.0 else 1.0


class StoryActors:
    """The actors of a story in a world.

    Attributes:
        bodies: by name.
        touching: ids of the entities that each one has touched since the last step.
    """

    def __init__(
        self,
        world: World,
        story_map: StoryMap,
        actors: Mapping[str, StoryActor],
        bodies: Mapping[str, Body],
        holds: Mapping[str, tuple[float, float]],
    ) -> None:
        """Take the actors.

        Args:
            holds: by name, how near an ego is when an actor begins to move, and its longest way; 0 for none [m].
        """
        self.world, self.map, self.by_name, self.bodies = world, story_map, actors, bodies
        self._holds = holds
        self.touching: dict[int, list[int]] = {}
        self._offsets: dict[str, float] = {}
        self._moved: tuple[list[StoryActor], FloatArray, FloatArray, FloatArray] | None = None

    def find(self, name: str) -> StoryActor:
        """Return an actor that is in the world.

        Raises:
            DocumentError: it is not.
        """
        actor = self.by_name[name]
        if actor.uid < 0:
            raise DocumentError(f"{printable(name, 60)} is not in the world")
        return actor

    def on_lane(self, name: str) -> StoryActor:
        """Return an actor with its present place on a lane; errors as for `find`.

        The lane of an actor that the world moves is looked up when it is asked for, because that takes 0.06 ms.
        """
        actor = self.find(name)
        if actor.is_lane_old:
            self.take_lane(actor)
        return actor

    def locate(self, name: str) -> tuple[MapPlace, OnLane]:
        """Return where an actor is; errors as for `find`."""
        actor = self.on_lane(name)
        return actor.place, actor.lane_place

    def put(self, actor: StoryActor, place: MapPlace) -> None:
        """Put an actor at a place, and onto the lane there."""
        yaw = math.remainder(place.yaw, math.tau)
        actor.x, actor.y, actor.z, actor.yaw = place.x, place.y, place.z, yaw
        actor.roll, actor.pitch = math.remainder(place.roll, math.tau), math.remainder(place.pitch, math.tau)
        self.take_lane(actor)
        actor.at_end = 0.0

    def read(self, actor: StoryActor) -> None:
        """Take place and speed of an actor from the world."""
        for axis in POSE:
            setattr(actor, axis, getattr(self.world, axis).item(self.world.row(actor.uid)))
        self.take_lane(actor)

    def take_lane(self, actor: StoryActor) -> None:
        """Note the lane that an actor is on, by its place."""
        on = self.map.project(actor.place)
        actor.lane, actor.s, actor.offset, actor.turned = on.lane, on.s, on.offset, on.turned
        actor.is_lane_old = False

    def show(self, actor: StoryActor) -> None:
        """Write place and speed of an actor into the world, outside of a step."""
        row = self.world.row(actor.uid)
        pose = {axis: getattr(actor, axis) for axis in ("x", "y", "z", "yaw", "roll", "pitch")}
        speed = max(-MAX_SPEED, min(MAX_SPEED, actor.speed))
        (teleport if actor.mode == PROGRAM else place_ghost)(self.world, row, **pose, speed=speed)

    def hand_over(self, actor: StoryActor, driver: LaneStart | None = None) -> None:
        """Have a driver of the world drive a vehicle along the lanes; an ego, or one off the lanes, stays as it is.

        Args:
            driver: how it drives; its own speed and route if there is none. Of the route the rest is driven, if the
                vehicle is on it. Lane and place are those that the actor has.
        """
        row, world = self.world.row(actor.uid), self.world
        if actor.lane < 0 or world.kind[row] != Kind.VEHICLE or abs(actor.turned) > math.pi / 4:
            return
        driver = driver or LaneStart(row, actor.lane, actor.s, max(actor.speed, STANDS), actor.route)
        at = driver.route.index(actor.lane) if actor.lane in driver.route else len(driver.route)
        route = driver.route[at:] + (driver.route[:at] if driver.is_loop and at < len(driver.route) else ())
        offset = max(-MAX_LATERAL, min(MAX_LATERAL, actor.offset))
        lateral = driver.lateral if abs(offset - driver.lateral) < ON_LINE else offset
        teleport(world, row, x=actor.x, y=actor.y, z=actor.z, yaw=actor.yaw, speed=max(actor.speed, 0.0))
        place = {"lane": actor.lane, "s": actor.s, "lateral": lateral}
        keep_lanes(world, [replace(driver, **place, route=route, is_loop=driver.is_loop and bool(route))])
        world.lateral_bias[row] = driver.lateral
        shift(world, np.array([row]), np.array([driver.lateral]))
        actor.mode = DRIVER

    def observe(self, later: float, touched: Iterable[tuple[int, int]], *, minds_lanes: bool) -> None:
        """Look where those actors are that the story does not move, and which of all stand still.

        Args:
            later: from the world's last frame to the step that begins; they go on until then [s].
            touched: ids of the pairs that have touched since the last step.
            minds_lanes: look as well which of all are off the lanes.
        """
        world = self.world
        self.touching.clear()
        for one, other in touched:
            self.touching.setdefault(one, []).append(other)
            self.touching.setdefault(other, []).append(one)
        for actor in self.by_name.values():
            actor.uid = actor.uid if actor.uid in world else -1
        there = {name: actor for name, actor in self.by_name.items() if actor.uid >= 0}
        moved = [actor for actor in there.values() if actor.mode != STORY]
        rows = [world.row(actor.uid) for actor in moved]
        poses = np.array([getattr(world, column)[rows] for column in (*POSE, "accel")])
        way, yaw = later * poses[_SPEED], poses[_YAW]
        poses[:2] += way * np.cos(yaw), way * np.sin(yaw)
        for actor, (x, y, *others) in zip(moved, poses.T.tolist(), strict=True):
            actor.travelled += math.hypot(x - actor.x, y - actor.y)
            actor.x, actor.y, actor.is_lane_old = x, y, True
            actor.z, actor.roll, actor.pitch, actor.yaw, actor.speed, actor.accel = others
        for actor in there.values():
            actor.still = actor.still + STORY_STEP if abs(actor.speed) < STANDS else 0.0
        for name in there if minds_lanes else ():
            actor = self.on_lane(name)
            is_off = actor.lane < 0 or abs(actor.offset) > 0.5 * float(self.map.roads.width[actor.lane])
            actor.off_road = actor.off_road + STORY_STEP if is_off else 0.0

    def begin_step(self) -> None:
        """Note poses and offsets before the actions of a step change them."""
        self._offsets = {name: actor.offset for name, actor in self.by_name.items()}
        for name, actor in self.by_name.items():
            actor.is_placed, actor.way_speed = False, None
            actor.shown = _pose(actor) if actor.uid in self.world and actor.mode == STORY else []
            self._hold(name, actor)

    def _hold(self, name: str, actor: StoryActor) -> None:
        """Have a pedestrian wait until an ego is near, and stand at the end of its way: additions of MORAI."""
        if name not in self._holds:
            return
        near, way = self._holds[name]
        if actor.waiting is not None:
            actor.waiting = actor.speed or actor.waiting
            egos = np.flatnonzero(self.world.alive & (self.world.kind == Kind.EGO))
            away = np.hypot(self.world.x[egos] - actor.x, self.world.y[egos] - actor.y)
            is_near = bool((away <= near).any())
            actor.speed, actor.waiting = (actor.waiting, None) if is_near else (0.0, actor.waiting)
        if way > 0.0:
            actor.speed = min(actor.speed, max(way - actor.travelled, 0.0) / STORY_STEP)

    def move(self) -> None:
        """Move all actors of the story by a step."""
        moved = {name: actor for name, actor in self.by_name.items() if actor.shown}
        rest = {name: actor for name, actor in moved.items() if not actor.is_placed}
        held = {name for name, distances in self._holds.items() if any(distances)}
        on_lanes = {name: actor for name, actor in rest.items() if actor.lane >= 0 and name not in held}
        curvature = self._curvature(list(on_lanes.values()))
        for name, actor in moved.items():
            self._hold(name, actor)
        for (name, actor), bend in zip(on_lanes.items(), curvature, strict=True):
            self._drive(actor, self._offsets[name], bend)
        for name, actor in rest.items():
            if name not in on_lanes:
                self._go_straight(actor)
        self._set_down(list(on_lanes.values()))
        for actor in on_lanes.values():
            if actor.is_changing_lane:
                actor.is_changing_lane = False
                on = self.map.project(actor.place)
                if on.lane >= 0 and math.cos(on.turned) > 0.0:
                    actor.lane, actor.s, actor.offset = on.lane, on.s, on.offset
        for actor in moved.values():
            actor.x, actor.y, actor.z = (max(-MAX_COORDINATE, min(MAX_COORDINATE, each)) for each in _pose(actor)[:3])
            actor.accel = (actor.speed - actor.shown[-1]) / STORY_STEP
        self._moved = None

    def show_between(self, share: float) -> None:
        """Write the actors of the story into the world, within the world's step.

        Args:
            share: of the story's step that is over at the end of the world's.
        """
        if self._moved is None:
            moved = [actor for actor in self.by_name.values() if actor.shown]
            begin = np.array([actor.shown for actor in moved]).reshape(-1, len(POSE)).T
            change = np.array([_pose(actor) for actor in moved]).reshape(-1, len(POSE)).T - begin
            change[_YAW] = np.remainder(change[_YAW] + math.pi, math.tau) - math.pi
            rates = np.array([[actor.accel for actor in moved], change[_YAW] / STORY_STEP])
            self._moved = moved, begin, change, rates
        moved, begin, change, rates = self._moved
        is_there = [actor.uid in self.world and actor.mode == STORY for actor in moved]
        if any(is_there):
            rows = np.array([self.world.row(actor.uid) for actor in compress(moved, is_there)])
            show_ghosts(
                self.world, rows, _COLUMNS, np.concatenate([begin + share * change, rates])[:, np.array(is_there)]
            )

    def _drive(self, actor: StoryActor, offset: float, curvature: float) -> None:
        """Move an actor along its lane.

        Args:
            offset: before the actions of the step.
            curvature: of its lane [1/m].
        """
        way = (actor.speed if actor.way_speed is None else actor.way_speed) * STORY_STEP
        aside = actor.offset - offset
        along = math.copysign(math.sqrt(max(way * way - aside * aside, 0.0)), way)
        stretch = max(1.0 - curvature * actor.offset, 0.1)
        on, left = self.map.move(actor.lane_place, actor.direction * along / stretch, actor.route)
        if left or (actor.at_end and not way):
            actor.at_end += STORY_STEP * (abs(left / along) if left and along else 1.0)
            actor.speed = 0.0
        else:
            actor.at_end = 0.0
        actor.travelled += max(abs(way) - abs(left), 0.0)
        actor.lane, actor.s = on.lane, on.s
        actor.aside = aside / STORY_STEP
        base = math.pi if actor.direction < 0.0 else 0.0
        if way:
            actor.turned = math.remainder(base + actor.direction * math.atan2(aside, abs(along)), math.tau)

    def _go_straight(self, actor: StoryActor) -> None:
        """Move an actor along its heading."""
        way = actor.speed * STORY_STEP
        actor.x += way * math.cos(actor.yaw)
        actor.y += way * math.sin(actor.yaw)
        actor.travelled += abs(way)
        if actor.lane >= 0:
            self.take_lane(actor)

    def _curvature(self, actors: list[StoryActor]) -> list[float]:
        lane, s = _on_lanes(actors)
        low, high = np.maximum(s - 1.0, 0.0), np.minimum(s + 1.0, self.map.roads.length[lane])
        _, yaw = self.map.roads.at(np.concatenate([lane, lane]), np.concatenate([low, high]))
        turn = np.remainder(yaw[len(lane) :] - yaw[: len(lane)] + math.pi, math.tau) - math.pi
        bend: list[float] = (turn / np.maximum(high - low, 1e-3)).tolist()
        return bend

    def _set_down(self, actors: list[StoryActor]) -> None:
        """Set the places of actors in the map frame by their places on lanes."""
        roads = self.map.roads
        lane, s = _on_lanes(actors)
        low = np.maximum(np.minimum(s, roads.length[lane]) - 0.5, 0.0)
        points, yaws = roads.at(np.concatenate([lane, lane, lane]), np.concatenate([s, low, low + 1.0]))
        num = len(actors)
        rise = points[2 * num :, 2] - points[num : 2 * num, 2]
        for actor, point, yaw, climb in zip(actors, points[:num].tolist(), yaws[:num].tolist(), rise, strict=True):
            actor.x = point[0] - actor.offset * math.sin(yaw)
            actor.y = point[1] + actor.offset * math.cos(yaw)
            actor.z = point[2]
            actor.yaw = math.remainder(yaw + actor.turned, math.tau)
            actor.pitch = -math.atan(float(climb)) * actor.direction
            actor.roll = 0.0


def _on_lanes(actors: list[StoryActor]) -> tuple[IntArray, FloatArray]:
    """Return the rows of the lanes that actors are on, and how far along these [m]."""
    return np.array([actor.lane for actor in actors], dtype=np.int64), np.array([actor.s for actor in actors])


def _pose(actor: StoryActor) -> list[float]:
    """Return the `POSE` of an actor."""
    return [actor.x, actor.y, actor.z, actor.roll, actor.pitch, actor.yaw, actor.speed]
