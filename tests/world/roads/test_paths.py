from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.paths import MAX_KEY, MAX_KNOWN_POINTS, MAX_PATH_LENGTH, Paths, lay_segments

REACH = 0.1  # [m]
SQUARE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]])


def line(length: float, num: int = 2) -> FloatArray:
    return np.column_stack([np.linspace(0.0, length, num), np.zeros(num), np.zeros(num)])


def test_segments_have_arc_start_direction_and_heading() -> None:
    segments = lay_segments(SQUARE, is_loop=True, reach=1.0)
    assert segments[:, 0].tolist() == [0.0, 3.0, 4.0, 7.0, 8.0, 11.0, 12.0, 15.0]
    assert segments[:, 1].tolist() == [*segments[1:, 0].tolist(), 16.0]
    right = math.pi / 2
    assert segments[:, 8] == pytest.approx([0.0, 0.0, right, right, math.pi, -math.pi, -right, -right])
    assert segments[:, 9] == pytest.approx([0.0, right] * 4)
    assert np.hypot(segments[:, 5], segments[:, 6]) == pytest.approx(1.0)


COORDINATES = st.integers(-6_400, 6_400).map(lambda steps: steps / 64.0)
"""[m]; two that differ are farther apart than the least segment."""

POINTS = st.lists(st.tuples(*[COORDINATES] * 3), min_size=2, max_size=10, unique=True)


@given(points=POINTS, is_loop=st.booleans(), reach=st.floats(0.05, 50.0))
def test_headings_are_continuous_and_within_half_a_turn(
    points: list[tuple[float, float, float]],
    is_loop: bool,  # noqa: FBT001 - a parameter of a test
    reach: float,
) -> None:
    segments = lay_segments(np.array(points), is_loop=is_loop, reach=reach)
    length, start = segments[:, 1] - segments[:, 0], segments[:, 8]
    end = start + length * segments[:, 9]
    assert (length > 0.0).all()
    for heading in (start, end):
        assert (np.abs(heading) <= math.pi).all()
    assert (start > -math.pi).all()
    following = np.roll(start, -1) if is_loop else np.append(start[1:], end[-1])
    turn = np.remainder(following - end + math.pi, 2.0 * math.pi) - math.pi
    # Slivers are not cut off, so at +-pi a heading may be off by what a sliver turns.
    assert np.abs(turn).max() < 1e-6 * (1.0 + 2.0 * math.pi * len(points) / min(reach, float(segments[-1, 1])))


def test_the_heading_is_the_mean_direction_within_reach() -> None:
    bent = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0], [30.0, 10.0, 0.0]])
    segments = lay_segments(bent, is_loop=False, reach=3.0)
    directions = np.repeat([0.0, math.pi / 2, 0.0], [10_000, 10_000, 30_000])  # one a millimetre
    for s in np.arange(0.0, 39.9, 0.37):
        i = segments[:, 0].searchsorted(s, side="right") - 1
        heading = segments[i, 8] + (s - segments[i, 0]) * segments[i, 9]
        mean = directions[round(s * 1000) : round((s + 3.0) * 1000)].mean()
        assert heading == pytest.approx(mean, abs=2e-3), s


def test_path_of_short_segments_is_split_only_at_its_waypoints() -> None:
    angles = np.linspace(0.0, 2.0 * math.pi, 600, endpoint=False)
    circle = np.column_stack([50.0 * np.cos(angles), 50.0 * np.sin(angles), np.zeros(600)])
    segments = lay_segments(circle, is_loop=True, reach=2.7)
    assert len(segments) <= 601  # once round it passes due west
    assert segments[:, 9] == pytest.approx(1.0 / 50.0, rel=1e-3)


def test_an_open_path_has_no_closing_segment() -> None:
    assert lay_segments(SQUARE, is_loop=False, reach=REACH)[-1, 1] == 12.0


def test_a_loop_that_repeats_its_first_point_is_closed_once() -> None:
    closed = np.concatenate([SQUARE, SQUARE[:1]])
    assert np.array_equal(
        lay_segments(closed, is_loop=True, reach=REACH), lay_segments(SQUARE, is_loop=True, reach=REACH)
    )


def test_repeated_waypoints_are_skipped() -> None:
    repeated = SQUARE.repeat(3, axis=0)
    assert np.array_equal(
        lay_segments(repeated, is_loop=False, reach=REACH), lay_segments(SQUARE, is_loop=False, reach=REACH)
    )


def test_a_vertical_segment_keeps_the_heading_before_it() -> None:
    lift = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 2.0, 5.0]])
    assert lay_segments(lift, is_loop=False, reach=REACH)[:, 8].tolist() == [math.pi / 2, math.pi / 2]


