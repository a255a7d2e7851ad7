from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.geometry.block_grid import REACH, BlockGrid
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.geometry.segment_search import BESIDE, CROWD, TURN_COST
from rosbridge_sim.world.many_worlds.many_roads import repeat_roads
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import LanePlaces, Roads
from tests.mutations import examples


def straight(*corners: tuple[float, float], z: float = 0.0) -> FloatArray:
    return np.array([(x, y, z) for x, y in corners], dtype=np.float64)


def make(*lines: FloatArray, successors: list[list[int]] | None = None) -> Roads:
    n = len(lines)
    ids = [f"L{i}" for i in range(n)]
    return Roads(ids, lines, successors or [[] for _ in lines], [3.5] * n, [10.0] * n)


def slow_nearest(roads: Roads, x: float, y: float, yaw: float | None) -> tuple[int, float, float, float]:
    """Lane, s, distance and score by plain loops: the judge of the fast one."""
    best = (-1, 0.0, math.inf, math.inf)
    for lane in range(len(roads)):
        line = roads.points[roads.first[lane] : roads.first[lane + 1]]
        s = 0.0
        for (x0, y0, _), (x1, y1, _) in zip(line[:-1].tolist(), line[1:].tolist(), strict=True):
            length = math.hypot(x1 - x0, y1 - y0)
            ux, uy = (x1 - x0) / length, (y1 - y0) / length
            along = min(max((x - x0) * ux + (y - y0) * uy, 0.0), length)
            distance = math.hypot(x - x0 - along * ux, y - y0 - along * uy)
            turn = 0.0 if yaw is None else TURN_COST * (1.0 - (math.cos(yaw) * ux + math.sin(yaw) * uy))
            if distance + turn < best[3] - 1e-9:
                best = (lane, s + along, distance, distance + turn)
            s += length
    return best


def test_lateral_offset_is_positive_to_the_left() -> None:
    roads = make(straight((0, 0), (50, 0), (100, 0)))
    places = roads.nearest([30.0, 60.0], [1.5, -2.0])
    assert places.lane.tolist() == [0, 0]
    assert places.s.tolist() == [30.0, 60.0]
    assert places.lateral.tolist() == [1.5, -2.0]
    assert places.distance.tolist() == [1.5, 2.0]
    assert places.yaw.tolist() == [0.0, 0.0]


def test_foot_point_beyond_the_end_is_the_end() -> None:
    places = make(straight((0, 0), (100, 0))).nearest(103.0, 4.0)
    assert (places.s[0], places.lateral[0], places.distance[0]) == (100.0, 4.0, 5.0)


def test_heading_chooses_between_two_directions() -> None:
    roads = make(straight((0, 0), (100, 0)), straight((100, 3.5), (0, 3.5)))
    assert roads.nearest(50.0, 1.8).lane[0] == 1
    assert roads.nearest(50.0, 1.8, 0.1).lane[0] == 0
    assert roads.nearest(50.0, 1.8, math.pi).lane[0] == 1
    assert roads.nearest([50.0, 50.0], [1.8, 1.8], [0.0, math.pi]).lane.tolist() == [0, 1]


def test_nearest_lane_is_found_far_from_every_road() -> None:
    roads = make(straight((0, 0), (100, 0)), straight((0, 500), (100, 500)))
    places = roads.nearest([50.0, 50.0, 1e7], [200.0, 300.0, 500.0])
    assert places.lane.tolist() == [0, 1, 1]
    assert places.distance.tolist() == [200.0, 200.0, 1e7 - 100.0]


def test_empty_road_map_has_no_nearest_lane() -> None:
    roads = Roads()
    places = roads.nearest([1.0, 2.0], [3.0, 4.0])
    assert len(roads) == 0
    assert places.lane.tolist() == [-1, -1]
    assert np.isinf(places.distance).all()
    assert len(make(straight((0, 0), (1, 0))).nearest([], []).lane) == 0


def test_point_on_a_lane_projects_to_itself() -> None:
    roads = make(straight((0, 0), (30, 0), (30, 40), z=2.0), straight((200, 0), (200, 10)))
    points, yaw = roads.at([0, 0, 1, 0, 0, 1], [10.0, 50.0, 4.0, -5.0, 999.0, 999.0])
    expected = [[10, 0, 2], [30, 20, 2], [200, 4, 0], [0, 0, 2], [30, 40, 2], [200, 10, 0]]
    np.testing.assert_allclose(points, expected, atol=1e-9)
    np.testing.assert_allclose(yaw, [0, math.pi / 2, math.pi / 2, 0, math.pi / 2, math.pi / 2], atol=1e-12)
    assert roads.length.tolist() == [70.0, 10.0]


