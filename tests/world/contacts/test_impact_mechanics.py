from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.contacts.impact_mechanics import (
    FRICTION,
    RESTITUTION,
    SLOP,
    Rigid,
    find_contact,
    find_impact,
    play,
)
from rosbridge_sim.world.contacts.impact_mechanics import strike as hit
from tests.mutations import examples

DT = 0.02


def car(  # noqa: PLR0917 - place, motion and body
    x: float = 0.0,
    y: float = 0.0,
    yaw: float = 0.0,
    vx: float = 0.0,
    vy: float = 0.0,
    rate: float = 0.0,
    *,
    per_mass: float = 1 / 1500.0,
    per_inertia: float = 1 / 2500.0,
    centre: float = 0.0,
    half_length: float = 2.2,
    half_width: float = 0.9,
) -> Rigid:
    """A car of 1.5 t, 4.4 m by 1.8 m, with its centre of gravity in the middle."""
    motion = vx * DT, vy * DT, rate * DT, vx, vy, rate
    return Rigid(x, y, yaw, *motion, per_mass, per_inertia, centre, half_length, half_width)


def wall(x: float, y: float = 0.0, half_length: float = 0.5, half_width: float = 5.0) -> Rigid:
    return car(x, y, per_mass=0.0, per_inertia=0.0, half_length=half_length, half_width=half_width)


def momentum(bodies: list[Rigid]) -> tuple[float, float, float]:
    """Momentum east and north [kg m/s], and angular momentum about the origin [kg m^2/s]."""
    east = sum(body.velocity_x / body.per_mass for body in bodies)
    north = sum(body.velocity_y / body.per_mass for body in bodies)
    spin = sum(
        (body.x * body.velocity_y - body.y * body.velocity_x) / body.per_mass + body.rate / body.per_inertia
        for body in bodies
    )
    return east, north, spin


def energy_of(body: Rigid) -> float:
    """Energy of motion [J]; 0 for what nothing moves."""
    if body.per_mass == 0.0:
        return 0.0
    square = body.velocity_x * body.velocity_x + body.velocity_y * body.velocity_y
    return 0.5 * (square / body.per_mass + body.rate * body.rate / body.per_inertia)


def test_head_on_impact_of_equal_cars_shares_the_speed() -> None:
    rear, front = car(vx=10.0), car(4.4)
    assert hit(rear, front, find_contact(rear, front))
    assert rear.velocity_x == pytest.approx(10.0 * (1 - RESTITUTION) / 2)
    assert front.velocity_x == pytest.approx(10.0 * (1 + RESTITUTION) / 2)
    assert rear.velocity_y == rear.rate == front.rate == 0.0


def test_heavy_car_keeps_more_of_its_speed() -> None:
    truck, small = car(vx=10.0, per_mass=1 / 15000.0), car(4.4)
    hit(truck, small, find_contact(truck, small))
    assert truck.velocity_x == pytest.approx(10.0 - 11.0 / 11)


def test_soft_impact_does_not_bounce() -> None:
    rear, front = car(vx=0.4), car(4.4)
    hit(rear, front, find_contact(rear, front))
    assert rear.velocity_x == pytest.approx(front.velocity_x)


def test_cars_that_part_are_left_alone() -> None:
    rear, front = car(vx=5.0), car(4.4, vx=6.0)
    assert not hit(rear, front, find_contact(rear, front))
    assert (rear.velocity_x, front.velocity_x) == (5.0, 6.0)


def test_impact_beside_the_middle_turns_both_cars() -> None:
    rear, front = car(vx=10.0), car(4.4, 1.2)
    hit(rear, front, find_contact(rear, front))
    assert rear.rate > 0.1  # held back on its left side
    assert front.rate > 0.1  # pushed forward on its right side


def test_full_face_meets_in_the_middle_even_a_degree_askew() -> None:
    contact = find_contact(car(), car(4.41, yaw=math.radians(1.0)))
    assert abs(contact.y) < 0.2
    assert contact.normal[0] == pytest.approx(1.0, abs=1e-3)


def test_side_impact_acts_on_the_side() -> None:
    contact = find_contact(car(yaw=0.0), car(1.0, 0.9 + 2.2, yaw=-math.pi / 2))
    assert contact.normal == pytest.approx((0.0, 1.0), abs=1e-9)
    assert (contact.x, contact.y) == pytest.approx((1.0, 0.9), abs=1e-6)


