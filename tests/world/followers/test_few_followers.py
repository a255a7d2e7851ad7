"""Few vehicles on lanes, which are moved and decide one by one, give the same bits as arrays."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.drivers import driver_model, driver_perception
from rosbridge_sim.world.followers import lane_following
from rosbridge_sim.world.followers.self_driving import start_self_driving
from rosbridge_sim.world.state.world import Body, Gear, Kind, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import built_in, keep_lane


def town_of(num: int) -> World:
    """The town with `num` that follow lanes, with gaps between their rows, and a box.

    Some wander, and the last one of several is an ego that drives itself.
    """
    world, rng, one = World(2), np.random.default_rng(num), built_in("town")
    world.lay_roads(one.roads, one.plan)
    length = one.roads.length
    places = [(lane, s) for lane in range(len(one.roads)) for s in np.arange(6.0, float(length[lane]) - 6.0, 14.0)]
    chosen = [places[i] for i in rng.permutation(len(places))[: num + (num == 1) + 1].tolist()]
    for i, (lane, s) in enumerate(chosen[2:]):
        uid = world.spawn(Kind.VEHICLE, Body(), name="car", x=0.0, y=0.0, speed=float(rng.uniform(0.0, 12.0)))
        keep_lane(world, world.row(uid), lane, float(s), wander=0.15 * (i % 3 == 1))
        if i == num // 2:
            world.spawn(Kind.OBSTACLE, Body(), name="between", x=0.0, y=-500.0)
    for (lane, s), kind in zip(chosen[:2], (Kind.OBSTACLE, Kind.EGO), strict=True):
        places_there, yaw = one.roads.at([lane], [s])
        x, y = places_there[0, :2].tolist()
        row = world.row(world.spawn(kind, Body(), name="other", x=x, y=y, yaw=float(yaw[0])))
    if num > 1:
        world.gear[row] = Gear.DRIVE
        assert start_self_driving(world, row)
    return world


@pytest.mark.parametrize("num", [1, 3, lane_following.FEW, driver_perception.FEW, driver_model.FEW])
def test_few_vehicles_move_and_decide_as_many_do(num: int, monkeypatch: pytest.MonkeyPatch) -> None:
    one_by_one = drive(num)
    for module in (driver_model, driver_perception, lane_following):
        monkeypatch.setattr(module, "FEW", 0)
    assert drive(num) == one_by_one


def drive(num: int) -> list[str]:
    """Hashes of the world on its way."""
    world, digests = town_of(num), []
    assert world.has_lane.sum() == num
    start = world.arc.copy()
    for _ in range(80):
        step(world)
        digests.append(world.digest() if world.frame % 10 == 0 else "")
    assert (world.arc != start).any()
    return digests