def test_lanes_keep_their_names_and_successors() -> None:
    roads = make(
        straight((0, 0), (1, 0)), straight((1, 0), (2, 0)), straight((1, 0), (2, 1)), successors=[[1, 2], [], []]
    )
    assert roads.row("L2") == 2
    assert roads.successors(0).tolist() == [1, 2]
    assert roads.successors(1).tolist() == []
    with pytest.raises(KeyError):
        roads.row("L9")


def test_repeated_points_are_harmless() -> None:
    roads = make(straight((0, 0), (0, 0), (5, 0), (5, 0), (10, 0)))
    assert roads.points[:, 0].tolist() == [0.0, 5.0, 10.0]
    assert roads.s.tolist() == [0.0, 5.0, 10.0]


@pytest.mark.parametrize(
    ("ids", "lines"),
    [
        (["a"], [straight((1, 1), (1, 1))]),
        (["a"], [straight()]),
        (["a", "a"], [straight((0, 0), (1, 0))] * 2),
        (["a"], []),
    ],
)
def test_invalid_lanes_are_refused(ids: list[str], lines: list[FloatArray]) -> None:
    with pytest.raises(ValueError, match="lane"):
        Roads(ids, [line.reshape(-1, 3) for line in lines], [[]] * len(lines), [3.5] * len(lines), [0.0] * len(lines))


def test_lanes_of_very_different_lengths_coexist() -> None:
    roads = make(*[straight((0, i), (1e7, 1e7 + i)) for i in range(20)], straight((0, -1), (1e-9, -1)))
    assert roads.nearest([5e6, 0.0], [5e6 + 3.1, -1.2]).lane.tolist() == [3, 20]


def test_long_lanes_of_many_blocks_are_found_at_every_point() -> None:
    turn = np.linspace(0.0, 6.0, 700)
    spiral = np.stack((50 * turn * np.cos(turn), 50 * turn * np.sin(turn), turn), axis=1)
    roads = make(straight((-500, -500), (-400, -500)), spiral, np.flipud(spiral))
    s = np.linspace(1.0, roads.length[1] - 1.0, 1000)
    points, yaw = roads.at(np.ones(1000, dtype=np.int64), s)
    places = roads.nearest(points[:, 0], points[:, 1], yaw)
    assert (places.lane == 1).all()
    np.testing.assert_allclose(places.s, s, atol=1e-6)
    back = roads.nearest(points[:, 0], points[:, 1], yaw + math.pi)
    assert (back.lane == 2).all()
    np.testing.assert_allclose(back.s, roads.length[2] - s, atol=1e-6)


coordinate = st.floats(-150, 150).map(lambda v: round(v, 2))
line = st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=6, unique=True)


@given(
    lines=st.lists(line, min_size=1, max_size=6),
    places=st.lists(st.tuples(coordinate, coordinate, st.none() | st.floats(-4, 4)), min_size=1, max_size=6),
)
def test_fast_path_equals_slow_path(
    lines: list[list[tuple[float, float]]], places: list[tuple[float, float, float | None]]
) -> None:
    roads = make(*[straight(*corners) for corners in lines])
    roads.curve[:] = 0.0  # the search is over the chords
    for x, y, yaw in places:
        found = roads.nearest(x, y, yaw)
        lane, _, distance, score = slow_nearest(roads, x, y, yaw)
        turn = 0.0 if yaw is None else TURN_COST * (1.0 - math.cos(yaw - found.yaw[0]))
        assert found.distance[0] + turn == pytest.approx(score, abs=1e-6)
        if yaw is None:
            assert found.distance[0] == pytest.approx(distance, abs=1e-6)
        points, _ = roads.at(found.lane, found.s)
        assert math.hypot(points[0, 0] - x, points[0, 1] - y) == pytest.approx(found.distance[0], abs=1e-6)
        assert lane >= 0


@examples(20)
@given(lines=st.lists(line, min_size=1, max_size=4), places=st.lists(st.tuples(coordinate, coordinate), max_size=20))
def test_many_queries_equal_single_queries(
    lines: list[list[tuple[float, float]]], places: list[tuple[float, float]]
) -> None:
    roads = make(*[straight(*corners) for corners in lines])
    together = roads.nearest([x for x, _ in places], [y for _, y in places])
    for i, (x, y) in enumerate(places):
        alone = roads.nearest(x, y)
        assert alone.lane[0] == together.lane[i]
        assert alone.s[0] == together.s[i]
        assert alone.lateral[0] == together.lateral[i]


# What lies beside and at the ends


