"""What drivers see ahead on their lanes: whom they follow, where they stop, how fast they may be, whose turn it is.

Everybody who is on a lane is an *entry*: a lane, where his tail is on it, and how fast he is. Drivers have one each,
and one more on each sibling of their lane as long as they still lie over it. Whoever does not keep to the lanes (an
ego, a man on foot, a crate) has one on every lane that he is in the way of. The entries are sorted once; whoever is
next on a lane is then a neighbour in the list, and whoever is first on a lane ahead is found by one search for all.

Where lanes cross or join, drivers *claim* the lane before they enter it: whoever comes within braking distance of its
`hold` asks, and gets it if no rival is claimed or occupied and nobody nearer asks for one. So no two ever meet there,
with lights or without; and nobody goes in who would have to stop inside, because there is no room behind it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.lane_conflicts import COMFORT, LaneConflicts
from rosbridge_sim.world.roads import Roads

__all__ = [
    "ACCEL",
    "BRAKE_FROM",
    "BRAKE_FULLY",
    "FIRM",
    "GAP",
    "HEADWAY",
    "STOP_GAP",
    "Drivers",
    "Entries",
    "View",
    "look",
    "spot",
]

ACCEL: Final = 1.5
"""How a driver picks up speed [m/s^2]."""

HEADWAY: Final = 1.2
"""The time he keeps to the one before him [s]."""

GAP: Final = 2.0
"""The distance that he keeps to him in a standing queue [m]."""

STOP_GAP: Final = 1.0
"""How far before a stop line people come to a stand [m]."""

BRAKE_FROM: Final = 1.25
BRAKE_FULLY: Final = 1.75
"""A stop that takes less than the first is not begun yet; from the second on a driver does what it takes [m/s^2]."""

FIRM: Final = 4.0
"""Nobody brakes harder than this for a light that has just become yellow: he goes through [m/s^2]."""

SPREAD: Final = 1.4
"""Who is nearer to a lane's line than this is in the way of those who drive there: half a car and a bit [m]."""

SOON: Final = 2.0
"""Somebody who moves leaves room behind him: so many seconds of his speed [s]."""

_TICKS: Final = float(1 << 16)
_ID_BITS: Final = 20
_ID_MASK: Final = (1 << _ID_BITS) - 1


@dataclass(slots=True, eq=False)
class Drivers:
    """Those who keep to the lanes, one each: copies of the world's columns, or figures of their bodies, all (k,).

    Attributes:
        lanes: (6, k) int64, where each is and will be; see `World.lane`.
        arc, speed: [m], [m/s].
        point: int64, row of the point of the roads before each.
        nose, rear, length: how far he reaches before and behind his reference point, and both [m].
        uid: int64.
        claim, held, exit_lane: int64; the lane he may enter, the one he has entered and is not out of, and the one
            behind it. Written by `look`.
    """

    lanes: IntArray
    arc: FloatArray
    speed: FloatArray
    point: IntArray
    nose: FloatArray
    rear: FloatArray
    length: FloatArray
    uid: IntArray
    claim: IntArray
    held: IntArray
    exit_lane: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Entries:
    """Who is where on which lane, all (m,).

    Attributes:
        lane: int64.
        s: of his middle or reference point, for the order [m].
        tail: where he ends [m].
        speed: along the lane [m/s].
        source: int64, which driver he is; -1 for all others.
    """

    lane: IntArray
    s: FloatArray
    tail: FloatArray
    speed: FloatArray
    source: IntArray

    @staticmethod
    def join(*parts: Entries) -> Entries:
        """All of some, one after the other."""
        columns = ("lane", "s", "tail", "speed", "source")
        return Entries(*(np.concatenate([getattr(part, column) for part in parts]) for column in columns))


@dataclass(slots=True, eq=False)
class View:
    """What a driver sees, all (k,).

    Attributes:
        gap: from his bumper to the tail of the one whom he follows, inf without [m].
        lead_speed: of that one, 0 without [m/s].
        lead: which driver that is; -1: another, or none.
        wall: from his bumper to where he must stop, inf without [m].
        pace: how fast he may be here, for the sake of what comes [m/s].
        is_shut_out: bool, it would be his turn but there is no room behind the lane that he wants.
    """

    gap: FloatArray
    lead_speed: FloatArray
    lead: IntArray
    wall: FloatArray
    pace: FloatArray
    is_shut_out: BoolArray


