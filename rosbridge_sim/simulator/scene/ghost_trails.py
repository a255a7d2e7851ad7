"""The last places of ghosts, and their speeds computed from these; arrays for all ghosts at once."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.scene.scene_limits import MAX_ENTITIES
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.world import DT, MAX_COORDINATE

SPEED_WINDOW: Final = 10
"""Frames over which a speed is computed: 0.2 s."""

MAX_GHOST_GAP: Final = 50
"""Largest gap in frames between two messages that are one motion: 1 s."""

MAX_GHOST_SPEED: Final = 100.0
"""Highest speed that counts as motion [m/s]. A faster change is a jump."""

_LENGTH: Final = SPEED_WINDOW + 1
"""Places that a trail has at most: one for each frame of the window, and one before it."""

_NEVER: Final = 2**62
"""Frame of a place that is free."""


class GhostTrails:
    """The last places of each ghost, in a ring of its own."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all of them."""
        self._uids = np.empty(0, np.int64)
        self._first, self._counts = np.empty((2, 0), np.int64)  # where a ring begins, and how many places it has
        self._frames, self._xy = _rings(0)

    def keep(self, uids: IntArray) -> None:
        """Forget all trails but those of these ghosts."""
        is_kept = np.isin(self._uids, uids)
        if not is_kept.all():
            self._uids, self._first, self._counts = self._uids[is_kept], self._first[is_kept], self._counts[is_kept]
            self._frames, self._xy = self._frames[is_kept], self._xy[is_kept]

    def move(self, uids: IntArray, frame: int, x: FloatArray, y: FloatArray, yaw: FloatArray) -> FloatArray:
        """Add a place to the trails of ghosts, and return their speeds along their headings, (m,) [m/s].

        Args:
            uids: (m,) the ghosts, none twice; those without a trail get one.
            x: (m,) east [m].
            y: (m,) north [m].
            yaw: (m,) headings [rad].
        """
        at = self._find(uids)
        first, counts, frames = self._first[at], self._counts[at], self._frames
        newest = (first + counts - 1) % _LENGTH
        last = frames[at, newest]
        is_same = last == frame  # two messages in a frame: the later one counts
        frames[at[is_same], newest[is_same]] = _NEVER
        counts -= is_same
        is_over = ~((last >= frame - MAX_GHOST_GAP) & (last <= frame))
        frames[at[is_over]] = _NEVER
        counts[is_over] = 0
        num_old = (frames[at] <= frame - SPEED_WINDOW).sum(axis=1)
        while (is_out := num_old > 1).any():  # the newest of them is where the window begins
            frames[at[is_out], first[is_out]] = _NEVER
            first = (first + is_out) % _LENGTH
            counts, num_old = counts - is_out, num_old - is_out
        speeds = np.zeros(len(at))
        moving = np.flatnonzero(counts)
        if len(moving):
            ghosts, begin, headings = at[moving], first[moving], yaw[moving].tolist()
            way_x, way_y = x[moving] - self._xy[ghosts, begin, 0], y[moving] - self._xy[ghosts, begin, 1]
            along = way_x * list(map(math.cos, headings)) + way_y * list(map(math.sin, headings))
            speeds[moving] = along / ((frame - frames[ghosts, begin]) * DT)
            is_jump = np.abs(speeds) > MAX_GHOST_SPEED
            frames[at[is_jump]] = _NEVER
            counts[is_jump], speeds[is_jump] = 0, 0.0
        free = (first + counts) % _LENGTH
        frames[at, free], self._xy[at, free, 0], self._xy[at, free, 1] = frame, x, y
        self._first[at], self._counts[at] = first, counts + 1
        return speeds

    def _find(self, uids: IntArray) -> IntArray:
        """Return the positions of ghosts, (m,), after the addition of empty trails for new ones."""
        new = uids[~np.isin(uids, self._uids)]
        if len(new):
            frames, xy = _rings(len(new))
            zero = np.zeros(len(new), np.int64)
            self._uids = np.concatenate([self._uids, new])
            self._first, self._counts = np.concatenate([self._first, zero]), np.concatenate([self._counts, zero])
            self._frames, self._xy = np.concatenate([self._frames, frames]), np.concatenate([self._xy, xy])
        order = np.argsort(self._uids)
        return np.asarray(order[np.searchsorted(self._uids, uids, sorter=order)])

    def save_state(self) -> PlainData:
        """Return ids, how many places each has, the places' frames, and x and y of the places, the oldest first."""
        places = np.arange(_LENGTH)
        owner, place = np.nonzero(places < self._counts[:, None])
        at = (self._first[owner] + place) % _LENGTH
        return self._uids.copy(), self._counts.copy(), self._frames[owner, at], self._xy[owner, at]

    def load_state(self, data: PlainData) -> None:
        """Become what was saved.

        Raises:
            ValueError: it is no such data. Nothing has changed.
        """
        is_four = isinstance(data, (list, tuple)) and len(data) == 4  # noqa: PLR2004 - those named in the next lines
        if not (is_four and all(isinstance(array, np.ndarray) for array in data)):
            raise ValueError("ghosts: expected ids, counts, frames and places")
        uids, counts, frames, places = data
        kinds = [(array.dtype.kind, array.ndim) for array in data]
        if kinds != [("i", 1)] * 3 + [("f", 2)] or not len(uids) == len(counts) <= MAX_ENTITIES:
            raise ValueError("ghosts: expected ids, counts, frames and places")
        is_good = len(places) == len(frames) and places.shape[1] == 2 and bool((counts >= 0).all())  # noqa: PLR2004 - x and y
        is_good = is_good and bool((counts <= _LENGTH).all()) and int(counts.sum()) == len(frames)
        if not (is_good and bool((np.abs(places) <= MAX_COORDINATE).all()) and len(np.unique(uids)) == len(uids)):
            raise ValueError("ghosts: expected a frame and a place for each count")
        owner, place = np.nonzero(np.arange(_LENGTH) < counts[:, None])
        if ((np.diff(frames) <= 0) & (np.diff(owner) == 0)).any():
            raise ValueError("ghosts: expected rising frames")  # a speed is a way divided by their difference
        self._uids, self._counts = uids.astype(np.int64), counts.astype(np.int64)
        self._first = np.zeros(len(uids), np.int64)
        self._frames, self._xy = _rings(len(uids))
        self._frames[owner, place], self._xy[owner, place] = frames, places


def _rings(num: int) -> tuple[IntArray, FloatArray]:
    """Return empty trails for this many ghosts: the frames of their places, and x and y."""
    return np.full((num, _LENGTH), _NEVER), np.zeros((num, _LENGTH, 2))
