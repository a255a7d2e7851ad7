from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.followers.path_following import _Moving, follow_paths
from rosbridge_sim.world.geometry.planar import FloatArray, arc_lengths, nearest_on_polyline
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from tests.mutations import examples
from tests.world.polylines import point_at

CAR = Body()
MAN = Body.box(0.5, 0.6, 1.75)
ANGLES = np.linspace(0.0, 2 * math.pi, 100, endpoint=False)
CIRCLE = np.column_stack([50.0 * np.cos(ANGLES), 50.0 * np.sin(ANGLES)])
BENT = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0], [30.0, 5.0]])


def npc(world: World, **figures: Any) -> int:  # noqa: ANN401 - whatever spawn takes
    usual: dict[str, Any] = {"name": "npc", "x": 0.0, "y": 0.0}
    return world.row(world.spawn(Kind.VEHICLE, CAR, **(usual | figures)))


def closed(path: FloatArray) -> FloatArray:
    return np.concatenate([path, path[:1]])


def test_constant_motion_is_a_straight_line_at_constant_speed() -> None:
    world = World()
    row = npc(world, x=3.0, y=4.0, z=5.0, yaw=0.7, speed=12.0)
    for _ in range(500):
        step(world)
    assert (world.x[row], world.y[row]) == pytest.approx((3.0 + 120.0 * math.cos(0.7), 4.0 + 120.0 * math.sin(0.7)))
    assert (world.z[row], world.yaw[row], world.speed[row], world.accel[row]) == (5.0, 0.7, 12.0, 0.0)


def test_backward_motion_has_the_opposite_heading() -> None:
    world = World()
    row = npc(world, speed=-2.0)
    for _ in range(50):
        step(world)
    assert (world.x[row], world.yaw[row]) == (pytest.approx(-2.0), 0.0)


def test_standing_entity_stays() -> None:
    world = World()
    world.spawn(Kind.OBSTACLE, Body.box(1.0, 1.0, 1.0), name="box", x=1.5, y=2.5, yaw=0.3)
    before = world.snapshot()
    for _ in range(10):
        step(world)
    assert np.array_equal(world.snapshot().floats, before.floats)


def test_path_is_followed_by_arc_length() -> None:
    world = World()
    row = npc(world, path=BENT, speed=5.0)
    arcs = arc_lengths(BENT)
    for i in range(1, 340):
        step(world)
        assert (world.x[row], world.y[row]) == pytest.approx(tuple(point_at(BENT, arcs, i * 0.1)[0]), abs=1e-9)
        assert world.arc[row] == pytest.approx(i * 0.1)


def test_vehicle_turns_evenly_over_its_wheelbase_before_a_corner() -> None:
    world = World()
    row = npc(world, path=BENT, speed=5.0, yaw=2.0)
    for _ in range(300):
        step(world)
        to_corner = 10.0 - world.arc[row], 15.0 - world.arc[row]
        shares = [min(max(1.0 - distance / CAR.wheelbase, 0.0), 1.0) for distance in to_corner]
        assert world.yaw[row] == pytest.approx(math.pi / 2 * (shares[0] - shares[1]))


def test_pedestrian_turns_within_a_step_of_the_corner() -> None:
    world = World()
    row = world.row(world.spawn(Kind.PEDESTRIAN, MAN, name="man", x=0.0, y=0.0, path=BENT, speed=1.0))
    for _ in range(460):
        step(world)
    assert world.yaw[row] == 0.0
    for _ in range(45):
        step(world)
    assert world.yaw[row] == math.pi / 2


@pytest.mark.parametrize("path", [BENT, CIRCLE, -CIRCLE[::7], BENT * 0.1])
@pytest.mark.parametrize("is_loop", [True, False])
def test_headings_are_continuous(path: FloatArray, is_loop: bool) -> None:  # noqa: FBT001 - a parameter of a test
    """A corner of angle a is turned over the wheelbase: the yaw rate is at most speed * (angles within it) / it."""
    world = World()
    row = npc(world, x=path[0, 0], y=path[0, 1], path=path, is_loop=is_loop, speed=8.0)
    line = np.concatenate([path, path[:2], path[2:]]) if is_loop else path
    corners = arc_lengths(line)[1:-1]
    legs = np.diff(line, axis=0)
    turns = np.abs(np.angle(np.exp(1j * np.diff(np.arctan2(legs[:, 1], legs[:, 0])))))
    within = [turns[(corners >= s) & (corners <= s + CAR.wheelbase)].sum() for s in corners]
    bound = 8.0 * max(within) / CAR.wheelbase * DT
    before = float(world.yaw[row])
    for _ in range(300):
        step(world)
        assert abs(math.remainder(world.yaw[row] - before, 2.0 * math.pi)) <= bound + 1e-9
        before = float(world.yaw[row])


def test_entity_stops_exactly_at_the_end_of_an_open_path() -> None:
    world = World()
    other = npc(world, speed=1.0, y=-9.0)
    row = npc(world, path=BENT, speed=7.77)
    for _ in range(400):
        step(world)
    assert (world.x[row], world.y[row], world.speed[row]) == (30.0, 5.0, 0.0)
    assert world.arc[row] == world.path_length[row] == 35.0
    assert world.x[other] == pytest.approx(8.0)
    assert world.derived(_Moving).rows.tolist() == [other]  # who stands is not looked at


