"""The lane followers of one world or of many, driven by loops in C, to the last bit as by arrays.

The loops do what all drivers need at each decision and in each step. What is rare stays with numpy: entities that
follow no lanes, joins, intruders, the start of lane changes, those close behind what stands, the swing of long
vehicles, and all sines.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.drivers.driver_model import Perception
from rosbridge_sim.world.drivers.intruders import stop_for_intruders
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries, EntryQueue, scale_ticks
from rosbridge_sim.world.drivers.lane_position import find_straights, headings
from rosbridge_sim.world.drivers.lane_wander import room_of
from rosbridge_sim.world.drivers.zip_merge import follow_in_joins
from rosbridge_sim.world.followers.lane_following import DECISION, LaneFollowers
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.kernels import c_source
from rosbridge_sim.world.kernels.loop_fields import CompiledLoops, LoopFields
from rosbridge_sim.world.lane_changes.lane_change_motion import LANE
from rosbridge_sim.world.lane_changes.lane_change_passing import Shifts, is_clear


class LaneKernel:
    """See the head of this file. It lives as long as the followers.

    Args:
        library: the loops.
        followers: written.
    """

    def __init__(self, library: CompiledLoops, followers: LaneFollowers) -> None:
        self._do, self._followers, self._fields = library, followers, LoopFields()
        self._at = self._fields.address
        self._others: Entries | None = None
        self._most_entries = 0
        self._take_map()
        self._take_drivers()
        fields, siblings = self._fields, followers.conflicts.siblings
        fields.make(c_source.FOR_DRIVERS, followers.num)
        fields.make(c_source.FOR_LANES, len(followers.roads) + 1)
        fields.take(looks=np.zeros(c_source.LOOK_WORDS * followers.num, np.int64))
        # Each driver has an entry on its lane, one on a lane that it leaves, and one on each sibling.
        self._most_own = followers.num * (2 + int(np.diff(siblings.first).max(initial=0)))
        self._take_slants(followers.shifted)

    def _take_map(self) -> None:
        followers, fields = self._followers, self._fields
        roads, conflicts, neighbours = followers.roads, followers.conflicts, followers.changes.neighbours
        straight_end, straight_yaw = roads.derived(find_straights)
        fields.copy(conflicts.onward, "first other", "onward_")
        fields.copy(conflicts.siblings, "first other figure", "sibling_")
        fields.copy(conflicts.rivals, "first other figure", "rival_")
        fields.copy(neighbours.before, "first other", "before_")
        fields.copy(roads, c_source.OF_ROADS)
        fields.copy(conflicts, c_source.OF_CONFLICTS)
        fields.copy(neighbours, c_source.OF_NEIGHBOURS)
        fields.copy(conflicts.joins, c_source.OF_JOINS)
        fields.take(
            segment_length=roads.segments.length,
            straight_end=straight_end,
            straight_yaw=straight_yaw,
            room=roads.derived(room_of),
            light=followers.world.signals.plan.light_of_lane,
        )
        fields["num_lanes"], fields["num_points"] = len(roads), len(roads.points)
        fields["num_in_map"], fields["has_long_legs"] = len(roads.alone), roads.has_long_legs
        fields["is_any"], fields["has_passes"] = neighbours.is_any, bool(conflicts.rival_passes.any())
        if roads.scale_of_lane is not None:
            fields["scale_ticks"] = scale_ticks(roads)
        if followers.choice.bounds is not None:
            fields.take(bounds=followers.choice.bounds)
            fields["num_bounds"] = len(followers.choice.bounds)

    def _take_drivers(self) -> None:
        followers, fields = self._followers, self._fields
        world, parameters, choice, wander = followers.world, followers.parameters, followers.choice, followers.wander
        fields.take_columns(world)
        is_ego = np.zeros(followers.num, dtype=bool)
        is_ego[followers.egos.index] = True
        fields.copy(followers, "nose rear wheelbase response rows uid let_in_later")
        fields.copy(parameters, "speed_factor headway comfort reaction politeness change_time most_lateral")
        fields.copy(parameters, "accel lateral", "own_")
        fields.copy(choice, "is_loop route salt")
        fields.copy(choice, "first length", "route_")
        fields.copy(wander, "rates phases width")
        fields.take(body_length=followers.length, desired=parameters.desired_speed, is_ego=is_ego)
        fields.take(may_change=followers.changes.may, wandering=wander.which, half_room=wander.half_width)
        fields["n"], fields["is_possible"] = followers.num, followers.changes.is_possible
        fields["has_route"], fields["num_wandering"] = len(choice.route) > 0, len(wander.which)
        fields["stride"] = world.int_block("behind", "ahead_5").strides[0] // 8

    # -- decisions

    def decide(self) -> None:
        """See `LaneFollowers.decide`."""
        do, at, fields, followers = self._do, self._at, self._fields, self._followers
        egos, world = followers.egos, followers.world
        if len(egos.rows):
            egos.project()
            followers.advance_lanes(egos.index)
        fields.arrays["frame"][:] = world.frames(followers.rows)
        np.floor_divide(fields.arrays["frame"], DECISION, out=fields.arrays["decision"])
        fields.take(may_enter=world.signals.may_enter)
        others, _, num_moving = followers.others(followers.drivers)
        self._take_entries(others)
        fields["num_moving"] = num_moving
        do["begin_decision"](at)
        fields.arrays["q_key"][: fields["num_entries"]].sort()
        do["perceive"](at)
        if num_moving:
            moving = others.first(num_moving)
            stop_for_intruders(followers.conflicts, self._drivers(), self._perception(), moving)
        num = do["accelerate"](at)
        if num:
            self._mind_closely(fields.arrays["looking"][:num])
        if len(followers.conflicts.joins.shared):
            wanted, moving = fields.arrays["wanted"], others.first(num_moving)
            wanted[:] = follow_in_joins(followers.conflicts, self._drivers(), moving, wanted)
        if followers.changes.is_possible:
            self._change_lanes()
        if len(egos.rows):
            wanted, lanes = fields.arrays["wanted"][egos.index], world.int_block("lane", "ahead_5")
            egos.command(lanes.take(egos.rows, axis=1), wanted)
        do["follow_wishes"](at)
        self._steer()

    def _drivers(self) -> Drivers:
        """Return the drivers without what only changes of lanes need."""
        return self._followers.drivers(may_change=False)

    def _take_entries(self, others: Entries) -> None:
        if others is self._others:
            return
        fields, num = self._fields, len(others.lane)
        self._others, fields["num_others"] = others, num
        for name in ("lane", "s", "tail", "speed", "accel", "stands"):
            fields.take(**{f"other_{name}": np.ascontiguousarray(getattr(others, name))})
        if self._most_own + num >= self._most_entries:
            self._most_entries = self._most_own + 2 * num + 1
            fields.make(c_source.FOR_QUEUE, self._most_entries)

    def _queue(self) -> EntryQueue:
        arrays, num = self._fields.arrays, self._fields["num_entries"]
        columns = {name: arrays[f"q_{name}"][: num + 1] for name in ("lane", "s", "tail", "speed", "accel", "source")}
        return EntryQueue.of_columns(num, position=arrays["q_position"][:num], first=arrays["q_first"], **columns)

    def _perception(self) -> Perception:
        names = ("gap", "lead_speed", "lead_accel", "lead", "stop_distance", "safe_speed", "is_shut_out", "is_blocked")
        arrays: dict[str, Any] = {name: self._fields.arrays[name] for name in names}
        return Perception(**arrays)

    def _mind_closely(self, of: IntArray) -> None:
        """Have some of those that leave lanes mind what stands there, or pull out; see `LaneChanges.mind_old_lane`."""
        fields, drivers = self._fields, self._drivers()
        arrays, num = fields.arrays, fields["num_leaving"]
        names = ("lane", "s", "tail", "speed", "accel", "source")
        columns = {name: arrays[f"left_{name}"][:num] for name in names}
        drivers.leaving = Entries(**columns, stands=np.zeros(num, dtype=bool))
        changes = self._followers.changes
        changes.mind_old_lane(drivers, self._queue(), arrays["desired_now"], arrays["wanted"], of)

    def _change_lanes(self) -> None:
        """See `LaneChanges.decide`."""
        do, at, arrays = self._do, self._at, self._fields.arrays
        num = do["look_at_lanes_beside"](at)
        if num:
            arrays["is_clear"][:num] = self._are_clear(num)
        begun = do["signal_changes"](at, num) if self._fields["num_looks"] else 0
        if begun:
            which, side, is_tight = (arrays[name][:begun].copy() for name in ("at", "side", "is_tight"))
            self._followers.changes.start(self._drivers(), which, side, is_tight)

    def _are_clear(self, num: int) -> npt.NDArray[np.bool_]:
        """Return which of the first looks of `at` are of drivers that could change lanes now; see `Shifts`."""
        followers, arrays = self._followers, self._fields.arrays
        which = arrays["looking"][arrays["at"][:num]]
        rows = followers.rows[which]
        shifts = Shifts(
            rows=rows,
            nose=followers.nose[which],
            length=followers.length[which],
            side=arrays["side"][:num],
            done=np.zeros(num),
            across=np.full(num, LANE),
            gap=arrays["gap"][which],
            lead_speed=arrays["lead_speed"][which],
            is_tight=arrays["is_tight"][:num],
            change_time=followers.parameters.change_time[which],
        )
        return is_clear(followers.world, shifts, followers.world.speed[rows])

    def _steer(self) -> None:
        """See `LaneFollowers.steer`."""
        do, at, arrays, followers = self._do, self._at, self._fields.arrays, self._followers
        num = do["look_at_headings"](at)
        if num:
            np.arctan2(arrays["north"][:num], arrays["east"][:num], arrays["angle"][:num])
            self._head_to_end(do["take_headings"](at, num))
        if len(followers.long):
            self._swing()
        if self._fields["num_wandering"]:
            np.sin(arrays["heading"], arrays["sine"])
            np.cos(arrays["heading"], arrays["cosine"])
        num = do["plan_aside"](at)
        if num:
            np.arctan2(arrays["north"][:num], arrays["east"][:num], arrays["angle"][:num])
        num = do["steer"](at)
        self._take_slants()
        if num:
            followers.choice.change(arrays["at"][:num].copy())

    def _swing(self) -> None:
        """See `LaneFollowers.plan_swings`."""
        fields, followers = self._fields, self._followers
        shifted = followers.shifted = fields.arrays["shifted"][: fields["num_shifted"]].copy()
        shifting = followers.plan_swings(fields.arrays["distance"])
        if followers.shifted is not shifted:
            for name, which in (("shifted", followers.shifted), ("shifting", shifting)):
                fields.arrays[name][: len(which)] = which
                fields[f"num_{name}"] = len(which)

    def _head_to_end(self, num: int) -> None:
        """Take the headings of the first drivers of `at` from the lanes, which end there."""
        if not num:
            return
        followers, arrays = self._followers, self._fields.arrays
        world, which = followers.world, arrays["at"][:num]
        rows = followers.rows[which]
        arc = world.arc[rows] + followers.on_chords(arrays["distance"])[which]
        lanes = world.int_block("lane", "ahead_5").take(rows, axis=1)
        arrays["heading"][which] = headings(followers.roads, lanes, arc, followers.wheelbase[which])

    def _take_slants(self, shifted: IntArray | None = None) -> None:
        """Take the angles of those who are beside their lines, and their sines and cosines."""
        fields = self._fields
        if shifted is not None:
            fields["num_shifted"] = len(shifted)
            fields.arrays["shifted"][: len(shifted)] = shifted
        num = fields["num_shifted"]
        self._slants = tuple(fields.arrays[name][:num] for name in ("angle", "sine", "cosine")) if num else ()

    # -- motion

    def move(self, dt: float) -> None:
        """See `LaneFollowers.move`."""
        do, at, egos = self._do, self._at, self._followers.egos
        saved = egos.save_poses() if len(egos.rows) else None
        if self._slants:
            angle, sine, cosine = self._slants
            do["find_slants"](at, dt)
            np.cos(angle, cosine)
            do["move"](at, dt)
            np.sin(angle, sine)
            np.cos(angle, cosine)
            do["nudge"](at)
        else:
            do["move"](at, dt)
        if saved is not None:
            egos.restore_poses(saved)
