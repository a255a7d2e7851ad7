from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rosbridge_sim.world.geometry.planar import (
    IntArray,
    arc_lengths,
    box_gaps,
    chain,
    distinct,
    do_boxes_meet,
    is_among,
    nearest_on_polyline,
    quaternion,
    rotate,
    rotate_back,
    wrap_angle,
)
from tests.world.polylines import point_at

ANGLES = st.floats(-1e4, 1e4)
CORNER = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])


@given(ANGLES)
def test_wrapped_angle_is_the_same_direction_in_the_half_open_range(angle: float) -> None:
    wrapped = float(wrap_angle(angle))
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-11)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-11)


@given(st.floats(-3.14, 3.14))
def test_angle_in_range_keeps_its_bits(angle: float) -> None:
    assert float(wrap_angle(angle)) == angle


def test_minus_pi_and_its_neighbours_are_wrapped_into_range() -> None:
    beyond = math.nextafter(math.pi, 4.0)
    wrapped = wrap_angle([-math.pi, math.pi, beyond, -beyond, 3 * math.pi, -3 * math.pi])
    assert wrapped.shape == (6,)
    assert ((wrapped > -math.pi) & (wrapped <= math.pi)).all()
    assert wrapped[0] == math.pi == wrapped[1]


@pytest.mark.parametrize("others", [[], [0.1], [4.0], [-math.pi, 9.0]])
def test_angle_just_inside_keeps_its_bits_beside_any_others(others: list[float]) -> None:
    """Else one vehicle of a world would change the yaw of another one."""
    inside = math.nextafter(-math.pi, 0.0)
    assert wrap_angle([inside, *others])[0] == inside


def test_arc_lengths_count_from_zero_in_the_plane_and_in_space() -> None:
    assert arc_lengths(CORNER).tolist() == [0.0, 10.0, 20.0]
    assert arc_lengths(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]])).tolist() == [0.0, 5.0]


@pytest.mark.parametrize(
    ("x", "y", "segment", "arc", "lateral"),
    [
        (5.0, 2.0, 0, 5.0, 2.0),  # left of the first
        (5.0, -2.0, 0, 5.0, -2.0),  # right of it
        (8.0, 5.0, 1, 15.0, 2.0),  # left of the second
        (13.0, -4.0, 0, 10.0, -5.0),  # outside the corner: the vertex, 3-4-5
        (-3.0, 4.0, 0, 0.0, 5.0),  # before the start
        (10.0, 14.0, 1, 20.0, 4.0),  # beyond the end
    ],
)
def test_nearest_gives_segment_arc_length_and_signed_distance(
    x: float, y: float, segment: int, arc: float, lateral: float
) -> None:
    near = nearest_on_polyline(CORNER, x, y)
    assert near.segment.tolist() == [segment]
    assert near.arc[0] == pytest.approx(arc)
    assert near.lateral[0] == pytest.approx(lateral)


def test_zero_length_segment_is_harmless() -> None:
    near = nearest_on_polyline(np.array([[0.0, 0.0], [0.0, 0.0], [4.0, 0.0]]), 2.0, 1.0)
    assert (near.arc[0], near.lateral[0]) == (2.0, 1.0)


def test_many_queries_equal_single_queries() -> None:
    rng = np.random.default_rng(1)
    points = np.cumsum(rng.normal(size=(700, 2)), axis=0)
    x, y = rng.normal(size=(2, 1000)) * 20  # more cells than one chunk takes
    many = nearest_on_polyline(points, x, y)
    for i in range(0, 1000, 100):
        alone = nearest_on_polyline(points, x[i], y[i])
        assert [column[i] for column in many] == [column[0] for column in alone]


@given(st.floats(0.0, 20.0))
def test_point_on_the_polyline_is_its_own_nearest(arc: float) -> None:
    x, y = point_at(CORNER, arc_lengths(CORNER), arc)[0]
    near = nearest_on_polyline(CORNER, x, y)
    assert near.arc[0] == pytest.approx(arc, abs=1e-9)
    assert near.lateral[0] == pytest.approx(0.0, abs=1e-9)


def test_empty_query_gives_an_empty_result() -> None:
    assert nearest_on_polyline(CORNER, [], []).arc.shape == (0,)


# Boxes

BOX = st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 6.0), st.floats(-math.pi, math.pi))
PLACE = st.complex_numbers(max_magnitude=15.0, allow_nan=False, allow_infinity=False)


def meet(first: complex, last: complex, one: tuple[float, float, float], other: tuple[float, float, float]) -> bool:
    heading = np.exp(1j * np.array([[one[2]], [other[2]]]))
    half = np.array([[one[:2]], [other[:2]]])
    return bool(do_boxes_meet(np.array([first]), np.array([last]), heading, half)[0])


def corners(box: tuple[float, float, float], middle: complex) -> list[complex]:
    a, b, yaw = box
    return [middle + complex(u * a, v * b) * np.exp(1j * yaw) for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1))]


