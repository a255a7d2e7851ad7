"""The component of `/sim/describe`: what one entity is, where it is, and what it does and why.

The driver model itself (`view_driver`) tells the action of a driver on lanes, as it would decide now. Drivers decide
ten times a second, so the answer may be up to 0.1 s ahead of the motion.
"""

from __future__ import annotations

from typing import Any, Final

from rosbridge_sim.errors import FieldError, GraphError, Reason
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.scenarios.scenario_model import UNTIL_EVENT
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.sim_services.late_answers import failing
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.followers.lane_following import DriverView, Stop, view_driver
from rosbridge_sim.world.lane_changes.lane_change_model import LaneChange
from rosbridge_sim.world.roads.road_places import find_lane
from rosbridge_sim.world.state.world import Kind

MAX_TO_LANE: Final = 3.5
"""An entity farther than this from the line of any lane is on none [m]: the width of a lane."""

NOTHING: Final = -1.0
"""A distance to something that there is not [m]: JSON has no infinity."""

_NOUNS: Final = {Kind.EGO: "ego", Kind.VEHICLE: "vehicle", Kind.PEDESTRIAN: "pedestrian", Kind.OBSTACLE: "obstacle"}

_SIDES: Final = ("left", "right")
_CHANGES: Final = {
    LaneChange.FASTER: "to get on faster",
    LaneChange.KEEP_RIGHT: "to keep right",
    LaneChange.ROUTE: "for its route",
    LaneChange.LANE_END: "because its own ends",
    LaneChange.AROUND: "to pass what stands",
}

_FIGURES: Final = {
    **{name: name for name in ("kind", "x", "y", "z", "speed", "start_within")},
    "heading": "yaw",
    "acceleration": "accel",
}
"""Field of the response -> column of the world."""

_AHEAD: Final = ("ahead_1", "ahead_2", "ahead_3", "ahead_4", "ahead_5")


