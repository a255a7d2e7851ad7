"""The way back: from the messages that a recording holds into the world's units, and into a `Recording`.

`RecordingBuilder` takes messages one after the other, from a bag's reader or from the bus, and makes arrays of them.
They may be of either release: a field that was renamed is looked for under both names. What a message does not say of
its units is taken to be as in the profile in use, as it is when the recording is one of ours. What went out goes out
again to the last bit.

Single figures that no world can hold (no number, or beyond all bounds) make their entry worthless: it is left out, and
a note says so.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.convert import DEGREES, EGO_TYPE, Converter, exact_quotient
from rosbridge_sim.morai.replays.recording import EGO_COLUMNS, OBJECT_COLUMNS, Actor, EgoTrack, ObjectTrack, Recording
from rosbridge_sim.morai.units import MPS_TO_KMH
from rosbridge_sim.world.geometry import BoolArray, FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state import MAX_COORDINATE, MAX_SPEED, Kind

__all__ = ["MAX_RECORDED_ENTRIES", "RecordingBuilder", "Recordings", "Then"]

MAX_RECORDED_ENTRIES: Final = 2_000_000
"""States of objects, and of egos, that a recording may hold: 20 objects at 50 Hz for half an hour are 1.8 million, and
0.4 GB while they are read."""

EARLIEST_DAY: Final = 10**18
"""The time of day in September 2001 [ns]; no simulation lasts for so long."""

_LISTS: Final = (("npc_list", Kind.VEHICLE), ("pedestrian_list", Kind.PEDESTRIAN), ("obstacle_list", Kind.OBSTACLE))
_NUM_FIGURES: Final = 13  # of an ObjectStatus
_VELOCITY: Final = [OBJECT_COLUMNS.index(name) for name in ("speed", "lateral_speed", "climb")]
_Z, _SPEED = 2, EGO_COLUMNS.index("speed")
_YAW, _YAW_RATE = EGO_COLUMNS.index("yaw"), EGO_COLUMNS.index("yaw_rate")

Then = Callable[[Recording | DocumentError, float], None]
"""`(the recording, or why there is none; monotonic time [s])`."""


class Recordings(Protocol):
    """Where recordings come from; the shell reads them from the disk."""

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        """Read the recording that a client names, which may take its time.

        Args:
            name: as the client says.
            reading: what takes its messages.
            then: called once, perhaps before this returns, and never while frames are being computed.
        """


StampRange = tuple[int, int]
"""When the message says that it is from, and when the bag says that it came [ns]."""


class _Rows:
    """Entries of a fixed number of figures, each under its stamps."""

    def __init__(self, num_figures: int) -> None:
        self.said = array("q")
        self.came = array("q")
        self.figures = array("d")
        self._num_figures = num_figures

    def stamps(self, *, is_said: bool) -> IntArray:
        return np.array(self.said if is_said else self.came, dtype=np.int64)

    def table(self) -> FloatArray:
        """(figures, n)."""
        return np.array(self.figures).reshape(-1, self._num_figures).T


class RecordingBuilder:
    """Gathers what is to become a `Recording`."""

    def __init__(self, name: str, convert: Converter) -> None:
        """Nothing yet.

        Args:
            name: of the recording, as a client calls it.
            convert: whose profile says what units are.
        """
        self.name = name
        self._convert = convert
        self._egos: dict[int, _Rows] = {}
        self._placeless: set[int] = set()
        self._samples = _Rows(0)
        self._counts = array("q")
        self._who = array("q")
        self._figures = array("d")
        self._cast: dict[tuple[int, Kind, str], int] = {}
        self._notes: list[str] = []

    # In

    def take_ego(self, index: int, message: Any, stamps: StampRange) -> None:  # noqa: ANN401 - whatever has the fields
        """An EgoVehicleStatus of the ego of that number."""
        place, velocity, accel = message.position, message.velocity, message.acceleration
        factor = DEGREES if self._convert.profile.wheel_angle_unit == "deg" else 1.0
        angle = getattr(message, "wheel_angle", None)
        # Under its newer name it is degrees in any profile.
        steer = getattr(message, "front_steer_angle", 0.0) / DEGREES if angle is None else angle / factor
        self._add_ego(
            index,
            stamps,
            (place.x, place.y, place.z, 0.0, 0.0, message.heading, velocity.x, accel.x, accel.y, math.nan),
            (steer, message.accel, message.brake),
        )

    def take_pedals(self, message: Any, stamps: StampRange) -> None:  # noqa: ANN401 - whatever has the fields
        """The first ego of a ReplayInfo: not where it is, so it stands, turned as it was."""
        self._placeless.add(0)
        turn, accel = message.orientation, message.linear_acceleration
        roll, pitch, yaw = _angles(turn.x, turn.y, turn.z, turn.w)
        nowhere = math.nan
        self._add_ego(
            0,
            stamps,
            (nowhere, nowhere, nowhere, roll, pitch, yaw, 0.0, accel.x, accel.y, message.angular_velocity.z),
            (message.ego_steer / DEGREES, message.ego_acc, message.ego_brake),
        )

    def take_objects(self, message: Any, stamps: StampRange) -> None:  # noqa: ANN401 - whatever has the fields
        """The lists of an ObjectStatusList or ReplayInfo; an ego among them is left out, it has a topic of its own.

        Raises:
            DocumentError: it has become too much.
        """
        who: list[tuple[int, Kind, str]] = []
        figures = array("d")
        for name, kind in _LISTS:
            for one in getattr(message, name, ()):
                if getattr(one, "type", None) == EGO_TYPE:  # a stranger's definition may lack it
                    continue
                velocity, accel, size, place = one.velocity, one.acceleration, one.size, one.position
                who.append((one.unique_id, kind, one.name))
                figures.extend(
                    (
                        *(one.heading, velocity.x, velocity.y, velocity.z, accel.x, accel.y, accel.z),
                        *(size.x, size.y, size.z, place.x, place.y, place.z),
                    )
                )
        self.take_sample(who, figures.tobytes(), stamps)

    def take_sample(self, who: Sequence[tuple[int, Kind, str]], figures: bytes, stamps: StampRange) -> None:
        """The same for whoever has read the lists himself.

        Args:
            who: unique_id, kind and name of each object.
            figures: 13 float64 of each in the order of an ObjectStatus: heading, then x, y, z of velocity,
                acceleration, size and position.
            stamps: of the message.

        Raises:
            DocumentError: it has become too much.
        """
        cast = self._cast
        self._who.extend([cast.setdefault(one, len(cast)) for one in who])
        self._figures.frombytes(figures)
        self._samples.said.append(stamps[0])
        self._samples.came.append(stamps[1])
        self._counts.append(len(who))
        self._check_size(len(self._who) + len(self._counts))

    def note(self, text: str) -> None:
        """What a person should know of the recording."""
        self._notes.append(text)

    def _add_ego(self, index: int, stamps: StampRange, motion: tuple[float, ...], controls: tuple[float, ...]) -> None:
        rows = self._egos.setdefault(index, _Rows(len(EGO_COLUMNS)))
        rows.said.append(stamps[0])
        rows.came.append(stamps[1])
        rows.figures.extend(motion)
        rows.figures.extend(controls)
        self._check_size(len(rows.said))

    def _check_size(self, num: int) -> None:
        if num > MAX_RECORDED_ENTRIES:
            raise DocumentError(
                f"{self.name}: more than {MAX_RECORDED_ENTRIES:,} states in it; cut it into shorter ones"
            )

    # Out

    def finish(self) -> Recording:
        """All that was taken, as arrays."""
        all_rows = [*self._egos.values(), self._samples]
        is_said = all(_is_a_clock(rows.stamps(is_said=True)) for rows in all_rows)
        if any(_is_of_the_day(rows.stamps(is_said=True)) for rows in all_rows):
            # Recorded by simulated time, as ours are: what was stamped with the time of day shows how long it took.
            is_said &= any(_is_of_the_day(rows.stamps(is_said=False)) for rows in all_rows)
        egos = {index: self._ego_track(index, rows, is_said=is_said) for index, rows in sorted(self._egos.items())}
        objects = self._object_track(is_said=is_said) if self._samples.said else None
        return Recording(
            self.name, {index: track for index, track in egos.items() if track}, objects, tuple(self._notes)
        )

    def _ego_track(self, index: int, rows: _Rows, *, is_said: bool) -> EgoTrack | None:
        values, stamps = rows.table().copy(), rows.stamps(is_said=is_said)
        keep = _order(stamps)
        values, stamps = values[:, keep], stamps[keep]
        has_place = index not in self._placeless
        is_good = self._are_good(values, f"of ego {index}", has_place=has_place)
        values, stamps = values[:, is_good], stamps[is_good]
        if not len(stamps):
            return None
        if has_place:  # what a ReplayInfo says is an orientation, which is in radians already
            values[_YAW] = exact_quotient(values[_YAW], DEGREES)
            turn, time = wrap_angle(np.diff(values[_YAW])), np.diff(stamps) / 1e9
            rate = turn / time
            values[_YAW_RATE] = np.concatenate([rate[:1], rate]) if len(rate) else 0.0
        return EgoTrack(stamps, values)

    def _are_good(self, values: FloatArray, whose: str, *, has_place: bool) -> BoolArray:
        """Which entries the world can hold; the pedals and angles need not be possible, but numbers."""
        checked = values.copy()
        if has_place:
            checked[_YAW_RATE] = 0.0  # it will follow from the headings
        else:
            checked[: _Z + 1] = 0.0
            checked[_YAW] = np.nan_to_num(checked[_YAW])
        limits = np.full((len(values), 1), MAX_COORDINATE)
        limits[_SPEED] = MAX_SPEED
        is_good = (np.abs(checked) <= limits).all(axis=0)
        self._note_bad(int(np.count_nonzero(~is_good)), whose)
        return np.asarray(is_good)

    def _object_track(self, *, is_said: bool) -> ObjectTrack:
        stamps, counts = self._samples.stamps(is_said=is_said), np.array(self._counts, dtype=np.int64)
        starts = np.concatenate([[0], np.cumsum(counts)])
        who = np.array(self._who, dtype=np.int64)
        values, sizes = self._convert_objects(np.array(self._figures).reshape(-1, _NUM_FIGURES).T)
        limits = np.full((len(OBJECT_COLUMNS), 1), MAX_COORDINATE)
        limits[_VELOCITY] = MAX_SPEED
        is_good = (np.abs(values) <= limits).all(axis=0)
        sample = np.repeat(np.arange(len(stamps)), counts)
        # Somebody who is in a sample twice counts once.
        _, first = np.unique(np.stack([sample, who]), axis=1, return_index=True)
        is_first = np.zeros(len(who), dtype=bool)
        is_first[first] = True
        self._note_bad(int(np.count_nonzero(~is_good)), "of an object")
        cast = self._find_cast(who, sizes)

        keep = _order(stamps)
        entries = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in keep.tolist()] or [starts[:0]])
        entries = entries[(is_good & is_first)[entries]]
        counts = np.bincount(sample[entries], minlength=len(stamps))[keep]
        return ObjectTrack(
            stamps[keep], np.concatenate([[0], np.cumsum(counts)]), who[entries], values[:, entries], cast
        )

    def _convert_objects(self, figures: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`OBJECT_COLUMNS`, and length, width, height [m], of all entries, (columns, k) each."""
        profile = self._convert.profile
        is_width_first = profile.object_size_order == "width-length-height"
        sizes = figures[[8, 7, 9] if is_width_first else [7, 8, 9]]
        heading, velocity, accel = figures[0], figures[1:4], figures[4:7]
        factor = MPS_TO_KMH if profile.object_velocity_unit == "km/h" else 1.0
        yaw = exact_quotient(heading, DEGREES)
        return np.stack([*figures[10:], yaw, *exact_quotient(velocity, factor), *accel]), sizes

    def _find_cast(self, who: IntArray, sizes: FloatArray) -> tuple[Actor, ...]:
        """Everybody who appears, each of the size that he had first."""
        _, first = np.unique(who, return_index=True)
        found = zip(self._cast, sizes[:, first].T.tolist(), strict=True)
        return tuple([Actor(uid, kind, name, (size[0], size[1], size[2])) for (uid, kind, name), size in found])

    def _note_bad(self, num: int, whose: str) -> None:
        if num:
            self.note(f"{num} states {whose} are left out: they hold no numbers, or numbers beyond all bounds")


def _is_a_clock(stamps: IntArray) -> bool:
    """Whether the messages' own stamps can be gone by: they are set, and time does not go back."""
    return len(stamps) == 0 or bool(stamps[-1] > 0 and (np.diff(stamps) >= 0).all() and (np.diff(stamps) > 0).any())


def _is_of_the_day(stamps: IntArray) -> bool:
    """Return whether these are, or come to be, times of day and not simulated ones."""
    return len(stamps) > 0 and int(stamps.max()) >= EARLIEST_DAY


def _order(stamps: IntArray) -> IntArray:
    """Indices in order of time; of several at one time the last."""
    order = stamps.argsort(kind="stable")
    is_last = np.append(np.diff(stamps[order]) > 0, np.ones(min(len(order), 1), dtype=bool))
    return np.asarray(order[is_last])


def _angles(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw of an orientation, as `quaternion` takes them [rad]; the yaw of none is not known (NaN)."""
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not 0.0 < norm < math.inf:
        return 0.0, 0.0, math.nan
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
