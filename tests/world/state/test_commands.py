"""Commands of driven rows: what is carried out, and what is refused."""

from __future__ import annotations

import itertools
import math

import pytest

from rosbridge_sim.world.state.commands import command, release, shift, turn_wheels
from rosbridge_sim.world.state.control_columns import update_control_columns
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.driven_cars import CAR, ego, pedals, speeds


def test_command_holds_until_the_next_one() -> None:
    world = ego()
    pedals(world, throttle=0.5)
    trace = speeds(world, 20.0)
    assert trace == sorted(trace)


@pytest.mark.parametrize("is_creeping", [False, True])
@pytest.mark.parametrize("gear", Gear)
def test_columns_follow_from_the_last_command_alone(gear: Gear, *, is_creeping: bool) -> None:
    world = World(0, Dynamics.SINGLE_TRACK, is_creeping=is_creeping)
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, gear=gear)
    columns = world.block("rear_steer_cmd", "speed")
    figures = (0.0, -0.0, 0.0, 2.0, 2.0, 200.0, 300.0, -2.0, -2.0)
    for mode, other, figure in itertools.product(Mode, Mode, figures):
        for each in (mode, other, mode):
            command(world, 0, mode=each, steer=0.0, throttle=figure, speed=figure, accel=figure)
            before = columns.tobytes()
            update_control_columns(world, 0, is_creeping=is_creeping)
            assert columns.tobytes() == before


def test_gear_change_at_speed_is_refused_and_keeps_the_gear() -> None:
    world = ego(speed=0.1)
    assert not shift(world, 0, Gear.REVERSE)
    assert world.gear[0] == Gear.DRIVE
    assert shift(world, 0, Gear.DRIVE)  # no change
    teleport(world, 0, x=0.0, y=0.0, z=0.0, yaw=0.0, speed=0.099)
    assert shift(world, 0, Gear.REVERSE)
    assert world.gear[0] == Gear.REVERSE


def test_gear_change_applies_to_the_command_in_force() -> None:
    world = ego(gear=Gear.PARK)
    command(world, 0, mode=Mode.SPEED, speed=5.0, steer=0.0)
    assert speeds(world, 1.0)[-1] == 0.0
    assert shift(world, 0, Gear.REVERSE)
    assert speeds(world, 5.0)[-1] == pytest.approx(-5.0)


@pytest.mark.parametrize(
    ("mode", "figure"),
    [(Mode.PEDALS, "throttle"), (Mode.PEDALS, "brake"), (Mode.SPEED, "speed"), (Mode.ACCEL, "accel")]
    + [(mode, "steer") for mode in Mode],
)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_non_finite_command_changes_nothing(mode: Mode, figure: str, value: float) -> None:
    world = ego()
    pedals(world, throttle=0.3, steer=0.1)
    before = world.digest()
    with pytest.raises(ValueError, match=f"{figure}: expected a finite number"):
        command(world, 0, **({"mode": mode, "steer": 0.0} | {figure: value}))  # type: ignore[arg-type]
    assert world.digest() == before


def test_values_of_other_modes_are_ignored() -> None:
    world = ego()
    command(world, 0, mode=Mode.SPEED, steer=0.0, speed=3.0, throttle=math.nan, brake=math.inf, accel=math.nan)
    assert speeds(world, 5.0)[-1] == pytest.approx(3.0)


def test_only_egos_take_commands() -> None:
    world = ego()
    npc = world.row(world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=0.0))
    gone = 0
    world.remove(int(world.uid[gone]))
    for row in (npc, gone):
        with pytest.raises(ValueError, match=f"row {row} is not driven"):
            pedals(world, row=row)
        with pytest.raises(ValueError, match=f"row {row} has no gears"):
            shift(world, row, Gear.PARK)


def test_unknown_gear_is_refused() -> None:
    world = ego()
    with pytest.raises(ValueError, match="5"):
        shift(world, 0, 5)  # type: ignore[arg-type]


def test_steered_wheels_stay_until_the_next_command() -> None:
    world = ego()
    turn_wheels(world, 0, 0.3)
    assert world.steer[0] == 0.3
    speeds(world, 0.5)
    assert world.steer[0] == 0.3
    turn_wheels(world, 0, -9.0)
    assert world.steer[0] == -CAR.max_steer
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match="steer: expected a finite number"):
            turn_wheels(world, 0, wrong)
    row = world.row(world.spawn(Kind.OBSTACLE, CAR, name="box", x=0.0, y=0.0))
    with pytest.raises(ValueError, match="no wheels"):
        turn_wheels(world, row, 0.0)


@pytest.mark.parametrize("mode", list(Mode))
def test_released_car_rolls_on_without_a_command(mode: Mode) -> None:
    world, fresh = ego(), ego()
    command(world, 0, mode=mode, steer=0.5, throttle=1.0, brake=0.5, speed=20.0, accel=3.0)
    for _ in range(100):
        step(world)
    assert abs(world.steer[0]) > 0.1
    release(world, 0)
    for other in (world, fresh):
        teleport(other, 0, x=1.0, y=2.0, z=0.0, yaw=0.5, speed=8.0)
    for _ in range(100):
        step(world)
        step(fresh)
        for name in ("x", "y", "yaw", "speed", "steer", "throttle", "brake", "accel"):
            assert getattr(world, name)[0] == getattr(fresh, name)[0], name


def test_only_a_driven_entity_can_be_released() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=0.0)
    with pytest.raises(ValueError, match="not driven"):
        release(world, 0)
