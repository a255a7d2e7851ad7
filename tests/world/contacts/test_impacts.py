"""Impacts between the rows of a world, and what slides to rest after them."""

from __future__ import annotations

import math
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.contacts import collisions
from rosbridge_sim.world.contacts.impacts import MAX_PAIRS, SLIDING_FRICTION, SPIN_END, collide, slide
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import place_ghost, set_speed, teleport
from rosbridge_sim.world.state.world import DT, Body, Dynamics, Kind, Mode, World
from rosbridge_sim.world.step import step
from rosbridge_sim.world.vehicle.dynamics import drive
from tests.mutations import examples
from tests.world.road_factory import CAR, road
from tests.world.road_factory import car as lane_car

pytestmark = pytest.mark.usefixtures("loops")

BOTH = pytest.mark.parametrize("dynamics", list(Dynamics))


def world_of(dynamics: Dynamics = Dynamics.SINGLE_TRACK, *, has_impacts: bool = True) -> World:
    return World(0, dynamics, has_impacts=has_impacts)


def ego(world: World, x: float, y: float = 0.0, yaw: float = 0.0, speed: float = 0.0, body: Body = CAR) -> int:  # noqa: PLR0917 - a pose
    return world.row(world.spawn(Kind.EGO, body, name="ego", x=x, y=y, yaw=yaw, speed=speed))


def thing(world: World, x: float, y: float = 0.0, kind: Kind = Kind.OBSTACLE, speed: float = 0.0, **more: Any) -> int:  # noqa: ANN401 - as for `spawn`
    body = CAR if kind == Kind.VEHICLE else Body.box(0.5, 4.0, 1.5)
    return world.row(world.spawn(kind, body, name="thing", x=x, y=y, speed=speed, **more))


def drivers(*at: tuple[float, float], has_impacts: bool = True) -> World:
    """A world with a straight road eastwards, and a driver on it at each place with a speed."""
    world = world_of(has_impacts=has_impacts)
    world.lay_roads(road(length=1000.0))
    for x, speed in at:
        lane_car(world, "a", x, speed=speed)
    return world


def run(world: World, num_steps: int) -> None:
    for _ in range(num_steps):
        step(world)


@BOTH
@pytest.mark.parametrize("kmh", [5.0, 30.0, 100.0, 250.0])
def test_ego_stops_at_an_obstacle(dynamics: Dynamics, kmh: float) -> None:
    world = world_of(dynamics)
    row, post = ego(world, 0.0, speed=kmh / 3.6), thing(world, 5.0)
    touched = 0
    for _ in range(120):
        step(world)
        touched += len(world.contacts)
        assert world.x[row] + 3.58 < 4.751
    assert touched
    assert world.speed[row] <= 0.0
    assert world.x[post] == 5.0


@BOTH
def test_ego_leans_against_a_wall_without_going_through(dynamics: Dynamics) -> None:
    world = world_of(dynamics)
    row, _ = ego(world, 0.0), thing(world, 8.0)
    command(world, row, mode=Mode.PEDALS, steer=0.0, throttle=1.0)
    run(world, 140)
    assert world.x[row] + 3.58 < 7.76
    assert abs(world.speed[row]) < 0.2


@BOTH
def test_report_alone_changes_no_motion(dynamics: Dynamics) -> None:
    there, free = world_of(dynamics, has_impacts=False), world_of(dynamics, has_impacts=False)
    row, _ = ego(there, 0.0, speed=20.0), thing(there, 10.0)
    ego(free, 0.0, speed=20.0)
    run(there, 60)
    run(free, 60)
    assert there.x[row] == free.x[0]


@BOTH
def test_the_first_contact_is_the_same_with_and_without_impacts(dynamics: Dynamics) -> None:
    frames = []
    for has_impacts in (False, True):
        world = world_of(dynamics, has_impacts=has_impacts)
        ego(world, 0.0, speed=27.7)
        thing(world, 20.0)
        while not len(world.contacts):
            step(world)
        frames.append((world.frame, world.contacts.tolist()))
    assert frames[0] == frames[1]


