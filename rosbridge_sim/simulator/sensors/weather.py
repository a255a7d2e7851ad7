"""The component of `/sim/weather`: light and air of what cameras and lidars see. The world drives as in any other."""

from __future__ import annotations

import logging
from typing import Any

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.participant import explain
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.scenery.pictures import Weather
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.suggestions import hint

__all__ = ["WeatherControl"]

_log = logging.getLogger("rosbridge_sim.morai")


class WeatherControl(Component):
    """The component of the weather.

    Attributes:
        weather: of the pictures from the next one on.
    """

    def __init__(self, context: SimulatorContext, weather: Weather = Weather.NOON) -> None:
        """Begin with a weather.

        Args:
            weather: at the start, and after a reset.
        """
        self.weather = self._start = weather
        context.hooks.on_reset.append(self._reset)

    def _reset(self) -> None:
        self.weather = self._start

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service."""
        bindings.provide("sim/weather", "rosbridge_sim_msgs/Weather", self._serve)

    def save_state(self) -> PlainData:
        """Return the weather; None for noon."""
        return None if self.weather is Weather.NOON else self.weather.value

    def load_state(self, data: PlainData, now: float) -> None:  # noqa: ARG002 - nothing is published
        """Have the saved weather; see `Component.load_state`."""
        self.weather = Weather.NOON if data is None else Weather(data)

    def _serve(self, call: Call, _now: float) -> None:
        request: Any = call.request
        name, message = request.weather, ""
        if name in set(Weather):
            self.weather = Weather(name)
            _log.info("weather %s, set by %s", name, call.caller.name)
        elif name:
            known = [each.value for each in Weather]
            error = FieldError(
                f"weather: expected one of {', '.join(known)}, or nothing to ask; got {name[:40]!r}{hint(name, known)}"
            )
            message = str(error)
            explain(call.caller, "error", f"{call.service.name}: {message}", error.reason)
        respond = call.service.type.response.struct_type
        call.answer(respond(result=not message, message=message, weather=self.weather.value))
