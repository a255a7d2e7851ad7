"""Two-wheelers with their riders, and obstacles: they stand on the ground, hang together and fill their boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.moving.other_shapes import AXLES, obstacle_template, two_wheeler_template
from rosbridge_sim.scenery.moving.template import Template, Tint
from rosbridge_sim.scenery.scene_frame import Shape
from tests.scenery.solid_figures import is_closed, is_mirrored, parts_of, volume_of

TWO_WHEELERS = (Shape.BICYCLE, Shape.MOTORCYCLE)
OBSTACLES = (Shape.BOX, Shape.CONE, Shape.BARREL, Shape.BARRIER)


def corners_of(shape: Template, *tints: Tint) -> np.ndarray:
    return np.asarray(shape.vertices[shape.triangles[np.isin(shape.tints, tints)]].reshape(-1, 3))


@pytest.mark.parametrize(("shape", "radius", "width"), [(Shape.BICYCLE, 0.34, 0.035), (Shape.MOTORCYCLE, 0.31, 0.12)])
def test_wheels_turn_about_the_axles_and_touch_the_ground(shape: Shape, radius: float, width: float) -> None:
    whole = two_wheeler_template(shape)
    rings = parts_of(whole.triangles[whole.tints == Tint.TYRE])
    assert len(rings) == 2
    for ring, x in zip(rings, (0.0, AXLES[shape]), strict=True):
        places = whole.vertices[np.unique(ring)] - (x, 0.0, radius)
        assert np.unique(np.round(np.hypot(places[:, 0], places[:, 2]), 9)) == pytest.approx([0.86 * radius, radius])
        assert np.unique(np.round(places[:, 1], 9)) == pytest.approx([-width / 2, width / 2])
        assert is_closed(ring)
        sides = 0.5 * 14 * math.sin(2 * math.pi / 14) * radius**2
        assert volume_of(whole.vertices, ring) == pytest.approx(sides * (1.0 - 0.86**2) * width)
    assert whole.vertices[:, 2].min() == pytest.approx(0.0, abs=0.01)  # a wheel has fourteen corners


@pytest.mark.parametrize("shape", TWO_WHEELERS)
def test_machine_below_the_rider_is_the_same_on_both_sides_and_looks_outwards(shape: Shape) -> None:
    whole = two_wheeler_template(shape)
    people = (Tint.SKIN, Tint.HAIR, Tint.SECOND)
    for part in parts_of(whole.triangles):
        if is_closed(part):
            assert volume_of(whole.vertices, part) > 0.0
    machine = whole.vertices[np.unique(whole.triangles[np.isin(whole.tints, (Tint.RIM, Tint.TYRE))])]
    assert is_mirrored(machine)
    lamps = {tint: corners_of(whole, tint) for tint in (Tint.HEAD_LAMP, Tint.BRAKE_LAMP)}
    assert lamps[Tint.HEAD_LAMP][:, 0].min() > AXLES[shape] - 0.2
    assert lamps[Tint.BRAKE_LAMP][:, 0].max() < 0.0
    for corners in lamps.values():
        assert np.abs(corners[:, 1]) == pytest.approx(0.05)
        assert (corners[:, 2].min() >= 0.7, corners[:, 2].max() <= 0.88) == (True, True)
    assert np.abs(corners_of(whole, *people)[:, 1]).max() < 0.26
    low, high = whole.vertices.min(axis=0), whole.vertices.max(axis=0)
    assert low == pytest.approx(np.array([-0.34, -0.31, 0.0]), abs=0.05)
    assert high == pytest.approx(np.array([AXLES[shape] + 0.33, 0.31, 1.70]), abs=0.06)


@pytest.mark.parametrize(("shape", "num"), [(Shape.BICYCLE, 926), (Shape.MOTORCYCLE, 746)])
def test_two_wheelers_have_all_their_parts(shape: Shape, num: int) -> None:
    whole = two_wheeler_template(shape)
    assert len(whole.triangles) == num
    tubes = [part for part in parts_of(whole.triangles[whole.tints == Tint.RIM]) if is_closed(part)]
    assert len(tubes) == (7 + 2 * 7 if shape == Shape.BICYCLE else 1)
    if shape == Shape.BICYCLE:
        spokes = [part for part in tubes if np.ptp(whole.vertices[part][..., 1]) < 0.01]
        hubs = whole.vertices[np.unique(np.concatenate(spokes))]
        assert len(spokes) == 14
        away = np.minimum(np.hypot(hubs[:, 0], hubs[:, 2] - 0.34), np.hypot(hubs[:, 0] - 1.05, hubs[:, 2] - 0.34))
        assert ((away < 0.01) | (np.abs(away - 0.9 * 0.34) < 0.01)).all()


@pytest.mark.parametrize("shape", TWO_WHEELERS)
def test_rider_sits_on_the_saddle_with_its_hands_at_the_bar(shape: Shape) -> None:
    whole = two_wheeler_template(shape)
    hips = corners_of(whole, Tint.SECOND)
    hips = hips[np.abs(hips[:, 2] - 0.9) < 0.08]
    assert abs(hips[:, 0].mean() - 0.24) < 0.1
    skin = corners_of(whole, Tint.SKIN)
    hands, head = skin[skin[:, 2] < 1.25], skin[skin[:, 2] > 1.35]
    assert len(hands)
    assert (hands[:, 1].max() > 0.15, hands[:, 1].min() < -0.15) == (True, True)
    assert np.hypot(hands[:, 0] - (AXLES[shape] - 0.2 * AXLES[shape]), hands[:, 2] - 1.02).max() < 0.4
    assert head[:, 0].mean() > hips[:, 0].mean() + 0.15  # it leans forward
    shoes = corners_of(whole, Tint.DARK)
    shoes = shoes[shoes[:, 2] < 0.6]
    assert shoes[:, 2].min() > 0.05  # the feet are off the ground


@pytest.mark.parametrize("shape", OBSTACLES)
def test_obstacle_fills_its_box_on_the_ground(shape: Shape) -> None:
    whole = obstacle_template(shape)
    low, high = whole.vertices.min(axis=0), whole.vertices.max(axis=0)
    assert (low[2], high[2]) == pytest.approx((0.0, 1.0))
    assert low[:2] == pytest.approx([-0.5, -0.5], abs=0.006)
    assert high[:2] == pytest.approx([0.5, 0.5], abs=0.006)
    assert is_mirrored(whole.vertices)
    assert is_mirrored(whole.vertices[:, [1, 0, 2]])
    assert {Tint.PAINT, Tint.SECOND} <= {Tint(int(tint)) for tint in np.unique(whole.tints)}
    for part in parts_of(whole.triangles):
        if is_closed(part):
            assert volume_of(whole.vertices, part) > 0.0


def test_cone_has_bands_one_above_the_other_and_gets_narrower() -> None:
    cone = obstacle_template(Shape.CONE)
    columns = [part for part in parts_of(cone.triangles) if not is_closed(part)]
    ends = [(cone.vertices[part][..., 2].min(), cone.vertices[part][..., 2].max()) for part in columns]
    assert len(columns) == 5
    assert (ends[0][0], ends[-1][1]) == (0.05, 1.0)
    assert [low for low, _ in ends[1:]] == [high for _, high in ends[:-1]]
    for part in columns:
        places = cone.vertices[np.unique(part)]
        assert np.hypot(places[:, 0], places[:, 1]) == pytest.approx(0.36 - 0.30 * places[:, 2])
    assert [cone.tints[(cone.triangles == part[0]).all(axis=1)][0] for part in columns] == [
        *(Tint.PAINT, Tint.SECOND, Tint.PAINT, Tint.SECOND, Tint.PAINT)
    ]


def test_barrel_is_a_column_with_two_hoops() -> None:
    barrel = obstacle_template(Shape.BARREL)
    parts = [barrel.vertices[np.unique(part)] for part in parts_of(barrel.triangles)]
    assert [(part[:, 2].min(), part[:, 2].max()) for part in parts] == [
        *((0.0, 0.30), (0.30, 0.34), (0.34, 0.64), (0.64, 0.68), (0.68, 1.0))
    ]
    assert [np.hypot(*part[0, :2]) for part in parts] == pytest.approx([0.48, 0.5, 0.48, 0.5, 0.48])


def test_barrier_is_broad_at_its_foot_and_slim_above() -> None:
    barrier = obstacle_template(Shape.BARRIER)
    corners = barrier.vertices

    def width(low: float, high: float) -> float:
        return float(np.ptp(corners[(corners[:, 2] >= low) & (corners[:, 2] <= high), 1]))

    assert [width(0.0, 0.2), width(0.95, 1.0)] == pytest.approx([1.0, 0.84 * 0.45])
    band = corners_of(barrier, Tint.SECOND)
    assert np.ptp(band, axis=0) == pytest.approx([1.0, 0.4, 0.12])


def test_box_has_two_straps_around_it() -> None:
    box = obstacle_template(Shape.BOX)
    straps = corners_of(box, Tint.SECOND)
    assert np.unique(np.round(straps[:, 2], 9)).tolist() == [0.02, 0.10, 0.90, 0.98]
    assert np.abs(straps[:, :2]) == pytest.approx(0.505)