def test_driver_that_is_hit_from_behind_slides_to_rest_and_stands() -> None:
    world = drivers((100.0, 5.0))
    hitter = ego(world, 80.0, y=world.y.item(0), speed=25.0)
    masses = np.array([world.bodies[hitter].mass, world.bodies[0].mass])
    before = 0.0
    while not len(world.contacts):
        before = float(world.speed[[hitter, 0]] @ masses)
        step(world)
    assert world.loose[0] == 1.0
    assert not world.has_lane[0]
    after = float(world.speed[[hitter, 0]] @ masses)
    assert after == pytest.approx(before, rel=0.01)  # both roll for a frame
    assert world.speed[0] > 12.0
    speed, start = world.speed.item(0), world.x.item(0)
    command(world, hitter, mode=Mode.PEDALS, steer=0.0, brake=1.0)
    run(world, 300)
    assert world.speed[0] == world.lateral_speed[0] == world.yaw_rate[0] == world.accel[0] == 0.0
    assert world.x[0] - start == pytest.approx(speed * speed / (2.0 * SLIDING_FRICTION * 9.80665), rel=0.02)


def test_driver_that_is_hit_from_the_side_is_thrown_aside_and_turned() -> None:
    world = drivers((100.0, 15.0))
    y = world.y.item(0)
    hitter = ego(world, 107.0, y=y - 14.0, yaw=math.pi / 2, speed=25.0)
    run(world, 200)
    assert world.y[0] - y > 3.0
    assert abs(world.yaw[0]) > 0.2
    assert world.speed[0] == world.lateral_speed[0] == world.yaw_rate[0] == 0.0
    assert world.speed[hitter] < 25.0


def test_standing_ego_that_is_hit_from_behind_moves() -> None:
    world = drivers((50.0, 20.0))
    row = ego(world, 62.0, y=world.y.item(0))
    run(world, 50)
    assert world.x[row] > 63.0


def test_wreck_that_stands_is_moved_by_the_next_impact() -> None:
    world = drivers((100.0, 0.0))
    ego(world, 80.0, y=world.y.item(0), speed=10.0)
    run(world, 160)
    at = world.x.item(0)
    teleport(world, 1, x=80.0, y=world.y.item(0), z=0.0, yaw=0.0, speed=20.0)
    run(world, 75)
    assert world.x[0] > at + 1.0


def test_driver_sees_a_wreck_and_stops_behind_it() -> None:
    world = drivers((200.0, 0.0), (120.0, 12.0))
    ego(world, 190.0, y=world.y.item(0), speed=10.0)
    run(world, 550)
    assert world.loose[0]
    assert world.has_lane[1]
    assert not len(world.contacts)
    assert world.speed[1] < 0.1


def test_wreck_drives_again_when_a_speed_is_set() -> None:
    world = drivers((100.0, 0.0))
    ego(world, 85.0, y=world.y.item(0), speed=10.0)
    run(world, 160)
    at = world.x.item(0)
    set_speed(world, 0, 5.0)
    run(world, 50)
    assert world.loose[0] == 0.0
    assert world.x[0] == pytest.approx(at + 5.0, abs=0.01)


def energy_of(world: World, row: int) -> float:
    """Twice the energy of motion of an ego, for each kilogram."""
    to_rear = CAR.front_load * CAR.wheelbase
    across = world.lateral_speed[row] + to_rear * world.yaw_rate[row]
    spin = to_rear * (CAR.wheelbase - to_rear) * world.yaw_rate[row] ** 2
    return float(world.speed[row] ** 2 + across**2 + spin)


@pytest.mark.parametrize("rate", [3.5, 8.0, 20.0, 300.0])
def test_ego_that_spins_loses_energy_and_is_caught(rate: float) -> None:
    world = world_of()
    row = ego(world, 0.0, speed=30.0)
    world.yaw_rate[row], world.loose[row] = rate, 1.0
    energies = [energy_of(world, row)]
    while world.loose[row]:
        step(world)
        energies.append(energy_of(world, row))
    assert (np.diff(energies) <= 1e-9 * energies[0]).all()
    assert abs(world.yaw_rate[row]) < SPIN_END
    command(world, row, mode=Mode.PEDALS, steer=0.0, brake=1.0)
    run(world, 250)
    assert world.speed[row] == 0.0


