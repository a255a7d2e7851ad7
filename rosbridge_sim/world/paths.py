"""The waypoint paths that agents follow, all in one pair of arrays so that one search serves every agent.

A path is laid down as its straight segments, end to end behind those of the other paths. Each segment has an
integer *key*: where it begins, in 2^-26 m (15 nm), counted from the path's *base*. Keys grow along the whole store,
so `numpy.searchsorted` finds the segments of any number of agents at once; and because they are integers, what is
found depends on the arc length alone and never on where in the store a path happens to lie. (Floating keys would: the
same drive would differ in its last bits after some other agent's path is gone.)

A removed path leaves a hole. Once the holes are more than half, the rest moves together, so that any number of
additions and removals needs memory for the paths in use alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import blake2b
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray, arc_lengths

__all__ = ["MAX_PATH_LENGTH", "TICKS", "Paths", "PathsSnapshot", "Segments", "lay_segments"]

TICKS: Final = float(1 << 26)  # key units in a metre
MAX_PATH_LENGTH: Final = 1e6  # 1,000 km
MAX_KEY: Final = 1 << 62  # 69 million km of paths
MIN_SEGMENT: Final = 1e-6  # shorter steps between waypoints are rounding in somebody's file and have no direction
MIN_CAPACITY: Final = 64

# Columns of a segment.
START, END, X, Y, Z, DX, DY, DZ, YAW = range(9)
NUM_COLUMNS: Final = 9

Segments = FloatArray


def lay_segments(points: FloatArray, *, is_loop: bool) -> Segments:
    """Return a polyline as its segments.

    Args:
        points: (m, 3) vertices [m]. Vertices that repeat the one before are passed over.
        is_loop: the last vertex is joined to the first.

    Returns:
        (k, 9) one row each: arc length at its start and end, start point x, y, z, direction in space (a unit
        vector), yaw. The end of the last one is the length of the path.

    Raises:
        ValueError: not a finite polyline in space, or shorter than a micrometre, or longer than `MAX_PATH_LENGTH`.
    """
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():  # noqa: PLR2004 - x, y, z
        raise ValueError(f"path: expected finite points of shape (m, 3), got shape {points.shape}")
    if is_loop and len(points):
        points = np.concatenate([points, points[:1]])
    # One pass: a run of tiny steps is merged as far as each single step goes, which no sane file will notice.
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)) > MIN_SEGMENT
    points = points[is_new]
    if len(points) < 2:  # noqa: PLR2004 - a segment has two ends
        raise ValueError("path: expected at least two different points")
    arcs = arc_lengths(points)
    if not arcs[-1] <= MAX_PATH_LENGTH:
        raise ValueError(f"path: expected at most {MAX_PATH_LENGTH:g} m, got {arcs[-1]:g} m")
    step = np.diff(points, axis=0)
    segments = np.empty((len(step), NUM_COLUMNS))
    segments[:, START], segments[:, END] = arcs[:-1], arcs[1:]
    segments[:, X : Z + 1] = points[:-1]
    segments[:, DX : DZ + 1] = step / np.diff(arcs)[:, None]
    segments[:, YAW] = _headings(step)
    return segments


def _headings(step: FloatArray) -> FloatArray:
    """Return each segment's yaw within (-pi, pi]; a vertical one keeps the yaw of the one before."""
    yaw = np.arctan2(step[:, 1], step[:, 0])
    yaw[yaw == -np.pi] = np.pi
    is_flat = (step[:, 0] != 0.0) | (step[:, 1] != 0.0)
    last = np.maximum.accumulate(np.where(is_flat, np.arange(len(step)), 0))
    return np.asarray(yaw[last])


@dataclass(frozen=True, slots=True)
class PathsSnapshot:
    """A copy of a store: segments (k, 9), keys (k,), spans {path: (first, count)} and the first free key."""

    segments: Segments
    keys: IntArray
    spans: dict[int, tuple[int, int]]
    next_base: int


