"""Entries: which entity occupies which lane, and where on it.

Each lane follower has one entry on its own lane, and one more on each sibling of that lane while both lanes still
overlap. One that changes lanes has one on either lane. An entity that does not follow lanes (an ego, a pedestrian, an
obstacle) has an entry on every lane that it obstructs. All entries are sorted once for each decision. Then the lead
vehicle on the same lane is the next entry in the list, and one search finds the first entry on a lane ahead, for all
drivers at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.records import Record, replace
from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads

CORRIDOR: Final = 1.4
"""An entity nearer to a lane's line than this obstructs the lane: half the width of a car, and half a metre [m]."""

TICKS: Final = float(1 << 16)
INDEX_BITS: Final = 20
INDEX_MASK: Final = (1 << INDEX_BITS) - 1
"""A sorting key has a place in 2^-16 m in its upper bits and an index in the lower 20: a million entries."""

LAST_KEY: Final = (1 << 63) - 1 - INDEX_MASK
"""Key of the entry that stands for "none", behind all others."""


MAX_SCALE_TICKS: Final = 1 << (63 - INDEX_BITS)
"""The scales of all worlds together are shorter than this."""

_SLOWEST: Final = 0.01
"""Keeps quotients finite [m/s]."""

_COLUMNS: Final = ("lane", "s", "tail", "speed", "accel", "source", "stands")
"""Columns of `Entries`."""


@dataclass(slots=True, eq=False)
class Drivers:
    """Lane followers: copies of the world's columns, or figures of their bodies; (k,) each unless noted.

    Attributes:
        lanes: (6, k) int64, the lane of each and the five ahead of it; -1 beyond a dead end.
        arc: of the reference point, on the lane [m].
        speed: along the lane [m/s].
        accel: along the lane, over the last step [m/s^2].
        point: int64, row of the point of the roads before each.
        nose, rear: from the reference point to the front bumper and to the tail [m].
        length: of the body [m].
        uid: int64.
        claim: int64, the lane that the driver may enter; -1 for none. Written by `right_of_way`.
        held: int64, the lane that it has entered and not left; -1 for none. Written by `right_of_way`.
        exit_lane: int64, the lane behind the claimed or held one. Written by `right_of_way`.
        is_let_in: bool, the others let it in if it stands at a stop line.
        parameters: of the drivers.
        lateral: the lateral acceleration that each accepts of bends now [m/s^2].
        leaving: entries of those that change lanes on the lanes that they leave, (m,) of them; None for none.
    """

    lanes: IntArray
    arc: FloatArray
    speed: FloatArray
    accel: FloatArray
    point: IntArray
    nose: FloatArray
    rear: FloatArray
    length: FloatArray
    uid: IntArray
    claim: IntArray
    held: IntArray
    exit_lane: IntArray
    is_let_in: BoolArray
    parameters: DriverParameters
    lateral: FloatArray
    leaving: Entries | None = None


class Entries(Record, eq=False):
    """Places of entities on lanes; (m,) each.

    Attributes:
        lane: int64, row of the lane.
        s: arc length of the middle or the reference point, which gives the order [m].
        tail: arc length of the tail [m].
        speed: along the lane [m/s].
        accel: along the lane, over the last step [m/s^2].
        source: int64, index of the driver; -1 for an entity that does not follow lanes.
        stands: bool, it does not follow lanes and will not be gone soon: a vehicle at rest, or an obstacle.
    """

    lane: IntArray
    s: FloatArray
    tail: FloatArray
    speed: FloatArray
    accel: FloatArray
    source: IntArray
    stands: BoolArray

    def first(self, num: int) -> Entries:
        """Return the first `num` entries."""
        return Entries(*(getattr(self, column)[:num] for column in _COLUMNS))

    def at(self, which: IntArray | BoolArray | slice) -> Entries:
        """Return some entries."""
        return Entries(*(getattr(self, column)[which] for column in _COLUMNS))

    def on_lanes(self, lane: IntArray) -> Entries:
        """Return the same entries on other lanes, (m,) int64."""
        return self if lane is self.lane else replace(self, lane=lane)

    @staticmethod
    def join(*parts: Entries) -> Entries:
        """Return several sets of entries as one, in the given order."""
        some = [part for part in parts if len(part.lane)] or parts[:1]
        if len(some) == 1:
            return some[0]
        return Entries(*(np.concatenate([getattr(part, column) for part in some]) for column in _COLUMNS))


