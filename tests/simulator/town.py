"""The simulator on a map with lights, on a bare bus, and a client that drives in it."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.geometry.planar import arc_lengths, nearest_on_polyline
from rosbridge_sim.world.roads.signal_plan import Lamp
from rosbridge_sim.world.state.world import World
from tests.simulator.sim_harness import Client, make_store
from tests.simulator.small_maps import tiny
from tests.world.polylines import point_at

__all__ = ["Crossroads", "Driver", "RouteLine", "StopLineObserver", "Town"]


class TinyLibrary(DiskLibrary):
    """The hand-written crossing as the map `tiny`, beside the built-in ones."""

    def map(self, name: str) -> RoadMap:
        return tiny() if name == "tiny" else super().map(name)


class Crossroads:
    """A simulator in synchronous mode with a client who is its master."""

    def __init__(self, scenario: Scenario) -> None:
        self.bus = Bus(make_store())
        self.world = World()
        self.node = make_node(self.bus, self.world, TinyLibrary(), scenario, NodeSettings(start="sync"))
        self.client = Client(self.bus, "/client")

    @classmethod
    def tiny(cls, x: float = 50.0, y: float = 3.5, **more: JsonValue) -> Crossroads:
        """The hand-written crossing; its stop line is at x = 100, its ego stands on the inner lane."""
        ego = {"initPosition": {"pos": {"x": x, "y": y}}, "gear": 4}
        document = {"mapInfo": {"mapName": "tiny"}, "egoVehicle": ego, **more}
        return cls(read_scenario(json.dumps(document).encode(), "tiny.json"))

    @classmethod
    def built_in(cls, name: str) -> Crossroads:
        return cls(DiskLibrary().scenario(name))

    def run(self, seconds: float) -> None:
        """Let the master tick."""
        if not self.node.sync.master_id:
            self.client.start()
        for _ in range(round(seconds / 0.02)):
            self.client.tick()

    def put(self, x: float, y: float, yaw_deg: float = 0.0) -> None:
        """Have the ego stand somewhere."""
        zeros = {"global_position_z": [0.0], "global_roll": [0.0], "global_pitch": [0.0], "velocity": [0.0]}
        self.client.send(
            "/ego_setting",
            "morai_msgs/MultiEgoSetting",
            number_of_ego_vehicle=1,
            camera_index=0,
            ego_index=[0],
            gear=[4],
            ctrl_mode=[16],
            **{"global_position_x": [x], "global_position_y": [y], "global_yaw": [yaw_deg], **zeros},
        )

    def last(self, topic: str) -> dict[str, Any] | None:
        """What was heard there with the newest frame, if anything was."""
        heard = self.client.messages(topic)
        return heard[-1] if heard and heard[-1]["header"]["seq"] == self.world.frame else None


Town = Crossroads


class RouteLine:
    """A way along links of a map, as one line.

    Attributes:
        line, arcs: its points and how far along it they are [m].
        stops: (how far along its stop line is [m], row of the lane that begins there), for lanes with a light.
    """

    def __init__(self, road_map: RoadMap, links: list[str]) -> None:
        roads = road_map.roads
        rows = [roads.row(link) for link in links]
        self.line = np.concatenate([roads.points[roads.first[row] : roads.first[row + 1]] for row in rows])[:, :2]
        self.arcs = arc_lengths(self.line)
        starts = np.cumsum([0.0, *(roads.length[row] for row in rows)]).tolist()
        lit = {lane for light in (road_map.plan.lights if road_map.plan else ()) for lane in light.lanes}
        self.stops = [(at, row) for at, row in zip(starts, rows, strict=False) if row in lit]

    def find(self, x: float, y: float, near: float) -> float:
        """How far along somebody is who was `near` a moment ago; the way may end where it begins [m]."""
        here = float(nearest_on_polyline(self.line, x, y).arc[0])
        return here if abs(here - near) < 20.0 else near


class Driver:
    """Somebody who knows the map and drives a round of links: pure pursuit, a limit, and brakes for what is ahead.

    Attributes:
        is_done: he has come round.
    """

    def __init__(self, client: Client, road_map: RoadMap, way: RouteLine, *, heeds_lights: bool) -> None:
        self._client = client
        self._line, self._arcs = way.line, way.arcs
        self._way = way
        # Where a light's stop line is on the way, and what must be lit there for him.
        plan = road_map.plan
        self._lines: dict[str, tuple[float, int]] = {}
        for at, row in way.stops:
            assert plan is not None
            need = Lamp.LEFT if road_map.roads.turn[row] > 1.0 else Lamp.GREEN
            self._lines[plan.lights[plan.light_of_lane[row]].name] = (at, int(need))
        self._heeds_lights = heeds_lights
        self._s = 10.0
        self._light: dict[str, Any] | None = None
        self._objects: list[dict[str, Any]] = []
        self.is_done = False

    def drive(self, status: dict[str, Any]) -> None:
        """Answer a tick's `vehicle_status` with a command."""
        x, y = status["position"]["x"], status["position"]["y"]
        self._s = self._way.find(x, y, self._s)
        self.is_done = bool(self._s > self._arcs[-1] - 5.0)
        speed = status["velocity"]["x"]
        goal = point_at(self._line, self._arcs, min(self._s + 3.0 + 0.3 * speed, self._arcs[-1]))[0]
        yaw = math.radians(status["heading"])
        ahead = (goal[0] - x) * math.cos(yaw) + (goal[1] - y) * math.sin(yaw)
        aside = (goal[1] - y) * math.cos(yaw) - (goal[0] - x) * math.sin(yaw)
        steering = math.atan2(2.0 * 2.7 * aside, ahead**2 + aside**2)
        room = min(self._room_before_line(), self._room_before_others())
        wish = min(25.0 / 3.6 if abs(steering) > 0.1 else 40.0 / 3.6, math.sqrt(2.0 * 1.5 * max(room, 0.0)))
        command = {"longlCmdType": 2, "velocity": wish * 3.6, "steering": steering}
        assert self._client.control(0, **command)

    def hear(self, messages: list[tuple[str, dict[str, Any]]]) -> None:
        """Take what was published with a tick."""
        self._light, self._objects = None, []
        for topic, message in messages:
            if topic == "/GetTrafficLightStatus":
                self._light = message
            elif topic == "/Object_topic":
                self._objects = message["npc_list"]

    def _room_before_line(self) -> float:
        light = self._light
        if not self._heeds_lights or light is None or light["trafficLightIndex"] not in self._lines:
            return math.inf
        at, need = self._lines[light["trafficLightIndex"]]
        room = at - self._s - 3.58 - 1.0  # from the bumper to a metre before the line
        if light["trafficLightStatus"] & need or room < -1.0:
            return math.inf
        # A yellow light that takes more than firm braking is passed.
        return room if not light["trafficLightStatus"] & Lamp.YELLOW or room > 8.0 else math.inf

    def _room_before_others(self) -> float:
        room = math.inf
        x, y = point_at(self._line, self._arcs, self._s)[0].tolist()
        for other in self._objects:
            if math.hypot(other["position"]["x"] - x, other["position"]["y"] - y) > 50.0:
                continue
            place = nearest_on_polyline(self._line, other["position"]["x"], other["position"]["y"])
            away = float(place.arc[0]) - self._s
            if 0.0 < away < 40.0 and abs(float(place.lateral[0])) < 2.0:
                room = min(room, away - 3.58 - 3.0 - 2.0)
        return room


