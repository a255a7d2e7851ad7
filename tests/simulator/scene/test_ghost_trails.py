"""Speeds of ghosts from their places: all at once they are those of each ghost alone."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.simulator.scene.ghost_trails import MAX_GHOST_GAP, MAX_GHOST_SPEED, SPEED_WINDOW, GhostTrails
from rosbridge_sim.world.state.world import DT

Place = tuple[int, float, float]


def speed_of_one(trail: deque[Place], frame: int, x: float, y: float, yaw: float) -> float:
    """Add a place to the trail of one ghost, and return its speed: what `GhostTrails.move` says, place by place."""
    if trail and not 0 <= frame - trail[-1][0] <= MAX_GHOST_GAP:
        trail.clear()
    if trail and trail[-1][0] == frame:
        trail.pop()
    while len(trail) > 1 and frame - trail[1][0] >= SPEED_WINDOW:
        trail.popleft()
    speed = 0.0
    if trail:
        since, old_x, old_y = trail[0]
        along = (x - old_x) * math.cos(yaw) + (y - old_y) * math.sin(yaw)
        speed = along / ((frame - since) * DT)
        if abs(speed) > MAX_GHOST_SPEED:
            trail.clear()
            speed = 0.0
    trail.append((frame, x, y))
    return speed


coordinates = st.floats(-8.0, 8.0)
messages = st.lists(
    st.tuples(
        st.sampled_from([0, 1, 1, 1, 2, 7, SPEED_WINDOW, MAX_GHOST_GAP, MAX_GHOST_GAP + 1, -3]),
        st.dictionaries(st.integers(1, 5), st.tuples(coordinates, coordinates, st.floats(-4.0, 4.0)), max_size=5),
    ),
    max_size=40,
)


@given(messages)
def test_speeds_of_all_ghosts_are_those_of_each_alone(messages: list[tuple[int, dict[int, tuple[float, ...]]]]) -> None:
    trails, alone, frame = GhostTrails(), dict[int, deque[Place]](), 100
    for i, (step, places) in enumerate(messages):
        frame += step
        if i % 9 == 8:
            gone = set(alone) - set(places)
            trails.keep(np.array(list(places), np.int64))
            alone = {uid: trail for uid, trail in alone.items() if uid not in gone}
        if i % 7 == 6:
            saved, trails = trails.save_state(), GhostTrails()
            trails.load_state(saved)
        poses = np.array(list(places.values())).reshape(-1, 3).T
        speeds = trails.move(np.array(list(places), np.int64), frame, *poses)
        expected = [speed_of_one(alone.setdefault(uid, deque()), frame, *pose) for uid, pose in places.items()]
        assert speeds.tolist() == expected
        uids, counts, frames, xy = trails.save_state()
        assert uids.tolist() == list(alone)
        assert counts.tolist() == [len(trail) for trail in alone.values()]
        assert [*zip(frames.tolist(), *xy.T.tolist(), strict=True)] == [p for trail in alone.values() for p in trail]


@pytest.mark.parametrize(
    ("uids", "counts", "frames", "why"),
    [
        ([1], [2], [5, 5], "rising frames"),
        ([1, 1], [1, 1], [5, 6], "a frame and a place"),
        ([1], [12], list(range(12)), "a frame and a place"),
        ([1], [2], [5], "a frame and a place"),
        ([1], [-1], [], "a frame and a place"),
    ],
)
def test_saved_trails_that_no_ghost_can_have_are_refused(
    uids: list[int], counts: list[int], frames: list[int], why: str
) -> None:
    trails = GhostTrails()
    trails.move(np.array([7]), 3, *np.zeros((3, 1)))
    before = [array.tolist() for array in trails.save_state()]
    places = np.zeros((len(frames), 2))
    with pytest.raises(ValueError, match=why):
        trails.load_state((np.array(uids), np.array(counts), np.array(frames, np.int64), places))
    assert [array.tolist() for array in trails.save_state()] == before