def test_lanes_know_their_neighbours_and_stop_lines() -> None:
    lines = [straight((0, 0), (50, 0)), straight((0, 3), (50, 3))]
    limits = [10.0, 0.0]
    roads = Roads(["a", "b"], lines, [[], []], [3.0, 3.0], limits, left=[1, -1], right=[-1, 0], is_stop=[True, False])
    assert (roads.left.tolist(), roads.right.tolist(), roads.is_stop.tolist()) == ([1, -1], [-1, 0], [True, False])
    plain = make(*lines)
    assert (plain.left.tolist(), plain.right.tolist(), plain.is_stop.tolist()) == ([-1, -1], [-1, -1], [False, False])
    with pytest.raises(ValueError, match="one value for each lane"):
        Roads(["a", "b"], lines, [[], []], [3.0, 3.0], [10.0, 0.0], left=[1])


def test_default_border_is_half_a_width_away() -> None:
    roads = make(straight((0, 0), (50, 0)))
    left, right = roads.beside(roads.nearest([10.0, 20.0], [0.5, -3.0]))
    assert (left.tolist(), right.tolist()) == ([1.25, 4.75], [2.25, -1.25])


def test_border_distance_may_change_along_a_lane() -> None:
    line = straight((0, 0), (0, 0), (40, 0))  # a repeated point takes its distances with it
    borders = {0: np.array([[2.0, 1.5], [9.0, 9.0], [4.0, 1.5]])}
    roads = Roads(["a"], [line], [[]], [3.0], [10.0], borders=borders)
    left, right = roads.beside(roads.nearest([0.0, 20.0, 40.0], [0.0, 1.0, 0.0]))
    assert (left.tolist(), right.tolist()) == ([2.0, 2.0, 4.0], [1.5, 2.5, 1.5])


def test_empty_road_map_has_no_borders() -> None:
    left, right = Roads().beside(Roads().nearest(1.0, 2.0))
    assert (left.tolist(), right.tolist()) == ([math.inf], [math.inf])


def test_turn_is_measured_from_end_to_end_of_a_lane() -> None:
    angles = np.linspace(0.0, 1.5 * math.pi, 200)
    arc = np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=-1)
    roads = make(straight((0, 0), (5, 0), (5, -5)), arc, straight((0, 0), (9, 9)))
    assert roads.turn.tolist() == pytest.approx([-math.pi / 2, 1.5 * math.pi, 0.0], abs=0.03)


def test_derived_road_data_is_computed_once() -> None:
    roads = make(straight((0, 0), (5, 0)))
    calls: list[Roads] = []

    def count(of: Roads) -> int:
        calls.append(of)
        return len(calls)

    assert (roads.derived(count), roads.derived(count)) == (1, 1)
    assert calls == [roads]


def test_different_roads_have_different_digests() -> None:
    def digest(x: float = 50.0, limit: float = 10.0, *, is_stop: bool = False) -> bytes:
        return Roads(["a"], [straight((0, 0), (x, 0))], [[]], [3.0], [limit], is_stop=[is_stop]).digest

    assert digest() == digest()
    assert len({digest(), digest(51.0), digest(limit=9.0), digest(is_stop=True)}) == 4


def slow_within(roads: Roads, x: FloatArray, y: FloatArray, radius: FloatArray) -> list[tuple[int, int]]:
    """Who is near which lane, with a look at all lanes: the judge of the fast one."""
    found = []
    for i, place in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        for lane in range(len(roads)):
            line = roads.points[roads.first[lane] : roads.first[lane + 1], :2]
            a, way = line[:-1], np.diff(line, axis=0)
            size = np.hypot(way[:, 0], way[:, 1])
            full = ((place - a) * way).sum(axis=1) / size
            along = np.clip(full, 0.0, size)
            lateral = np.abs((place - a)[:, 1] * way[:, 0] - (place - a)[:, 0] * way[:, 1]) / size
            distance = np.hypot(full - along, lateral)
            if ((distance <= radius[i]) & (distance - lateral < BESIDE)).any():
                found.append((i, lane))
    return found


def web(num: int, size: float) -> Roads:
    """Bent lanes at random, some of many blocks."""
    rng = np.random.default_rng(2)
    lines = []
    for i in range(num):
        angle = np.cumsum(rng.normal(0.0, 0.1, 100 if i % 3 else 5)) + rng.uniform(-3.0, 3.0)
        step = rng.uniform(0.3, 4.0)
        steps = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1) * step
        lines.append(np.cumsum(steps, axis=0) + np.append(rng.uniform(-size, size, 2), 0.0))
    return make(*lines)


