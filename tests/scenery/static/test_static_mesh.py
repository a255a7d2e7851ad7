"""Maps as triangles."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rosbridge_sim.maps.road_map import Border, Crosswalk, RoadMap
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.loose_paint import LoosePaint
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_paint import add_paint
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.roads.surface import Surface
from tests.scenery.solid_figures import area_seen_from_above
from tests.scenery.static.small_scenes import map_of as small_map
from tests.world.road_factory import line, make

PAINT = (Label.PAINT_WHITE, Label.PAINT_YELLOW, Label.CROSSWALK, Label.STOP_LINE)


@cache
def map_of(name: str) -> RoadMap:
    return DiskLibrary().map(name)


def places_of(mesh: Mesh, *labels: Label) -> np.ndarray:
    """(k, 3, 3) corners of the triangles of some classes, map frame."""
    return mesh.vertices[mesh.triangles[np.isin(mesh.label, labels)]].astype(np.float64) + mesh.origin


@cache
def dressed(name: str) -> Mesh:
    return static_mesh(map_of(name), name, 0)


@cache
def bare(road_map: RoadMap) -> Mesh:
    return static_mesh(road_map, road_map.name, 0, is_dressed=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["town", "hills", "parking", "roundabout", "track"])
def test_everything_beside_the_roads_leaves_them_free(name: str) -> None:
    road_map = map_of(name)
    mesh = dressed(name)
    cover = RoadCover(road_map.roads)
    # Foot and trunk level: crowns, arms and lamps may be above a road.
    corners = places_of(mesh, Label.BUILDING, Label.TREE, Label.POLE).reshape(-1, 3)
    height = corners[:, 2] - cover.height(corners)
    low = corners[height < 1.0]
    assert len(low) > 100
    assert not cover.is_on(low).any()


@pytest.mark.slow
def test_dressing_follows_from_name_and_seed() -> None:
    def street() -> RoadMap:
        crosswalk = Crosswalk("", (line((40, -2), (44, -2), (44, 2), (40, 2)),))
        return small_map(make(a=(line((0, 0), (100, 0)), "")), crosswalks=(crosswalk,))

    one = static_mesh(street(), "name", 0)
    assert np.isin([Label.BUILDING, Label.TREE], one.label).all()
    assert one.digest == static_mesh(street(), "name", 0).digest
    assert one.digest != static_mesh(street(), "name", 1).digest
    assert one.digest != static_mesh(street(), "other", 0).digest
    assert not np.isin(static_mesh(street(), "name", 0, is_dressed=False).label, [Label.BUILDING, Label.TREE]).any()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hills", "town"])
def test_roads_and_paint_follow_the_surface_of_the_world(name: str) -> None:
    road_map = map_of(name)
    mesh = bare(road_map)
    surface = road_map.roads.derived(Surface)
    cover = RoadCover(road_map.roads)
    for labels, bound in (((Label.ASPHALT,), 0.06), (PAINT, 0.08)):
        middle = places_of(mesh, *labels).mean(axis=1)
        middle = middle[cover.is_on(middle)]
        ground = surface.find(middle[:, 0].copy(), middle[:, 1].copy(), middle[:, 2].copy()).height
        assert len(middle) > 500
        assert np.quantile(np.abs(middle[:, 2] - ground), 0.99) < bound


@pytest.mark.slow
def test_ground_of_hills_is_below_its_roads() -> None:
    road_map = map_of("hills")
    mesh = bare(road_map)
    corners = places_of(mesh, Label.GROUND).mean(axis=1)
    cover = RoadCover(road_map.roads)
    near = corners[cover.is_on(corners)]
    assert len(near) > 100
    assert (near[:, 2] < cover.height(near)).all()


@pytest.mark.slow
def test_strips_are_cut_into_pieces_of_ten_metres() -> None:
    corners = places_of(bare(map_of("track")), Label.ASPHALT, *PAINT)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert sides.max() < 12.0


@pytest.mark.slow
def test_town_has_paint_of_its_lines_and_no_kerb_across_a_lane() -> None:
    road_map = map_of("town")
    mesh = bare(road_map)
    for label in (*PAINT, Label.ASPHALT, Label.KERB, Label.PAVEMENT, Label.TRAFFIC_LIGHT, Label.POLE):
        assert (mesh.label == label).any(), label.name
    cover = RoadCover(road_map.roads)
    kerbs = places_of(mesh, Label.KERB).mean(axis=1)
    assert cover.is_on(kerbs).mean() < 0.002


@pytest.mark.slow
def test_crossing_of_the_town_has_no_island_between_its_lanes() -> None:
    road_map = map_of("town")
    cover = RoadCover(road_map.roads)
    middles = places_of(bare(road_map), Label.PAVEMENT, Label.KERB).mean(axis=1)
    near = middles[np.hypot(middles[:, 0], middles[:, 1]) < 40.0]  # of the crossing in the middle of the map
    assert len(near) > 300
    is_enclosed = np.ones(len(near), dtype=bool)
    for angle in np.arange(8) * np.pi / 4:
        ray = np.array([np.cos(angle), np.sin(angle), 0.0])
        is_enclosed &= np.any([cover.is_on(near + distance * ray) for distance in range(1, 13)], axis=0)
    assert not is_enclosed.any()


@pytest.mark.slow
def test_crossing_of_the_town_is_asphalt_between_its_turns() -> None:
    corners = places_of(bare(map_of("town")), Label.ASPHALT)[..., :2]
    near = corners[(np.abs(corners).min(axis=1) < 14.0).all(axis=1)]
    x, y = np.meshgrid(np.arange(-11.0, 11.1, 0.25), np.arange(-11.0, 11.1, 0.25))
    places = np.column_stack([x.ravel(), y.ravel()])
    places = places[np.abs(places).min(axis=1) < 6.5]  # the roads that meet are 14 m wide
    is_paved = np.zeros(len(places), dtype=bool)
    for a, b, c in near:
        pairs = ((a, b), (b, c), (c, a))
        sides = [(q - p)[0] * (places - p)[:, 1] - (q - p)[1] * (places - p)[:, 0] for p, q in pairs]
        is_paved |= np.all([side >= -1e-6 for side in sides], axis=0) | np.all([side <= 1e-6 for side in sides], axis=0)
    assert is_paved.all()


def test_map_without_lines_gets_them_from_its_lanes() -> None:
    roads = make(
        right=(line((0, 0), (100, 0)), ""), left=(line((0, 3.5), (100, 3.5)), ""), back=(line((100, 7), (0, 7)), "")
    )
    road_map = RoadMap("own", DiskLibrary().map("loop").projection, (0.0, 0.0, 0.0), roads)
    builder = MeshBuilder(np.zeros(3))
    add_paint(builder, road_map, RoadCover(roads))
    mesh = builder.finish()
    width = roads.width[0]
    yellow = places_of(mesh, Label.PAINT_YELLOW)[..., 1]
    assert yellow.mean() == pytest.approx(3.5 + width / 2, abs=0.1)
    white = places_of(mesh, Label.PAINT_WHITE)[..., 1].mean(axis=1)
    assert {round(value) for value in white.tolist()} == {round(-width / 2), round(width / 2), round(7 + width / 2)}


@pytest.mark.slow
def test_crosswalk_of_any_size_has_few_triangles() -> None:
    roads = make(a=(line((0, 0), (20, 0)), ""))
    outline = line((-1e6, 0), (1e6, 0), (1e6, 2e6), (-1e6, 2e6))
    crosswalk, lines = Crosswalk("", (outline,)), (Border("", line((0, 5), (1e6, 5)), 501, ("Solid",)),)
    road_map = RoadMap("own", map_of("loop").projection, (0.0, 0.0, 0.0), roads)
    paint = LoosePaint(replace(road_map, crosswalks=(crosswalk,), borders=lines), RoadCover(roads))
    builder = MeshBuilder(np.zeros(3))
    paint.add_asphalt(builder)
    assert 80_000 < len(builder.finish()) < 300_000
    assert paint.is_near(np.array([(30.0, 5.5, 0.0), (30.0, -2.0, 0.0), (30.0, 5.5, 9.0)])).tolist() == [
        True,
        False,
        False,
    ]


@pytest.mark.parametrize("step", [1, -1])
def test_crosswalk_beside_the_lanes_lies_on_asphalt_that_looks_up(step: int) -> None:
    roads = make(a=(line((0, 0), (20, 0)), ""))
    outline = line((8, -6), (12, -6), (12, 6), (8, 6))[::step]
    road_map = RoadMap("own", map_of("loop").projection, (0.0, 0.0, 0.0), roads)
    paint = LoosePaint(replace(road_map, crosswalks=(Crosswalk("", (outline,)),)), RoadCover(roads))
    builder = MeshBuilder(np.zeros(3))
    paint.add_asphalt(builder)
    mesh = builder.finish()
    assert (mesh.normals[:, 2] > 0.99).all()
    places = places_of(mesh, Label.ASPHALT)
    # Pieces of half a metre whose middle is not on the asphalt of the lane, 1.9 m from its line.
    assert np.abs(places[..., 1].mean(axis=1)).min() > 1.75
    assert area_seen_from_above(mesh.vertices, mesh.triangles) == pytest.approx(4.0 * 2 * 4.0)


def test_map_without_roads_has_no_triangles() -> None:
    empty = RoadMap("own", DiskLibrary().map("loop").projection, (0.0, 0.0, 0.0), make())
    assert len(static_mesh(empty, "own", 0)) == 0