def find_entries(
    roads: Roads,
    *,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    yaw: FloatArray,
    speed: FloatArray,
    accel: FloatArray,
    half_length: FloatArray,
    half_width: FloatArray,
    foresight: FloatArray,
    stands: BoolArray,
) -> tuple[Entries, IntArray, FloatArray]:
    """Return the entries of boxes that do not follow lanes. All arguments but `roads` are (n,), in the map frame.

    Args:
        x: middle of the box, east [m].
        y: middle of the box, north [m].
        z: height of the box; it has no entries on lanes of another level, unless the map is flat [m].
        yaw: heading [rad].
        speed: along the heading [m/s].
        accel: along the heading [m/s^2].
        half_length: half of the length of the box [m].
        half_width: half of the width of the box [m].
        foresight: a box that will obstruct a lane within this time, at its present velocity, has an entry now [s].
        stands: see `Entries`.

    Returns:
        The entries, (m,); (m,) int64, the index of the box that each belongs to, rising; and (m,) the times after which
        the boxes will be in the way [s].
    """
    owner, places = roads.within(x, y, CORRIDOR + np.hypot(half_length, half_width) + np.abs(speed) * foresight)
    if not len(owner):
        none = np.empty(0)
        return Entries(owner, none, none, none, none, owner, stands[owner]), owner, none
    lateral, half_length, half_width, speed = places.lateral, half_length[owner], half_width[owner], speed[owner]
    turn = yaw[owner] - places.yaw
    cos, sin = np.cos(turn), np.sin(turn)
    ahead, across = np.abs(cos), np.abs(sin)
    half_across, half_along = across * half_length + ahead * half_width, ahead * half_length + across * half_width
    drift = sin * speed
    then = lateral + drift * foresight[owner]
    reach = CORRIDOR + half_across
    obstructs = (np.fmin(lateral, then) < reach) & (np.fmax(lateral, then) > -reach)
    if not roads.is_flat:
        obstructs &= roads.are_level(places, z[owner])
    at = obstructs.nonzero()[0]
    owner, cos, s = owner[at], cos[at], places.s[at]
    along = np.maximum(speed[at] * cos, 0.0)
    room = np.fmax(np.abs(lateral[at]) - CORRIDOR - half_across[at], 0.0)
    arrival = room / np.fmax(np.abs(drift[at]), _SLOWEST)
    source = np.full(len(at), -1, dtype=np.int64)
    entries = Entries(places.lane[at], s, s - half_along[at], along, accel[owner] * cos, source, stands[owner])
    return entries, owner, arrival


def sibling_entries(conflicts: LaneConflicts, own: Entries) -> Entries:
    """Return the entries on the siblings of lanes, for drivers that are still where both lanes overlap.

    Args:
        own: (k,) the entries of the drivers on their own lanes.
    """
    siblings = conflicts.siblings
    at = (own.tail < conflicts.shared[own.lane]).nonzero()[0]
    if not len(at):
        return own.first(0)
    index, link = siblings.of(own.lane[at])
    is_shared = own.tail[at[index]] < siblings.figure[link]
    source, other = at[index[is_shared]], siblings.other[link[is_shared]]
    return Entries(
        other, own.s[source], own.tail[source], own.speed[source], own.accel[source], source, own.stands[source]
    )