def gap(one: list[complex], other: list[complex], *yaws: float) -> float:
    """The widest strip between two sets of points: across and along the lines through two of them, and by `yaws`.

    The yaws are those of the boxes: the edge of a box without size has no direction that could be computed from it.
    """
    points = [*one, *other]
    pairs = [b - a for i, a in enumerate(points) for b in points[i + 1 :]]
    directions = [pair / abs(pair) for pair in pairs if abs(pair) >= 1e-3] + [np.exp(1j * yaw) for yaw in yaws]
    widest = -math.inf
    for normal in [turned for direction in directions for turned in (direction, direction * 1j)]:
        mine, theirs = ([(c * normal.conjugate()).real for c in box] for box in (one, other))
        widest = max(widest, min(mine) - max(theirs), min(theirs) - max(mine))
    return widest


@given(PLACE, PLACE, BOX, BOX)
@example(1e-9 + 0j, 1e-9 + 0j, (4.9e-4, 0.0, -2.0), (1e-9, 0.0, -1.9))
def test_sweeping_boxes_meet_if_their_traces_overlap(
    first: complex, last: complex, one: tuple[float, float, float], other: tuple[float, float, float]
) -> None:
    # What a box passes on a straight line is the hull of where it begins and where it ends.
    wide = gap(corners(one, 0.0), corners(other, first) + corners(other, last), one[2], other[2])
    if abs(wide) > 1e-3:
        assert meet(first, last, one, other) == (wide < 0.0)


@given(PLACE, PLACE, BOX, BOX)
def test_sweep_test_is_symmetric(
    first: complex, last: complex, one: tuple[float, float, float], other: tuple[float, float, float]
) -> None:
    answer = meet(first, last, one, other)
    assert meet(-first, -last, other, one) == answer
    assert meet(last, first, one, other) == answer


def test_zero_width_boxes_meet_and_miss_correctly() -> None:
    needle, across = (1.0, 0.0, 0.0), (1.0, 0.0, math.pi / 2)
    assert meet(0.5j, 0.5j, needle, across)
    assert not meet(1.5j, 1.5j, needle, across)
    assert meet(5.0 + 3.0j, 5.0 - 300.0j, needle, (9.0, 0.0, 0.0))
    assert not meet(15.0 + 3.0j, 15.0 - 300.0j, needle, (9.0, 0.0, 0.0))
    assert meet(-300.0 - 300.0j, 300.0 + 300.0j, needle, across)


def test_chained_rotations_compose_and_invert() -> None:
    first, second, vector = quaternion(0.1, -0.4, 2.0), quaternion(-1.0, 0.3, 0.7), (1.0, -2.0, 3.0)
    assert rotate(chain(first, second), vector) == pytest.approx(rotate(first, rotate(second, vector)), abs=1e-14)
    assert rotate_back(first, rotate(first, vector)) == pytest.approx(vector, abs=1e-14)
    assert rotate(quaternion(0.0, 0.0, math.pi / 2), (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)


@pytest.mark.parametrize(
    ("middle", "yaw", "gap"),
    [
        (7.0 + 0.0j, 0.0, 3.0),  # one behind the other
        (1.0 + 3.0j, 0.0, 1.0),  # side by side
        (5.0 + 0.0j, math.pi / 2, 2.0),  # across
        (-10.0 + 9.0j, math.pi / 4, 16.0 * math.sqrt(0.5) - 0.5),  # 19 less 2 and 1, all on the diagonal
        (1.0 + 1.0j, 0.0, -1.0),  # one in the other
    ],
)
def test_gap_of_boxes_is_the_widest_strip_between_them(middle: complex, yaw: float, gap: float) -> None:
    """Two boxes of 4 x 2 m, and of 4 x 1 m where they stand askew; the same from the other one's view."""
    width = 0.5 if yaw == math.pi / 4 else 1.0
    heading = np.array([[1.0 + 0.0j], [complex(math.cos(yaw), math.sin(yaw))]])
    half = np.array([[[2.0, 1.0]], [[2.0, width]]])
    assert box_gaps(np.array([middle]), heading, half) == pytest.approx(gap)
    assert box_gaps(np.array([-middle]), heading[::-1], half[::-1]) == pytest.approx(gap)


NUMBERS = st.lists(st.integers(-3, 3) | st.integers(-(2**62), 2**62), max_size=12).map(
    lambda rows: np.array(rows, np.int64)
)


@given(NUMBERS)
def test_distinct_values_are_those_of_numpy(values: IntArray) -> None:
    assert distinct(values).tolist() == np.unique(values).tolist()
    assert distinct(np.stack([values, values[::-1]]) / 3.0).tolist() == np.unique(values / 3.0).tolist()


@given(NUMBERS, NUMBERS)
def test_values_among_others_are_those_of_numpy(values: IntArray, others: IntArray) -> None:
    both = np.stack([values, values[::-1]])
    assert is_among(both, others).tolist() == np.isin(both, others).tolist()
