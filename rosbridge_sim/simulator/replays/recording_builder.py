"""Recordings built from recorded messages, converted from the messages' units into the world's.

`RecordingBuilder` takes messages one by one, from a bag or from the bus, and makes arrays of them. They may be of
either release: a renamed field is looked up under both names. Units that a message does not name are taken from the
profile in use, which is right for the simulator's own recordings. Their values are restored exactly.

An entry with a value that the world cannot hold (not a number, or out of range) is left out, with a note.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.morai.messages.object_lists import DEGREES, EGO_TYPE, exact_quotient
from rosbridge_sim.printable import printable
from rosbridge_sim.simulator.replays.recorded_drive import (
    EGO_COLUMNS,
    OBJECT_COLUMNS,
    Actor,
    EgoTrack,
    ObjectTrack,
    Recording,
)
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_SPEED, Kind

MAX_RECORDED_ENTRIES: Final = 2_000_000
"""Largest number of states of objects, and of each ego, in a recording: 20 objects at 50 Hz for half an hour are 1.8
million states, and 0.4 GB while they are read."""

MAX_NOTES: Final = 20
"""Remarks about a recording: each is a line of the log and a status for the caller."""

MAX_NOTE: Final = 300
"""Longest remark [characters]."""

EARLIEST_WALL_TIME: Final = 10**18
"""Smallest stamp that is wall-clock time: September 2001 [ns]. No simulated time grows so large."""

_LISTS: Final = (("npc_list", Kind.VEHICLE), ("pedestrian_list", Kind.PEDESTRIAN), ("obstacle_list", Kind.OBSTACLE))
_NUM_FIGURES: Final = 13  # of an ObjectStatus
_VELOCITY: Final = [OBJECT_COLUMNS.index(name) for name in ("speed", "lateral_speed", "climb")]
_Z = 2
_SPEEDS: Final = [EGO_COLUMNS.index(name) for name in ("speed", "climb")]
_YAW, _YAW_RATE = EGO_COLUMNS.index("yaw"), EGO_COLUMNS.index("yaw_rate")

Then = Callable[[Recording | DocumentError, float], None]
"""Takes the recording, or the error that prevented it; and monotonic time [s]."""


class Recordings(Protocol):
    """Source of recordings; the shell reads them from the disk."""

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        """Read the recording that a client names; this may take seconds.

        Args:
            reading: takes the messages.
            then: called once, perhaps before this returns, and never while frames are being computed.
        """


MessageStamps = tuple[int, int]
"""Stamp of a message's header, and the time at which the bag's recorder received it [ns]."""


class _Rows:
    """Entries with a fixed number of values, each with its stamps."""

    def __init__(self, num_figures: int) -> None:
        self.header_stamps = array("q")
        self.arrival_stamps = array("q")
        self.figures = array("d")
        self._num_figures = num_figures

    def stamps(self, *, by_header: bool) -> IntArray:
        return np.array(self.header_stamps if by_header else self.arrival_stamps, dtype=np.int64)

    def table(self) -> FloatArray:
        """Return all values, (figures, n)."""
        return np.array(self.figures).reshape(-1, self._num_figures).T


class RecordingBuilder:
    """Collects messages, and makes a `Recording` of them."""

    def __init__(self, name: str, convert: Converter) -> None:
        """Start with an empty recording.

        Args:
            name: the recording's, as clients call it.
            convert: its profile gives the units.
        """
        self.name = name
        self._convert = convert
        self._egos: dict[int, _Rows] = {}
        self._without_position: set[int] = set()
        self._samples = _Rows(0)
        self._counts = array("q")
        self._actor_indices = array("q")
        self._figures = array("d")
        self._actors: dict[tuple[int, Kind, str], int] = {}
        self._notes: list[str] = []
        self._num_notes = 0

    # In

    def take_ego(self, index: int, message: Any, stamps: MessageStamps) -> None:  # noqa: ANN401 - whatever has the fields
        """Take an EgoVehicleStatus.

        Args:
            message: any object with the fields of the type.

        Raises:
            DocumentError: the recording has too many states.
        """
        place, velocity, accel = message.position, message.velocity, message.acceleration
        factor = DEGREES if self._convert.profile.wheel_angle_unit == "deg" else 1.0
        angle = getattr(message, "wheel_angle", None)
        # The field with the newer name is in degrees in any profile.
        steer = getattr(message, "front_steer_angle", 0.0) / DEGREES if angle is None else angle / factor
        figures = (
            *(place.x, place.y, place.z, 0.0, 0.0, message.heading),
            *(velocity.x, velocity.y, velocity.z, accel.x, accel.y, accel.z, math.nan),
            *(steer, message.accel, message.brake),
        )
        self._add_ego(index, stamps, figures)

    def take_pedals(self, message: Any, stamps: MessageStamps) -> None:  # noqa: ANN401 - whatever has the fields
        """Take the first ego of a ReplayInfo: its pedals and orientation. The message holds no position.

        Args:
            message: any object with the fields of the type.

        Raises:
            DocumentError: the recording has too many states.
        """
        self._without_position.add(0)
        turn, accel = message.orientation, message.linear_acceleration
        roll, pitch, yaw = _angles(turn.x, turn.y, turn.z, turn.w)
        figures = (
            *(math.nan, math.nan, math.nan, roll, pitch, yaw),
            *(0.0, 0.0, 0.0, accel.x, accel.y, accel.z, message.angular_velocity.z),
            *(message.ego_steer / DEGREES, message.ego_acc, message.ego_brake),
        )
        self._add_ego(0, stamps, figures)

    def take_objects(self, message: Any, stamps: MessageStamps) -> None:  # noqa: ANN401 - whatever has the fields
        """Take the lists of an ObjectStatusList or ReplayInfo.

        Egos in them are left out, because they have their own topics.

        Args:
            message: any object with the fields of the type.

        Raises:
            DocumentError: the recording has too many states.
        """
        who: list[tuple[int, Kind, str]] = []
        figures = array("d")
        for name, kind in _LISTS:
            for one in getattr(message, name, ()):
                if getattr(one, "type", None) == EGO_TYPE:  # another program's definition may lack it
                    continue
                velocity, accel, size, place = one.velocity, one.acceleration, one.size, one.position
                who.append((one.unique_id, kind, one.name))
                figures.extend((one.heading, velocity.x, velocity.y, velocity.z, accel.x, accel.y, accel.z))
                figures.extend((size.x, size.y, size.z, place.x, place.y, place.z))
        self.take_sample(who, figures.tobytes(), stamps)

    def take_sample(self, who: Sequence[tuple[int, Kind, str]], figures: bytes, stamps: MessageStamps) -> None:
        """Take object lists that have been decoded already.

        Args:
            who: unique_id, kind and name of each object.
            figures: 13 float64 of each in the order of an ObjectStatus: heading, then x, y, z of velocity,
                acceleration, size and position.

        Raises:
            DocumentError: the recording has too many states.
        """
        actors = self._actors
        self._actor_indices.extend([actors.setdefault(one, len(actors)) for one in who])
        self._figures.frombytes(figures)
        self._samples.header_stamps.append(stamps[0])
        self._samples.arrival_stamps.append(stamps[1])
        self._counts.append(len(who))
        self._check_size(len(self._actor_indices) + len(self._counts))

    def note(self, text: str) -> None:
        """Add a remark for the user; of many, the first ones are kept.

        Args:
            text: one line; names in it may be any text, of any length.
        """
        self._num_notes += 1
        if len(self._notes) < MAX_NOTES:
            self._notes.append(" ".join(printable(text, MAX_NOTE).split()))

    def _add_ego(self, index: int, stamps: MessageStamps, figures: Sequence[float]) -> None:
        """Add a row in the order of `EGO_COLUMNS`."""
        rows = self._egos.setdefault(index, _Rows(len(EGO_COLUMNS)))
        rows.header_stamps.append(stamps[0])
        rows.arrival_stamps.append(stamps[1])
        rows.figures.extend(figures)
        self._check_size(len(rows.header_stamps))

    def _check_size(self, num: int) -> None:
        if num > MAX_RECORDED_ENTRIES:
            raise DocumentError(
                f"{self.name}: expected at most {MAX_RECORDED_ENTRIES:,} states; cut it into shorter recordings"
            )

    # Out

    def finish(self) -> Recording:
        """Return the recording of all messages that were taken.

        Returns:
            The recording; an ego without a usable state is left out.
        """
        all_rows = [*self._egos.values(), self._samples]
        by_header = all(_can_be_time(rows.stamps(by_header=True)) for rows in all_rows)
        if any(_is_wall_time(rows.stamps(by_header=True)) for rows in all_rows):
            # The recorder uses simulated time, as ours does. Wall-clock headers show computing time and are not used.
            by_header &= any(_is_wall_time(rows.stamps(by_header=False)) for rows in all_rows)
        egos = {index: self._ego_track(index, rows, by_header=by_header) for index, rows in sorted(self._egos.items())}
        objects = self._object_track(by_header=by_header) if self._samples.header_stamps else None
        more = self._num_notes - len(self._notes)
        notes = (*self._notes, *([f"and {more} more remarks like these"] if more else []))
        return Recording(self.name, {index: track for index, track in egos.items() if track}, objects, notes)

    def _ego_track(self, index: int, rows: _Rows, *, by_header: bool) -> EgoTrack | None:
        values, stamps = rows.table().copy(), rows.stamps(by_header=by_header)
        keep = _order(stamps)
        values, stamps = values[:, keep], stamps[keep]
        has_place = index not in self._without_position
        is_good = self._are_good(values, f"of ego {index}", has_place=has_place)
        values, stamps = values[:, is_good], stamps[is_good]
        if not len(stamps):
            return None
        if has_place:  # a ReplayInfo holds an orientation, which is in radians already
            values[_YAW] = exact_quotient(values[_YAW], DEGREES)
            turn, time = wrap_angle(np.diff(values[_YAW])), np.diff(stamps) / 1e9
            rate = turn / time
            values[_YAW_RATE] = np.concatenate([rate[:1], rate]) if len(rate) else 0.0
        return EgoTrack(stamps, values)

    def _are_good(self, values: FloatArray, whose: str, *, has_place: bool) -> BoolArray:
        """Return which entries the world can hold; pedals and angles must be numbers, of any size."""
        checked = values.copy()
        if has_place:
            checked[_YAW_RATE] = 0.0  # computed from the headings later
        else:
            checked[: _Z + 1] = 0.0
            checked[_YAW] = np.nan_to_num(checked[_YAW])
        limits = np.full((len(values), 1), MAX_COORDINATE)
        limits[_SPEEDS] = MAX_SPEED
        is_good = (np.abs(checked) <= limits).all(axis=0)
        self._note_bad(int(np.count_nonzero(~is_good)), whose)
        return np.asarray(is_good)

    def _object_track(self, *, by_header: bool) -> ObjectTrack:
        stamps, counts = self._samples.stamps(by_header=by_header), np.array(self._counts, dtype=np.int64)
        starts = np.concatenate([[0], np.cumsum(counts)])
        indices = np.array(self._actor_indices, dtype=np.int64)
        values, sizes = self._convert_objects(np.array(self._figures).reshape(-1, _NUM_FIGURES).T)
        limits = np.full((len(OBJECT_COLUMNS), 1), MAX_COORDINATE)
        limits[_VELOCITY] = MAX_SPEED
        is_good = (np.abs(values) <= limits).all(axis=0)
        sample = np.repeat(np.arange(len(stamps)), counts)
        # An object that is in a sample twice counts once.
        _, first = np.unique(np.stack([sample, indices]), axis=1, return_index=True)
        is_first = np.zeros(len(indices), dtype=bool)
        is_first[first] = True
        self._note_bad(int(np.count_nonzero(~is_good)), "of an object")
        actors = self._find_actors(indices, sizes)

        keep = _order(stamps)
        entries = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in keep.tolist()] or [starts[:0]])
        entries = entries[(is_good & is_first)[entries]]
        counts = np.bincount(sample[entries], minlength=len(stamps))[keep]
        return ObjectTrack(
            stamps[keep], np.concatenate([[0], np.cumsum(counts)]), indices[entries], values[:, entries], actors
        )

    def _convert_objects(self, figures: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return `OBJECT_COLUMNS`, and length, width, height [m], of all entries, (columns, k) each."""
        profile = self._convert.profile
        is_width_first = profile.object_size_order == "width-length-height"
        sizes = figures[[8, 7, 9] if is_width_first else [7, 8, 9]]
        heading, velocity, accel = figures[0], figures[1:4], figures[4:7]
        factor = MPS_TO_KMH if profile.object_velocity_unit == "km/h" else 1.0
        yaw = exact_quotient(heading, DEGREES)
        return np.stack([*figures[10:], yaw, *exact_quotient(velocity, factor), *accel]), sizes

    def _find_actors(self, indices: IntArray, sizes: FloatArray) -> tuple[Actor, ...]:
        """Return all objects of the recording, each with its first size."""
        _, first = np.unique(indices, return_index=True)
        found = zip(self._actors, sizes[:, first].T.tolist(), strict=True)
        return tuple([Actor(uid, kind, name, (size[0], size[1], size[2])) for (uid, kind, name), size in found])

    def _note_bad(self, num: int, whose: str) -> None:
        if num:
            self.note(f"{num} states {whose} are left out: their numbers are not finite, or out of range")


def _can_be_time(stamps: IntArray) -> bool:
    """Return whether stamps can be used as time: they are set, and they never go back."""
    return len(stamps) == 0 or bool(stamps[-1] > 0 and (np.diff(stamps) >= 0).all() and (np.diff(stamps) > 0).any())


def _is_wall_time(stamps: IntArray) -> bool:
    """Return whether stamps are, or become, wall-clock times and not simulated ones."""
    return len(stamps) > 0 and int(stamps.max()) >= EARLIEST_WALL_TIME


def _order(stamps: IntArray) -> IntArray:
    """Return indices in order of time; of entries with the same stamp, the last one."""
    order = stamps.argsort(kind="stable")
    is_last = np.append(np.diff(stamps[order]) > 0, np.ones(min(len(order), 1), dtype=bool))
    return np.asarray(order[is_last])


def _angles(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad], as `quaternion` takes them; yaw is NaN if the quaternion has no valid norm."""
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not 0.0 < norm < math.inf:
        return 0.0, 0.0, math.nan
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
