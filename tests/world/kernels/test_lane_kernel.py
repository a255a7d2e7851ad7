"""Loops in C give the bits of arrays: on all maps, for any number of rows, one world and many, with egos and boxes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.followers.lane_following import LaneFollowers
from rosbridge_sim.world.followers.self_driving import change_lane, start_self_driving
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.kernels.lane_kernel import LaneKernel
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.turn_shares import TurnShares
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from rosbridge_sim.worlds.worlds import Worlds
from tests.world.kernels.compiled_loops import needs_compiler, with_loops
from tests.world.lane_drives import BUS
from tests.world.road_factory import CAR, arc, built_in, car, crossing, line, make, ring, road

pytestmark = needs_compiler

MAPS = ("hills", "loop", "motorway", "parking", "roundabout", "town", "track")


def random_world(
    name: str, num: int, seed: int = 0, *, shares: TurnShares | None = None, has_egos: bool = True
) -> World:
    """A map with an ego that moves and one that drives itself, a box on a lane, cars and buses that wander."""
    rng = np.random.default_rng(seed)
    road_map = built_in(name)
    world = World(seed, Dynamics.KINEMATIC, has_impacts=bool(seed % 2), turn_shares=shares)
    world.lay_roads(road_map.roads, road_map.plan)
    roads = world.roads
    lanes = rng.integers(0, len(roads), num + 3)
    places = rng.uniform(0.0, 1.0, num + 3) * roads.length[lanes]
    point, yaw = roads.at(lanes, places)
    for i in range(2 * has_egos):
        x, y, z = point[i]
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=x, y=y, z=z, yaw=yaw[i], gear=Gear.DRIVE))
        command(world, row, mode=Mode.SPEED, speed=6.0, steer=0.02)
        if i:
            start_self_driving(world, row, desired_speed=12.0)
    x, y, z = point[2]
    world.spawn(Kind.OBSTACLE, CAR, name="box", x=x, y=y, z=z, yaw=yaw[2])
    starts = []
    for lane, s in zip(lanes[3:].tolist(), places[3:].tolist(), strict=True):
        body = BUS if rng.random() < 0.2 else CAR
        speed = float(rng.uniform(0.0, 12.0))
        row = world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=speed))
        starts.append(
            LaneStart(
                row,
                lane,
                s,
                desired_speed=float(rng.choice([np.inf, 4.0])),
                changes_lanes=bool(rng.random() < 0.9),
                wander=float(rng.choice([0.0, 0.15])),
                lateral=float(rng.choice([0.0, 0.0, 0.3])),
            )
        )
    keep_lanes(world, starts)
    return world


def bits(world: World) -> list[bytes]:
    return [world.block("front_load", "wander_y_rate").tobytes(), world.int_block("uid", "came_from").tobytes()]


def check_both(one: World, other: World, frames: int) -> None:
    """Two equal worlds stay equal, one with arrays and one with loops."""
    for _ in range(frames):
        with with_loops(are_there=False):
            step(one)
        with with_loops():
            step(other)
        assert bits(one) == bits(other), one.frame
    assert one.digest() == other.digest()


@pytest.mark.parametrize("name", MAPS)
def test_loops_give_the_bits_of_arrays_on_each_map(name: str) -> None:
    one, other = (random_world(name, 25, seed=MAPS.index(name)) for _ in range(2))
    check_both(one, other, 40)


@pytest.mark.parametrize("name", MAPS)
def test_loops_give_the_bits_of_arrays_for_ten_thousand_frames(name: str) -> None:
    """Without egos and impacts, which cost more than drivers do; other tests have them."""
    one, other = (random_world(name, 14, seed=10 + 2 * MAPS.index(name), has_egos=False) for _ in range(2))
    check_both(one, other, 10_000)


@pytest.mark.parametrize("num", [1, 7, 100])
def test_loops_give_the_bits_of_arrays_for_any_number_of_rows(num: int) -> None:
    one, other = (random_world("motorway", num, seed=num, shares=TurnShares(1.0, 2.0, 1.0)) for _ in range(2))
    check_both(one, other, 50)


def short_lanes() -> Roads:
    """A crossing of lanes that are shorter than a car's nose: drivers hold lanes that their axles have not reached."""
    return make(
        w=(line((-80, 0), (-14, 0)), "w1"),
        w1=(line((-14, 0), (-12, 0)), "w2"),
        w2=(line((-12, 0), (-4, 0)), "we"),
        we=(line((-4, 0), (-1, 0)), "wf"),
        wf=(line((-1, 0), (2, 0)), "e"),
        e=(line((2, 0), (100, 0)), "w"),
        s=(line((0, -80), (0, -6)), "sn"),
        sn=(line((0, -6), (0, -1)), "sm"),
        sm=(line((0, -1), (0, 3)), "n"),
        n=(line((0, 3), (0, 100)), "s"),
    )