def test_closed_path_is_followed_again() -> None:
    world = World()
    row = npc(world, x=50.0, path=CIRCLE, is_loop=True, speed=60.0)
    length = float(world.path_length[row])
    assert length == pytest.approx(2 * math.pi * 50.0, rel=1e-3)
    for _ in range(1000):  # nearly four rounds
        step(world)
        assert 0.0 <= world.arc[row] < length
    assert world.arc[row] == pytest.approx(1200.0 % length, abs=1e-6)


def test_tiny_loop_can_be_passed_many_times_in_a_step() -> None:
    world = World()
    triangle = np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.4]])  # 1.2 m
    row = npc(world, path=triangle, is_loop=True, speed=1000.0)
    for i in range(1, 100):
        step(world)
        assert math.remainder(world.arc[row] - 20.0 * i, 1.2) == pytest.approx(0.0, abs=1e-9)
        assert abs(nearest_on_polyline(closed(triangle), world.x[row], world.y[row]).lateral[0]) < 1e-9


def test_path_in_space_is_followed_in_space() -> None:
    world = World()
    ramp = np.array([[0.0, 0.0, 1.0], [40.0, 0.0, 31.0]])
    row = npc(world, path=ramp, speed=5.0)
    for _ in range(100):
        step(world)
    assert (world.x[row], world.y[row], world.z[row]) == pytest.approx((8.0, 0.0, 7.0))


def test_entities_together_move_like_each_alone() -> None:
    sorts: list[dict[str, Any]] = [
        {"speed": 3.0, "yaw": 1.0},
        {"speed": 6.0, "path": BENT},
        {"speed": 0.0},
        {"speed": 25.0, "path": CIRCLE, "is_loop": True, "x": 50.0},
        {"speed": 1.3, "path": BENT[::-1], "is_loop": True},
    ]
    together = World()
    rows = [npc(together, **sort) for sort in sorts]
    alone = [World() for _ in sorts]
    for world, sort in zip(alone, sorts, strict=True):
        npc(world, **sort)
    for _ in range(300):
        for world in (together, *alone):
            step(world)
    for row, world in zip(rows, alone, strict=True):
        for name in ("x", "y", "z", "yaw", "speed", "arc"):
            assert getattr(together, name)[row] == getattr(world, name)[0], name


def test_two_half_steps_equal_a_whole_one() -> None:
    whole, halves = World(), World()
    for world in (whole, halves):
        npc(world, path=BENT, speed=5.0)
        npc(world, speed=2.0, yaw=1.0)
    for _ in range(200):
        follow_paths(whole, DT)
        follow_paths(halves, DT / 2)
        follow_paths(halves, DT / 2)
        assert np.allclose(whole.x, halves.x, rtol=0.0, atol=1e-9)
        assert np.allclose(whole.y, halves.y, rtol=0.0, atol=1e-9)


POINTS = st.lists(st.tuples(*[st.floats(-100.0, 100.0, width=32)] * 2), min_size=2, max_size=8, unique=True)


@examples(15)
@given(st.lists(st.tuples(POINTS, st.booleans(), st.floats(0.0, 300.0)), min_size=1, max_size=4))
def test_entity_never_leaves_its_path(walkers: list[tuple[list[tuple[float, float]], bool, float]]) -> None:
    world = World()
    lines = []
    for points, is_loop, speed in walkers:
        path = np.array(points)
        if arc_lengths(path)[-1] < 1e-3:
            continue
        x, y = points[0]
        world.spawn(Kind.PEDESTRIAN, MAN, name="man", x=x, y=y, path=path, is_loop=is_loop, speed=speed)
        lines.append(closed(path) if is_loop else path)
    for _ in range(60):
        step(world)
        for row, line in enumerate(lines):
            assert abs(nearest_on_polyline(line, world.x[row], world.y[row]).lateral[0]) < 1e-6
            assert -math.pi < world.yaw[row] <= math.pi


def test_entity_that_takes_a_path_later_follows_it_as_one_that_had_it_from_the_start() -> None:
    worlds = World(), World()
    for i, world in enumerate(worlds):
        npc(world, path=CIRCLE, is_loop=True, speed=3.0)
        row = npc(world, y=0.1, speed=3.0, path=BENT if i else None)
        if not i:
            world.follow_path(row, BENT, is_loop=False)
    for _ in range(300):
        for world in worlds:
            step(world)
    assert worlds[0].digest() == worlds[1].digest()
    assert worlds[0].x[1] > 10.0


def test_path_that_cannot_be_followed_leaves_the_old_one() -> None:
    world = World()
    row = npc(world, path=CIRCLE, speed=3.0)
    step(world)
    before = world.digest()
    for path in (BENT[:1], BENT * math.nan, BENT * 1e6):
        with pytest.raises(ValueError, match="path: expected"):
            world.follow_path(row, path, is_loop=False)
    assert world.digest() == before
    world.follow_path(row, BENT, is_loop=True)
    assert (world.paths.num_live, bool(world.is_loop[row])) == (len(world.paths.segments), True)
    backwards = npc(world, speed=-1.0)
    with pytest.raises(ValueError, match="speed >= 0"):
        world.follow_path(backwards, BENT, is_loop=False)
