"""All waypoint paths, in one pair of arrays, so that one search serves all entities that follow one.

A path is stored as its straight segments, end to end after those of the other paths. Each segment has an integer *key*:
where it begins, in 2^-26 m (15 nm), counted from the *base* of its path. Keys grow along the whole store, so
`numpy.searchsorted` finds the segments of any number of entities at once. Because keys are integers, the result depends
on the arc length alone, and not on where in the store a path is. (With floating-point keys the same drive would differ
in its last bits after another entity's path is removed.)

*The heading* of a row is not that of a leg, because a car does not jerk at a waypoint. It is the mean direction of the
path from the row to `reach` ahead, with d(u) the direction of the leg at arc length u, counted on over full turns:

    yaw(s) = 1 / reach * integral of d(u) du from s to s + reach

With the wheelbase as reach, this is nearly the line from the rear axle to the front axle, if both are on the path. So a
corner is turned evenly over one reach, and the yaw rate is at most speed * (angles of the corners within reach) /
reach. Between places where a corner is at either end of the window, yaw(s) is a straight line. So the segments end
there as well, and each holds its heading and the change of it. Legs shorter than half the reach are not cut: on them
the heading is a straight line between its true values at both ends.

A removed path leaves a hole. When the holes are more than half, the store is compacted. So any number of additions and
removals needs memory for the paths in use alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import blake2b
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, arc_lengths, distinct, wrap_angle

KEYS_PER_METRE: Final = float(1 << 26)
"""Key units in a metre: 15 nm each, far below the digits of any file."""

MAX_PATH_LENGTH: Final = 1e6
"""The longest path [m]: longer than any drive, and its keys fit an int64."""

MAX_KEY: Final = 1 << 62
"""The last key of a store: 69 million km of paths."""

MIN_SEGMENT: Final = 1e-6
"""A shorter step between waypoints is rounding in a file, and has no direction [m]."""

MIN_SEGMENTS: Final = 64
"""Segments that memory is taken for at least."""

STRAIGHT: Final = 1e-9
"""Two legs with at most this angle between them need no cut [rad]: it is rounding."""

WRAP_MARGIN: Final = 1e-12
"""A heading that changes stays so far from +-pi that rounding cannot bring it beyond [rad]."""

# Columns of a segment; see `lay_segments`.
START, END, X, Y, Z, DX, DY, DZ, YAW, TURN = range(10)
NUM_COLUMNS: Final = 10

Segments = FloatArray
"""(k, 10), one row for each segment; see `lay_segments`."""


MAX_KNOWN_POINTS: Final = 250
"""Points of a path whose segments are remembered: a pedestrian's or a vehicle's way through a town has some dozens."""

MAX_KNOWN_PATHS: Final = 256
"""Paths whose segments are remembered: those of a few scenarios, in 15 MB at most. 40 paths take 20 ms to lay, and a
load that is repeated, or was rehearsed in another thread, must not stop the world for so long."""


def lay_segments(points: FloatArray, *, is_loop: bool, reach: float) -> Segments:
    """Return the segments of a polyline: its legs, cut where the heading starts or stops to change.

    Do not write into them: those of short paths are remembered.

    Args:
        points: (m, 3) vertices, east, north, up [m]. Vertices that repeat the one before are left out.
        is_loop: the last vertex is joined to the first.
        reach: length over which the heading is averaged, positive; see the head of this file [m].

    Returns:
        (k, 10), one row each: arc length at its start and end [m], start point x, y, z [m], direction in space (a unit
        vector), heading at its start [rad] and change of the heading [rad/m]. The end of the last one is the length
        of the path.

    Raises:
        ValueError: the points are no finite polyline in space, or it is shorter than a micrometre or longer than
            `MAX_PATH_LENGTH`.
    """
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():  # noqa: PLR2004 - x, y, z
        raise ValueError(f"path: expected finite points of shape (m, 3), got shape {points.shape}")
    if len(points) <= MAX_KNOWN_POINTS:
        return _lay_once(points.astype(np.float64).tobytes(), is_loop, reach)
    return _lay(points, is_loop=is_loop, reach=reach)


@lru_cache(MAX_KNOWN_PATHS)
def _lay_once(data: bytes, is_loop: bool, reach: float) -> Segments:  # noqa: FBT001 - the cache wants it so
    segments = _lay(np.frombuffer(data, np.float64).reshape(-1, 3), is_loop=is_loop, reach=reach)
    segments.flags.writeable = False
    return segments


def _lay(points: FloatArray, *, is_loop: bool, reach: float) -> Segments:
    if is_loop and len(points):
        points = np.concatenate([points, points[:1]])
    # One pass: of a run of tiny steps each single one is left out, which matters to no real file.
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)) > MIN_SEGMENT
    points = points[is_new]
    if len(points) < 2:  # noqa: PLR2004 - a segment has two ends
        raise ValueError("path: expected at least two different points")
    arcs = arc_lengths(points)
    if not arcs[-1] <= MAX_PATH_LENGTH:
        raise ValueError(f"path: expected at most {MAX_PATH_LENGTH:g} m, got {arcs[-1]:g} m")
    step = np.diff(points, axis=0)
    direction = step / np.diff(arcs)[:, None]
    cuts, yaw = _cut(arcs, _headings(step), reach, is_loop=is_loop)
    starts = cuts[:-1]
    leg = arcs[1:-1].searchsorted(starts, side="right")
    segments = np.empty((len(starts), NUM_COLUMNS))
    segments[:, START], segments[:, END] = starts, cuts[1:]
    segments[:, X : Z + 1] = points[leg] + (starts - arcs[leg])[:, None] * direction[leg]
    segments[:, DX : DZ + 1] = direction[leg]
    segments[:, YAW] = yaw[:, 0]
    segments[:, TURN] = (yaw[:, 1] - yaw[:, 0]) / np.diff(cuts)
    return segments


def _cut(arcs: FloatArray, direction: FloatArray, reach: float, *, is_loop: bool) -> tuple[FloatArray, FloatArray]:
    """Return where segments begin and end, (k + 1,), and the headings at both ends of each, (k, 2).

    Args:
        arcs: (m + 1,) arc lengths of the vertices [m].
        direction: (m,) directions of the legs [rad].
        reach: see the head of this file [m].
        is_loop: the path continues on its first leg.
    """
    length = float(arcs[-1])
    course = np.unwrap(direction)
    edges = arcs
    if is_loop:  # twice round, so that the window lies within
        reach = min(reach, length)
        turn = course[-1] + wrap_angle(direction[0] - direction[-1]) - course[0]
        edges, course = np.concatenate([arcs, length + arcs[1:]]), np.concatenate([course, course + turn])
    else:  # beyond its end it continues straight
        edges = np.append(arcs, length + reach)
        course = np.append(course, course[-1])
    total = np.concatenate([[0.0], np.cumsum(course * np.diff(edges))])
    # A short leg is not cut. Nor is a tiny piece cut off, which would have no direction of its own.
    enters = edges[1:-1][np.abs(np.diff(course)) > STRAIGHT] - reach
    leg = np.minimum(edges[1:].searchsorted(enters, side="right"), len(edges) - 2)
    is_far = np.minimum(enters - edges[leg], edges[leg + 1] - enters) > MIN_SEGMENT
    is_long = edges[leg + 1] - edges[leg] > 0.5 * reach
    enters = enters[is_far & is_long & (enters > 0.0) & (enters < length)]
    cuts = distinct(np.concatenate([arcs, enters]))
    ahead = np.minimum(cuts + reach, edges[-1])
    heading = (np.interp(ahead, edges, total) - np.interp(cuts, edges, total)) / reach
    heading = np.stack([heading[:-1], heading[1:]], axis=1)
    # Where all legs in the window have one direction, the heading is theirs to the last bit.
    first = edges[1:-1].searchsorted(cuts[:-1], side="right")
    last = edges[1:-1].searchsorted(ahead[1:], side="left")
    bends = np.concatenate([[0], np.cumsum(np.diff(course) != 0.0)])
    is_straight = bends[first] == bends[last]
    heading[is_straight] = course[first[is_straight], None]
    return _wrap_segments(cuts, heading)


def _wrap_segments(cuts: FloatArray, heading: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bring headings into (-pi, pi], and cut segments within which they pass due west.

    Args:
        cuts: (k + 1,) where segments begin and end [m].
        heading: (k, 2) headings at both ends of each [rad].

    Returns:
        The same arrays, with the new cuts.
    """
    turns = np.floor((heading + math.pi) / math.tau)
    crossings: list[float] = []
    for i in np.flatnonzero(turns[:, 0] != turns[:, 1]).tolist():  # rare
        (here, there), (start, end) = heading[i].tolist(), cuts[i : i + 2].tolist()
        if there == here:
            continue
        low, high = sorted(turns[i].tolist())
        for turn in np.arange(low + 1.0, high + 1.0).tolist():
            part = (turn * math.tau - math.pi - here) / (there - here)
            at = start + part * (end - start)
            if start + MIN_SEGMENT < at < end - MIN_SEGMENT:
                crossings.append(at)
    if crossings:
        more = distinct(np.concatenate([cuts, crossings]))
        owner = cuts[1:-1].searchsorted(more[:-1], side="right")
        part = np.stack([more[:-1] - cuts[owner], more[1:] - cuts[owner]], axis=1) / np.diff(cuts)[owner, None]
        heading = heading[owner, :1] + part * (heading[owner, 1:] - heading[owner, :1])
        cuts = more
    middle = np.floor((heading.mean(axis=1) + math.pi) / math.tau)
    wrapped = np.clip(heading - middle[:, None] * math.tau, WRAP_MARGIN - math.pi, math.pi - WRAP_MARGIN)
    is_straight = heading[:, 0] == heading[:, 1]
    wrapped[is_straight] = wrap_angle(heading[is_straight])
    return cuts, wrapped


