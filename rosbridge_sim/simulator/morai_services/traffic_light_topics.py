"""Topics and a service for traffic lights and intersections: their state, and commands that set them.

A light is identified by its name on the map. An intersection is identified by its controller's name, or by the number
at the end of that name. Lamp states are sent as the world has them, because the world uses MORAI's numbers.

*The light ahead* belongs to the next stop line within 100 m on the lanes that follow the ego's lane. Where lanes fork,
the lane that goes straightest on is taken. Its topic is silent while there is no such light. The intersection's topic
is
silent while the ego is not in one.
"""

from __future__ import annotations

import logging
import math
from functools import partial
from typing import Any, Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.mgeo_lights import light_type
from rosbridge_sim.schema.float32 import round32
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.world.roads.signal_plan import UNSET, Lamp
from rosbridge_sim.world.roads.signals import Signals, light_ahead
from rosbridge_sim.world.state.world import DT

STOP_LINE_REACH: Final = 100.0
"""Largest distance from the rear axle to a stop line ahead [m]."""

MAX_LIGHT_TO_LANE: Final = 5.0
"""Largest distance to a lane for an ego that is on the road [m]."""

NO_LIGHT: Final = -2
"""Status that is returned for an unknown light."""

_LAMPS: Final = sum(int(lamp) for lamp in Lamp)

_log = logging.getLogger("rosbridge_sim.morai")


class TrafficLightTopics(Component):
    """Component of traffic lights. It holds no state of its own; the world does."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._make_light = context.maker(
            "morai_msgs/GetTrafficLightStatus", "header trafficLightIndex trafficLightType trafficLightStatus"
        )
        self._make_status = context.maker(
            "morai_msgs/IntersectionStatus", "header intersection_index intersection_status intersection_status_time"
        )
        self._make_all = context.maker("morai_msgs/IntscnTL", "header idx state delta_time")
        self._make_info = context.maker("morai_msgs/MoraiTLInfo", "header idx status")

    def bind(self, bindings: SubscribersServices) -> None:
        """Subscribe to commands for lights and intersections, and offer the service that returns a light's state."""
        bindings.listen("SetTrafficLight", "SetTrafficLight", self._set_light)
        bindings.listen("InsnControl", "IntersectionControl", self._set_phase)
        bindings.provide("Morai_TLSrv", "MoraiTLInfoSrv", self._tell_light)

    def publish(self, publishers: Publishers) -> None:
        """Publish the state of all intersections."""
        publishers.add("/IntscnTL_topic", "morai_msgs/IntscnTL", self._intersections, is_shown_in_pause=True)

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:
        """Publish the light ahead of the ego, and the intersection around it."""
        for name, kind, make in (
            ("GetTrafficLightStatus", "morai_msgs/GetTrafficLightStatus", self._light_ahead),
            ("InsnStatus", "morai_msgs/IntersectionStatus", self._intersection_around),
        ):
            publishers.add(prefix + name, kind, partial(make, ego), is_shown_in_pause=True)

    # Out

    @property
    def _signals(self) -> Signals:
        return self._context.world.signals

    def _header(self, frame_id: str) -> Struct:
        return self._context.convert.header(self._context.world.frame, frame_id)

    def _place(self, ego: Ego) -> tuple[int, float] | None:
        """Return the ego's lane and arc length on it [m]; None off the road, or on the wrong side of it."""
        world, row = self._context.world, ego.row
        places = world.roads.nearest(world.x[row], world.y[row], world.yaw[row], world.z[row])
        is_along = math.cos(places.yaw[0] - world.yaw[row]) > 0.0
        if not (places.distance[0] <= MAX_LIGHT_TO_LANE and is_along):
            return None
        return int(places.lane[0]), float(places.s[0])

    def _light_ahead(self, ego: Ego) -> Struct:
        signals = self._signals
        place = self._place(ego) if signals.plan.lights else None
        light = None if place is None else light_ahead(self._context.world.roads, signals.plan, *place, STOP_LINE_REACH)
        if light is None:
            return None
        known = signals.plan.lights[light]
        return self._make_light(
            self._header("TrafficLightStatus"), known.name, light_type(known), int(signals.shown[light])
        )

    def _intersection_around(self, ego: Ego) -> Struct:
        signals = self._signals
        place = self._place(ego) if signals.plan.controllers else None
        controller = -1 if place is None else int(signals.plan.controller_of_lane[place[0]])
        if controller < 0:
            return None
        return self._make_status(
            self._header("IntersectionStatus"),
            signals.plan.controllers[controller].number,
            int(signals.phase[controller]),
            round32(signals.elapsed(controller) * DT),
        )

    def _intersections(self) -> Struct:
        signals = self._signals
        controllers = signals.plan.controllers
        return self._make_all(
            self._header("IntscnTL"),
            [controller.name for controller in controllers],
            signals.phase.tolist(),
            [round32(signals.remaining(i) * DT) for i in range(len(controllers))],
        )

    # In

    def _set_light(self, message: Struct, sender: Participant, _now: float) -> None:
        where, index, status = "morai_msgs/SetTrafficLight", message.trafficLightIndex, message.trafficLightStatus
        signals = self._signals
        try:
            light = signals.plan.light(index)
        except KeyError:
            raise FieldError(f"{where}.trafficLightIndex: the map has no traffic light {index[:80]!r}") from None
        if status == UNSET:
            signals.release(light)
        elif status & ~_LAMPS:
            raise FieldError(f"{where}.trafficLightStatus: expected a sum of lamps, or -1 to hand back, got {status}")
        elif status & ~(known := signals.plan.lamps_of_group(light)):
            lamps = " + ".join(str(int(lamp)) for lamp in Lamp if lamp & known)
            text = f"traffic light {index[:80]!r} and those of its group have the lamps {lamps}"
            raise FieldError(f"{where}.trafficLightStatus: {text}; expected a sum of some of them, got {status}")
        else:
            signals.force(light, status)
        _log.debug("traffic light %s: %d by %s", index, status, sender.name)

    def _set_phase(self, message: Struct, sender: Participant, _now: float) -> None:
        where = "morai_msgs/IntersectionControl"
        number, phase = message.intersection_index, message.intersection_status
        seconds = message.intersection_status_time
        signals = self._signals
        numbers = [controller.number for controller in signals.plan.controllers]
        if number not in numbers:
            raise FieldError(f"{where}.intersection_index: the map has no intersection {number}")
        controller = numbers.index(number)
        num_phases = int(signals.plan.num_phases[controller])
        if not 0 <= phase < num_phases:
            raise FieldError(f"{where}.intersection_status: intersection {number} has {num_phases} phases, got {phase}")
        length = signals.phase_length(controller, phase)
        if not (math.isfinite(seconds) and 0 <= round(seconds / DT) < length):
            raise FieldError(
                f"{where}.intersection_status_time: phase {phase} lasts {length * DT:.2f} s, got {seconds}"
            )
        signals.set_phase(controller, phase, round(seconds / DT))
        _log.debug("intersection %d: phase %d, %.2f s, by %s", number, phase, seconds, sender.name)

    def _tell_light(self, call: Call, _now: float) -> None:
        request: Any = call.request
        index = request.request.idx
        signals = self._signals
        try:
            status = int(signals.shown[signals.plan.light(index)])
        except KeyError:
            index, status = "", NO_LIGHT
        call.respond(self._make_info(self._header("TrafficLightStatus"), index, status))