class EntryQueue:
    """Entries in the order in which they stand on their lanes.

    One more entry at the end stands for "none": on lane -1, infinitely far ahead, at rest.

    Attributes:
        num: entries, without the one at the end; also the position of that one.
        position: (num,) int64, the position in the queue of each entry as given.
        lane, s, tail, speed, accel, source: (num + 1,) as in `Entries`, in the order of the queue.
        first: (l + 1,) int64, the position of the first entry on each lane; `num` where there is none, and for lane -1.

    Args:
        parts: sets of entries, in any order.
    """

    def __init__(self, roads: Roads, *parts: Entries) -> None:
        self._roads = roads
        some = [part for part in parts if len(part.lane)]
        self.num = num = sum(len(part.lane) for part in some)
        codes, figures = np.empty((2, num + 1), dtype=np.int64), np.empty((4, num + 1))
        start = 0
        for part in some:
            end = start + len(part.lane)
            codes[0, start:end], codes[1, start:end] = part.lane, part.source
            figures[0, start:end], figures[1, start:end] = part.s, part.tail
            figures[2, start:end], figures[3, start:end] = part.speed, part.accel
            start = end
        codes[:, num], figures[:2, num], figures[2:, num] = -1, np.inf, 0.0
        # One whole number for each entry, of its place and its index: equal places have an order then, and a sort of
        # plain numbers is faster than one of indices.
        lane, index = codes[0, :num], np.arange(num + 1)
        place = roads.base[lane] + np.minimum(np.maximum(figures[0, :num], 0.0), roads.length[lane])
        key = np.empty(num + 1, dtype=np.int64)
        key[:num], key[num] = _keys(roads, place, lane), LAST_KEY
        key |= index
        key.sort()
        order = key & INDEX_MASK
        self._key = key
        self.position = np.empty(num, dtype=np.int64)
        self.position[order[:num]] = index[:num]
        self.lane, self.source = codes.take(order, axis=1)
        self.s, self.tail, self.speed, self.accel = figures.take(order, axis=1)
        self.first = np.empty(len(roads) + 1, dtype=np.int64)
        self.first.fill(num)
        is_first = np.ones(num, dtype=bool)
        np.not_equal(self.lane[1:-1], self.lane[:-2], is_first[1:])
        first = is_first.nonzero()[0]
        self.first[self.lane[first]] = first

    @classmethod
    def of_columns(cls, num: int, **columns: npt.NDArray[Any]) -> EntryQueue:
        """Return a queue that was worked out elsewhere, of its attributes; it cannot `find`."""
        queue = cls.__new__(cls)
        queue.num = num
        for name, column in columns.items():
            setattr(queue, name, column)
        return queue

    def find(self, lane: IntArray, s: FloatArray) -> IntArray:
        """Return the positions of the first entries at or beyond places on lanes, of whatever lane, (k,) int64.

        Args:
            lane: (k,) int64, rows of lanes.
            s: (k,) arc lengths, held within the lanes [m].
        """
        place = self._roads.base[lane] + np.minimum(np.maximum(s, 0.0), self._roads.length[lane])
        return self._key.searchsorted(_keys(self._roads, place, lane))

    def first_on(self, lane: IntArray) -> IntArray:
        """Return the position of the first entry on each lane, (k,) int64; `num` where the lane is empty."""
        return self.first.take(lane)


def _keys(roads: Roads, place: FloatArray, lane: IntArray) -> IntArray:
    """Return the keys of places on the one scale of all lanes, (k,) int64, with 0 in the lower bits."""
    ticks = (place * TICKS).astype(np.int64)
    if roads.scale_of_lane is not None:  # the copies of a scale for many worlds
        ticks += roads.scale_of_lane[lane] * scale_ticks(roads)
    return ticks << INDEX_BITS


def scale_ticks(roads: Roads) -> int:
    """Return the length of the one scale of all lanes, in units of keys."""
    return int(float(roads.chain[-1]) * TICKS) + 2 if len(roads.chain) else 1
