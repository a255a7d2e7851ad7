"""Vehicles that keep to the lanes: they follow one another, heed limits, lights and whose turn it is, choose a way.

*Where*: the middle of a car's rear axle is at arc length `arc` of a lane. It moves along the lane's line exactly as
walkers move along their paths: on straight legs, so that it is on the line to the last bits. The middle of the front
axle is on the line as well, and that gives the heading. The next lanes are chosen five ahead, by a route or by chance;
chance is a function of the world's seed, the car's id and how many choices it has made. Whoever has no route and
stands before a street that is full chooses anew; or streets that fill up in a ring would stand for ever.

*How fast*: the intelligent driver model (Treiber, Hennecke, Helbing 2000), with v the speed, v0 the wish or what the
`lookout` allows, s the gap and dv the closing speed:

    v' = a (1 - (v / v0)^4 - (s* / s)^2)        s* = s0 + v T + v dv / (2 sqrt(a b))

Above v0 the first two terms give way to (v0 - v) / `SETTLE`. For what stands still (a stop line, the end of a road) the
last term does: whoever would have to brake by more than a certain amount from here on brakes by just that amount.

Drivers look and decide ten times a second and keep their acceleration in between, as people do: a decision is worked
out for all at once and costs ten times as much as moving them. It falls on fixed frames, so no state but the columns
matters.

*Pilots* are driven rows that drive themselves (`take_wheel`): they decide as all the others do, but what they decide
goes to their pedals and, by pure pursuit of the lane's line, to their wheels. `dynamics` moves them; their place on the
lane is that beside which they are.

Where it stops being true: nobody changes lanes, overtakes or reverses; of those who do not keep to the lanes only
people on foot are seen where they will be, the others where they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.driver_perception import (
    ACCEL,
    BRAKE_FROM,
    BRAKE_FULLY,
    FIRM,
    GAP,
    HEADWAY,
    STOP_GAP,
    Drivers,
    Entries,
    View,
    look,
    spot,
)
from rosbridge_sim.world.dynamics import command
from rosbridge_sim.world.geometry import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.lane_conflicts import COMFORT, LaneConflicts
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.state import DT, Gear, Kind, Mode, World, usual_wheelbase

__all__ = ["DECISION", "drive_lanes", "keep_lane", "leave_lane", "onto", "take_wheel"]

DECISION: Final = 5
"""Frames from one decision to the next: 0.1 s."""

_INTERVAL: Final = DECISION * DT

HARD: Final = 8.0
"""As hard as a car can brake [m/s^2]."""

SETTLE: Final = 0.4
"""How soon a driver who is too fast is not [s]."""

CREEP: Final = 0.1
"""Slower than this is as good as standing [m/s]; it keeps quotients finite, too."""

MOVES: Final = 0.5
"""A vehicle faster than this is on its way through an intersection, not waiting in it [m/s]."""

FORESIGHT: Final = 3.0
"""Who will have walked onto the road in this time is waited for [s]."""

MAX_WAIT_STEPS: Final = 20
"""Who stands before a full street chooses anew each time so many decisions have gone by: 2 s."""

MAX_ROUTE_TURNS: Final = 8
"""Lanes entered within one step, at most: a map's snippets of a centimetre must not hold up the world."""

MAX_ASIDE: Final = 3.0
"""A pilot takes the wheel only so near to the middle of a lane [m],"""

MAX_ASLANT: Final = math.radians(60.0)
"""and with no more than this between its heading and the lane's [rad]."""

PURSUIT: Final = 0.6
MIN_PURSUIT: Final = 4.0
"""A pilot steers towards where the lane's line will be after so long, and not nearer than this [s, m]."""

_AHEAD: Final = tuple(f"ahead_{i}" for i in range(1, 6))
_LEGS: Final = ("leg_start", "leg_end", "leg_x", "leg_y", "leg_z", "leg_dx", "leg_dy", "leg_dz")


