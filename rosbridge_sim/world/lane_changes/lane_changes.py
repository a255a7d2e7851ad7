"""Lane changes: which drivers want one and why, when they begin it, and what the others do meanwhile.

*Wish.* A driver looks at the lanes beside it once a second. It must change if its lane ends, if its route goes on from
another lane, or if something stands ahead that waits for nothing. Otherwise `lane_change_model` decides. No driver
changes lanes inside an intersection. Near its entry a driver changes only if it must.

*Signal.* A driver signals for 1.5 s at least before it moves over. If it must change, the follower in the other lane
opens a gap for it, and the driver adapts its own speed to the vehicle that will be ahead of it.

*Change.* The vehicle belongs to the new lane at once, with an offset from it that goes to zero (`lane_change_motion`).
While it is on its way it has an entry on the old lane too, so the drivers in both lanes see it, and it minds the lead
vehicles in both. Changes to the left begin on even decisions and those to the right on odd ones, so that two drivers
never take the same gap from two sides.

Self-driving egos stay in their lane, unless `self_driving.change_lane` is called.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import CREEP, FIRM, HARDEST, Perception
from rosbridge_sim.world.drivers.driver_parameters import HEAVY_LENGTH, DriverParameters
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries, EntryQueue
from rosbridge_sim.world.drivers.lane_position import rear_axles, set_legs
from rosbridge_sim.world.drivers.route_choice import NUM_AHEAD, RouteChoice
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, is_any, run_of, wrap_angle
from rosbridge_sim.world.lane_changes.lane_change_decision import BLOCKED_WAY, LaneLook
from rosbridge_sim.world.lane_changes.lane_change_model import LaneChange, follow
from rosbridge_sim.world.lane_changes.lane_change_motion import (
    LANE,
    TIGHT_BEND,
    lateral_in_shift,
    length_of_tight_shift,
    shift_time,
)
from rosbridge_sim.world.lane_changes.lane_change_passing import Shifts, find_blocked, find_edges, is_clear
from rosbridge_sim.world.roads.lane_change_map import NUM_SIDES, LaneNeighbours
from rosbridge_sim.world.roads.lane_conflicts import SETTLING_TIME, LaneConflicts
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

LOOK_EVERY: Final = 5  # odd, so that looks fall on even and odd decisions in turn
LOOK_PARTS: Final = 2
"""Each so many decisions, one of so many parts of the drivers looks at the lanes beside: each driver once a second, for
a change is no matter of tenths of a second. Few looks of many drivers cost less than many of few."""

SPARE_ROOM, SLOW = 1.0, 6.0
"""Room that a driver with a lane beside it keeps in addition to that in a queue [m], behind what follows no lane and is
slower than that [m/s]. So it can pull out if that stands."""

OFF_OLD_LANE, OFF_OLD_LANE_LONG = 1.0, 0.3
"""A vehicle this near to its new place does not obstruct the old lane any more [m]: it is 2.5 m from that line. The
tail of a long one, which stands 3 m back at an angle, is then 0.2 m over the border instead of 0.8 m."""

FASTER_SOON: Final = 1.0
"""A driver that changes lanes minds the speed that it would have after this time [s]: three times its reaction."""


class LaneChanges:
    """The lane changes of some lane followers. It lives as long as they do, see `lane_following`, and holds no state.

    Attributes:
        world, rows, choice: as given.
        roads, neighbours, conflicts: of the world.
        is_possible: somebody may change lanes somewhere.

    Args:
        world: written by the methods.
        rows: (n,) int64, rows of all lane followers. The methods mean indices into these.
        choice: of the same rows.
    """

    def __init__(self, world: WorldRows, rows: IntArray, choice: RouteChoice) -> None:
        self.world, self.rows, self.choice = world, rows, choice
        self.roads = world.roads
        self.neighbours = world.roads.derived(LaneNeighbours)
        self.conflicts = world.roads.derived(LaneConflicts)
        self._at: slice | IntArray = run_of(rows) if len(rows) else rows
        self.may = (world.kind[rows] != int(Kind.EGO)) & ~world.keeps_lane[rows]
        is_long = 2.0 * world.half_length[rows] > HEAVY_LENGTH
        self._off_old_lane = np.where(is_long, OFF_OLD_LANE_LONG, OFF_OLD_LANE)
        self.is_possible = self.neighbours.is_any and bool(self.may.any())

    def find_leaving(self, drivers: Drivers) -> Entries | None:
        """Return the entries of those that change lanes on the lanes that they leave; None if there are none."""
        world, at = self.world, self._at
        if not self.is_possible or not np.count_nonzero(world.leaving[at]):
            return None
        leaves = world.leaving[at] > 0
        is_near = np.abs(world.lateral[at] - world.lateral_to[at]) > self._off_old_lane
        which = (leaves & is_near).nonzero()[0]
        if not len(which):
            return None
        lane, s = self.neighbours.cross(
            world.leaving[self.rows[which]] - 1, drivers.lanes[0, which], drivers.arc[which]
        )
        is_there = lane >= 0
        which, lane, s = which[is_there], lane[is_there], s[is_there]
        if not len(which):
            return None
        speed, accel = drivers.speed[which], drivers.accel[which]
        return Entries(lane, s, s - drivers.rear[which], speed, accel, which, np.zeros(len(which), bool))

    def find_lateral(self, parameters: DriverParameters, speed: FloatArray) -> FloatArray:
        """Return the lateral acceleration that drivers accept of bends now, (n,) [m/s^2].

        It is less while they change lanes, and before a change that they must make: they slow down for it.

        Args:
            speed: (n,) [m/s].
        """
        lateral = parameters.lateral
        if not self.is_possible:
            return lateral
        world, rows, at = self.world, self.rows, self._at
        if not (np.count_nonzero(world.leaving[at]) or np.count_nonzero(world.change[at])):
            return lateral
        leaves = world.leaving[at] > 0
        which = (leaves | (world.change[at] >= int(LaneChange.ROUTE))).nonzero()[0]
        if not len(which):
            return lateral
        way = np.abs(world.lateral_to[rows[which]] - world.lateral_from[rows[which]])
        across = np.where(leaves[which], way, LANE)
        lateral = lateral.copy()
        lateral[which] = lateral_in_shift(parameters, which, speed[which], across)
        return lateral

    def decide(
        self,
        drivers: Drivers,
        perception: Perception,
        desired_speed: FloatArray,
        accel: FloatArray,
        decision: int | IntArray,
    ) -> tuple[FloatArray, bool]:
        """Choose who signals, begins or ends a lane change.

        Call it only where a change `is_possible`.

        Args:
            drivers: all of them; `claim` is written.
            desired_speed: (k,) the desired speed or the safe one, whichever is lower [m/s].
            accel: (k,) that they chose without regard to lane changes [m/s^2].
            decision: number of the decision, one for all or (k,).

        Returns:
            The accelerations (k,) that all choose then, and whether anybody has begun a change.
        """
        assert perception.queue is not None
        world, rows = self.world, self.rows
        accel = accel.copy()
        if drivers.leaving is not None:
            self.mind_old_lane(drivers, perception.queue, desired_speed, accel)
        if np.count_nonzero(world.leaving[self._at]):
            self.end_changes()
        self._leave_room(drivers, perception, desired_speed, accel)
        # A driver that must change looks for its gap at each decision; one that signals by choice, at each
        # `LOOK_EVERY`-th.
        is_part, change = decision % LOOK_EVERY == 0, world.change[self._at]
        is_due = is_part if isinstance(is_part, bool) else is_any(is_part)
        if not is_due and not np.count_nonzero(change):
            return accel, False
        looks = change >= int(LaneChange.ROUTE)
        if is_due:
            looks |= is_part & (change >= int(LaneChange.FASTER))
            is_turn = is_part & (drivers.uid % LOOK_PARTS == decision // LOOK_EVERY % LOOK_PARTS)
            looks |= is_turn & self.neighbours.has_side[drivers.lanes[0]]
        which, has_begun = (looks & self.may & (world.leaving[self._at] == 0)).nonzero()[0], False
        if len(which):
            look = LaneLook(world, rows, self.choice, drivers, perception, perception.queue, desired_speed, which)
            begins = look.decide(accel, decision)
            has_begun = len(begins[0]) > 0
            if has_begun:
                self.start(drivers, *begins)
        return accel, has_begun

    def end_changes(self) -> None:
        """End the changes of those that have arrived."""
        world, rows = self.world, self.rows
        done = rows[(world.leaving[rows] > 0) & (world.lateral_left[rows] == 0.0)]
        world.leaving[done] = world.signal[done] = world.change[done] = 0
        world.change_since[done] = world.frames(done)

    def mind_old_lane(
        self,
        drivers: Drivers,
        queue: EntryQueue,
        desired_speed: FloatArray,
        accel: FloatArray,
        of: IntArray | slice = slice(None),
    ) -> None:
        """Brake for the lead vehicle in the old lane, where a vehicle that changes lanes would touch it.

        Args:
            accel: written.
            of: which of the entries of those that leave their lanes.
        """
        assert drivers.leaving is not None
        num, entries = len(drivers.arc), drivers.leaving
        after = queue.position[num : num + len(entries.lane)][of] + 1
        entries = entries.at(of)
        world, which = self.world, entries.source
        is_on = queue.lane[after] == entries.lane
        gap = np.where(is_on, queue.tail[after] - entries.s, np.inf)
        lead_speed = np.where(is_on, queue.speed[after], 0.0)
        following = drivers.lanes[1, which]
        side = world.leaving[self.rows[which]] - 1
        beyond = np.where(following >= 0, self.neighbours.beside[side, following], -1)
        far = (~is_on & (beyond >= 0)).nonzero()[0]
        first = queue.first_on(beyond[far])
        gap[far] = self.roads.length[entries.lane[far]] - entries.s[far] + queue.tail[first]
        lead_speed[far] = queue.speed[first]
        gap -= drivers.nose[which]
        rows = self.rows[which]
        shifts = Shifts(
            rows=rows,
            nose=drivers.nose[which],
            length=drivers.length[which],
            side=NUM_SIDES - 1 - side,
            done=1.0 - world.lateral_left[rows],
            across=np.abs(world.lateral_from[rows] - world.lateral_to[rows]),
            gap=gap,
            lead_speed=lead_speed,
            is_tight=world.lateral_bend[rows] != 0.0,
            change_time=drivers.parameters.change_time[which],
        )
        now, edges = drivers.speed[which], find_edges(world, shifts)
        # The faster a vehicle drives, the later it is off the old lane: before it must brake, it stops to accelerate.
        faster = now + FASTER_SOON * np.fmax(drivers.accel[which], 0.0)
        soon = which[~is_clear(world, shifts, faster, edges)]
        accel[soon] = np.fmin(accel[soon], 0.0)
        # Those that pull out from rest do it at walking speed: their wheels are turned.
        at = (shifts.is_tight & np.isfinite(gap)).nonzero()[0]
        duration = shift_time(ARRAYS, shifts.change_time[at], now[at])
        walking = length_of_tight_shift(world, rows[at], shifts.across[at]) / duration
        accel[which[at]] = np.fmin(accel[which[at]], (walking - now[at]) / SETTLING_TIME)
        blocked = find_blocked(world, shifts, now, edges)
        hits = (blocked < np.inf).nonzero()[0]
        at = which[hits]
        speed, is_lead = drivers.speed[at], blocked[hits] <= gap[hits]
        gap, lead_speed = blocked[hits], np.where(is_lead, lead_speed[hits], 0.0)
        brakes = follow(speed, desired_speed[at], gap, lead_speed)
        # As firm as it takes not to touch: the model brakes with all it has for any small gap, at walking speed, too.
        needed = np.fmax(speed * speed - lead_speed * lead_speed, 0.0) / (2.0 * np.fmax(gap, CREEP))
        accel[at] = np.fmin(accel[at], np.fmax(brakes, -np.fmin(np.fmax(needed, FIRM), HARDEST)))

    def _leave_room(
        self, drivers: Drivers, perception: Perception, desired_speed: FloatArray, accel: FloatArray
    ) -> None:
        """Keep more room than in a queue behind what is slow and follows no lane: it may stay where it stands."""
        is_slow = (perception.gap < BLOCKED_WAY) & (perception.lead_speed < SLOW) & (drivers.speed < SLOW)
        at = (is_slow & (perception.lead < 0)).nonzero()[0]
        which = at[self.neighbours.has_side[drivers.lanes[0][at]] & self.may[at]] if len(at) else at
        if not len(which):
            return
        gap = perception.gap[which] - SPARE_ROOM
        brakes = follow(drivers.speed[which], desired_speed[which], gap, perception.lead_speed[which])
        accel[which] = np.fmin(accel[which], np.fmax(brakes, -FIRM))

    def start(self, drivers: Drivers, which: IntArray, side: IntArray, is_tight: BoolArray) -> None:
        """Begin lane changes: the vehicles belong to the other lanes from now on, where they are.

        Args:
            drivers: `claim` is written.
            which: (k,) int64.
            side: (k,) int64, `LEFT` or `RIGHT`.
            is_tight: (k,) they pull out from rest, with turned wheels.
        """
        world, rows, roads = self.world, self.rows[which], self.roads
        lane, s = self.neighbours.cross(side, world.lane[rows], world.arc[rows])
        lanes = self.choice.preview(which, lane)
        # The wander goes on beside the change.
        x, y, wheelbase = (
            world.x[rows] - world.wander_x[rows],
            world.y[rows] - world.wander_y[rows],
            world.wheelbase[rows],
        )
        lateral, own_yaw = np.zeros(len(which)), world.yaw[rows] - world.wander_slope[rows]
        yaw = own_yaw
        for _ in range(4):  # each round makes the error some tens of times less
            foot, yaw = rear_axles(roads, lanes, s, wheelbase)
            east, north = x - foot[:, 0], y - foot[:, 1]
            s = np.fmin(np.fmax(s + east * np.cos(yaw) + north * np.sin(yaw), 0.0), np.nextafter(roads.length[lane], 0))
            lateral = north * np.cos(yaw) - east * np.sin(yaw)
        world.int_block("lane", f"ahead_{NUM_AHEAD}")[:, rows] = lanes
        world.arc[rows] = s
        world.behind[rows] = world.claim[rows] = world.exit_lane[rows] = -1
        drivers.claim[which] = drivers.exit_lane[which] = -1
        world.lateral[rows] = world.lateral_from[rows] = lateral
        world.lateral_to[rows], world.lateral_push[rows], world.lateral_left[rows] = world.lateral_bias[rows], 0.0, 1.0
        bend = TIGHT_BEND * (world.lateral_to[rows] - lateral)
        world.lateral_bend[rows] = np.where(is_tight, bend, 0.0)
        world.drift[rows] = wrap_angle(own_yaw - yaw)
        world.leaving[rows] = world.came_from[rows] = NUM_SIDES - side
        set_legs(world, self.conflicts, rows)
