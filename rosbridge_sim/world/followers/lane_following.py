"""Lane following: vehicles that drive on lanes, follow one another, obey lights and give way.

*Position.* The middle of the rear axle is at arc length `arc` of a lane (see `lane_position`). It moves along the
legs of the lane's line as `path_following` moves along paths, and beside their chords as `bends` has it. So it is on
the smooth line to the last bits. The next five lanes are chosen in advance (`route_choice`). A driver without a route
that waits for a full street chooses again after a while; otherwise streets that fill up in a ring would block one
another for ever.

*Lane changes* are chosen by `lane_changes`, with the same decisions, and driven by `lane_change_motion`. A vehicle that
changes lanes is beside the line for a while, and so is a long one in a tight bend (`lane_swing`). Drivers with a
`wander_width` are always a little beside it (`lane_wander`).

*Speed.* `driver_perception` finds what is ahead, and `driver_model` turns that into an acceleration. Drivers decide
ten times a second and keep their acceleration in between: a decision is made for all at once and costs ten times as
much as moving them. It falls on fixed frames, so the columns of the world are the whole state.

*Reaction.* The acceleration follows the decision with a lag of first order, by the driver's reaction time. So all
reactions come late and without a jump, and no past values need to be kept: the acceleration itself is the memory.

Limits of the model: no overtaking in lanes of the other direction, no reversing; self-driving egos stay in their lane.
Of the entities that do not follow lanes, only pedestrians are seen where they will be; the others are seen where they
are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, Protocol

import numpy as np

from rosbridge_sim.records import asdict
from rosbridge_sim.world.drivers.driver_model import CREEP, accelerate
from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.drivers.driver_perception import DriverSight, Stop, observe, perceive
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries
from rosbridge_sim.world.drivers.lane_position import enter_next_legs, headings_ahead, set_legs
from rosbridge_sim.world.drivers.lane_swing import are_straight, find_long, find_swinging, plan_swings
from rosbridge_sim.world.drivers.lane_wander import LaneWander
from rosbridge_sim.world.drivers.right_of_way import find_entered
from rosbridge_sim.world.drivers.route_choice import NUM_AHEAD, RouteChoice
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.drivers.zip_merge import follow_in_joins
from rosbridge_sim.world.followers.other_entities import OtherEntities
from rosbridge_sim.world.followers.self_driving import SelfDrivingEgos
from rosbridge_sim.world.followers.turn_signals import find_turn_signals
from rosbridge_sim.world.geometry.bends import offset, stretch
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, is_any, of_rows, run_of, wrap_angle
from rosbridge_sim.world.lane_changes.lane_change_model import LaneChange
from rosbridge_sim.world.lane_changes.lane_change_motion import find_shifted, nudge, plan_shifts, shift_time
from rosbridge_sim.world.lane_changes.lane_changes import LaneChanges
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.state.loop_maker import LoopMaker
from rosbridge_sim.world.state.world import DT, Dynamics
from rosbridge_sim.world.state.world_rows import WorldRows

__all__ = ["DECISION", "DriverView", "Stop", "drive_lanes", "view_driver"]

DECISION: Final = 5
"""Frames from one decision to the next: 0.1 s, less than a person needs to react."""

INTERVAL: Final = DECISION * DT

MAX_WAIT_DECISIONS: Final = 20
"""Decisions after which a driver before a full street or a blocked crossing chooses other lanes: 2 s, enough for a
queue to move off."""

LET_IN_EVERY, LET_IN_FOR = 600, 80
"""Decisions after which the others let in a driver that waits at a stop line, and for how many: 8 s in each minute, so
that a side street moves beside a full main road. Those that may enter already take up to 6 s to leave the crossing."""

LET_IN_APART: Final = 37
"""Drivers with neighbouring ids are let in at other times: so many decisions apart."""

MAX_LANES_ENTERED: Final = 8
"""Lanes entered within one step, at most: lanes of a centimetre in a map must not slow the step down."""

FEW: Final = 8
"""Up to this number of vehicles, single floats are faster than arrays: 2 us for each vehicle, or 20 us for all."""

LONGEST_LEG: Final = 1e9
"""Beyond every leg of a map, whose coordinates are at most 1e8 [m]."""

_MOTION: Final = ("accel", "leg_dz")
_LAST_MOVED, _NUM_MOVED = "arc", 9
"""First and last of the columns that `move` reads, and the last of those that it writes, with the number of these."""

_Bends = tuple[FloatArray, FloatArray]
"""Of the legs that vehicles are on: (n, 2) the curves, see `bends.leg_curves`, and (n,) the lengths [m]."""

MAX_STRETCH: Final = 0.5
"""The line of a bend is longer or shorter than the way beside it by this share of the way, at most: a lane's width
beside the line of a bend of 7 m."""


def drive_lanes(world: WorldRows, dt: float) -> None:
    """Move all entities that follow lanes; on the frames of decision they decide first.

    Args:
        world: written in place.
        dt: length of the step [s].
    """
    followers = world.derived(LaneFollowers)
    if not followers.num:
        return
    is_decision = world.frame % DECISION == 0
    if is_decision:
        followers.take_kernel(LANE_LOOPS.make)
    by = followers.kernel or followers
    has_motion = len(followers.egos.rows) > 0 and world.dynamics == Dynamics.SINGLE_TRACK
    saved = followers.egos.save_motion() if has_motion else None
    if is_decision:
        by.decide()
    by.move(dt)
    if saved is not None:
        followers.egos.restore_motion(saved)


class Kernel(Protocol):
    """Loops that do the work of `LaneFollowers` for the same followers, to the last bit."""

    def decide(self) -> None:
        """See `LaneFollowers.decide`."""

    def move(self, dt: float) -> None:
        """See `LaneFollowers.move`."""


LANE_LOOPS: Final = LoopMaker[Callable[["LaneFollowers"], Kernel]]()
"""The loops that drive lane followers, from the next decision of each world on."""


def view_driver(world: WorldRows, row: int) -> DriverView | None:
    """Return what an entity that follows lanes does, as it would decide now; None for any other entity.

    One that waits for an ego does not decide: None, too. All drivers decide for this, as copies: it takes some
    milliseconds with thousands of them.

    Args:
        world: read only.
    """
    if not world.has_lane[row] or world.start_within[row] > 0.0:
        return None
    followers = LaneFollowers(world)  # of its own: a question must not decide when the world makes its own
    drivers = followers.drivers()
    drivers.claim, drivers.held, drivers.exit_lane = (
        drivers.claim.copy(),
        drivers.held.copy(),
        drivers.exit_lane.copy(),
    )
    others, rows, num_driving = followers.others(lambda: drivers)
    which = int((followers.rows == row).nonzero()[0][0])
    sight = observe(followers.conflicts, world.signals.may_enter, drivers, others, num_driving, which=which)
    rows = np.concatenate([followers.rows, rows, [-1]])  # the last one is that of none
    light = int(world.signals.plan.light_of_lane[sight.stop_lane]) if sight.stop is Stop.LIGHT else -1
    return DriverView(
        **asdict(sight) | {"lead": rows.item(sight.lead), "rival": rows.item(sight.rival)},
        light=light,
        change=LaneChange(int(world.change[row])),
        signal=int(find_turn_signals(world, np.array([row]))[0]),
        is_changing=bool(world.leaving[row] > 0),
    )


class DriverView(DriverSight):
    """Action of a driver on lanes, with its reasons: what it perceives, where `lead` and `rival` are rows of the world.

    Attributes:
        light: row of the light that forbids it to go on; -1 for none.
        change: why it changes lanes, or wants to.
        signal: its turn signal: 0 none, 1 left, 2 right.
        is_changing: it moves over to the other lane.
    """

    light: int
    change: LaneChange = LaneChange.NONE
    signal: int = 0
    is_changing: bool = False


class LaneFollowers:
    """The entities that follow lanes, and what is the same at every step.

    It lives until the next `World.touch`: until an entity comes or goes, stops or starts to move. Indices (`which`)
    count these entities; rows are rows of the world.
    """

    def __init__(self, world: WorldRows) -> None:
        self.world = world
        # One that waits for an ego is what all things that stand are: it asks for no lane and holds none.
        follows = world.has_lane & (world.start_within == 0.0)
        self.rows: IntArray = (world.alive & follows).nonzero()[0]
        self.num = len(self.rows)
        if not self.num:
            return
        self.at = run_of(self.rows)
        self._views = tuple(world.block(*_MOTION)[:, self.at]) if isinstance(self.at, slice) else ()
        self.roads = world.roads
        self._is_few = self.num <= FEW and not self.roads.has_long_legs
        self._cells = [column.data for column in world.block(*_MOTION)] if self._is_few else []
        self.conflicts = world.roads.derived(LaneConflicts)
        half, centre = world.half_length[self.at], world.centre[self.at]
        self.nose, self.rear, self.length = half + centre, half - centre, 2.0 * half
        self.parameters = DriverParameters.of(world, self.rows)
        self.response = -np.expm1(-INTERVAL / self.parameters.reaction)
        self.wheelbase = world.wheelbase[self.at].copy()
        self.uid = world.uid[self.at].copy()
        self.let_in_later = LET_IN_APART * self.uid
        self.choice = RouteChoice(world, self.rows)
        self.changes = LaneChanges(world, self.rows, self.choice)
        self.egos = SelfDrivingEgos(world, self.rows)
        self.shifted = find_shifted(world, self.rows)
        self.long = find_long(world, self.rows)
        self.wander = LaneWander(world, self.rows)
        self.other_entities = OtherEntities(world, world.alive & ~follows)
        self._beside: FloatArray | None = None
        self._bends: _Bends | tuple[()] | None = None
        self.kernel: Kernel | None = None
        self._maker: Callable[[LaneFollowers], Kernel] | None = None

    def take_kernel(self, make: Callable[[LaneFollowers], Kernel] | None) -> None:
        """Be driven by what `make` returns, from now on; None for arrays."""
        if make is not self._maker:
            self.shifted = find_shifted(self.world, self.rows)  # loops keep a list of their own
            self._maker, self.kernel = make, None if make is None else make(self)

    def decide(self) -> None:
        """Choose the accelerations until the next decision."""
        world, at = self.world, self.at
        self._beside = self._bends = None
        if len(self.egos.rows):
            self.egos.project()
            self.advance_lanes(self.egos.index)
        drivers = self.drivers()
        others, _, num_driving = self.others(lambda: drivers)
        perception = perceive(self.conflicts, world.signals.may_enter, drivers, others, num_driving)
        lanes, speed = drivers.lanes, drivers.speed
        wanted = accelerate(speed, perception, self.parameters)
        if len(self.conflicts.joins.shared):
            wanted = follow_in_joins(self.conflicts, drivers, others.first(num_driving), wanted)
        if self.changes.is_possible:
            desired_speed = np.fmin(self.parameters.desired_speed, perception.safe_speed)
            wanted, has_begun = self.changes.decide(drivers, perception, desired_speed, wanted, self._decision())
            if has_begun or len(self.shifted):
                self.shifted = find_shifted(world, at)
                lanes = of_rows(world.int_block("lane", "ahead_5"), at)
        accel = drivers.accel + self.response * (wanted - drivers.accel)
        if len(self.egos.rows):  # their pedals have a lag of their own
            index = self.egos.index
            accel[index] = wanted[index]
            self.egos.command(lanes[:, index], wanted[index])
        world.accel[at] = accel
        self._steer(lanes, speed, accel)
        is_held_up = perception.is_shut_out | perception.is_blocked
        if is_any(is_held_up):
            waits = (is_held_up & (speed < CREEP)).nonzero()[0]
            is_turn = (self._decision() + self.uid) % MAX_WAIT_DECISIONS == 0
            waits = waits[is_turn[waits]]
            if len(waits):
                self.choice.change(waits)
        if not isinstance(at, slice):
            world.claim[at], world.held[at], world.exit_lane[at] = drivers.claim, drivers.held, drivers.exit_lane

    def _decision(self) -> int | IntArray:
        """Return the number of this decision, one for all or (n,)."""
        return self.world.frames(self.rows) // DECISION

    def drivers(self, *, may_change: bool = True) -> Drivers:
        """Return the lane followers; columns of the world as they are, views of it where their rows are neighbours.

        Args:
            may_change: whether anybody changes lanes, or must; with False nobody is asked.
        """
        world, at, lateral = self.world, self.at, self.parameters.lateral
        if may_change:
            lateral = self.changes.find_lateral(self.parameters, world.speed[at])
        drivers = Drivers(
            lanes=of_rows(world.int_block("lane", "ahead_5"), at),
            arc=world.arc[at],
            speed=world.speed[at],
            accel=world.accel[at],
            point=world.point[at],
            nose=self.nose,
            rear=self.rear,
            length=self.length,
            uid=self.uid,
            claim=world.claim[at],
            held=world.held[at],
            exit_lane=world.exit_lane[at],
            is_let_in=(self._decision() + self.let_in_later) % LET_IN_EVERY < LET_IN_FOR,
            parameters=self.parameters,
            lateral=lateral,
        )
        if may_change:
            drivers.leaving = self.changes.find_leaving(drivers)
        return drivers

    def others(self, drivers: Callable[[], Drivers]) -> tuple[Entries, IntArray, int]:
        """Return the entries of all other entities; see `OtherEntities.entries`."""
        return self.other_entities.entries(drivers)

    def _steer(self, lanes: IntArray, speed: FloatArray, accel: FloatArray) -> None:
        """Set the yaw rates with which the headings are right at the next decision."""
        world, at = self.world, self.at
        time = np.where(speed + accel * INTERVAL < 0.0, speed / np.fmax(-accel, CREEP), INTERVAL)
        distance = time * (speed + 0.5 * accel * time)
        moves = distance > 0.0
        arc = world.arc[at] + self.on_chords(distance)
        heading = headings_ahead(self.roads, lanes, arc, self.wheelbase, point=world.point[at], moves=moves)
        shifting = self.plan_swings(distance)
        self.wander.plan(distance, heading, lanes[0], self.shifted, INTERVAL)
        self.plan_shifts(shifting, distance, heading)
        turn = np.where(moves, wrap_angle(heading - world.yaw[at]), 0.0)
        world.yaw_rate[at] = turn / INTERVAL
        world.lateral_accel[at] = world.yaw_rate[at] * speed

    def plan_swings(self, distance: FloatArray) -> IntArray:
        """Plan the swing of long vehicles until the next decision; return the others that are `shifted`, (m,) int64.

        Args:
            distance: (n,) that each will drive until then [m].
        """
        world = self.world
        swinging = self.long[find_swinging(world, self.rows[self.long])] if len(self.long) else self.long
        if not len(swinging) or are_straight(world, self.rows[swinging], distance[swinging]):
            return self.shifted
        plan_swings(world, self.rows[swinging], distance[swinging], INTERVAL)
        is_shifted = np.zeros(self.num, dtype=bool)
        is_shifted[self.shifted] = True
        is_shifted[swinging] = False
        shifting: IntArray = is_shifted.nonzero()[0]
        is_shifted[swinging[find_shifted(world, self.rows[swinging])]] = True
        self.shifted = is_shifted.nonzero()[0]
        return shifting

    def plan_shifts(self, shifting: IntArray, distance: FloatArray, heading: FloatArray) -> None:
        """Plan the motion across until the next decision, and add its angles to the headings then.

        Args:
            shifting: (m,) int64, from `plan_swings`.
            distance: (n,) that each will drive until then [m].
            heading: (n,) of the lanes, written [rad].
        """
        world, at = self.world, self.at
        if len(shifting):
            duration = shift_time(ARRAYS, self.parameters.change_time[shifting], world.speed[at][shifting])
            plan_shifts(world, self.rows[shifting], duration, distance[shifting], INTERVAL)
        if len(self.shifted):
            heading += world.drift[at] + world.drift_rate[at] * INTERVAL
            self.shifted = find_shifted(world, at)  # without those that have arrived, as if it were made now

    def move(self, dt: float) -> None:
        """Move along the legs by `dt` [s]; `dynamics` moves the self-driving egos."""
        saved = self.egos.save_poses() if len(self.egos.rows) else None
        if self._is_few and not len(self.shifted):
            self._move_one_by_one(dt)
        else:
            self._move_at_once(dt)
        self.wander.move(dt)
        if len(self.shifted):
            nudge(self.world, self.rows[self.shifted], dt)
        if saved is not None:
            self.egos.restore_poses(saved)

    def _move_one_by_one(self, dt: float) -> None:
        """Do what `_move_at_once` does, to the last bit, for few vehicles that are on their lines or wander."""
        accel, _, yaw_rate, x, y, yaw, speed, z, arc, leg_start, leg_end, leg_x, leg_y, leg_z, *leg = self._cells
        beside = self._way_beside(dt).tolist() if len(self.wander.which) else None
        rows, past = self.rows.tolist(), []
        for i, row in enumerate(rows):
            before = speed[row]
            after = before + accel[row] * dt
            if after < 0.0:
                after, accel[row] = 0.0, before / -dt
            step = (before + after) * (0.5 * dt)
            if beside is not None:
                most = MAX_STRETCH * step
                step += min(max(beside[i], -most), most)
            arc[row] += step
            speed[row] = after
            if arc[row] >= leg_end[row]:
                past.append(i)
        if past:
            self._pass_ends(np.array(past))
        (dx, dy, dz), curve, point = leg, self.roads.curve.data, self.world.point.data
        for row in rows:
            distance, east, north = arc[row] - leg_start[row], dx[row], dy[row]
            p, q = curve[point[row], 0], curve[point[row], 1]
            aside = distance * (min(leg_end[row] - leg_start[row], LONGEST_LEG) - distance) * (p + q * distance)
            x[row] = distance * east + leg_x[row] - aside * north
            y[row] = distance * north + leg_y[row] + aside * east
            z[row] = distance * dz[row] + leg_z[row]
            angle = yaw[row] + yaw_rate[row] * dt
            yaw[row] = angle if -math.pi < angle <= math.pi else float(wrap_angle(angle))

    def _move_at_once(self, dt: float) -> None:
        """Move many vehicles, or some that change lanes."""
        accel, _, yaw_rate, x, y, yaw, speed, z, arc, leg_start, leg_end, *leg = columns = self._columns()
        after = speed + accel * dt
        is_stopping = after < 0.0
        if is_any(is_stopping):  # it brakes by no more than brings it to a stand
            after = np.fmax(after, 0.0)
            accel[:] = np.where(is_stopping, speed / -dt, accel)
        step = (speed + after) * (0.5 * dt)
        if len(self.wander.which):
            # Beside the line of a bend the way is longer or shorter, as in `_along`.
            most = MAX_STRETCH * step
            step += np.fmin(np.fmax(self._way_beside(dt), -most), most)
        if len(self.shifted):
            step[self.shifted] = self._along(step[self.shifted], dt)
        arc += self.on_chords(step)
        speed[:] = after
        is_past = arc >= leg_end
        if is_any(is_past):
            past = is_past.nonzero()[0]
            self._write(columns, past)
            self._pass_ends(past)
            self._read(columns, past)
        leg_x, leg_y, leg_z, leg_dx, leg_dy, leg_dz = leg
        distance = arc - leg_start
        np.multiply(distance, leg_dx, x)
        np.multiply(distance, leg_dy, y)
        x += leg_x
        y += leg_y
        if self._bends is None or not self.roads.is_flat:  # else the height is that of the last step
            np.multiply(distance, leg_dz, z)
            np.add(z, leg_z, z)
        if self._bends is None:
            self._bends = self._find_bends(leg_start, leg_end)
        if self._bends:
            curve, length = self._bends
            aside = offset(curve, distance, length)
            x -= aside * leg_dy
            y += aside * leg_dx
        yaw += yaw_rate * dt
        is_beyond = yaw > math.pi
        is_beyond |= yaw <= -math.pi  # nearly always some drive due west, which is pi
        if is_any(is_beyond):
            yaw[is_beyond] = wrap_angle(yaw[is_beyond])
        self._write(columns, slice(None))

    def _find_bends(self, leg_start: FloatArray, leg_end: FloatArray) -> _Bends | tuple[()]:
        """Return the bends of the legs with these starts and ends, (n,); nothing where all are straight."""
        curve = self.roads.curve.take(self.world.point[self.at], axis=0)
        # Until the first decision the leg of a self-driving ego has no end.
        return (curve, np.fmin(leg_end - leg_start, LONGEST_LEG)) if np.count_nonzero(curve) else ()

    def _columns(self) -> Sequence[FloatArray]:
        """Return the columns of `_MOTION`, (n,) each: views where the rows are neighbours, else copies."""
        return self._views or tuple(self.world.block(*_MOTION).take(self.rows, axis=1))

    def _write(self, columns: Sequence[FloatArray], which: slice | IntArray) -> None:
        """Write what `move` has changed in copies from `_columns` for some vehicles."""
        if not self._views:
            moved = [column[which] for column in columns[:_NUM_MOVED]]
            self.world.block(_MOTION[0], _LAST_MOVED)[:, self.rows[which]] = moved

    def _read(self, columns: Sequence[FloatArray], which: IntArray) -> None:
        """Bring copies from `_columns` up to date for some vehicles."""
        if not self._views:
            now = self.world.block(*_MOTION).take(self.rows[which], axis=1)
            for column, values in zip(columns, now, strict=True):
                column[which] = values

    def _way_beside(self, dt: float) -> FloatArray:
        """Return by how much the line of a bend is longer than the way of those who wander beside it, (n,) [m].

        It is the same in all steps from one decision to the next.
        """
        if self._beside is None:
            world, at = self.world, self.at
            bend = world.yaw_rate[at] - world.drift_rate[at] - world.wander_slope_rate[at]
            self._beside = bend * (dt * world.wander[at])
        return self._beside

    def _pass_ends(self, which: IntArray) -> None:
        """Bring lane and leg up to date for vehicles that are beyond the ends of their legs."""
        world, rows = self.world, self.rows[which]
        self._bends = None
        if not self.roads.has_long_legs:
            farther = enter_next_legs(world, self.conflicts, rows)
            if len(farther):
                self.advance_lanes(which[farther])
            return
        before = self._stretch(rows, 0.0)
        self.advance_lanes(which)
        # Beyond the end of a leg the way is that on the next one.
        beyond = world.arc[rows] - world.leg_start[rows]
        world.arc[rows] += beyond * (before / self._stretch(rows, 0.0) - 1.0)

    def on_chords(self, distance: FloatArray) -> FloatArray:
        """Return by how much arc lengths, which are those of legs, rise on ways along smooth lines, (n,) [m].

        Args:
            distance: (n,) of the ways, shorter than legs that turn much [m].
        """
        if not self.roads.has_long_legs:
            return distance
        return distance / self._stretch(self.at, distance)

    def _stretch(self, rows: slice | IntArray, distance: FloatArray | float) -> FloatArray:
        """Return the way of rows for each metre of their legs, in the middle of the `distance` ahead [m], (k,)."""
        world = self.world
        length = world.leg_end[rows] - world.leg_start[rows]
        along = np.fmin(world.arc[rows] - world.leg_start[rows] + 0.5 * distance, length)
        return stretch(self.roads.curve.take(world.point[rows], axis=0), along, length)

    def _along(self, step: FloatArray, dt: float) -> FloatArray:
        """Return by how much the arc lengths of the `shifted` rise, (k,) [m].

        In a bend the line is longer or shorter than the way beside it, and who moves across moves along by less.

        Args:
            step: (k,) by which they move [m].
            dt: length of the step [s].
        """
        world, rows = self.world, self.rows[self.shifted]
        aslant = world.drift[rows] + world.drift_rate[rows] * dt + world.wander_slope[rows]
        bend = world.yaw_rate[rows] - world.drift_rate[rows] - world.wander_slope_rate[rows]
        turn = bend * dt * world.lateral[rows]
        most = MAX_STRETCH * step
        return step * np.cos(aslant) + np.fmin(np.fmax(turn, -most), most)

    def advance_lanes(self, which: IntArray) -> None:
        """Bring lane and leg up to date for vehicles whose arc length may be beyond the end of their leg or lane."""
        world, rows = self.world, self.rows[which]
        for _ in range(MAX_LANES_ENTERED):
            is_over = world.arc[rows] >= self.roads.length[world.lane[rows]]
            if not is_any(is_over):
                break
            self._enter_next(which[is_over])
        set_legs(world, self.conflicts, rows)

    def _enter_next(self, which: IntArray) -> None:
        """Move vehicles on to the next lane; at a dead end they stand at the end of theirs."""
        world, rows = self.world, self.rows[which]
        is_end = world.ahead_1[rows] < 0
        if is_any(is_end):
            at_end = rows[is_end]
            world.arc[at_end] = np.nextafter(self.roads.length[world.lane[at_end]], 0.0)
            world.speed[at_end] = world.accel[at_end] = 0.0
            which, rows = which[~is_end], rows[~is_end]
        world.arc[rows] -= self.roads.length[world.lane[rows]]
        lanes = world.int_block("behind", "ahead_5")
        lanes[:-1, rows] = lanes[1:, rows]
        world.turns[rows] += 1
        world.ahead_5[rows] = self.choice.choose(which, world.ahead_4[rows], world.turns[rows] + NUM_AHEAD)
        lane = world.lane[rows]
        enters, held = self.conflicts.wait_point[lane] == 0.0, world.held[rows]
        # Of lanes shorter than itself a vehicle holds the last one that its nose is on.
        place = find_entered(self.roads, lanes[1:, rows], world.arc[rows] + self.nose[which], held)
        world.held[rows] = np.where(enters & (place == 0), lane, held)
        has_come = enters & (world.claim[rows] == lane)
        world.claim[rows[has_come]] = -1
