"""Motion of driven rows: the model against closed forms, and against a slow twin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.records import replace
from rosbridge_sim.world.geometry.planar import arc_lengths, nearest_on_polyline
from rosbridge_sim.world.state.commands import command, shift
from rosbridge_sim.world.state.control_columns import STICTION
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import DT, Body, Gear, Kind, Mode, World
from rosbridge_sim.world.vehicle.dynamics import drive
from tests.world.driven_cars import CAR, SLICK, ego, move, pedals, speeds
from tests.world.polylines import left_of, point_at

# -- steering and the arc


@pytest.mark.parametrize("speed", [0.3, 5.0, 15.0, 30.0, -4.0])
@pytest.mark.parametrize("steer", [0.02, 0.3, -0.3, math.radians(36.25)])
def test_rear_axle_follows_a_circle_of_wheelbase_over_tangent_at_constant_steering(speed: float, steer: float) -> None:
    world = ego(SLICK, speed=speed)
    world.steer[0] = steer
    pedals(world, steer=steer)
    radius = CAR.wheelbase / math.tan(steer)
    for _ in range(150):
        move(world)
        assert math.hypot(world.x[0], world.y[0] - radius) == pytest.approx(abs(radius), rel=1e-9)


def test_full_circle_ends_at_its_start() -> None:
    radius = CAR.wheelbase / math.tan(0.2)
    world = ego(SLICK, speed=2 * math.pi * radius / 10.0)  # once round in ten seconds
    world.steer[0] = 0.2
    pedals(world, steer=0.2)
    speeds(world, 10.0)
    assert (world.x[0], world.y[0], world.yaw[0]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert world.yaw_rate[0] == pytest.approx(2 * math.pi / 10.0)
    assert world.lateral_accel[0] == pytest.approx(world.speed[0] ** 2 / radius)


def test_steering_is_clipped_and_rate_limited() -> None:
    world = ego()
    pedals(world, steer=9.0)
    assert world.steer_cmd[0] == CAR.max_steer
    for i in range(1, 40):
        move(world)
        assert world.steer[0] == pytest.approx(i * CAR.max_steer_rate * DT)
    speeds(world, 1.0)
    assert world.steer[0] == CAR.max_steer
    pedals(world, steer=-9.0)
    speeds(world, 3.0)
    assert world.steer[0] == pytest.approx(-CAR.max_steer, abs=1e-15)


def test_left_and_right_are_mirror_images() -> None:
    left, right = ego(speed=12.0), ego(speed=12.0)
    for i in range(300):
        steer = 0.3 * math.sin(i / 20)
        pedals(left, throttle=0.4, steer=steer)
        pedals(right, throttle=0.4, steer=-steer)
        move(left)
        move(right)
        assert left.x[0] == right.x[0]
        assert left.y[0] == -right.y[0]
        assert left.yaw[0] == -right.yaw[0]
        assert left.lateral_accel[0] == -right.lateral_accel[0]


def test_motion_is_independent_of_the_heading() -> None:
    """Turned and moved as a whole: nothing depends on where on the map the car is."""
    turn = 2.5
    here, there = ego(speed=10.0), ego(speed=10.0, x=100.0, y=-70.0, yaw=turn)
    for i in range(200):
        for world in (here, there):
            pedals(world, throttle=0.5, steer=0.2 * math.cos(i / 30))
            move(world)
    x = 100.0 + here.x[0] * math.cos(turn) - here.y[0] * math.sin(turn)
    y = -70.0 + here.x[0] * math.sin(turn) + here.y[0] * math.cos(turn)
    assert (there.x[0], there.y[0]) == pytest.approx((x, y), abs=1e-9)


def test_reversed_motion_ends_at_its_start() -> None:
    world = ego(SLICK, speed=5.0)
    world.steer[0] = 0.3
    pedals(world, steer=0.3)
    speeds(world, 3.0)
    x, y, yaw = world.x[0], world.y[0], world.yaw[0]
    teleport(world, 0, x=x, y=y, z=0.0, yaw=yaw, speed=-5.0)
    speeds(world, 3.0)
    assert (world.x[0], world.y[0], world.yaw[0]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-8)


def test_headings_stay_within_half_a_turn() -> None:
    world = ego(SLICK, speed=10.0)
    for steer in (0.5, -0.5):
        pedals(world, steer=steer)
        for _ in range(600):
            move(world)
            assert -math.pi < world.yaw[0] <= math.pi


def test_heading_due_west_stays_pi() -> None:
    world = ego(yaw=-math.pi, speed=10.0)
    speeds(world, 1.0)
    assert world.yaw[0] == math.pi
    world.yaw[0] = -math.pi  # as an unlucky sum might leave it
    move(world)
    assert world.yaw[0] == math.pi


def test_smaller_steps_reduce_the_error() -> None:
    """Against a step of a sixteenth: the error falls at least in proportion with the step."""

    def end(parts: int) -> tuple[float, float]:
        world = ego(speed=3.0)
        for i in range(150):
            steer, throttle, brake = 0.4 * math.sin(i / 25), max(0.0, math.sin(i / 40)), max(0.0, -math.sin(i / 40)) / 4
            pedals(world, throttle, brake, steer)
            for _ in range(parts):
                drive(world, DT / parts)
        return float(world.x[0]), float(world.y[0])

    truth = end(16)
    errors = [math.dist(end(parts), truth) for parts in (1, 2, 4)]
    assert errors[0] < 0.01  # after three seconds and 20 m
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]


# -- pedals


def test_full_throttle_acceleration_is_that_of_a_fast_family_car() -> None:
    world = ego()
    pedals(world, throttle=1.0)
    trace = speeds(world, 60.0)
    to_100 = next(i for i, speed in enumerate(trace) if speed > 100 / 3.6) * DT
    assert 9.0 < to_100 < 11.0
    assert 175.0 < trace[-1] * 3.6 < 185.0
    assert world.throttle[0] == 1.0


def test_without_throttle_energy_never_grows() -> None:
    world = ego(speed=30.0)
    pedals(world, steer=0.05)
    trace = [30.0, *speeds(world, 60.0)]
    assert all(after <= before for before, after in pairwise(trace))
    assert trace[-1] < 10.0


@pytest.mark.parametrize("speed", [5.0, 15.0, 30.0])
def test_braking_distance_follows_from_the_brake(speed: float) -> None:
    body = replace(CAR, rolling=0.0, drag=0.0)
    world = ego(body, speed=speed)
    pedals(world, brake=0.5)
    speeds(world, 10.0)
    assert world.speed[0] == 0.0
    assert world.x[0] == pytest.approx(speed**2 / body.max_decel, abs=0.01)


@pytest.mark.parametrize("speed", [20.0, -3.0])
def test_braked_car_stops_and_stays_to_the_bit(speed: float) -> None:
    world = ego(speed=speed)
    pedals(world, brake=1.0, steer=0.3)
    speeds(world, 6.0)
    place = (world.x[0], world.y[0], world.yaw[0])
    for _ in range(200):
        move(world)
        assert (world.speed[0], world.accel[0], world.lateral_accel[0], world.yaw_rate[0]) == (0.0, 0.0, 0.0, 0.0)
        assert not np.signbit(world.speed[0])
    assert (world.x[0], world.y[0], world.yaw[0]) == place


def test_the_stronger_pedal_wins() -> None:
    world = ego()
    pedals(world, throttle=1.0, brake=1.0)
    assert speeds(world, 1.0)[-1] == 0.0
    pedals(world, throttle=1.0, brake=0.1)
    assert speeds(world, 1.0)[-1] == pytest.approx(3.5 - 0.85 - 0.12, abs=0.02)


def test_too_little_throttle_does_not_overcome_the_rolling_resistance() -> None:
    world = ego()
    pedals(world, throttle=CAR.rolling / CAR.max_accel)
    assert speeds(world, 5.0)[-1] == 0.0
    pedals(world, throttle=0.04)
    assert speeds(world, 5.0)[-1] > 0.05


def test_pedals_are_clipped_and_reported_as_commanded() -> None:
    world = ego()
    pedals(world, throttle=7.0, brake=-3.0)
    move(world)
    assert (world.throttle[0], world.brake[0]) == (1.0, 0.0)
    pedals(world, throttle=0.25, brake=0.125)
    move(world)
    assert (world.throttle[0], world.brake[0]) == (0.25, 0.125)


# -- gears


def test_a_parked_car_does_not_move() -> None:
    world = ego(gear=Gear.PARK)
    pedals(world, throttle=1.0, steer=0.3)
    speeds(world, 3.0)
    assert (world.x[0], world.y[0], world.yaw[0], world.speed[0]) == (0.0, 0.0, 0.0, 0.0)


def test_neutral_gear_rolls_without_drive() -> None:
    world = ego(gear=Gear.NEUTRAL, speed=10.0)
    pedals(world, throttle=1.0)
    trace = speeds(world, 5.0)
    assert 8.0 < trace[-1] < trace[0] < 10.0


def test_reverse_gear_drives_backwards() -> None:
    world = ego(gear=Gear.REVERSE)
    pedals(world, throttle=0.5, steer=0.2)
    speeds(world, 3.0)
    assert world.speed[0] < -3.0
    assert world.x[0] < -3.0
    assert world.y[0] > 0.0  # on the circle to its left, the other way round
    assert world.yaw[0] < 0.0
    pedals(world, brake=1.0)
    assert speeds(world, 2.0)[-1] == 0.0


def test_reverse_gear_at_forward_roll_passes_through_zero_speed() -> None:
    world = ego(speed=0.09)
    assert shift(world, 0, Gear.REVERSE)
    pedals(world, throttle=0.2)
    trace = speeds(world, 1.0)
    assert trace == sorted(trace, reverse=True)
    assert trace[-1] < -0.3


# -- speed and acceleration


@pytest.mark.parametrize("kmh", [1.0, 30.0, 60.0, 120.0])
@pytest.mark.parametrize("start", [0.0, 40.0])
def test_speed_mode_reaches_and_holds_its_target_without_overshoot(kmh: float, start: float) -> None:
    world = ego(speed=start)
    target = kmh / 3.6
    command(world, 0, mode=Mode.SPEED, speed=target, steer=0.0)
    trace = speeds(world, 25.0)
    if start < target:
        assert max(trace) <= target * 1.0001
    else:
        assert min(trace) >= target * 0.9999
    assert trace[-100:] == pytest.approx([target] * 100, rel=1e-6)
    assert 0.0 < world.throttle[0] < 1.0
    assert world.brake[0] == 0.0


def test_speed_mode_keeps_its_acceleration_limits() -> None:
    world = ego(replace(CAR, speed_mode_accel=1.0, speed_mode_decel=2.0))
    command(world, 0, mode=Mode.SPEED, speed=10.0, steer=0.0)
    assert speeds(world, 5.0)[-1] == pytest.approx(5.0, abs=0.01)
    assert world.accel[0] == pytest.approx(1.0)
    speeds(world, 10.0)
    command(world, 0, mode=Mode.SPEED, speed=0.0, steer=0.0)
    assert speeds(world, 2.0)[-1] == pytest.approx(6.0, abs=0.01)
    assert world.accel[0] == pytest.approx(-2.0)
    assert world.brake[0] > 0.0


@pytest.mark.parametrize("gear", [Gear.DRIVE, Gear.REVERSE])
def test_target_speed_zero_stops_without_throttle(gear: Gear) -> None:
    world = ego(gear=gear, speed=5.0 if gear == Gear.DRIVE else -5.0)
    command(world, 0, mode=Mode.SPEED, speed=0.0, steer=0.1)
    speeds(world, 5.0)
    for _ in range(100):
        move(world)
        assert (world.speed[0], world.accel[0], world.throttle[0]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("gear", "wish", "expected"),
    [(Gear.DRIVE, -5.0, 0.0), (Gear.REVERSE, 5.0, -5.0), (Gear.REVERSE, -5.0, -5.0), (Gear.PARK, 5.0, 0.0)],
)
def test_target_speed_is_in_the_direction_of_the_gear(gear: Gear, wish: float, expected: float) -> None:
    world = ego(gear=gear)
    command(world, 0, mode=Mode.SPEED, speed=wish, steer=0.0)
    assert speeds(world, 10.0)[-1] == pytest.approx(expected)


def test_acceleration_mode_holds_its_acceleration() -> None:
    world = ego()
    command(world, 0, mode=Mode.ACCEL, accel=1.5, steer=0.0)
    speeds(world, 0.1)  # the first step starts against the rolling resistance alone
    for _ in range(200):
        move(world)
        assert world.accel[0] == pytest.approx(1.5)
    assert 0.0 < world.throttle[0] <= 1.0


@pytest.mark.parametrize("accel", [-0.05, -1.0, -6.0, -1e9])
def test_constant_negative_acceleration_stops_the_car_for_good(accel: float) -> None:
    world = ego(speed=2.0)
    command(world, 0, mode=Mode.ACCEL, accel=accel, steer=0.0)
    move(world)
    if accel > -CAR.max_decel:
        assert world.accel[0] == pytest.approx(accel)
    speeds(world, 2.1 / min(1.0, -accel))
    for _ in range(100):
        move(world)
        assert world.speed[0] == 0.0


def test_acceleration_zero_holds_speed_and_standstill() -> None:
    world = ego(speed=15.0)
    command(world, 0, mode=Mode.ACCEL, accel=0.0, steer=0.0)
    assert speeds(world, 20.0)[-1] == pytest.approx(15.0)
    world = ego()
    command(world, 0, mode=Mode.ACCEL, accel=0.0, steer=0.0)
    assert speeds(world, 20.0)[-1] == 0.0


def test_positive_acceleration_in_reverse_drives_backwards() -> None:
    world = ego(gear=Gear.REVERSE)
    command(world, 0, mode=Mode.ACCEL, accel=1.0, steer=0.0)
    assert speeds(world, 3.0)[-1] == pytest.approx(-3.0, abs=0.02)


def test_acceleration_beyond_the_pedals_presses_them_fully() -> None:
    world = ego(speed=10.0)
    command(world, 0, mode=Mode.ACCEL, accel=50.0, steer=0.0)
    move(world)
    assert (world.throttle[0], world.brake[0]) == (1.0, 0.0)
    command(world, 0, mode=Mode.ACCEL, accel=-50.0, steer=0.0)
    move(world)
    assert (world.throttle[0], world.brake[0]) == (0.0, 1.0)


# -- the fast one against a slow one


@dataclass
class Slow:
    """The same car in plain Python, one formula after the other as the head of dynamics.py has them."""

    body: Body
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    speed: float = 0.0
    steer: float = 0.0
    throttle: float = 0.0
    brake: float = 0.0
    gear: Gear = Gear.DRIVE

    def step(self, wish: dict[str, Any], dt: float) -> None:
        body, sense = self.body, -1.0 if self.gear == Gear.REVERSE else 1.0
        drag = body.rolling + body.drag * self.speed**2
        if wish["mode"] == Mode.PEDALS:
            self.throttle, self.brake = min(max(wish["throttle"], 0), 1), min(max(wish["brake"], 0), 1)
        else:
            if wish["mode"] == Mode.SPEED:
                target = abs(wish["speed"]) if sense < 0 else max(wish["speed"], 0.0)
                accel = (target - sense * self.speed) / dt
                accel = max(min(accel, body.speed_mode_accel), -body.speed_mode_decel)
            else:
                accel, target = wish["accel"], 1.0
            self.throttle = min(max((accel + drag) / body.max_accel, 0.0), 1.0) if target else 0.0
            self.brake = min(max(-(accel + drag) / body.max_decel, 0.0), 1.0)
        drive = {Gear.DRIVE: 1, Gear.REVERSE: -1}.get(self.gear, 0) * body.max_accel * self.throttle
        hold = body.max_decel if self.gear == Gear.PARK else STICTION
        pushed = self.speed + drive * dt
        slowed = max(0.0, abs(pushed) - (drag + body.max_decel * self.brake + hold) * dt)
        speed = math.copysign(slowed, pushed)
        way = (self.speed + speed) / 2 * dt
        self.speed = speed
        limit = body.max_steer_rate * dt
        wanted = min(max(wish["steer"], -body.max_steer), body.max_steer)
        change = min(max(wanted - self.steer, -limit), limit)
        turn = way * math.tan(self.steer + change / 2) / body.wheelbase
        self.steer += change
        if abs(turn) > 1e-9:
            radius = way / turn
            self.x += radius * (math.sin(self.yaw + turn) - math.sin(self.yaw))
            self.y -= radius * (math.cos(self.yaw + turn) - math.cos(self.yaw))
        else:
            self.x += way * math.cos(self.yaw)
            self.y += way * math.sin(self.yaw)
        self.yaw += turn


WISHES = st.fixed_dictionaries(
    {
        "mode": st.sampled_from(Mode),
        "steer": st.floats(-1.0, 1.0),
        "throttle": st.floats(-0.5, 1.5),
        "brake": st.floats(-0.5, 1.5) | st.just(0.0),
        "speed": st.floats(-5.0, 40.0) | st.just(0.0),
        "accel": st.floats(-10.0, 5.0) | st.just(0.0),
    }
)
DRIVES = st.lists(st.tuples(WISHES, st.sampled_from(Gear), st.integers(1, 25)), min_size=1, max_size=6)


@given(st.lists(DRIVES, min_size=1, max_size=3), st.booleans())
def test_fast_path_equals_slow_path_for_any_row_layout(
    drives: list[list[tuple[dict[str, Any], Gear, int]]],
    has_gaps: bool,  # noqa: FBT001 - a drawn value
) -> None:
    world = World()
    bodies = [replace(CAR, wheelbase=2.0 + i, max_accel=2.0 + i) for i in range(len(drives))]
    for body in bodies:
        world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0)
        if has_gaps:
            world.spawn(Kind.VEHICLE, CAR, name="between", x=0.0, y=0.0, speed=1.0)
    rows = world.rows(Kind.EGO).tolist()
    slow = [Slow(body) for body in bodies]
    plans = [[(wish, gear) for wish, gear, num in plan for _ in range(num)] for plan in drives]
    for i in range(min(len(plan) for plan in plans)):
        for row, car, plan in zip(rows, slow, plans, strict=True):
            wish, gear = plan[i]
            if shift(world, row, gear):
                car.gear = gear
            command(world, row, **wish)
            car.step(wish, DT)
        move(world)
        for row, car in zip(rows, slow, strict=True):
            for name in ("x", "y", "speed", "steer", "throttle", "brake"):
                assert getattr(world, name)[row] == pytest.approx(getattr(car, name), abs=1e-8), name
            assert math.cos(world.yaw[row] - car.yaw) == pytest.approx(1.0)


# -- a drive


@pytest.mark.parametrize("kmh", [30.0, 60.0])
def test_pure_pursuit_keeps_the_rear_axle_on_a_winding_road(kmh: float) -> None:
    """Bends of 20 m radius at 30 km/h, of 80 m (the same lateral acceleration) at 60 km/h."""
    scale = (kmh / 30.0) ** 2
    curvature = np.repeat([0.0, 1 / 20.0, 0.0, -1 / 20.0, 1 / 20.0, 0.0], [30, 40, 30, 50, 50, 30]) / scale
    yaw = np.cumsum(curvature) * 0.5 * scale
    road = np.column_stack([np.cumsum(np.cos(yaw)), np.cumsum(np.sin(yaw))]) * 0.5 * scale
    world = ego(x=road[0, 0], y=road[0, 1], yaw=yaw[0])
    arcs = arc_lengths(road)
    worst, ahead = 0.0, 3.0 * math.sqrt(scale)
    for _ in range(5000):
        x, y, heading = world.x.item(0), world.y.item(0), world.yaw.item(0)
        near = nearest_on_polyline(road, x, y)
        worst = max(worst, abs(near.lateral.item(0)))
        if near.arc[0] > arcs[-1] - ahead - 1.0:
            break
        goal = point_at(road, arcs, near.arc + ahead)[0]
        left = left_of(goal[0] - x, goal[1] - y, heading)
        steer = math.atan2(2.0 * CAR.wheelbase * left, (goal[0] - x) ** 2 + (goal[1] - y) ** 2)
        command(world, 0, mode=Mode.SPEED, speed=kmh / 3.6, steer=steer)
        move(world)
    else:
        pytest.fail("the end of the road was not reached")
    assert world.speed[0] == pytest.approx(kmh / 3.6)
    assert worst < 0.3


@pytest.mark.parametrize("throttle", [0.0, 0.5])
def test_car_that_is_put_back_in_each_step_moves_in_each_step(throttle: float) -> None:
    world = ego()
    pedals(world, throttle=throttle)
    before, moved = world.block("target", "speed").copy(), []
    for _ in range(4):
        drive(world, DT)
        moved.append(world.x[0])
        world.block("target", "speed")[:] = before  # as something else may do within a step, without a `touch`
    assert len(set(moved)) == 1
    assert (moved[0] > 0.0) == (throttle > 0.0)
    drive(world, 2.0 * DT)
    assert (world.x[0] > moved[0]) == (throttle > 0.0)
