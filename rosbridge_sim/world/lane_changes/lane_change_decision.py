"""A look at the lanes beside: which drivers want to change lanes, why, and which of them begin; see `lane_changes`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import FIRM, HARDEST, STOP_GAP, Perception
from rosbridge_sim.world.drivers.lane_entries import Drivers, EntryQueue
from rosbridge_sim.world.drivers.route_choice import RouteChoice
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.lane_changes.lane_change_model import KEEP_RIGHT_BIAS, THRESHOLD, LaneChange, find_safe, follow
from rosbridge_sim.world.lane_changes.lane_change_motion import CAR_LENGTH, LANE, lateral_in_shift, shift_time
from rosbridge_sim.world.lane_changes.lane_change_passing import STANDS, Shifts, is_clear
from rosbridge_sim.world.roads.lane_change_map import NUM_SIDES, RIGHT, LaneNeighbours
from rosbridge_sim.world.roads.lane_conflicts import MAX_LATERAL, SETTLING_TIME, LaneConflicts, foresight
from rosbridge_sim.world.state.world import DT
from rosbridge_sim.world.state.world_rows import WorldRows

SIGNAL_FRAMES: Final = 75
"""Frames that a driver signals before it moves over: 1.5 s, three blinks."""

PATIENCE: Final = 300
"""Frames after which a driver gives up a change that it need not make and for which there is no gap: 6 s."""

REST: Final = 400
"""Frames after a change, or after one was given up, before a driver wishes one that it need not make: 8 s."""

RETURN: Final = 750
"""Frames after a change before a driver wishes to keep right, or to go back to the lane that it left: 15 s. So one that
has overtaken goes back when it is well past, and not to where it came from a moment ago."""

GOOD_REASON: Final = 2.0
"""Advantage for which a driver goes back earlier, after `REST` [m/s^2]: the comfortable braking. So a lane that comes
to a halt is left, but small differences of two lanes are not worth a second change."""

MUST_TIME, MUST_WAY = 12.0, 100.0
"""A driver begins to look for a gap this time [s] and at least this far [m] before it must have changed, for each lane
that it must cross."""

WAY_ON: Final = 300.0
"""A lane that goes on for this length is no worse than one that goes on for ever [m]: room to overtake and return."""

ENTRY_WAY: Final = 20.0
"""Changes of choice begin only farther from an intersection than this length [m] and the way that signal and change
take at the present speed."""

SPEED_TOLERANCE: Final = 1.015
"""The speed may be greater than bends allow by this factor when a lane change begins: drivers come close to the safe
speed, and never quite reach it."""

LIGHT_QUEUE: Final = 15.0
"""A vehicle that stands nearer to an intersection than this may wait for it [m]. So nobody passes it."""

QUEUE_GAP: Final = 10.0
"""Two standing vehicles belong to one queue if the gap between them is at most this long [m]."""

BLOCKED_TIME, BLOCKED_WAY = 6.0, 40.0
"""Something that stands ahead is a reason to change within this time [s], and within this distance at least [m]."""

PULL_OUT: Final = 2.0
PULL_OUT_PER_LENGTH: Final = 0.4
"""A driver that wants to pass what stands keeps this much more room to it than in a queue [m], and more for each metre
of its vehicle beyond `CAR_LENGTH`: with 4 m in all the corner of a car stays clear of it in an easy turn, and that of a
bus with 6.6 m. At full lock a car needs 1.9 m, so one that stands nearer comes out, too."""

STUCK: Final = 400
"""Frames for which a driver wants to pass what stands and cannot, before those behind it pass it, too: 8 s."""

KIND_BRAKING: Final = 2.0
"""Drivers brake by this at most to open a gap, or to come to a gap [m/s^2]: the comfortable deceleration."""

COURTESY: Final = 1500
"""Frames for which drivers open gaps for one that waits: 30 s. After that it gets none for as long, so that a driver
that cannot use its gap does not hold up a lane for ever."""

BEFORE_JOIN: Final = 100.0
"""Disadvantage of a lane that soon joins another one, more than any advantage [m/s^2]. Those on both have an order
already, so a driver changes into it only if it must."""

LOOK_BACK: Final = 3
"""Lanes behind on which a follower is searched. Few lanes are shorter than 50 m."""


@dataclass(slots=True, eq=False)
class _Option:
    """The lane on one side, as each driver finds it; (k,) each.

    Attributes:
        is_there: one may change to this side here.
        run: how far the lanes go on there [m].
        gap: to the lead vehicle there, inf for none [m].
        lead_speed: of it [m/s].
        gap_behind: from the follower there, inf for none [m].
        follower: int64, which driver it is; -1 for none, and for an entity that does not follow lanes.
        follower_speed: of it [m/s].
        advantage: of a change, without the bias [m/s^2].
        is_safe: the change is.
    """

    is_there: BoolArray
    run: FloatArray
    gap: FloatArray
    lead_speed: FloatArray
    gap_behind: FloatArray
    follower: IntArray
    follower_speed: FloatArray
    advantage: FloatArray
    is_safe: BoolArray

    def at(self, which: slice | IntArray) -> _Option:
        """Return some of the drivers' options."""
        return _Option(*(getattr(self, name)[which] for name in _OPTION_COLUMNS))