def _braking_gap(speed: FloatArray) -> FloatArray:
    """How near somebody may come to one who stands before he brakes as hard as he speeds up [m]."""
    return GAP + HEADWAY * speed + speed * speed / (2.0 * math.sqrt(ACCEL * COMFORT))


def spot(
    roads: Roads,
    *,
    x: FloatArray,
    y: FloatArray,
    yaw: FloatArray,
    speed: FloatArray,
    half_length: FloatArray,
    half_width: FloatArray,
    foresight: FloatArray,
) -> tuple[Entries, IntArray]:
    """Entries for boxes that do not keep to the lanes, all (n,).

    Args:
        roads: the lanes.
        x: middle, east [m].
        y: the same, north [m].
        yaw: heading [rad].
        speed: along it [m/s].
        half_length: [m].
        half_width: [m].
        foresight: whoever will be in the way within so long, if he goes on like that, is taken to be so now [s].

    Returns:
        The entries, and (m,) int64, whose each is, rising.
    """
    who, places = roads.within(x, y, SPREAD + np.hypot(half_length, half_width) + np.abs(speed) * foresight)
    cos, sin = np.cos(yaw[who] - places.yaw), np.sin(yaw[who] - places.yaw)
    half_across = np.abs(sin) * half_length[who] + np.abs(cos) * half_width[who]
    half_along = np.abs(cos) * half_length[who] + np.abs(sin) * half_width[who]
    then = places.lateral + sin * speed[who] * foresight[who]
    left, right = np.fmax(places.lateral, then), np.fmin(places.lateral, then)
    at = np.flatnonzero((right < SPREAD + half_across) & (left > -SPREAD - half_across))
    lane, s = places.lane[at], places.s[at]
    along = np.maximum(speed[who[at]] * cos[at], 0.0)
    return Entries(lane, s, s - half_along[at], along, np.full(len(at), -1, dtype=np.int64)), who[at]


def look(network: LaneConflicts, may_enter: BoolArray, drivers: Drivers, others: Entries, num_moving: int) -> View:
    """What each driver sees; claims are given out and given back.

    Args:
        network: what is known of the roads.
        may_enter: (l,) what the lights allow.
        drivers: written: claim, held, exit_lane.
        others: those who do not keep to the lanes.
        num_moving: how many of `others`, the first ones, are vehicles that move: they occupy what they drive on.
    """
    lookout = _Lookout(network, may_enter, drivers, others)
    lookout.look_ahead()
    lookout.give_claims(others, num_moving)
    return lookout.view


class _Queue:
    """Entries in the order in which they stand on their lanes; one more at the end is nobody, infinitely far."""

    def __init__(self, roads: Roads, entries: Entries) -> None:
        self.num = len(entries.lane)
        # One whole number for each: place and entry. So equals have an order, and sorting numbers needs no indices.
        place = roads.base[entries.lane] + np.clip(entries.s, 0.0, roads.length[entries.lane])
        key = ((place * _TICKS).astype(np.int64) << _ID_BITS) | np.arange(self.num)
        key.sort()
        order = key & _ID_MASK
        self.position = np.empty(self.num, dtype=np.int64)
        self.position[order] = np.arange(self.num)
        self.key = key
        self.first_key = (roads.base * _TICKS).astype(np.int64) << _ID_BITS
        self.lane = np.append(entries.lane[order], -1)
        self.tail = np.append(entries.tail[order], np.inf)
        self.speed = np.append(entries.speed[order], 0.0)
        self.source = np.append(entries.source[order], -1)

    def first_on(self, lane: IntArray) -> IntArray:
        """The position of whoever is first on each lane; `num` where nobody is."""
        position = self.key.searchsorted(self.first_key[lane])
        return np.where(self.lane[position] == lane, position, self.num)