class Paths:
    """All paths in use.

    Attributes:
        segments: (num, 9) see `lay_segments`.
        keys: (num,) int64, rising: the start of each segment in `TICKS`, plus its path's base.
        num, num_live: segments in the store with and without the holes.
    """

    __slots__ = ("_digest", "_keys", "_next_base", "_segments", "_spans", "keys", "num", "num_live", "segments")

    def __init__(self) -> None:
        self._digest: bytes | None = None  # of what is there now
        self.clear()

    def clear(self) -> None:
        """Forget every path."""
        self._segments: Segments = np.empty((MIN_CAPACITY, NUM_COLUMNS))
        self._keys: IntArray = np.empty(MIN_CAPACITY, dtype=np.int64)
        self._spans: dict[int, tuple[int, int]] = {}  # in the order of the store
        self._next_base = 0
        self.num_live = 0
        self._bind(0)

    def add(self, path: int, segments: Segments) -> int:
        """Lay a path behind the others and return its base, the key where it begins.

        Raises:
            ValueError: the keys are used up; the store is as it was.
        """
        first, count, base = self.num, len(segments), self._next_base
        # One key beyond the end of the path keeps an agent that stands exactly there on its own path.
        next_base = base + int(segments[-1, END] * TICKS) + 2
        if next_base > MAX_KEY:
            raise ValueError(f"path: the paths in use are longer together than {MAX_KEY / TICKS:g} m")
        if first + count > len(self._keys):
            self._reserve(2 * (first + count))
        self._segments[first : first + count] = segments
        self._keys[first : first + count] = base + np.floor(segments[:, START] * TICKS).astype(np.int64)
        self._spans[path] = (first, count)
        self._next_base = next_base
        self.num_live += count
        self._bind(first + count)
        return base

    def remove(self, path: int) -> bool:
        """Take a path out; True when the rest moved together and every base must be asked for again."""
        _, count = self._spans.pop(path)
        self._digest = None
        self.num_live -= count
        if 2 * self.num_live >= self.num and self._next_base < MAX_KEY // 2:
            return False
        self._compact()
        return True

    def base(self, path: int) -> int:
        """Return the key where a path begins."""
        return int(self._keys[self._spans[path][0]])

    def digest(self) -> bytes:
        """Return a hash of the whole store. It is most of a world and changes rarely, so it is worked out once."""
        if self._digest is None:
            state = blake2b(digest_size=16)
            state.update(repr((self._next_base, list(self._spans.items()))).encode())
            state.update(self.segments.tobytes())
            self._digest = state.digest()
        return self._digest

    def snapshot(self) -> PathsSnapshot:
        """Return a copy that `restore` takes."""
        return PathsSnapshot(self.segments.copy(), self.keys.copy(), dict(self._spans), self._next_base)

    def restore(self, saved: PathsSnapshot) -> None:
        """Become what the snapshot was; the snapshot stays good for another time."""
        self.clear()
        num = len(saved.keys)
        self._reserve(num)
        self._segments[:num], self._keys[:num] = saved.segments, saved.keys
        self._spans = dict(saved.spans)
        self._next_base = saved.next_base
        self.num_live = sum(count for _, count in self._spans.values())
        self._bind(num)

    def _reserve(self, capacity: int) -> None:
        capacity = max(MIN_CAPACITY, capacity)
        segments, keys = np.empty((capacity, NUM_COLUMNS)), np.empty(capacity, dtype=np.int64)
        segments[: self.num], keys[: self.num] = self.segments, self.keys
        self._segments, self._keys = segments, keys
        self._bind(self.num)

    def _compact(self) -> None:
        kept = [(path, self.segments[first : first + count]) for path, (first, count) in self._spans.items()]
        capacity = 2 * self.num_live
        self.clear()
        self._reserve(capacity)
        for path, segments in kept:
            self.add(path, segments)

    def _bind(self, num: int) -> None:
        self._digest = None
        self.num = num
        self.segments, self.keys = self._segments[:num], self._keys[:num]
