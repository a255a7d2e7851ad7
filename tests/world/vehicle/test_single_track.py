"""The single track model: standing, pedals, speed mode, tyres at their limit, rear wheels, lean, and equal bits."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import CATALOGUE
from rosbridge_sim.world.state.commands import command, release, shift
from rosbridge_sim.world.state.entity_types import GRAVITY, ROAD_FRICTION
from rosbridge_sim.world.state.placement import set_speed, teleport
from rosbridge_sim.world.state.world import DT, Body, Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from rosbridge_sim.world.vehicle import dynamics
from rosbridge_sim.world.vehicle.dynamics import drive
from rosbridge_sim.world.vehicle.sensor_readings import Mounting, feel
from rosbridge_sim.world.vehicle.wheel_readings import NO_READING, read_wheel
from tests.world.driven_cars import CAR, pedals, speeds
from tests.world.kernels.compiled_loops import with_loops

pytestmark = pytest.mark.usefixtures("loops")

# A car that nothing slows, with an engine without a bound of power
FREE = replace(CAR, rolling=0.0, air_drag=0.0, engine_drag=0.0, power=1e3)

# A BMW 320i, vehicle 2 of commonroad-vehicle-models 3.0.2, without drag: its drives there are known.
VEHICLE_2 = Body(
    length=4.508,
    width=1.61,
    wheelbase=2.5789128,
    front_overhang=0.8,
    rear_overhang=1.1290872,
    max_steer=1.066,
    max_steer_rate=0.4,
    max_accel=11.5,
    max_decel=11.5,
    rolling=0.0,
    air_drag=0.0,
    engine_drag=0.0,
    mass=1093.2952334674046,
    front_load=1.4227170936 / 2.5789128,
    cg_height=0.61373004,
    dynamic_index=1791.5995300122856 / (1093.2952334674046 * 1.1561957064 * 1.4227170936),
    front_stiffness=21.92,
    rear_stiffness=21.92,
    grip=1.0489 / ROAD_FRICTION,
    grip_along=1.0489 / ROAD_FRICTION,
    front_drive=0.0,
)


def ego(body: Body = CAR, *, is_creeping: bool = False, **figures: Any) -> World:  # noqa: ANN401 - whatever spawn takes
    """A world of one ego of the single track model, in row 0, without stability control as the references."""
    world = World(0, Dynamics.SINGLE_TRACK, is_creeping=is_creeping, has_stability_control=False)
    world.spawn(Kind.EGO, body, name="ego", **({"x": 0.0, "y": 0.0} | figures))
    return world


def to_speed(world: World, speed: float, steer: float = 0.0) -> None:
    command(world, 0, mode=Mode.SPEED, speed=speed, steer=steer)


def lateral_accel_of_the_middle(world: World) -> float:
    """Lateral acceleration at the centre of gravity [m/s^2]."""
    body = world.bodies[0]
    return world.lateral_accel.item(0) + body.front_load * body.wheelbase * world.yaw_accel.item(0)


# -- beside the reference; `scripts/bench/fidelity.py` compares all of the drives


@pytest.mark.parametrize(
    ("speed", "steer", "wanted"),
    # Yaw rate at 0.1, 0.2, 0.4 and 2.8 s after the step, by ST (0.02 rad) and STD (0.1 rad) of the package.
    [
        (5.0, 0.02, (0.0368, 0.0387, 0.0388, 0.0388)),
        (15.0, 0.02, (0.0751, 0.1066, 0.1158, 0.1163)),
        (25.0, 0.02, (0.0905, 0.1503, 0.1861, 0.1939)),
        (15.0, 0.1, (0.1051, 0.2861, 0.5193, 0.5418)),
        (25.0, 0.1, (0.12, 0.3328, 0.5714, 0.5205)),
    ],
)
def test_step_of_steering_gives_the_yaw_rate_of_the_reference(
    speed: float, steer: float, wanted: tuple[float, ...]
) -> None:
    world = ego(VEHICLE_2, speed=speed)
    pedals(world, steer=steer)
    rates = []
    for _ in range(140):
        step(world)
        rates.append(world.yaw_rate.item(0))
    assert [rates[i] for i in (4, 9, 19, 139)] == pytest.approx(wanted, abs=0.03 * max(wanted))


def test_full_lock_slides_wide_within_the_friction_circle() -> None:
    world = ego(speed=30.0)
    pedals(world, steer=CAR.max_steer)
    most = 0.0
    for _ in range(150):
        step(world)
        most = max(most, math.hypot(world.accel.item(0), lateral_accel_of_the_middle(world)))
        assert abs(world.front_slip.item(0)) < math.pi / 2
    assert most < 1.05 * ROAD_FRICTION * GRAVITY
    assert 30.0 > world.speed[0] > 0.0
    assert abs(world.lateral_speed.item(0)) > 0.5


def test_car_understeers() -> None:
    """The same wheel angle turns a faster car less for each metre, and no car more than rolling wheels do."""
    curvatures = []
    for speed in (1.0, 8.0, 16.0):
        world = ego(FREE, speed=speed)
        pedals(world, steer=0.03)
        speeds(world, 4.0)
        curvatures.append(world.yaw_rate.item(0) / world.speed.item(0))
    assert curvatures[0] == pytest.approx(math.tan(0.03) / CAR.wheelbase, rel=1e-9)
    assert curvatures[0] > curvatures[1] > curvatures[2] > 0.5 * curvatures[0]


def test_less_friction_gives_a_wider_bend() -> None:
    ends = []
    for friction in (0.9, 0.6):
        world = ego(speed=20.0)
        world.friction[0] = friction
        pedals(world, steer=0.15)
        speeds(world, 2.0)
        ends.append(world.y.item(0))
    assert ends[1] < 0.85 * ends[0]


@pytest.mark.parametrize("speed", [0.2, 0.9, 1.5, 2.5, 4.0, 10.0, 25.0, 50.0, 200.0, -3.0, -8.0])
def test_straight_drive_is_stable_after_a_push_to_the_side(speed: float) -> None:
    world = ego(FREE, speed=speed)
    world.lateral_speed[0] = 0.02 * speed
    pedals(world)
    speeds(world, 6.0)
    assert abs(world.lateral_speed.item(0)) < 1e-3 * abs(speed)
    assert abs(world.yaw_rate.item(0)) < 1e-3


@pytest.mark.parametrize("speed", [1.5, 3.0, 6.0, 12.0, 25.0])
def test_a_frame_is_close_to_sixteen_parts_of_it(speed: float) -> None:
    traces = []
    for parts in (1, 16):
        world = ego(speed=speed)
        pedals(world, throttle=0.3, steer=0.1)
        trace = []
        for _ in range(60):
            for _ in range(parts):
                drive(world, DT / parts)
            trace.append(world.yaw_rate.item(0))
        traces.append(trace)
    assert traces[0] == pytest.approx(traces[1], abs=0.03 * max(traces[1]))


def test_tyres_take_over_without_a_jump() -> None:
    world = ego()
    to_speed(world, 6.0, steer=0.3)
    before = None
    for _ in range(300):
        step(world)
        now = world.lateral_accel.item(0), world.yaw_rate.item(0)
        if before is not None:
            assert abs(now[0] - before[0]) < 0.25
            assert abs(now[1] - before[1]) < 0.03
        before = now


def test_left_and_right_are_mirror_images() -> None:
    left, right = ego(speed=15.0), ego(speed=15.0)
    for i in range(300):
        steer = 0.3 * math.sin(i / 20)
        command(left, 0, mode=Mode.PEDALS, throttle=0.4, steer=steer, rear_steer=0.1 * steer)
        command(right, 0, mode=Mode.PEDALS, throttle=0.4, steer=-steer, rear_steer=-0.1 * steer)
        step(left)
        step(right)
        for name, sign in (("x", 1), ("y", -1), ("yaw", -1), ("lateral_speed", -1), ("roll", -1), ("pitch", 1)):
            assert getattr(left, name)[0] == sign * getattr(right, name)[0], name


# -- standing


@pytest.mark.parametrize("grade", [0.0, 0.6, -0.6])
@pytest.mark.parametrize(
    "act",
    [
        lambda _: None,
        lambda world: pedals(world, brake=1.0, steer=0.4),
        lambda world: to_speed(world, 0.0),
        lambda world: command(world, 0, mode=Mode.ACCEL, accel=0.0, steer=0.1),
        lambda world: command(world, 0, mode=Mode.ACCEL, accel=-2.0, steer=0.1),
    ],
    ids=["untouched", "brake", "speed 0", "accel 0", "accel -2"],
)
def test_what_stands_stays(act: Callable[[World], None], grade: float) -> None:
    world = ego()
    world.grade[0] = grade
    act(world)
    for _ in range(250):
        step(world)
    for name in ("x", "y", "yaw", "speed", "lateral_speed", "yaw_rate", "accel", "pitch", "roll"):
        assert getattr(world, name)[0] == 0.0, name


@pytest.mark.slow
@pytest.mark.parametrize("num_minutes", [1, pytest.param(10, marks=pytest.mark.long)])
def test_minutes_untouched_change_no_bit_but_the_frame(num_minutes: int) -> None:
    world = ego()
    floats = world.block("rear_steer_cmd", "speed").copy()
    for _ in range(num_minutes * 3_000):
        step(world)
    assert (world.block("rear_steer_cmd", "speed") == floats).all()


@pytest.mark.parametrize(("speed", "steer"), [(20.0, 0.0), (20.0, 0.3), (-3.0, 0.2)])
def test_braked_car_comes_to_rest_and_all_that_moves_ends(speed: float, steer: float) -> None:
    world = ego(speed=speed)
    pedals(world, brake=1.0, steer=steer)
    speeds(world, 12.0)
    pose = world.x[0], world.y[0], world.yaw[0]
    speeds(world, 1.0)
    assert (world.x[0], world.y[0], world.yaw[0]) == pose
    for name in ("speed", "lateral_speed", "yaw_rate", "yaw_accel", "accel", "pitch", "roll", "pitch_rate"):
        assert getattr(world, name)[0] == 0.0, name
    assert not np.signbit(world.speed[0])


def test_slope_moves_a_car_that_creeps() -> None:
    world = ego(is_creeping=True, gear=Gear.NEUTRAL)
    world.grade[0] = -0.6
    assert speeds(world, 4.0)[-1] < -1.0
    pedals(world, brake=0.3)
    speeds(world, 5.0)
    assert world.speed[0] == 0.0


@pytest.mark.parametrize(
    ("gear", "sign"), [(Gear.DRIVE, 1.0), (Gear.REVERSE, -1.0), (Gear.NEUTRAL, 0.0), (Gear.PARK, 0.0)]
)
def test_creeping_car_goes_at_walking_speed_in_its_gear(gear: Gear, sign: float) -> None:
    world = ego(is_creeping=True, gear=gear)
    speed = speeds(world, 20.0)[-1]
    assert speed == pytest.approx(sign * 5.2 / 3.6, abs=0.05)
    pedals(world, brake=0.1)
    assert speeds(world, 5.0)[-1] == 0.0
    to_speed(world, 0.0)
    assert speeds(world, 2.0)[-1] == 0.0
    release(world, 0)
    assert speeds(world, 20.0)[-1] == pytest.approx(speed, abs=0.1)


def test_engine_starts_uphill_only_if_it_is_strong_enough() -> None:
    world = ego()
    world.grade[0] = -1.0
    pedals(world, throttle=0.2)  # 0.7 m/s^2
    assert speeds(world, 3.0)[-1] == 0.0
    pedals(world, throttle=0.5)
    assert speeds(world, 3.0)[-1] > 0.5


def test_speed_is_held_on_a_slope() -> None:
    for grade in (1.0, -1.0):
        world = ego(speed=10.0)
        world.grade[0] = grade
        to_speed(world, 10.0)
        assert speeds(world, 10.0)[-1] == pytest.approx(10.0, abs=0.01)


# -- engine


def test_car_out_of_gear_is_slowed_by_air_and_wheels_alone() -> None:
    """At 100 km/h: 0.17 m/s^2 by a cd A of 0.53 m^2, 0.12 by the wheels, and in D 0.3 by the engine."""
    slowing = {}
    for gear in (Gear.NEUTRAL, Gear.DRIVE):
        world = ego(speed=100 / 3.6, gear=gear)
        pedals(world)
        step(world)
        slowing[gear] = -world.accel.item(0)
    assert slowing[Gear.NEUTRAL] == pytest.approx(0.29, abs=0.01)
    assert slowing[Gear.DRIVE] == pytest.approx(0.59, abs=0.01)


def full_throttle(body: Body, seconds: float, gear: Gear = Gear.DRIVE, speed: float = 0.0) -> list[float]:
    """Speeds of a car under full throttle [km/h]."""
    world = ego(body, gear=gear, speed=speed)
    pedals(world, throttle=1.0)
    trace = []
    for _ in range(round(seconds / DT)):
        drive(world, DT)
        trace.append(abs(world.speed.item(0)) * 3.6)
    return trace


@pytest.mark.parametrize(
    ("name", "kmh", "seconds", "top"),
    [
        ("2016_Hyundai_Ioniq", 100.0, 10.8, 185.0),
        ("2016_Kia_Niro(HEV)", 100.0, 11.5, 162.0),
        ("Hyundai_Ioniq_5", 100.0, 7.4, 185.0),
        ("2021_VW_Golf_GTI", 100.0, 6.4, 250.0),
        ("2020_Kia_Stinger", 100.0, 6.0, 240.0),
        ("Bus", 50.0, 12.0, 100.0),
        ("Bicycle", 20.0, 7.5, 32.0),
    ],
)
def test_models_accelerate_as_their_data_sheets_say(name: str, kmh: float, seconds: float, top: float) -> None:
    body = next(model.body for model in CATALOGUE if model.name == name)
    trace = full_throttle(body, seconds + 0.5)
    assert next(i for i, speed in enumerate(trace, 1) if speed >= kmh) * DT == pytest.approx(seconds, abs=0.15)
    fast = full_throttle(body, 20.0, speed=0.97 * top / 3.6)
    assert fast[-1] == pytest.approx(top, rel=0.015)
    assert max(fast) < 1.001 * top
    most = min(40.0, top)
    back = full_throttle(body, 3.0, Gear.REVERSE, speed=-0.97 * most / 3.6)
    assert back[-1] == pytest.approx(most, rel=0.03)
    assert max(back) < 1.001 * most


def stop(body: Body) -> float:
    """Return the way from 100 km/h to a stand with a full brake [m]."""
    world = World(0, Dynamics.SINGLE_TRACK)
    world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0, speed=100 / 3.6)
    command(world, 0, mode=Mode.PEDALS, steer=0.0, brake=1.0)
    while world.speed.item(0) > 0.0:
        step(world)
    return world.x.item(0)


def test_stops_of_the_documentation_are_those_of_all_models() -> None:
    page = (Path(__file__).parents[3] / "docs" / "modelling.md").read_text(encoding="utf-8")
    row = r"^\| (\S+) \| ([0-9.]+) \| ([0-9.]+) \| ([0-9.]+) m/s² \| ([0-9.]+) m \| ([0-9]+) to ([0-9]+) m \|$"
    told = re.findall(row, page, flags=re.MULTILINE)
    bodies = {model.name: model.body for model in CATALOGUE if model.kind is Kind.VEHICLE}
    assert {name for name, *_ in told} == {name for name in bodies if not name.startswith("Vehicle_")}
    for name, *cells, low, high in told:
        body, way = bodies[name], stop(bodies[name])
        assert [f"{body.grip_along:g}", f"{body.grip:g}", f"{body.max_decel:g}", f"{way:.1f}"] == cells, name
        assert int(low) <= way <= int(high), name
    assert f"| 100..0 km/h | {stop(bodies['2016_Hyundai_Ioniq']):.1f} m |" in page


def test_way_of_a_stop_falls_with_the_grip_along_the_wheels_alone() -> None:
    plain, *others = (
        stop(replace(CAR, grip_along=along, grip=across)) for along, across in ((1.0, 1.0), (1.3, 1.0), (1.3, 1.2))
    )
    assert others[0] == pytest.approx(plain / 1.3, rel=0.05)  # the lag is the same
    assert others[1] == others[0]


# -- actuators


@pytest.mark.parametrize(("figures", "lag"), [({"throttle": 1.0}, 0.2), ({"brake": 0.5}, 0.15)])
def test_pedal_reaches_63_per_cent_after_its_time_constant(figures: dict[str, float], lag: float) -> None:
    world = ego(FREE, speed=20.0)
    command(world, 0, mode=Mode.PEDALS, steer=0.0, **figures)
    accels = []
    for _ in range(100):
        step(world)
        accels.append(world.accel.item(0))
    share = accels[round(lag / DT) - 1] / accels[-1]
    assert share == pytest.approx(1.0 - math.exp(-round(lag / DT) * DT / lag), abs=0.01)
    reported = world.throttle.item(0) if "throttle" in figures else world.brake.item(0)
    assert reported == next(iter(figures.values()))


@pytest.mark.parametrize(
    ("before", "after"), [(0.0, 10.0), (0.0, 0.2), (20.0, 5.0), (20.0, 0.0), (10.0, 9.5), (0.0, 30.0), (3.0, 0.0)]
)
def test_speed_mode_keeps_its_jerk_limit_and_does_not_overshoot(before: float, after: float) -> None:
    world = ego(speed=before)
    to_speed(world, before)
    speeds(world, 4.0)
    to_speed(world, after)
    accels, trace = [world.accel.item(0)], []
    for _ in range(1000):
        step(world)
        accels.append(world.accel.item(0))
        trace.append(world.speed.item(0))
    assert max(abs(b - a) for a, b in pairwise(accels)) / DT < 10.01
    assert min(before, after) - 0.005 < min(trace) <= max(trace) < max(before, after) + 0.005
    assert trace[-1] == pytest.approx(after, abs=1e-6)
    assert after > 0.0 or trace[-1] == 0.0


@pytest.mark.parametrize(("wanted", "lag"), [(-6.0, 0.15), (1.5, 0.2)])
def test_acceleration_mode_reaches_its_command_with_the_lag_of_the_pedal(wanted: float, lag: float) -> None:
    world = ego(speed=15.0)
    to_speed(world, 15.0)
    speeds(world, 3.0)
    command(world, 0, mode=Mode.ACCEL, accel=wanted, steer=0.0)
    accels = []
    for _ in range(round(8 * lag / DT)):
        step(world)
        accels.append(world.accel.item(0))
    ninety = next(i for i, accel in enumerate(accels, 1) if accel / wanted > 0.9) * DT
    assert ninety == pytest.approx(math.log(10.0) * lag, abs=0.07), "2.3 time constants"
    assert accels[-1] == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize("along", [1.0, 1.3])
def test_forces_along_and_across_stay_within_the_ellipse(along: float) -> None:
    body = replace(CAR, grip_along=along, cg_height=0.01, max_decel=30.0, rolling=0.0, air_drag=0.0, engine_drag=0.0)
    world = ego(body, speed=25.0)
    pedals(world, brake=1.0, steer=0.1)
    most_along = most_across = 0.0
    for _ in range(60):
        step(world)
        ahead = world.accel.item(0) / (along * ROAD_FRICTION * GRAVITY)
        across = world.rear_force.item(0) / (ROAD_FRICTION * GRAVITY * (1.0 - body.front_load))
        assert math.hypot(ahead, across) < 1.0
        most_along, most_across = max(most_along, abs(ahead)), max(most_across, abs(across))
    assert most_along == pytest.approx(0.95, abs=0.02)
    assert most_across > 0.2, "of the 0.31 that brakes leave"


def test_braking_is_limited_by_the_grip() -> None:
    world = ego(replace(CAR, max_decel=30.0), speed=30.0)
    pedals(world, brake=1.0)
    speeds(world, 1.5)
    assert -world.accel.item(0) == pytest.approx(
        0.95 * CAR.grip_along * ROAD_FRICTION * GRAVITY + CAR.rolling + CAR.engine_drag, abs=0.1
    )
    world = ego(replace(CAR, launch_accel=30.0, power=1e3), speed=5.0)
    pedals(world, throttle=1.0)
    speeds(world, 1.5)
    assert world.accel.item(0) < CAR.grip_along * ROAD_FRICTION * GRAVITY * CAR.front_load


# -- rear wheels


def test_rear_wheels_move_the_car() -> None:
    """Opposite to the front wheels they tighten the circle; along with them, the car goes sideways and turns less."""
    turns = {}
    for rear in (-0.1, 0.0, 0.1):
        world = ego(FREE, speed=0.9)
        command(world, 0, mode=Mode.PEDALS, steer=0.1, rear_steer=rear)
        speeds(world, 4.0)
        turns[rear] = world.yaw_rate.item(0)
        assert world.rear_steer.item(0) == pytest.approx(rear)
        assert world.lateral_speed.item(0) == pytest.approx(0.9 * math.tan(rear))
    assert turns[-0.1] == pytest.approx(2.0 * turns[0.0])
    assert turns[0.1] == pytest.approx(0.0, abs=1e-12)


def test_rear_wheels_are_clipped_and_released() -> None:
    world = ego()
    command(world, 0, mode=Mode.PEDALS, steer=0.0, rear_steer=9.0)
    speeds(world, 2.0)
    assert world.rear_steer.item(0) == CAR.max_rear_steer
    release(world, 0)
    assert world.rear_steer.item(0) == world.rear_steer_cmd.item(0) == 0.0
    with pytest.raises(ValueError, match="rear_steer: expected a finite number"):
        command(world, 0, mode=Mode.PEDALS, steer=0.0, rear_steer=math.nan)


# -- lean and sensors


def test_body_pitches_under_the_brake_and_rolls_out_of_a_bend() -> None:
    world = ego(speed=15.0, roll=0.01, pitch=0.02)
    pedals(world, brake=0.3)
    speeds(world, 1.0)
    assert world.pitch.item(0) - 0.02 == pytest.approx(-CAR.pitch_gain * world.accel.item(0), rel=0.02)
    assert world.pitch.item(0) > 0.03, "nose down"
    world = ego(speed=15.0, roll=0.01)
    pedals(world, steer=0.05)
    speeds(world, 2.0)
    assert world.roll.item(0) - 0.01 == pytest.approx(CAR.roll_gain * world.lateral_accel.item(0), rel=0.02)
    assert world.roll.item(0) > 0.02, "left side up in a bend to the left"
    teleport(world, 0, x=0.0, y=0.0, z=0.0, yaw=0.0, roll=0.3)
    step(world)
    assert world.roll.item(0) == 0.3


@pytest.mark.parametrize(("speed", "steer"), [(25.0, 0.06), (30.0, 0.08)])
def test_hard_brake_in_a_bend_spins_the_car_and_tips_nothing_over(speed: float, steer: float) -> None:
    world = ego(speed=speed)
    pedals(world, steer=steer)
    speeds(world, 1.0)
    pedals(world, brake=1.0, steer=steer)
    yaw, way = world.yaw.item(0), 0.0
    while world.speed.item(0) > 0.0:
        step(world)
        way += world.speed.item(0) * DT
        assert abs(world.roll.item(0)) < 0.15
        assert world.z.item(0) == 0.0
    bend = way * math.tan(steer) / CAR.wheelbase
    turned = math.remainder(world.yaw.item(0) - yaw, 2.0 * math.pi)
    assert turned > 1.5 * bend, (turned, bend)


def test_lean_follows_the_acceleration_with_a_lag_of_150_milliseconds() -> None:
    world = ego(speed=15.0)
    pedals(world, brake=0.5)
    for _ in range(20):
        before = world.pitch.item(0)
        step(world)
        goal = -CAR.pitch_gain * world.accel.item(0)
        left = (goal - world.pitch.item(0)) / (goal - before)
        assert left == pytest.approx(math.exp(-DT / 0.15), rel=1e-6)


def test_rates_of_the_lean_are_those_of_pitch_and_roll() -> None:
    world = ego(speed=15.0)
    pedals(world, brake=0.3, steer=0.05)
    largest = 0.0
    for _ in range(30):
        pitch, roll = world.pitch.item(0), world.roll.item(0)
        step(world)
        largest = max(largest, world.roll_rate.item(0))
        assert world.pitch_rate.item(0) == pytest.approx((world.pitch.item(0) - pitch) / DT, abs=1e-9)
        assert world.roll_rate.item(0) == pytest.approx((world.roll.item(0) - roll) / DT, abs=1e-9)
    assert largest > 0.05


def test_inertial_unit_feels_the_lean() -> None:
    world = ego(speed=15.0)
    pedals(world, brake=0.5)
    for _ in range(5):
        step(world)
    felt = feel(world, 0, Mounting())
    assert felt.angular_velocity[1] == pytest.approx(world.pitch_rate.item(0), rel=0.01)
    assert felt.angular_velocity[1] > 0.03
    pitch = world.pitch.item(0)
    ahead = world.accel.item(0) * math.cos(pitch) - GRAVITY * math.sin(pitch)
    assert felt.acceleration[0] == pytest.approx(ahead, abs=1e-6)


def test_accelerations_are_those_of_the_path() -> None:
    """Differences of the positions, twice, in the frame of the car; over five steps."""
    world = ego(speed=18.0)
    pedals(world, steer=0.06)
    places, accels = [], []
    for _ in range(60):
        step(world)
        places.append(world.x.item(0) + 1j * world.y.item(0))
        turned = complex(world.accel.item(0), world.lateral_accel.item(0))
        accels.append(turned * np.exp(1j * (world.yaw.item(0) - 0.5 * DT * world.yaw_rate.item(0))))
    velocity = np.diff(places) / DT
    for i in range(10, 50, 5):
        seen = (velocity[i + 5] - velocity[i]) / (5 * DT)
        assert abs(seen - np.mean(accels[i + 1 : i + 7])) < 0.15


def test_wheel_readings_carry_the_car() -> None:
    world = ego(FREE, speed=15.0)
    pedals(world, steer=0.04)
    speeds(world, 2.0)
    front, rear = read_wheel(world, 0, "front"), read_wheel(world, 0, "rear")
    force = 2.0 * (front.lateral_force * math.cos(world.steer.item(0)) + rear.lateral_force)
    assert force == pytest.approx(CAR.mass * lateral_accel_of_the_middle(world), rel=0.01)
    assert front.slip < 0.0, "the wheels point more to the left than they go"
    assert front.lateral_force == pytest.approx(-front.cornering_stiffness * front.slip, rel=0.1)
    assert read_wheel(World(), 0, "front") == NO_READING


# -- equal bits of floats and arrays, which compiled loops take the place of


@pytest.fixture
def arrays() -> Iterator[None]:
    with with_loops(are_there=False):
        yield


def random_drive(seed: int, num: int) -> World:
    """Drive cars at random, with things between some of their rows."""
    rng = np.random.default_rng(seed)
    world = World(0, Dynamics.SINGLE_TRACK, is_creeping=seed % 2 == 1)
    for i in range(num):
        body = replace(CAR, wheelbase=float(rng.uniform(1.0, 4.0)), front_load=float(rng.uniform(0.3, 0.7)))
        world.spawn(Kind.EGO, body, name="ego", x=0.0, y=100.0 * i, speed=float(rng.uniform(-9.0, 45.0)))
        if seed % 3:
            world.spawn(Kind.OBSTACLE, CAR, name="box", x=90.0, y=100.0 * i)
    rows = world.rows(Kind.EGO)
    for frame in range(85):
        if frame % 17 == 0:
            world.grade[rows] = rng.uniform(-1.0, 1.0, num)
            for row in rows.tolist():
                angles = {"steer": float(rng.uniform(-0.7, 0.7)), "rear_steer": float(rng.uniform(-0.2, 0.2))}
                figures = {"throttle": float(rng.uniform()), "brake": float(rng.uniform() * rng.integers(2))}
                wanted = {"speed": float(rng.uniform(0.0, 30.0)), "accel": float(rng.uniform(-9.0, 4.0))}
                command(world, row, mode=Mode(int(rng.integers(1, 4))), **angles, **figures, **wanted)
        drive(world, DT)
        world.frame += 1
    return world


@pytest.mark.usefixtures("arrays")
@pytest.mark.parametrize("seed", range(6))
def test_many_cars_at_once_have_the_bits_of_each_one(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dynamics, "FEW", 10**9)
    one_by_one = random_drive(seed, 6)
    monkeypatch.setattr(dynamics, "FEW", 0)
    at_once = random_drive(seed, 6)
    assert at_once.digest() == one_by_one.digest()
    assert np.isfinite(at_once.block("rear_steer", "roll")).all()


@pytest.mark.usefixtures("arrays")
def test_single_car_as_an_array_has_the_bits_of_floats(monkeypatch: pytest.MonkeyPatch) -> None:
    floats = random_drive(4, 1).digest()
    monkeypatch.setattr(dynamics, "FEW", 0)
    assert random_drive(4, 1).digest() == floats


def test_restored_world_goes_on_with_the_same_bits() -> None:
    world = random_drive(1, 2)
    saved = world.snapshot()
    other = World()
    other.restore(saved)
    assert (other.dynamics, other.is_creeping) == (Dynamics.SINGLE_TRACK, True)
    for each in (world, other):
        for _ in range(50):
            step(each)
    assert world.digest() == other.digest()


def test_set_speed_and_gear_act_at_once() -> None:
    world = ego(speed=20.0)
    pedals(world, steer=0.1)
    speeds(world, 1.0)
    set_speed(world, 0, 0.0)
    assert (world.speed[0], world.lateral_speed[0], world.yaw_rate[0]) == (0.0, 0.0, 0.0)
    assert shift(world, 0, Gear.REVERSE)
    to_speed(world, 3.0)
    assert speeds(world, 4.0)[-1] == pytest.approx(-3.0, abs=0.01)


# -- loads and the friction circle under the brake


def rear_slip_under_the_brake(body: Body, brake: float, steer: float) -> float:
    """Slip angle of the rear axle a third of a second after the brake, in a bend at 15 m/s."""
    world = ego(body, speed=15.0)
    to_speed(world, 15.0, steer=steer)
    speeds(world, 2.0)
    pedals(world, steer=steer, brake=brake)
    speeds(world, 0.3)
    return abs(world.rear_slip.item(0))


def test_braking_takes_load_from_the_rear_axle() -> None:
    """So the rear tyres slip more than those of a car with its weight on the ground."""
    low, high = (rear_slip_under_the_brake(replace(CAR, cg_height=height), 0.5, 0.033) for height in (0.01, 0.6))
    assert high > 1.2 * low, (low, high)


def test_brakes_take_grip_from_the_tyres_across() -> None:
    """With its weight on the ground no load moves: the friction circle alone makes the rear tyres slip."""
    low = replace(CAR, cg_height=0.01)
    scarce, plenty = (rear_slip_under_the_brake(replace(low, grip=grip), 0.95, 0.08) for grip in (1.0, 3.0))
    assert scarce > 1.2 * plenty, (scarce, plenty)


def test_car_that_brakes_hard_turns_in_half_as_much() -> None:
    """The front tyres give to the brakes what they lack across; that ABS leaves is enough to steer."""
    rates = []
    for brake in (0.0, 0.95):
        world = ego(replace(CAR, cg_height=0.01), speed=20.0)
        pedals(world, steer=0.2, brake=brake)
        speeds(world, 0.4)
        rates.append(world.yaw_rate.item(0))
    rolling, braking = rates
    assert 0.3 * rolling < braking < 0.7 * rolling, (rolling, braking)


@pytest.mark.usefixtures("arrays")
def test_cars_in_two_threads_move_as_alone() -> None:
    """One of them is the rehearsal of a scenario that is being loaded, in a thread of its own."""

    def run(steer: float, start: Barrier) -> bytes:
        world = World(0, Dynamics.SINGLE_TRACK)
        world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, speed=15.0)
        pedals(world, throttle=0.3, steer=steer)
        start.wait()
        for _ in range(600):
            drive(world, DT)
        return world.x.tobytes() + world.yaw.tobytes()

    steers = (0.03, -0.01)
    alone = [run(steer, Barrier(1)) for steer in steers]
    interval, start = sys.getswitchinterval(), Barrier(len(steers))
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(len(steers)) as threads:
            assert list(threads.map(lambda steer: run(steer, start), steers)) == alone
    finally:
        sys.setswitchinterval(interval)


@pytest.mark.usefixtures("arrays")
def test_car_that_stands_moves_off_with_the_bits_of_one_that_nobody_has_watched() -> None:
    def stand_then_drive(num_frames: int) -> str:
        world = World(0, Dynamics.SINGLE_TRACK)
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0))
        for _ in range(num_frames):
            step(world)
        pose = world.block("x", "speed")[:, row].tobytes()
        step(world)
        assert world.block("x", "speed")[:, row].tobytes() == pose
        world.accel[row] = 1.0  # written from outside: the next step writes its own again
        world.touch()
        step(world)
        assert world.accel[row] == 0.0
        world.accel[row] = 1.0
        step(world)
        assert world.accel[row] == 0.0
        command(world, row, mode=Mode.ACCEL, accel=1.0, steer=0.1)
        for _ in range(50):
            step(world)
        assert world.x[row] > 0.2
        world.frame = 0
        return world.digest()

    assert stand_then_drive(1) == stand_then_drive(20)
