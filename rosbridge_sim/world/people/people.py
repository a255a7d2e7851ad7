"""Pedestrians that heed others: they keep apart, wait at the kerb, and cross by light or gap.

Such a pedestrian has a path, and `yields` is not 0. Five frames long it walks straight on with one speed, as
`path_following` moves rows on legs; then it decides anew, together with all others. So the columns of the world are the
whole state. Its `arc` counts on from the leg's start; a decision projects it onto the path again.

*Walking* is the social force model (Helbing and Molnar 1995): a pedestrian wants to walk with its desired speed towards
a place ahead on its path, and takes it with a relaxation time; others push it away by a potential whose lines of equal
value are ellipses in the direction of their steps; those behind push less. Vehicles push like walls. Each keeps its own
distance to the right of its path, which its id decides, so that people do not walk in single file.

*Crossing.* `crossings` tells where a path crosses the road. Before it, a pedestrian stops at the kerb. It goes if its
light is green, or without a light if there is a gap; and in both cases only if no vehicle is on its way, and all that
come would arrive after it or are drivers on lanes that can stop. Once it goes, drivers see where it will be.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from rosbridge_sim.world.geometry.neighbours import find_neighbours
from rosbridge_sim.world.geometry.planar import BoolArray, ComplexArray, FloatArray, IntArray
from rosbridge_sim.world.people.known_crossings import FARTHEST, KnownCrossings
from rosbridge_sim.world.roads.paths import DX, DY, END, START, X, Y
from rosbridge_sim.world.roads.signal_plan import Lamp
from rosbridge_sim.world.state.loop_maker import LoopMaker
from rosbridge_sim.world.state.world import DT, Kind
from rosbridge_sim.world.state.world_rows import WorldRows

INTERVAL: Final = 5
"""Frames from one decision to the next, as that of drivers, and two frames after theirs, to spread the load."""

WALK_OFFSET: Final = 2
_SECONDS: Final = INTERVAL * DT

COMMITTED: Final = 2
"""`yields` of a pedestrian that crosses: this plus the number of the crossing on its path. 1 is any other one."""

RELAXATION: Final = 0.5
"""Time in which a pedestrian takes its desired velocity [s]; tau of the paper."""

REPULSION: Final = 2.1
"""Strength of the potential between two pedestrians [m^2/s^2]; V0 of the paper."""

DECAY: Final = 0.3
"""Length over which it falls [m]; sigma of the paper."""

STRIDE: Final = 2.0
"""Time of the other's step that makes the ellipse [s]; delta t of the paper."""

BEHIND: Final = 0.5
"""Share with which those out of view push; c of the paper. The view is 200 degrees wide."""

_VIEW: Final = math.cos(math.radians(100.0))

BODY: Final = 6.0
BODY_WIDTH: Final = 0.6
BODY_DECAY: Final = 0.15
"""Two bodies that touch push each other so strongly [m/s^2], where their middles are a shoulder's width apart [m], and
less by the factor e for each such length [m]. The paper's potential alone lets people walk through each other. The
figures are tuned by us: groups that meet keep more than 0.3 m between all middles."""

REACH: Final = 3.0
"""Others farther away do not push [m]: there the potential is below 1 % of that at arm's length."""

WALL: Final = 10.0
WALL_DECAY: Final = 0.2
"""Strength [m/s^2] and length [m] of the push of vehicles and things; U0/R and R of the paper's walls."""

AGAINST: Final = 0.3
AROUND: Final = 4.0
NEAR: Final = 0.6
NOSE_SHARE: Final = 0.3
"""The way of a pedestrian around a vehicle or a thing. It begins if the pedestrian walks against the thing, with a
cosine beyond `AGAINST`, and is nearer than `NEAR` [m]. Farther away the push of the thing is weaker than the will of
the pedestrian. An acceleration of `AROUND` [m/s^2] then leads along the thing. In front of the share `NOSE_SHARE` of
its half length the way leads around the nose, else around the tail."""

MAX_PUSH: Final = 6.0
"""Greatest acceleration [m/s^2]: a person who starts to run. Tuned by us: less lets people walk into one another."""

HASTE: Final = 1.3
"""A pedestrian walks at most so much faster than it wants; the paper's factor."""

STEP_BACK: Final = 0.5
CLOSE: Final = 1.0
"""Speed of somebody at the kerb who steps back from a vehicle [m/s], and the push that makes it do so [m/s^2]: that of
a side 0.46 m away, as of a bus that turns."""