def keep_lane(
    world: World,
    row: int,
    lane: int,
    s: float,
    *,
    wish: float = math.inf,
    route: Sequence[int] = (),
    is_loop: bool = False,
) -> None:
    """Have a vehicle keep to the lanes from a place on one of them on, where it is put with the speed that it has.

    Args:
        world: written in place.
        row: of a VEHICLE.
        lane: row of a lane.
        s: how far along it, held within the lane [m].
        wish: how fast the driver would like to go; limits, bends and others slow him [m/s].
        route: rows of lanes, each one a successor of the one before, beginning with `lane`; where it ends, or without
            one, chance chooses.
        is_loop: the route begins again; its first lane is a successor of its last.

    Raises:
        ValueError: not a vehicle, no such lane, a wish or place that is no number, or a route that does not lead along
            lanes. Nothing has changed.
    """
    roads = world.roads
    if world.kind[row] != Kind.VEHICLE or not world.alive[row]:
        raise ValueError(f"row {row} is no vehicle that could keep to a lane")
    if not 0 <= lane < len(roads):
        raise ValueError(f"lane: expected 0..{len(roads) - 1}, got {lane!r}")
    if not (math.isfinite(s) and wish >= 0.0):
        raise ValueError(f"s and wish: expected numbers, the wish not negative, got {s!r} and {wish!r}")
    way = [*route, route[0]] if route and is_loop else list(route)
    if route and route[0] != lane:
        raise ValueError(f"route: expected to begin with lane {lane}, got {route[0]}")
    for i, (here, there) in enumerate(pairwise(way)):
        if not 0 <= here < len(roads) or there not in roads.successors(here):
            raise ValueError(f"route[{i}]: lane {there} does not follow lane {here}")

    s = min(max(s, 0.0), float(roads.length[lane]))
    x, y, z = roads.at(lane, s)[0][0].tolist()
    world.place(row, x=x, y=y, z=z, yaw=0.0, speed=max(float(world.speed[row]), 0.0))
    world.wheelbase[row] = usual_wheelbase(world.bodies[row])
    if len(route):
        world.routes[int(world.uid[row])] = np.array(route, dtype=np.int64)
    _join(world, row, lane, s, wish=wish, is_loop=is_loop)
    _set_legs(world, roads.derived(LaneConflicts), np.array([row]))
    lanes = world.int_block("lane", "ahead_5")[:, [row]]
    world.yaw[row] = _heading(roads, lanes, world.arc[[row]], world.wheelbase[[row]])[0]
    world.touch()


def take_wheel(world: World, row: int) -> bool:
    """Have a driven row drive itself along the lanes, from where it is, until `leave_lane` or whatever places it.

    It decides on the frames of decision; a `command` from outside holds until then.

    Args:
        world: written in place.
        row: of an EGO.

    Returns:
        Whether there is a lane that it could drive on; if not, nothing has changed.

    Raises:
        ValueError: the row is not driven.
    """
    if world.kind[row] != Kind.EGO or not world.alive[row]:
        raise ValueError(f"row {row} is not driven")
    near = world.roads.nearest(world.x[row], world.y[row], world.yaw[row])
    is_along = math.cos(near.yaw[0] - world.yaw[row]) >= math.cos(MAX_ASLANT)
    if not (near.distance[0] <= MAX_ASIDE and is_along):
        return False
    leave_lane(world, row)
    _join(world, row, int(near.lane[0]), float(near.s[0]), wish=math.inf, is_loop=False)
    world.touch()
    return True


def leave_lane(world: World, row: int) -> None:
    """Have a row keep to no lane any more; it goes on as it moves now. Who keeps to none is left alone."""
    if world.has_lane[row]:
        x, y, z, yaw, speed = (float(getattr(world, name)[row]) for name in ("x", "y", "z", "yaw", "speed"))
        world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
        world.touch()


def _join(world: World, row: int, lane: int, s: float, *, wish: float, is_loop: bool) -> None:
    """Write what makes a row one of those who keep to the lanes."""
    world.has_lane[row], world.is_loop[row], world.wish[row] = True, is_loop, wish
    world.lane[row], world.arc[row], world.turns[row] = lane, s, 0
    world.claim[row] = world.held[row] = world.exit_lane[row] = world.behind[row] = -1
    _Way(world, np.array([row])).plan(np.array([0]))
    if s + world.half_length[row] + world.centre[row] > world.roads.derived(LaneConflicts).hold[lane]:
        world.held[row], world.exit_lane[row] = lane, world.ahead_1[row]


def drive_lanes(world: World, dt: float) -> None:
    """Move all who keep to the lanes by `dt`, in place; on the frames of decision they look first."""
    traffic = world.derived(_Traffic)
    if not traffic.num:
        return
    if world.frame % DECISION == 0:
        traffic.decide()
    traffic.move(dt)


def _set_legs(world: World, network: LaneConflicts, rows: IntArray) -> None:
    """Find the straight legs that rows are on."""
    point, _ = world.roads.locate(world.lane[rows], world.arc[rows])
    world.point[rows] = point
    world.block(_LEGS[0], _LEGS[-1])[:, rows] = network.legs[point].T