@pytest.mark.parametrize("speed", [30.0, 100.0, 250.0, 3000.0])
def test_moment_of_touching_is_found_at_any_speed(speed: float) -> None:
    moving = car(-3.0, vx=speed / 3.6)
    moving.move_x = 6.0
    post = wall(0.0, half_length=0.025, half_width=0.025)
    assert find_impact(moving, post, 0.0) == pytest.approx((3.0 - 2.2 - 0.025) / 6.0, abs=1e-4)


def test_cars_that_pass_beside_each_other_do_not_touch() -> None:
    assert find_impact(car(-3.0, vx=50.0), car(3.0, 1.81, vx=-50.0), 0.0) == math.inf


def test_row_of_cars_hands_the_impact_on_within_one_step() -> None:
    bodies = [car(0.0, vx=30.0), *(car(4.6 + 4.41 * i) for i in range(3))]
    play(bodies, [(0, 1), (1, 2), (2, 3)], DT)
    assert bodies[3].velocity_x > 5.0
    assert all(a.x + 4.4 <= b.x + 5 * SLOP for a, b in pairwise(bodies))


def test_car_between_two_walls_comes_to_rest() -> None:
    bodies = [car(vx=20.0), wall(2.75), wall(-2.75)]
    for _ in range(50):
        bodies[0].time = 0.0
        bodies[1].time = bodies[2].time = 0.0
        play(bodies, [(0, 1), (0, 2)], DT)
    assert abs(bodies[0].velocity_x) < 0.5
    assert abs(bodies[0].x) < 0.1


anywhere, angle = st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi)
speed = st.floats(-60.0, 60.0)
rigid = st.builds(
    car,
    *(anywhere, anywhere, angle, speed, speed, st.floats(-5.0, 5.0)),
    per_mass=st.floats(1 / 40_000.0, 1 / 200.0),
    per_inertia=st.floats(1 / 200_000.0, 1 / 150.0),
    centre=st.floats(-0.5, 0.5),
)


@given(rigid, rigid)
def test_impact_keeps_momentum_and_adds_no_energy(first: Rigid, second: Rigid) -> None:
    contact = find_contact(first, second)
    before, energy = momentum([first, second]), energy_of(first) + energy_of(second)
    was_struck = hit(first, second, contact)
    after = momentum([first, second])
    size = 1.0 + sum(abs(body.velocity_x) + abs(body.velocity_y) for body in (first, second)) / 1e-5
    assert after == pytest.approx(before, abs=1e-9 * size)
    assert energy_of(first) + energy_of(second) <= energy * (1.0 + 1e-9) + 1e-6
    if was_struck:
        assert find_contact(first, second).gap == contact.gap  # velocities alone change


@given(rigid, st.floats(-3.0, 3.0))
def test_impact_on_a_wall_adds_no_energy(body: Rigid, x: float) -> None:
    energy = energy_of(body)
    other = wall(x)
    hit(body, other, find_contact(body, other))
    assert energy_of(body) <= energy * (1.0 + 1e-9) + 1e-6
    assert other.velocity_x == other.velocity_y == other.rate == 0.0


@given(st.lists(rigid, min_size=2, max_size=5))
@examples(25)
def test_heap_of_bodies_loses_energy_and_keeps_momentum(bodies: list[Rigid]) -> None:
    energy, before = sum(energy_of(body) for body in bodies), momentum(bodies)[:2]
    play(bodies, [(i, j) for i in range(len(bodies)) for j in range(i + 1, len(bodies))], DT)
    assert sum(energy_of(body) for body in bodies) <= energy * (1.0 + 1e-9) + 1e-6
    size = 1.0 + sum(abs(body.velocity_x) + abs(body.velocity_y) for body in bodies) / 1e-5
    assert momentum(bodies)[:2] == pytest.approx(before, abs=1e-8 * size)


def test_friction_stays_within_its_cone() -> None:
    first, second = car(vx=10.0, vy=30.0), car(4.4)
    hit(first, second, find_contact(first, second))
    assert abs(second.velocity_y) <= FRICTION * second.velocity_x * (1 + 1e-9)
