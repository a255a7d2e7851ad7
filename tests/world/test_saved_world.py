"""Bytes from outside: figures of lane followers that a step would read as an index are refused."""

from __future__ import annotations

import pytest

from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.entity_arrays import FLOATS, INTS
from rosbridge_sim.world.state.world import World
from tests.world.road_factory import car, road


def test_point_of_a_lane_follower_is_before_another_one() -> None:
    world = World(0)
    world.lay_roads(road())
    car(world, world.roads.ids[0], 1.0, speed=3.0)
    data, num = to_plain(world.snapshot()), len(world.roads.points)
    for point, is_good in ((num - 2, True), (num - 1, False)):
        data["ints"][INTS.index("point"), 0] = point
        if is_good:
            assert from_plain(data, world.roads, world.signals.plan).ints[INTS.index("point"), 0] == point
        else:
            with pytest.raises(ValueError, match=r"ints\.point"):
                from_plain(data, world.roads, world.signals.plan)


def test_leg_of_a_lane_follower_ends_on_its_lane() -> None:
    world = World(0)
    world.lay_roads(road())
    car(world, world.roads.ids[0], 1.0, speed=3.0)
    data = to_plain(world.snapshot())
    data["floats"][FLOATS.index("leg_end"), 0] = -1.0
    with pytest.raises(ValueError, match=r"floats\.leg_end"):
        from_plain(data, world.roads, world.signals.plan)