def tight_road() -> Roads:
    """Both directions of a road with a tight bend: cars pass each other there, buses do not."""

    def way(radius: float) -> FloatArray:
        return np.concatenate([line((-40, radius)), arc(0, 0, radius, 90, -90), line((radius, -40))])

    return make(a=(way(9.0), "b"), b=(way(12.5)[::-1], "a"))


@pytest.mark.parametrize("roads_of", [crossing, ring, road, short_lanes, tight_road])
@pytest.mark.parametrize("seed", range(2))
def test_drivers_do_the_same_at_intersections_and_ends(seed: int, roads_of: Callable[[], Roads]) -> None:
    roads, worlds = roads_of(), []
    for _ in range(2):
        world, rng = World(seed), np.random.default_rng(seed)
        world.lay_roads(roads)
        for _ in range(12):
            name, body = str(rng.choice(roads.ids)), BUS if rng.random() < 0.3 else CAR
            car(world, name, float(rng.uniform(0.0, roads.length[roads.row(name)])), speed=5.0, body=body)
        worlds.append(world)
    check_both(worlds[0], worlds[1], 100)


@pytest.mark.parametrize("roads_of", [crossing, short_lanes, tight_road])
@pytest.mark.parametrize("seeds", [range(5), range(5, 15)])
def test_decisions_are_the_same_from_any_claims_and_holds(seeds: range, roads_of: Callable[[], Roads]) -> None:
    roads = roads_of()
    for seed in seeds:
        worlds = []
        for _ in range(2):
            world, rng = World(seed), np.random.default_rng(seed)
            world.lay_roads(roads)
            for _ in range(14):
                name, body = str(rng.choice(roads.ids)), BUS if rng.random() < 0.2 * (seed % 3) else CAR
                place, speed = float(rng.uniform(0.0, roads.length[roads.row(name)])), float(rng.uniform(-4.0, 8.0))
                car(world, name, place, speed=max(speed, 0.0), body=body)
            lanes = world.int_block("lane", "ahead_5")
            for row in range(world.n):
                ahead = [-1, *lanes[lanes[:, row] >= 0, row][:4].tolist()]
                world.claim[row], world.held[row] = rng.choice(ahead, 2)
                world.exit_lane[row] = rng.choice(ahead)
            worlds.append(world)
        check_both(worlds[0], worlds[1], 6)


@pytest.mark.parametrize("name", ["motorway", "town"])
def test_few_drivers_look_far_behind_likewise(name: str) -> None:
    for seed in range(3):
        one, other = (random_world(name, 8, seed) for _ in range(2))
        check_both(one, other, 11)


