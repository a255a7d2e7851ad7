"""The lane change model: what a mean driver accelerates with, and which changes are safe."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.lane_changes.lane_change_model import find_safe, follow


@pytest.mark.parametrize(
    ("speed", "desired", "gap", "lead_speed", "accel"),
    [
        (0.0, 20.0, np.inf, 0.0, 1.5),
        (20.0, 20.0, np.inf, 0.0, 0.0),
        (10.0, 20.0, np.inf, 0.0, 1.5 * 15 / 16),
        (10.0, 10.0, 14.0, 10.0, -1.5),  # 2 m and 1.2 s
        (10.0, 10.0, 28.0, 10.0, -1.5 / 4),
        (40.0, 20.0, np.inf, 0.0, -3.0),  # as hard as a driver brakes for a limit
        (10.0, 10.0, 2.0, 30.0, -1.5),  # one that gets away leaves the standing gap alone
    ],
)
def test_mean_driver_accelerates_by_the_intelligent_driver_model(
    speed: float, desired: float, gap: float, lead_speed: float, accel: float
) -> None:
    given = [np.array([value]) for value in (speed, desired, gap, lead_speed)]
    assert follow(*given).tolist() == [pytest.approx(accel)]


@pytest.mark.parametrize(
    ("speed", "other", "least"),
    [
        (0.0, 0.0, 2.0),  # corners reach out
        (10.0, 20.0, 6.0),  # and 0.4 s
        (20.0, 10.0, 51.25),  # the one behind brakes with 4 m/s^2 at most
        (10.0, 10.0, 8.57),
    ],
)
def test_change_needs_room_and_spares_the_one_behind_hard_braking(speed: float, other: float, least: float) -> None:
    """In each case one drives behind with `speed`, and one ahead with `other`."""
    for gap, is_safe in ((least - 0.2, False), (least + 0.2, True)):
        free, behind, ahead = np.array([np.inf]), np.array([speed]), np.array([other])
        near = np.array([gap])
        assert find_safe(behind, near, ahead, free, np.zeros(1)).tolist() == [is_safe]
        assert find_safe(ahead, free, np.zeros(1), near, behind).tolist() == [is_safe]


def test_one_driver_follows_as_many_do() -> None:
    given = np.random.default_rng(0).uniform(0.0, 15.0, (4, 200))
    given[2, :20] = np.inf
    one_by_one = [follow(*given[:, i : i + 1]).item() for i in range(200)]
    assert one_by_one == follow(*given).tolist()
