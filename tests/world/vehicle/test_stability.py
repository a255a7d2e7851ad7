"""Stability control of the single track model: a car that brakes hard in a bend."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.scenarios.catalogue import find_model
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.state.world import DT, Body, Dynamics, Kind, Mode, World
from rosbridge_sim.world.vehicle.dynamics import drive
from rosbridge_sim.world.vehicle.stability import correct, make_control, share_along
from tests.world.driven_cars import CAR

pytestmark = pytest.mark.usefixtures("loops")


def brake_in_bends(
    body: Body, cells: Sequence[tuple[float, float, float]], *, is_stable: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the greatest slip angles of rear axles [deg] and the mean decelerations down to 3 m/s [m/s^2], (k,).

    Args:
        body: of the cars.
        cells: speed before [m/s], lateral acceleration for which the wheels are turned [g], commanded acceleration
            [m/s^2].
        is_stable: with stability control.
    """
    world = World(0, Dynamics.SINGLE_TRACK, has_stability_control=is_stable)
    steers = []
    for i, (speed, lateral, _) in enumerate(cells):
        world.spawn(Kind.EGO, body, name="ego", x=0.0, y=500.0 * i, speed=speed)
        understeer = (1.0 / body.front_stiffness - 1.0 / body.rear_stiffness) * lateral
        steers.append(math.atan(body.wheelbase * lateral * GRAVITY / speed**2) + understeer)
        command(world, i, mode=Mode.SPEED, speed=speed, steer=steers[-1])
    for _ in range(100):
        drive(world, DT)
    for i, (_, _, accel) in enumerate(cells):
        command(world, i, mode=Mode.ACCEL, accel=accel, steer=steers[i])
    most, before, frames = np.zeros(len(cells)), world.speed.copy(), np.zeros(len(cells))
    while (world.speed > 3.0).any():
        drive(world, DT)
        is_fast = world.speed > 3.0
        frames += is_fast
        most = np.where(is_fast, np.maximum(most, np.abs(world.rear_slip)), most)
    return np.degrees(most), (before - 3.0) / ((frames + 1.0) * DT)


LATERALS = np.round(np.arange(0.12, 0.721, 0.04), 2).tolist()
"""Wheels turned for 0.72 g bring the car into a bend of 0.6 g: its tyres saturate."""

ACCELS = (-2.0, -4.0, -5.0, -6.0, -7.0, -8.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["2016_Hyundai_Ioniq", "2016_Kia_Niro(HEV)", "2020_Kia_Stinger", "Van"])
@pytest.mark.parametrize("speed", [15.0, 20.0, 25.0, 30.0])
def test_car_that_brakes_in_a_bend_does_not_spin(name: str, speed: float) -> None:
    model = find_model(name)
    assert model is not None
    cells = [(speed, lateral, accel) for lateral in LATERALS for accel in ACCELS]
    slip, slowing = brake_in_bends(model.body, cells, is_stable=True)
    assert slip.max() < 8.0, cells[slip.argmax()]
    assert (slowing > 0.7 * -np.array(cells)[:, 2]).all(), "it brakes less, but it brakes"


def test_car_that_brakes_with_all_it_has_in_a_bend_does_not_spin() -> None:
    """The tyres grip better along than across; brakes that used all of it would take the load from the rear axle."""
    cells = [(speed, lateral, -15.0) for speed in (20.0, 30.0) for lateral in (0.1, 0.3, 0.5)]
    for name in ("2016_Hyundai_Ioniq", "2016_Kia_Niro(HEV)", "2021_VW_Golf_GTI", "2020_Kia_Stinger"):
        model = find_model(name)
        assert model is not None
        slip, slowing = brake_in_bends(model.body, cells, is_stable=True)
        assert slip.max() < 8.0, (name, cells[slip.argmax()])
        assert slowing[0] > 9.0, "in a gentle bend it brakes as straight on, but for the lag"


def test_car_without_stability_control_spins() -> None:
    assert brake_in_bends(CAR, [(25.0, 0.3, -8.0)], is_stable=False)[0] > 45.0


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


class Floats:
    """The operators of one car, in plain Python."""

    least, most, magnitude, root = staticmethod(min), staticmethod(max), staticmethod(abs), staticmethod(math.sqrt)

    @staticmethod
    def pick(condition: float, if_positive: float, otherwise: float) -> float:
        return if_positive if condition > 0.0 else otherwise


FLOATS: Any = Floats  # it has those that stability control uses


@pytest.mark.parametrize("seed", range(20))
def test_brakes_of_one_side_act_against_a_yaw_rate_beyond_the_wanted_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    to_front, to_rear, index, front, rear = rng.uniform(
        (1.0, 1.0, 0.8, 15.0, 15.0), (1.5, 1.5, 1.1, 25.0, 25.0)
    ).tolist()
    control = make_control((to_front, to_rear), index, (front, rear))
    wheelbase = to_front + to_rear
    for _ in range(20):
        u, r, turned, grip = rng.uniform((-5.0, -1.5, -0.2, 0.3), (35.0, 1.5, 0.2, 1.0)).tolist()
        understeer = max((1.0 / front - 1.0 / rear) / GRAVITY, 0.0)
        most = GRAVITY * grip / max(abs(u), 3.0)
        wanted = min(max(u * turned / (wheelbase + understeer * u * u), -most), most)
        low, high = min(wanted, 0.0) - 0.05, max(wanted, 0.0) + 0.05  # between straight on and the wanted rate
        excess = max(r - high, low - r, 0.0)
        lever = 0.28 * wheelbase / (index * to_front * to_rear)
        force = min(22.0 / lever * excess, 0.4 * GRAVITY * grip)
        turn, found = correct(FLOATS, control, grip, (u, r), turned)
        assert found == pytest.approx(force)
        assert turn == pytest.approx(force * lever * (1.0 if r < low else -1.0))


@pytest.mark.parametrize(
    ("across", "kept", "left"), [(0.0, 0.85, 1.0), (0.4, 0.85, math.sqrt(0.75)), (2.0, 0.6, 0.8), (0.48, 0.97, 0.8)]
)
def test_axle_keeps_grip_across_for_one_and_a_quarter_of_its_force(across: float, kept: float, left: float) -> None:
    assert share_along(FLOATS, across, kept) == pytest.approx(left)
