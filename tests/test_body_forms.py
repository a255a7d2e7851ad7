"""Bodies for viewers are the shapes that cameras see."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.scenery.moving.template import Tint
from rosbridge_sim.scenery.moving.vehicle_shapes import vehicle_template
from rosbridge_sim.scenery.scene_frame import Shape
from scripts.drawing.body_forms import BODY_PARTS, body_forms


@pytest.mark.parametrize("name", [*(shape.name.lower() for shape in Shape), "far"])
def test_form_lies_in_its_box_and_each_triangle_has_a_part(name: str) -> None:
    form = body_forms()[name]
    corners = np.array(form["vertices"]).reshape(-1, 3)
    rows = np.array(form["triangles"]).reshape(-1, 3)
    assert (np.abs(corners[:, :2]) <= 500).all()
    assert corners[:, 2].min() >= 0
    assert corners[:, 2].max() in range(900, 1001)
    assert (rows.min(), rows.max()) == (0, len(corners) - 1)
    assert len(form["parts"]) == len(rows)
    assert set(form["parts"]) <= {*BODY_PARTS.values(), 5}


def test_car_has_the_body_and_the_lamps_of_the_camera_and_four_wheels() -> None:
    form, seen = body_forms()["car"], vehicle_template(Shape.CAR)
    parts = np.array(form["parts"])
    for tint in (Tint.BRAKE_LAMP, Tint.LEFT_LAMP, Tint.GLASS):
        assert np.count_nonzero(parts == BODY_PARTS[tint]) == np.count_nonzero(seen.tints == tint)
    corners = np.array(form["vertices"]).reshape(-1, 3)[np.array(form["triangles"]).reshape(-1, 3)]
    low = corners[(corners[:, :, 2] < 20).any(axis=1)].mean(axis=1)  # what touches the road
    assert {(bool(x > 0), bool(y > 0)) for x, y, _ in low} == {(a, b) for a in (False, True) for b in (False, True)}
