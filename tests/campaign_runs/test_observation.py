"""What a driver in Python is given: numbers for one world, arrays for several."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.campaign_runs.observation import Observation
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.worlds.drivable_worlds import DrivableWorlds
from tests.world.road_factory import ego, road


def worlds_of(*speeds: float) -> DrivableWorlds:
    found = []
    for i, speed in enumerate(speeds):
        world = OneOfMany(seed=5 + i)
        world.roads = road(100.0)
        world.start_scoring()
        world.frame = 3
        ego(world, 20.0, 0.5, speed=speed)
        found.append(world)
    return DrivableWorlds(found)


def test_one_world_is_told_in_numbers() -> None:
    seen = Observation(worlds_of(4.0), [{"gap": 2.0}], is_single=True)
    assert seen.time == pytest.approx(0.06)
    assert (seen.seed, seen.parameters) == (5, {"gap": 2.0})
    assert (seen.ego["speed"], seen.ego["x"]) == (4.0, 20.0)
    assert isinstance(seen.ego["speed"], float)
    lane = seen.lane([10.0])
    assert (lane["offset"], lane["s"]) == (0.5, 20.0)
    assert lane["points"] == pytest.approx(np.array([[10.0, -0.5]]))
    assert seen.others(3).shape == (3, 9)


def test_several_worlds_are_told_in_arrays() -> None:
    parameters = [{"gap": 2.0}, {"gap": 3.0}]
    seen = Observation(worlds_of(4.0, 6.0), parameters, is_single=False)
    assert (seen.seed, seen.parameters) == ([5, 6], parameters)
    assert seen.ego["speed"].tolist() == [4.0, 6.0]
    assert seen.lane([10.0])["points"].shape == (2, 1, 2)
    assert seen.others(3).shape == (2, 3, 9)
