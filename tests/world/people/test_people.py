"""Pedestrians that heed others: on the pavement, at the kerb, on the road, and among each other."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.geometry.neighbours import find_neighbours
from rosbridge_sim.world.people.crossings import find_crossings
from rosbridge_sim.world.people.people import COMMITTED, find_ways_over, walk
from rosbridge_sim.world.roads.paths import lay_segments
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import world_of
from tests.world.road_factory import CAR, car, ego, line, make, road

pytestmark = pytest.mark.usefixtures("loops")

MAN = Body.box(0.45, 0.55, 1.7)
OVER = np.array([[50.0, -12.0], [50.0, 12.0]])
"""A path over the road of the tests, which leads east along y = 0 and is 3.5 m wide."""


def walker(world: World, path: np.ndarray = OVER, speed: float = 1.3, *, is_loop: bool = False) -> int:
    x, y = path[0]
    return world.row(
        world.spawn(Kind.PEDESTRIAN, MAN, name="man", x=x, y=y, path=path, speed=speed, is_loop=is_loop, yields=True)
    )


def lit(colour: Lamp) -> World:
    """Return a road with a light for pedestrians that always shows a colour."""
    roads = road()
    light = Light("walk", is_pedestrian=True, x=50.0, y=-3.0)
    return world_of(
        roads, SignalPlan(roads, [light], [Controller("c", 1, ((0,),), (Phase(10, (int(colour),)),), (0,))])
    )


def test_pedestrian_crosses_a_free_road_and_stops_at_the_end_of_its_path() -> None:
    world = world_of(road())
    row = walker(world)
    states = set()
    for _ in range(1150):
        step(world)
        states.add(int(world.yields[row]))
    assert states == {1, COMMITTED}
    assert (world.x[row], world.y[row]) == (pytest.approx(50.0, abs=1.0), pytest.approx(12.0, abs=1.3))
    assert world.speed[row] == 0.0


def test_pedestrian_crosses_each_road_on_its_path() -> None:
    world = world_of(make(a=(line((0, 0), (100, 0)), ""), b=(line((0, 12), (100, 12)), "")))
    row = walker(world, np.array([[50.0, -5.0], [50.0, 18.0]]))
    states = set()
    for _ in range(950):
        step(world)
        states.add(int(world.yields[row]))
    assert states == {1, COMMITTED, COMMITTED + 1}
    assert world.y[row] > 16.5


@pytest.mark.parametrize(("colour", "crosses"), [(Lamp.RED, False), (Lamp.GREEN, True)])
def test_pedestrian_waits_at_the_kerb_for_green(colour: Lamp, crosses: bool) -> None:  # noqa: FBT001 - a case
    world = lit(colour)
    row = walker(world)
    for _ in range(600):
        step(world)
    assert (world.y[row] > 3.0) == crosses
    if not crosses:
        assert -3.0 < world.y[row] < -1.75
        assert world.speed[row] == 0.0


@pytest.mark.parametrize(
    ("colour", "goes"), [(Lamp.RED, False), (Lamp.GREEN, True), (Lamp.RED | Lamp.GREEN, True), (Lamp(0), False)]
)
def test_pedestrian_at_the_kerb_begins_to_cross_when_green_is_shown(colour: Lamp, *, goes: bool) -> None:
    world = lit(colour)
    row = walker(world)
    world.y[row], world.leg_start[row], world.frame = -2.7, 9.3, 2
    walk(world)
    assert world.yields[row] == (COMMITTED if goes else 1)


@pytest.mark.parametrize(("speed", "waits"), [(0.25, False), (0.35, True)])
def test_pedestrian_minds_a_vehicle_in_front_of_its_way_unless_it_can_stop_at_once(
    speed: float, *, waits: bool
) -> None:
    world = world_of(road())
    row = walker(world, speed=0.6)
    world.y[row], world.leg_start[row], world.frame = -2.7, 9.3, 2
    ego(world, 50.0 - CAR.length + CAR.rear_overhang - 1.2, 0.0, speed=speed)
    walk(world)
    assert world.yields[row] == (1 if waits else COMMITTED)


def test_pedestrian_waits_for_an_ego_that_comes_but_not_for_one_that_stands() -> None:
    for speed, is_waiting in ((10.0, True), (0.0, False)):
        world = world_of(road())
        ego(world, 5.0, 0.0, speed=speed)
        row = walker(world, OVER + np.array([[0.0, 8.0], [0.0, 0.0]]))
        for _ in range(150):
            step(world)
        assert (world.y[row] < -1.75) == is_waiting


def test_driver_stops_for_a_pedestrian_that_crosses_and_drives_on() -> None:
    world = world_of(road())
    row = car(world, "a", 10.0, speed=8.0)
    person = walker(world, OVER + np.array([[0.0, 8.0], [0.0, 0.0]]))
    least, is_hit = 99.0, False
    for _ in range(700):
        step(world)
        is_hit = is_hit or len(world.contacts) > 0
        if abs(world.y[person]) < 2.0:
            least = min(least, abs(world.x[row] - 50.0))
    assert not is_hit
    assert least > 3.0
    assert world.x[row] > 60.0
    assert world.y[person] > 3.0


def test_drivers_of_another_map_see_somebody_who_had_begun_to_cross_on_the_old_one() -> None:
    world = world_of(make(a=(line((0, 0), (100, 0)), ""), b=(line((0, 12), (100, 12)), "")))
    row = walker(world, np.array([[50.0, -5.0], [50.0, 18.0]]))
    while world.yields[row] != COMMITTED + 1:
        step(world)
    world.lay_roads(make(a=(line((0, 0), (100, 0)), "")))  # its second crossing is no more
    car(world, "a", 10.0, speed=8.0)
    while world.yields[row] >= COMMITTED:
        step(world)
    assert world.yields[row] == 1


def test_driver_does_not_brake_for_one_that_waits_at_the_kerb() -> None:
    world = lit(Lamp.RED)
    walker(world, OVER + np.array([[0.0, 9.0], [0.0, 0.0]]))
    row = car(world, "a", 5.0, speed=10.0)
    slowest = 10.0
    for _ in range(350):
        step(world)
        slowest = min(slowest, float(world.speed[row]))
    assert slowest > 9.9
    assert world.x[row] > 55.0


def test_driver_that_is_past_before_somebody_comes_does_not_brake_for_it() -> None:
    lanes = {f"l{i}": (line((0, 3.5 * i), (400, 3.5 * i)), "") for i in range(4)}
    world = world_of(make(**lanes))
    walker(world, np.array([[50.0, 9.0], [50.0, -6.0]]))  # on the road, five seconds from the lane of the car
    row = car(world, "l0", 30.0, speed=14.0)
    hardest = 0.0
    for _ in range(150):
        step(world)
        hardest = min(hardest, world.accel[row])
    assert world.x[row] > 70.0
    assert hardest > -0.5


def test_driver_that_can_stop_gently_waits_for_somebody_who_comes_later() -> None:
    lanes = {f"l{i}": (line((0, 3.5 * i), (400, 3.5 * i)), "") for i in range(4)}
    world = world_of(make(**lanes))
    walker(world, np.array([[50.0, 9.0], [50.0, -6.0]]))
    row = car(world, "l0", 12.0, speed=10.0)
    for _ in range(250):
        step(world)
        assert world.accel[row] > -4.5
    assert world.x[row] < 50.0 - 3.6


def test_way_of_those_who_cross_is_foreseen_to_the_other_kerb_and_not_along_their_heading() -> None:
    world = world_of(road())
    row = walker(world, np.array([[50.0, -1.7], [50.0, 12.0]]))
    for _ in range(10):
        step(world)
    assert world.yields[row] == COMMITTED
    world.yaw[row] = 0.0
    times, velocities = find_ways_over(world)
    there = world.x[row] + 1j * world.y[row] + times[row] * velocities[row]
    assert there.imag == pytest.approx(1.75, abs=0.5)
    assert 50.2 < there.real < 51.0  # to the right of the path


def test_way_over_a_slanting_crossing_leads_to_the_right_of_the_path_at_the_other_kerb() -> None:
    world = world_of(road())
    path = np.array([[48.0, -2.5], [62.0, 11.5]])  # north east
    row = walker(world, path)
    for _ in range(20):
        step(world)
    assert world.yields[row] == COMMITTED
    times, velocities = find_ways_over(world)
    there = world.x[row] + 1j * world.y[row] + times[row] * velocities[row]
    beside = (there - (48.0 - 2.5j)) * np.exp(-0.25j * np.pi)
    end = find_crossings(world.paths.of(int(world.uid[row])), world.roads, world.signals.plan, 0.9).end
    assert -0.9 <= beside.imag <= -0.3
    assert beside.real == pytest.approx(end[0], abs=0.02)


def test_people_walk_with_their_speed_and_each_at_its_own_distance_to_the_right_of_its_path() -> None:
    world = World()
    rows = [walker(world, np.array([[0.0, 50.0 * i], [60.0, 50.0 * i]])) for i in range(8)]
    for _ in range(500):
        step(world)
    beside = 50.0 * np.arange(8) - world.y[rows]
    assert world.x[rows] == pytest.approx(13.0, abs=0.3)
    assert world.speed[rows] == pytest.approx(1.3, abs=1e-3)
    assert 0.3 <= beside.min() < 0.45
    assert 0.75 < beside.max() <= 0.9


def test_acceleration_of_people_is_the_change_of_their_speed() -> None:
    world = world_of(road())
    row = walker(world)
    world.speed[row] = 0.0
    for _ in range(8):
        before = float(world.speed[row])
        for _ in range(5):
            step(world)
        assert world.accel[row] == pytest.approx((world.speed[row] - before) / (5 * DT), abs=1e-9)
    assert world.speed[row] > 1.0


@pytest.mark.parametrize(("room", "steps_back"), [(0.3, True), (0.7, True), (0.78, False)])
def test_somebody_at_the_kerb_steps_back_from_a_vehicle_that_comes_too_near(room: float, *, steps_back: bool) -> None:
    world = lit(Lamp.RED)
    row = walker(world, np.array([[50.0, -4.0], [50.0, 12.0]]))
    for _ in range(150):
        step(world)
    kerb = float(world.y[row])
    y = kerb + room + 0.5 * CAR.width  # at 0.3 m its side is at the chest
    path = np.array([[42.0, y], [70.0, y]])
    world.spawn(Kind.VEHICLE, CAR, name="bus", x=42.0, y=y, path=path, speed=3.0)
    least = kerb
    for _ in range(400):
        step(world)
        assert not len(world.contacts)
        least = min(least, float(world.y[row]))
    assert (least < kerb - 0.02) == steps_back
    assert world.y[row] == pytest.approx(kerb, abs=0.1)  # back again


def test_somebody_who_is_pushed_over_the_kerb_does_not_begin_to_cross_at_red() -> None:
    world = lit(Lamp.RED)
    row = walker(world, np.array([[50.0, -4.0], [50.0, 12.0]]))
    for _ in range(200):
        step(world)
    world.y[row] += 0.9
    world.leg_y[row] += 0.9
    for _ in range(200):
        step(world)
        assert world.yields[row] == 1
    assert world.y[row] < -1.5


def begins_to_cross(world: World) -> bool:
    """Return whether somebody at the kerb of the road begins to cross at its first decision."""
    row = walker(world, np.array([[50.0, -2.5], [50.0, 12.0]]))
    for _ in range(3):
        step(world)
    return int(world.yields[row]) == COMMITTED


@pytest.mark.parametrize(("room", "crosses"), [(-1.0, False), (1.0, True)])
def test_pedestrian_crosses_before_a_driver_that_can_stop_three_metres_away(room: float, *, crosses: bool) -> None:
    """It reacts for 1 s and brakes with 2 m/s^2; 8 m/s need 24 m for that."""
    world = world_of(road())
    nose = CAR.length - CAR.rear_overhang
    car(world, "a", 50.0 - nose - (24.0 + 3.0 + room), speed=8.0, desired_speed=8.0)
    assert begins_to_cross(world) == crosses


@pytest.mark.parametrize(("y", "crosses"), [(-5.5, True), (-3.5, False), (0.0, False), (3.0, False), (5.5, True)])
def test_pedestrian_waits_for_a_vehicle_that_passes_within_two_metres_of_the_crossing(
    y: float, *, crosses: bool
) -> None:
    world = world_of(road())
    ego(world, 30.0, y, speed=8.0)
    assert begins_to_cross(world) == crosses


@pytest.mark.parametrize(("spare", "crosses"), [(0.75, False), (1.25, True)])
def test_pedestrian_crosses_if_a_vehicle_comes_a_second_after_it_is_across(spare: float, *, crosses: bool) -> None:
    """The crossing is 4.1 m long, from kerb to kerb, and reaches half a metre to each side of the path."""
    world = world_of(road())
    nose = CAR.length - CAR.rear_overhang
    ego(world, 50.0 - 0.5 - nose - 8.0 * (4.1 / 1.3 + spare), 0.0, speed=8.0)
    assert begins_to_cross(world) == crosses


@pytest.mark.parametrize(("away", "crosses"), [(68.0, False), (73.0, True)])
def test_pedestrian_looks_for_vehicles_within_70_metres(away: float, *, crosses: bool) -> None:
    world = world_of(road())
    ego(world, 50.0 - away - CAR.centre, 0.0, speed=30.0)
    assert begins_to_cross(world) == crosses


@pytest.mark.parametrize(
    ("x", "y", "crosses"),
    [(50.0, -4.0, True), (50.0, 2.2, False), (50.0, 3.6, True), (44.0, 0.0, True), (57.0, 0.0, True)],
)
def test_pedestrian_waits_for_what_stands_on_the_crossing_and_not_beside_it(
    x: float, y: float, *, crosses: bool
) -> None:
    world = world_of(road())
    ego(world, x, y)
    assert begins_to_cross(world) == crosses


@pytest.mark.parametrize(("y", "crosses"), [(10.0, False), (-10.0, True)])
def test_pedestrian_waits_for_a_vehicle_that_comes_at_an_angle_to_the_road(y: float, *, crosses: bool) -> None:
    world = world_of(road())
    ego(world, 30.0, y, yaw=np.arctan2(-10.0, 20.0), speed=8.0)
    assert begins_to_cross(world) == crosses


@pytest.mark.parametrize(("turn", "crosses"), [(65.0, False), (-65.0, False), (75.0, True), (-75.0, True)])
def test_driver_that_is_near_may_turn_to_a_crossing_by_70_degrees(turn: float, *, crosses: bool) -> None:
    world = world_of(road())
    row = car(world, "a", 42.0, speed=3.0)
    world.yaw[row] = np.radians(turn)
    person = walker(world, np.array([[50.0, -2.5], [50.0, 12.0]]))
    world.frame = 2
    walk(world)
    assert (world.yields[person] == COMMITTED) == crosses


def test_somebody_who_has_begun_to_cross_goes_on_if_a_vehicle_comes() -> None:
    world = world_of(road())
    row = walker(world, np.array([[50.0, -2.9], [50.0, 12.0]]), 0.6)
    for _ in range(3):
        step(world)
    ego(world, 30.0, 0.0, speed=8.0)
    for _ in range(10):
        step(world)
        assert world.yields[row] == COMMITTED
    assert world.y[row] < -2.05, "it is still before the road"


def test_those_behind_push_half_as_much_as_those_ahead() -> None:
    velocities = []
    for together in ((1, 2), (1,), (2,)):
        world = World()
        for uid in together:
            path = np.array([[0.8 * uid, 0.0], [40.0, 0.0]])
            world.spawn(
                Kind.PEDESTRIAN, MAN, name="man", x=0.8 * uid, y=0.0, uid=uid, path=path, speed=1.3, yields=True
            )
        world.speed[:] = 0.0
        for _ in range(3):
            step(world)
        velocities += (world.speed * np.exp(1j * world.yaw)).tolist()
    back, front, back_alone, front_alone = velocities
    assert (back - back_alone).real < -0.1
    assert front - front_alone == pytest.approx(-0.5 * (back - back_alone), rel=1e-3)


def crowd() -> World:
    """Return two groups of people that walk through each other in a passage, one after the other."""
    world = World(3)
    for i in range(10):
        way = np.array([[-12.0 - i % 5, 0.1 * (i % 3)], [30.0, 0.1 * (i % 3)]]) * (1 if i < 5 else -1)
        walker(world, way, 1.0 + 0.05 * i)
    return world


def test_people_who_meet_pass_without_touching() -> None:
    world = crowd()
    least = 9.0
    for frame in range(900):
        step(world)
        if frame % 5 == 0:
            away = np.hypot(world.x[:, None] - world.x, world.y[:, None] - world.y) + 9.0 * np.eye(10)
            least = min(least, float(away.min()))
    assert least > 0.3
    assert world.x[:5].min() > 0.0 > world.x[5:].max()  # all are through


@pytest.mark.slow
def test_people_walk_around_a_car_that_stands_across_their_path() -> None:
    world = World()
    walkers = {}
    for i, offset in enumerate((-2.0, 0.0, 1.5, 3.5)):
        for j, yaw in enumerate(np.radians(np.arange(24.0, 360.0, 48.0)).tolist()):
            x, y = 40.0 * i, 40.0 * j
            # The path leads north through a place that lies so far before the rear axle of the car.
            place = x - offset * np.cos(yaw), y - offset * np.sin(yaw)
            world.spawn(Kind.VEHICLE, CAR, name="car", x=place[0], y=place[1], yaw=yaw)
            walkers[walker(world, np.array([[x, y - 8.0], [x, y + 7.0]]))] = y
    for _ in range(950):
        step(world)
        assert not len(world.contacts)
    assert [row for row, y in walkers.items() if world.y[row] < y + 5.0] == []


def test_the_same_bits_come_from_a_snapshot_and_beside_people_far_away() -> None:
    first, second, third = crowd(), crowd(), crowd()
    for i in range(40):
        walker(third, np.array([[1e4 + 0.7 * i, 0.0], [1e4, 50.0]]))
    for frame in range(200):
        if frame == 72:
            second.restore(first.snapshot())
        for world in (first, second, third):
            step(world)
    assert first.digest() == second.digest()
    alone, beside = first.block("x", "leg_turn"), third.block("x", "leg_turn")[:, :10]
    at = [i for i in range(len(alone)) if not np.array_equal(alone[i], beside[i])]
    assert not at


def test_crossings_are_where_the_path_is_on_a_lane_and_know_their_light() -> None:
    world = lit(Lamp.GREEN)
    row = walker(world, np.array([[50.0, -12.0], [50.0, 12.0], [60.0, 12.0], [60.0, -12.0]]), is_loop=True)
    found = find_crossings(world.paths.of(int(world.uid[row])), world.roads, world.signals.plan)
    assert found.start.tolist() == pytest.approx([9.95, 43.95], abs=0.3)
    assert found.end.tolist() == pytest.approx([14.05, 48.05], abs=0.3)
    assert found.light.tolist() == [0, -1]


def test_people_wait_where_those_beside_the_path_are_off_the_road_too() -> None:
    world = world_of(make(a=(line((0, 50), (100, -50)), "")))
    row = walker(world)
    segments = world.paths.of(int(world.uid[row]))
    on_path, beside = (find_crossings(segments, world.roads, world.signals.plan, side) for side in (0.0, 0.9))
    assert beside.start.tolist() == pytest.approx(on_path.start - 0.9, abs=0.3), "the road comes nearer on the right"
    assert beside.end.tolist() == on_path.end.tolist()


def test_long_path_has_all_its_crossings() -> None:
    roads = make(**{name: (line(*[(x, 0.0) for x in np.arange(0.0, 60.0, 0.5)]), "") for name in "abc"})
    path = np.stack([np.repeat(np.arange(1.0, 31.0, 0.05), 2), np.tile([-4.0, 4.0, 4.0, -4.0], 300)], axis=-1)
    segments = lay_segments(np.column_stack([path, np.zeros(len(path))]), is_loop=False, reach=0.5)
    assert len(find_crossings(segments, roads, SignalPlan(roads)).start) == 600


def test_neighbours_are_all_pairs_within_reach() -> None:
    rng = np.random.default_rng(0)
    x, y, a, b = rng.uniform(-9.0, 9.0, (4, 60))
    one, other = find_neighbours(x, y, a, b, 2.0)
    near = np.argwhere(np.square(x[:, None] - a) + np.square(y[:, None] - b) < 4.0)
    assert np.array_equal(np.column_stack([one, other]), near)


@pytest.mark.parametrize(("yields", "stops"), [(True, True), (False, False)])
def test_vehicle_on_a_path_that_yields_stops_for_what_stands_ahead(yields: bool, stops: bool) -> None:  # noqa: FBT001
    world = World()
    path = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 60.0]])
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="a", x=0.0, y=0.0, path=path, speed=8.0, yields=yields))
    ego(world, 60.0, 30.0)
    for _ in range(800):
        step(world)
    assert (world.y[row] < 27.0) == stops
    assert (len(world.contacts) > 0 or world.y[row] > 55.0) != stops


def test_vehicle_on_a_path_that_yields_is_no_pedestrian() -> None:
    world = World()
    walker(world)
    uid = world.spawn(Kind.VEHICLE, CAR, name="a", x=0.0, y=0.0, path=np.array([[0.0, 0.0], [60.0, 0.0]]), yields=True)
    row, columns = world.row(uid), ("speed", "yaw", "accel", "leg_start", "leg_end", "yields")
    world.desired_speed[row], world.frame = 8.0, 2
    before = [float(getattr(world, name)[row]) for name in columns]
    walk(world)
    assert [float(getattr(world, name)[row]) for name in columns] == before


def test_vehicle_on_a_path_drives_on_when_the_way_is_free_again() -> None:
    world = World()
    path = np.array([[0.0, 0.0], [60.0, 0.0]])
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="a", x=0.0, y=0.0, path=path, speed=8.0, yields=True))
    thing = world.spawn(Kind.OBSTACLE, MAN, name="box", x=25.0, y=0.0)
    for _ in range(300):
        step(world)
    assert world.speed[row] < 0.1
    world.remove(thing)
    for _ in range(450):
        step(world)
    assert world.x[row] == pytest.approx(60.0, abs=0.5)


def test_somebody_who_was_pushed_beyond_the_end_of_its_path_is_at_the_end() -> None:
    world = World()
    row = walker(world, np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]))
    world.x[row], world.y[row], world.leg_start[row], world.frame = 10.0, 11.0, 19.9, 2
    walk(world)
    assert (world.arc[row], world.speed[row]) == (20.0, 0.0)
