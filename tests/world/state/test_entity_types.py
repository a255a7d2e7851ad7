from __future__ import annotations

import math
from dataclasses import fields

import pytest

from rosbridge_sim.records import replace
from rosbridge_sim.world.state.entity_types import Body


def test_default_car_length_is_the_sum_of_its_parts() -> None:
    body = Body()
    assert body.length == pytest.approx(body.rear_overhang + body.wheelbase + body.front_overhang)
    assert math.degrees(body.max_steer) == pytest.approx(36.25)
    assert body.centre == pytest.approx(1.345)


def test_reference_point_of_a_box_is_its_centre() -> None:
    body = Body.box(0.5, 0.6, 1.75)
    assert (body.length, body.width, body.height, body.wheelbase, body.centre) == (0.5, 0.6, 1.75, 0.0, 0.0)


@pytest.mark.parametrize("name", [field.name for field in fields(Body)])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_non_finite_dimension_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"Body\.{name}: "):
        replace(Body(), **{name: value})


@pytest.mark.parametrize("figures", [{"length": 0.0}, {"width": 0.0}, {"max_steer": math.pi / 2}])
def test_invalid_body_dimensions_are_refused(figures: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="Body"):
        Body(**figures)
