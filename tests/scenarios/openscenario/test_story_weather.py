"""Environments of stories: exact bounds of the weathers and of the friction."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.scenarios.openscenario.story_weather import find_friction, find_weather


def item(kind: str, *parts: StoryItem, **values: Any) -> StoryItem:  # noqa: ANN401 - attributes of an element
    return StoryItem(kind, values, parts, "")


def sun(elevation: float) -> StoryItem:
    return item("Sun", elevation=elevation)


def rain(kind: str = "rain", **values: float) -> StoryItem:
    return item("Precipitation", precipitationType=kind, **values)


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ((), ""),
        ((item("Wind"),), ""),
        ((item("Fog", visualRange=999.0),), "fog"),
        ((item("Fog", visualRange=1000.0),), "noon"),
        ((item("Fog", visualRange=999.0), rain(intensity=5.0), sun(-1.0)), "fog"),
        ((rain(precipitationIntensity=0.1, intensity=0.0),), "rain"),
        ((rain(precipitationIntensity=0.0, intensity=5.0),), "noon"),
        ((rain(intensity=0.1), sun(-1.0)), "rain"),
        ((rain(),), "noon"),
        ((rain("snow", intensity=5.0),), "noon"),
        ((rain(), sun(-0.2)), "night"),
        ((sun(0.105),), "noon"),
        ((sun(0.1),), "dusk"),
        ((sun(-0.105),), "dusk"),
        ((sun(-0.11),), "night"),
    ],
)
def test_weather_of_an_environment(parts: tuple[StoryItem, ...], expected: str) -> None:
    assert find_weather(item("Environment", item("Weather", *parts))) == expected


def test_environment_without_weather_or_road_tells_nothing() -> None:
    assert find_weather(item("Environment")) == ""
    assert find_friction(item("Environment")) is None
    shares = [
        find_friction(item("Environment", item("RoadCondition", frictionScaleFactor=f))) for f in (0.05, 0.4, 2.0)
    ]
    assert shares == [0.1, 0.4, 1.0]
