"""Looks at the lanes beside, driver by driver in plain Python, from the rules at the head of `lane_changes`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_perception import perceive
from rosbridge_sim.world.drivers.lane_position import set_legs
from rosbridge_sim.world.drivers.route_choice import RouteChoice
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.followers.lane_following import LaneFollowers
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.lane_changes.lane_change_decision import LaneLook
from rosbridge_sim.world.lane_changes.lane_change_model import LaneChange
from rosbridge_sim.world.lane_changes.lane_change_motion import LANE, shift_time
from rosbridge_sim.world.lane_changes.lane_change_passing import Shifts, is_clear
from rosbridge_sim.world.roads.lane_change_map import LEFT, NUM_SIDES, RIGHT, LaneNeighbours
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.state.world import Kind, World
from tests.world.lane_drives import BUS, world_of
from tests.world.road_factory import CAR, car, ego, keep_lane, line

FRAME: Final = 10_000
CAR_LENGTH: Final = 4.5


def streets(first: str) -> tuple[Roads, SignalPlan]:
    """A road to the east: three lanes of which the right one ends, a crossing with a way off, and an entry.

    `k0`, `k1`: 20 m; `a0` to `a2`: 280 m, where one keeps right; `b0`, `b1`: 200 m; `c0`, `c1`: through the crossing;
    `d0`, `d1`: 240 m; `f0`, `f1`: 240 m. `e` leaves from `b1`, `x` crosses, `r` joins `d1`. A light is before `g1`.

    Args:
        first: the lane of row 0.
    """
    lanes: dict[str, tuple[list[tuple[float, float]], str, float, str]] = {
        "k0": ([(-20, 0), (0, 0)], "a0", 25.0, "k1"),
        "k1": ([(-20, -3.5), (0, -3.5)], "a1", 25.0, ""),
        "a0": ([(0, 0), (280, 0)], "b0", 25.0, "a1"),
        "a1": ([(0, -3.5), (280, -3.5)], "b1", 25.0, "a2"),
        "a2": ([(0, -7), (270, -7)], "", 25.0, ""),
        "b0": ([(280, 0), (480, 0)], "c0", 15.0, "b1"),
        "b1": ([(280, -3.5), (480, -3.5)], "c1 e", 15.0, ""),
        "c0": ([(480, 0), (500, 0)], "d0", 15.0, ""),
        "c1": ([(480, -3.5), (500, -3.5)], "d1", 15.0, ""),
        "e": ([(480, -3.5), (490, -6), (500, -16), (500, -200)], "", 15.0, ""),
        "x": ([(496, -200), (496, 200)], "", 15.0, ""),
        "d0": ([(500, 0), (740, 0)], "f0", 25.0, "d1"),
        "d1": ([(500, -3.5), (740, -3.5)], "f1", 25.0, "r"),
        "r": ([(500, -20), (740, -3.5)], "f1", 25.0, ""),
        "f0": ([(740, 0), (980, 0)], "h0", 25.0, "f1"),
        "f1": ([(740, -3.5), (980, -3.5)], "g1", 25.0, ""),
        "h0": ([(980, 0), (1100, 0)], "", 25.0, ""),
        "g1": ([(980, -3.5), (1100, -3.5)], "", 25.0, ""),
    }
    names = sorted(lanes, key=lambda name: name != first)
    lanes = {name: lanes[name] for name in names}
    right = [names.index(lane[3]) if lane[3] else -1 for lane in lanes.values()]
    roads = Roads(
        names,
        [_fine(lane[0]) for lane in lanes.values()],
        [[names.index(name) for name in lane[1].split()] for lane in lanes.values()],
        [3.5] * len(names),
        [lane[2] for lane in lanes.values()],
        left=[right.index(i) if i in right else -1 for i in range(len(names))],
        right=right,
    )
    light = Light("light", lanes=(names.index("g1"),))
    phase = Phase(10, (int(Lamp.GREEN),))
    return roads, SignalPlan(roads, [light], [Controller("c", 1, ((0,),), (phase,), (0,))])


def _fine(corners: list[tuple[float, float]]) -> FloatArray:
    """A line with points every 10 m."""
    points = [corners[0]]
    for (x0, y0), (x1, y1) in pairwise(corners):
        num = max(1, round(math.hypot(x1 - x0, y1 - y0) / 10.0))
        points += [(x0 + (x1 - x0) * i / num, y0 + (y1 - y0) * i / num) for i in range(1, num + 1)]
    return line(*points)


@pytest.fixture(scope="module")
def roads() -> list[tuple[Roads, SignalPlan]]:
    return [streets(first) for first in ("c1", "d1", "a0", "e", "f1")]


PARTS: Final = [
    ("k0 k1 a0 a1 a2", (-20.0, 90.0)),
    ("a0 a1 a2", (150.0, 280.0)),
    ("b0 b1 c0 c1 e d0 d1", (390.0, 530.0)),
    ("a0 a1 b0 b1", (220.0, 330.0)),
    ("c0 c1 d0 d1 r", (480.0, 600.0)),
    ("d0 d1 r f0 f1", (690.0, 780.0)),
    ("d0 d1 r", (600.0, 740.0)),
    ("f0 f1 g1 h0", (910.0, 990.0)),
]
"""Lanes, and between which places along the road vehicles are on them: they are near one another [m]."""

ROUTES: Final = {
    "k0": "k1 a1 b1 e",
    "a0": "a1 b1 e",
    "a1": "a0 b0 c0 d0",
    "a2": "a1 b1 c1",
    "b0": "b1 e",
    "b1": "b0 c0 d0 f0",
    "d0": "d1 f1 g1",
    "d1": "d0 f0 h0",
    "f0": "f1 g1",
}
"""For a lane the route of a driver that has left it for this one."""


def traffic(roads: tuple[Roads, SignalPlan], seed: int) -> World:
    """Drivers of all sorts at one part of the road, in the middle of what they do, and what stands among them."""
    rng = np.random.default_rng(seed)
    world = world_of(*roads, seed=seed)
    names, (low, high) = PARTS[seed % len(PARTS)]
    beside, flow, wider = list[tuple[int, int]](), rng.uniform(0.0, 25.0), rng.choice([0.0, 50.0])
    jam, tail = (str(rng.choice(names.split())) if rng.random() < 0.4 else ""), low + rng.uniform(0.0, 40.0)
    for _ in range(int(rng.integers(3, 14))):
        is_in_jam = bool(jam) and rng.random() < 0.5
        name = jam if is_in_jam else str(rng.choice(names.split()))
        lane = world.roads.row(name)
        tail += rng.uniform(6.0, 18.0) * is_in_jam
        place = tail if is_in_jam else rng.uniform(low - wider, high + wider)
        place -= float(world.roads.points[world.roads.first[lane], 0])
        s = min(max(place, rng.uniform(0.0, 3.0)), float(world.roads.length[lane]) - 0.01)
        if rng.random() < 0.15:
            x, y = world.roads.at([lane], [s])[0][0, :2].tolist()
            ego(world, x, y + rng.uniform(-0.5, 0.5), speed=float(rng.choice([0.0, 0.0, 1.5, 6.0])))
            continue
        body = BUS if rng.random() < 0.25 else CAR
        pace = float(rng.choice([0.0, 0.3, rng.uniform(1.0, 26.0), *np.fmax(flow + rng.uniform(-2.0, 2.0, 5), 0.0)]))
        pace = float(rng.choice([0.0, 0.3])) if is_in_jam else pace
        row = world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=pace))
        route = (
            [world.roads.row(each) for each in ROUTES[name].split()] if rng.random() < 0.5 * (name in ROUTES) else []
        )
        desired = float(rng.choice([0.4, rng.uniform(1.0, 10.0), *rng.uniform(5.0, 30.0, 4)]))
        keep_lane(world, row, route[0] if route else lane, s, desired_speed=desired, route=route)
        if route:
            beside.append((row, lane))
        put_into(world, row, rng)
    for row, lane in beside:
        preview = RouteChoice(world, np.array([row])).preview(np.zeros(1, dtype=np.int64), np.array([lane]))
        world.int_block("lane", "ahead_5")[:, [row]] = preview
        set_legs(world, world.roads.derived(LaneConflicts), np.array([row]))
    world.frame = FRAME
    return world


def put_into(world: World, row: int, rng: np.random.Generator) -> None:
    """Have a driver signal, change lanes, or rest, since some time."""
    world.came_from[row] = rng.integers(0, 3)
    since = [30, 74, 75, 76, 299, 300, 399, 400, 401, 749, 750, 1499, 1500, 2900, FRAME]
    world.change_since[row] = FRAME - rng.choice(since)
    state = rng.random()
    if state < 0.1:
        world.leaving[row], world.lateral[row], world.lateral_from[row] = rng.integers(1, 3), 2.0, 3.5
        world.lateral_left[row], world.change[row] = 0.6, LaneChange.FASTER
    elif state < 0.5:
        world.change[row], world.signal[row] = rng.choice([1, 2, 3, 4, 5, 5]), rng.integers(1, 3)
        if world.change[row] >= LaneChange.ROUTE:
            world.change_since[row] = FRAME - rng.choice([74, 75, 400, 401, 1499, 1500, 2900])
    before = {"d0": "c0", "d1": "c1"}.get(str(world.roads.ids[world.lane[row]]))
    if before is not None and world.arc[row] < 3.0:
        world.held[row] = world.roads.row(before)  # its tail is still in the crossing


@dataclass
class Option:
    """The lane on one side, as one driver finds it."""

    is_there: bool = False
    run: float = 0.0
    gap: float = math.inf
    lead_speed: float = 0.0
    gap_behind: float = math.inf
    follower: int = -1
    advantage: float = -math.inf
    is_safe: bool = False


@dataclass
class Wish:
    """What one driver decides: reason, side, whether it begins, and from rest."""

    reason: int = 0
    side: int = 0
    since: float = 0.0
    begins: bool = False
    is_tight: bool = False
    excess: float = 0.0
    brakes: list[tuple[int, float]] = field(default_factory=list)


def follow(speed: float, desired: float, gap: float, lead_speed: float) -> float:
    """The intelligent driver model of a mean driver: 1.5 m/s^2, 2 m/s^2, 1.2 s, 2 m."""
    free = max(1.0 - (speed / max(desired, 0.1)) ** 4, -2.0)
    wanted = 2.0 + max(1.2 * speed + speed * (speed - lead_speed) / (2.0 * math.sqrt(3.0)), 0.0)
    return 1.5 * (free - (wanted / max(gap, 0.1)) ** 2)


class Scene:
    """What all drivers of a world see."""

    def __init__(self, world: World) -> None:
        self.world, self.followers = world, LaneFollowers(world)
        self.drivers = self.followers.drivers()
        others, _, num_moving = self.followers.others(lambda: self.drivers)
        may_enter = world.signals.may_enter
        self.perception = perceive(self.followers.conflicts, may_enter, self.drivers, others, num_moving)

        self.desired = np.fmin(self.drivers.parameters.desired_speed, self.perception.safe_speed)


class OneByOne:
    """What `LaneLook` decides for one driver."""

    def __init__(self, scene: Scene, i: int) -> None:
        world, followers = scene.world, scene.followers
        self.world, self.roads, self.i, self.row = world, world.roads, i, int(followers.rows[i])
        self.rows, self.choice = followers.rows, followers.choice
        self.drivers, self.perception, self.desired = scene.drivers, scene.perception, scene.desired
        queue = self.perception.queue
        assert queue is not None
        self.entries = [
            tuple(column[at].item() for column in (queue.lane, queue.s, queue.tail, queue.speed, queue.source))
            for at in range(queue.num)
        ]
        self.own_at = int(queue.position[i])
        self.neighbours = self.roads.derived(LaneNeighbours)
        self.conflicts = self.roads.derived(LaneConflicts)
        drivers = self.drivers
        self.lanes = drivers.lanes[:, i].tolist()
        self.arc, self.speed, self.nose = (float(each[i]) for each in (drivers.arc, drivers.speed, drivers.nose))
        self.rear, self.length = float(drivers.rear[i]), float(drivers.length[i])
        self.gap, self.lead_speed = float(self.perception.gap[i]), float(self.perception.lead_speed[i])
        self.change_time = drivers.parameters.change_time[[i]]
        self.shift_time = shift_time(ARRAYS, self.change_time, drivers.speed[[i]]).item()
        self.run = self.run_on(self.lanes, self.arc)
        waits, narrow = self.conflicts.wait_point, self.conflicts.joins.narrow_from
        is_before_join = self.conflicts.joins.join[self.lanes[0]] >= 0
        is_near = self.gap < max(40.0, 6.0 * self.speed) and self.lead_speed < 0.5
        self.to_entry = self.entry(waits if is_near and is_before_join else np.fmin(waits, narrow))
        self.options = list[Option]()

    def run_on(self, lanes: list[int], s: float) -> float:
        """How far lanes go on from a place."""
        known = [lane for lane in lanes if lane >= 0]
        return math.inf if len(known) == len(lanes) else sum(float(self.roads.length[lane]) for lane in known) - s

    def entry(self, begins: FloatArray) -> float:
        """From the bumper to the next conflict or light; 0 inside of one."""
        own, bumper = self.lanes[0], self.arc + self.nose
        if self.arc - self.rear < self.conflicts.shared[own]:
            return 0.0
        if math.isfinite(begins[own]) and bumper > begins[own]:
            return 0.0
        nearest, distance = float(begins[own]) - bumper, float(self.roads.length[own]) - bumper
        for lane in self.lanes[1:]:
            if lane < 0:
                break
            is_lit = self.world.signals.plan.light_of_lane[lane] >= 0
            nearest = min(nearest, distance if is_lit else distance + float(begins[lane]))
            distance += float(self.roads.length[lane])
        return nearest

    def lead_from(self, lanes: list[int], s: float) -> tuple[float, float]:
        """Distance and speed of the first tail beyond a place."""
        here = [entry for entry in self.entries if entry[0] == lanes[0] and entry[1] >= s]
        if here:
            return here[0][2] - s, here[0][3]
        distance = float(self.roads.length[lanes[0]]) - s
        for lane in lanes[1:]:
            if lane < 0:
                break
            there = [entry for entry in self.entries if entry[0] == lane]
            if there:
                return distance + there[0][2], there[0][3]
            distance += float(self.roads.length[lane])
        return math.inf, 0.0

    def follower_of(self, lane: int, s: float) -> tuple[int, float]:
        """The nearest entry before a place, on the lane or on three before it; and its distance."""
        here = [at for at, entry in enumerate(self.entries) if entry[0] == lane and entry[1] < s]
        if here:
            return here[-1], s - self.entries[here[-1]][1]
        level = [(lane, s)]
        for _ in range(3):
            level = [
                (before, way + float(self.roads.length[before]))
                for at, way in level
                for before in range(len(self.roads))
                if at in self.roads.successors(before)
            ]
            found = []
            for before, way in level:
                last = [at for at, entry in enumerate(self.entries) if entry[0] == before]
                found += [(way - self.entries[last[-1]][1], last[-1])] if last else []
            if found:
                distance, at = min(found)
                return at, distance
        return -1, math.inf

    def cost(self, follower: int, speed: float, gap: float, beyond: float, lead_speed: float) -> float:
        """By how much a follower accelerates more with the driver ahead of it than without."""
        wanted = float(self.desired[follower]) if follower >= 0 else max(speed, 1.0)
        without = follow(speed, wanted, gap + self.length + beyond, lead_speed)
        return max(follow(speed, wanted, gap, self.speed), -8.0) - max(without, -8.0)

    def option(self, side: int) -> Option:
        """The lane on one side."""
        own = self.lanes[0]
        beside, places = self.neighbours.cross(np.array([side]), np.array([own]), np.array([self.arc]))
        lane, s = int(beside[0]), float(places[0])
        if lane < 0 or not self.neighbours.may[side, own]:
            return Option()
        if s + self.nose + self.shift_time * self.speed >= self.conflicts.joins.narrow_from[lane]:
            return Option()
        found = Option(is_there=True)
        lanes = self.choice.preview(np.array([self.i]), np.array([lane]))[:, 0].tolist()
        found.run = self.run_on(lanes, s)
        to_tail, found.lead_speed = self.lead_from(lanes, s)
        found.gap = to_tail - self.nose
        at, distance = self.follower_of(lane, s)
        others, speed = 0.0, 0.0
        if at >= 0:
            _, place, tail, speed, found.follower = self.entries[at]
            nose = float(self.drivers.nose[found.follower]) if found.follower >= 0 else place - tail
            found.gap_behind = distance - self.rear - nose
            others = self.cost(found.follower, speed, found.gap_behind, found.gap, found.lead_speed)
        found.is_safe = self.is_safe(found, speed)
        wanted = float(self.desired[self.i])
        gain = follow(self.speed, wanted, found.gap, found.lead_speed)
        gain -= follow(self.speed, wanted, self.gap, self.lead_speed)
        if side == RIGHT and self.own_at > 0:
            lane_behind, place, _, speed, old = self.entries[self.own_at - 1]
            if lane_behind == own and old >= 0:
                room = self.arc - self.rear - place - float(self.drivers.nose[old])
                others -= self.cost(old, speed, room, self.gap, self.lead_speed)
        found.advantage = gain + float(self.drivers.parameters.politeness[self.i]) * others
        joins = self.conflicts.joins.join
        if joins[lane] >= 0 and (joins[own] < 0 or side == RIGHT):
            found.advantage -= 100.0
        return found

    def is_safe(self, option: Option, speed_behind: float) -> bool:
        """MOBIL's safety: no braking of 4 m/s^2, and 2 m and 0.4 s of room."""
        own = follow(self.speed, max(self.speed, 1.0), option.gap, option.lead_speed)
        theirs = follow(speed_behind, max(speed_behind, 1.0), option.gap_behind, self.speed)
        has_room = option.gap > 2.0 + 0.4 * self.speed and option.gap_behind > 2.0 + 0.4 * speed_behind
        return has_room and own > -4.0 and theirs > -4.0

    def must(self, options: list[Option]) -> tuple[int, int]:
        """Why the driver must change, and to which side; 0 if it need not."""
        if math.isfinite(self.run):
            known = [lane for lane in self.lanes if lane >= 0]
            last, group, place = known[-1], self.neighbours.group, self.neighbours.place
            turn = self.world.turns[self.row] + len(known) - 1
            wanted = int(self.choice.find_wanted(np.array([self.i]), np.array([turn]))[0])
            is_route = wanted >= 0 and wanted != last
            lanes_left = int(place[wanted] - place[last]) if is_route and group[wanted] == group[last] else 0
            side = LEFT if lanes_left > 0 else RIGHT if lanes_left < 0 else -1
            if not is_route:
                side = int(self.neighbours.merge_side[last]) - 1
            if side >= 0 and self.run < max(abs(lanes_left), 1) * max(100.0, 12.0 * self.speed):
                return (LaneChange.ROUTE if is_route else LaneChange.LANE_END), side
        if not self.is_blocked():
            return 0, 0
        worth = []
        for side, option in enumerate(options):
            goes_on = option.run > self.gap + 300.0 or option.run >= self.run
            is_good = option.is_there and goes_on and option.gap > self.gap + self.length
            keeps = is_good and self.world.signal[self.row] == side + 1
            worth.append(math.inf if keeps else option.advantage + option.is_safe if is_good else -math.inf)
        if max(worth) == -math.inf:
            return 0, 0
        return LaneChange.AROUND, int(worth[RIGHT] > worth[LEFT])

    def is_blocked(self) -> bool:
        """Something stands ahead that waits for nothing."""
        world = self.world
        is_near = self.gap < max(40.0, 6.0 * self.speed) and self.lead_speed < 0.5
        if not is_near or self.to_entry <= self.gap + 15.0:
            return False
        lead = int(self.perception.lead[self.i])
        if lead >= 0:
            row = int(self.rows[lead])
            is_stuck = world.change[row] == LaneChange.AROUND or world.leaving[row] > 0
            if world.desired_speed[row] >= 0.5 and not (is_stuck and self.world.frame - world.change_since[row] > 400):
                return False
        ahead = [entry for entry in self.entries[self.own_at + 1 :] if entry[0] == self.lanes[0]]
        if len(ahead) < 2:
            return True
        (_, place, *_), (_, _, tail, speed, source) = ahead[:2]
        return not (source >= 0 and speed < 0.5 and tail < place + 10.0 + self.nose)

    def decide(self, decision: int) -> Wish:
        """Reason and side, and whether it begins now."""
        world, row = self.world, self.row
        options = self.options = [self.option(LEFT), self.option(RIGHT)]
        now, since, signal = int(world.change[row]), float(world.change_since[row]), int(world.signal[row])
        wish = Wish(*self.must(options))
        is_inside = self.to_entry <= 0.0 or self.drivers.held[self.i] >= 0
        if self.drivers.claim[self.i] >= 0:  # it could not stop before another lane
            is_inside |= float(self.drivers.speed[self.i]) ** 2 > 2.0 * 4.0 * max(self.to_entry - 1.0, 0.0)
        bias = 0.3 if self.neighbours.keeps_right[self.lanes[0]] else 0.0
        far = 20.0 + (1.5 + self.shift_time) * self.speed
        advantages = []
        for side, option in enumerate(options):
            goes_on = option.run > 300.0 + 12.0 * self.speed or option.run >= self.run
            is_open = option.is_there and goes_on and self.to_entry > far and not is_inside
            advantages.append(option.advantage + (bias if side == RIGHT else -bias) if is_open else -math.inf)
        if not wish.reason and now == 0:
            best = RIGHT if advantages[RIGHT] > advantages[LEFT] else LEFT
            is_right = best == RIGHT and options[RIGHT].advantage < 0.2
            is_back = world.came_from[row] == best + 1 and advantages[best] < 2.0
            has_rested = since == 0 or self.world.frame - since >= (750 if is_right or is_back else 400)
            if has_rested and advantages[best] > 0.2 and options[best].is_safe:
                wish.reason, wish.side = (LaneChange.KEEP_RIGHT if is_right else LaneChange.FASTER), best
        elif not wish.reason and now in {LaneChange.FASTER, LaneChange.KEEP_RIGHT}:
            side = max(signal - 1, 0)
            if advantages[side] > 0.0 and self.world.frame - since < 300:
                wish.reason, wish.side = now, side
        wish.excess = self.excess(wish.side) if wish.reason else 0.0
        if wish.excess > 0.0 and now == 0 and wish.reason in {LaneChange.FASTER, LaneChange.KEEP_RIGHT}:
            wish.reason = 0
        is_new = (wish.side + 1 if wish.reason else 0) != signal
        wish.since = world.frame if is_new else since
        self.act(wish, options[wish.side], decision, is_new=is_new, is_inside=is_inside)
        return wish

    def act(self, wish: Wish, option: Option, decision: int, *, is_new: bool, is_inside: bool) -> None:
        """Begin, or have gaps opened."""
        wish.is_tight = wish.reason == LaneChange.AROUND and self.speed < 0.5
        clear = wish.reason > 0 and not is_inside and self.is_clear(wish.side, is_tight=wish.is_tight)
        has_signalled = not is_new and self.world.frame - wish.since >= 75
        is_open = option.is_there and option.is_safe and clear and not is_inside and wish.excess <= 0.0
        wish.begins = wish.reason > 0 and has_signalled and is_open and wish.side == decision % 2
        wanted = float(self.desired[self.i])
        if wish.excess > 0.0 and wish.reason >= LaneChange.ROUTE:
            comfort = float(self.drivers.parameters.comfort[self.i])
            wish.brakes.append((self.i, -min(wish.excess / 0.6, comfort)))
        if wish.begins:
            return
        if wish.reason >= LaneChange.ROUTE and option.is_there and not is_inside:
            if (self.world.frame - wish.since) % 3000 < 1500 and clear and option.follower >= 0:
                speed, other = float(self.drivers.speed[option.follower]), float(self.desired[option.follower])
                wish.brakes.append((option.follower, max(follow(speed, other, option.gap_behind, self.speed), -2.0)))
            wish.brakes.append((self.i, max(follow(self.speed, wanted, option.gap, option.lead_speed), -2.0)))
        if wish.reason == LaneChange.AROUND:
            gap = self.gap - 2.0 - 0.4 * max(self.length - CAR_LENGTH, 0.0)
            wish.brakes.append((self.i, max(follow(self.speed, wanted, gap, self.lead_speed), -8.0)))

    def excess(self, side: int) -> float:
        """By how much the driver is too fast for the bends of the lane on one side while it changes lanes."""
        own, figures, roads = self.lanes[0], self.drivers.parameters, self.roads
        beside, places = self.neighbours.cross(np.array([side]), np.array([own]), np.array([self.arc]))
        lane, s = int(beside[0]), float(places[0])
        if lane < 0:
            return 0.0
        lateral, most, reaction, comfort = (
            float(each[self.i]) for each in (figures.lateral, figures.most_lateral, figures.reaction, figures.comfort)
        )
        left = most - 0.1 - 10.0 / math.sqrt(3.0) * LANE / self.shift_time**2
        factor, reach = min(max(left, 0.3), lateral) / 2.5, self.speed * (1.2 + reaction) + 2.5
        table = self.conflicts.speeds_ahead
        lanes = self.choice.preview(np.array([self.i]), np.array([lane]))[:, 0].tolist()
        points = range(int(roads.first[lane]), int(roads.first[lane + 1]) - 1)
        at = max(point for point in points if roads.s[point] <= s)
        square = factor * float(table[at, 5] + table[at, 6] * (s - table[at, 0]))
        distance = float(roads.length[lane]) - s
        for following in lanes[1:]:
            if following < 0:
                break
            here, least = table[int(roads.first[following]), 4:6].tolist()
            enter = here + max(1.0 - distance / reach, 0.0) * (least - here)
            square = min(square, factor * enter + 2.0 * comfort * max(distance - reach, 0.0))
            distance += float(roads.length[following])
        return self.speed - 1.015 * math.sqrt(square)

    def is_clear(self, side: int, *, is_tight: bool) -> bool:
        """It gets past the vehicle ahead of it, see `lane_change_passing`."""
        shifts = Shifts(
            rows=np.array([self.row]),
            nose=np.array([self.nose]),
            length=np.array([self.length]),
            side=np.array([side]),
            done=np.zeros(1),
            across=np.full(1, LANE),
            gap=np.array([self.gap]),
            lead_speed=np.array([self.lead_speed]),
            is_tight=np.array([is_tight]),
            change_time=self.change_time,
        )
        return is_clear(self.world, shifts, np.array([self.speed])).item()