_OPTION_COLUMNS: Final = tuple(_Option.__dataclass_fields__)

_LOOK_COLUMNS: Final = (
    *("_which", "_lanes", "_arc", "_speed", "_shift_time", "_nose", "_rear", "_length", "_gap", "_lead_speed"),
    *("_run", "_to_entry", "_is_blocked", "_is_inside", "_is_free"),
)
"""Attributes of `LaneLook` that have an entry for each driver."""


class LaneLook:
    """One look of some drivers at the lanes beside them, and what they decide."""

    def __init__(  # noqa: PLR0917 - what all drivers see, and some of them
        self,
        world: WorldRows,
        rows: IntArray,
        choice: RouteChoice,
        drivers: Drivers,
        perception: Perception,
        queue: EntryQueue,
        desired_speed: FloatArray,
        which: IntArray,
    ) -> None:
        self._world, self._rows, self._roads, self._choice = world, rows, world.roads, choice
        self._neighbours = world.roads.derived(LaneNeighbours)
        self._conflicts = world.roads.derived(LaneConflicts)
        self._drivers, self._perception, self._queue = drivers, perception, queue
        self._desired_speed = desired_speed
        self._which = which
        self._lanes = drivers.lanes.take(which, axis=1)
        self._arc, self._speed = drivers.arc[which], drivers.speed[which]
        self._shift_time = shift_time(ARRAYS, drivers.parameters.change_time[which], self._speed)
        self._nose, self._rear, self._length = drivers.nose[which], drivers.rear[which], drivers.length[which]
        self._gap, self._lead_speed = perception.gap[which], perception.lead_speed[which]
        self._run = self._find_run(self._lanes, self._arc)
        conflicts = self._conflicts
        self._to_entry = self._find_entry(np.fmin(conflicts.wait_point, conflicts.joins.narrow_from))
        reach = np.fmax(BLOCKED_WAY, BLOCKED_TIME * self._speed)
        is_near = (self._gap < reach) & (self._lead_speed < STANDS)
        self._is_blocked = np.zeros(len(which), dtype=bool)
        if np.count_nonzero(is_near):
            # Nobody changes lanes on the stretch before a join, but around what stands there one may leave it.
            before_join = (is_near & (conflicts.joins.join[self._lanes[0]] >= 0)).nonzero()[0]
            if len(before_join):
                self._to_entry[before_join] = self._find_entry(conflicts.wait_point)[before_join]
            at = (is_near & (self._to_entry > self._gap + LIGHT_QUEUE)).nonzero()[0]
            if len(at):
                self._is_blocked[at] = self._find_blocked(at)
        self._is_inside = (self._to_entry <= 0.0) | (drivers.held[which] >= 0)
        # One that may enter its lane, and could not stop before another one, is inside, too.
        has_claim = drivers.claim[which] >= 0
        self._is_inside |= has_claim & (np.square(self._speed) > 2.0 * FIRM * np.fmax(self._to_entry - STOP_GAP, 0.0))
        is_far = self._to_entry > ENTRY_WAY + (SIGNAL_FRAMES * DT + self._shift_time) * self._speed
        self._is_free = is_far & ~self._is_inside

    def _narrow(self) -> None:
        """Leave out those who can do nothing: near an entry, without a reason to change and without a signal."""
        world, rows = self._world, self._rows[self._which]
        counts = self._is_free | self._is_blocked | (self._run < np.inf)
        counts |= (world.change[rows] | world.signal[rows]) != 0
        at = counts.nonzero()[0]
        if len(at) < len(rows):
            for name in _LOOK_COLUMNS:
                setattr(self, name, getattr(self, name)[..., at])

    def decide(self, accel: FloatArray, decision: int | IntArray) -> tuple[IntArray, IntArray, BoolArray]:
        """Choose who signals and who begins to change.

        Args:
            accel: (n,) of all drivers, written: for gaps that open [m/s^2].
            decision: number of the decision, one for all or (n,).

        Returns:
            Those that begin, (m,) int64; (m,) int64, to which side; and (m,) bool, whether they pull out from rest.
        """
        self._narrow()
        which, is_inside = self._which, self._is_inside
        if not len(which):
            return which, which, which > 0
        world, rows = self._world, self._rows[which]
        num, frame, turn = len(which), world.frames(rows), decision if isinstance(decision, int) else decision[which]
        both = self._look_aside()
        options = [both.at(slice(i * num, (i + 1) * num)) for i in range(NUM_SIDES)]
        now, since, signal = world.change[rows], world.change_since[rows], world.signal[rows]
        reason, side = self._find_must(options)
        must = reason > 0
        # Changes of choice
        bias = KEEP_RIGHT_BIAS * self._neighbours.keeps_right[self._lanes[0]]
        advantages = []
        for i, option in enumerate(options):
            advantage = option.advantage + (bias if i == RIGHT else -bias)
            goes_on = (option.run > WAY_ON + MUST_TIME * self._speed) | (option.run >= self._run)
            is_open = option.is_there & goes_on & self._is_free
            advantages.append(np.where(is_open, advantage, -np.inf))
        best = np.where(advantages[RIGHT] > advantages[0], RIGHT, 0)
        index = np.arange(num)
        safe = both.is_safe[index + num * best]
        most = np.fmax(advantages[0], advantages[RIGHT])
        is_right = (best == RIGHT) & (options[RIGHT].advantage < THRESHOLD)
        is_back = (world.came_from[rows] == best + 1) & (most < GOOD_REASON)
        has_rested = (since == 0) | (frame - since >= np.where(is_right | is_back, RETURN, REST))
        wishes = (~must & (now == 0) & (most > THRESHOLD) & safe & has_rested).nonzero()[0]
        side[wishes] = best[wishes]
        reason[wishes] = np.where(is_right[wishes], int(LaneChange.KEEP_RIGHT), int(LaneChange.FASTER))
        # Signals for a change of choice that goes on
        is_kept = ~must & ((now == int(LaneChange.FASTER)) | (now == int(LaneChange.KEEP_RIGHT)))
        old_side = np.maximum(signal - 1, 0)
        old_advantage = np.where(old_side == RIGHT, advantages[RIGHT], advantages[0])
        is_kept &= (old_advantage > 0.0) & (frame - since < PATIENCE)
        side[is_kept], reason[is_kept] = old_side[is_kept], now[is_kept]
        is_slow = self._mind_bends(reason, side, must, accel)
        # The signals from now on
        shows = np.where(reason > 0, side + 1, 0)
        is_new = shows != signal
        since = np.where(is_new, frame, since)
        world.change[rows], world.signal[rows], world.change_since[rows] = reason, shows, since
        # The drivers that begin
        chosen = both.at(index + num * side)
        is_tight = (reason == int(LaneChange.AROUND)) & (self._speed < STANDS)
        is_clear = np.zeros(num, dtype=bool)
        if len(at := ((reason > 0) & ~is_inside).nonzero()[0]):
            is_clear[at] = self._is_clear(at, side[at], is_tight[at])
        may = chosen.is_there & chosen.is_safe & is_clear & is_slow
        begins = (reason > 0) & ~is_new & (frame - since >= SIGNAL_FRAMES) & may & (side == turn % NUM_SIDES)
        must_wait = (reason >= int(LaneChange.ROUTE)) & ~begins & chosen.is_there & ~is_inside
        if np.count_nonzero(must_wait):
            self._open_gaps(index[must_wait], chosen, is_clear, accel)
        keep_room = (reason == int(LaneChange.AROUND)) & ~begins
        if np.count_nonzero(keep_room):
            self._keep_room(index[keep_room], accel)
        return which[begins], side[begins], is_tight[begins]

    def _mind_bends(self, reason: IntArray, side: IntArray, must: BoolArray, accel: FloatArray) -> BoolArray:
        """Return which drivers are slow enough to change lanes in the bends of the other lane, (k,).

        Of the others those that must change brake gently, and no other one begins to signal.

        Args:
            reason: (k,) int64, of the changes; written.
            side: (k,) int64.
            must: (k,) bool.
            accel: (n,) of all drivers, written [m/s^2].
        """
        is_slow = np.ones(len(reason), dtype=bool)
        at = (reason > 0).nonzero()[0]
        if not len(at):
            return is_slow
        excess = self._excess(at, side[at])
        is_slow[at] = excess <= 0.0
        at, excess = at[excess > 0.0], excess[excess > 0.0]
        is_new = self._world.change[self._rows[self._which[at]]] == 0
        reason[at[is_new & ~must[at]]] = 0
        slows = must[at]
        which = self._which[at[slows]]
        braking = np.fmin(excess[slows] / SETTLING_TIME, self._drivers.parameters.comfort[which])
        accel[which] = np.fmin(accel[which], -braking)
        return is_slow

    def _excess(self, at: IntArray, side: IntArray) -> FloatArray:
        """Return by how much drivers are too fast to change lanes in the bends of lanes beside them, (m,) [m/s].

        Args:
            at: (m,) int64, the drivers.
            side: (m,) int64, `LEFT` or `RIGHT`.
        """
        which, speed, speeds_ahead = self._which[at], self._speed[at], self._conflicts.speeds_ahead
        lane, s = self._neighbours.cross(side, self._lanes[0, at], self._arc[at])
        there = (lane >= 0).nonzero()[0]
        which, drivers = which[there], self._drivers.parameters
        lanes = self._choice.preview(which, lane[there])
        excess, speed, s = np.zeros(len(at)), speed[there], s[there]
        factor = lateral_in_shift(drivers, which, speed, LANE) / MAX_LATERAL
        reach = foresight(speed, drivers.reaction[which])
        start, *_, bend, slope = speeds_ahead.take(self._roads.locate(lanes[0], s)[0], 0).T
        square, distance = factor * (bend + slope * (s - start)), self._roads.length[lanes[0]] - s
        for following in lanes[1:]:
            # Beyond a dead end there is no lane, and no bend that counts.
            *_, first, least, _ = speeds_ahead.take(self._roads.first[np.maximum(following, 0)], 0).T
            enter = first + np.fmax(1.0 - distance / reach, 0.0) * (least - first)
            before = factor * enter + 2.0 * drivers.comfort[which] * np.fmax(distance - reach, 0.0)
            square = np.where(following >= 0, np.fmin(square, before), square)
            distance += self._roads.length[following]
        excess[there] = speed - SPEED_TOLERANCE * np.sqrt(square)
        return excess

    def _is_clear(self, at: IntArray, side: IntArray, is_tight: BoolArray) -> BoolArray:
        """Return whether drivers would be clear of their lead vehicles in time if they began now, (m,)."""
        shifts = Shifts(
            rows=self._rows[self._which[at]],
            nose=self._nose[at],
            length=self._length[at],
            side=side,
            done=np.zeros(len(at)),
            across=np.full(len(at), LANE),
            gap=self._gap[at],
            lead_speed=self._lead_speed[at],
            is_tight=is_tight,
            change_time=self._drivers.parameters.change_time[self._which[at]],
        )
        return is_clear(self._world, shifts, self._speed[at])

    def _find_must(self, options: list[_Option]) -> tuple[IntArray, IntArray]:
        """Return why drivers must change lanes and to which side, (k,) int64 each; 0 for those that need not."""
        which, neighbours, choice = self._which, self._neighbours, self._choice
        world, rows = self._world, self._rows[which]
        reason, side = np.zeros(len(which), dtype=np.int64), np.zeros(len(which), dtype=np.int64)
        ends = np.isfinite(self._run).nonzero()[0]
        if len(ends):
            count = (self._lanes[:, ends] >= 0).sum(axis=0) - 1
            last = self._lanes[count, ends]
            wanted = choice.find_wanted(which[ends], world.turns[rows[ends]] + count)
            is_route = (wanted >= 0) & (wanted != last)
            steps = np.where(is_route, neighbours.place[wanted] - neighbours.place[last], 1)
            to_side = np.where(is_route, np.where(steps > 0, 1, 2), neighbours.merge_side[last])
            begins_at = np.abs(steps) * np.fmax(MUST_WAY, MUST_TIME * self._speed[ends])
            is_near = (to_side > 0) & (self._run[ends] < begins_at)
            at = ends[is_near]
            reason[at] = np.where(is_route[is_near], int(LaneChange.ROUTE), int(LaneChange.LANE_END))
            side[at] = to_side[is_near] - 1
        around = ((reason == 0) & self._is_blocked).nonzero()[0]
        if len(around):
            values = []
            for option in options:
                goes_on = (option.run > self._gap + WAY_ON) | (option.run >= self._run)
                is_good = option.is_there & goes_on & (option.gap > self._gap + self._length)
                values.append(np.where(is_good, option.advantage + option.is_safe, -np.inf)[around])
            # One that signals already keeps its side, or it would never come to begin.
            signal = world.signal[rows[around]]
            values = [np.where((signal == i + 1) & (value > -np.inf), np.inf, value) for i, value in enumerate(values)]
            has_one = np.fmax(values[0], values[1]) > -np.inf
            reason[around[has_one]] = LaneChange.AROUND
            side[around] = np.where(values[1] > values[0], 1, 0)
        return reason, side

    def _find_blocked(self, at: IntArray) -> BoolArray:
        """Return whether what stands ahead of some drivers, (m,) int64, waits for nothing, (m,)."""
        drivers, queue = self._drivers, self._queue
        perception, world = self._perception, self._world
        lead = perception.lead[self._which[at]]
        rows = self._rows[lead]
        is_stuck = (world.change[rows] == int(LaneChange.AROUND)) | (world.leaving[rows] > 0)
        is_stuck &= world.frames(rows) - world.change_since[rows] > STUCK
        is_parked = (lead < 0) | (world.desired_speed[rows] < STANDS) | is_stuck
        # The entry of the lead vehicle, if it is on the same lane, and the one ahead of it
        position = np.minimum(queue.position[self._which[at]] + 1, queue.num)
        following = np.minimum(position + 1, queue.num)
        is_queue = (queue.lane[following] == queue.lane[position]) & (queue.speed[following] < STANDS)
        # No difference of the two: both are infinite behind the last entry.
        is_queue &= queue.tail[following] < queue.s[position] + QUEUE_GAP + drivers.nose[self._which[at]]
        is_queue &= queue.lane[position] == self._lanes[0, at]
        is_queue &= queue.source[following] >= 0
        return np.asarray(is_parked & ~is_queue)

    def _open_gaps(self, at: IntArray, chosen: _Option, is_clear: BoolArray, accel: FloatArray) -> None:
        """Have followers open gaps for those that must change, and these adapt to the lead vehicles there."""
        which, world = self._which, self._world
        waited = world.frames(self._rows[which[at]]) - world.change_since[self._rows[which[at]]]
        helped = at[(waited % (2 * COURTESY) < COURTESY) & is_clear[at] & (chosen.follower[at] >= 0)]
        follower = chosen.follower[helped]
        speed = self._drivers.speed[follower]
        brakes = follow(speed, self._desired_speed[follower], chosen.gap_behind[helped], self._speed[helped])
        np.minimum.at(accel, follower, np.fmax(brakes, -KIND_BRAKING))
        brakes = follow(self._speed[at], self._desired_speed[which[at]], chosen.gap[at], chosen.lead_speed[at])
        accel[which[at]] = np.fmin(accel[which[at]], np.fmax(brakes, -KIND_BRAKING))

    def _keep_room(self, at: IntArray, accel: FloatArray) -> None:
        """Keep room to pull out, for drivers that want to pass a standing vehicle."""
        which = self._which[at]
        room = PULL_OUT + PULL_OUT_PER_LENGTH * np.fmax(self._length[at] - CAR_LENGTH, 0.0)
        brakes = follow(self._speed[at], self._desired_speed[which], self._gap[at] - room, self._lead_speed[at])
        accel[which] = np.fmin(accel[which], np.fmax(brakes, -HARDEST))

    def _look_aside(self) -> _Option:
        """Return what all of them find to the left, and then to the right: both cost little more than one."""
        drivers, queue, neighbours = self._drivers, self._queue, self._neighbours
        half = len(self._which)
        num = NUM_SIDES * half
        side, own_index = np.divmod(np.arange(num), half)
        own_lane = self._lanes[0, own_index]
        option = _Option(
            is_there=np.zeros(num, dtype=bool),
            run=np.zeros(num),
            gap=np.full(num, np.inf),
            lead_speed=np.zeros(num),
            gap_behind=np.full(num, np.inf),
            follower=np.full(num, -1, dtype=np.int64),
            follower_speed=np.zeros(num),
            advantage=np.full(num, -np.inf),
            is_safe=np.zeros(num, dtype=bool),
        )
        lane, s = neighbours.cross(side, own_lane, self._arc[own_index])
        # Before a join there must be time to finish: from there on vehicles of two lanes share the room.
        narrow_from = np.where(lane >= 0, self._conflicts.joins.narrow_from[lane], np.inf)
        is_wide = s + (self._nose + self._shift_time * self._speed)[own_index] < narrow_from
        option.is_there = (lane >= 0) & neighbours.may[side, own_lane] & is_wide
        there = option.is_there.nonzero()[0]
        if not len(there):
            return option
        at = own_index[there]
        which, lane, s = self._which[at], lane[there], s[there]
        lanes = self._choice.preview(which, lane)
        option.run[there] = self._find_run(lanes, s)
        position = queue.find(lane, s)
        gap, lead_speed = self._find_lead(lanes, s, position)
        gap -= self._nose[at]
        option.gap[there], option.lead_speed[there] = gap, lead_speed
        entry, distance = self._find_follower(lane, s, position)
        follower = queue.source[entry]
        nose = np.where(follower >= 0, drivers.nose[follower], queue.s[entry] - queue.tail[entry])
        has_follower = np.isfinite(distance)
        gap_behind = np.where(has_follower, distance - self._rear[at] - nose, np.inf)
        speed_behind = np.where(has_follower, queue.speed[entry], 0.0)
        option.gap_behind[there], option.follower_speed[there] = gap_behind, speed_behind
        option.follower[there] = np.where(has_follower, follower, -1)
        option.is_safe[there] = find_safe(self._speed[at], gap, lead_speed, gap_behind, speed_behind)
        # MOBIL
        speed, wanted = self._speed[at], self._desired_speed[which]
        own = follow(speed, wanted, gap, lead_speed) - follow(speed, wanted, self._gap[at], self._lead_speed[at])
        others = np.where(has_follower, self._cost(follower, speed_behind, gap_behind, at, gap, lead_speed), 0.0)
        before = np.maximum(queue.position[which] - 1, 0)
        old = queue.source[before]
        # A slow driver makes way to the right for one that comes from behind, but not to the left.
        has_old = (
            (side[there] == RIGHT)
            & (queue.position[which] > 0)
            & (queue.lane[before] == self._lanes[0, at])
            & (old >= 0)
        )
        old_speed = queue.speed[before]
        old_gap = self._arc[at] - self._rear[at] - queue.s[before] - np.where(old >= 0, drivers.nose[old], 0.0)
        gain = -self._cost(old, old_speed, old_gap, at, self._gap[at], self._lead_speed[at])
        politeness = drivers.parameters.politeness[which]
        joins = self._conflicts.joins.join
        # The lane of an entry, to the right of one that it joins, only leads back.
        enters_join = (joins[lane] >= 0) & ((joins[self._lanes[0, at]] < 0) | (side[there] == RIGHT))
        worth = own + politeness * (others + np.where(has_old, gain, 0.0))
        option.advantage[there] = worth - np.where(enters_join, BEFORE_JOIN, 0.0)
        return option

    def _cost(  # noqa: PLR0917 - of three vehicles
        self,
        follower: IntArray,
        speed: FloatArray,
        gap: FloatArray,
        at: IntArray,
        beyond: FloatArray,
        lead_speed: FloatArray,
    ) -> FloatArray:
        """Return by how much followers accelerate more with the driver ahead of them than without, (m,) [m/s^2].

        Args:
            follower: (m,) int64; -1 for those that do not follow lanes.
            speed: (m,) of the follower [m/s].
            gap: (m,) between follower and driver [m].
            at: (m,) int64, the drivers.
            beyond: (m,) gap of the driver to the vehicle ahead of it [m].
            lead_speed: (m,) of that vehicle [m/s].
        """
        wanted = np.where(follower >= 0, self._desired_speed[follower], np.fmax(speed, 1.0))
        without = follow(speed, wanted, gap + self._length[at] + beyond, lead_speed)
        return np.asarray(np.fmax(follow(speed, wanted, gap, self._speed[at]), -HARDEST) - np.fmax(without, -HARDEST))

    def _find_lead(self, lanes: IntArray, s: FloatArray, position: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the distance of the first tail beyond places, inf for none [m], and its speed [m/s]; (m,) each.

        Args:
            lanes: (6, m) int64, lanes of the places and those ahead.
            s: (m,) the places [m].
            position: (m,) int64, of the first entries beyond them in the queue.
        """
        queue, roads = self._queue, self._roads
        is_on = queue.lane[position] == lanes[0]
        gap = np.where(is_on, queue.tail[position] - s, np.inf)
        lead_speed = np.where(is_on, queue.speed[position], 0.0)
        distance = roads.length[lanes[0]] - s
        for lane in lanes[1:]:
            at = (np.isinf(gap) & (lane >= 0)).nonzero()[0]
            if not len(at):
                break
            first = queue.first_on(lane[at])
            gap[at] = distance[at] + queue.tail[first]
            lead_speed[at] = queue.speed[first]
            distance[at] += roads.length[lane[at]]
        return gap, lead_speed

    def _find_follower(self, lane: IntArray, s: FloatArray, position: IntArray) -> tuple[IntArray, FloatArray]:
        """Return the last entry before places: its position in the queue, and its distance, inf for none [m].

        Args:
            lane: (m,) int64, lanes of the places.
            s: (m,) the places [m].
            position: (m,) int64, of the first entries beyond them in the queue.
        """
        queue, roads = self._queue, self._roads
        before = self._neighbours.before
        entry = np.maximum(position - 1, 0)
        is_on = (position > 0) & (queue.lane[entry] == lane)
        distance = np.where(is_on, s - queue.s[entry], np.inf)
        at, from_lane, way = (~is_on).nonzero()[0], lane[~is_on], s[~is_on]
        for _ in range(LOOK_BACK):
            if not len(at):
                break
            index, link = before.of(from_lane)
            at, from_lane, way = at[index], before.other[link], way[index] + roads.length[before.other[link]]
            last = queue.find(from_lane, roads.length[from_lane]) - 1
            is_found = (last >= 0) & (queue.lane[last] == from_lane)
            found = is_found.nonzero()[0]
            there = way[found] - queue.s[last[found]]
            # The nearest of several lanes that lead here; of equally near ones the first.
            for i in found[np.lexsort((found, there))].tolist():
                if way[i] - queue.s[last[i]] < distance[at[i]]:
                    distance[at[i]], entry[at[i]] = way[i] - queue.s[last[i]], last[i]
            is_open = ~is_found & np.isinf(distance[at])
            at, from_lane, way = at[is_open], from_lane[is_open], way[is_open]
        return entry, distance

    def _find_run(self, lanes: IntArray, s: FloatArray) -> FloatArray:
        """Return how far the lanes ahead go on from places, inf where no end is known, (m,) [m]."""
        run = np.full(len(s), np.inf)
        ends = (lanes[-1] < 0).nonzero()[0]
        if len(ends):
            length = np.where(lanes[:, ends] >= 0, self._roads.length[lanes[:, ends]], 0.0)
            length[0] -= s[ends]
            run[ends] = np.add.accumulate(length)[-1]
        return run

    def _find_entry(self, begins: FloatArray) -> FloatArray:
        """Return the distance from the front bumper to the next place where lanes conflict or a light is, (k,) [m].

        It is 0 or negative inside of such a place.

        Args:
            begins: (l,) arc length at which lanes conflict, inf for none [m].
        """
        roads, conflicts = self._roads, self._conflicts
        own, ahead = self._lanes[0], self._lanes[1:]
        bumper, has_light = self._arc + self._nose, self._world.signals.plan.light_of_lane[ahead] >= 0
        # A vehicle whose tail is still where the own lane forks is inside.
        is_inside = self._arc - self._rear < conflicts.shared[own]
        to_entry = np.where(is_inside, 0.0, begins[own] - bumper)
        distance = roads.length[self._lanes[:-1]]
        distance[0] -= bumper
        # Lanes beyond a dead end are not there.
        there = np.add.accumulate(distance) + np.where(has_light, 0.0, begins[ahead])
        return np.fmin(to_entry, np.minimum.reduce(np.where(ahead >= 0, there, np.inf)))