def test_hard_impact_on_a_corner_makes_the_ego_spin() -> None:
    world = world_of()
    row, _ = ego(world, 0.0, speed=40.0), thing(world, 8.0, y=2.6)
    was_loose = False
    for _ in range(300):
        step(world)
        was_loose = was_loose or bool(world.loose[row])
    assert was_loose
    assert not world.loose[row]


def test_spinning_ego_that_is_placed_elsewhere_obeys_at_once() -> None:
    world = world_of()
    row = ego(world, 0.0, speed=30.0)
    world.yaw_rate[row], world.loose[row] = 8.0, 1.0
    run(world, 3)
    teleport(world, row, x=0.0, y=0.0, z=0.0, yaw=0.0, speed=5.0)
    command(world, row, mode=Mode.SPEED, steer=0.0, speed=5.0)
    run(world, 50)
    assert world.x[row] == pytest.approx(5.0, abs=0.1)
    assert world.y[row] == 0.0


# Who is moved, and who is passed through


@BOTH
@pytest.mark.parametrize("kind", [Kind.PEDESTRIAN, Kind.VEHICLE])
def test_pedestrians_and_ghosts_are_told_and_passed_through(dynamics: Dynamics, kind: Kind) -> None:
    world = world_of(dynamics)
    free = world_of(dynamics)
    row, other = ego(world, 0.0, speed=15.0), thing(world, 15.0, kind=kind)
    ego(free, 0.0, speed=15.0)
    if kind == Kind.VEHICLE:
        place_ghost(world, other, x=15.0, y=0.0, z=0.0, yaw=0.0)
    touched = 0
    for _ in range(100):
        step(world)
        step(free)
        touched += len(world.contacts)
    assert touched
    assert world.x[row] == free.x[row]
    assert not len(world.passing)


def test_vehicle_on_a_path_pushes_and_is_not_moved() -> None:
    world = world_of()
    row = ego(world, 0.0)
    path = np.array([[-30.0, 0.0], [300.0, 0.0]])
    body = world.row(world.spawn(Kind.VEHICLE, CAR, name="van", x=-30.0, y=0.0, speed=10.0, path=path))
    run(world, 200)
    assert world.x[body] == pytest.approx(10.0, abs=1e-6)
    assert world.x[row] > world.x[body] + 4.4
    assert world.speed[row] > 5.0


@BOTH
def test_overlap_from_the_start_gives_no_kick_until_it_has_parted(dynamics: Dynamics) -> None:
    world = world_of(dynamics)
    row, _ = ego(world, 0.0), thing(world, 1.0)
    run(world, 20)
    assert (world.x[row], world.y[row], world.yaw[row], world.speed[row]) == (0.0, 0.0, 0.0, 0.0)
    assert world.passing.tolist() == world.contacts.tolist() != []
    command(world, row, mode=Mode.SPEED, steer=0.0, speed=5.0)
    run(world, 120)
    assert world.x[row] > 5.0
    assert not len(world.passing)
    teleport(world, row, x=-8.0, y=0.0, z=0.0, yaw=0.0, speed=5.0)
    run(world, 100)
    assert world.x[row] < 0.0  # now it is stopped


def test_teleport_into_a_touched_neighbour_gives_no_kick() -> None:
    world = world_of()
    row, _ = ego(world, 0.0), thing(world, 8.0)
    command(world, row, mode=Mode.PEDALS, steer=0.0, throttle=1.0)
    run(world, 120)
    teleport(world, row, x=7.0, y=0.0, z=0.0, yaw=0.0)
    command(world, row, mode=Mode.PEDALS, steer=0.0, brake=1.0)
    run(world, 20)
    assert (world.x[row], world.y[row]) == (7.0, 0.0)


def test_ghost_that_drives_on_within_another_gives_no_kick() -> None:
    world = world_of()
    row, _ = ego(world, 0.0), thing(world, 8.0)
    place_ghost(world, row, x=7.0, y=0.0, z=0.0, yaw=0.0, speed=5.0)
    run(world, 5)
    command(world, row, mode=Mode.SPEED, steer=0.0, speed=5.0)
    run(world, 30)
    assert world.x[row] > 7.5


