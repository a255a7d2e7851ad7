"""A scenario in a form that knows no file format: entities, drivers, phases of lights, spawn points.

Each reader of a format makes one of these, and the scene loads it. All places are in the map frame [m, rad].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rosbridge_sim.records import Record, field
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.scenarios.openscenario.story_records import Story
from rosbridge_sim.scenarios.spawn_points import SpawnPoint
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.state.world import Gear, Kind


class Driver(Record):
    """A driver that follows the lanes.

    Attributes:
        desired_speed: highest speed, inf for the speed limit [m/s].
        links: ids of the links of its route; empty for a random route.
        changes_lanes: it changes lanes where that helps it.
        lateral: offset from the line of its lane that it keeps, left positive [m].
        lane, s, route: the lane that it starts on, the arc length there [m], and the route's lanes; set by
            `place_on_roads`.
    """

    desired_speed: float
    links: tuple[str, ...] = ()
    lane: int = -1
    s: float = 0.0
    route: tuple[int, ...] = ()
    changes_lanes: bool = True
    lateral: float = 0.0


class PhaseStart(Record):
    """Phase of an intersection at the start.

    Attributes:
        controller: position or id of its controller, as in the document; an id in results of `sort_phases`.
        phase: number of the phase.
        elapsed: time since the phase began [s].
    """

    controller: str
    phase: int
    elapsed: float


class Spawn(Record, eq=False):
    """One agent to be added to the world.

    Attributes:
        uid: the id in the file, 0 for the first ego; None for the next free one.
        x, y, z: reference point in the map frame [m]. 0 while only the link is known (`is_placed` False).
        yaw: (-pi, pi] [rad].
        roll, pitch: (-pi, pi]; the world keeps them until the agent is placed elsewhere [rad].
        speed: along the heading or the path; never negative on a path [m/s].
        path: (m, 3) waypoints in the map frame, at least two different ones [m]; None for straight ahead.
        is_loop: the path, or the driver's route, is closed.
        gear: of an ego.
        driver: of a vehicle that follows the lanes.
        link: id of the link that it starts on; None after `place_on_roads`.
        link_ratio: start along that link, 0..1.
        is_placed: x, y and z are valid.
        start_within: it stands until an ego is this near [m]; 0 starts at once.
        yields: it stops for what is ahead on its path.
        kept: keys of the document without effect yet, with their values as they are written.
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
    driver: Driver | None = None
    link: str | None = None
    link_ratio: float = 0.0
    is_placed: bool = True
    roll: float = 0.0
    pitch: float = 0.0
    start_within: float = 0.0
    yields: bool = False
    kept: Mapping[str, Any] = field(default_factory=dict)  # JSON values
    where: str = ""


class Scenario(Record, eq=False):
    """A whole scenario, in the order of its document.

    Attributes:
        name: of the file, without `.json`.
        map_name: of its map; None if it names none.
        egos, vehicles, pedestrians, obstacles: agents to add. No two have one `uid`.
        phases: phases of intersections at the start.
        spawn_points: places where vehicles appear.
        story: what the file of OpenSCENARIO, or the blocks `rosbridge_sim` of MORAI's JSON, ask for; None for nothing.
        kept: keys of the document without effect yet, with their values as they are written.
        notes: remarks about reinterpreted entries: a line each, for the log.
    """

    name: str
    map_name: str | None = None
    egos: tuple[Spawn, ...] = ()
    vehicles: tuple[Spawn, ...] = ()
    pedestrians: tuple[Spawn, ...] = ()
    obstacles: tuple[Spawn, ...] = ()
    phases: tuple[PhaseStart, ...] = ()
    notes: tuple[str, ...] = ()
    kept: Mapping[str, Any] = field(default_factory=dict)  # JSON values
    spawn_points: tuple[SpawnPoint, ...] = ()
    story: Story | None = None