def _headings(step: FloatArray) -> FloatArray:
    """Return the yaw of each leg, (m,) within (-pi, pi] [rad]; a vertical leg has the yaw of the one before.

    Args:
        step: (m, 3) from the start of each leg to its end [m].
    """
    yaw = np.arctan2(step[:, 1], step[:, 0])
    yaw[yaw == -np.pi] = np.pi
    is_flat = (step[:, 0] != 0.0) | (step[:, 1] != 0.0)
    last = np.maximum.accumulate(np.where(is_flat, np.arange(len(step)), 0))
    return np.asarray(yaw[last])


@dataclass(frozen=True, slots=True)
class PathsSnapshot:
    """A copy of a store.

    Attributes:
        segments: (k, 10).
        keys: (k,) int64.
        spans: for each path its first segment and their count.
        next_base: the first free key.
        contents: those hashes of single paths that are known, see `Paths.content_of`.
    """

    segments: Segments
    keys: IntArray
    spans: dict[int, tuple[int, int]]
    next_base: int
    contents: dict[int, bytes] = field(default_factory=dict, compare=False)


class Paths:
    """The store of all paths in use, by the ids of the entities that follow them.

    Attributes:
        segments: (num, 10) see `lay_segments`.
        keys: (num,) int64, rising: the start of each segment in key units, plus the base of its path.
        num, num_live: segments in the store, with and without the holes.
    """

    def __init__(self) -> None:
        self._digest: bytes | None = None  # of the present content
        self._snapshot: PathsSnapshot | None = None  # the same
        self.clear()

    def clear(self) -> None:
        """Remove all paths."""
        self._segments: Segments = np.empty((MIN_SEGMENTS, NUM_COLUMNS))
        self._keys: IntArray = np.empty(MIN_SEGMENTS, dtype=np.int64)
        self._spans: dict[int, tuple[int, int]] = {}  # in the order of the store
        self._contents: dict[int, bytes] = {}
        self.next_base = 0
        self.num_live = 0
        self._bind(0)

    def add(self, path: int, segments: Segments) -> int:
        """Store a path after the others and return its base, the key where it begins.

        Args:
            path: id of the path, not in use.
            segments: (k, 10), see `lay_segments`.

        Raises:
            ValueError: the keys are used up. The store is as it was.
        """
        first, count, base = self.num, len(segments), self.next_base
        next_base = self.check_room(segments)
        if first + count > len(self._keys):
            self._reserve(2 * (first + count))
        self._segments[first : first + count] = segments
        self._keys[first : first + count] = base + np.floor(segments[:, START] * KEYS_PER_METRE).astype(np.int64)
        self._spans[path] = (first, count)
        self.next_base = next_base
        self.num_live += count
        self._bind(first + count)
        return base

    def check_room(self, segments: Segments) -> int:
        """Return the first free key behind a path that is added now.

        Raises:
            ValueError: the keys would be used up.
        """
        # One key beyond the end of the path keeps an entity that stands exactly there on its own path.
        next_base = self.next_base + int(segments[-1, END] * KEYS_PER_METRE) + 2
        if next_base > MAX_KEY:
            raise ValueError(f"path: the paths in use are longer together than {MAX_KEY / KEYS_PER_METRE:g} m")
        return next_base

    def remove(self, path: int) -> bool:
        """Remove a path.

        Returns:
            True when the store was compacted, so that every `base` must be read again.
        """
        _, count = self._spans.pop(path)
        self._contents.pop(path, None)
        self._digest = self._snapshot = None
        self.num_live -= count
        if 2 * self.num_live >= self.num and self.next_base < MAX_KEY // 2:
            return False
        self._compact()
        return True

    def base(self, path: int) -> int:
        """Return the key where a path begins."""
        return int(self._keys[self._spans[path][0]])

    def of(self, path: int) -> Segments:
        """Return the segments of a path, (k, 10); do not write into the array."""
        first, count = self._spans[path]
        return self.segments[first : first + count]

    def content_of(self, path: int) -> bytes:
        """Return a hash of the segments of a path. It is kept, for all are asked for when an actor comes or goes."""
        content = self._contents.get(path)
        if content is None:
            content = self._contents[path] = blake2b(self.of(path).tobytes(), digest_size=16).digest()
        return content

    def find(self, base: IntArray, arc: FloatArray) -> Segments:
        """Return the segments, (..., 10), at arc lengths (..., k) of the paths whose bases (k,) are given."""
        keys = base + (arc * KEYS_PER_METRE).astype(np.int64)
        return self.segments.take(self.keys.searchsorted(keys, side="right") - 1, axis=0)

    def digest(self) -> bytes:
        """Return a hash of the whole store. The store is most of a world and changes rarely, so the hash is kept."""
        if self._digest is None:
            state = blake2b(digest_size=16)
            state.update(repr((self.next_base, list(self._spans.items()))).encode())
            state.update(self.segments.tobytes() + self.keys.tobytes())
            self._digest = state.digest()
        return self._digest

    def snapshot(self) -> PathsSnapshot:
        """Return a copy for `restore`, the same one until the store changes: it is most of a world."""
        if self._snapshot is None:
            self._snapshot = PathsSnapshot(
                self.segments.copy(), self.keys.copy(), dict(self._spans), self.next_base, dict(self._contents)
            )
        return self._snapshot

    def restore(self, saved: PathsSnapshot) -> None:
        """Become what a snapshot holds; the snapshot can be used again."""
        self.clear()
        num = len(saved.keys)
        self._reserve(num)
        self._segments[:num], self._keys[:num] = saved.segments, saved.keys
        self._spans, self._contents = dict(saved.spans), dict(saved.contents)
        self.next_base = saved.next_base
        self.num_live = sum(count for _, count in self._spans.values())
        self._bind(num)
        self._snapshot = saved

    def _reserve(self, capacity: int) -> None:
        capacity = max(MIN_SEGMENTS, capacity)
        segments, keys = np.empty((capacity, NUM_COLUMNS)), np.empty(capacity, dtype=np.int64)
        segments[: self.num], keys[: self.num] = self.segments, self.keys
        self._segments, self._keys = segments, keys
        self._bind(self.num)

    def _compact(self) -> None:
        kept = [(path, self.segments[first : first + count]) for path, (first, count) in self._spans.items()]
        capacity, contents = 2 * self.num_live, self._contents
        self.clear()
        self._reserve(capacity)
        for path, segments in kept:
            self.add(path, segments)
        self._contents = contents

    def _bind(self, num: int) -> None:
        self._digest = self._snapshot = None
        self.num = num
        self.segments, self.keys = self._segments[:num], self._keys[:num]