def test_nothing_is_hit_below_a_bridge() -> None:
    world = world_of()
    row, _ = ego(world, 0.0, speed=20.0), thing(world, 10.0, z=5.0)
    run(world, 60)
    assert world.x[row] > 15.0


# Repeatability


def crash(order: tuple[int, ...], dynamics: Dynamics = Dynamics.SINGLE_TRACK) -> World:
    """Four cars that meet in one place, spawned in a given order with the same ids."""
    world = world_of(dynamics)
    for i in order:
        yaw = 0.5 * math.pi * i + 0.1
        x, y = -12.0 * math.cos(yaw) + 0.3 * i, -12.0 * math.sin(yaw)
        world.spawn(Kind.EGO, CAR, name="car", x=x, y=y, yaw=yaw, speed=18.0 + i, uid=i)
    return world


@BOTH
def test_rows_and_order_of_spawning_change_no_bit(dynamics: Dynamics) -> None:
    seen = set()
    for order in list(permutations(range(4)))[::11]:
        world = crash(order, dynamics)
        run(world, 60)
        seen.add(tuple(
            figure for i in range(4) for figure in world.block("x", "speed")[:, world.row(i)].tolist()
        ))  # fmt: skip
    assert len(seen) == 1


def test_crash_goes_on_from_a_snapshot_with_the_same_bits() -> None:
    world = crash((0, 1, 2, 3))
    run(world, 30)
    ego(world, 0.0, 0.5)  # placed within the others
    saved = world.snapshot()
    run(world, 3)
    later = world.snapshot()
    run(world, 20)
    for snapshot, num_steps in ((saved, 23), (later, 20)):
        other = World(5)
        other.restore(from_plain(to_plain(snapshot), snapshot.roads, world.signals.plan))
        assert other.digest() != world.digest()
        run(other, num_steps)
        assert other.digest() == world.digest()


def test_digest_tells_which_pairs_pass_through_each_other() -> None:
    first, second = world_of(), world_of()
    for world in (first, second):
        ego(world, 0.0)
        thing(world, 1.0)
        step(world)
    second.passing = second.passing[:0]
    assert first.digest() != second.digest()


@examples(8)
@given(
    st.lists(
        st.tuples(st.floats(-12, 12), st.floats(-12, 12), st.floats(-math.pi, math.pi), st.floats(0, 35)),
        min_size=2,
        max_size=6,
    )
)
def test_impacts_in_a_heap_of_egos_never_add_energy(cars: list[tuple[float, float, float, float]]) -> None:
    world = world_of()
    for x, y, yaw, speed in cars:
        ego(world, x, y, yaw, speed)

    def energy() -> float:
        length = CAR.wheelbase
        to_rear = CAR.front_load * length
        across = world.lateral_speed + to_rear * world.yaw_rate
        spin = to_rear * (length - to_rear) * np.square(world.yaw_rate)
        return float((np.square(world.speed) + np.square(across) + spin).sum())

    for _ in range(40):
        before = collisions.remember(world)
        slide(world, DT)
        drive(world, DT)
        collisions.find(world, before)
        most = energy()
        collide(world, DT)
        assert energy() <= most * (1.0 + 1e-9) + 1e-9


@pytest.mark.slow
def test_huge_crash_is_bounded() -> None:
    world = world_of()
    for i in range(2 * MAX_PAIRS):
        ego(world, 6.0 * (i % 8) + (0.0 if i % 2 else 0.2), 2.2 * (i // 8), 0.3, speed=float(i % 7) * 4.0)
    run(world, 10)
    assert np.isfinite(world.block("x", "speed")).all()


def test_removing_an_entity_within_a_crash_is_no_error() -> None:
    world = crash((0, 1, 2, 3))
    run(world, 30)
    ego(world, 0.0, 0.5)
    step(world)
    for uid in range(4):
        world.remove(uid)
        step(world)
    assert not len(world.passing)
