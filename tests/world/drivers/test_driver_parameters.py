"""Parameters of drivers: by class, by seed and by id."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from rosbridge_sim.scenarios.catalogue import find_model
from rosbridge_sim.world.drivers.driver_parameters import (
    BICYCLE,
    CAR,
    FIGURES,
    HEAVY,
    LIGHT_GOODS,
    MOTORCYCLE,
    DriverParameters,
    classes_of,
)
from rosbridge_sim.world.state.chance import bell
from rosbridge_sim.world.state.world import Body, Kind, World


def crowd(seed: int, kind: Kind = Kind.VEHICLE) -> World:
    world = World(seed)
    for i in range(400):
        world.spawn(kind, Body(), name="car", x=10.0 * i, y=0.0)
    world.desired_speed[:] = np.inf
    return world


def test_figures_have_their_mean_and_deviation_and_stay_within_bounds() -> None:
    world = crowd(3)
    drivers = DriverParameters.of(world, np.arange(400))
    for each in fields(DriverParameters):
        values, (mean, deviation, least, most) = getattr(drivers, each.name), FIGURES[each.name][:, CAR].tolist()
        assert values.mean() == pytest.approx(mean, abs=0.2 * deviation), each.name
        assert values.std() == pytest.approx(deviation, rel=0.15), each.name
        assert values.min() >= least
        assert values.max() <= most
    assert abs(np.corrcoef(drivers.headway, drivers.accel)[0, 1]) < 0.15


def test_figures_depend_on_seed_and_id_only() -> None:
    world, rows = crowd(3), np.arange(400)
    before = DriverParameters.of(world, rows)
    world.remove(int(world.uid[7]))
    after = DriverParameters.of(world, rows[10:])
    other = DriverParameters.of(crowd(4), rows)
    for each in fields(DriverParameters):
        assert (getattr(before, each.name)[10:] == getattr(after, each.name)).all()
    assert (before.headway != other.headway).mean() > 0.9


def test_given_speed_is_kept_with_the_limit() -> None:
    world = crowd(3)
    world.desired_speed[5] = 40.0
    drivers = DriverParameters.of(world, np.arange(400))
    assert (drivers.desired_speed[5], drivers.speed_factor[5]) == (40.0, 1.0)


def test_ego_is_the_mean_driver() -> None:
    drivers = DriverParameters.of(crowd(3, Kind.EGO), np.arange(400))
    for each in fields(DriverParameters):
        assert set(getattr(drivers, each.name).tolist()) == {FIGURES[each.name].item(0, CAR)}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("2016_Hyundai_Ioniq", CAR),
        ("2014_Kia_K7", CAR),
        ("Van", LIGHT_GOODS),
        ("Truck", LIGHT_GOODS),
        ("Bus", HEAVY),
        ("Motorcycle", MOTORCYCLE),
        ("Bicycle", BICYCLE),
    ],
)
def test_size_of_a_vehicle_gives_its_class(name: str, expected: int) -> None:
    model = find_model(name)
    assert model is not None
    body = model.body
    size = (np.array([figure]) for figure in (body.length, body.width, body.height))
    assert classes_of(*size).tolist() == [expected]


def test_driver_has_the_mean_of_its_class_and_a_chance_of_its_own_in_each_figure() -> None:
    world = World(5)
    bodies = [Body(), Body(12.0, 2.5, 3.2), Body(5.5, 2.0, 2.6), Body(2.2, 0.8, 1.5), Body(1.8, 0.5, 1.6)]
    rows = [world.row(world.spawn(Kind.VEHICLE, body, name="v", x=20.0 * i, y=0.0)) for i, body in enumerate(bodies)]
    rows.append(world.row(world.spawn(Kind.EGO, Body(), name="ego", x=200.0, y=0.0)))
    at = np.array(rows)
    world.desired_speed[at] = np.inf
    drivers = DriverParameters.of(world, at)
    classes = [CAR, HEAVY, LIGHT_GOODS, MOTORCYCLE, BICYCLE, CAR]
    for question, each in enumerate(fields(DriverParameters)):
        chance = bell(world.salts(at), question)
        chance[-1] = 0.0
        for i, kind in enumerate(classes):
            mean, deviation, least, most = FIGURES[each.name][:, kind].tolist()
            value = mean + deviation * chance[i]
            assert getattr(drivers, each.name)[i] == pytest.approx(min(max(value, least), most))
    assert drivers.take(np.array([4, 0])).headway.tolist() == drivers.headway[[4, 0]].tolist()
