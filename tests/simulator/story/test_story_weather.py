"""Environments of stories: the weather of cameras and lidars, and the friction of the road."""

from __future__ import annotations

import pytest

from rosbridge_sim.simulator.sensor_rigs.weather import WeatherControl
from rosbridge_sim.simulator.snapshots.node_state import NodeState
from tests.simulator.story.story_texts import Telling, after, event, group, link, speed, story, teleport

EGO = {"Ego": teleport(link("middle", 20)) + speed(10)}
SUN = '<Sun azimuth="0" elevation="{}" illuminance="1000"/>'
CLEAR = '<Fog visualRange="100000"/><Precipitation precipitationType="dry" precipitationIntensity="0"/>'
RAIN = '<Precipitation precipitationType="rain" precipitationIntensity="5"/>'


def environment(weather: str, road: str = "") -> str:
    time = '<TimeOfDay animation="false" dateTime="2026-01-01T12:00:00"/>'
    inner = f'<Weather fractionalCloudCover="zeroOktas">{weather}</Weather>' if weather else ""
    environment = f'<Environment name="e">{time}{inner}{road}</Environment>'
    return f"<GlobalAction><EnvironmentAction>{environment}</EnvironmentAction></GlobalAction>"


def told(action: str) -> Telling:
    return Telling(story(EGO, group("Ego", event("change", action, after(0.2)))))


@pytest.mark.parametrize(
    ("weather", "expected"),
    [
        (SUN.format(0.5) + CLEAR, "noon"),
        (SUN.format(0.0) + CLEAR, "dusk"),
        (SUN.format(-0.3) + CLEAR, "night"),
        (SUN.format(-0.3) + RAIN, "rain"),
        ('<Fog visualRange="300"/>' + RAIN, "fog"),
        ('<Precipitation precipitationType="snow" intensity="5"/>', "noon"),
        ("", "dusk"),  # as it was
    ],
)
def test_cameras_have_the_weather_that_is_most_like_an_environment(weather: str, expected: str) -> None:
    telling = told(environment(weather))
    control = telling.node.component(WeatherControl)
    control.set("dusk")
    telling.run(0.1)
    assert control.weather == "dusk"
    telling.run(0.3)
    assert control.weather == expected


@pytest.mark.parametrize(("factor", "share"), [(0.5, 0.5), (3.0, 1.0), (-1.0, 0.1)])
def test_the_friction_of_the_road_is_that_of_the_environment_within_bounds(factor: float, share: float) -> None:
    telling = told(environment("", f'<RoadCondition frictionScaleFactor="{factor}"/>'))
    telling.run(0.4)
    assert telling.world.friction_share == share


def test_weather_of_init_holds_at_once_and_again_after_a_reset_and_a_restore() -> None:
    init = environment(RAIN).replace("<GlobalAction>", "").replace("</GlobalAction>", "")
    text = story(EGO).replace("<Init><Actions>", f"<Init><Actions><GlobalAction>{init}</GlobalAction>")
    telling = Telling(text)
    control = telling.node.component(WeatherControl)
    assert control.weather == "rain"
    state = NodeState(telling.node.context, telling.node.components)
    saved = state.save()
    control.set("noon")
    telling.node.context.scene_changes.reset(None, 0.0)
    assert control.weather == "rain"
    control.set("noon")
    state.restore(saved, 0.0, before_undo=lambda: None)
    assert control.weather == "rain"
