"""Paint on roads: its areas, places, colours and heights, on straight roads made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.maps.road_map import Border, Crosswalk
from rosbridge_sim.scenery.lines import cut_dashes
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_paint import add_paint, four_corners
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from tests.scenery.static.small_scenes import area, corners, map_of, thing
from tests.world.road_factory import line, make, road

AWAY = line((0, 50), (10, 50))
"""A line of paint that is far from the others: a map with one gets no guessed lines."""


def painted(*borders: Border, roads: Roads | None = None, crosswalks: tuple[Crosswalk, ...] = ()) -> Mesh:
    builder = MeshBuilder(np.zeros(3))
    roads = road(100.0) if roads is None else roads
    add_paint(builder, map_of(roads, borders=borders, crosswalks=crosswalks), RoadCover(roads))
    return builder.finish()


@pytest.mark.parametrize(
    ("colour", "label", "rgb"),
    [
        ((), Label.PAINT_WHITE, (236, 233, 229)),
        (("white",), Label.PAINT_WHITE, (236, 233, 229)),
        (("Yellow",), Label.PAINT_YELLOW, (224, 188, 50)),
        (("BLUE",), Label.PAINT_BLUE, (44, 92, 190)),
        (("red",), Label.PAINT_WHITE, (236, 233, 229)),
    ],
)
def test_solid_line_is_15_cm_wide_just_above_the_road_in_its_colour(
    colour: tuple[str, ...], label: Label, rgb: tuple[int, int, int]
) -> None:
    mesh = painted(Border("", line((0, 1), (40, 1), z=2.0), 501, ("Solid",), colour))
    assert set(mesh.label.tolist()) == {label}
    assert np.unique(mesh.colour, axis=0).tolist() == [list(rgb)]
    assert thing(mesh, label) == ([0.0, 0.925, 2.004], [40.0, 1.075, 2.004])
    assert area(mesh, label) == pytest.approx(40.0 * 0.15)


@pytest.mark.parametrize(("limit", "dash", "gap"), [(15.0, 3.0, 5.0), (22.2, 3.0, 5.0), (80 / 3.6, 10.0, 10.0)])
def test_broken_line_has_the_dashes_of_its_kind_of_road(limit: float, dash: float, gap: float) -> None:
    mesh = painted(Border("", line((0, 1), (80, 1)), 503, ("Broken",)), roads=road(100.0, limit))
    assert area(mesh, Label.PAINT_WHITE) == pytest.approx(80.0 * 0.15 * dash / (dash + gap))
    ends = corners(mesh, Label.PAINT_WHITE)[..., 0]
    assert ends.min() == pytest.approx(0.5 * gap)
    assert ends.max() == pytest.approx(80.0 - 0.5 * gap)


def test_double_line_has_one_line_to_each_side_with_a_look_of_its_own() -> None:
    mesh = painted(Border("", line((0, 0), (80, 0)), 501, ("Solid", "Broken", "Solid"), ("yellow", "white")))
    left, right = corners(mesh, Label.PAINT_YELLOW), corners(mesh, Label.PAINT_WHITE)
    assert (left[..., 1].min(), left[..., 1].max()) == pytest.approx((0.05, 0.2))
    assert (right[..., 1].min(), right[..., 1].max()) == pytest.approx((-0.2, -0.05))
    assert area(mesh, Label.PAINT_YELLOW) == pytest.approx(80.0 * 0.15)
    assert area(mesh, Label.PAINT_WHITE) == pytest.approx(80.0 * 0.15 * 3 / 8)
    both = painted(Border("", line((0, 0), (80, 0)), 501, ("Solid", "Solid"), ("yellow",)))
    assert area(both, Label.PAINT_YELLOW) == pytest.approx(2 * 80.0 * 0.15)


def test_line_without_a_shape_is_solid_and_a_kerb_is_not_painted() -> None:
    mesh = painted(Border("", line((0, 0), (80, 0)), 501), *(Border("", AWAY, kind) for kind in (598, 599)))
    assert area(mesh, Label.PAINT_WHITE) == pytest.approx(80.0 * 0.15)
    assert corners(mesh, Label.PAINT_WHITE)[..., 1].max() < 1.0


def test_bend_of_a_line_keeps_its_width() -> None:
    angle = np.linspace(0.0, np.pi / 2, 60)
    arc = np.column_stack([30.0 * np.sin(angle), 30.0 - 30.0 * np.cos(angle), 0.0 * angle])
    mesh = painted(Border("", arc, 501, ("Solid",)))
    away = np.hypot(*(corners(mesh, Label.PAINT_WHITE).reshape(-1, 3)[:, :2] - (0.0, 30.0)).T)
    assert (away.min(), away.max()) == pytest.approx((29.925, 30.075), abs=0.001)
    assert area(mesh, Label.PAINT_WHITE) == pytest.approx(30.0 * np.pi / 2 * 0.15, rel=1e-3)


def stops(*borders: Border, is_stop: bool = True, width: float = 3.5) -> Mesh:
    ways = line((0, 0), (40, 0), z=1.0), line((40, 0), (80, 0), z=1.0)
    roads = Roads(["a", "b"], ways, [[1], []], [width, width], [15.0, 15.0], is_stop=[is_stop, False])
    return painted(Border("", AWAY, 501), *borders, roads=roads)


def test_lane_with_a_stop_gets_a_stop_line_across_its_end() -> None:
    assert thing(stops(), Label.STOP_LINE) == ([39.5, -1.75, 1.004], [40.0, 1.75, 1.004])
    assert area(stops(), Label.STOP_LINE) == pytest.approx(0.5 * 3.5)
    assert not (stops(is_stop=False).label == Label.STOP_LINE).any()


@pytest.mark.parametrize(("at", "num"), [(39.75, 1), (36.0, 1), (44.9, 1), (46.5, 2), (33.0, 2)])
def test_stop_line_of_the_map_is_painted_once(at: float, num: int) -> None:
    mesh = stops(Border("", line((at, -1.75), (at, 1.75), z=1.0), 530, ("Solid",)))
    assert area(mesh, Label.STOP_LINE) == pytest.approx(num * 0.5 * 3.5)
    assert np.unique(mesh.colour[mesh.label == Label.STOP_LINE], axis=0).tolist() == [[236, 233, 229]]


def test_stop_line_of_the_map_across_three_lanes_counts_for_the_one_in_the_middle() -> None:
    mesh = stops(Border("", line((39.75, -5.25), (39.75, 5.25), z=1.0), 530, ("Solid",)))
    assert area(mesh, Label.STOP_LINE) == pytest.approx(0.5 * 10.5)


def test_stop_of_another_lane_is_painted_beside_one_of_the_map() -> None:
    ways = [line((0, y), (40, y)) for y in (0.0, 30.0)]
    roads = Roads(["a", "b"], ways, [[], []], [3.5, 3.5], [15.0, 15.0], is_stop=[True, True])
    mesh = painted(Border("", line((39.75, -1.75), (39.75, 1.75)), 530, ("Solid",)), roads=roads)
    assert area(mesh, Label.STOP_LINE) == pytest.approx(2 * 0.5 * 3.5)
    assert corners(mesh, Label.STOP_LINE)[..., 1].max() == pytest.approx(31.75)


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("is_reversed", [False, True])
def test_crosswalk_has_bars_along_the_road_as_far_as_it_is_long(turn: int, is_reversed: bool) -> None:  # noqa: FBT001 - of the table
    outline = line((10, -5), (14, -5), (14, 5), (10, 5), z=0.5)
    outline = np.roll(outline[::-1] if is_reversed else outline, turn, axis=0)
    mesh = painted(Border("", AWAY, 501), crosswalks=(Crosswalk("", (outline,)),))
    assert thing(mesh, Label.CROSSWALK) == ([10.0, -4.75, 0.506], [14.0, 4.75, 0.506])
    assert area(mesh, Label.CROSSWALK) == pytest.approx(4.0 * 10.0 / 2)
    edges = np.unique(np.round(corners(mesh, Label.CROSSWALK)[..., 1], 3))
    assert edges.tolist() == (np.arange(-4.75, 5.0, 0.5)).tolist()


SLANTED = np.array([[0.8, 0.6], [-0.6, 0.8]])


@pytest.mark.parametrize(
    "outline",
    [
        [(0, 0), (6, 0), (6, 3), (3, 3), (0, 3)],  # a point too many
        [(0, 0), (6, 0), (6, 3), (5, 2.5), (4, 3), (0, 3), (0, 0)],
        [(0, 0), (0, 3), (1, 3), (6, 3), (6, 0)],
    ],
)
def test_outline_of_any_number_of_corners_becomes_the_box_along_its_longest_side(
    outline: list[tuple[float, float]],
) -> None:
    flat = np.array(outline, dtype=np.float64) @ SLANTED
    found = four_corners(np.column_stack([flat, np.arange(len(flat)) * 0.0 + 2.0]))
    assert found is not None
    back = found[:, :2] @ SLANTED.T
    assert sorted(map(tuple, np.abs(back.round(6)).tolist())) == [(0.0, 0.0), (0.0, 3.0), (6.0, 0.0), (6.0, 3.0)]
    assert found[:, 2].tolist() == [2.0] * 4


def test_box_of_an_outline_has_the_height_of_its_nearest_corner() -> None:
    outline = np.array([(0, 0, 1), (6, 0, 2), (6, 3, 3), (3, 3, 9), (0, 3, 4)], dtype=np.float64)
    found = four_corners(outline)
    assert found is not None
    assert dict(zip(map(tuple, found[:, :2].round(6).tolist()), found[:, 2].tolist(), strict=True)) == {
        (0.0, 0.0): 1.0,
        (6.0, 0.0): 2.0,
        (6.0, 3.0): 3.0,
        (0.0, 3.0): 4.0,
    }
    assert four_corners(outline[:2]) is None
    assert four_corners(np.concatenate([outline[:2], outline[:1]])) is None
    quad = outline[[0, 1, 2, 4]]
    for given in (quad, np.concatenate([quad, quad[:1]])):
        assert np.array_equal(four_corners(given), quad)  # type: ignore[arg-type]


def test_two_roads_with_oncoming_traffic_get_yellow_between_them_and_white_outside() -> None:
    roads = make(there=(line((0, 0), (100, 0)), ""), back=(line((100, 3.5), (0, 3.5)), ""))
    mesh = painted(roads=roads)
    yellow, white = corners(mesh, Label.PAINT_YELLOW), corners(mesh, Label.PAINT_WHITE)
    assert yellow[..., 1].mean() == pytest.approx(1.75)
    assert area(mesh, Label.PAINT_YELLOW) == pytest.approx(2 * 100.0 * 0.15)  # each lane paints its own left edge
    assert np.unique(np.round(white[..., 1].mean(axis=1))).tolist() == [-2.0, 5.0]
    assert area(mesh, Label.PAINT_WHITE) == pytest.approx(2 * 100.0 * 0.15)


def test_lanes_of_one_direction_have_a_broken_line_between_them_that_one_of_them_paints() -> None:
    roads = make(right=(line((0, 0), (80, 0)), ""), left=(line((0, 3.5), (80, 3.5)), ""))
    mesh = painted(roads=roads)
    middles = corners(mesh, Label.PAINT_WHITE)[..., 1].mean(axis=1)
    between = corners(mesh, Label.PAINT_WHITE)[np.abs(middles - 1.75) < 0.2]
    assert np.ptp(between[..., 0]) == pytest.approx(75.0)
    assert area(mesh, Label.PAINT_WHITE) == pytest.approx(80.0 * 0.15 * (2 + 3 / 8))


def test_dashes_begin_and_end_with_half_a_gap_and_are_stretched_to_fit() -> None:
    assert cut_dashes(16.0, 3.0, 5.0).tolist() == [[2.5, 5.5], [10.5, 13.5]]
    assert cut_dashes(2.0, 3.0, 5.0).tolist() == [[0.625, 1.375]]
    stretched: FloatArray = cut_dashes(18.0, 3.0, 5.0)
    assert np.diff(stretched, axis=1).ravel() == pytest.approx(9.0 * 3 / 8)
