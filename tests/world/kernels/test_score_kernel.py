"""Loops in C judge egos to the last bit as arrays: on all maps, on and off the road, one world and many."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from rosbridge_sim.world.kernels import score_kernel
from rosbridge_sim.world.kernels.c_source import MORE_PAIRS, NEAR_EDGES
from rosbridge_sim.world.kernels.score_kernel import ScoreKernel, measures_alike
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.scoring import BACK_INSIDE
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from rosbridge_sim.worlds.worlds import Worlds
from tests.world.kernels.compiled_loops import library, make_score_kernel, needs_compiler, with_loops
from tests.world.road_factory import CAR, built_in, crossing, line, make

pytestmark = needs_compiler

MAPS = ("hills", "loop", "motorway", "parking", "roundabout", "town", "track")


def random_egos(name: str, num: int, seed: int) -> World:
    """A map with egos that drive along lanes, against them and off the road, and boxes that slide past them."""
    rng, road_map = np.random.default_rng(seed), built_in(name)
    world = World(seed, Dynamics.KINEMATIC, has_impacts=bool(seed % 2))
    world.lay_roads(road_map.roads, road_map.plan)
    lanes = rng.integers(0, len(world.roads), 2 * num)
    places, aside = (
        rng.uniform(0.0, 1.0, 2 * num) * world.roads.length[lanes],
        rng.choice([0.0, 0.0, 1.5, 9.0], 2 * num),
    )
    turn = rng.choice([0.0, 0.1, 3.0], 2 * num)
    stops = (world.roads.is_stop | road_map.plan.is_before_light).nonzero()[0]
    if len(stops):  # the first one comes over a stop line
        lanes[0] = rng.choice(stops)
        places[0], aside[0], turn[0] = world.roads.length[lanes[0]] - 6.0, 0.0, 0.0
    point, yaw = world.roads.at(lanes, places)
    point[:, 0], point[:, 1] = point[:, 0] - aside * np.sin(yaw), point[:, 1] + aside * np.cos(yaw)
    yaw = yaw + turn
    for i, (x, y, z) in enumerate(point.tolist()):
        kind, angle = (Kind.EGO if i < num else Kind.VEHICLE), float(yaw[i])
        row = world.row(world.spawn(kind, CAR, name="car", x=x, y=y, z=z, yaw=angle, gear=Gear.DRIVE))
        world.place(row, x=x, y=y, z=z, yaw=angle, speed=float(rng.uniform(0.0, 25.0)))
        if i < num:
            command(
                world, row, mode=Mode.SPEED, speed=float(rng.uniform(2.0, 25.0)), steer=float(rng.normal(0.0, 0.02))
            )
    world.start_scoring()
    return world


def state(world: World) -> list[bytes]:
    """All columns; those of scores are behind the others."""
    return [
        world.block("front_load", "lateral_accel_square_sum").tobytes(),
        world._ints.tobytes(),
        world._bools.tobytes(),
    ]


def check_both(one: World, other: World, frames: int) -> None:
    for _ in range(frames):
        with with_loops(are_there=False):
            step(one)
        with with_loops():
            step(other)
        assert state(one) == state(other), one.frame
    assert one.digest() == other.digest()


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("num", [1, 6])
def test_scores_are_the_same_on_each_map(name: str, num: int) -> None:
    one, other = (random_egos(name, num, seed=MAPS.index(name) + num) for _ in range(2))
    check_both(one, other, 60)
    egos = one.rows(Kind.EGO)
    assert one.score_frames[egos].min() == 60


@pytest.mark.parametrize("name", MAPS)
def test_scores_are_the_same_for_many_frames(name: str) -> None:
    one, other = (random_egos(name, 4, seed=20 + MAPS.index(name)) for _ in range(2))
    check_both(one, other, 2_000)


def test_all_that_counts_has_been_met() -> None:
    """Else the comparisons above would compare zeros."""
    worlds = [random_egos(name, 6, seed=MAPS.index(name) + 6) for name in ("motorway", "town")]
    with with_loops():
        for world in worlds:
            for _ in range(60):
                step(world)
    names = ("off_road_frames", "road_frames", "num_lane_invasions", "num_stop_lines", "max_lane_offset", "max_jerk")
    for name in names:
        assert any(getattr(world, name)[world.rows(Kind.EGO)].any() for world in worlds), name
    assert any(np.isfinite(world.min_time_to_collision[world.rows(Kind.EGO)]).any() for world in worlds)


def test_stop_line_is_passed_in_a_step_that_is_longer_than_it() -> None:
    """A restored state may have such speeds."""
    road_map, worlds = built_in("town"), []
    for _ in range(2):
        world = World(0, Dynamics.KINEMATIC)
        world.lay_roads(road_map.roads, road_map.plan)
        lane = int(road_map.plan.is_before_light.nonzero()[0][0])
        point, yaw = world.roads.at([lane], [world.roads.length[lane] - 8.0])
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, gear=Gear.DRIVE))
        x, y, z = point[0].tolist()
        world.place(row, x=x, y=y, z=z, yaw=float(yaw[0]), speed=10_000.0)
        world.start_scoring()
        worlds.append(world)
    check_both(worlds[0], worlds[1], 1)
    assert worlds[0].num_stop_lines[0] == 1


def test_many_worlds_are_judged_likewise() -> None:
    one, other = (Worlds("town", 3, traffic=5, seed=7, egos=2) for _ in range(2))
    for part in range(5):
        commands: dict[str, npt.ArrayLike] = {"steering": [[0.1], [0.0], [-0.05]], "speed": 8.0}
        if part == 3:
            for worlds in (one, other):
                worlds.reset([True, False, False])
                worlds.place(1, x=0.0, y=0.0, yaw=0.0, ego=1)
        with with_loops(are_there=False):
            one.step(commands, 7)
        with with_loops():
            other.step(commands, 7)
        for name, figures in one.scores().items():
            assert figures.tobytes() == other.scores()[name].tobytes(), name
        assert one.digests() == other.digests()


@pytest.mark.parametrize("name", ["hills", "motorway", "roundabout", "town"])
def test_egos_see_their_lanes_likewise(name: str) -> None:
    worlds = Worlds(name, 3, egos=2)
    roads, rng = worlds.map_of(0).road_map.roads, np.random.default_rng(0)
    for _ in range(10):
        for world in range(3):
            lane = int(rng.integers(len(roads)))
            point, yaw = roads.at([lane], [rng.uniform(0.0, roads.length[lane])])
            x, y, z = point[0] + [*rng.normal(0.0, 3.0, 2), 0.0]
            worlds.place(
                world, x=x, y=y, z=z, yaw=float(yaw[0] + rng.choice([0.0, 0.3, 3.0])), ego=int(rng.integers(2))
            )
        ahead = rng.uniform(-20.0, 200.0, int(rng.integers(5))).tolist()
        with with_loops(are_there=False):
            expected = worlds.lanes(ahead)
        with with_loops():
            found = worlds.lanes(ahead)
        assert list(found) == list(expected)
        for figure, values in expected.items():
            assert found[figure].tobytes() == values.tobytes(), figure


@pytest.mark.parametrize("egos", [1, 2])
@pytest.mark.parametrize("num_worlds", [1, 3])
@pytest.mark.parametrize("name", ["hills", "motorway"])
def test_egos_see_others_likewise(name: str, num_worlds: int, egos: int) -> None:
    worlds = Worlds(name, num_worlds, traffic=9, egos=egos)
    for num in (1, 3, 40):
        worlds.step({"steering": 0.02, "speed": 12.0}, 7)
        with with_loops(are_there=False):
            expected = worlds.others(num)
        with with_loops():
            found = worlds.others(num)
        assert found.tobytes() == expected.tobytes(), num
        assert expected[..., 0].any()


@pytest.mark.parametrize("num", [1, 3])
def test_arrays_choose_between_others_at_one_distance(num: int) -> None:
    worlds = Worlds("motorway")
    worlds.place(0, x=500.0, y=2.0, yaw=0.3)
    for x, y in ((530.0, 2.0), (500.0, 10.0), (500.0, -6.0), (496.0, 2.0)):
        worlds.spawn(0, "Traffic_Cone", x=x, y=y)
    with with_loops(are_there=False):
        expected = worlds.others(num)
    with with_loops():
        assert worlds.others(num).tobytes() == expected.tobytes()
    part = worlds._egos.parts[0]
    kernel = make_score_kernel()(part.columns)
    assert kernel.see_others(part.rows, num) is None


def test_others_that_were_seen_stay_as_they_were() -> None:
    worlds = Worlds("motorway", traffic=5)
    with with_loops():
        seen = worlds.others(3)
        before = seen.copy()
        worlds.step({"steering": 0.1, "speed": 20.0}, 20)
        assert worlds.others(3).tobytes() != before.tobytes()
    assert np.array_equal(seen, before)


def test_lanes_that_were_seen_stay_as_they_were() -> None:
    worlds = Worlds("motorway")
    with with_loops():
        seen = worlds.lanes((5.0,))
        before = {name: values.copy() for name, values in seen.items()}
        worlds.step({"steering": 0.1, "speed": 20.0}, 20)
        worlds.lanes((5.0,))
    assert all(np.array_equal(values, before[name]) for name, values in seen.items())


def test_cells_begin_anew_when_there_is_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(score_kernel, "MAX_SEGMENTS", 10)
    roads, worlds = crossing(), []
    for _ in range(2):
        world = World(0)
        world.lay_roads(roads)
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=-60.0, y=0.5, gear=Gear.DRIVE))
        world.place(row, x=-60.0, y=0.5, z=0.0, yaw=0.0, speed=20.0)
        command(world, row, mode=Mode.SPEED, speed=20.0, steer=0.01)
        world.start_scoring()
        worlds.append(world)
    used = []
    for _ in range(60):
        check_both(worlds[0], worlds[1], 1)
        kernel = worlds[1].derived(make_score_kernel())
        assert isinstance(kernel, ScoreKernel)
        used.append(kernel._cells.arrays["used"].item(1))
    assert max(used) <= 10
    assert min(np.diff(used)) < 0


def test_ego_far_from_the_map_is_judged_by_arrays() -> None:
    one, other = (random_egos("motorway", 2, seed=9) for _ in range(2))
    for world in (one, other):
        teleport(world, 0, x=9e6, y=0.0, z=0.0, yaw=0.0)
    check_both(one, other, 3)
    assert one.off_road_frames[0] == 3


def test_lanes_wider_than_cells_are_judged_by_arrays() -> None:
    roads = Roads(["wide"], [line((0, 0), (300, 0))], [[]], [40.0], [15.0], left=[-1], right=[-1])
    worlds = []
    for _ in range(2):
        world = World(0)
        world.lay_roads(roads)
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=10.0, y=15.0, yaw=0.3, gear=Gear.DRIVE))
        command(world, row, mode=Mode.SPEED, speed=10.0, steer=0.0)
        world.start_scoring()
        worlds.append(world)
    check_both(worlds[0], worlds[1], 60)
    assert worlds[0].max_lane_offset[0] > 10.0


@pytest.mark.parametrize("over", [0.0, 1e-15, -1e-15, -BACK_INSIDE, -BACK_INSIDE + 1e-15])
def test_box_next_to_the_edge_of_its_lane_is_measured_by_arrays(over: float) -> None:
    worlds = []
    for _ in range(2):
        world = World(0)
        world.lay_roads(make(a=(line((0, 0), (900, 0)), "")))
        world.spawn(Kind.EGO, CAR, name="ego", x=10.0, y=0.0, gear=Gear.DRIVE)
        world.start_scoring()
        world.is_over_left[0] = True
        worlds.append(world)
    edge = float(worlds[0].roads.border[0, 0] - worlds[0].half_width[0])
    for world in worlds:
        teleport(world, 0, x=10.0, y=edge + over, z=0.0, yaw=0.0)
    check_both(worlds[0], worlds[1], 2)
    kernel = worlds[1].derived(make_score_kernel())
    assert isinstance(kernel, ScoreKernel)
    assert kernel._do["judge_egos"](kernel._at) == NEAR_EDGES


def test_more_pairs_that_meet_than_there_is_room_for() -> None:
    worlds = []
    for _ in range(2):
        world = World(0)
        world.lay_roads(make(a=(line((0, 0), (900, 0)), "")))
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, gear=Gear.DRIVE))
        world.place(row, x=0.0, y=0.0, z=0.0, yaw=0.0, speed=20.0)
        command(world, row, mode=Mode.SPEED, speed=20.0, steer=0.0)
        for i in range(MORE_PAIRS + 10):
            world.spawn(Kind.OBSTACLE, CAR, name="box", x=40.0 + 0.1 * i, y=0.0)
        world.start_scoring()
        worlds.append(world)
    check_both(worlds[0], worlds[1], 40)
    assert worlds[1].min_time_to_collision[0] < 10.0


def test_distances_are_those_of_numpy_on_this_machine() -> None:
    assert measures_alike(library())
