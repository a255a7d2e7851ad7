"""Entities on hills: height, pitch and roll, grade, contacts, and bridges over roads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.followers.lane_following import view_driver
from rosbridge_sim.world.followers.self_driving import start_self_driving
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.surface import Surface
from rosbridge_sim.world.scoring import read_score
from rosbridge_sim.world.state.commands import command, shift
from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.state.placement import place_ghost, teleport
from rosbridge_sim.world.state.world import DT, Body, Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from rosbridge_sim.world.vehicle.sensor_readings import Mounting, feel
from tests.world.road_factory import CAR, built_in, keep_lane, line, make

pytestmark = pytest.mark.usefixtures("loops")

MAN = Body.box(0.45, 0.55, 1.7)
CONE = Body.box(0.4, 0.4, 0.3)
BRIDGE = 6.5  # height of the bridge of the map hills, over (0, 0) [m]
BOTH = pytest.mark.parametrize("dynamics", list(Dynamics))


def slope(percent: float, length: float = 1000.0) -> Roads:
    """A road to the east that is level for 100 m, then rises."""
    ahead = [(x, 0.0) for x in np.arange(0.0, length + 1.0, 10.0).tolist()]
    points = line(*ahead)
    points[:, 2] = np.maximum(points[:, 0] - 100.0, 0.0) * percent / 100.0
    return make(a=(points, ""))


def world_on(roads: Roads, dynamics: Dynamics = Dynamics.SINGLE_TRACK, *, is_creeping: bool = False) -> World:
    world = World(3, dynamics, is_creeping=is_creeping)
    world.lay_roads(roads)
    return world


def hills(dynamics: Dynamics = Dynamics.SINGLE_TRACK) -> World:
    world = World(3, dynamics)
    road_map = built_in("hills")
    world.lay_roads(road_map.roads, road_map.plan)
    return world


def ego(world: World, x: float, y: float = 0.0, *, z: float | None = None, yaw: float = 0.0, speed: float = 0.0) -> int:
    return world.row(world.spawn(Kind.EGO, CAR, name="ego", x=x, y=y, z=z, yaw=yaw, speed=speed))


def thing(  # noqa: PLR0917 - as few words as a drawing
    world: World, kind: Kind, body: Body, x: float, y: float = 0.0, z: float | None = None
) -> int:
    return world.row(world.spawn(kind, body, name="thing", x=x, y=y, z=z))


def hold(world: World, row: int, speed: float) -> None:
    command(world, row, mode=Mode.SPEED, steer=0.0, speed=speed)


def road_height(x: float, percent: float) -> float:
    return max(x - 100.0, 0.0) * percent / 100.0


# -- height and attitude


@BOTH
@pytest.mark.parametrize("speed", [5.0, 15.0, 40.0])
def test_height_of_an_ego_is_that_of_a_slope_within_a_centimetre(dynamics: Dynamics, speed: float) -> None:
    world = world_on(slope(6.0), dynamics)
    row = ego(world, 95.0, speed=speed)
    hold(world, row, speed)
    for _ in range(int(17.0 / speed / DT)):
        step(world)
        assert abs(world.z.item(row) - road_height(world.x.item(row), 6.0)) < 0.01
    assert world.x.item(row) > 110.0
    assert world.ground_pitch.item(row) == pytest.approx(-math.atan(0.06))
    assert world.climb.item(row) == pytest.approx(0.06 * world.speed.item(row), rel=0.02)


def test_everything_that_moves_or_is_placed_stands_on_the_slope() -> None:
    world = world_on(slope(10.0))
    box = thing(world, Kind.OBSTACLE, CONE, 200.0, z=3.0)
    man = world.row(
        world.spawn(
            Kind.PEDESTRIAN, MAN, name="man", x=150.0, y=3.0, speed=1.5, path=np.array([[150.0, 3.0], [300.0, 3.0]])
        )
    )
    straight = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=120.0, y=-3.0, speed=10.0))
    driver = thing(world, Kind.VEHICLE, CAR, 130.0)
    keep_lane(world, driver, 0, 130.0)
    parked = ego(world, 400.0)
    for _ in range(100):
        step(world)
        for row in (box, man, straight, driver, parked):
            assert world.z.item(row) == pytest.approx(road_height(world.x.item(row), 10.0), abs=1e-9)
    assert world.x.item(driver) > 131.0
    for row in (box, straight, driver, parked):
        assert world.pitch.item(row) == pytest.approx(-math.atan(0.1))
    assert world.pitch.item(man) == 0.0, "people stand upright"


def test_reverse_and_crosswise_vehicles_lean_as_the_ground_does() -> None:
    world = world_on(slope(10.0))
    down, across = ego(world, 300.0, yaw=math.pi), ego(world, 320.0, yaw=math.pi / 2)
    assert world.pitch.item(down) == pytest.approx(math.atan(0.1))
    assert (world.pitch.item(across), world.roll.item(across)) == pytest.approx((0.0, -math.atan(0.1)))
    felt = feel(world, down, Mounting())
    assert felt.acceleration == pytest.approx(
        (-GRAVITY * math.sin(math.atan(0.1)), 0.0, GRAVITY * math.cos(math.atan(0.1)))
    )


def test_banked_bend_rolls_a_vehicle() -> None:
    world = hills()
    lane = world.roads.row("F1")
    s = world.roads.s[world.roads.first[lane] + 75]  # at a point of the map, where the lane's line is on its legs
    (place,), (yaw,) = world.roads.at(lane, s)
    x, y, z = place.tolist()
    row = ego(world, x, y, z=z, yaw=float(yaw))
    assert world.roll.item(row) == pytest.approx(-math.atan(0.04), abs=0.002), "the outside of a left bend is higher"
    assert world.z.item(row) == pytest.approx(z, abs=1e-6)
    beside = ego(world, x, y, z=z, yaw=0.0)
    assert world.pitch.item(beside) != world.pitch.item(row)


def test_flat_map_is_not_searched() -> None:
    world = world_on(built_in("town").roads)
    row = ego(world, 5.0, z=1.25, speed=3.0)
    before = world.z.item(row)
    for _ in range(10):
        step(world)
    assert (world.z.item(row), world.pitch.item(row), world.grade.item(row)) == (
        before,
        world.lean_pitch.item(row),
        0.0,
    )
    assert world.roads.is_flat
    assert Surface not in world.roads.kept


@BOTH
def test_map_change_puts_egos_onto_the_new_ground(dynamics: Dynamics) -> None:
    world = World(0, dynamics)
    row = ego(world, 300.0)
    world.lay_roads(slope(5.0))
    assert world.z.item(row) == pytest.approx(10.0)
    world.lay_roads(slope(0.0))
    step(world)
    assert (world.grade.item(row), world.pitch.item(row)) == (0.0, 0.0)


# -- placement


def test_height_chooses_between_bridge_and_road_below() -> None:
    world = hills()
    expected = {None: 0.0, -2.0: 0.0, 0.0: 0.0, 2.0: 0.0, 5.0: BRIDGE, BRIDGE: BRIDGE, 20.0: BRIDGE}
    for z, height in expected.items():
        row = ego(world, 0.0, -1.0, z=z)
        assert world.z.item(row) == pytest.approx(height), z


def test_ghost_keeps_its_height_until_it_is_driven() -> None:
    world = world_on(slope(5.0))
    row = ego(world, 200.0)
    place_ghost(world, row, x=300.0, y=0.0, z=77.0, yaw=0.0, speed=5.0, pitch=0.3)
    step(world)
    assert (world.z.item(row), world.pitch.item(row)) == (77.0, 0.3)
    command(world, row, mode=Mode.PEDALS, steer=0.0)
    step(world)
    assert world.z.item(row) == pytest.approx(road_height(world.x.item(row), 5.0))
    assert world.pitch.item(row) == pytest.approx(-math.atan(0.05), abs=1e-3)


def test_teleport_puts_an_ego_onto_the_ground() -> None:
    world = world_on(slope(5.0))
    row = ego(world, 0.0)
    teleport(world, row, x=500.0, y=1.0, z=0.0, yaw=0.0, pitch=0.2)
    assert (world.z.item(row), world.pitch.item(row)) == pytest.approx((20.0, -math.atan(0.05)))


# -- grade


def test_coasting_downhill_accelerates_by_gravity_without_resistance() -> None:
    world = world_on(slope(-6.0))
    row = ego(world, 300.0, speed=10.0)
    command(world, row, mode=Mode.PEDALS, steer=0.0)
    for _ in range(100):
        step(world)
        body, speed = world.bodies[row], world.speed.item(row)
        expected = GRAVITY * math.sin(math.atan(0.06)) - body.rolling - body.air_drag * speed * speed - body.engine_drag
        assert world.accel.item(row) == pytest.approx(expected, abs=1e-3)
    assert expected > 0.0


def test_what_stands_on_a_slope_stays_and_rolls_only_with_creep() -> None:
    still, rolling = (world_on(slope(-8.0), is_creeping=is_creeping) for is_creeping in (False, True))
    for world in (still, rolling):
        row = ego(world, 300.0)
        shift(world, row, Gear.NEUTRAL)
        digest = world.x.item(row), world.z.item(row)
        for _ in range(130):
            step(world)
        if world is still:
            assert (world.x.item(row), world.z.item(row), world.speed.item(row)) == (*digest, 0.0)
        else:
            assert world.speed.item(row) > 1.0


@pytest.mark.parametrize("percent", [10.0, -10.0])
def test_speed_mode_holds_its_speed_on_a_slope(percent: float) -> None:
    world = world_on(slope(percent))
    row = ego(world, 90.0, speed=10.0)
    hold(world, row, 10.0)
    for _ in range(180):
        step(world)
    assert world.x.item(row) > 120.0
    assert world.speed.item(row) == pytest.approx(10.0, abs=0.05)


# -- contacts


@BOTH
@pytest.mark.parametrize("speed", [3.0, 14.0, 40.0])
def test_car_on_a_slope_is_hit_at_any_speed(dynamics: Dynamics, speed: float) -> None:
    world = hills(dynamics)
    lane = world.roads.row("F1")
    (x, y, z), yaw = (each[0] for each in world.roads.at(lane, 40.0))
    parked = ego(world, float(x), float(y), z=float(z), yaw=float(yaw))
    (x, y, z), yaw = (each[0] for each in world.roads.at(lane, 32.0))
    row = ego(world, float(x), float(y), z=float(z), yaw=float(yaw), speed=speed)
    hold(world, row, speed)
    pairs = set()
    for _ in range(int(8.0 / speed / DT)):
        step(world)
        pairs |= {tuple(pair) for pair in world.contacts.tolist()}
    assert pairs == {(world.uid.item(parked), world.uid.item(row))}


@pytest.mark.parametrize("is_downhill", [False, True])
def test_low_box_is_hit_on_a_slope(is_downhill: bool) -> None:  # noqa: FBT001 - a parameter of a test
    world = world_on(slope(10.0))
    box = thing(world, Kind.OBSTACLE, CONE, 305.0)
    row = ego(world, 318.0 if is_downhill else 292.0, yaw=math.pi if is_downhill else 0.0, speed=5.0)
    hold(world, row, 5.0)
    for _ in range(120):
        step(world)
        if len(world.contacts):
            break
    assert world.contacts.tolist() == [[world.uid.item(box), world.uid.item(row)]]
    assert abs(world.x.item(row) - 305.0) > 2.5, "the bumper touches it, not the rear axle"


@pytest.mark.parametrize("speed", [pytest.param(2.0, marks=pytest.mark.slow), 14.0, 40.0])
def test_drive_below_a_bridge_or_on_it_meets_nobody_on_the_other_road(speed: float) -> None:
    world = hills()
    world.start_scoring()
    above, below = (
        thing(world, Kind.VEHICLE, CAR, -1.0, -1.75, BRIDGE),
        thing(world, Kind.VEHICLE, CAR, -1.75, 0.0, 0.0),
    )
    down = ego(world, -1.75, 20.0, z=0.0, yaw=-math.pi / 2, speed=speed)
    over = ego(world, -18.0, -1.75, z=BRIDGE, speed=speed)
    teleport(world, below, x=1.75, y=-3.0, z=0.0, yaw=math.pi / 2)
    teleport(world, above, x=-1.0, y=1.75, z=BRIDGE, yaw=math.pi)
    for row in (down, over):
        hold(world, row, speed)
    for _ in range(int(36.0 / speed / DT)):
        step(world)
        assert not len(world.contacts)
    for row in (down, over):
        score = read_score(world, row)
        assert (score.min_time_to_collision, score.off_road_time, score.num_lane_invasions) == (math.inf, 0.0, 0)
        assert score.max_lane_offset < 0.1
    assert world.z.item(down) == pytest.approx(0.0, abs=1e-6)
    assert world.z.item(over) == pytest.approx(BRIDGE, abs=0.5)


def test_driver_below_the_bridge_does_not_see_a_car_on_it() -> None:
    world = hills()
    thing(world, Kind.VEHICLE, CAR, -1.0, -1.75, BRIDGE)
    driver = thing(world, Kind.VEHICLE, CAR, -1.75, 20.0)
    keep_lane(world, driver, world.roads.row("F2"), 55.0)
    view = view_driver(world, driver)
    assert view is not None
    assert (view.lead, view.gap) == (-1, math.inf)
    blocked = thing(world, Kind.VEHICLE, CAR, -1.75, 0.0, 0.0)
    view = view_driver(world, driver)
    assert view is not None
    assert view.lead == blocked


def test_time_to_collision_counts_a_car_ahead_on_a_slope() -> None:
    world = world_on(slope(10.0))
    world.start_scoring()
    row = ego(world, 300.0, speed=10.0)
    thing(world, Kind.VEHICLE, CAR, 350.0)
    step(world)
    assert world.time_to_collision.item(row) == pytest.approx(4.5, abs=0.2)


@pytest.mark.slow
def test_self_driving_ego_drives_over_the_crest_and_below_the_bridge() -> None:
    world = hills()
    world.start_scoring()
    row = ego(world, -20.0, -1.75, z=BRIDGE, speed=12.0)
    parked = thing(world, Kind.VEHICLE, CAR, 0.0, 1.75, BRIDGE)
    assert start_self_driving(world, row)
    heights = []
    for _ in range(2400):
        step(world)
        line_height = world.roads.at(world.lane[row], world.arc[row])[0][0, 2]
        assert abs(world.z.item(row) - line_height) < 0.02
        heights.append(world.z.item(row))
    assert max(heights) > 16.0
    assert min(heights) < 0.1
    assert world.speed.item(row) > 10.0
    assert read_score(world, row).num_collisions == 0
    assert world.z.item(parked) == pytest.approx(BRIDGE)


# -- bits


@BOTH
def test_many_egos_on_hills_have_the_bits_of_each_alone(dynamics: Dynamics) -> None:
    def start(world: World, i: int) -> int:
        lane = i % len(world.roads)
        (x, y, z), yaw = (each[0] for each in world.roads.at(lane, 3.0 + 2.0 * i))
        row = ego(world, float(x), float(y), z=float(z), yaw=float(yaw), speed=4.0 + i)
        hold(world, row, 9.0)
        return row

    together = hills(dynamics)
    rows = [start(together, i) for i in range(7)]
    for _ in range(30):
        step(together)
    for i in (0, 3, 6):
        row = rows[i]
        alone = hills(dynamics)
        (only,) = (start(alone, i),)
        for _ in range(30):
            step(alone)
        for column in ("x", "y", "z", "pitch", "roll", "grade", "climb", "speed", "pitch_rate"):
            assert getattr(alone, column)[only] == getattr(together, column)[row], column


def test_restored_world_drives_on_with_the_same_bits_on_hills() -> None:
    world = hills()
    row = ego(world, 40.0, -1.75, speed=10.0)
    start_self_driving(world, row)
    world.spawn(Kind.PEDESTRIAN, MAN, name="man", x=60.0, y=-5.0, speed=1.0)
    for _ in range(33):
        step(world)
    saved = world.snapshot()
    digests = []
    for start in (world, World(8)):
        if start is not world:
            start.restore(saved)
        for _ in range(40):
            step(start)
        digests.append(start.digest())
    assert digests[0] == digests[1]


# -- vertical motion


def test_climb_is_the_change_of_height_and_its_acceleration_the_change_of_climb() -> None:
    """Over the crest and the bends of the hills, where the map has points and lanes meet."""
    world = hills()
    place, yaw = world.roads.at(world.roads.row("F1"), 20.0)
    x, y, z = place[0].tolist()
    row = ego(world, x, y, z=z, yaw=yaw.item())
    assert start_self_driving(world, row)
    heights, climbs, accels = [], [], []
    for _ in range(1500):
        step(world)
        heights.append(world.z.item(row))
        climbs.append(world.climb.item(row))
        accels.append(world.climb_accel.item(row))
    half_second = np.ones(25) / 25
    mean = np.convolve(np.diff(heights) / DT, half_second, "valid")
    assert np.convolve(climbs[1:], half_second, "valid") == pytest.approx(mean, abs=0.03)
    assert np.cumsum(accels) * DT == pytest.approx(np.array(climbs), abs=0.02)
    assert max(map(abs, accels)) < 2.5, "no peak where the map has a point"
    assert max(climbs) - min(climbs) > 1.0


def test_ego_that_backs_up_a_slope_climbs() -> None:
    world = world_on(slope(8.0))
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=300.0, y=0.0, yaw=math.pi, gear=Gear.REVERSE))
    hold(world, row, 5.0)
    for _ in range(200):
        step(world)
    assert world.speed.item(row) == pytest.approx(-5.0, abs=0.01)
    assert world.climb.item(row) == pytest.approx(0.4, abs=0.001)


def test_ego_that_is_placed_on_a_slope_with_speed_does_not_jump() -> None:
    world = world_on(slope(8.0))
    row = ego(world, 300.0, speed=20.0)
    step(world)
    assert world.climb.item(row) == pytest.approx(0.08 * world.speed.item(row), rel=1e-6)
    assert world.climb_accel.item(row) == pytest.approx(0.08 * world.accel.item(row), abs=1e-6)
    hold(world, row, 20.0)
    for _ in range(100):
        step(world)
    assert world.climb_accel.item(row) == pytest.approx(0.08 * world.accel.item(row), abs=1e-6)


def test_inertial_unit_feels_a_dip() -> None:
    """A road that falls and then rises presses the car down by v^2 times the change of slope for each metre."""
    points = line(*[(x, 0.0) for x in np.arange(0.0, 601.0, 2.5).tolist()])
    points[:, 2] = 0.0005 * (points[:, 0] - 300.0) ** 2
    for dynamics, wanted in ((Dynamics.SINGLE_TRACK, 0.4), (Dynamics.KINEMATIC, 0.0)):
        world = world_on(make(a=(points, "")), dynamics)
        row = ego(world, 260.0, speed=20.0)
        hold(world, row, 20.0)
        felt = []
        for _ in range(150):
            step(world)
            ahead, _, up = feel(world, row, Mounting()).acceleration
            pitch = world.pitch.item(row)
            felt.append(up * math.cos(pitch) - ahead * math.sin(pitch) - GRAVITY)
        assert np.mean(felt[50:]) == pytest.approx(wanted, abs=0.03), dynamics
