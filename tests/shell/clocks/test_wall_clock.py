"""The clock of stamps, when the system clock is set."""

from __future__ import annotations

import time
from itertools import pairwise

from rosbridge_sim.shell.clocks.wall_clock import WallClock

SECOND = 1_000_000_000
DAY = 1_700_000_000 * SECOND


class Times:
    """Two clocks of a system.

    Attributes:
        wall, steady: what they say [ns].
    """

    def __init__(self) -> None:
        self.wall, self.steady = DAY, 5
        self.clock = WallClock(lambda: self.wall, lambda: self.steady)

    def after(self, passed_ns: int) -> int:
        self.wall += passed_ns
        self.steady += passed_ns
        return self.clock.read_ns()


def test_wall_clock_follows_the_system_time() -> None:
    times = Times()
    assert [times.after(SECOND) for _ in range(3)] == [DAY + SECOND, DAY + 2 * SECOND, DAY + 3 * SECOND]
    before = time.time_ns()
    assert before <= WallClock().read_ns() <= time.time_ns()


def test_wall_clock_runs_at_half_speed_after_the_system_clock_was_set_back() -> None:
    times = Times()
    seen = [times.after(20_000_000)]
    times.wall -= SECOND // 10
    seen += [times.after(20_000_000) for _ in range(20)]
    steps = [after - before for before, after in pairwise(seen)]
    assert min(steps) >= 10_000_000
    assert steps[:9] == [10_000_000] * 9
    assert seen[-1] == times.wall


def test_wall_clock_follows_a_system_clock_set_forward() -> None:
    times = Times()
    times.after(SECOND)
    times.wall += 3_600 * SECOND
    assert times.after(SECOND) == times.wall


def test_wall_clock_readings_are_strictly_increasing() -> None:
    times = Times()
    assert [times.after(0) for _ in range(3)] == [DAY, DAY + 1, DAY + 2]
    times.wall = 0
    assert times.after(0) == DAY + 3


def test_stamps_differ_where_the_systems_clock_moves_in_coarse_steps() -> None:
    step = 15_625_000  # of Windows
    times = Times()
    seen = [times.after(step if i % 4 == 0 else 0) for i in range(400)]
    assert all(later > earlier for earlier, later in pairwise(seen))
    assert 0 <= seen[-1] - (DAY + 100 * step) < 4
