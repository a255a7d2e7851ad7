from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.records import replace
from rosbridge_sim.world.geometry.planar import FloatArray, quaternion, rotate
from rosbridge_sim.world.state import commands, placement
from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from rosbridge_sim.world.vehicle.sensor_readings import Mounting, _yaw_accel, feel, find_boxes, locate

CAR = Body()
# No drag and no patience: so that circles and ways have closed forms.
SLICK = replace(CAR, rolling=0.0, drag=0.0, max_steer_rate=1e6)

ON_AXLE = Mounting()
ROOF = Mounting(x=1.5, y=-0.4, z=1.6)


def ego(body: Body = CAR, **figures: Any) -> World:  # noqa: ANN401 - whatever spawn takes
    """A world of one ego, in row 0."""
    world = World()
    usual: dict[str, Any] = {"name": "ego", "x": 0.0, "y": 0.0, "uid": 0}
    world.spawn(Kind.EGO, body, **(usual | figures))
    return world


def drive(world: World, num: int, **wishes: float) -> None:
    mode = Mode.SPEED if "speed" in wishes else Mode.PEDALS
    commands.command(world, 0, mode=mode, steer=wishes.pop("steer", 0.0), **wishes)
    for _ in range(num):
        step(world)


def approx(*values: float, tolerance: float = 1e-8) -> Any:  # noqa: ANN401 - pytest's own
    return pytest.approx(values, abs=tolerance)


# -- where a sensor is


@pytest.mark.parametrize(
    ("yaw", "place"),
    [(0.0, (11.5, 19.6, 4.6)), (math.pi / 2, (10.4, 21.5, 4.6)), (math.pi, (8.5, 20.4, 4.6))],
)
def test_antenna_position_follows_the_vehicle_pose(yaw: float, place: tuple[float, float, float]) -> None:
    assert locate(ego(x=10.0, y=20.0, z=3.0, yaw=yaw), 0, ROOF) == approx(*place)


def test_antenna_on_a_slope_is_tilted() -> None:
    world = ego()
    placement.teleport(world, 0, x=0.0, y=0.0, z=0.0, yaw=math.pi / 2, pitch=-math.pi / 2)  # nose up, it looked north
    assert locate(world, 0, Mounting(x=2.0, z=1.0)) == approx(0.0, -1.0, 2.0)
    placement.teleport(world, 0, x=0.0, y=0.0, z=0.0, yaw=0.0, roll=math.pi / 2)  # on its right side
    assert locate(world, 0, Mounting(y=2.0, z=1.0)) == approx(0.0, -1.0, 2.0)


def test_sensor_at_the_rear_axle_has_the_vehicle_position() -> None:
    assert locate(ego(x=1.0, y=2.0, z=3.0, yaw=1.0), 0, ON_AXLE) == (1.0, 2.0, 3.0)


# -- what an inertial unit feels


def test_imu_at_rest_has_gravity_upward_and_its_heading() -> None:
    reading = feel(ego(yaw=0.7), 0, ROOF)
    assert reading.acceleration == approx(0.0, 0.0, GRAVITY)
    assert reading.angular_velocity == (0.0, 0.0, 0.0)
    assert reading.orientation == quaternion(0.0, 0.0, 0.7)


def test_imu_measures_longitudinal_acceleration_at_any_mounting() -> None:
    world = ego(SLICK)
    drive(world, 10, throttle=0.5)
    for mounting in (ON_AXLE, ROOF):
        assert feel(world, 0, mounting).acceleration == approx(0.5 * SLICK.max_accel, 0.0, GRAVITY)


@pytest.mark.parametrize("speed", [5.0, 20.0, -4.0])
@pytest.mark.parametrize("steer", [0.2, -0.3])
def test_imu_measures_the_centripetal_acceleration_of_its_own_circle(speed: float, steer: float) -> None:
    world = ego(SLICK, speed=speed, yaw=2.0)
    world.steer[0] = steer
    drive(world, 50, steer=steer)
    rate = speed * math.tan(steer) / SLICK.wheelbase
    radius = SLICK.wheelbase / math.tan(steer)
    reading = feel(world, 0, ROOF)
    assert reading.angular_velocity == approx(0.0, 0.0, rate, tolerance=1e-7)
    # The middle of the circle lies `radius` to the left of the axle; the pull is towards it, by its distance.
    pull = (-(rate**2) * ROOF.x, rate**2 * (radius - ROOF.y), GRAVITY)
    assert reading.acceleration == approx(*pull, tolerance=1e-7)  # it slows by a little, see STICTION