@pytest.mark.parametrize("seed", range(0, 240, 4))
def test_drivers_wish_signal_begin_and_open_gaps_as_one_by_one(
    seed: int, roads: list[tuple[Roads, SignalPlan]]
) -> None:
    for each in range(seed, seed + 4):
        world = traffic(roads[each % len(roads)], each)
        compare(world, decision=each // 8 % 2)
        world.frame += 74 + each % 2  # those who have signalled since the first look may begin on odd ones
        compare(world, decision=each // 16 % 2)


def compare(world: World, decision: int) -> None:
    """Have all drivers look, together and one by one; those that change lanes do not."""
    scene = Scene(world)
    followers, perception = scene.followers, scene.perception
    is_free = (world.leaving[followers.rows] == 0).nonzero()[0]
    which = is_free[followers.changes.neighbours.has_side[world.lane[followers.rows[is_free]]]]
    one_by_one = [OneByOne(scene, int(i)) for i in which]
    wishes = [each.decide(decision) for each in one_by_one]
    assert perception.queue is not None
    arguments = (followers.choice, scene.drivers, perception, perception.queue, scene.desired)
    accel = np.full(followers.num, 9.0)
    look = LaneLook(world, followers.rows, *arguments, which)
    option = look._look_aside()  # all of them to the left, then all to the right
    for name in ("is_there", "run", "gap", "lead_speed", "gap_behind", "follower", "advantage", "is_safe"):
        values = [getattr(each.options[side], name) for side in range(NUM_SIDES) for each in one_by_one]
        assert getattr(option, name).tolist() == pytest.approx(values, rel=1e-9, abs=1e-9), name
    assert np.fmax(look._to_entry, 0.0) == pytest.approx([max(each.to_entry, 0.0) for each in one_by_one])
    begins, sides, tight = look.decide(accel, decision)
    rows = followers.rows[which]
    assert world.change[rows].tolist() == [wish.reason for wish in wishes]
    assert world.signal[rows].tolist() == [wish.side + 1 if wish.reason else 0 for wish in wishes]
    assert world.change_since[rows].tolist() == [wish.since for wish in wishes]
    begun = [(int(i), wish) for i, wish in zip(which, wishes, strict=True) if wish.begins]
    assert begins.tolist() == [i for i, _ in begun]
    assert sides.tolist() == [wish.side for _, wish in begun]
    assert tight.tolist() == [wish.is_tight for _, wish in begun]
    expected = np.full(followers.num, 9.0)
    for wish in wishes:
        for i, brakes in wish.brakes:
            expected[i] = min(expected[i], brakes)
    assert accel == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("beyond", "wishes"), [(-2.0, False), (2.0, True)])
def test_driver_changes_by_choice_only_where_20_metres_and_the_way_of_the_change_are_left(
    beyond: float, *, wishes: bool, roads: list[tuple[Roads, SignalPlan]]
) -> None:
    world = world_of(*roads[0])
    row = car(world, "b1", 20.0, speed=10.0)
    lane, scene = world.roads.row("b1"), Scene(world)
    duration = shift_time(ARRAYS, scene.drivers.parameters.change_time, np.array([10.0])).item()
    bumper = float(world.roads.length[lane]) - (20.0 + (1.5 + duration) * 10.0 + beyond)
    keep_lane(world, row, lane, bumper - float(scene.drivers.nose[0]))
    car(world, "b1", bumper + 25.0, speed=4.0, desired_speed=4.0)
    world.frame = FRAME
    compare(world, decision=0)
    assert (world.change[row] == LaneChange.FASTER) == wishes


@pytest.mark.parametrize(("beyond", "goes_around"), [(-1.0, False), (1.0, True)])
def test_driver_does_not_go_around_what_stands_within_15_metres_of_an_intersection(
    beyond: float, *, goes_around: bool, roads: list[tuple[Roads, SignalPlan]]
) -> None:
    world = world_of(*roads[0])
    row = car(world, "b1", 20.0, speed=3.0)
    lane, nose, gap = world.roads.row("b1"), float(Scene(world).drivers.nose[0]), 8.0
    bumper = float(world.roads.length[lane]) - (gap + 15.0 + beyond)
    keep_lane(world, row, lane, bumper - nose)
    ego(world, 280.0 + bumper + gap + CAR.rear_overhang, -3.5)
    world.frame = FRAME
    compare(world, decision=0)
    assert (world.change[row] == LaneChange.AROUND) == goes_around


@pytest.mark.parametrize(
    ("speed", "gap", "goes_around"), [(10.0, 59.0, True), (10.0, 61.0, False), (3.0, 39.0, True), (3.0, 41.0, False)]
)
def test_driver_goes_around_what_stands_within_six_seconds_or_forty_metres(
    speed: float, gap: float, *, goes_around: bool, roads: list[tuple[Roads, SignalPlan]]
) -> None:
    world = world_of(*roads[0])
    row = car(world, "a1", 50.0, speed=speed)
    ego(world, 50.0 + float(Scene(world).drivers.nose[0]) + gap + CAR.rear_overhang, -3.5)
    world.frame = FRAME
    compare(world, decision=0)
    assert (world.change[row] == LaneChange.AROUND) == goes_around


def test_driver_does_not_go_around_a_queue_with_the_first_driver_of_all(roads: list[tuple[Roads, SignalPlan]]) -> None:
    world = world_of(*roads[0])
    head, _, row = (car(world, "a1", s, speed=v, desired_speed=w) for s, v, w in ((80, 0, 9), (72, 0, 0), (58, 3, 9)))
    world.frame = FRAME
    compare(world, decision=0)
    assert head == 0
    assert world.change[row] == LaneChange.FASTER  # and not around a queue
    world.speed[head] = 5.0
    compare(world, decision=0)
    assert world.change[row] == LaneChange.AROUND


@pytest.mark.parametrize(
    ("to_entry", "has_claim", "is_inside"), [(15.0, True, True), (25.0, True, False), (15.0, False, False)]
)
def test_driver_that_may_enter_and_cannot_stop_any_more_changes_no_lanes_before_the_crossing(
    to_entry: float, roads: list[tuple[Roads, SignalPlan]], *, has_claim: bool, is_inside: bool
) -> None:
    world = World()
    world.lay_roads(*roads[0])
    row = car(world, "b1", 1.0, speed=12.0)
    world.arc[row] = world.roads.length[world.lane[row]] - to_entry - world.half_length[row] - world.centre[row]
    scene = Scene(world)
    scene.drivers.claim[:] = scene.drivers.lanes[1] if has_claim else -1
    assert scene.perception.queue is not None
    arguments = (scene.followers.choice, scene.drivers, scene.perception, scene.perception.queue, scene.desired)
    look = LaneLook(world, scene.followers.rows, *arguments, np.array([0]))
    assert look._to_entry == pytest.approx([to_entry])
    assert look._is_inside.tolist() == [is_inside]
