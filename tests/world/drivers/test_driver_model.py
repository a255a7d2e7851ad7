"""The driver model: behind a lead vehicle, after a cut-in, and how drivers brake for what stands still."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_model import (
    GAP,
    HARDEST,
    Perception,
    SlowVehicles,
    accelerate,
    firm_stop,
    gap_wanted,
    keep_gap,
)
from rosbridge_sim.world.drivers.driver_parameters import CAR, FIGURES, DriverParameters
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.geometry.planar import FloatArray


def typical(**figures: float) -> DriverParameters:
    """The mean driver of a car, but for some figures."""
    means = {each.name: FIGURES[each.name].item(0, CAR) for each in fields(DriverParameters)}
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


def follow_by_the_papers(speed: float, lead: float, gap: float, lead_accel: float, driver: dict[str, float]) -> float:
    """The acceleration behind a lead vehicle, written from the equations at the head of `driver_model`."""
    a, b, gap = driver["accel"], driver["comfort"], max(gap, 0.1)
    closing, lead_accel = speed - lead, min(lead_accel, a)
    wanted = 2.5 + max(speed * driver["headway"] + speed * closing / (2.0 * math.sqrt(a * b)), 0.0)
    idm = max(a * (1.0 - (wanted / gap) ** (2 if wanted > gap else 4)), -8.0)
    room = lead**2 - 2.0 * gap * lead_accel
    if lead * closing <= -2.0 * gap * lead_accel and room > 0.0:
        heuristic = speed**2 * lead_accel / room
    else:
        heuristic = lead_accel - max(closing, 0.0) ** 2 / (2.0 * gap)
    q = (idm - heuristic) / b
    return idm if q >= 0.0 else 0.01 * idm + 0.99 * (heuristic + b * q / math.sqrt(1.0 + q * q))


def stop_by_the_rules(free: float, speed: float, distance: float) -> float:
    """The acceleration towards a place to stop: needed deceleration, taken from 1.25 to 1.75 m/s^2 on."""
    left = distance - 1.0
    needed = math.inf if left <= 0.0 else speed**2 / (2.0 * max(left, 1e-3))
    if needed > 4.0:  # beyond firm braking the way up to the line counts, but for a tenth
        needed = min(needed, max(speed**2 / (2.0 * max(0.9 * distance, 1e-3)), 4.0))
    share = 1.0 if left < 0.3 else min(max((needed - 1.25) / 0.5, 0.0), 1.0)
    return min(free, free - share * (free + needed))


def accelerate_by_the_papers(
    seen: dict[str, float], driver: dict[str, float], *, slow: tuple[float, ...] = ()
) -> float:
    """The acceleration of one driver, number by number."""
    speed, wanted = seen["speed"], min(driver["desired_speed"], seen["safe"])
    if speed < wanted:
        chosen = driver["accel"] * (1.0 - min(speed / max(wanted, 0.1), 1.0) ** 4)
    else:
        chosen = max((wanted - speed) / 0.6, -4.0)
    if math.isfinite(seen["stop"]):
        chosen = stop_by_the_rules(chosen, speed, seen["stop"])
    if math.isfinite(seen["gap"]):
        chosen = min(chosen, follow_by_the_papers(speed, seen["lead"], seen["gap"], seen["lead_accel"], driver))
    if slow:
        chosen = min(chosen, follow_by_the_papers(speed, slow[1], slow[0], slow[2], driver))
    return max(chosen, -8.0)


def test_accelerations_are_those_of_the_equations_number_by_number() -> None:
    """Near and far leads, those that drive off and that brake, lines that are reached, passed, and far ahead."""
    rng, num = np.random.default_rng(5), 2_000
    drivers = {each.name: rng.uniform(0.6, 2.4, num) for each in fields(DriverParameters)}
    drivers["desired_speed"] = rng.uniform(0.0, 30.0, num)
    seen = {
        "speed": rng.choice([0.0, 0.05, 1.0, 1.0], num) * rng.uniform(0.0, 25.0, num),
        "safe": rng.uniform(0.0, 30.0, num),
        "lead": rng.choice([0.0, 1.0], num) * rng.uniform(0.0, 25.0, num),
        "lead_accel": rng.choice([0.0, 1.0, 1.0], num) * rng.uniform(-6.0, 3.0, num),
        "gap": rng.choice([0.05, 1.0, 10.0, np.inf], num) * rng.uniform(0.5, 10.0, num),
        "stop": rng.choice([0.2, 1.0, 30.0, np.inf], num) * rng.uniform(0.5, 3.0, num),
    }
    slow_gap, slow_speed, slow_accel = (
        rng.uniform(1.0, 60.0, num // 4),
        rng.uniform(0.0, 8.0, num // 4),
        rng.uniform(-3.0, 1.0, num // 4),
    )
    slow_of = rng.choice(num, num // 4, replace=False)
    no, lead_index = np.zeros(num, dtype=np.bool_), np.zeros(num, dtype=np.int64)
    perception = Perception(
        *(seen["gap"], seen["lead"], seen["lead_accel"], lead_index, seen["stop"], seen["safe"], no, no),
        slow=SlowVehicles(slow_of, slow_gap, slow_speed, slow_accel),
    )
    found = accelerate(seen["speed"], perception, DriverParameters(**drivers))
    slow = dict(zip(slow_of.tolist(), zip(slow_gap, slow_speed, slow_accel, strict=True), strict=True))
    expected = [
        accelerate_by_the_papers(
            {name: value.item(i) for name, value in seen.items()},
            {name: value.item(i) for name, value in drivers.items()},
            slow=slow.get(i, ()),
        )
        for i in range(num)
    ]
    assert found == pytest.approx(np.array(expected), rel=1e-9, abs=1e-9)


def test_wanted_gap_and_its_acceleration_are_those_of_the_paper() -> None:
    driver = typical()
    a, b, headway = (value.item() for value in (driver.accel, driver.comfort, driver.headway))
    for speed, closing in [(10.0, 3.0), (20.0, -30.0), (0.0, 5.0)]:
        wanted = 2.5 + max(speed * headway + speed * closing / (2.0 * math.sqrt(a * b)), 0.0)
        assert gap_wanted(
            ARRAYS, np.array([speed]), np.array([closing]), driver.accel, driver.comfort, driver.headway
        ).item() == pytest.approx(wanted)
        for gap, power in [(0.5 * wanted, 2), (2.0 * wanted, 4)]:
            found = keep_gap(ARRAYS, driver.accel, np.array([wanted]), np.array([gap])).item()
            assert found == pytest.approx(a * (1.0 - (wanted / gap) ** power))


def test_driver_nearer_than_a_foot_to_its_place_to_stand_does_not_creep_to_it() -> None:
    none = np.full(1, np.inf)
    no, lead = np.zeros(1, dtype=np.bool_), np.full(1, -1, dtype=np.int64)
    for distance, sets_off in [(1.2, False), (1.4, True), (0.4, False)]:
        seen = Perception(none, np.zeros(1), np.zeros(1), lead, np.full(1, distance), np.full(1, 20.0), no, no)
        accel = accelerate(np.zeros(1), seen, typical()).item()
        assert (accel > 0.0) == sets_off


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
    expected = firm_stop(ARRAYS, np.full(1, speed), np.full(1, accel), reaction)
    while speed > 11.0:
        accel += (-4.0 - accel) * dt / 0.3
        speed, place = speed + accel * dt, place + speed * dt
        now = place + firm_stop(ARRAYS, np.full(1, speed), np.full(1, accel), reaction)
        assert now == pytest.approx(expected, abs=0.02)
