"""A recorded drive as plain arrays, and its state at any moment.

A recording has one track for each ego and one for all other objects. Each track has its own stamps, because topics are
recorded at different rates. A moment that equals a stamp gives the recorded values, to the last bit. A moment between
two stamps is interpolated, unless the two are too far apart in time or space to be one motion.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import blake2b
from typing import Final

import numpy as np

from rosbridge_sim.records import Record, replace
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.replays.recorded_plans import RecordedPlan
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_UID, BoolArray, Kind

EGO_COLUMNS: Final = (
    *("x", "y", "z", "roll", "pitch", "yaw"),
    *("speed", "lateral_speed", "climb", "accel", "lateral_accel", "climb_accel", "yaw_rate"),
    *("steer", "throttle", "brake"),
)
"""Values of an ego's track: columns of the world, in its units."""

OBJECT_COLUMNS: Final = (
    *("x", "y", "z", "yaw", "speed", "lateral_speed", "climb"),
    *("accel", "lateral_accel", "climb_accel"),
)
"""Values of the track of all other objects."""

MAX_FRAME_GAP_NS: Final = 1_000_000_000
"""Longest time between two stamps that is interpolated [ns]: a longer one is a gap in the recording."""

MAX_RECORDED_SPEED: Final = 100.0
"""Highest speed from one stamp to the next that is interpolated [m/s]: a faster change is a jump."""

MAX_STAMP: Final = 2**62
"""Bound of a stamp [ns], so that a difference of two is an int64."""

_ANGLES: Final = frozenset({"roll", "pitch", "yaw"})
_EGO_ANGLES: Final = np.array([name in _ANGLES for name in EGO_COLUMNS])
_OBJECT_ANGLES: Final = np.array([name in _ANGLES for name in OBJECT_COLUMNS])


class Actor(Record):
    """An object of a recording; not an ego.

    Attributes:
        uid: as recorded; its id in the world may be another one.
        kind: VEHICLE, PEDESTRIAN or OBSTACLE.
        name: the model's, as recorded.
        size: length, width, height [m]; as recorded, not checked.
    """

    uid: int
    kind: Kind
    name: str
    size: tuple[float, float, float]


class EgoTrack(Record, eq=False):
    """States of one ego over time.

    Attributes:
        stamps: (n,) int64, rising, n >= 1 [ns].
        values: (columns, n) float64, a row for each of `EGO_COLUMNS`; NaN where unknown.
    """

    stamps: IntArray
    values: FloatArray

    @property
    def has_place(self) -> bool:
        """True if it holds the position of the ego."""
        return not bool(np.isnan(self.values[0]).any())

    def at(self, stamp_ns: int) -> FloatArray:
        """Return the state at a moment.

        Args:
            stamp_ns: the moment, on the clock of the stamps [ns].

        Returns:
            (columns,) float64, as in `EGO_COLUMNS`.
        """
        i, part = _find(self.stamps, stamp_ns)
        if not part:
            return self.values[:, i]
        reach = _max_way(self.stamps, i)
        return _interpolate(self.values[:, i : i + 1], self.values[:, i + 1 : i + 2], part, reach, _EGO_ANGLES)[:, 0]


class ObjectTrack(Record, eq=False):
    """States of all objects but the egos over time.

    Attributes:
        stamps: (n,) int64, rising, n >= 1 [ns].
        starts: (n + 1,) int64: at stamp i the entries from starts[i] to starts[i + 1] hold.
        actor_indices: (k,) int64, indices into `actors`, each at most once at a stamp.
        values: (columns, k) float64, a row for each of `OBJECT_COLUMNS`.
        actors: all objects of the recording.
    """

    stamps: IntArray
    starts: IntArray
    actor_indices: IntArray
    values: FloatArray
    actors: tuple[Actor, ...]

    def at(self, stamp_ns: int) -> tuple[IntArray, FloatArray]:
        """Return the objects at a moment.

        Args:
            stamp_ns: the moment, on the clock of the stamps [ns].

        Returns:
            (m,) indices into `actors`, and (columns, m) float64 states, as in `OBJECT_COLUMNS`.
        """
        i, part = _find(self.stamps, stamp_ns)
        present, values = self._sample(i)
        if not part:
            return present, values
        next_present, next_values = self._sample(i + 1)
        _, here, there = np.intersect1d(present, next_present, return_indices=True)
        values = values.copy()  # an object that is gone at the next stamp keeps its state until then
        reach = _max_way(self.stamps, i)
        values[:, here] = _interpolate(values[:, here], next_values[:, there], part, reach, _OBJECT_ANGLES)
        return present, values

    def _sample(self, i: int) -> tuple[IntArray, FloatArray]:
        entries = slice(self.starts[i], self.starts[i + 1])
        return self.actor_indices[entries], self.values[:, entries]


