"""The component of `/sim/weather`: light and air of what cameras and lidars see, and a friction of rain if one is set.

The friction is that of the ground below egos of the single track model. It is part of the world, and so of snapshots.
"""

from __future__ import annotations

import logging
from typing import Any

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.scenery.pictures import Weather
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.suggestions import hint

_log = logging.getLogger("rosbridge_sim.morai")


class WeatherControl(Component):
    """The component of the weather.

    Attributes:
        weather: of the pictures from the next one on.
    """

    def __init__(
        self, context: SimulatorContext, weather: Weather = Weather.NOON, *, rain_friction: float = 0.0
    ) -> None:
        """Begin with a weather.

        Args:
            weather: at the start, and after a reset.
            rain_friction: friction of the ground in rain, relative to a dry one; 0 for rain that changes none.
        """
        self._context = context
        self._rain_friction = rain_friction or 1.0
        self._start = weather
        self._reset()
        context.hooks.on_reset.append(self._reset)

    def _reset(self) -> None:
        self.set(self._start)

    def set(self, weather: str = "", friction: float | None = None) -> None:
        """Change the weather.

        Args:
            weather: a `Weather`; empty for the present one.
            friction: of the ground, relative to a dry one; None for that of the weather.
        """
        self.weather: Weather = Weather(weather or self.weather)
        own = self._rain_friction if self.weather is Weather.RAIN else 1.0
        self._context.world.set_friction_share(own if friction is None else friction)

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service."""
        bindings.provide("sim/weather", "rosbridge_sim_msgs/Weather", self._serve)

    def save_state(self) -> PlainData:
        """Return the weather; None for noon."""
        return None if self.weather is Weather.NOON else self.weather.value

    def load_state(self, data: PlainData, now: float) -> None:  # noqa: ARG002 - nothing is published
        """Have the saved weather; the world has its friction. See `Component.load_state`."""
        self.weather = Weather.NOON if data is None else Weather(data)

    def _serve(self, call: Call, _now: float) -> None:
        request: Any = call.request
        name, message = request.weather, ""
        if name in set(Weather):
            self.set(name)
            _log.info("weather %s, set by %s", name, call.caller.name)
        elif name:
            known = [each.value for each in Weather]
            error = FieldError(
                f"weather: expected one of {', '.join(known)}, or nothing to ask; got {name[:40]!r}{hint(name, known)}"
            )
            message = str(error)
            call.explain(message, error.reason)
        call.respond(result=not message, message=message, weather=self.weather.value)
