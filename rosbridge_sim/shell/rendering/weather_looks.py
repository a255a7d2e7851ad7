"""Light and air of each weather, as the figures that the shaders take."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.records import Record
from rosbridge_sim.scenery.pictures import Weather

Rgb = tuple[float, float, float]


class WeatherLook(Record):
    """Light and air; colours are 0..1.

    Attributes:
        sun: direction to the sun, east, north, up; need not have length 1.
        direct: light of the sun on what looks straight up.
        ambient: light from everywhere.
        zenith, horizon: of the sky.
        is_dark: lamps are lit, and head lamps light the road.
        beam: light of these on what is right before them, as a share of noon.
        is_wet: roads shine, and drops fall.
        shadow: how dark the shadows below vehicles are, 0..1.
    """

    sun: Rgb
    direct: Rgb
    ambient: Rgb
    zenith: Rgb
    horizon: Rgb
    is_dark: bool = False
    beam: float = 0.0
    is_wet: bool = False
    shadow: float = 0.5


LOOKS: Final = {
    # At noon light and ambient add up to 1 on a level road, so paint has there the colour that its masks expect.
    Weather.NOON: WeatherLook(
        (-0.35, -0.55, 0.95), (0.54, 0.53, 0.50), (0.46, 0.47, 0.50), (0.24, 0.45, 0.76), (0.50, 0.68, 0.86)
    ),
    Weather.DUSK: WeatherLook(
        *((-0.95, -0.25, 0.22), (0.26, 0.15, 0.07), (0.27, 0.26, 0.33), (0.17, 0.20, 0.38), (0.86, 0.52, 0.33)),
        is_dark=True,
        beam=0.9,
        shadow=0.3,
    ),
    Weather.NIGHT: WeatherLook(
        *(
            (0.3, 0.3, 0.9),
            (0.02, 0.025, 0.035),
            (0.085, 0.09, 0.115),
            (0.015, 0.02, 0.04),
            (0.05, 0.055, 0.075),
        ),
        is_dark=True,
        beam=9.0,
        shadow=0.2,
    ),
    Weather.RAIN: WeatherLook(
        *((0.0, 0.0, 1.0), (0.06, 0.06, 0.06), (0.55, 0.56, 0.58), (0.42, 0.45, 0.48), (0.56, 0.58, 0.60)),
        is_wet=True,
        shadow=0.3,
    ),
    Weather.FOG: WeatherLook(
        *((0.0, 0.0, 1.0), (0.05, 0.05, 0.05), (0.74, 0.75, 0.76), (0.72, 0.73, 0.74), (0.73, 0.74, 0.75)),
        shadow=0.2,
    ),
}
"""The look of each weather."""
