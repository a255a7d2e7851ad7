"""The driver model: behind a lead vehicle, after a cut-in, and how drivers brake for what stands still."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_model import GAP, HARDEST, Perception, accelerate, firm_stop
from rosbridge_sim.world.drivers.driver_parameters import CAR, FIGURES, DriverParameters
from rosbridge_sim.world.geometry.planar import FloatArray


def typical(**figures: float) -> DriverParameters:
    """The mean driver of a car, but for some figures."""
    means = {each.name: FIGURES[each.name][CAR].mean for each in fields(DriverParameters)}
    return DriverParameters(**{name: np.array([value]) for name, value in (means | figures).items()})


def chosen(speed: float, lead: float, gap: float, *, lead_accel: float = 0.0, safe: float = 40.0) -> float:
    """The acceleration of the mean driver behind a lead vehicle."""
    one, none = np.ones(1), np.full(1, np.inf)
    no = np.zeros(1, dtype=np.bool_)
    lead_index = np.zeros(1, dtype=np.int64)
    seen = Perception(gap * one, lead * one, lead_accel * one, lead_index, none, safe * one, no, no)
    return accelerate(speed * one, seen, typical()).item()


@pytest.mark.parametrize(
    ("speed", "lead", "gap"), [(20.0, 15.0, 60.0), (15.0, 0.0, 80.0), (10.0, 10.0, 13.0), (20.0, 15.0, 50.0)]
)
def test_following_equals_the_intelligent_driver_model(speed: float, lead: float, gap: float) -> None:
    """A weaker closing term brakes late and hard, a stronger one much too early."""
    driver = typical()
    a, b, headway = (value.item() for value in (driver.accel, driver.comfort, driver.headway))
    wanted = GAP + headway * speed + speed * (speed - lead) / (2.0 * math.sqrt(a * b))
    share = (wanted / gap) ** (2 if wanted > gap else 4)
    assert chosen(speed, lead, gap) == pytest.approx(min(a * (1 - (speed / 40.0) ** 4), a * (1.0 - share)))


def test_gap_of_equal_speed_is_that_of_the_headway_up_to_the_desired_speed() -> None:
    assert chosen(39.9, 39.9, GAP + 39.9 * typical().headway.item()) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("gap", [6.0, 8.0, 10.0])
@pytest.mark.parametrize("speed", [11.0, 14.0, 25.0, 33.0])
def test_cut_in_at_equal_speed_is_taken_calmly(speed: float, gap: float) -> None:
    assert -3.0 < chosen(speed, speed, gap) < 0.0


@pytest.mark.parametrize(("lead", "lead_accel", "gap"), [(5.0, 0.0, 10.0), (15.0, -8.0, 6.0), (0.0, 0.0, 18.0)])
def test_cut_in_that_is_dangerous_is_answered_by_hard_braking(lead: float, lead_accel: float, gap: float) -> None:
    assert chosen(15.0, lead, gap, lead_accel=lead_accel) < -4.5


def test_many_drivers_at_once_decide_as_each_alone_to_the_bit() -> None:
    rng, num = np.random.default_rng(1), 333
    figures = {each.name: rng.uniform(0.5, 2.5, num) for each in fields(DriverParameters)}
    figures["desired_speed"] = rng.uniform(5.0, 30.0, num)
    speed, lead_speed, safe = rng.uniform(0.0, 25.0, (3, num))
    gap, stop = rng.uniform(0.0, 60.0, (2, num))
    gap[::5] = stop[::2] = np.inf
    lead_accel, lead, no = rng.uniform(-5.0, 3.0, num), np.zeros(num, dtype=np.int64), np.zeros(num, dtype=np.bool_)

    def decide(part: slice) -> FloatArray:
        figures_seen = (gap[part], lead_speed[part], lead_accel[part], lead[part], stop[part], safe[part])
        seen = Perception(*figures_seen, is_shut_out=no[part], is_blocked=no[part])
        return accelerate(speed[part], seen, DriverParameters(*(figure[part] for figure in figures.values())))

    alone = np.concatenate([decide(slice(i, i + 1)) for i in range(num)])
    assert decide(slice(None)).tobytes() == alone.tobytes()


def test_no_acceleration_is_beyond_the_bounds() -> None:
    """Over all speeds, gaps and accelerations, with the corners where a quotient could lose its bottom."""
    speeds, gaps, accels = (0.0, 1e-9, 0.3, 15.0, 60.0), (-5.0, 0.0, 1e-9, 2.0, 30.0, 1e9), (-9.0, -1e-12, 0.0, 3.0)
    values = [
        chosen(speed, lead, gap, lead_accel=accel)
        for speed in speeds
        for lead in speeds
        for gap in gaps
        for accel in accels
    ]
    assert np.isfinite(values).all()
    assert min(values) >= -HARDEST
    assert max(values) <= typical().accel.item()


def test_firm_stop_ends_at_the_same_place_at_each_moment_of_it() -> None:
    speed, accel, place, dt = 14.0, 1.0, 0.0, 1e-3
    reaction = np.full(1, 0.3)
    expected = firm_stop(np.full(1, speed), np.full(1, accel), reaction)
    while speed > 11.0:
        accel += (-4.0 - accel) * dt / 0.3
        speed, place = speed + accel * dt, place + speed * dt
        now = place + firm_stop(np.full(1, speed), np.full(1, accel), reaction)
        assert now == pytest.approx(expected, abs=0.02)