class Describe(Component):
    """The component of the description. It holds no state."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service that exists once, not for each ego."""
        bindings.provide("sim/describe", "rosbridge_sim_msgs/Describe", failing(self._tell))

    def _tell(self, call: Call, _now: float) -> None:
        request: Any = call.request
        if self._context.stepper.is_moving:  # half of the world would be of the frame before
            raise GraphError("a frame is being computed; call between two frames", reason=Reason.NOT_NOW)
        call.respond(result=True, **self._describe(request.id))

    def _describe(self, number: int) -> dict[str, Any]:
        """Return the fields of the response.

        Raises:
            FieldError: there is no such entity.
        """
        context = self._context
        world = context.world
        ego = context.egos.find(number)
        if ego is not None and ego.is_there:
            row = ego.row
        elif number in world and world.kind[world.row(number)] != Kind.EGO:  # an ego has another number here
            ego, row = None, world.row(number)
        else:
            raise FieldError(f"id: there is no entity {number}; /sim/scene/state has the numbers")
        behaviour, controlled_by = self._behaviour(row, ego)
        fields: dict[str, Any] = {
            "frame": world.frame,
            "model": world.names[row],
            **{field: getattr(world, column).item(row) for field, column in _FIGURES.items()},
            **self._place(row),
            "behaviour": behaviour,
            "controlled_by": controlled_by,
            "client": "" if ego is None or ego.commander is None else ego.commander.where,
            "gap": NOTHING,
            "stop_distance": NOTHING,
        }
        view = None if world.is_ghost[row] else view_driver(world, row)
        if view is not None:
            fields |= self._drive(view)
        fields["text"] = self._text(row, behaviour, view)
        return fields

    def _behaviour(self, row: int, ego: Ego | None) -> tuple[str, str]:
        """Return how an entity moves, and what controls it."""
        world, scene = self._context.world, self._context.scene
        if world.has_lane[row]:
            behaviour = "lane"
        elif world.is_ghost[row]:
            behaviour = "ghost"
        elif ego is not None:
            behaviour = "driven"
        elif world.has_path[row]:
            behaviour = "path"
        else:
            moves = world.speed[row] != 0.0 or world.start_within[row] > 0.0
            behaviour = "straight" if moves else "stand"
        if ego is None:
            if behaviour != "ghost":
                return behaviour, "simulator"
            return behaviour, "replay" if scene.is_replaying else "client"
        return behaviour, ego.driver

    def _place(self, row: int) -> dict[str, Any]:
        """Return the fields of the place on the roads."""
        world = self._context.world
        roads = world.roads
        if world.has_lane[row]:
            lane = world.lane.item(row)
            found = [getattr(world, name).item(row) for name in _AHEAD]
            ahead = [roads.ids[each] for each in found if each >= 0]
            lateral = world.lateral.item(row)
            if world.kind[row] == Kind.EGO:  # it drives as it can: its offset is measured
                near = find_lane(roads, *(getattr(world, name).item(row) for name in ("x", "y", "yaw", "z")))
                lateral = near.lateral if near is not None and near.lane == lane else 0.0
            return {"link": roads.ids[lane], "distance": world.arc.item(row), "lateral": lateral, "next_links": ahead}
        near = find_lane(roads, *(getattr(world, name).item(row) for name in ("x", "y", "yaw", "z")))
        if near is None or near.distance > MAX_TO_LANE:
            return {}
        return {"link": roads.ids[near.lane], "distance": near.s, "lateral": near.lateral}

    def _drive(self, view: DriverView) -> dict[str, Any]:
        """Return the fields of what a driver on lanes does."""
        context = self._context
        roads, number = context.world.roads, context.egos.unique_id
        fields: dict[str, Any] = {"follows": view.is_following, "stops_for": view.stop.value}
        fields["turn_signal"] = view.signal
        if view.lead >= 0:
            fields |= {"lead_id": number(view.lead), "gap": view.gap}
        if view.stop is not Stop.NONE:
            fields |= {"stop_distance": view.stop_distance, "stop_link": roads.ids[view.stop_lane]}
        if view.change is not LaneChange.NONE:
            fields |= {"changes_lane": view.change.name.lower(), "is_changing": view.is_changing}
        if view.light >= 0:
            fields["light"] = context.world.signals.plan.lights[view.light].name
        if view.rival >= 0:
            fields |= {"gives_way": True, "gives_way_to": number(view.rival)}
        return fields

    def _text(self, row: int, behaviour: str, view: DriverView | None) -> str:
        """Return what an entity does, for a person."""
        world = self._context.world
        speed = world.speed.item(row)
        pace = "stands" if speed == 0.0 else f"drives at {speed * MPS_TO_KMH:.0f} km/h"
        if world.kind[row] == Kind.PEDESTRIAN:
            pace = pace.replace("drives", "walks")
        if world.start_within[row] > 0.0:
            within = world.start_within.item(row)
            return "waits for its event" if within <= UNTIL_EVENT else f"waits until an ego is within {within:g} m"
        if view is None:
            ways = {"path": " on its path", "straight": " straight on", "ghost": ", placed frame by frame"}
            return pace + ("" if behaviour == "straight" and speed == 0.0 else ways.get(behaviour, ""))
        parts = [pace]
        if view.stop is Stop.LIGHT:
            light = world.signals.plan.lights[view.light].name if view.light >= 0 else "?"
            parts.append(f"stops for light {light} in {view.stop_distance:.0f} m")
        elif view.stop is Stop.RIGHT_OF_WAY:
            rival = f" to {self._noun(view.rival)}" if view.rival >= 0 else ""
            parts.append(f"gives way{rival} in {view.stop_distance:.0f} m")
        elif view.stop is Stop.NO_ROOM:
            parts.append("waits for room behind the intersection")
        elif view.stop is Stop.END:
            parts.append(f"stops at the end of the road in {view.stop_distance:.0f} m")
        if view.change is not LaneChange.NONE:
            side = _SIDES[view.signal - 1]
            verb = "changes" if view.is_changing else "wants to change"
            parts.append(f"{verb} to the lane to the {side} {_CHANGES[view.change]}")
        if view.is_following and view.lead >= 0:
            what = self._noun(view.lead)
            is_walker = world.kind[view.lead] == Kind.PEDESTRIAN
            verb = "stops for" if is_walker else "follows" if world.speed[view.lead] != 0.0 else "queues behind"
            parts.append(f"{verb} {what}, {max(view.gap, 0.0):.1f} m ahead")
        return ", ".join(parts)

    def _noun(self, row: int) -> str:
        kind = Kind(self._context.world.kind.item(row))
        return f"{_NOUNS[kind]} {self._context.egos.unique_id(row)}"