class RecordedMoment(Record, eq=False):
    """State of all replayed entities at a moment.

    Attributes:
        egos: an ego's number -> (columns,) as in `EGO_COLUMNS`; NaN leaves the ego's value as it is.
        actors: the other objects.
        values: (columns, m) of these, as in `OBJECT_COLUMNS`.
    """

    egos: Mapping[int, FloatArray]
    actors: tuple[Actor, ...]
    values: FloatArray


@dataclass(frozen=True, eq=False)  # without slots, because the digest is kept
class Recording:
    """A recorded drive.

    Attributes:
        name: as clients call it.
        egos: an ego's number -> its track.
        objects: track of all others; None where the recording holds none.
        notes: remarks for the user.
        plans: what programs published that viewers draw; it moves nothing, and is no part of the digest.
    """

    name: str
    egos: Mapping[int, EgoTrack] = field(default_factory=dict)
    objects: ObjectTrack | None = None
    notes: tuple[str, ...] = ()
    plans: tuple[RecordedPlan, ...] = ()

    def without_plans(self, denied: Collection[RecordedPlan], note: str) -> Recording:
        """Return the same without some of the plans, and with a remark why."""
        plans = tuple([plan for plan in self.plans if plan not in denied])
        other = replace(self, plans=plans, notes=(*self.notes, note))
        other.__dict__["digest"] = self.digest  # it has taken a while
        return other

    @property
    def is_empty(self) -> bool:
        """True if there is nothing to show."""
        return not self.egos and self.objects is None

    @property
    def start_ns(self) -> int:
        """First stamp [ns]; an empty recording has none."""
        return int(min(stamps[0] for stamps in self._stamps()))

    @property
    def duration_ns(self) -> int:
        """Time from the first stamp to the last [ns]; an empty recording has none."""
        return int(max(stamps[-1] for stamps in self._stamps())) - self.start_ns

    @cached_property
    def digest(self) -> bytes:
        """16 bytes that stand for the tracks; those of large ones take a while, so the thread that reads asks first."""
        state = blake2b(repr((self.name, list(self.egos))).encode(), digest_size=16)
        for track in self.egos.values():
            state.update(track.stamps.tobytes())
            state.update(track.values.tobytes())
        if self.objects is not None:
            state.update(repr(self.objects.actors).encode())
            for column in (self.objects.stamps, self.objects.starts, self.objects.actor_indices, self.objects.values):
                state.update(column.tobytes())
        return state.digest()

    def moment(self, since_ns: int) -> RecordedMoment:
        """Return the state at a moment. A track that begins later shows its first entry.

        Args:
            since_ns: time since the first stamp of the recording [ns].

        Returns:
            The state of all replayed entities.
        """
        stamp_ns = self.start_ns + since_ns
        egos = {index: track.at(stamp_ns) for index, track in self.egos.items()}
        if self.objects is None:
            return RecordedMoment(egos, (), np.empty((len(OBJECT_COLUMNS), 0)))
        present, values = self.objects.at(stamp_ns)
        actors = self.objects.actors
        return RecordedMoment(egos, tuple([actors[i] for i in present.tolist()]), values)

    def _stamps(self) -> list[IntArray]:
        stamps = [track.stamps for track in self.egos.values()]
        return stamps if self.objects is None else [*stamps, self.objects.stamps]


def to_plain(recording: Recording) -> PlainData:
    """Return a recording as plain data; it is meant for the single moment of a network replay."""
    track, objects = recording.objects, None
    if track is not None:
        actors = [actor_to_plain(actor) for actor in track.actors]
        objects = (track.stamps, track.starts, track.actor_indices, track.values, actors)
    egos = [(index, ego.stamps, ego.values) for index, ego in recording.egos.items()]
    return {"name": recording.name, "egos": egos, "objects": objects}


