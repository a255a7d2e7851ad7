"""People of the built-in scenes: who crosses, and where there are lights for them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.world.people.crossings import Crossings, find_crossings
from rosbridge_sim.world.roads.paths import lay_segments
from tests.world.road_factory import built_in

SCENES = Path(__file__).resolve().parents[2] / "rosbridge_sim" / "data" / "scenarios"


@cache
def crossings_of(scene: str, map_name: str) -> list[Crossings]:
    """The crossings of each pedestrian of a scene that heeds the traffic."""
    road_map = built_in(map_name)
    scenario = read_scenario((SCENES / f"{scene}.json").read_bytes(), f"{scene}.json")
    paths = [(spawn.path, spawn.is_loop) for spawn in scenario.pedestrians if spawn.yields and spawn.path is not None]
    return [
        find_crossings(lay_segments(np.asarray(path), is_loop=is_loop, reach=0.5), road_map.roads, road_map.plan, 0.9)
        for path, is_loop in paths
    ]


@pytest.mark.parametrize(
    ("scene", "map_name", "num"), [("demo", "track", 4), pytest.param("town", "town", 40, marks=pytest.mark.slow)]
)
def test_people_of_a_scene_cross_its_streets(scene: str, map_name: str, num: int) -> None:
    crossings = crossings_of(scene, map_name)
    assert len(crossings) == num
    assert all(len(each.start) > 0 for each in crossings)


def test_people_of_the_demo_cross_by_lights_behind_the_start_of_its_ego() -> None:
    crossings = crossings_of("demo", "track")
    assert all((each.light >= 0).all() for each in crossings)
    assert sum(bool((np.abs(each.ends[:, ::2] + 5.0) < 5.0).all()) for each in crossings) >= 2