def on_routes(wander: float) -> World:
    """Drivers on a motorway that must change lanes, or want to."""
    road_map = built_in("motorway")
    world, rng = World(3), np.random.default_rng(3)
    world.lay_roads(road_map.roads, road_map.plan)
    roads = world.roads
    for _ in range(30):
        lane = int(rng.integers(0, len(roads)))
        route = [lane]
        while len(route) < 4 and len(roads.successors(route[-1])):
            route.append(int(rng.choice(roads.successors(route[-1]))))
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=float(rng.uniform(0, 25))))
        s = float(rng.uniform(0.0, roads.length[lane]))
        keep_lanes(world, [LaneStart(row, lane, s, route=tuple(route), wander=wander)])
    return world


def test_routes_and_changes_of_lanes_are_the_same() -> None:
    one, other = on_routes(0.15), on_routes(0.15)
    check_both(one, other, 120)
    assert one.change.any() or one.came_from.any()  # else nobody has changed lanes, or wanted to


def test_arrays_go_on_with_the_changes_of_lanes_that_loops_have_begun() -> None:
    one, other = on_routes(0.0), on_routes(0.0)
    with with_loops():
        while not other.leaving.any():
            step(other)
    with with_loops(are_there=False):
        while one.frame < other.frame:
            step(one)
        for world in (one, other):
            for _ in range(20):
                step(world)
    assert bits(one) == bits(other)


def test_self_driving_ego_changes_lanes_likewise() -> None:
    one, other = (random_world("motorway", 20, seed=2) for _ in range(2))
    for world in (one, other):
        egos = world.rows(Kind.EGO)
        own = [row for row in egos.tolist() if world.has_lane[row]]
        assert own
        for side in (0, 1):
            change_lane(world, own[0], side)
    check_both(one, other, 100)


def test_loops_are_taken_over_and_given_back_between_two_frames() -> None:
    one, other = (random_world("town", 30, seed=4) for _ in range(2))
    for frame in range(60):
        with with_loops(are_there=False):
            step(one)
        with with_loops(are_there=frame % 37 > 15):  # at frames of decision and between them
            step(other)
        assert bits(one) == bits(other), frame


def test_world_goes_on_from_a_snapshot_and_after_entities_come_and_go() -> None:
    one, other = (random_world("town", 20, seed=5) for _ in range(2))
    check_both(one, other, 25)
    saved = one.snapshot()
    check_both(one, other, 10)
    for world in (one, other):
        world.restore(saved)
        world.remove(int(world.uid[5]))
        car(world, world.roads.ids[0], 1.0, speed=3.0)
        teleport(world, 0, x=0.0, y=0.0, z=0.0, yaw=0.0)
    check_both(one, other, 35)


def test_many_worlds_are_driven_by_loops_likewise() -> None:
    one, other = (Worlds("town", 3, traffic=12, seed=7) for _ in range(2))
    commands: dict[str, float | FloatArray] = {"steering": 0.0, "speed": 8.0}
    for part in range(5):
        if part == 3:  # from now on the frames of the worlds differ
            for worlds in (one, other):
                worlds.reset([True, False, False])
        with with_loops(are_there=False):
            one.step(commands, 7)
        with with_loops():
            other.step(commands, 7)
        assert one.digests() == other.digests()


def test_zero_with_a_sign_that_is_left_of_a_shift_is_plain_zero_afterwards() -> None:
    """A restored state may have it."""
    one, other = (random_world("motorway", 10, seed=1, has_egos=False) for _ in range(2))
    for world in (one, other):
        rows = world.has_lane.nonzero()[0]
        world.lateral_left[rows], world.lateral_to[rows] = -0.0, 0.2
    check_both(one, other, 6)


def test_place_that_is_no_number_is_the_begin_of_its_lane() -> None:
    world = random_world("motorway", 40, seed=3)
    world.arc[world.has_lane.nonzero()[0][::3]] = np.nan
    with with_loops():
        step(world)
    kernel = world.derived(LaneFollowers).kernel
    assert isinstance(kernel, LaneKernel)
    lanes = kernel._queue().lane[:-1]
    assert np.all(np.diff(lanes) >= 0)  # else one is in the queue where its lane is not