@pytest.mark.parametrize("size", [100.0, 5_000.0])
def test_lanes_near_places_equal_a_full_search(size: float) -> None:
    roads, rng = web(12, size), np.random.default_rng(3)
    beside = roads.points[rng.integers(0, len(roads.points), 40), :2] + rng.normal(0.0, 6.0, (40, 2))
    x, y = np.concatenate([beside, rng.uniform(-size, size, (20, 2)), [[1e9, -1e9]]]).T
    num_found = 0
    for most in (3.0, 16.0, 60.0):
        radius = rng.uniform(0.0, most, len(x))
        who, places = roads.within(x, y, radius)
        assert list(zip(who.tolist(), places.lane.tolist(), strict=True)) == slow_within(roads, x, y, radius)
        num_found += len(who)
        few = [roads.within(x[[i]], y[[i]], radius[[i]])[1] for i in range(len(x))]  # without a grid
        for name in LanePlaces.__struct_fields__:
            alone = np.concatenate([getattr(each, name) for each in few])
            assert alone.tobytes() == getattr(places, name).tobytes()
    assert num_found > 60


def test_clearance_is_the_distance_to_the_nearest_segment() -> None:
    roads, rng = web(12, 100.0), np.random.default_rng(4)
    x, y = rng.uniform(-200.0, 200.0, (2, 80))
    most = rng.uniform(1.0, 60.0, 80)
    points, ends = roads.points[:, :2], roads.first[1:] - 1
    start, way = np.delete(points[:-1], ends[:-1], axis=0), np.delete(np.diff(points, axis=0), ends[:-1], axis=0)
    for i, found in enumerate(roads.clearance(x, y, most).tolist()):
        away = [x[i], y[i]] - start
        share = np.clip((away * way).sum(axis=1) / np.square(way).sum(axis=1), 0.0, 1.0)
        nearest = np.hypot(*(away - share[:, None] * way).T).min()
        assert found == pytest.approx(min(nearest, most[i]), abs=1e-9)
        assert found == roads.clearance(x[[i]], y[[i]], most[[i]])[0]


def test_nobody_is_clear_of_too_many_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    roads = make(*(straight((0, i), (500, i)) for i in range(4)))
    x, y, most = np.array([250.0]), np.array([8.0]), np.array([20.0])
    assert roads.clearance(x, y, most).tolist() == [5.0]
    monkeypatch.setattr("rosbridge_sim.world.geometry.segment_search.MAX_SEGMENTS", 3)
    assert roads.clearance(x, y, most).tolist() == [0.0]


def test_many_lanes_in_one_place_hide_none_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    roads = make(*(straight((0, i), (500, i)) for i in range(4)))
    x, y = np.full(1_000, 250.0), np.zeros(1_000)
    x[::100] = np.arange(10) * 20.0
    monkeypatch.setattr("rosbridge_sim.world.geometry.segment_search.MAX_SEGMENTS", 1_000)
    who, _ = roads.within(x, y, np.full(1_000, 5.0))
    seen = set(who.tolist())
    assert set(range(0, 1_000, 100)) <= seen
    assert len(seen) == 10 + CROWD
    monkeypatch.setattr("rosbridge_sim.world.geometry.segment_search.CROWD", 1_000)
    who, _ = roads.within(x, y, np.full(1_000, 5.0))
    assert len(set(who.tolist())) == 250  # of four segments each


def test_a_grid_of_very_long_blocks_stays_small() -> None:
    rng = np.random.default_rng(4)
    low = rng.uniform(-1e5, 1e5, (50, 2))
    high = low + rng.uniform(1e4, 1e5, (50, 2))
    grid = BlockGrid(low, high)
    assert len(grid._block) <= 16 * 51
    place = rng.uniform(-2e5, 2e5, (200, 2))
    owner, block = grid.find(place)
    found = set(zip(owner.tolist(), block.tolist(), strict=True))
    for i, here in enumerate(place):
        is_in = np.all((here >= low - REACH) & (here <= high + REACH), axis=1)
        assert {(i, box) for box in np.flatnonzero(is_in).tolist()} <= found


def test_pickle_of_roads_has_what_they_were_made_of_and_all_else_is_worked_out_again() -> None:
    one = web(40, 300.0)
    size = len(pickle.dumps(one))
    one.derived(LaneConflicts)
    one.nearest(one.points[:, 0], one.points[:, 1])
    one.clearance(one.points[:, 0] + 50.0, one.points[:, 1], np.full(len(one.points), 9.0))
    assert len(pickle.dumps(one)) == size < 3 * (one.points.nbytes + one.border.nbytes)
    again: Roads = pickle.loads(pickle.dumps(one))  # noqa: S301 - our own
    assert again.alone is again
    assert vars(again).keys() == vars(one).keys()
    for name in vars(one).keys() - {"alone", "segments", "search", "kept"}:
        assert np.array_equal(getattr(again, name), getattr(one, name)), name
    for name in one.segments.__struct_fields__:
        assert np.array_equal(getattr(again.segments, name), getattr(one.segments, name)), name
    with pytest.raises(TypeError, match="pickle the map, `alone`"):
        pickle.dumps(repeat_roads(one, 2))