def _heading(roads: Roads, lanes: IntArray, arc: FloatArray, wheelbase: FloatArray) -> FloatArray:
    """Headings of cars whose rear axles are at `arc` of the first of their lanes, (k,) each, lanes (6, k) [m, rad]."""
    rear, _ = roads.at(*onto(roads, lanes, arc))
    front, yaw = roads.at(*onto(roads, lanes, arc + wheelbase))
    step = front - rear
    # At the end of the last lane there is no line for the front axle.
    is_short = np.hypot(step[:, 0], step[:, 1]) < 0.5 * wheelbase
    return np.where(is_short, yaw, np.arctan2(step[:, 1], step[:, 0]))


def onto(roads: Roads, lanes: IntArray, arc: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return lane and arc length of places that may be beyond the end of the first lane.

    Args:
        roads: the lanes.
        lanes: (6, k) the lane that each row is on and those ahead of it, -1 beyond a dead end.
        arc: (k,) from the start of the first one [m].
    """
    lane, s = lanes[0].copy(), arc.copy()
    for following in lanes[1:]:
        length = roads.length[lane]
        at = np.flatnonzero((s > length) & (following >= 0))
        if not len(at):
            break
        s[at] -= length[at]
        lane[at] = following[at]
    return lane, s


class _Traffic:
    """Those who keep to the lanes, and what is the same at every step.

    Lives until somebody comes or goes, stands or begins to move.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.rows = np.flatnonzero(world.alive & world.has_lane)
        self.num = len(self.rows)
        if not self.num:
            return
        first, last = int(self.rows[0]), int(self.rows[-1])
        is_run = last - first + 1 == self.num
        self.at: slice | IntArray = slice(first, last + 1) if is_run else self.rows
        self.roads = world.roads
        self.network = world.roads.derived(LaneConflicts)
        half, centre = world.half_length[self.at], world.centre[self.at]
        self.nose, self.rear, self.length = half + centre, half - centre, 2.0 * half
        self.wish = world.wish[self.at].copy()
        self.wheelbase = world.wheelbase[self.at].copy()
        self.uid = world.uid[self.at].copy()
        self.way = _Way(world, self.rows)
        self.pilots = np.flatnonzero(world.kind[self.rows] == Kind.EGO)
        others = world.alive & ~world.has_lane
        moves = (world.kind == Kind.EGO) | (world.speed != 0.0)
        self.still, _ = _spot(world, np.flatnonzero(others & ~moves))
        self.moving = np.flatnonzero(others & moves)
        self.on_wheels = (world.kind[self.moving] == Kind.EGO) | (world.kind[self.moving] == Kind.VEHICLE)

    def decide(self) -> None:
        """Choose the accelerations until the next decision."""
        world, at = self.world, self.at
        if len(self.pilots):
            self._find_pilots()
        ints = world.int_block("lane", "ahead_5")[:, at]
        drivers = Drivers(
            *(ints, world.arc[at], world.speed[at], world.point[at], self.nose, self.rear, self.length, self.uid),
            *(world.claim[at], world.held[at], world.exit_lane[at]),
        )
        # Those who drive through come first: they hold the lanes of an intersection, others are only in the way.
        drives = self.on_wheels & (np.abs(world.speed[self.moving]) > MOVES)
        seen, whose = _spot(world, np.concatenate([self.moving[drives], self.moving[~drives]]))
        num_driving = int(np.count_nonzero(whose < np.count_nonzero(drives)))
        view = look(self.network, world.signals.may_enter, drivers, Entries.join(seen, self.still), num_driving)
        speed, accel = drivers.speed, _accelerate(drivers.speed, np.fmin(self.wish, view.pace), view)
        world.accel[at] = accel
        self._steer(ints, speed, accel)
        if len(self.pilots):
            self._command_pilots(ints, accel)
        turn_away = view.is_shut_out & (speed < CREEP) & ((world.frame // DECISION + self.uid) % MAX_WAIT_STEPS == 0)
        if turn_away.any():
            self.way.change(np.flatnonzero(turn_away))
        if not isinstance(at, slice):
            world.claim[at], world.held[at], world.exit_lane[at] = drivers.claim, drivers.held, drivers.exit_lane

    def _find_pilots(self) -> None:
        """See where on their lanes they are: beside which point of the line."""
        world, rows = self.world, self.rows[self.pilots]
        foot, yaw = self.roads.at(world.lane[rows], world.arc[rows])
        along = (world.x[rows] - foot[:, 0]) * np.cos(yaw) + (world.y[rows] - foot[:, 1]) * np.sin(yaw)
        world.arc[rows] = np.fmax(world.arc[rows] + along, 0.0)
        self._turn(self.pilots)

    def _command_pilots(self, lanes: IntArray, accel: FloatArray) -> None:
        """Press their pedals and turn their wheels."""
        world, rows = self.world, self.rows[self.pilots]
        reach = np.fmax(world.speed[rows] * PURSUIT, MIN_PURSUIT)
        goal, _ = self.roads.at(*onto(self.roads, lanes[:, self.pilots], world.arc[rows] + reach))
        east, north, yaw = goal[:, 0] - world.x[rows], goal[:, 1] - world.y[rows], world.yaw[rows]
        aside = north * np.cos(yaw) - east * np.sin(yaw)
        steer = np.arctan2(2.0 * world.wheelbase[rows] * aside, np.fmax(east * east + north * north, 1.0))
        for row, angle, wish in zip(rows.tolist(), steer.tolist(), accel[self.pilots].tolist(), strict=True):
            if world.gear[row] == Gear.DRIVE:
                command(world, row, mode=Mode.ACCEL, steer=angle, accel=wish)
            else:
                command(world, row, mode=Mode.PEDALS, steer=angle, brake=1.0)

    def _steer(self, lanes: IntArray, speed: FloatArray, accel: FloatArray) -> None:
        """Turn so that the heading is right at the next decision, when the car is where this takes it."""
        world, at = self.world, self.at
        time = np.where(speed + accel * _INTERVAL < 0.0, speed / np.fmax(-accel, CREEP), _INTERVAL)
        way = time * (speed + 0.5 * accel * time)
        moves = np.flatnonzero(way > 0.0)
        turn = np.zeros(self.num)
        heading = _heading(self.roads, lanes[:, moves], (world.arc[at] + way)[moves], self.wheelbase[moves])
        turn[moves] = wrap_angle(heading - world.yaw[at][moves])
        world.yaw_rate[at] = turn / _INTERVAL
        world.lateral_accel[at] = world.yaw_rate[at] * speed

    def move(self, dt: float) -> None:
        """Slide along the legs, all but the pilots; whoever comes to the end of one is given the next."""
        world, at = self.world, self.at
        if len(self.pilots):
            rows = self.rows[self.pilots]
            kept = {name: getattr(world, name)[rows] for name in ("x", "y", "z", "yaw", "speed")}
        before, accel = world.speed[at], world.accel[at]
        after = before + accel * dt
        is_stopping = after < 0.0
        if np.count_nonzero(is_stopping):  # it brakes by no more than brings it to a stand
            after = np.fmax(after, 0.0)
            world.accel[at] = np.where(is_stopping, before / -dt, accel)
        arc = world.arc[at] + (before + after) * (0.5 * dt)
        world.speed[at], world.arc[at] = after, arc
        is_past = arc >= world.leg_end[at]
        if np.count_nonzero(is_past):
            self._turn(np.flatnonzero(is_past))
        way = world.arc[at] - world.leg_start[at]
        world.x[at] = world.leg_x[at] + way * world.leg_dx[at]
        world.y[at] = world.leg_y[at] + way * world.leg_dy[at]
        world.z[at] = world.leg_z[at] + way * world.leg_dz[at]
        yaw = world.yaw[at] + world.yaw_rate[at] * dt
        world.yaw[at] = yaw if np.abs(yaw).max() < math.pi else wrap_angle(yaw)
        if len(self.pilots):
            for name, values in kept.items():
                getattr(world, name)[rows] = values

    def _turn(self, which: IntArray) -> None:
        world, rows = self.world, self.rows[which]
        for _ in range(MAX_ROUTE_TURNS):
            is_over = world.arc[rows] >= self.roads.length[world.lane[rows]]
            if not is_over.any():
                break
            self._enter_next(which[is_over])
        _set_legs(world, self.network, rows)

    def _enter_next(self, which: IntArray) -> None:
        world, rows = self.world, self.rows[which]
        is_end = world.ahead_1[rows] < 0
        if is_end.any():
            at_end = rows[is_end]
            world.arc[at_end] = np.nextafter(self.roads.length[world.lane[at_end]], 0.0)
            world.speed[at_end] = world.accel[at_end] = 0.0
            which, rows = which[~is_end], rows[~is_end]
        world.arc[rows] -= self.roads.length[world.lane[rows]]
        lanes = world.int_block("behind", "ahead_5")
        lanes[:-1, rows] = lanes[1:, rows]
        world.turns[rows] += 1
        world.ahead_5[rows] = self.way.choose(which, world.ahead_4[rows], world.turns[rows] + len(_AHEAD))
        lane = world.lane[rows]
        enters = self.network.hold[lane] == 0.0
        world.held[rows[enters]] = lane[enters]
        has_come = enters & (world.claim[rows] == lane)
        world.claim[rows[has_come]] = -1


def _spot(world: World, rows: IntArray) -> tuple[Entries, IntArray]:
    cos, sin = np.cos(world.yaw[rows]), np.sin(world.yaw[rows])
    return spot(
        world.roads,
        x=world.x[rows] + world.centre[rows] * cos,
        y=world.y[rows] + world.centre[rows] * sin,
        yaw=world.yaw[rows],
        speed=world.speed[rows],
        half_length=world.half_length[rows],
        half_width=world.half_width[rows],
        foresight=np.where(world.kind[rows] == Kind.PEDESTRIAN, FORESIGHT, 0.0),
    )


def _accelerate(speed: FloatArray, wish: FloatArray, view: View) -> FloatArray:
    """The driver model; see the head of this file."""
    below = ACCEL * (1.0 - np.square(np.square(np.fmin(speed / np.fmax(wish, CREEP), 1.0))))
    free = np.where(speed < wish, below, np.fmax((wish - speed) / SETTLE, -FIRM))
    desired = GAP + np.fmax(speed * (HEADWAY + (speed - view.lead_speed) / (2.0 * math.sqrt(ACCEL * COMFORT))), 0.0)
    behind = free - ACCEL * np.square(desired / np.fmax(view.gap, CREEP))
    left = view.wall - STOP_GAP
    needed = np.where(left > 0.0, speed * speed / (2.0 * np.fmax(left, 1e-3)), HARD)
    share = np.fmin(np.fmax((needed - BRAKE_FROM) / (BRAKE_FULLY - BRAKE_FROM), 0.0), 1.0)
    before = np.fmin(free, free - share * (free + needed))
    return np.asarray(np.fmax(np.fmin(behind, before), -HARD))


# The way


class _Way:
    """Which lane comes next, for some rows; `which` are positions in these."""

    def __init__(self, world: World, rows: IntArray) -> None:
        self.world, self.rows = world, rows
        self.onward = world.roads.derived(LaneConflicts).onward
        routes = [world.routes.get(uid, _NO_ROUTE) for uid in world.uid[rows].tolist()] if world.routes else []
        self.length = np.array([len(route) for route in routes] or [0] * len(rows), dtype=np.int64)
        self.first = np.cumsum(self.length) - self.length
        self.route = np.concatenate(routes) if routes else _NO_ROUTE
        self.is_loop = world.is_loop[rows].copy()
        self.salt = _mix(world.uid[rows].astype(np.uint64) + np.uint64(world.seed * 0x632BE59BD9B4E019 % 2**64))

    def plan(self, which: IntArray) -> None:
        """Choose the lanes ahead."""
        world, rows = self.world, self.rows[which]
        lanes = world.int_block("lane", _AHEAD[-1])
        for i in range(1, len(lanes)):
            lanes[i, rows] = self.choose(which, lanes[i - 1, rows], world.turns[rows] + i)

    def change(self, which: IntArray) -> None:
        """Choose others, where there is no route."""
        which = which[self.length[which] == 0]
        self.world.turns[self.rows[which]] += len(_AHEAD) + 1
        self.plan(which)

    def choose(self, which: IntArray, lane: IntArray, turn: IntArray) -> IntArray:
        """The lane after `lane` (k,), as the `turn`-th (k,); -1 at a dead end."""
        onward = self.onward
        count = np.where(lane >= 0, onward.first[lane + 1] - onward.first[lane], 0)
        dice = _mix(self.salt[which] + turn.astype(np.uint64)) % np.maximum(count, 1).astype(np.uint64)
        chosen = np.full(len(which), -1, dtype=np.int64)
        goes = count > 0
        chosen[goes] = onward.other[onward.first[lane[goes]] + dice[goes].astype(np.int64)]
        length = self.length[which]
        index = np.where(self.is_loop[which] & (length > 0), turn % np.maximum(length, 1), turn)
        knows = index < length
        if knows.any():
            chosen[knows] = self.route[self.first[which[knows]] + index[knows]]
        return chosen


_NO_ROUTE: Final[IntArray] = np.empty(0, dtype=np.int64)
_ODD: Final = np.uint64(0x9E3779B97F4A7C15)


def _mix(value: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Scatter numbers over 64 bits so that neighbours have nothing in common (Steele, Lea, Flood 2014)."""
    value = value * _ODD
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))