def test_imu_measures_angular_acceleration_of_throttle_in_a_turn() -> None:
    steer = 0.3
    world = ego(SLICK, speed=4.0)
    world.steer[0] = steer
    drive(world, 1, steer=steer, throttle=1.0)
    on_axle, ahead = feel(world, 0, ON_AXLE).acceleration, feel(world, 0, Mounting(x=2.0)).acceleration
    swing = SLICK.max_accel * math.tan(steer) / SLICK.wheelbase
    assert ahead[1] - on_axle[1] == pytest.approx(2.0 * swing, abs=1e-9)


def motion(world: World, mounting: Mounting, num: int) -> tuple[FloatArray, FloatArray]:
    """Places of the sensor (num, 3), and what it feels in the map's axes (num, 3), frame by frame."""
    places, felt = [], []
    for _ in range(num):
        step(world)
        places.append(locate(world, 0, mounting))
        reading = feel(world, 0, mounting)
        felt.append(rotate(reading.orientation, reading.acceleration))
    return np.array(places), np.array(felt)


def test_imu_acceleration_equals_the_second_derivative_of_its_position() -> None:
    world = ego(speed=8.0, yaw=-1.0)
    commands.command(world, 0, mode=Mode.PEDALS, steer=0.5, throttle=0.3)
    mounting = Mounting(x=3.0, y=0.8, z=1.0, roll=0.3, pitch=-0.2, yaw=1.0)
    places, felt = motion(world, mounting, 40)  # the wheels get there within 42 steps
    way = np.diff(places, n=2, axis=0) / DT**2  # at frames 1..38
    between = 0.5 * (felt[1:-1] + felt[2:])  # a reading is of the middle of its step
    # Of up to 20 m/s^2. What is left is dt: readings are of a step and shown in the axes of its end.
    np.testing.assert_allclose(between[:, :2], way[:, :2], atol=0.4)
    np.testing.assert_allclose(felt[:, 2], GRAVITY, atol=1e-12)
    still = Mounting(**{name: getattr(mounting, name) for name in ("roll", "pitch", "yaw")})
    without_lever = np.array([rotate(feel(world, 0, still).orientation, feel(world, 0, still).acceleration)])
    assert np.abs(felt[-1] - without_lever[0]).max() > 1.0  # so the test has seen the lever


def test_tilted_imu_measures_in_its_own_axes() -> None:
    world = ego(SLICK)
    drive(world, 10, throttle=1.0)
    push = SLICK.max_accel
    assert feel(world, 0, Mounting(yaw=math.pi / 2)).acceleration == approx(0.0, -push, GRAVITY)
    assert feel(world, 0, Mounting(roll=math.pi)).acceleration == approx(push, 0.0, -GRAVITY)
    assert feel(world, 0, Mounting(pitch=-math.pi / 2)).acceleration == approx(GRAVITY, 0.0, -push)
    assert feel(world, 0, Mounting(yaw=0.25)).orientation == approx(*quaternion(0.0, 0.0, 0.25))


def test_imu_in_a_tilted_vehicle_has_lateral_gravity() -> None:
    world = ego()
    placement.teleport(world, 0, x=0.0, y=0.0, z=0.0, yaw=1.0, roll=0.2)
    lean = feel(world, 0, ROOF).acceleration
    assert lean == approx(0.0, GRAVITY * math.sin(0.2), GRAVITY * math.cos(0.2))


def test_teleport_gives_no_acceleration_peak() -> None:
    world = ego(speed=10.0)
    drive(world, 20, steer=0.4)
    placement.teleport(world, 0, x=5.0, y=5.0, z=0.0, yaw=0.0, speed=10.0)
    assert feel(world, 0, ROOF).acceleration == approx(0.0, 0.0, GRAVITY)
    commands.turn_wheels(world, 0, -0.4)
    assert feel(world, 0, ROOF).acceleration == approx(0.0, 0.0, GRAVITY)
    placement.place_ghost(world, 0, x=0.0, y=0.0, z=0.0, yaw=0.0, speed=10.0)
    step(world)
    assert feel(world, 0, ROOF).acceleration == approx(0.0, 0.0, GRAVITY)


# -- the boxes around


