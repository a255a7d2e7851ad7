"""Stability control of the single track model: a car that brakes hard in a bend."""

from __future__ import annotations

import math

import pytest

from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Dynamics, Kind, Mode, World
from rosbridge_sim.world.vehicle.dynamics import drive
from rosbridge_sim.world.vehicle.sensor_readings import GRAVITY
from tests.world.driven_cars import CAR


def brake_in_a_bend(speed: float, lateral: float, accel: float, *, is_stable: bool) -> tuple[float, float]:
    """Return the greatest slip angle of the rear axle [deg] and the mean deceleration down to 3 m/s [m/s^2].

    Args:
        speed: before [m/s].
        lateral: acceleration of the bend [g].
        accel: commanded [m/s^2].
        is_stable: with stability control.
    """
    world = World(0, Dynamics.SINGLE_TRACK, has_stability_control=is_stable)
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, speed=speed)
    understeer = (1.0 / CAR.front_stiffness - 1.0 / CAR.rear_stiffness) * lateral
    steer = math.atan(CAR.wheelbase * lateral * GRAVITY / speed**2) + understeer
    command(world, 0, mode=Mode.SPEED, speed=speed, steer=steer)
    for _ in range(100):
        drive(world, DT)
    command(world, 0, mode=Mode.ACCEL, accel=accel, steer=steer)
    most, before, frames = 0.0, world.speed.item(0), 0
    while world.speed.item(0) > 3.0:
        drive(world, DT)
        frames += 1
        most = max(most, abs(world.rear_slip.item(0)))
    return math.degrees(most), (before - world.speed.item(0)) / (frames * DT)


@pytest.mark.parametrize("accel", [-2.0, -4.0, -6.0, -8.0])
@pytest.mark.parametrize(("speed", "lateral"), [(15.0, 0.6), (20.0, 0.37), (25.0, 0.5), (30.0, 0.27), (30.0, 0.45)])
def test_car_that_brakes_hard_in_a_bend_does_not_spin(speed: float, lateral: float, accel: float) -> None:
    slip, slowing = brake_in_a_bend(speed, lateral, accel, is_stable=True)
    assert slip < 8.0
    assert slowing > 0.7 * -accel, "it brakes less, but it brakes"


def test_car_without_stability_control_spins() -> None:
    assert brake_in_a_bend(25.0, 0.3, -8.0, is_stable=False)[0] > 45.0


def test_full_lock_slides_straight_on() -> None:
    """The front tyres are beyond their best angle: nothing takes the wheels or the speed back."""
    paths = []
    for is_stable in (True, False):
        world = World(0, Dynamics.SINGLE_TRACK, has_stability_control=is_stable)
        world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, speed=25.0)
        command(world, 0, mode=Mode.PEDALS, steer=CAR.max_steer)
        for _ in range(75):
            drive(world, DT)
        assert abs(world.front_slip.item(0)) > math.radians(15.0)
        paths.append(world.y.item(0))
    assert paths[0] < 1.2 * paths[1]
