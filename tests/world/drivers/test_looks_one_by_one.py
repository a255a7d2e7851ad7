"""The look of few drivers gives the same bits as that of many."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from rosbridge_sim.world.drivers import driver_model, driver_perception
from rosbridge_sim.world.drivers.driver_model import Perception, SlowVehicles, accelerate
from rosbridge_sim.world.drivers.driver_perception import perceive
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.worlds.worlds import Worlds
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


def test_few_drivers_of_many_worlds_look_as_many_do(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = (Worlds("parking", 3, traffic=1, seed=1) for _ in range(2))
    for _ in range(3):
        one.step(n=20)
        with monkeypatch.context() as patched:
            patched.setattr(driver_perception, "FEW", 0)
            other.step(n=20)
        assert one.digests() == other.digests()
