"""Rehearsal of a scenario's first frames, where it is read: beside the event loop.

Much of what frames need of a map is computed once and kept with its roads: conflicts and neighbours of lanes, places
for traffic, the crossings of pedestrians' paths, routes of spawn points. In a town that takes as long as ten or twenty
frames. A scratch world computes it in the reading thread, so the first frames of the scene find it. What they do does
not depend on that: it is a function of the roads and paths alone. If the world computes it at the same moment, either
copy can be used.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import DEFAULT_EGO
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import place_on_roads
from rosbridge_sim.simulator.scene.load import Load
from rosbridge_sim.simulator.scene.scene import populate
from rosbridge_sim.simulator.scene.scene_limits import FIRST_UID
from rosbridge_sim.world.demand import LaneSlots
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.drivers.lane_wander import USUAL_WANDER
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.routing import KnownRoutes
from rosbridge_sim.world.state.world import Dynamics, Kind, World
from rosbridge_sim.world.step import step

NUM_FRAMES: Final = 5
"""Frames of a rehearsal: drivers and pedestrians decide in every fifth one."""

MAX_KNOWN: Final = 8
"""Scenarios of one map that are known as rehearsed."""


class _Rehearsed:
    """The last scenarios that were rehearsed on one map: a repeated load needs no rehearsal."""

    def __init__(self, _roads: Roads) -> None:
        self.scenarios: deque[Scenario] = deque(maxlen=MAX_KNOWN)
        self.is_filled = False


class Rehearsal:
    """Rehearses scenarios; its methods may be called from any thread."""

    def __init__(self, dynamics: Dynamics, *, has_traffic: bool) -> None:
        """Rehearse nothing yet.

        Args:
            has_traffic: each new scene is filled with traffic.
        """
        self._dynamics = dynamics
        self._has_traffic = has_traffic

    def rehearse(self, scenario: Scenario, road_map: RoadMap) -> None:
        """Have all that the first frames need of the roads computed. A scenario that cannot be loaded is no error."""
        roads = road_map.roads
        done = roads.derived(_Rehearsed)
        if scenario in done.scenarios and done.is_filled >= self._has_traffic:
            return
        try:
            self._play(place_on_roads(scenario, roads), road_map)
        except (DocumentError, ValueError):  # the load itself tells of it
            return
        done.scenarios.append(scenario)
        done.is_filled |= self._has_traffic

    def _play(self, placed: Scenario, road_map: RoadMap) -> None:
        """Compute the first frames in a scratch world.

        Raises:
            ValueError: the world refuses an entity.
        """
        roads = road_map.roads
        starts = [(point.lane, point.s) for point in placed.spawn_points[:1]]
        if self._has_traffic:
            slots = roads.derived(LaneSlots.of)
            starts += zip(slots.lane[:1].tolist(), slots.s[:1].tolist(), strict=True)
        routes = roads.derived(KnownRoutes)
        for point in placed.spawn_points:
            if point.goal_lane >= 0:
                routes.find(point.lane, point.s, point.goal_lane, point.goal_s)
        # What they wait for would not come within these frames.
        others = [replace(spawn, start_within=0.0) for spawn in placed.vehicles + placed.pedestrians + placed.obstacles]
        world = World(0, self._dynamics)
        load = Load(placed.name, placed.egos[:1], tuple(others), is_clearing=True, map_name="", road_map=road_map)
        next_uid = populate(world, load, load.plan, FIRST_UID)
        for uid, (lane, s) in enumerate(starts, next_uid):
            world.spawn(Kind.VEHICLE, DEFAULT_EGO.body, name=DEFAULT_EGO.name, x=0.0, y=0.0, uid=uid)
            keep_lanes(world, [LaneStart(world.row(uid), lane, s, wander=USUAL_WANDER)])
        for _ in range(NUM_FRAMES):
            step(world)
