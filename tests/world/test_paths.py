from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.geometry import FloatArray
from rosbridge_sim.world.paths import MAX_KEY, MAX_PATH_LENGTH, Paths, lay_segments

SQUARE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]])


def line(length: float, num: int = 2) -> FloatArray:
    return np.column_stack([np.linspace(0.0, length, num), np.zeros(num), np.zeros(num)])


def test_segments_carry_arc_start_direction_and_heading() -> None:
    segments = lay_segments(SQUARE, is_loop=True)
    assert segments[:, 0].tolist() == [0.0, 4.0, 8.0, 12.0]
    assert segments[:, 1].tolist() == [4.0, 8.0, 12.0, 16.0]
    assert segments[:, 8] == pytest.approx([0.0, math.pi / 2, math.pi, -math.pi / 2])
    assert np.hypot(segments[:, 5], segments[:, 6]) == pytest.approx(1.0)


def test_an_open_path_has_no_closing_segment() -> None:
    assert lay_segments(SQUARE, is_loop=False)[-1, 1] == 12.0


def test_a_loop_that_repeats_its_first_point_is_closed_once() -> None:
    closed = np.concatenate([SQUARE, SQUARE[:1]])
    assert len(lay_segments(closed, is_loop=True)) == 4


def test_repeated_waypoints_are_passed_over() -> None:
    assert len(lay_segments(SQUARE.repeat(3, axis=0), is_loop=False)) == 3


def test_a_vertical_segment_keeps_the_heading_before_it() -> None:
    lift = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 2.0, 5.0]])
    assert lay_segments(lift, is_loop=False)[:, 8].tolist() == [math.pi / 2, math.pi / 2]


def test_due_west_is_pi_even_from_a_negative_zero() -> None:
    west = np.array([[4.0, 0.0, 0.0], [0.0, -0.0, 0.0]])
    west[1, 1] = -5e-324
    assert lay_segments(west, is_loop=False)[0, 8] == math.pi


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.zeros((1, 3)),
        np.zeros((5, 3)),
        np.zeros((2, 4)),
        np.zeros(3),
        np.array([[0.0, 0.0, 0.0], [math.nan, 0.0, 0.0]]),
        np.array([[0.0, 0.0, 0.0], [math.inf, 0.0, 0.0]]),
        np.array([[0.0, 0.0, 0.0], [2 * MAX_PATH_LENGTH, 0.0, 0.0]]),
    ],
)
@pytest.mark.parametrize("is_loop", [False, True])
def test_what_is_no_path_is_refused(points: FloatArray, is_loop: bool) -> None:  # noqa: FBT001 - a parameter of a test
    with pytest.raises(ValueError, match="path: "):
        lay_segments(points, is_loop=is_loop)


def test_keys_rise_along_the_whole_store() -> None:
    paths = Paths()
    for i in range(50):
        paths.add(i, lay_segments(line(10.0 + i, 7), is_loop=False))
    assert (np.diff(paths.keys) > 0).all()
    assert paths.num == paths.num_live == 300


def test_a_store_that_paths_come_to_and_leave_does_not_grow() -> None:
    paths = Paths()
    paths.add(0, lay_segments(line(100.0, 101), is_loop=False))
    capacity = 0
    for i in range(1, 2000):
        paths.add(i, lay_segments(line(50.0, 51), is_loop=False))
        if paths.remove(i):
            assert paths.base(0) == 0
        capacity = max(capacity, len(paths._keys))
    assert capacity <= 1024
    assert paths.num_live == 100


def test_after_moving_together_each_path_lies_at_its_base() -> None:
    paths = Paths()
    laid = {i: lay_segments(line(10.0 + i, 11), is_loop=False) for i in range(20)}
    for i, segments in laid.items():
        paths.add(i, segments)
    moved = [paths.remove(i) for i in range(0, 20, 2)]
    moved += [paths.remove(i) for i in (1, 5, 9)]
    assert any(moved)
    for i in (3, 7, 11, 13, 15, 17, 19):
        at = int(paths.keys.searchsorted(paths.base(i)))
        assert np.array_equal(paths.segments[at : at + 10], laid[i])


def test_a_store_whose_keys_are_used_up_refuses_and_recovers() -> None:
    paths = Paths()
    far = lay_segments(line(MAX_PATH_LENGTH), is_loop=False)
    paths.add(0, far)
    paths._next_base = MAX_KEY - 1000
    before = paths.num
    with pytest.raises(ValueError, match="longer together"):
        paths.add(1, far)
    assert paths.num == before
    paths._next_base = 3 * (MAX_KEY // 4)
    paths.add(2, lay_segments(line(1.0), is_loop=False))
    assert paths.remove(2)  # the keys ran high: it moved together though it was not half empty
    paths.add(1, far)


def test_a_snapshot_serves_more_than_once() -> None:
    paths = Paths()
    paths.add(7, lay_segments(SQUARE, is_loop=True))
    saved = paths.snapshot()
    other = Paths()
    for _ in range(2):
        other.restore(saved)
        assert np.array_equal(other.segments, paths.segments)
        assert np.array_equal(other.keys, paths.keys)
        other.remove(7)
        assert other.num == 0