def from_plain(data: PlainData) -> Recording:
    """Return the recording that `to_plain` was given.

    Raises:
        ValueError: it is no such data, or a figure is out of the world's bounds.
    """
    try:
        egos = {index: EgoTrack(stamps, values) for index, stamps, values in data["egos"]}
        objects = None
        if data["objects"] is not None:
            stamps, starts, indices, values, actors = data["objects"]
            objects = ObjectTrack(stamps, starts, indices, values, tuple([actor_from_plain(actor) for actor in actors]))
        for index, track in egos.items():
            _check(type(index) is int and 0 <= index < MAX_UID)
            _check_track(track.stamps, track.values, len(EGO_COLUMNS), len(track.stamps))
        if objects is not None:
            _check_track(objects.stamps, objects.values, len(OBJECT_COLUMNS), len(objects.actor_indices))
            starts, indices = objects.starts, objects.actor_indices
            _check(starts.dtype == np.int64 and starts.shape == (len(objects.stamps) + 1,))
            _check(int(starts[0]) == 0 and int(starts[-1]) == len(indices) and bool((np.diff(starts) >= 0).all()))
            _check(indices.dtype == np.int64 and indices.ndim == 1)
            _check(bool(((indices >= 0) & (indices < len(objects.actors))).all()))
            _check(not bool(np.isnan(objects.values).any()))
        _check(isinstance(data["name"], str) and bool(egos or objects))
        return Recording(data["name"], egos, objects)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise ValueError(f"recording: expected tracks with stamps and values ({error!r:.80})") from None


def actor_to_plain(actor: Actor) -> PlainData:
    """Return an object of a recording as plain data."""
    return (actor.uid, int(actor.kind), actor.name, actor.size)


def actor_from_plain(data: PlainData) -> Actor:
    """Return the object that `actor_to_plain` was given.

    Raises:
        ValueError: it is no such data.
    """
    uid, kind, name, size = data
    _check(type(uid) is int and type(kind) is int and isinstance(name, str) and isinstance(size, tuple))
    _check(len(size) == 3 and all(isinstance(length, float) for length in size))  # noqa: PLR2004 - the axes
    if kind == Kind.EGO:
        raise ValueError("recording: expected an object, no ego")
    return Actor(uid, Kind(kind), name, size)


def _check_track(stamps: IntArray, values: FloatArray, num_columns: int, num: int) -> None:
    _check(stamps.dtype == np.int64 and stamps.ndim == 1 and len(stamps) > 0 and bool((np.diff(stamps) > 0).all()))
    _check(bool((np.abs(stamps) < MAX_STAMP).all()))
    _check(values.dtype == np.float64 and values.shape == (num_columns, num))
    _check(bool((np.isnan(values) | (np.abs(values) <= MAX_COORDINATE)).all()))


def _check(is_good: bool) -> None:  # noqa: FBT001 - an assertion
    if not is_good:
        raise ValueError("recording: expected rising stamps, and values within the world's bounds")


def _find(stamps: IntArray, stamp_ns: int) -> tuple[int, float]:
    """Return the last entry at or before a moment, and the elapsed part (0..1) of the time to the next one."""
    i = max(int(stamps.searchsorted(stamp_ns, side="right")) - 1, 0)
    since = stamp_ns - int(stamps[i])
    if since <= 0 or i + 1 == len(stamps):
        return i, 0.0
    gap = int(stamps[i + 1]) - int(stamps[i])
    return i, since / gap if gap <= MAX_FRAME_GAP_NS else 0.0


def _max_way(stamps: IntArray, i: int) -> float:
    """Return the longest distance from a stamp to the next one that is not a jump [m]."""
    return MAX_RECORDED_SPEED * (int(stamps[i + 1]) - int(stamps[i])) / 1e9


def _interpolate(before: FloatArray, after: FloatArray, part: float, reach: float, is_angle: BoolArray) -> FloatArray:
    """Interpolate two states, (columns, m); an object that jumps keeps its position until the next stamp."""
    change = after - before
    change[is_angle] = wrap_angle(change[is_angle])
    change[:, np.hypot(change[0], change[1]) > reach] = 0.0
    return before + part * change
