"""Kerbs, pavements, verges, asphalt in gaps, walls of bridges: their widths and heights beside straight roads."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.maps.road_map import Border, Crosswalk
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_edges import _are_turns, _drop_short, _narrowest, _smooth_runs
from rosbridge_sim.scenery.static.road_surface import sample_lane
from rosbridge_sim.scenery.static.terrain import BELOW, Terrain, _lowest_around, _smooth
from rosbridge_sim.world.roads.roads import Roads
from tests.scenery.static.small_scenes import area, corners, drawn
from tests.world.road_factory import crossing, line, make, road

PEOPLE = (Crosswalk("", (line((40, -2), (44, -2), (44, 2), (40, 2)),)),)
"""A crosswalk: people walk beside the roads then."""

LINES = (Border("", line((0, 0), (100, 0)), 501, ("Solid",)),)


def beside(mesh: Mesh, label: Label, *, left: bool = True) -> np.ndarray:
    """Corners of a class on one side of the road along x, in its middle part."""
    places = corners(mesh, label).reshape(-1, 3)
    return np.asarray(places[(places[:, 0] > 20.0) & (places[:, 0] < 80.0) & ((places[:, 1] > 0.0) == left)])


def spans(places: np.ndarray) -> tuple[float, ...]:
    """Least and greatest distance from the middle of the road, and heights."""
    away = np.abs(places[:, 1])
    return tuple(round(float(value), 3) for value in (away.min(), away.max(), places[:, 2].min(), places[:, 2].max()))


@pytest.mark.parametrize("left", [True, False])
def test_road_of_people_has_kerbs_and_pavements_on_both_sides(left: bool) -> None:  # noqa: FBT001 - of the table
    mesh = drawn(road(100.0), crosswalks=PEOPLE, borders=LINES)
    edge = 1.75 + 0.35
    assert spans(beside(mesh, Label.KERB, left=left)) == (edge, round(edge + 0.18, 3), 0.0, 0.09)
    assert spans(beside(mesh, Label.PAVEMENT, left=left)) == (round(edge + 0.18, 3), round(edge + 2.6, 3), 0.03, 0.03)
    verge = beside(mesh, Label.GROUND, left=left)
    near = verge[np.abs(verge[:, 1]) < 9.0]
    assert np.abs(near[:, 1]).max() == pytest.approx(edge + 5.6, abs=1e-3)
    assert sorted({round(float(z), 3) for z in near[:, 2]}) == [-0.36, 0.03]  # from the pavement to below the ground


def test_road_without_people_has_a_verge_alone() -> None:
    mesh = drawn(road(100.0), borders=LINES)
    assert not np.isin(mesh.label, [Label.KERB, Label.PAVEMENT]).any()
    verge = beside(mesh, Label.GROUND)
    near = verge[np.abs(verge[:, 1]) < 9.0]
    assert spans(near) == (2.1, 5.1, -0.36, 0.0)


def test_all_that_lies_flat_looks_up() -> None:
    mesh = drawn(road(100.0), crosswalks=PEOPLE, borders=LINES)
    flat = np.isin(mesh.label, [Label.ASPHALT, Label.PAVEMENT, Label.GROUND, Label.PAINT_WHITE, Label.CROSSWALK])
    assert (mesh.normals[flat, 2] > 0.0).all()
    kerb = corners(mesh, Label.KERB)
    normals = mesh.normals[mesh.label == Label.KERB]
    is_front = np.ptp(kerb[..., 1], axis=1) < 1e-6
    towards_road = -np.sign(kerb[..., 1].mean(axis=1)) * normals[:, 1]
    inner = np.abs(kerb[..., 1].mean(axis=1)) < 2.15
    assert (towards_road[is_front & inner] > 0.99).all()
    assert (towards_road[is_front & ~inner] < -0.99).all()
    assert (normals[~is_front, 2] > 0.99).all()


def test_asphalt_is_the_lane_with_its_shoulders_and_a_bit_longer() -> None:
    mesh = drawn(road(100.0), borders=LINES)
    places = corners(mesh, Label.ASPHALT).reshape(-1, 3)
    assert places.min(axis=0) == pytest.approx([-0.2, -2.1, 0.0], abs=1e-4)
    assert places.max(axis=0) == pytest.approx([100.2, 2.1, 0.0], abs=1e-4)
    assert area(mesh, Label.ASPHALT) == pytest.approx(100.4 * 4.2)


def test_lane_with_a_slope_across_is_two_strips_that_meet_in_its_middle() -> None:
    points = line((0, 0), (50, 0), (100, 0))
    banks = {0: np.tile([-0.03, 0.02], (3, 1))}
    mesh = drawn(Roads(["a"], [points], [[]], [3.5], [15.0], banks=banks), borders=LINES)
    places = corners(mesh, Label.ASPHALT).reshape(-1, 3)
    height = np.where(places[:, 1] > 0.0, -0.03, 0.02) * places[:, 1]
    assert places[:, 2] == pytest.approx(height, abs=1e-4)
    assert sorted({round(float(y), 3) for y in places[:, 1]}) == [-2.1, 0.0, 2.1]
    assert area(mesh, Label.ASPHALT) == pytest.approx(100.4 * 4.2)


@pytest.mark.parametrize(("length", "num"), [(100.0, 101), (10.4, 11), (0.6, 3)])
def test_places_along_a_lane_are_about_a_step_apart_and_reach_its_end(length: float, num: int) -> None:
    sample = sample_lane(road(length), 0, 1.0, 2)
    assert sample.points[:, 0] == pytest.approx(np.linspace(0.0, length, num))
    assert sample.side.tolist() == [[0.0, 1.0]] * num
    assert sample.border.tolist() == [[1.75, 1.75]] * num


def test_verge_is_a_dull_green() -> None:
    mesh = drawn(road(100.0), borders=LINES)
    near = (mesh.label == Label.GROUND) & (np.ptp(mesh.vertices[mesh.triangles][..., 2], axis=1) > 0.1)
    assert np.unique(mesh.colour[near], axis=0).tolist() == [[99, 112, 86]]


def two_lanes(gap: float) -> Roads:
    apart = 3.5 + gap
    return make(there=(line((0, 0), (100, 0)), ""), back=(line((100, apart), (0, apart)), ""))


@pytest.mark.parametrize(("gap", "is_filled"), [(1.2, True), (3.1, True), (3.6, False), (8.0, False)])
def test_narrow_gap_between_two_roads_is_asphalt(gap: float, is_filled: bool) -> None:  # noqa: FBT001 - of the table
    mesh = drawn(two_lanes(gap), crosswalks=PEOPLE, borders=LINES)
    places = corners(mesh, Label.ASPHALT).mean(axis=1)
    middle = 1.75 + 0.5 * gap
    is_there = area(mesh, Label.ASPHALT) > 2 * 100.4 * 4.2 + 0.5
    assert is_there == is_filled
    kerbs = corners(mesh, Label.KERB)[..., 1].mean(axis=1)
    inside = kerbs[(kerbs > 1.0) & (kerbs < 1.75 + gap + 1.0)]
    assert (len(inside) > 0) == (not is_filled)
    assert len(places)
    if not is_filled:
        pavement = corners(mesh, Label.PAVEMENT)[..., 1]
        pavement = pavement[(pavement > 1.0) & (pavement < 2.5 + gap)]
        assert np.abs(pavement - middle).max() <= 0.5 * gap - 0.35 + 1e-6
        assert np.abs(pavement - middle).min() < 0.6 or gap > 6.0


def test_bridge_has_walls_on_both_sides_and_no_pavement() -> None:
    above = line((0, 0), (40, 0), (60, 0), (100, 0))
    above[:, 2] = 9.0
    below = line((50, -60), (50, 60))
    mesh = drawn(make(above=(above, ""), below=(below, "")), crosswalks=PEOPLE, borders=LINES)
    walls = corners(mesh, Label.KERB).reshape(-1, 3)
    walls = walls[walls[:, 2] > 5.0]
    assert len(walls)
    assert sorted({round(float(z) - 9.0, 3) for z in walls[:, 2]} & {-0.7, 0.0, 0.9}) == [-0.7, 0.0, 0.9]
    tops = walls[np.abs(walls[:, 2] - 9.9) < 1e-3]
    assert sorted({round(abs(float(y)), 3) for y in tops[:, 1]}) == [2.1, 2.35]
    assert {float(np.sign(y)) for y in tops[:, 1]} == {-1.0, 1.0}
    beyond = walls[np.abs(np.abs(walls[:, 1]) - 2.35) < 1e-3]
    ends = [beyond[np.abs(beyond[:, 2] - z) < 1e-3, 0] for z in (8.3, 9.9)]
    assert len({(round(float(x.min()), 3), round(float(x.max()), 3)) for x in ends}) == 1
    is_wall = (mesh.label == Label.KERB) & (mesh.vertices[mesh.triangles][..., 2].min(axis=1) > 5.0)
    places, normals = corners(mesh, Label.KERB), mesh.normals[mesh.label == Label.KERB]
    sides = np.abs(places[is_wall[mesh.label == Label.KERB]][..., 1].mean(axis=1))
    outwards = np.sign(places[..., 1].mean(axis=1)) * normals[:, 1]
    outwards = outwards[is_wall[mesh.label == Label.KERB]]
    assert outwards[sides < 2.11].tolist() == pytest.approx([-1.0] * int((sides < 2.11).sum()))
    assert outwards[sides > 2.34].tolist() == pytest.approx([1.0] * int((sides > 2.34).sum()))


def test_ways_through_a_crossing_are_found_by_forks_joins_and_stops() -> None:
    ways = {"a": "b c k", "b": "d", "c": "e", "d": "", "e": "", "f": "d", "g": "h", "h": "", "k": ""}
    names = list(ways)
    roads = Roads(
        names,
        [line((i, 0), (i, 90 if name == "c" else 20)) for i, name in enumerate(names)],
        [[names.index(to) for to in then.split()] for then in ways.values()],
        [3.5] * 9,
        [15.0] * 9,
        is_stop=[name == "g" for name in names],
    )
    found = {name for name, is_turn in zip(names, _are_turns(roads), strict=True) if is_turn}
    assert found == {"b", "k", "f", "h"}  # of a fork, before a join, behind a stop; c is too long for a turn
    assert not _are_turns(crossing()).any()


def test_runs_of_an_edge_are_cut_where_it_jumps_and_dropped_where_they_are_holes() -> None:
    is_open = np.array([True] * 3 + [False] * 2 + [True] * 4 + [False])
    assert _drop_short(is_open).tolist() == [False] * 5 + [True] * 4 + [False]
    assert _drop_short(np.ones(2, dtype=bool)).all()
    filled = np.array([0.0, 0.5, 1.0, 1.6, 1.6, 1.6])
    assert _smooth_runs(np.ones(6, dtype=bool), filled) == [(0, 3), (3, 6)]
    assert _smooth_runs(np.array([True, True, True, True, False, True]), filled) == [(0, 3)]
    assert _narrowest(np.array([3.0, 1.0, 2.0, 5.0])).tolist() == [1.0, 1.0, 1.0, 2.0]


def hill() -> Roads:
    points = line(*((x, 0.0) for x in range(0, 201, 10)))
    points[:, 2] = 0.002 * (points[:, 0] - 100.0) ** 2
    return make(a=(points, ""))


def test_ground_never_comes_through_a_road_on_a_hill() -> None:
    roads = hill()
    terrain, along = Terrain(roads, RoadCover(roads)), np.linspace(2.0, 198.0, 300)
    for aside in (-1.75, 0.0, 1.75):
        places = np.column_stack([along, np.full(300, aside)])
        top = np.interp(along, roads.points[:, 0], roads.points[:, 2])
        assert (terrain.height(places) < top).all()
        assert (terrain.height(places) > top - 6.0).all()


def test_ground_of_a_flat_map_is_just_below_its_roads_and_far_beyond_them() -> None:
    roads = make(a=(line((0, 0), (100, 0), z=7.0), ""))
    mesh = drawn(roads, borders=LINES)
    ground = corners(mesh, Label.GROUND).reshape(-1, 3)
    grid = ground[np.abs(ground[:, 2] - (7.0 - BELOW)) < 1e-4]
    assert grid[:, :2].min(axis=0) == pytest.approx([-250.0, -250.0])
    assert (grid[:, :2].max(axis=0) >= (350.0, 250.0)).all()
    assert (grid[:, :2].max(axis=0) < (370.0, 270.0)).all()
    whole = corners(mesh, Label.GROUND)
    flat = whole[(np.abs(whole[..., 2] - 6.94) < 1e-4).all(axis=1)]
    sides = flat[:, 1, :2] - flat[:, 0, :2], flat[:, 2, :2] - flat[:, 0, :2]
    areas = 0.5 * (sides[0][:, 0] * sides[1][:, 1] - sides[0][:, 1] * sides[1][:, 0])
    assert areas == pytest.approx(200.0)
    assert areas.sum() == pytest.approx(np.prod(np.ptp(grid[:, :2], axis=0)))
    colours = np.unique(mesh.colour[mesh.label == Label.GROUND], axis=0)
    grass = [[79, 114, 69], [84, 119, 72], [88, 125, 76], [90, 123, 80]]
    assert colours.tolist() == [*grass, [99, 112, 86]]


def test_height_of_the_ground_is_that_of_its_cells_evened_out() -> None:
    roads = hill()
    terrain = Terrain(roads, RoadCover(roads))
    grid, cell = terrain._height, terrain._cell
    for i, j in ((3, 4), (10, 20)):
        at = terrain._low + cell * np.array([(i, j), (i + 0.25, j), (i, j + 0.75), (i + 0.5, j + 0.5)])
        corner = grid[i : i + 2, j : j + 2]
        expected = [
            *(corner[0, 0], 0.75 * corner[0, 0] + 0.25 * corner[1, 0], 0.25 * corner[0, 0] + 0.75 * corner[0, 1]),
            corner.mean(),
        ]
        assert terrain.height(at) == pytest.approx(np.array(expected))
    outside = terrain.height(np.array([terrain._low - 1e4, terrain._low + 1e6]))
    assert outside.tolist() == [grid[0, 0], grid[-1, -1]]


def test_ground_takes_the_lowest_place_near_roads_and_changes_evenly_between_them() -> None:
    height = np.arange(20.0).reshape(4, 5)
    is_near = np.zeros((4, 5), dtype=bool)
    is_near[2, 2] = is_near[0, 0] = is_near[3, 4] = True
    found = _lowest_around(height, is_near)
    assert (found[2, 2], found[0, 0], found[3, 4]) == (6.0, 0.0, 13.0)
    assert np.array_equal(found[~is_near], height[~is_near])
    is_fixed = np.zeros((3, 9), dtype=bool)
    is_fixed[:, [0, 8]] = True
    smooth = _smooth(np.where(np.arange(9) == 8, 8.0, 0.0) * np.ones((3, 1)), is_fixed)
    assert smooth == pytest.approx(np.tile(np.arange(9.0), (3, 1)), abs=0.02)
