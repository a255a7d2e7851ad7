"""The component of `/sim/map`, `/sim/route` and `/sim/nearest_lane`: questions about the map that change nothing.

A route on a map of usual size takes less than a few milliseconds and is found at once. On a larger one it is found by
the `Reader`, in a thread as a rule, one at a time; only its client waits.
"""

from __future__ import annotations

import math
from typing import Any, Final

from rosbridge_sim.errors import FieldError, GraphError, Reason
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import replace
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.markers.map_drawing import MapDrawing
from rosbridge_sim.simulator.sim_services.late_answers import LateAnswers, failing
from rosbridge_sim.simulator.sim_services.object_parsing import find_link, within
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.road_places import find_lane, is_on_road
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.routing import Route, find_route, route_points
from rosbridge_sim.world.state.world import MAX_COORDINATE

MAX_LANES_AT_ONCE: Final = 10_000
"""Lanes of a map on which a route is found at once: at most 5 ms."""

MAX_WAITING_ROUTES: Final = 8
"""Routes on a larger map that may wait for the thread; the 100,000 lanes of the largest map take some 100 ms each."""

MAX_FROM_LANE: Final = 100.0
"""A route begins and ends at most this far from a lane's line [m]; a place farther away is a mistake."""

_Found = tuple[Route, FloatArray] | None


class RoadServices(Component):
    """The component of questions about the map.

    It holds no state but the drawing of the map in use, which any program would make anew from the map.
    """

    def __init__(self, context: SimulatorContext) -> None:
        """Offer nothing yet."""
        self._context = context
        self._late = LateAnswers(context)
        self._drawing: MapDrawing | None = None
        self._drawn: object = None  # the map that `_drawing` is of
        self._make_point = context.maker("geometry_msgs/Point", "x y z")

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/map", "rosbridge_sim_msgs/Map", failing(self._tell_map))
        bindings.provide("sim/route", "rosbridge_sim_msgs/Route", failing(self._tell_route))
        bindings.provide("sim/nearest_lane", "rosbridge_sim_msgs/NearestLane", failing(self._tell_nearest_lane))

    # The map

    @property
    def is_offered(self) -> bool:
        """True if the network settings have `/sim/map` on."""
        return bool(self._context.interfaces.settings.choice(InterfaceKind.SERVICE, "/sim/map").is_on)

    @property
    def drawing(self) -> MapDrawing:
        """The drawing of the map in use, lights of a story included; the same object as long as they are the same."""
        road_map, plan = self._context.scene.road_map, self._context.world.signals.plan
        if self._drawing is None or self._drawn != (road_map, plan.digest):
            self._drawing = MapDrawing(self._context.bus.store, replace(road_map, plan=plan))
            self._drawn = road_map, plan.digest
        return self._drawing

    def _tell_map(self, call: Call, _now: float) -> None:
        request: Any = call.request
        drawing = self.drawing
        if request.page >= drawing.num_pages:
            raise FieldError(f"page: expected 0..{drawing.num_pages - 1}, got {request.page}")
        call.respond(**drawing.page(request.page))

    # Routes

    def _tell_route(self, call: Call, now: float) -> None:
        request: Any = call.request
        roads = self._context.world.roads
        start, goal = _read_place(request.start, "start", roads), _read_place(request.goal, "goal", roads)
        if len(roads) > MAX_LANES_AT_ONCE and self._late.num_waiting >= MAX_WAITING_ROUTES:
            text = f"{MAX_WAITING_ROUTES} routes are being found; ask again after one of the answers"
            raise GraphError(text, reason=Reason.TOO_FAST)

        def find() -> _Found:
            route = find_route(roads, *start, *goal)
            return None if route is None else (route, route_points(roads, route))

        def answer(found: _Found) -> None:
            if found is None:
                here, there = roads.ids[start[0]], roads.ids[goal[0]]
                text = f"no way leads from {here!r} to {there!r} along the links"
                call.fail(GraphError(text, reason=Reason.REFUSED))
                return
            route, points = found
            call.respond(
                result=True,
                links=[roads.ids[lane] for lane in route.lanes],
                points=[self._make_point(*point) for point in points.tolist()],
                length_m=route.length,
            )

        if len(roads) <= MAX_LANES_AT_ONCE:
            answer(find())
        else:
            self._late.find(call, find, answer, now)

    # Lanes

    def _tell_nearest_lane(self, call: Call, _now: float) -> None:
        request: Any = call.request
        roads = self._context.world.roads
        x, y, yaw = _read_point(request, "")
        near = find_lane(roads, x, y, yaw)
        if near is None:
            raise GraphError("the map has no lanes", reason=Reason.REFUSED)
        call.respond(
            result=True,
            link=roads.ids[near.lane],
            distance=near.s,
            lateral=near.lateral,
            heading_deg=math.degrees(near.yaw),
            speed_limit=float(roads.speed_limit[near.lane]),
            length=float(roads.length[near.lane]),
            is_on_road=is_on_road(roads, x, y),
        )


def _read_place(place: Struct, where: str, roads: Roads) -> tuple[int, float]:
    """Return row and arc length [m] of a RoadPlace.

    Raises:
        FieldError: it is no place on a lane.
    """
    if place.link:
        lane = find_link(roads, place.link, f"{where}.link")
        unit = f"m, the length of {place.link[:80]!r}"
        return lane, within(place.distance, 0.0, float(roads.length[lane]), f"{where}.distance", unit)
    x, y, yaw = _read_point(place, f"{where}.")
    near = find_lane(roads, x, y, yaw)
    if near is None or near.distance > MAX_FROM_LANE:
        got = "a map without lanes" if near is None else f"({x:g}, {y:g}), {near.distance:.0f} m from one"
        raise FieldError(f"{where}: expected a place within {MAX_FROM_LANE:g} m of a lane's line, got {got}")
    return near.lane, near.s


def _read_point(message: Struct, where: str) -> tuple[float, float, float | None]:
    """Return x, y [m] and heading [rad] of a message; None for a heading that does not count.

    Raises:
        FieldError: a number that is none, or out of bounds.
    """
    fields = ("x", "y", "heading_deg") if message.use_heading else ("x", "y")
    for field in fields:
        value = getattr(message, field)
        if not -MAX_COORDINATE <= value <= MAX_COORDINATE:
            raise FieldError(f"{where}{field}: expected a number within +-{MAX_COORDINATE:g}, got {value:g}")
    yaw = math.radians(math.remainder(message.heading_deg, 360.0)) if message.use_heading else None
    return message.x, message.y, yaw
