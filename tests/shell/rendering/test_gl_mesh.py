"""Shadows below entities, as triangles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.shell.rendering.gl_mesh import SHADOW_LIFT, SHADOW_MARGIN, _shadows
from rosbridge_sim.world.state.world import World
from tests.shell.rendering.graphics import model, nothing, put


def test_shadow_reaches_a_margin_beyond_the_box_of_its_entity_and_turns_with_it() -> None:
    world, name = World(), "2016_Hyundai_Ioniq"
    put(world, name, 20.0, 30.0, yaw=0.5 * math.pi)  # it looks to the north
    corners = _shadows(take_frame(world), np.array([5.0, 10.0, 0.0]))
    body = model(name).body
    half = np.array([0.5 * body.length + SHADOW_MARGIN, 0.5 * body.width + SHADOW_MARGIN])
    middle = np.array([15.0, 20.0 + body.centre])
    assert corners.shape == (6, 5)
    assert corners[:, :2].min(axis=0) == pytest.approx(middle - half[::-1])
    assert corners[:, :2].max(axis=0) == pytest.approx(middle + half[::-1])
    assert corners[:, 2] == pytest.approx(SHADOW_LIFT)
    # Ahead is the first of both places within the shadow, left the second one.
    assert corners[:, 1] == pytest.approx(middle[1] + corners[:, 3] * half[0])
    assert corners[:, 0] == pytest.approx(middle[0] - corners[:, 4] * half[1])
    assert sorted(set(map(tuple, corners[:, 3:].tolist()))) == [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]


def test_nothing_has_no_shadow() -> None:
    assert _shadows(nothing(), np.zeros(3)).shape == (0, 5)