def test_boxes_are_in_the_ego_frame_with_the_nearest_first() -> None:
    world = ego(x=10.0, y=10.0, yaw=math.pi / 2)
    world.spawn(Kind.OBSTACLE, Body.box(1.0, 2.0, 3.0), name="far", x=10.0, y=40.0, uid=7, yaw=-2.0)
    world.spawn(Kind.VEHICLE, CAR, name="car", x=4.0, y=10.0, yaw=math.pi, uid=8, speed=-2.0)
    world.spawn(Kind.PEDESTRIAN, Body.box(0.5, 0.5, 1.7), name="beyond", x=10.0, y=110.1, uid=9)
    boxes = find_boxes(world, 0, 100.0, 10)
    assert world.uid[boxes.rows].tolist() == [8, 7]
    assert boxes.x.tolist() == approx(0.0, 30.0)
    assert boxes.y.tolist() == approx(6.0 + CAR.centre, 0.0)
    assert boxes.z.tolist() == approx(CAR.height / 2, 1.5)
    assert boxes.length.tolist() == approx(CAR.length, 1.0)
    assert boxes.width.tolist() == approx(CAR.width, 2.0)
    assert boxes.height.tolist() == approx(CAR.height, 3.0)
    assert boxes.yaw.tolist() == approx(math.pi / 2, 1.5 * math.pi - 2.0)
    assert boxes.distance.tolist() == approx(math.hypot(6.0 + CAR.centre, CAR.height / 2), math.hypot(30.0, 1.5))
    assert boxes.speed.tolist() == [-2.0, 0.0]


def test_boxes_of_tilted_objects_and_for_a_tilted_ego_are_right() -> None:
    world = ego()
    world.spawn(Kind.VEHICLE, CAR, name="car", x=20.0, y=3.0, uid=8)
    mine, other = (0.1, -0.2, 0.4), (-0.3, 0.25, 2.0)
    for row, (roll, pitch, yaw) in enumerate((mine, other)):
        x, y = world.x.item(row), world.y.item(row)
        placement.teleport(world, row, x=x, y=y, z=1.0 + row, roll=roll, pitch=pitch, yaw=yaw)
    boxes = find_boxes(world, 0, 100.0, 10)
    middle = rotate(quaternion(*other), (CAR.centre, 0.0, CAR.height / 2))
    seen = rotate(quaternion(*mine), (boxes.x[0], boxes.y[0], boxes.z[0]))
    assert seen == approx(20.0 + middle[0], 3.0 + middle[1], 1.0 + middle[2])


def test_number_of_boxes_is_bounded_and_empty_without_objects() -> None:
    world = ego()
    assert len(find_boxes(world, 0, 100.0, 10).rows) == 0
    for i in range(1, 9):
        world.spawn(Kind.OBSTACLE, Body.box(1.0, 1.0, 1.0), name="box", x=10.0 - i, y=5.0, uid=i)
    world.remove(5)
    assert world.uid[find_boxes(world, 0, 100.0, 3).rows].tolist() == [8, 7, 6]


@pytest.mark.parametrize(("share", "counts"), [(-0.9, True), (0.9, True), (1.1, False), (-3.0, False)])
def test_wheels_that_were_set_from_outside_turn_the_car_with_no_acceleration(share: float, *, counts: bool) -> None:
    world = World()
    row = world.row(world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0, speed=8.0))
    turned = share * 0.5 * DT * float(world.steer_rate[row])
    world.steer[row] = turned
    expected = 8.0 * turned / (0.5 * DT) / float(world.wheelbase[row]) if counts else 0.0
    assert _yaw_accel(world, row) == pytest.approx(expected)


def test_yaw_acceleration_from_rest_is_that_of_turned_wheels_and_none_without_them_or_as_a_ghost() -> None:
    world = World()
    scooter = Body(1.6, 0.6, 1.2, wheelbase=0.9, front_overhang=0.3, rear_overhang=0.4)
    rows = [world.row(world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0)) for body in (CAR, scooter, CAR, CAR)]
    world.steer[rows], world.accel[rows], world.speed[rows] = 0.2, 1.5, 0.5 * DT * 1.5
    world.is_ghost[rows[2]], world.wheelbase[rows[3]] = True, 0.0
    turning = [1.5 * math.tan(0.2) / wheelbase for wheelbase in (CAR.wheelbase, 0.9)]
    assert [_yaw_accel(world, row) for row in rows] == pytest.approx([*turning, 0.0, 0.0])
