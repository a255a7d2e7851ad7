"""Bodies of vehicles: within their boxes, the same on both sides, with all their parts, which look outwards."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbridge_sim.scenery.moving.template import Profile, Template, TemplateBuilder, Tint
from rosbridge_sim.scenery.moving.vehicle_shapes import _MAKERS, TRACK, WHEELS, vehicle_template, wheel_template
from rosbridge_sim.scenery.scene_frame import Shape
from tests.scenery.solid_figures import is_closed, is_mirrored, parts_of, volume_of

SHAPES = [(shape, is_coarse) for shape in _MAKERS for is_coarse in (False, True)]

LAMPS = (Tint.HEAD_LAMP, Tint.BRAKE_LAMP, Tint.LEFT_LAMP, Tint.RIGHT_LAMP, Tint.REVERSE_LAMP)


def drawn(shape: Shape, *, is_coarse: bool = False) -> Template:
    """The body as it is drawn, before it is cut to its box."""
    builder = TemplateBuilder(is_coarse=is_coarse)
    _MAKERS[shape](builder)
    return builder.finish()


def middles_of(body: Template, tint: Tint) -> np.ndarray:
    return np.asarray(body.vertices[body.triangles[body.tints == tint]].mean(axis=1))


@pytest.mark.parametrize(("shape", "is_coarse"), SHAPES)
def test_body_is_drawn_within_its_box_but_for_lamps_and_mirrors(shape: Shape, is_coarse: bool) -> None:  # noqa: FBT001 - of the table
    low, high = (edge(drawn(shape, is_coarse=is_coarse).vertices, axis=0) for edge in (np.min, np.max))
    assert (low >= (-0.508, -0.56, 0.08)).all()
    assert (high <= (0.508, 0.56, 1.0)).all()
    assert high[0] - low[0] >= 1.0
    assert high[1] - low[1] >= 0.97
    assert (low[2] < 0.21, high[2]) == (True, 1.0)
    body = vehicle_template(shape, is_coarse=is_coarse).vertices
    assert (np.abs(body[:, :2]).max(axis=0) <= 0.5).all()
    assert np.abs(body[:, 0]).max() == 0.5


@pytest.mark.parametrize(("shape", "is_coarse"), SHAPES)
def test_body_is_the_same_on_both_sides_but_for_the_doors_of_a_bus(shape: Shape, is_coarse: bool) -> None:  # noqa: FBT001 - of the table
    body = drawn(shape, is_coarse=is_coarse)
    if shape == Shape.BUS:
        doors = [
            part
            for part in parts_of(body.triangles)
            if np.allclose(body.vertices[part].min(axis=(0, 1))[1:], (-0.5, 0.12))
        ]
        assert len(doors) == 2
        left_out = np.unique(np.concatenate(doors))
        assert body.vertices[left_out, 1].max() < -0.48
        assert is_mirrored(np.delete(body.vertices, left_out, axis=0))
    else:
        assert is_mirrored(body.vertices)


@pytest.mark.parametrize(("shape", "is_coarse"), SHAPES)
def test_each_part_of_a_body_is_a_solid_that_looks_outwards_or_a_plate_that_looks_away(
    shape: Shape,
    is_coarse: bool,  # noqa: FBT001 - of the table
) -> None:
    body = drawn(shape, is_coarse=is_coarse)
    for part in parts_of(body.triangles):
        if is_closed(part):
            assert volume_of(body.vertices, part) > 1e-6
            continue
        a, b, c = (body.vertices[part[:, i]] for i in range(3))
        looks, place = np.cross(b - a, c - a).sum(axis=0), body.vertices[part].mean(axis=(0, 1))
        axis = int(np.abs(looks).argmax())  # ahead, back or to a side
        assert looks[axis] * place[axis] > 0.0


@pytest.mark.parametrize(
    ("shape", "nums"),
    [(Shape.CAR, (300, 104)), (Shape.VAN, (224, 100)), (Shape.TRUCK, (280, 156)), (Shape.BUS, (432, 308))],
)
def test_bodies_have_few_triangles_and_far_ones_fewer(shape: Shape, nums: tuple[int, int]) -> None:
    assert tuple(len(drawn(shape, is_coarse=is_coarse).triangles) for is_coarse in (False, True)) == nums


@pytest.mark.parametrize(("shape", "is_coarse"), SHAPES)
def test_lamps_and_plates_are_where_they_belong(shape: Shape, is_coarse: bool) -> None:  # noqa: FBT001 - of the table
    body = drawn(shape, is_coarse=is_coarse)
    for tint in LAMPS:
        middles = middles_of(body, tint)
        is_third = middles[:, 2] > 0.8  # brake lamp behind the rear window
        assert is_third.any() == (tint == Tint.BRAKE_LAMP and shape == Shape.CAR and not is_coarse)
        middles = middles[~is_third]
        assert (middles[:, 0] > 0.43).any() == (tint in {Tint.HEAD_LAMP, Tint.LEFT_LAMP, Tint.RIGHT_LAMP})
        assert (middles[:, 0] < -0.43).any() == (tint != Tint.HEAD_LAMP)
        assert (np.abs(middles[:, 0]) > 0.38).all()
        assert (middles[:, 1] > 0.2).any() == (tint != Tint.RIGHT_LAMP)
        assert (middles[:, 1] < -0.2).any() == (tint != Tint.LEFT_LAMP)
        assert (np.abs(middles[:, 1]) > 0.25).all()
        assert middles[:, 2].min() > 0.13
        assert middles[:, 2].max() < 0.6
        places = body.vertices[body.triangles[body.tints == tint]][..., 0]
        if tint != Tint.HEAD_LAMP:
            assert places.min() == pytest.approx(-0.503)  # it stands out from the rear
    plates = middles_of(body, Tint.PLATE)
    assert len(plates) == (0 if is_coarse else 24)
    if not is_coarse:
        assert (plates[:, 0].min() < -0.48, plates[:, 0].max() > 0.48) == (True, True)


@pytest.mark.parametrize(("shape", "is_coarse"), SHAPES)
def test_side_views_are_seen_whole_from_their_first_point_as_their_triangles_need(
    shape: Shape,
    is_coarse: bool,  # noqa: FBT001 - of the table
) -> None:
    found: list[bool] = []

    class Watched(TemplateBuilder):
        def extrude(self, profile: Profile, sides: Tint) -> None:
            first, *others = (complex(along, up) for along, up, _, _ in profile)
            ways = [other - first for other in others]
            found.append(all((a.conjugate() * b).imag < 0.0 for a, b in pairwise(ways)))
            super().extrude(profile, sides)

    _MAKERS[shape](Watched(is_coarse=is_coarse))
    assert found
    assert all(found)


@pytest.mark.parametrize(("is_coarse", "sides"), [(False, 10), (True, 6)])
def test_wheel_is_a_round_open_drum_with_a_rim_outside(is_coarse: bool, sides: int) -> None:  # noqa: FBT001 - of the table
    wheel = wheel_template(is_coarse=is_coarse)
    area = 0.5 * sides * math.sin(2 * math.pi / sides)
    tyre = wheel.triangles[wheel.tints == Tint.TYRE]
    fan = np.array([[0, i, i + 1] for i in range(1, sides - 1)])  # closes the inner side
    assert volume_of(wheel.vertices, np.concatenate([tyre, fan])) == pytest.approx(area)
    assert np.hypot(wheel.vertices[:, 0], wheel.vertices[:, 2]).max() == pytest.approx(1.0)
    rim = wheel.vertices[wheel.triangles[wheel.tints == Tint.RIM]]
    assert len(rim) == (0 if is_coarse else sides - 2)
    assert np.allclose(rim[..., 1], 0.53)
    assert np.allclose(np.hypot(rim[..., 0], rim[..., 2]), 0.62)
    if len(rim):
        assert (np.cross(rim[:, 1] - rim[:, 0], rim[:, 2] - rim[:, 0])[:, 1] > 0.0).all()


def test_wheels_stand_within_the_body() -> None:
    for shape, (radius, thick) in WHEELS.items():
        assert 0.14 < radius < 0.23, shape
        assert TRACK + thick < 1.0