LOOK_AHEAD: Final = 1.2
"""Distance along the path of the place that is walked to [m]: a step or two."""

SIDES: Final = (0.3, FARTHEST)
"""Least and greatest distance to the right of the path [m], tuned by us: people who meet pass, all within a crosswalk
of 3 m."""

KERB_GAP: Final = 0.6
"""Distance before the road at which people wait [m]. Their feet are on the kerb, and the side of a bus that reaches
0.3 m over the border of its lane in a turn does not touch them."""

AT_KERB: Final = 1.0
"""From this distance to the kerb on, a pedestrian looks whether it may go [m]."""

BRAKE: Final = 1.0
"""Deceleration with which it stops there [m/s^2]."""

MARGIN: Final = 1.0
"""A vehicle that comes must arrive so long after the pedestrian has crossed [s]."""

DRIVER_BRAKE: Final = 2.0
DRIVER_DELAY: Final = 1.0
"""A driver on lanes that can stop with this deceleration [m/s^2] after this time [s] will do it, so that it is no
hindrance: half of the hardest braking for a light."""

STOP_ROOM: Final = 3.0
"""Distance that a driver leaves to a pedestrian when it stops [m]."""

SIGHT: Final = 70.0
"""People look for vehicles within this distance [m]: 5 s at 50 km/h."""

ASIDE: Final = 2.0
"""A vehicle that will pass the ends of a crossing by more than this does not come onto it [m]."""

SLOW: Final = 0.5
"""Least speed at which drivers expect a pedestrian to go on in a crossing [m/s]."""

CREEPS: Final = 0.3
"""A vehicle below this speed stops at once [m/s]."""

TURN: Final = 0.35
"""Cosine of the greatest angle between a driver's heading and a crossing that it may turn to: 70 degrees."""

STANDS: Final = 0.05
"""A lower speed counts as standing [m/s]: the heading then stays."""


def walk(world: WorldRows) -> None:
    """Have the pedestrians that heed others decide; called on the frames of decision.

    Args:
        world: written in place.
    """
    people = world.derived(People)
    if people.num:
        people.take_kernel(PEOPLE_LOOPS.make)
        people.decide()


class PeopleLoops(Protocol):
    """Loops that do parts of the work of `People` for the same people, to the last bit."""

    def find_places(self) -> tuple[FloatArray, ComplexArray, ComplexArray]:
        """See `People.find_places`."""

    def mind_kerbs(self, arc: FloatArray, /) -> tuple[FloatArray, FloatArray]:
        """See `People.mind_kerbs`."""


PEOPLE_LOOPS: Final = LoopMaker[Callable[["People"], PeopleLoops]]()
"""The loops for people, from the next decision of each world on."""


def find_ways_over(world: WorldRows) -> tuple[FloatArray, ComplexArray]:
    """Return how those who cross will go on, for each row.

    Their present heading says little: they turn into a crossing from the pavement, and walk around each other.

    Args:
        world: read only.

    Returns:
        (n,) the times in which they will be off the road; 0 for all others [s]. And (n,) complex, the velocities with
        which they get from their place to the other kerb in that time [m/s].
    """
    times, velocities = np.zeros(world.n), np.zeros(world.n, dtype=np.complex128)
    people = world.derived(People)
    if people.num:
        state, rows = world.yields[people.rows], people.rows
        # On another map a way has other crossings. Who remembers one that is no more decides anew, after the drivers.
        at = ((state >= COMMITTED) & (state - COMMITTED < np.diff(people.first))).nonzero()[0]
        crossing = people.first[at] + state[at] - COMMITTED
        left = people.end[crossing] - world.arc[rows[at]]
        times[rows[at]] = np.fmax(left, 0.0) / np.fmax(world.speed[rows[at]], SLOW)
        ends = people.ends[crossing]
        kerb = ends[:, 2] + 1j * ends[:, 3]
        course = kerb - (ends[:, 0] + 1j * ends[:, 1])
        kerb = kerb - 1j * people.side[at] * course / np.fmax(np.abs(course), STANDS)
        way = kerb - (world.x[rows[at]] + 1j * world.y[rows[at]])
        velocities[rows[at]] = np.where(left > 0.0, way / np.fmax(times[rows[at]], DT), 0.0)
    return times, velocities


