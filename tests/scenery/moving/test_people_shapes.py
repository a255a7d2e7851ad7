"""People: proportions, closed limbs, and a walk in which arms and legs swing against each other."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.scenery.moving.people_shapes import (
    STRIDE,
    SWING,
    _loft,
    figure_limbs,
    pose_figure,
    trunk_template,
    walking_angles,
)
from rosbridge_sim.scenery.moving.template import Template, Tint
from tests.scenery.solid_figures import is_closed, is_mirrored, parts_of, volume_of

STANDING = np.zeros((1, 8))


def figure(angles: np.ndarray = STANDING) -> tuple[np.ndarray, Template]:
    vertices, template = pose_figure(angles)
    return vertices[0], template


def corners(tint: Tint, angles: np.ndarray = STANDING) -> np.ndarray:
    vertices, template = figure(angles)
    return np.asarray(vertices[template.triangles[template.tints == tint]].reshape(-1, 3))


def test_figure_stands_on_the_ground_with_height_one_and_is_the_same_on_both_sides() -> None:
    vertices, template = figure()
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert (low[2], high[2]) == pytest.approx((0.0, 1.0))
    assert (low[1], high[1]) == pytest.approx((-0.161, 0.161), abs=0.002)  # 0.55 m for 1.7 m
    assert (low[0], high[0]) == pytest.approx((-0.077, 0.095), abs=0.005)  # heads are a bit behind, shoes ahead
    assert abs(vertices[:, 1].mean()) < 1e-3
    assert len(template.triangles) == len(template.tints)


def test_parts_of_a_figure_are_where_they_belong() -> None:
    shoes, trousers, shirt = (corners(tint) for tint in (Tint.DARK, Tint.SECOND, Tint.PAINT))
    skin, hair = corners(Tint.SKIN), corners(Tint.HAIR)
    assert (shoes[:, 2].min(), shoes[:, 2].max()) == pytest.approx((0.0, 0.04))
    assert (trousers[:, 2].min(), trousers[:, 2].max()) == pytest.approx((0.035, 0.585))
    assert (shirt[:, 2].min(), shirt[:, 2].max()) == pytest.approx((0.49, 0.855))
    assert (skin[:, 2].min(), skin[:, 2].max()) == pytest.approx((0.43, 0.995))
    assert (hair[:, 2].min(), hair[:, 2].max()) == pytest.approx((0.885, 1.0))
    assert hair[:, 0].min() < skin[skin[:, 2] > 0.8][:, 0].min()  # it is behind the face
    assert hair[:, 0].max() < skin[skin[:, 2] > 0.8][:, 0].max() + 0.005
    assert np.abs(hair[:, 1]).max() < 0.06


def test_limbs_hang_from_their_joints_and_get_slimmer() -> None:
    limbs = figure_limbs()
    assert [limb.parent for limb in limbs] == [-1, 0, -1, 2, -1, 4, -1, 6]
    for left, right in zip(limbs[:4], limbs[4:], strict=True):
        assert right.joint == (left.joint[0], -left.joint[1], left.joint[2])
        assert left.joint[1] > 0.0
    assert [limb.joint[2] for limb in limbs[:4]] == [0.50, 0.275, 0.815, 0.63]
    for limb in limbs:
        part = parts_of(limb.template.triangles)[0]
        places = limb.template.vertices[np.unique(part)]
        top, bottom = (places[np.isclose(places[:, 2], height)] for height in (0.0, places[:, 2].min()))
        assert np.ptp(top[:, 1]) > np.ptp(bottom[:, 1])
        assert 0.13 < -places[:, 2].min() < 0.25


def test_trunk_is_closed_but_for_its_neck_and_looks_outwards() -> None:
    trunk = trunk_template()
    parts = parts_of(trunk.triangles)
    assert [is_closed(part) for part in parts] == [True, True, False, True, True, False]
    for part in parts:
        if is_closed(part):
            assert volume_of(trunk.vertices, part) > 1e-5
    neck, back = (trunk.vertices[np.unique(parts[i])] for i in (2, 5))
    assert (neck[:, 2].min(), neck[:, 2].max()) == (0.835, 0.885)
    assert (back[:, 2].min(), back[:, 2].max(), back[:, 0].max()) == (0.885, 0.94, -0.03)
    assert is_mirrored(back)


def test_loft_goes_through_its_ellipses() -> None:
    vertices, triangles = _loft([(0.0, 1.0, 2.0), (3.0, 1.0, 2.0)], 40)
    assert is_closed(triangles)
    assert volume_of(vertices, triangles) == pytest.approx(np.pi * 1.0 * 2.0 * 3.0, rel=0.01)
    assert (vertices[:, 0] ** 2 + (vertices[:, 1] / 2.0) ** 2) == pytest.approx(1.0)
    assert (len(vertices), len(triangles)) == (80, 2 * 40 + 2 * 38)
    assert len(_loft([(0.0, 1.0, 1.0), (1.0, 1.0, 1.0)])[0]) == 14


def walk(strides: list[float], *, speed: float = 1.2, height: float = 1.7) -> np.ndarray:
    num = len(strides)
    return walking_angles(np.array(strides), np.full(num, height), np.full(num, speed))


def test_walk_repeats_after_two_steps_with_the_sides_in_turn() -> None:
    cycle = STRIDE * 1.7
    first, half, whole = walk([0.3, 0.3 + 0.5 * cycle, 0.3 + cycle])
    assert whole == pytest.approx(first)
    assert half == pytest.approx(np.roll(first, 4))
    assert abs(cycle - 1.4) < 0.01


def test_arms_swing_against_the_legs_and_knees_bend_back_while_a_leg_swings_forward() -> None:
    angles = walk(np.linspace(0.0, STRIDE * 1.7, 200, endpoint=False).tolist())
    thigh, knee, arm, elbow = angles[:, :4].T
    assert (thigh.max(), thigh.min()) == pytest.approx((SWING, -SWING), abs=1e-3)
    assert arm == pytest.approx(-0.75 * thigh)
    assert knee.max() == pytest.approx(-0.25 * SWING)
    assert knee.min() == pytest.approx(-1.75 * SWING)
    assert thigh[knee.argmin()] == pytest.approx(0.0, abs=0.02)
    assert (np.diff(thigh)[knee[:-1] < -0.3] > 0.0).all()
    assert elbow == pytest.approx(0.12 + 0.6 * SWING)


def test_pace_makes_the_swing_and_who_stands_has_straight_legs() -> None:
    at = 0.25 * STRIDE * 1.7
    swings = [walk([at], speed=speed)[0, 0] for speed in (0.0, 0.6, -0.6, 1.2, 5.0)]
    assert swings == pytest.approx([0.0, 0.5 * SWING, 0.5 * SWING, SWING, 1.15 * SWING])
    assert walk([0.2], speed=0.0)[0] == pytest.approx(np.array([0, 0, 0, 0.12, 0, 0, 0, 0.12]))


def test_bent_limbs_stay_as_long_and_hang_together() -> None:
    angles = np.array([[0.6, -0.9, -0.4, 0.3, -0.2, -0.1, 0.7, 0.2]])
    vertices, template = figure(angles)
    straight, _ = figure()
    for part in parts_of(template.triangles):
        rows = np.unique(part)
        assert np.ptp(vertices[rows, 1]) == pytest.approx(np.ptp(straight[rows, 1]))
        apart = [np.linalg.norm(places[rows] - places[rows[0]], axis=1) for places in (vertices, straight)]
        assert apart[0] == pytest.approx(apart[1])
    # The ankle: the thigh goes forward by 0.6, and the shin hangs at 0.6 - 0.9.
    soles = vertices[np.unique(template.triangles[template.tints == Tint.DARK])]
    left = soles[soles[:, 1] > 0.0]
    knee = 0.225 * np.sin(0.6), 0.5 - 0.225 * np.cos(0.6)
    heel = np.array([knee[0] + 0.275 * np.sin(-0.3), knee[1] - 0.275 * np.cos(0.3)])
    middle = np.array([0.03 * np.cos(-0.3) + 0.02 * np.sin(0.3), 0.03 * np.sin(-0.3) + 0.02 * np.cos(0.3)])
    assert left[:, [0, 2]].mean(axis=0) == pytest.approx(heel + middle, abs=1e-6)
