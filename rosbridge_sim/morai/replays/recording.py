"""A recorded drive as plain arrays, and what it shows at a moment of it.

A recording has a track of each ego and one of everybody else. Each has its own stamps, for topics are recorded at rates
of their own. A moment that falls on a stamp shows what was recorded there, to the last bit; one between two stamps
shows what lies between both, unless they are too far apart in time or space to be one motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state import BoolArray, Kind

__all__ = ["EGO_COLUMNS", "OBJECT_COLUMNS", "Actor", "EgoTrack", "ObjectTrack", "RecordedMoment", "Recording"]

EGO_COLUMNS: Final = (
    *("x", "y", "z", "roll", "pitch", "yaw", "speed", "accel", "lateral_accel", "yaw_rate"),
    *("steer", "throttle", "brake"),
)
"""What a track tells of an ego: columns of the world, in its units."""

OBJECT_COLUMNS: Final = (
    *("x", "y", "z", "yaw", "speed", "lateral_speed", "climb"),
    *("accel", "lateral_accel", "climb_accel"),
)
"""What a track tells of anybody else."""

MAX_FRAME_GAP_NS: Final = 1_000_000_000
"""Between stamps that are farther apart nothing is known [ns]."""

MAX_RECORDED_SPEED: Final = 100.0
"""Who was faster than this from one stamp to the next has been put elsewhere and has not driven there [m/s]."""

_ANGLES: Final = frozenset({"roll", "pitch", "yaw"})
_EGO_ANGLES: Final = np.array([name in _ANGLES for name in EGO_COLUMNS])
_OBJECT_ANGLES: Final = np.array([name in _ANGLES for name in OBJECT_COLUMNS])


@dataclass(frozen=True, slots=True)
class Actor:
    """Somebody in a recording who is no ego.

    Attributes:
        uid: as recorded; no number of the world's yet.
        kind: VEHICLE, PEDESTRIAN or OBSTACLE.
        name: of the model, as recorded.
        size: length, width, height [m]; as recorded, so anything.
    """

    uid: int
    kind: Kind
    name: str
    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class EgoTrack:
    """One ego's way.

    Attributes:
        stamps: (n,) int64, rising, n >= 1 [ns].
        values: (columns, n) float64, a row for each of `EGO_COLUMNS`; NaN is not known.
    """

    stamps: IntArray
    values: FloatArray

    @property
    def has_place(self) -> bool:
        """Whether it tells where the ego is."""
        return not bool(np.isnan(self.values[0]).any())

    def at(self, stamp_ns: int) -> FloatArray:
        """Its (columns,) at a moment."""
        i, part = _find(self.stamps, stamp_ns)
        if not part:
            return self.values[:, i]
        reach = _reach(self.stamps, i)
        return _between(self.values[:, i : i + 1], self.values[:, i + 1 : i + 2], part, reach, _EGO_ANGLES)[:, 0]


@dataclass(frozen=True, slots=True, eq=False)
class ObjectTrack:
    """Everybody else's ways.

    Attributes:
        stamps: (n,) int64, rising, n >= 1 [ns].
        starts: (n + 1,) int64: at stamp i the entries from starts[i] to starts[i + 1] hold.
        who: (k,) int64, indices into `cast`, each at most once at a stamp.
        values: (columns, k) float64, a row for each of `OBJECT_COLUMNS`.
        cast: all who ever appear.
    """

    stamps: IntArray
    starts: IntArray
    who: IntArray
    values: FloatArray
    cast: tuple[Actor, ...]

    def at(self, stamp_ns: int) -> tuple[IntArray, FloatArray]:
        """Who is there at a moment, (m,) indices into `cast`, and their (columns, m)."""
        i, part = _find(self.stamps, stamp_ns)
        who, values = self._sample(i)
        if not part:
            return who, values
        later, then = self._sample(i + 1)
        _, here, there = np.intersect1d(who, later, return_indices=True)
        values = values.copy()  # whoever has left by then stays where he was
        values[:, here] = _between(values[:, here], then[:, there], part, _reach(self.stamps, i), _OBJECT_ANGLES)
        return who, values

    def _sample(self, i: int) -> tuple[IntArray, FloatArray]:
        entries = slice(self.starts[i], self.starts[i + 1])
        return self.who[entries], self.values[:, entries]


@dataclass(frozen=True, slots=True, eq=False)
class RecordedMoment:
    """How the world is to look at a moment.

    Attributes:
        egos: an ego's number -> (columns,) as in `EGO_COLUMNS`; NaN leaves it as it is.
        cast: who else is there.
        values: (columns, m) of these, as in `OBJECT_COLUMNS`.
    """

    egos: Mapping[int, FloatArray]
    cast: tuple[Actor, ...]
    values: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A recorded drive.

    Attributes:
        name: as a client calls it.
        egos: an ego's number -> its track.
        objects: None where the recording tells nothing of them.
        notes: what a person should know of it.
    """

    name: str
    egos: Mapping[int, EgoTrack] = field(default_factory=dict)
    objects: ObjectTrack | None = None
    notes: tuple[str, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to show."""
        return not self.egos and self.objects is None

    @property
    def start_ns(self) -> int:
        """Its first stamp [ns]; not of an empty one."""
        return int(min(stamps[0] for stamps in self._stamps()))

    @property
    def duration_ns(self) -> int:
        """From its first stamp to its last [ns]; not of an empty one."""
        return int(max(stamps[-1] for stamps in self._stamps())) - self.start_ns

    def scene(self, since_ns: int) -> RecordedMoment:
        """What it shows so long after its first stamp [ns]; a track that has not begun shows its first entry."""
        stamp_ns = self.start_ns + since_ns
        egos = {index: track.at(stamp_ns) for index, track in self.egos.items()}
        if self.objects is None:
            return RecordedMoment(egos, (), np.empty((len(OBJECT_COLUMNS), 0)))
        who, values = self.objects.at(stamp_ns)
        cast = self.objects.cast
        return RecordedMoment(egos, tuple([cast[i] for i in who.tolist()]), values)

    def _stamps(self) -> list[IntArray]:
        stamps = [track.stamps for track in self.egos.values()]
        return stamps if self.objects is None else [*stamps, self.objects.stamps]


def _find(stamps: IntArray, stamp_ns: int) -> tuple[int, float]:
    """The entry that a moment falls on or behind, and which part of the way to the next one it has gone."""
    i = max(int(stamps.searchsorted(stamp_ns, side="right")) - 1, 0)
    since = stamp_ns - int(stamps[i])
    if since <= 0 or i + 1 == len(stamps):
        return i, 0.0
    gap = int(stamps[i + 1]) - int(stamps[i])
    return i, since / gap if gap <= MAX_FRAME_GAP_NS else 0.0


def _reach(stamps: IntArray, i: int) -> float:
    """How far anybody drives from a stamp to the next one [m]."""
    return MAX_RECORDED_SPEED * (int(stamps[i + 1]) - int(stamps[i])) / 1e9


def _between(before: FloatArray, after: FloatArray, part: float, reach: float, is_angle: BoolArray) -> FloatArray:
    """Part of the way from one state to the next, (columns, m); who jumps stays where he was until he does."""
    change = after - before
    change[is_angle] = wrap_angle(change[is_angle])
    change[:, np.hypot(change[0], change[1]) > reach] = 0.0
    return before + part * change