class People:
    """The pedestrians that heed others, and what is the same at every decision.

    It lives until the next `World.touch`. All arrays but those of vehicles are (k,), one entry for each of them.
    """

    def __init__(self, world: WorldRows) -> None:
        self.world = world
        is_walker = world.alive & (world.kind == Kind.PEDESTRIAN) & ~world.is_ghost
        self.rows: IntArray = (is_walker & world.has_path & (world.yields > 0)).nonzero()[0]
        self.num = len(self.rows)
        if not self.num:
            return
        rows = self.rows
        self.kernel: PeopleLoops | None = None
        self._maker: Callable[[People], PeopleLoops] | None = None
        self.base, self.path_length, self.is_loop = world.path_bases(rows), world.path_length[rows], world.is_loop[rows]
        self._has_loops, self._has_ends = bool(self.is_loop.any()), not self.is_loop.all()
        self.stop_from = np.where(self.is_loop, np.inf, self.path_length - AT_KERB)
        low, high = SIDES
        share = (world.uid[rows] * 0x9E3779B1 % 2**32) / 2**32  # even, and the same in every world
        self.side = low + (high - low) * share
        self.others: IntArray = is_walker.nonzero()[0]
        on_ground = world.alive & (world.kind != Kind.PEDESTRIAN)
        self.solid: IntArray = on_ground.nonzero()[0]
        self.cars: IntArray = (on_ground & ((world.kind == Kind.EGO) | (world.kind == Kind.VEHICLE))).nonzero()[0]
        self.longest = world.most_of_world(world.half_length[self.solid], self.solid, rows)
        self._find_crossings()

    def _find_crossings(self) -> None:
        """Lay the crossings of all paths end to end: `first[i]` is the first one of pedestrian i.

        `owner` and `number` say for each crossing whose it is, and which one on that path.
        """
        world = self.world
        known = world.roads.derived(KnownCrossings)
        count, found = known.of([world.world_with(row) for row in self.rows.tolist()], world.uid[self.rows].tolist())
        self.first = np.append(0, np.cumsum(count))
        self.owner = np.arange(self.num).repeat(count)
        self.number = np.arange(len(self.owner)) - self.first[self.owner]
        self.start, self.end, self.ends = found.start, found.end, found.ends
        self.light = world.own_lights(self.rows[self.owner], found.light)
        # Those who have a crossing, and the first crossing of each.
        self._at_road = count.nonzero()[0]
        self._first_of_each = self.first[self._at_road]
        self._round = np.where(self.is_loop, self.path_length, 0.0)[self.owner]

    def decide(self) -> None:
        """Choose speeds and headings until the next decision."""
        world, rows = self.world, self.rows
        by = self.kernel or self
        arc, goal, course = by.find_places()
        free_wish, wish = by.mind_kerbs(arc)
        x, y, yaw_now, speed_now, z = world.block("x", "z").take(rows, axis=1)
        place = x + 1j * y
        # Social force model: (v0 e - v) / tau towards the goal, and pushes by people and by what is solid.
        way = goal - place
        towards = way / np.fmax(np.abs(way), STANDS)
        velocity = speed_now * np.exp(1j * yaw_now)
        from_solid, around = self._push_of_solid(x, y, towards, course)
        steps_back = (wish < free_wish) & (np.abs(from_solid) > CLOSE)
        push = (wish * towards - velocity) / RELAXATION + self._push(x, y, place, towards) + around
        most = HASTE * wish
        # At a kerb it gives way to a vehicle that comes near, and stands otherwise.
        at = steps_back.nonzero()[0]
        if len(at):
            push[at] = -velocity[at] / RELAXATION
            most[at] = np.fmax(most[at], STEP_BACK)
        push += from_solid
        push *= np.fmin(1.0, MAX_PUSH / np.fmax(np.abs(push), MAX_PUSH))
        # Euler's step to the next decision, with a bounded force and a bounded speed; below `STANDS` it stands.
        after = velocity + push * _SECONDS
        speed = np.abs(after)
        after *= np.fmin(speed, most) / np.fmax(speed, STANDS)
        speed = np.abs(after)
        stands = speed < STANDS
        speed[stands] = 0.0
        yaw = np.where(stands, yaw_now, np.arctan2(after.imag, after.real))
        # Until then it goes straight on: a leg that begins here and has no end.
        world.accel[rows] = (speed - speed_now) / _SECONDS
        world.speed[rows], world.yaw[rows] = speed, yaw
        world.arc[rows] = world.leg_start[rows] = arc
        world.leg_end[rows] = np.inf
        world.leg_x[rows], world.leg_y[rows], world.leg_z[rows] = x, y, z
        world.leg_dx[rows], world.leg_dy[rows], world.leg_dz[rows] = np.cos(yaw), np.sin(yaw), 0.0
        world.leg_yaw[rows], world.leg_turn[rows] = yaw, 0.0

    def take_kernel(self, make: Callable[[People], PeopleLoops] | None) -> None:
        """Have what `make` returns do its part from now on; None for arrays."""
        if make is not self._maker:
            self._maker, self.kernel = make, None if make is None else make(self)

    def find_places(self) -> tuple[FloatArray, ComplexArray, ComplexArray]:
        """Return the arc lengths of the places on the paths that belong to positions, near the last ones.

        They are not beyond the kerb at which a pedestrian waits. With them, what `_look_along` returns for them.
        """
        world, rows = self.world, self.rows
        x, y = world.x[rows], world.y[rows]
        arc = world.leg_start[rows]  # of the last decision
        (here, ahead), (distance, other), is_over = self._feet(np.array([arc, self._ahead(arc, LOOK_AHEAD)]), x, y)
        arc = np.where((other < distance) | is_over[0], ahead, here)
        # On the inner side of a corner the goal may be where one stands already.
        goal, course = self._look_along(arc)
        is_there = np.hypot(goal.real - x, goal.imag - y) < 0.5 * LOOK_AHEAD
        if np.count_nonzero(is_there):
            arc = np.where(is_there, self._ahead(arc, 0.25 * LOOK_AHEAD), arc)
            goal, course = self._look_along(arc)
        held = self._hold_at_kerb(arc)
        if held is not arc:
            goal, course = self._look_along(held)
        return held, goal, course

    def _feet(self, arc: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the foot points of positions on pieces of the paths, their distances, and which are at an end.

        Args:
            arc: (m, k) arc lengths on the pieces [m].
            x: (k,) east [m].
            y: (k,) north [m].

        Returns:
            (m, k) each.
        """
        leg = self.world.find_legs(self.base, arc).transpose(2, 0, 1)
        start, course_x, course_y = leg[START], leg[DX], leg[DY]
        length, east, north = leg[END] - start, x - leg[X], y - leg[Y]
        along = east * course_x + north * course_y
        foot = np.fmin(np.fmax(along, 0.0), length)
        away = np.hypot(east - foot * course_x, north - foot * course_y)
        return start + foot, away, along >= length

    def _ahead(self, arc: FloatArray, distance: float) -> FloatArray:
        """Return arc lengths that are farther on; a loop begins again, another path ends."""
        there = arc + distance
        if not self._has_loops:
            return np.asarray(np.fmin(there, self.path_length))
        again = np.asarray(np.fmod(there, self.path_length))
        return np.where(self.is_loop, again, np.fmin(there, self.path_length)) if self._has_ends else again

    def _look_along(self, arc: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the places to walk to from arc lengths [m], and the directions of the paths there; (k,) complex each.

        The places are to the right of the paths.
        """
        ahead = self._ahead(arc, LOOK_AHEAD)
        leg, here = self.world.find_legs(self.base, np.array([ahead, arc])).transpose(0, 2, 1)
        along = ahead - leg[START]
        goal = leg[X] + along * leg[DX] + 1j * (leg[Y] + along * leg[DY])
        return goal + self.side * (leg[DY] - 1j * leg[DX]), here[DX] + 1j * here[DY]

    def _push(self, x: FloatArray, y: FloatArray, place: ComplexArray, towards: ComplexArray) -> ComplexArray:
        """Return the accelerations by other pedestrians, (k,) complex [m/s^2]."""
        world = self.world
        others = self.others
        other_x, other_y = world.x[others], world.y[others]
        one, index = find_neighbours(x, y, other_x, other_y, REACH, world.worlds_of(self.rows, others))
        is_other = (others.take(index) != self.rows.take(one)).nonzero()[0]
        if not len(is_other):
            return np.zeros(self.num, dtype=np.complex128)
        one, index = one.take(is_other), index.take(is_other)
        other = others.take(index)
        away = place.take(one) - (other_x + 1j * other_y).take(index)
        # Two at one place: the lower row goes to the right.
        away = np.where(away == 0.0, np.where(self.rows[one] < other, 0.01j, -0.01j), away)
        step = (world.speed[others] * STRIDE * np.exp(1j * world.yaw[others])).take(index)
        from_step = away - step
        near, far = np.abs(away), np.fmax(np.abs(from_step), 1e-3)
        half = 0.5 * np.sqrt(np.fmax(np.square(near + far) - np.square(np.abs(step)), 1e-4))
        size = REPULSION / DECAY * np.exp(-half / DECAY) * (near + far) / (4.0 * half)
        force = size * (away / near + from_step / far)
        force += BODY * np.exp((BODY_WIDTH - near) / BODY_DECAY) * away / near
        towards = towards.take(one)
        is_seen = -(towards.real * away.real + towards.imag * away.imag) >= _VIEW * near
        return self._sum(one, force * np.where(is_seen, 1.0, BEHIND))

    def _push_of_solid(
        self, x: FloatArray, y: FloatArray, towards: ComplexArray, course: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return the accelerations by the boxes of vehicles and things: away from them, and along them."""
        world, solid = self.world, self.solid
        worlds = world.worlds_of(self.rows, solid)
        one, other = find_neighbours(x, y, *self._middles(solid), REACH + self.longest, worlds)
        if not len(one):
            nothing = np.zeros(self.num, dtype=np.complex128)
            return nothing, nothing
        other = solid[other]
        turn = np.exp(-1j * world.yaw[other])
        local = (x[one] - world.x[other] + 1j * (y[one] - world.y[other])) * turn - world.centre[other]
        half_length, half_width = world.half_length[other], world.half_width[other]
        beyond_x = local.real - np.minimum(np.maximum(local.real, -half_length), half_length)
        beyond_y = local.imag - np.minimum(np.maximum(local.imag, -half_width), half_width)
        away = np.hypot(beyond_x, beyond_y)
        body = world.half_width[self.rows[one]]
        size = WALL * np.exp(-np.fmax(away - body, 0.0) / WALL_DECAY)
        force = (beyond_x + 1j * beyond_y) / np.fmax(away, 0.05)
        # A pedestrian goes around a thing on the side of the path on which most of the thing is not. That side
        # stays the same on the way around, while the way to the path turns with each step.
        against = (towards[one] * turn * np.conj(force)).real
        course_against = (course[one] * turn * np.conj(force)).real
        faces = (against < 0.0) & (np.fmin(against, course_against) < -AGAINST) & (away < body + NEAR)
        from_hub = local - NOSE_SHARE * half_length
        is_left = (np.conj(course[one] * turn) * from_hub).imag >= 0.0
        along = np.where(is_left, -1j, 1j) * force
        return self._sum(one, size * force / turn), self._sum(one, np.where(faces, AROUND * along, 0.0) / turn)

    def _sum(self, one: IntArray, force: ComplexArray) -> ComplexArray:
        """Return the sums of what pushes each."""
        real = np.bincount(one, weights=force.real, minlength=self.num)
        return np.asarray(real + 1j * np.bincount(one, weights=force.imag, minlength=self.num))

    def _middles(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        world = self.world
        centre, yaw = world.centre[rows], world.yaw[rows]
        return world.x[rows] + centre * np.cos(yaw), world.y[rows] + centre * np.sin(yaw)

    # The road

    def mind_kerbs(self, arc: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the speeds that are wanted without kerbs, and with stops there; note who begins and ends to cross."""
        world, rows = self.world, self.rows
        # 0 while it waits for an ego, and at the end of the path.
        wish = world.desired_speed[rows]
        wish[(world.start_within[rows] > 0.0) | (arc >= self.stop_from)] = 0.0
        state = world.yields[rows]
        owner, number = self.owner, self.number
        # The distance to each kerb, and the crossing that is next on the way: the nearest kerb that is not behind.
        here = arc[owner]
        to_kerb = self.start - here
        passed = (to_kerb <= 0.0).nonzero()[0]
        inside = passed[here[passed] <= self.end[passed]]
        to_kerb[passed] += self._round[passed]
        to_kerb[inside] = 0.0
        to_kerb[to_kerb < 0.0] = np.inf
        nearest = np.full(self.num, np.inf)
        nearest[self._at_road] = np.minimum.reduceat(to_kerb, self._first_of_each) if len(owner) else np.inf
        next_of = np.full(self.num, -1, dtype=np.int64)
        is_next = (to_kerb == nearest[owner]) & (to_kerb < np.inf)
        next_of[owner[is_next]] = number[is_next]
        state[(state >= COMMITTED) & (next_of != state - COMMITTED)] = 1
        entered = owner[inside]
        entered = entered[state[entered] < COMMITTED]  # it was put onto the road
        state[entered] = COMMITTED + next_of[entered]
        asks = ((state < COMMITTED) & (nearest < AT_KERB) & (wish > 0.0)).nonzero()[0]
        if len(asks):
            goes = asks[self.may_cross(asks, self.first[asks] + next_of[asks], world.desired_speed[rows[asks]])]
            state[goes] = COMMITTED + next_of[goes]
        world.yields[rows] = state
        room = nearest - KERB_GAP
        stop = np.sqrt(2.0 * BRAKE * np.fmax(room, 0.0))
        return wish, np.where(state < COMMITTED, np.fmin(wish, stop), wish)

    def _hold_at_kerb(self, arc: FloatArray) -> FloatArray:
        """Return arc lengths before the kerb for those who may not cross: near a corner a place has several."""
        world, rows = self.world, self.rows
        owner, number = self.owner, self.number
        before = world.leg_start[rows][owner]
        crosses = world.yields[rows][owner] == COMMITTED + number
        held = ((before < self.start) & (arc[owner] >= self.start) & ~crosses).nonzero()[0]
        if len(held):
            arc = arc.copy()
            np.minimum.at(arc, owner[held], np.nextafter(self.start[held], 0.0))
        return arc

    def may_cross(self, asks: IntArray, crossing: IntArray, speed: FloatArray) -> BoolArray:
        """Return who may begin to cross, (a,).

        Args:
            asks: (a,) int64, which of the pedestrians ask.
            crossing: (a,) int64, rows of the crossings.
            speed: (a,) of those who ask [m/s].
        """
        signals = self.world.signals
        light = self.light[crossing]
        shown = signals.shown[np.maximum(light, 0)] if len(signals.shown) else np.zeros(len(light), dtype=np.int64)
        may = (light < 0) | (shown < 0) | (shown & int(Lamp.GREEN) != 0)
        at = may.nonzero()[0]
        may[at] = ~self._is_endangered(asks[at], crossing[at], speed[at])
        return np.asarray(may)

    def _is_endangered(self, asks: IntArray, crossing: IntArray, speed: FloatArray) -> BoolArray:
        """Return which of some crossings a vehicle is on, or will reach too early, (a,)."""
        world, cars = self.world, self.cars
        ends = self.ends[crossing]
        start, stop = ends[:, 0] + 1j * ends[:, 1], ends[:, 2] + 1j * ends[:, 3]
        width = np.fmax(np.abs(stop - start), 0.1)
        way = (stop - start) / width
        middle = 0.5 * (start + stop)
        car_x, car_y = self._middles(cars)
        worlds = world.worlds_of(self.rows[asks], cars)
        one, car = find_neighbours(middle.real, middle.imag, car_x, car_y, SIGHT, worlds)
        place, car = car_x[car] + 1j * car_y[car], cars[car]
        half, pace = world.half_length[car], world.speed[car]
        heading = np.exp(1j * world.yaw[car])
        # In the frame of the crossing: along it from the first kerb, and across it.
        local = (place - start[one]) * np.conj(way[one])
        turned = heading * np.conj(way[one])
        side = np.abs(turned.real) * half + np.abs(turned.imag) * world.half_width[car]
        depth = np.abs(turned.imag) * half + np.abs(turned.real) * world.half_width[car]
        is_on = (np.abs(local.imag) < depth + 0.5) & (local.real > -side) & (local.real < width[one] + side)
        across: FloatArray = -turned.imag * np.sign(local.imag) * pace  # towards the crossing
        gap = np.fmax(np.abs(local.imag) - depth - 0.5, 0.0)
        arrival = gap / np.fmax(across, 1e-3)
        hits = local.real + arrival * turned.real * pace
        comes = (across > CREEPS) & (hits > -ASIDE) & (hits < width[one] + ASIDE)
        # A driver on lanes may turn towards the crossing: it counts if it comes nearer at all.
        foot = np.minimum(np.maximum(local.real, 0.0), width[one])
        away = np.fmax(np.abs(foot - local) - half, 0.0)
        nears = ((foot - local) * np.conj(turned)).real > TURN * np.abs(foot - local)
        is_driver = world.has_lane[car] & (world.kind[car] != int(Kind.EGO))
        comes |= is_driver & nears & (pace > CREEPS)
        gap = np.where(is_driver, away, gap)
        is_early = arrival < width[one] / np.fmax(speed[one], 0.1) + MARGIN
        needs = pace * (DRIVER_DELAY + pace / (2.0 * DRIVER_BRAKE)) + STOP_ROOM
        endangers = is_on | (comes & np.where(is_driver, gap < needs, is_early))
        return np.asarray(np.bincount(one[endangers], minlength=len(crossing)) > 0)
