"""Environments of a story -> the weathers that cameras and lidars know, and the friction of the road."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.world.state.entity_types import MIN_FRICTION_SHARE

FOG_RANGE: Final = 1_000.0
"""Fog is air in which one sees less far than this [m] (WMO)."""

TWILIGHT: Final = 0.105
"""So far below the horizon the sun ends the civil twilight: 6 degrees [rad]. As far above it light is still that of
dusk; that is our choice."""


def find_weather(environment: StoryItem) -> str:
    """Return the weather that is most like an `Environment`: fog, rain, night, dusk or noon; empty if it tells none."""
    weather = environment.find("Weather")
    sun, fog, rain = (None if weather is None else weather.find(kind) for kind in ("Sun", "Fog", "Precipitation"))
    if fog is not None and fog["visualRange"] < FOG_RANGE:
        return "fog"
    intensity = 0.0 if rain is None else rain.get("precipitationIntensity", rain.get("intensity", 0.0))
    if rain is not None and rain["precipitationType"] == "rain" and intensity > 0.0:
        return "rain"
    if sun is not None and sun["elevation"] < TWILIGHT:
        return "night" if sun["elevation"] < -TWILIGHT else "dusk"
    return "" if weather is None or not (sun or fog or rain) else "noon"


def find_friction(environment: StoryItem) -> float | None:
    """Return the friction of the road relative to a dry one, within bounds; None if it is not told."""
    road = environment.find("RoadCondition")
    return None if road is None else min(max(road["frictionScaleFactor"], MIN_FRICTION_SHARE), 1.0)
