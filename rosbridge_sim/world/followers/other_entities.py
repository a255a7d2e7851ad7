"""Entities that do not follow lanes, as drivers see them: their entries on the lanes that they obstruct.

Pedestrians are seen where they will be soon; all others are seen where they are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import FIRM
from rosbridge_sim.world.drivers.lane_entries import CORRIDOR, Drivers, Entries, find_entries
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, is_any, ranges
from rosbridge_sim.world.people.people import COMMITTED, find_ways_over
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

MOVES: Final = 0.5
"""A vehicle above this speed drives through an intersection; a slower one waits in it [m/s]."""

FORESIGHT: Final = 3.0
"""Drivers wait for pedestrians that will be on the road within this time [s]: 4 m at walking speed, a lane's width."""

MAX_PARTS: Final = 4
"""For pedestrians that cross by light or gap, drivers wait as long as they need, up to so many times as long."""

LANES_TO_PASS: Final = 3
"""Lanes, with its own one, on which a driver may pass before those who cross: up to the far side of an intersection. It
goes on if it would have to brake harder than `FIRM` for somebody who comes later, as for a yellow light."""

PAST: Final = 1.0
"""It must be so far past the place then [m]."""

PACE: Final = 2.0
"""Least speed at which it clears the place [m/s]: a driver that stands with its nose beyond it moves off."""

FEW: Final = 64
"""Up to so many people, those who are far from all lanes are left out; larger crowds are looked at as a whole, because
`segment_search.MAX_SEGMENTS` leaves some of them out."""

FAR: Final = 3.0
RETRY: Final = 0.5
CERTAIN: Final = 0.01
"""Lanes are looked for so far around people who are near none, and again after so many metres at least. By the last one
a person is farther from them than is worked out [m]."""

_MOTION: Final = ("accel", "z")
_YAW, _SPEED = 5, 6
"""First and last of the columns by which a body is seen, and the lines of two of them."""

_AHEAD, _HALVES, _FORESIGHT = 0, slice(1, 3), 3
"""Lines of `_Bodies`: how far the middle of a body is ahead of its reference point [m], and for how long the place
where it goes is looked at [s]."""


class OtherEntities:
    """The entities that do not follow lanes. It lives until the next `World.touch`.

    Args:
        world: read only.
        is_other: (n,) bool, the rows of these.
    """

    def __init__(self, world: WorldRows, is_other: BoolArray) -> None:
        self._world = world
        may_move = (world.kind == int(Kind.EGO)) | (world.speed != 0.0) | (world.loose > 0.0) | (world.yields > 0)
        still = (is_other & ~may_move).nonzero()[0]
        self._still, owner, _ = _Bodies(world, still).entries(np.arange(len(still)))
        self._still_rows = still[owner]
        self._rows: IntArray = (is_other & may_move).nonzero()[0]
        self._bodies = _Bodies(world, self._rows)
        self._on_wheels = (world.kind[self._rows] == int(Kind.EGO)) | (world.kind[self._rows] == int(Kind.VEHICLE))
        self._seen: Entries | None = None
        self._found = self._still, self._still_rows, 0

    def entries(self, drivers: Callable[[], Drivers]) -> tuple[Entries, IntArray, int]:
        """Return all entries, their rows, and how many of them drive, which are the first ones.

        Those that drive occupy the lanes of an intersection, the others only obstruct.

        Args:
            drivers: returns all lane followers; called if somebody crosses.
        """
        world = self._world
        if not len(self._rows):
            return self._found
        drives = self._on_wheels & (np.abs(world.speed[self._rows]) > MOVES)
        first = drives.nonzero()[0]
        which = np.concatenate([first, (~(drives | self._bodies.find_far())).nonzero()[0]])
        seen, owner, arrival = self._bodies.entries(which)
        if seen is self._seen:
            return self._found
        rows = self._rows[which[owner]]
        crossing = (world.yields[rows] >= COMMITTED).nonzero()[0]
        self._seen = None if len(crossing) else seen
        if len(crossing):
            passed = find_passed_first(world.roads, drivers(), seen.at(crossing), arrival[crossing])
            is_left = np.ones(len(owner), dtype=bool)
            is_left[crossing[passed]] = False
            left = is_left.nonzero()[0]
            seen, owner, rows = seen.at(left), owner[left], rows[left]
        num_driving = int(np.count_nonzero(owner < len(first)))
        self._found = Entries.join(seen, self._still), np.concatenate([rows, self._still_rows]), num_driving
        return self._found