def test_due_west_is_pi_even_from_a_negative_zero() -> None:
    west = np.array([[4.0, 0.0, 0.0], [0.0, -0.0, 0.0]])
    west[1, 1] = -5e-324
    assert lay_segments(west, is_loop=False, reach=REACH)[0, 8] == math.pi


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
def test_invalid_path_is_refused(points: FloatArray, is_loop: bool) -> None:  # noqa: FBT001 - a parameter of a test
    with pytest.raises(ValueError, match="path: "):
        lay_segments(points, is_loop=is_loop, reach=REACH)


def test_keys_increase_along_the_whole_store() -> None:
    paths = Paths()
    for i in range(50):
        paths.add(i, lay_segments(line(10.0 + i, 7), is_loop=False, reach=REACH))
    assert (np.diff(paths.keys) > 0).all()
    assert paths.num == paths.num_live == 300


def test_adding_and_removing_paths_does_not_grow_the_store() -> None:
    paths = Paths()
    paths.add(0, lay_segments(line(100.0, 101), is_loop=False, reach=REACH))
    capacity = 0
    for i in range(1, 2000):
        paths.add(i, lay_segments(line(50.0, 51), is_loop=False, reach=REACH))
        if paths.remove(i):
            assert paths.base(0) == 0
        capacity = max(capacity, len(paths._keys))
    assert capacity <= 1024
    assert paths.num_live == 100


def test_compacted_store_has_each_path_at_its_base() -> None:
    paths = Paths()
    laid = {i: lay_segments(line(10.0 + i, 11), is_loop=False, reach=REACH) for i in range(20)}
    for i, segments in laid.items():
        paths.add(i, segments)
    moved = [paths.remove(i) for i in range(0, 20, 2)]
    moved += [paths.remove(i) for i in (1, 5, 9)]
    assert any(moved)
    for i in (3, 7, 11, 13, 15, 17, 19):
        at = int(paths.keys.searchsorted(paths.base(i)))
        assert np.array_equal(paths.segments[at : at + 10], laid[i])


def test_store_without_free_keys_refuses_and_recovers() -> None:
    paths = Paths()
    far = lay_segments(line(MAX_PATH_LENGTH), is_loop=False, reach=REACH)
    paths.add(0, far)
    paths.next_base = MAX_KEY - 1000
    before = paths.num
    with pytest.raises(ValueError, match="longer together"):
        paths.add(1, far)
    assert paths.num == before
    paths.next_base = 3 * (MAX_KEY // 4)
    paths.add(2, lay_segments(line(1.0), is_loop=False, reach=REACH))
    assert paths.remove(2)  # the keys ran high: it moved together though it was not half empty
    paths.add(1, far)


def test_snapshot_can_be_restored_more_than_once() -> None:
    paths = Paths()
    paths.add(7, lay_segments(SQUARE, is_loop=True, reach=REACH))
    saved = paths.snapshot()
    other = Paths()
    for _ in range(2):
        other.restore(saved)
        assert np.array_equal(other.segments, paths.segments)
        assert np.array_equal(other.keys, paths.keys)
        other.remove(7)
        assert other.num == 0


def test_different_stores_have_different_digests() -> None:
    """The digest of a world tells replays apart; each of these stores moves its agents otherwise, now or later."""

    def digest(*lengths: float, base: int = 0, first: int = 0, aside: float = 0.0) -> bytes:
        paths = Paths()
        paths.next_base = base
        for i, length in enumerate(lengths, start=first):
            points = line(length, 7)
            points[:, 1] = aside
            paths.add(i, lay_segments(points, is_loop=False, reach=REACH))
        return paths.digest()

    usual = digest(10.0, 20.0)
    others = [
        digest(10.0),
        digest(10.0, 20.0, aside=1.0),  # the segments alone
        digest(10.0, 20.0, first=1),  # who has which path
        digest(10.0, 20.0, base=9),  # the key of the next one
    ]
    assert digest(10.0, 20.0) == usual
    assert len({usual, *others}) == 5


def test_digest_changes_with_added_and_removed_paths() -> None:
    paths = Paths()
    laid = lay_segments(line(10.0, 7), is_loop=False, reach=REACH)
    empty = paths.digest()
    paths.add(0, laid)
    alone = paths.digest()
    paths.add(1, laid)
    both = paths.digest()
    paths.remove(1)
    assert len({empty, alone, both, paths.digest()}) == 4  # the next path gets another key than before


def test_same_short_path_is_laid_once_and_cannot_be_written() -> None:
    points = np.cumsum(np.arange(3.0 * MAX_KNOWN_POINTS).reshape(-1, 3), axis=0)
    first = lay_segments(points, is_loop=False, reach=1.0)
    assert lay_segments(points.copy(), is_loop=False, reach=1.0) is first
    assert not first.flags.writeable
    for changed in (lay_segments(points, is_loop=True, reach=1.0), lay_segments(points, is_loop=False, reach=2.0)):
        assert not np.array_equal(changed, first)
    longer = np.vstack([points, points[-1:] + 1.0])
    assert lay_segments(longer, is_loop=False, reach=1.0) is not lay_segments(longer, is_loop=False, reach=1.0)
