"""The look of few drivers gives the same bits as that of many."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from rosbridge_sim.world.drivers import driver_model, driver_perception
from rosbridge_sim.world.drivers.driver_model import Perception, SlowVehicles, accelerate
from rosbridge_sim.world.drivers.driver_perception import perceive
from rosbridge_sim.world.drivers.lane_position import keep_lane
from rosbridge_sim.world.drivers.rule_operators import FEW
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.state.world import Body, Kind, World
from rosbridge_sim.world.step import step
from tests.world.drivers.test_looks_ahead_one_by_one import a_situation, again, blocks
from tests.world.road_factory import built_in


@pytest.fixture(scope="module")
def maps() -> list[LaneConflicts]:
    return [LaneConflicts(built_in("town").roads), blocks()]


def few(monkeypatch: pytest.MonkeyPatch, num: int) -> None:
    """Take up to so many drivers one by one."""
    monkeypatch.setattr(driver_perception, "FEW", num)
    monkeypatch.setattr(driver_model, "FEW", num)


def bits(perception: Perception) -> list[bytes]:
    """The figures of all drivers."""
    slow = perception.slow
    columns: list[npt.NDArray[np.generic]] = [
        perception.gap,
        perception.lead_speed,
        perception.lead_accel,
        perception.lead,
    ]
    columns += [perception.stop_distance, perception.safe_speed, perception.is_shut_out, perception.is_blocked]
    columns += [] if slow is None else [getattr(slow, name) for name in SlowVehicles.__struct_fields__]
    return [column.tobytes() for column in columns]


@pytest.mark.parametrize("seed", range(40))
def test_few_drivers_perceive_and_choose_what_many_do(
    seed: int, maps: list[LaneConflicts], monkeypatch: pytest.MonkeyPatch
) -> None:
    case, may_enter = a_situation(maps, seed)
    found = []
    for num in (0, len(case.drivers.arc)):
        few(monkeypatch, num)
        one = again(case)
        drivers = one.drivers
        perception = perceive(one.conflicts, may_enter, drivers, one.others, one.num_moving)
        accel = accelerate(drivers.speed, perception, drivers.parameters)
        found.append([*bits(perception), drivers.claim.tobytes(), drivers.exit_lane.tobytes(), accel.tobytes()])
    assert found[0] == found[1]


def town_of(num: int) -> World:
    """The town with drivers, an ego beside the road and an obstacle on it."""
    world, rng, one = World(2), np.random.default_rng(num), built_in("town")
    world.lay_roads(one.roads, one.plan)
    world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=-5.25)
    length = one.roads.length
    places = [(lane, s) for lane in range(len(one.roads)) for s in np.arange(6.0, float(length[lane]) - 6.0, 14.0)]
    chosen = rng.permutation(len(places))[: num + 1].tolist()
    for lane, s in (places[i] for i in chosen[1:]):
        uid = world.spawn(Kind.VEHICLE, Body(), name="car", x=0.0, y=0.0, speed=float(rng.uniform(0.0, 12.0)))
        keep_lane(world, world.row(uid), lane, float(s))
    lane, s = places[chosen[0]]
    (x, y, _), _ = (values[0] for values in one.roads.at([lane], [s]))
    world.spawn(Kind.OBSTACLE, Body(), name="box", x=float(x), y=float(y))
    return world


@pytest.mark.parametrize("num", [1, 7, FEW])
def test_world_of_few_drivers_has_the_same_hash_each_time(num: int, monkeypatch: pytest.MonkeyPatch) -> None:
    digests = []
    for most in (0, FEW):
        few(monkeypatch, most)
        world, found = town_of(num), []
        for _ in range(300):
            step(world)
            found.append(world.digest() if world.frame % 25 == 0 else "")
        digests.append(found)
    assert digests[0] == digests[1]
