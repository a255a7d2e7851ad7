"""Buildings, trees, lamps and posts beside a straight road: shapes, colours, distances, and how many there are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.maps.road_map import Border, Crosswalk
from rosbridge_sim.scenery.mesh import Label, Lit, Mesh
from rosbridge_sim.scenery.static.dressing import _cells, _crown, _far_apart, _fir
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.scenery.static.terrain import BELOW, Terrain
from tests.scenery.solid_figures import is_closed, parts_of, volume_of
from tests.scenery.static.small_scenes import map_of
from tests.world.road_factory import line, make

LINES = (Border("", line((0, 0), (400, 0)), 501, ("Solid",)),)
PEOPLE = (Crosswalk("", (line((40, -2), (44, -2), (44, 2), (40, 2)),)),)
EDGE = 1.75
"""Distance of the edges of the lane from its middle [m]."""


@pytest.fixture(scope="module")
def town() -> Mesh:
    return static_mesh(map_of(make(a=(line((0, 0), (400, 0)), "")), borders=LINES, crosswalks=PEOPLE), "x", 0)


@pytest.fixture(scope="module")
def country() -> Mesh:
    return static_mesh(map_of(make(a=(line((0, 0), (400, 0)), "")), borders=LINES), "x", 0)


def solids(mesh: Mesh, label: Label, lit: Lit = Lit.NEVER) -> list[np.ndarray]:
    """Corners of each solid of a class, map frame."""
    which = (mesh.label == label) & (mesh.lit == lit)
    parts = parts_of(mesh.triangles[which])
    return [mesh.vertices[np.unique(part)].astype(np.float64) + mesh.origin for part in parts]


def trees(mesh: Mesh) -> list[list[np.ndarray]]:
    """Corners of the parts of each tree: its trunk, and a crown or the cones of a fir."""
    found: list[list[np.ndarray]] = []
    for part in solids(mesh, Label.TREE):
        if len(part) == 10:
            found.append([])
        found[-1].append(part)
    return found


def around(part: np.ndarray, trunk: np.ndarray) -> float:
    """Radius of a part about the middle of a trunk [m]."""
    return float(np.hypot(*(part - trunk.mean(axis=0)).T[:2]).max())


def away_from_road(places: np.ndarray) -> np.ndarray:
    beyond = np.maximum(np.maximum(-places[:, 0], places[:, 0] - 400.0), 0.0)
    return np.asarray(np.hypot(beyond, places[:, 1]) - EDGE)


@pytest.mark.parametrize(("name", "free", "num"), [("town", 3.4, (60, 110)), ("country", 1.5, (2, 12))])
def test_buildings_keep_off_the_road_and_off_each_other(
    name: str, free: float, num: tuple[int, int], request: pytest.FixtureRequest
) -> None:
    mesh = request.getfixturevalue(name)
    houses = solids(mesh, Label.BUILDING)
    assert num[0] <= len(houses) <= num[1]
    for house in houses:
        assert len(house) == 8
        low, high = house[house[:, 2] < 0.0], house[house[:, 2] > 0.0]
        assert low[:, 2] == pytest.approx(-BELOW - 1.0, abs=1e-4)
        assert float(high[0, 2]) + BELOW == pytest.approx(
            min((4, 7, 10, 13, 16, 22, 31), key=lambda h: abs(h - high[0, 2])), abs=1e-3
        )
        sides = np.linalg.norm(np.diff(low[:3, :2], axis=0), axis=1)
        assert (12.0 <= sides[0] <= 24.0, 10.0 <= sides[1] <= 18.0) == (True, True)
        assert away_from_road(low).min() > free
        assert away_from_road(low.mean(axis=0)[None]).max() < 140.0
    middles = np.array([house[:, :2].mean(axis=0) for house in houses])
    radii = np.array([0.5 * np.ptp(house[:, :2], axis=0).max() for house in houses])
    apart = np.linalg.norm(middles[:, None] - middles, axis=2) + 1e9 * np.eye(len(houses))
    assert (apart > (radii[:, None] + radii) * 0.9 - 2.0).all()
    roofs = mesh.normals[mesh.label == Label.BUILDING]
    assert (roofs[:, 2] > 0.99).sum() == 2 * len(houses)
    walls = mesh.colour[mesh.label == Label.BUILDING]
    assert len(np.unique(walls, axis=0)) >= (6 if name == "town" else 2)
    assert np.unique(walls[roofs[:, 2] > 0.99], axis=0).tolist() == [[112, 108, 106]]


def test_houses_of_a_town_have_walls_of_eight_colours_and_seven_heights(town: Mesh) -> None:
    walls = town.colour[(town.label == Label.BUILDING) & (np.abs(town.normals[:, 2]) < 0.5)]
    greys = [(128, 120, 116), (140, 146, 150), (150, 110, 92), (160, 148, 138), (172, 138, 112)]
    assert np.unique(walls, axis=0).tolist() == [
        list(colour) for colour in [*greys, (178, 168, 152), (186, 176, 150), (196, 190, 180)]
    ]
    heights = np.round([house[:, 2].max() + BELOW for house in solids(town, Label.BUILDING)], 3)
    values, counts = np.unique(heights, return_counts=True)
    assert values.tolist() == [4.0, 7.0, 10.0, 13.0, 16.0, 22.0, 31.0]
    assert counts / len(heights) == pytest.approx([0.14, 0.24, 0.24, 0.16, 0.12, 0.07, 0.03], abs=0.08)


def test_houses_stand_along_a_slanted_road_and_reach_from_below_the_lowest_ground_to_above_the_highest() -> None:
    roads = make(a=(np.array([(0.0, 0.0, 0.0), (240.0, 320.0, 24.0)]), ""))
    mesh = static_mesh(map_of(roads, borders=LINES, crosswalks=PEOPLE), "x", 0)
    terrain = Terrain(roads, RoadCover(roads))
    houses = solids(mesh, Label.BUILDING)
    slopes = []
    for house in houses:
        ground = terrain.height(house[:4, :2])
        assert house[:4, 2] == pytest.approx(ground.min() - 1.0, abs=2e-3)
        assert float(house[4, 2] - ground.max()) == pytest.approx(
            min((4, 7, 10, 13, 16, 22, 31), key=lambda h: abs(h - float(house[4, 2] - ground.max()))), abs=2e-3
        )
        side = house[1, :2] - house[0, :2]
        assert side / np.linalg.norm(side) == pytest.approx((0.6, 0.8), abs=1e-3)
        assert float(side @ (house[2, :2] - house[1, :2])) == pytest.approx(0.0, abs=0.01)
        slopes.append(np.ptp(ground))
    assert len(houses) > 40
    assert max(slopes) > 1.0


@pytest.mark.parametrize(("name", "free"), [("town", 3.4), ("country", 1.5)])
def test_trees_stand_on_the_ground_beside_the_road_more_of_them_near_it(
    name: str, free: float, request: pytest.FixtureRequest
) -> None:
    mesh = request.getfixturevalue(name)
    parts = solids(mesh, Label.TREE)
    trunks = [part for part in parts if len(part) == 10]
    assert len(trunks) > 60
    feet = np.array([trunk.mean(axis=0) for trunk in trunks])
    away = away_from_road(feet)
    assert away.min() > free + 1.5
    assert away.max() < 98.0
    near, far = (away < 30.0).sum() / (400.0 * 60.0), (away > 50.0).sum() / (500.0 * 96.0)
    assert near > 2.0 * far
    for trunk in trunks:
        assert trunk[:, 2].min() == pytest.approx(-BELOW - 0.1, abs=1e-3)
        assert 0.9 < np.ptp(trunk[:, 2]) < 3.3
        assert 0.1 < np.ptp(trunk[:, 0]) < 0.45
    tops = [part for part in parts if len(part) != 10]
    assert {len(part) for part in tops} == {30, 14}  # crowns, and the cones of firs
    crowns = [part for part in tops if len(part) == 30]
    assert len(crowns) + sum(len(part) == 14 for part in tops) / 3 == len(trunks)
    assert 1.4 < len(crowns) / (len(trunks) - len(crowns)) < 3.0
    for part in tops:
        assert 2.0 < np.ptp(part[:, 2]) < 9.0 or len(part) == 14
        assert part[:, 2].min() + BELOW > 0.6
        assert part[:, 2].max() < 10.8


def test_parts_of_a_tree_have_its_size_from_three_quarters_to_one_and_a_third(town: Mesh) -> None:
    forest = trees(town)
    assert {len(tree) for tree in forest} == {2, 4}
    sizes = []
    for trunk, *tops in forest:
        foot = float(trunk[:, 2].min())
        assert foot == pytest.approx(-BELOW - 0.1, abs=1e-3)
        is_fir = len(tops) == 3
        size = (float(trunk[:, 2].max()) - foot) / (1.4 if is_fir else 2.4)
        sizes.append(size)
        assert around(trunk, trunk) == pytest.approx((0.14 if is_fir else 0.16) * size, abs=1e-3)
        spans = [((top[:, 2].min() - foot) / size, (top[:, 2].max() - foot) / size) for top in tops]
        radii = [around(top, trunk) / size for top in tops]
        if is_fir:
            third = 6.4 / 3
            steps = [(1.0 + 0.85 * third * k, 1.0 + third * (k + 1.3)) for k in range(3)]
            assert np.ravel(spans) == pytest.approx(np.ravel(steps), abs=5e-3)
            assert radii == pytest.approx([1.7, 1.7 * 0.73, 1.7 * 0.46], abs=5e-3)
        else:
            assert spans[0] == pytest.approx((1.9, 6.2), abs=5e-3)
            assert radii == pytest.approx([1.9 * 0.95], abs=5e-3)
    assert (min(sizes), max(sizes)) == pytest.approx((0.75, 1.35), abs=0.05)


def test_crowns_are_turned_each_in_its_own_way_and_have_five_greens(country: Mesh) -> None:
    turns = []
    for trunk, *tops in trees(country):
        if len(tops) == 1:
            corner = (tops[0] - trunk.mean(axis=0))[0]
            turns.append(math.atan2(corner[1], corner[0]) % (2 * math.pi))
    assert np.histogram(turns, 4, (0.0, 2 * math.pi))[0].min() > 0.1 * len(turns)
    is_tree = country.label == Label.TREE
    parts = parts_of(country.triangles[is_tree])
    colours, at = [], 0
    for part in parts:
        colours.append(country.colour[is_tree][at : at + len(part)].astype(float))
        at += len(part)
    trunks = [colour for colour, part in zip(colours, parts, strict=True) if len(np.unique(part)) == 10]
    assert np.unique(np.concatenate(trunks), axis=0).tolist() == [[86, 68, 52]]
    crowns = [colour for colour, part in zip(colours, parts, strict=True) if len(np.unique(part)) == 30]
    greens = np.unique([crown[0] for crown in crowns], axis=0).tolist()
    assert greens == [[56, 84, 48], [62, 92, 44], [70, 96, 60], [72, 104, 50], [88, 112, 52]]
    for crown in crowns:
        shade = crown[:, 1] / crown[0, 1]
        assert (shade.min(), shade.max()) == pytest.approx((0.92, 1.08), abs=0.02)


def test_half_of_the_cells_in_the_country_and_a_third_in_town_have_a_tree_fewer_away_from_the_road(
    town: Mesh, country: Mesh
) -> None:
    x, y = np.meshgrid(np.arange(-139.5, 540.0), np.arange(-139.5, 140.0))
    away = away_from_road(np.column_stack([x.ravel(), y.ravel()]))
    for mesh, share, free, shadow in ((country, 0.5, 1.5, 0.0), (town, 0.34, 3.4, 0.28)):
        reckoned = share / 121.0 * np.exp(-away[(away > free + 2.3) & (away < 98.0)] / 45.0).sum()
        assert len(trees(mesh)) == pytest.approx((1.0 - shadow) * reckoned, rel=0.08)
        room = [
            (float(away_from_road(trunk.mean(axis=0)[None])[0]) - free)
            / np.ptp(trunk[:, 2])
            * (2.4, 1.4)[len(tops) > 1]
            for trunk, *tops in trees(mesh)
        ]
        assert 2.2 < min(room) < 2.9  # of a size's 2.2 m, the grid leaves some more
    far = [float(away_from_road(trunk.mean(axis=0)[None])[0]) for trunk, *_ in trees(country)]
    assert 90.0 < max(far) < 98.0


def test_no_tree_stands_in_a_house(town: Mesh) -> None:
    houses = [house[:, :2] for house in solids(town, Label.BUILDING)]
    feet = [part.mean(axis=0)[:2] for part in solids(town, Label.TREE) if len(part) == 10]
    for house in houses:
        middle = house.mean(axis=0)
        reach = np.linalg.norm(house - middle, axis=1).max()
        assert min(np.linalg.norm(foot - middle) for foot in feet) > reach + 1.9


def test_street_lamps_stand_36_m_apart_on_the_right_of_a_lane_in_a_town_and_hang_over_it(town: Mesh) -> None:
    poles = [part for part in solids(town, Label.POLE) if np.ptp(part[:, 2]) > 5.0]
    arms = [part for part in solids(town, Label.POLE) if np.ptp(part[:, 2]) < 1.0]
    glasses = solids(town, Label.POLE, Lit.IN_THE_DARK)
    assert len(poles) == len(arms) == len(glasses) == 11
    feet = np.array([pole[:, :2].mean(axis=0) for pole in poles])
    assert feet[:, 0] == pytest.approx(18.0 + 36.0 * np.arange(11), abs=1e-3)
    assert feet[:, 1] == pytest.approx(-EDGE - 1.1, abs=1e-3)
    for pole, arm, glass in zip(poles, arms, glasses, strict=True):
        assert (pole[:, 2].min(), np.ptp(pole[:, 2])) == pytest.approx((-BELOW - 0.1, 7.5), abs=1e-3)
        assert np.ptp(pole[:, 0]) == pytest.approx(2 * 0.09, abs=0.01)
        assert np.ptp(pole[pole[:, 2] > 5.0, 0]) == pytest.approx(2 * 0.05, abs=0.01)
        assert len(pole) == 14
        inwards = (EDGE + 1.1) + arm[:, 1]
        assert (inwards.min(), inwards.max()) == pytest.approx((0.0, 1.7), abs=1e-3)
        inwards = (EDGE + 1.1) + glass[:, 1]
        assert (inwards.min(), inwards.max()) == pytest.approx((1.1, 1.9), abs=1e-3)
        assert np.ptp(arm, axis=0)[[0, 2]] == pytest.approx([0.08, 0.08], abs=1e-3)
        assert np.ptp(glass, axis=0)[[0, 2]] == pytest.approx([0.28, 0.1], abs=1e-3)
        assert glass[:, 2].max() == pytest.approx(7.5 - BELOW - 0.1, abs=1e-3)


def test_lamp_beside_a_slanted_road_hangs_over_it_straight() -> None:
    mesh = static_mesh(map_of(make(a=(line((0, 0), (30, 40)), "")), borders=LINES, crosswalks=PEOPLE), "x", 0)
    (arm,) = [part for part in solids(mesh, Label.POLE) if np.ptp(part[:, 2]) < 1.0]
    foot = np.array([0.6 * 18.0, 0.8 * 18.0]) + (EDGE + 1.1) * np.array([0.8, -0.6])
    along, inwards = (arm[:, :2] - foot) @ (0.6, 0.8), (arm[:, :2] - foot) @ (-0.8, 0.6)
    assert (along.min(), along.max()) == pytest.approx((-0.04, 0.04), abs=1e-3)
    assert (inwards.min(), inwards.max()) == pytest.approx((0.0, 1.7), abs=1e-3)


def test_lamps_of_lanes_side_by_side_are_not_nearer_than_three_fifths_of_their_distance() -> None:
    roads = make(a=(line((0, 0), (100, 0)), ""), b=(line((90, 12), (0, 12)), ""))
    mesh = static_mesh(map_of(roads, borders=LINES, crosswalks=PEOPLE), "x", 0)
    feet = [pole[:, :2].mean(axis=0) for pole in solids(mesh, Label.POLE) if np.ptp(pole[:, 2]) > 5.0]
    apart = min(np.linalg.norm(a - b) for i, a in enumerate(feet) for b in feet[:i])
    assert len(feet) >= 4
    assert 21.6 < apart < 30.0


def test_posts_with_red_caps_stand_beside_country_roads(country: Mesh) -> None:
    parts = solids(country, Label.POLE)
    posts, caps = ([part for part in parts if (np.ptp(part[:, 2]) > 0.5) == is_post] for is_post in (True, False))
    assert len(posts) == len(caps) == 11
    for post, cap in zip(posts, caps, strict=True):
        assert (np.ptp(post[:, 0]), np.ptp(cap[:, 0])) == pytest.approx((0.12, 0.13), abs=1e-3)
        assert len(post) == len(cap) == 12
        assert post[:, 1].mean() == pytest.approx(-EDGE - 1.5, abs=1e-3)
        assert (post[:, 2].min(), np.ptp(post[:, 2])) == pytest.approx((-BELOW - 0.1, 0.95), abs=1e-3)
        assert (cap[:, 2].min() - post[:, 2].max(), np.ptp(cap[:, 2])) == pytest.approx((0.0, 0.13), abs=1e-3)
    colours = np.unique(country.colour[country.label == Label.POLE], axis=0).tolist()
    assert colours == [[200, 60, 40], [206, 204, 198]]


def test_short_lanes_have_neither_lamps_nor_posts_and_the_next_ones_have() -> None:
    mesh = static_mesh(map_of(make(a=(line((0, 0), (17, 0)), "")), borders=LINES), "x", 0)
    assert not (mesh.label == Label.POLE).any()
    roads = make(a=(line((0, 0), (17, 0)), "b"), b=(line((17, 0), (77, 0)), ""))
    posts = solids(static_mesh(map_of(roads, borders=LINES), "x", 0), Label.POLE)
    assert sorted({round(float(post[:, 0].mean())) for post in posts}) == [35, 71]


def test_neither_lamps_nor_posts_stand_on_another_road_or_in_a_narrow_strip_beside_one() -> None:
    beside = make(a=(line((0, 0), (100, 0)), ""), b=(line((0, -6), (100, -6)), ""))
    mesh = static_mesh(map_of(beside, borders=LINES, crosswalks=PEOPLE), "x", 0)
    feet = [pole[:, :2].mean(axis=0) for pole in solids(mesh, Label.POLE) if np.ptp(pole[:, 2]) > 5.0]
    assert sorted((round(float(x)), round(float(y), 3)) for x, y in feet) == [(x, EDGE + 1.1) for x in (18, 54, 90)]
    crossed = make(a=(line((0, 0), (100, 0)), ""), b=(line((54, -50), (54, 50)), ""))
    mesh = static_mesh(map_of(crossed, borders=LINES, crosswalks=PEOPLE), "x", 0)
    feet = [pole[:, :2].mean(axis=0) for pole in solids(mesh, Label.POLE) if np.ptp(pole[:, 2]) > 5.0]
    along = sorted(round(float(x), 2) for x, y in feet if abs(abs(y) - EDGE - 1.1) < 0.01)
    assert along == [18.0, 90.0]


def test_crown_has_four_rings_of_seven_corners_each_turned_a_little_against_the_one_below() -> None:
    vertices, _ = _crown(2.0, 1.5, 6.5, 0.3)
    rings, ends = vertices[:28].reshape(4, 7, 3), vertices[28:]
    assert ends.tolist() == [[0.0, 0.0, 1.5], [0.0, 0.0, 6.5]]
    assert rings[:, :, 2] == pytest.approx(np.tile(np.array([[1.5], [2.9], [4.5], [6.0]]), 7))
    assert np.hypot(rings[:, :, 0], rings[:, :, 1]) == pytest.approx(np.tile(np.array([[0.9], [1.9], [1.8], [0.9]]), 7))
    angles = np.unwrap(np.arctan2(rings[:, :, 1], rings[:, :, 0]), axis=1)
    assert angles[:, 0] == pytest.approx([0.3, 0.5, 0.7, 0.9])
    assert np.diff(angles, axis=1) == pytest.approx(np.full((4, 6), 2 * math.pi / 7))


def test_crown_and_fir_are_closed_or_cones_that_look_outwards() -> None:
    vertices, triangles = _crown(2.0, 1.5, 6.0, 0.3)
    assert is_closed(triangles)
    assert volume_of(vertices, triangles) > 0.5 * math.pi * 4.0 * 4.5 * 0.6
    assert (vertices[:, 2].min(), vertices[:, 2].max()) == (1.5, 6.0)
    assert np.hypot(*vertices[:, :2].T).max() == pytest.approx(0.95 * 2.0)
    other, _ = _crown(2.0, 1.5, 6.0, 0.3 + 2 * math.pi / 7)
    assert sorted(np.round(other[:, 2], 6)) == sorted(np.round(vertices[:, 2], 6))
    vertices, triangles = _fir(1.7, 1.0, 7.4)
    cones = [vertices[np.unique(part)] for part in parts_of(triangles)]
    assert [len(cone) for cone in cones] == [14, 14, 14]
    tops = [np.hypot(*cone[cone[:, 2] > cone[:, 2].mean(), :2].T) for cone in cones]
    assert np.concatenate(tops) == pytest.approx(0.02)
    third = 6.4 / 3
    assert [float(cone[:, 2].min()) for cone in cones] == pytest.approx([1.0 + 0.85 * third * k for k in range(3)])
    assert [float(cone[:, 2].max()) for cone in cones] == pytest.approx([1.0 + third * (k + 1.3) for k in range(3)])
    assert [np.hypot(*cone[:, :2].T).max() for cone in cones] == pytest.approx([1.7, 1.7 * 0.73, 1.7 * 0.46])


def test_things_that_would_meet_give_way_to_the_first() -> None:
    places = np.array([(0.0, 0.0), (15.0, 0.0), (50.0, 50.0), (39.0, 0.0), (41.0, 0.0), (-1.0, 30.0)])
    assert _far_apart(places, np.full(6, 10.0)) == [0, 2, 3, 5]
    assert _far_apart(places[[0, 3]], np.array([19.0, 19.5])) == [0, 1]
    assert _far_apart(places[[0, 3]], np.array([19.0, 20.2])) == [0]
    assert _far_apart(places, np.full(6, 0.5)) == list(range(6))


def test_cells_have_a_place_each_over_the_map_and_140_m_around() -> None:
    roads = make(a=(line((0, 0), (400, 0)), ""))
    found = _cells(roads, 20.0, np.random.default_rng(0))
    assert len(found) == 34 * 14
    cells = np.floor((found - (-140.0, -140.0)) / 20.0)
    assert len(np.unique(cells, axis=0)) == len(found)
    within = (found - (-140.0, -140.0)) / 20.0 - cells
    assert (within.min() >= 0.2, within.max() <= 0.8) == (True, True)
    huge = make(a=(line((0, 0), (100_000, 0)), "b"), b=(line((100_000, 0), (100_000, 100_000)), ""))
    assert 35_000 < len(_cells(huge, 11.0, np.random.default_rng(0))) <= 40_400