class _Bodies:
    """The bodies of some rows, and what they never change.

    Args:
        world: read only.
        rows: (k,) int64, which do not follow lanes.
    """

    def __init__(self, world: WorldRows, rows: IntArray) -> None:
        self._world, self._rows = world, rows
        is_person = world.kind[rows] == int(Kind.PEDESTRIAN)
        self._may_stand = ~is_person
        # Pedestrians that heed the traffic wait at the kerb. While they cross, drivers wait for them.
        foresight = np.where(is_person & (world.yields[rows] == 0), FORESIGHT, 0.0)
        self._figures = np.array([world.centre[rows], world.half_length[rows], world.half_width[rows], foresight])
        self._bits: bytes | None = None
        self._heeding = (is_person & (foresight == 0.0) & (self._figures[_AHEAD] == 0.0)).nonzero()[0]
        self._heeding = self._heeding[: FEW * (len(self._heeding) <= FEW)]
        self._reach = CORRIDOR + np.hypot(*self._figures[_HALVES, self._heeding])
        self._looked_from = world.block("x", "y").take(rows[self._heeding], axis=1)
        self._room = np.zeros(len(self._heeding))

    def find_far(self) -> BoolArray:
        """Return which bodies are certainly on no lane, (k,): people who do not cross, and are far from all lanes.

        They may walk as far as the nearest lane was when it was looked for.
        """
        world, heeding, is_far = self._world, self._heeding, np.zeros(len(self._rows), dtype=bool)
        if not len(heeding):
            return is_far
        rows = self._rows[heeding]
        x, y = place = world.block("x", "y").take(rows, axis=1)
        moved = np.hypot(*(place - self._looked_from))
        if is_any(moved > np.fmax(self._room, RETRY)):
            self._looked_from, moved = place, np.zeros(len(rows))
            self._room = world.roads.clearance(x, y, self._reach + FAR) - self._reach - CERTAIN
        is_far[heeding] = (moved < self._room) & (world.yields[rows] < COMMITTED)
        return is_far

    def entries(self, which: IntArray) -> tuple[Entries, IntArray, FloatArray]:
        """Return the entries of bodies, their owners among these, and their arrivals; see `find_entries`.

        Args:
            which: (m,) int64, the bodies in the order of the entries.
        """
        world, rows = self._world, self._rows[which]
        now = world.block(*_MOTION).take(rows, axis=1)
        if is_any(world.yields[rows] >= COMMITTED):
            return self._find_on_ways(rows, which, now)
        bits = now.tobytes() + which.tobytes()
        if bits != self._bits:  # else all stand where they stood at the last decision
            entries, owner, arrival = self._find(now, self._figures.take(which, axis=1), self._may_stand[which])
            entries = entries.on_lanes(world.own_lanes(rows[owner], entries.lane))
            self._bits, self._found = bits, (entries, owner, arrival)
        return self._found

    def _find_on_ways(self, rows: IntArray, which: IntArray, now: FloatArray) -> tuple[Entries, IntArray, FloatArray]:
        """Return the same where some cross; each part of their way is looked at from its own beginning.

        A bend has no place beside one that is far away.
        """
        times, velocities = find_ways_over(self._world)
        time = times[rows]
        crosses = (time > 0.0).nonzero()[0]
        way = velocities[rows[crosses]]
        now[_YAW, crosses], now[_SPEED, crosses] = np.arctan2(way.imag, way.real), np.abs(way)
        index, later = _parts_of(time)
        now, figures = now.take(index, axis=1), self._figures.take(which[index], axis=1)
        left = time[index]
        figures[_AHEAD] += now[_SPEED] * later
        figures[_FORESIGHT] = np.where(left > 0.0, np.fmin(left - later, FORESIGHT), figures[_FORESIGHT])
        entries, owner, arrival = self._find(now, figures, self._may_stand[which[index]])
        arrival += later[owner]
        owner = index[owner]
        return entries.on_lanes(self._world.own_lanes(rows[owner], entries.lane)), owner, arrival

    def _find(self, now: FloatArray, figures: FloatArray, may_stand: BoolArray) -> tuple[Entries, IntArray, FloatArray]:
        """Return the entries of bodies with these columns of `_MOTION`, (8, m), and figures, (4, m)."""
        accel, _, _, x, y, yaw, speed, z = now
        ahead, half_length, half_width, foresight = figures
        return find_entries(
            self._world.roads,
            x=x + ahead * np.cos(yaw),
            y=y + ahead * np.sin(yaw),
            z=z,
            yaw=yaw,
            speed=speed,
            accel=accel,
            half_length=half_length,
            half_width=half_width,
            foresight=foresight,
            stands=may_stand & (np.abs(speed) < MOVES),
        )


def _parts_of(time: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the parts of the ways of those who will be off the road after some times, which are looked at one by one.

    Args:
        time: (k,) 0 for those who do not cross [s].

    Returns:
        (m,) int64, whose part it is, and (m,) when it begins [s]; first the first parts of all.
    """
    index, later = [np.arange(len(time))], [np.zeros(len(time))]
    for part in range(1, MAX_PARTS):
        crossing = (time > part * FORESIGHT).nonzero()[0]
        if not len(crossing):
            break
        index.append(crossing)
        later.append(np.full(len(crossing), part * FORESIGHT))
    return np.concatenate(index), np.concatenate(later)


def find_passed_first(roads: Roads, drivers: Drivers, entries: Entries, arrival: FloatArray) -> BoolArray:
    """Return which entries lie where a driver will have passed before they are in the way, and cannot stop gently.

    Such a driver goes on, and so does one whose nose is past the place. Those behind it follow it until it is past, and
    then see the entry.

    Args:
        entries: (m,) of people who cross.
        arrival: (m,) when they will be in the way [s].

    Returns:
        (m,) bool.
    """
    found = np.zeros(len(arrival), dtype=bool)
    order = entries.lane.argsort(kind="stable")
    on_lane, before = entries.lane[order], -drivers.arc
    for part in range(LANES_TO_PASS):
        lane = drivers.lanes[part]
        first = on_lane.searchsorted(lane)
        count = on_lane.searchsorted(lane, side="right") - first
        if not np.count_nonzero(count):
            before = before + roads.length[lane]
            continue
        driver, entry = np.arange(len(lane)).repeat(count), order[ranges(first, count)]
        speed = drivers.speed[driver]
        gap = entries.tail[entry] + (before - drivers.nose)[driver]
        rest = gap + drivers.length[driver]
        cannot = (gap < speed * speed / (2.0 * FIRM)) & (rest > 0.0)
        is_gone = (rest + PAST < arrival[entry] * np.fmax(speed, PACE)) | (gap < -PAST)
        found[entry[cannot & is_gone]] = True
        before = before + roads.length[lane]
    return found