class StopLineObserver:
    """Sees how the ego comes over the stop lines of its way; knows nothing but the world.

    It is the front bumper that counts, and what the light of the lane beyond the line shows in that frame.

    Attributes:
        passed: (name, what was lit) of all lights that were passed.
        red: names of those that were red, with nothing beside it that lets pass.
    """

    def __init__(self, world: World, way: RouteLine) -> None:
        self._world = world
        self._way = way
        self._nose = 10.0
        self.passed: list[tuple[str, int]] = []
        self.red: list[str] = []

    def watch(self) -> None:
        """Look once, after a frame."""
        world, row = self._world, self._world.row(0)
        reach = world.half_length[row] + world.centre[row]
        yaw = world.yaw[row]
        x, y = world.x[row] + reach * math.cos(yaw), world.y[row] + reach * math.sin(yaw)
        before, self._nose = self._nose, self._way.find(x, y, self._nose)
        plan = world.signals.plan
        for at, lane in self._way.stops:
            if not before < at <= self._nose:
                continue
            light = int(plan.light_of_lane[lane])
            value = int(world.signals.shown[light])
            self.passed.append((plan.lights[light].name, value))
            if value & Lamp.RED and not value & plan.pass_of_lane[lane]:
                self.red.append(plan.lights[light].name)