class _Lookout:
    """One look of all drivers.

    Attributes:
        view: what they see.
        wish: (k,) int64, the lane that each must claim next; -1: none.
        behind: (k,) int64, the lane behind that one.
        way: (k,) from the bumper to where one waits for it [m].
    """

    def __init__(self, network: LaneConflicts, may_enter: BoolArray, drivers: Drivers, others: Entries) -> None:
        self.network, self.roads, self.may_enter, self.drivers = network, network.roads, may_enter, drivers
        self._let_go()
        lane, num = drivers.lanes[0], len(drivers.arc)
        own = Entries(lane, drivers.arc, drivers.arc - drivers.rear, drivers.speed, np.arange(num))
        self.queue = _Queue(self.roads, Entries.join(own, self._shadows(own), others))
        after = self.queue.position[:num] + 1
        lead = np.where(self.queue.lane[after] == lane, after, self.queue.num)
        point, pace = drivers.point, network.pace
        start, end = self.roads.s[point], self.roads.s[point + 1]
        share = (drivers.arc - start) / (end - start)
        self.view = View(
            gap=self.queue.tail[lead] - drivers.arc - drivers.nose,
            lead_speed=self.queue.speed[lead],
            lead=self.queue.source[lead],
            wall=np.full(num, np.inf),
            pace=pace[point] + share * (pace[point + 1] - pace[point]),
            is_shut_out=np.zeros(num, dtype=bool),
        )
        self.wish = np.full(num, -1, dtype=np.int64)
        self.behind = self.wish.copy()
        self.way = np.full(num, np.inf)

    def _let_go(self) -> None:
        """Claims become holds where the bumper has come to the place to wait at; holds end where the tail is out."""
        drivers = self.drivers
        at = np.flatnonzero((drivers.claim >= 0) & (drivers.claim == drivers.lanes[0]))
        at = at[drivers.arc[at] + drivers.nose[at] >= self.network.hold[drivers.claim[at]]]
        drivers.held[at], drivers.claim[at] = drivers.claim[at], -1
        at = np.flatnonzero(drivers.held >= 0)
        is_out = self._tail_inside(at) > self.network.out[drivers.held[at]]
        drivers.held[at[is_out]] = -1

    def _tail_inside(self, at: IntArray) -> FloatArray:
        """How far the tails of some drivers are along the lane that they hold [m]."""
        drivers = self.drivers
        is_on = drivers.lanes[0][at] == drivers.held[at]
        before = np.where(is_on, 0.0, self.roads.length[drivers.held[at]])
        return np.asarray(before + drivers.arc[at] - drivers.rear[at])

    def _shadows(self, own: Entries) -> Entries:
        """Entries on the siblings of lanes, for those who are still where both lie over one another."""
        siblings = self.network.siblings
        at = np.flatnonzero(own.tail < self.network.shared[own.lane])
        which, link = siblings.of(own.lane[at])
        is_shared = own.tail[at[which]] < siblings.figure[link]
        source, other = at[which[is_shared]], siblings.other[link[is_shared]]
        return Entries(other, own.s[source], own.tail[source], own.speed[source], source)

    # The lanes ahead

    def look_ahead(self) -> None:
        """See what is on the lanes ahead, as far as it matters at each driver's speed."""
        drivers, view, roads, network = self.drivers, self.view, self.roads, self.network
        self._wish_here()
        horizon = 1.5 * _braking_gap(drivers.speed) + GAP + drivers.nose
        way = roads.length[drivers.lanes[0]] - drivers.arc
        i = np.arange(len(way))
        for lanes, behind in zip(drivers.lanes[1:], [*drivers.lanes[2:], None], strict=True):
            i = i[way[i] < horizon[i]]
            lane = lanes[i]
            is_end = lane < 0
            if is_end.any():
                at = i[is_end]
                view.wall[at] = np.fmin(view.wall[at], way[at] - drivers.nose[at])
                i, lane = i[~is_end], lane[~is_end]
            if not len(i):
                break
            line = way[i] - drivers.nose[i]
            self._heed_light(i, lane, line)
            is_next = np.isfinite(network.hold[lane]) & (drivers.claim[i] != lane)
            is_next &= (self.wish[i] < 0) & np.isinf(view.wall[i])
            at = i[is_next]
            self.wish[at], self.way[at] = lane[is_next], line[is_next] + network.hold[lane[is_next]]
            self.behind[at] = -1 if behind is None else behind[at]
            enter = network.pace[roads.first[lane]]
            view.pace[i] = np.fmin(view.pace[i], np.sqrt(enter * enter + 2.0 * COMFORT * np.fmax(way[i], 0.0)))
            self._find_lead(i, lane, way)
            way[i] += roads.length[lane]

    def _wish_here(self) -> None:
        """Some lanes cross others only farther on: then it is the driver's own lane that he must claim."""
        drivers = self.drivers
        lane, behind = drivers.lanes[:2]
        way = self.network.hold[lane] - drivers.arc - drivers.nose
        at = np.flatnonzero(np.isfinite(way) & (way > 0.0) & (drivers.claim != lane) & (drivers.held != lane))
        self.wish[at], self.behind[at], self.way[at] = lane[at], behind[at], way[at]

    def _heed_light(self, i: IntArray, lane: IntArray, line: FloatArray) -> None:
        """Stop at the line of a lane that may not be entered, unless that takes more than firm braking.

        No memory is needed for that: who brakes as he must stays able to, and who goes on becomes ever less so.
        """
        drivers, view = self.drivers, self.view
        stops = ~self.may_enter[lane] & (line > 0.0) & (np.square(drivers.speed[i]) < 2.0 * FIRM * line)
        at = i[stops]
        view.wall[at] = np.fmin(view.wall[at], line[stops])
        drivers.claim[at[drivers.claim[at] == lane[stops]]] = -1

    def _find_lead(self, i: IntArray, lane: IntArray, way: FloatArray) -> None:
        """The first one on the next lane, for those who follow nobody yet."""
        view, queue = self.view, self.queue
        is_free = np.isinf(view.gap[i])
        at = i[is_free]
        first = queue.first_on(lane[is_free])
        view.gap[at] = way[at] + queue.tail[first] - self.drivers.nose[at]
        view.lead_speed[at], view.lead[at] = queue.speed[first], queue.source[first]

    # Claims

    def give_claims(self, others: Entries, num_moving: int) -> None:
        """Give lanes to those who ask for them, the nearest first, where no rival is taken; the rest must wait."""
        drivers, view, network = self.drivers, self.view, self.network
        # In time to find out before he would begin to brake.
        speed = drivers.speed
        asks = (self.wish >= 0) & (self.way < speed * (speed / (2.0 * BRAKE_FROM) + HEADWAY) + STOP_GAP + GAP)
        # Who is behind somebody who waits himself would only keep others out.
        is_led = view.gap <= self.way
        asks &= ~is_led | ((view.lead >= 0) & (drivers.claim[view.lead] >= 0))
        at = np.flatnonzero(asks)
        has_room = self._has_room(at)
        view.is_shut_out[at[~has_room]] = True
        at = at[has_room]
        if len(at):
            wish = self.wish[at]
            taken = self._taken(others, num_moving)
            rank = np.empty(len(at), dtype=np.int64)
            rank[np.lexsort((drivers.uid[at], self.way[at]))] = np.arange(len(at))
            best = np.full(len(network.hold), len(at), dtype=np.int64)
            np.minimum.at(best, wish, rank)
            which, link = network.rivals.of(wish)
            rival = network.rivals.other[link]
            is_refused = (taken[rival] < network.rivals.figure[link]) | (best[rival] < rank[which])
            given = at[np.bincount(which[is_refused], minlength=len(at)) == 0]
            drivers.claim[given], drivers.exit_lane[given] = self.wish[given], self.behind[given]
        waits = (self.wish >= 0) & (drivers.claim != self.wish)
        view.wall[waits] = np.fmin(view.wall, self.way)[waits]

    def _has_room(self, at: IntArray) -> BoolArray:
        """Which of some drivers would come to a stand behind the lane that they want, and not on it."""
        drivers, hold = self.drivers, self.network.hold
        behind = self.behind[at]
        first = self.queue.first_on(behind)
        free = self.queue.tail[first] + SOON * self.queue.speed[first]
        coming = np.flatnonzero(((drivers.claim >= 0) | (drivers.held >= 0)) & (drivers.exit_lane >= 0))
        needs = drivers.length[coming] + GAP
        reserved = np.bincount(drivers.exit_lane[coming], weights=needs, minlength=len(hold))
        # Where lanes of that sort follow one another, each is claimed in its turn.
        is_plain = (behind >= 0) & np.isinf(hold[behind])
        return np.asarray(~is_plain | (free - reserved[behind] >= drivers.length[at] + GAP))

    def _taken(self, others: Entries, num_moving: int) -> FloatArray:
        """(l,) how far the last one who has each lane, or has claimed it, is along it; inf where nobody has [m]."""
        drivers = self.drivers
        taken = np.full(len(self.network.hold), np.inf)
        at = np.flatnonzero(drivers.held >= 0)
        np.minimum.at(taken, drivers.held[at], self._tail_inside(at))
        np.minimum.at(taken, others.lane[:num_moving], others.tail[:num_moving])
        taken[drivers.claim[drivers.claim >= 0]] = -np.inf
        return taken
