"""Pedestrians at roads, one by one in plain complex numbers: the kerb, lights, gaps, and who goes on."""

from __future__ import annotations

import cmath
import math
from typing import Final

import numpy as np
import pytest

from rosbridge_sim.world.people.crossings import Crossings, find_crossings
from rosbridge_sim.world.people.people import COMMITTED, People, find_ways_over, walk
from rosbridge_sim.world.roads.paths import DX, DY, START, X, Y
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.lane_drives import BUS, world_of
from tests.world.people.test_walking_one_by_one import CLOSE, MAN, Walker
from tests.world.road_factory import CAR, car, line, make

BOX: Final = Body.box(0.8, 0.8, 1.0)
NUM: Final = 10
APART: Final = 200.0
"""Each pedestrian has its own place on the road, out of sight of the others [m]."""


def street() -> tuple[Roads, SignalPlan]:
    """Two lanes to the east and one back; every third place has no light, one is red, one green."""
    end = APART * NUM
    points = [(x, 0.0) for x in np.arange(0.0, end + 1.0, 20.0)]
    roads = make(
        a=(line(*points), ""),
        b=(line(*[(x, 3.5) for x, _ in points]), ""),
        c=(line(*[(x, 10.0) for x, _ in reversed(points)]), ""),
    )
    lit = [i for i in range(NUM) if i % 3]
    lights = [Light(f"w{i}", is_pedestrian=True, x=APART * (i + 0.5), y=-3.0) for i in lit]
    lamps = tuple(int(Lamp.RED if i % 3 == 1 else Lamp.GREEN) for i in lit)
    controller = Controller("c", 1, tuple((i,) for i in range(len(lit))), (Phase(10, lamps),), (0,) * len(lit))
    return roads, SignalPlan(roads, lights, [controller])


@pytest.fixture(scope="module")
def roads() -> tuple[Roads, SignalPlan]:
    return street()


def people_at_the_road(roads: tuple[Roads, SignalPlan], seed: int) -> tuple[World, list[int]]:
    """People before, on and behind a road, and vehicles that stand on their way, come, pass and leave."""
    rng, world, rows = np.random.default_rng(seed), world_of(*roads, seed=seed), []
    for i in range(NUM):
        middle = APART * (i + 0.5)
        way = cmath.rect(1.0, math.pi / 2 + rng.uniform(-0.5, 0.5))
        ends = np.array([[middle, -2.0], [middle, -2.0]]) + np.outer([-9.0, 26.0], [way.real, way.imag])
        is_loop = bool(rng.random() < 0.3)  # over the road and back, at another place
        back = ends[::-1] + np.array([15.0, 0.0])
        uid = world.spawn(
            *(Kind.PEDESTRIAN, MAN),
            name="p",
            x=ends[0, 0],
            y=ends[0, 1],
            path=np.concatenate([ends, back]) if is_loop else ends,
            is_loop=is_loop,
            speed=rng.uniform(0.4, 2.0),
            yields=True,
        )
        row = world.row(uid)
        rows.append(row)
        if rng.random() < 0.1:
            world.start_within[row] = 5.0  # it waits for an ego
        arc = float(
            rng.choice([rng.uniform(0.0, 35.5), rng.uniform(7.0, 9.5), rng.uniform(7.8, 9.0), rng.uniform(13.0, 17.0)])
        )
        if is_loop and rng.random() < 0.5:
            arc = float(world.path_length[row]) - rng.uniform(0.1, 14.0)  # on its way to the first kerb again
        leg = world.paths.of(uid)
        leg = leg[leg[:, START] <= arc][-1]
        way = complex(leg[DX], leg[DY])
        place = complex(leg[X], leg[Y]) + (arc - leg[START] - 1j * rng.uniform(0.2, 1.0)) * way
        world.x[row], world.y[row] = place.real, place.imag
        world.leg_start[row] = world.arc[row] = max(arc - rng.choice([0.0, 0.2, 1.0]), 0.0)
        world.yaw[row] = cmath.phase(way) + rng.uniform(-0.5, 0.5)
        world.speed[row] = rng.choice([0.0, 0.03, 1.0]) * rng.uniform(0.5, 2.0)
        world.yields[row] = rng.choice([1, 1, COMMITTED, COMMITTED + 1])
        for _ in range(int(rng.integers(0, 4))):
            vehicle_near(world, rng, middle)
        if rng.random() < 0.2:
            aside = cmath.rect(rng.uniform(0.5, 1.6), rng.uniform(-3.1, 3.1))
            world.spawn(Kind.OBSTACLE, BOX, name="box", x=place.real + aside.real, y=place.imag + aside.imag)
    world.frame = 2
    return world, rows


def vehicle_near(world: World, rng: np.random.Generator, middle: float) -> None:
    """A driver on a lane, or an ego or another vehicle, that stands or drives near a place."""
    body = BUS if rng.random() < 0.3 else CAR
    speed = float(rng.choice([0.0, 0.05, 0.3, 1.0, 1.0]) * rng.uniform(1.0, 14.0))
    away = float(rng.choice([-1.0, 1.0]) * rng.choice([3.0, 15.0, 40.0, 80.0]) * rng.uniform(0.0, 1.0))
    if rng.random() < 0.5:
        lane = str(rng.choice(["a", "b", "c"]))
        s = middle + away if lane != "c" else APART * NUM - middle + away
        row = car(world, lane, s, speed=speed, body=body)
        world.yaw[row] += rng.choice([0.0, 0.0, 0.4, -0.4])
        return
    kind = rng.choice([Kind.EGO, Kind.VEHICLE, Kind.OBSTACLE])
    y, yaw = rng.uniform(-6.0, 14.0), rng.choice([0.0, math.pi, *rng.uniform(-3.0, 3.0, 2)])
    row = world.row(world.spawn(Kind(kind), body, name="v", x=middle + away, y=y, yaw=yaw))
    world.speed[row] = speed if kind != Kind.OBSTACLE else 0.0


class Crosser(Walker):
    """One pedestrian at a road, and what it decides."""

    def __init__(self, world: World, row: int) -> None:
        super().__init__(world, row)
        segments = world.paths.of(int(world.uid[row]))
        self.crossings: Crossings = find_crossings(segments, world.roads, world.signals.plan, 0.9)
        self.state = int(world.yields[row])
        before = float(world.leg_start[row])
        for i, start in enumerate(self.crossings.start.tolist()):
            if before < start <= self.arc and self.state != COMMITTED + i:
                self.arc = math.nextafter(start, 0.0)  # it is still before this kerb
        self.aim(self.arc)

    def mind_kerb(self) -> tuple[int, float, float]:
        """The state from now on, and the speeds that are wanted without and with the kerb."""
        is_at_end = not self.is_loop and self.arc >= self.length - 1.0
        waits = is_at_end or self.world.start_within[self.row] > 0.0
        free = 0.0 if waits else float(self.world.desired_speed[self.row])
        kerbs = list(zip(self.crossings.start.tolist(), self.crossings.end.tolist(), strict=True))
        inside = [i for i, (start, end) in enumerate(kerbs) if start <= self.arc <= end]
        ahead = [i for i, (start, _) in enumerate(kerbs) if start >= self.arc]
        again = [i for i in range(len(kerbs)) if self.is_loop]
        following = [*inside, *ahead, *again, None][0]
        room = math.inf if following is None else kerbs[following][0] - self.arc
        room = 0.0 if inside else room + self.length if room < 0.0 else room
        state = self.state
        if state >= COMMITTED and following != state - COMMITTED:
            state = 1
        if following is not None and state < COMMITTED:
            asks = room < 1.0 and free > 0.0
            if inside or (asks and self.may_go(following)):
                state = COMMITTED + following
        wish = free if state >= COMMITTED else min(free, math.sqrt(2.0 * max(room - 0.6, 0.0)))
        return state, free, wish

    def may_go(self, crossing: int) -> bool:
        """Its light is not red, and no vehicle endangers it."""
        light = int(self.crossings.light[crossing])
        shown = int(self.world.signals.shown[light]) if light >= 0 else int(Lamp.GREEN)
        if not shown & int(Lamp.GREEN):
            return False
        vehicles = [Kind.EGO, Kind.VEHICLE]
        cars = [row for row in range(self.world.n) if self.world.kind[row] in vehicles]
        return not any(self.is_endangered(row, self.crossings.ends[crossing].tolist()) for row in cars)

    def is_endangered(self, row: int, ends: list[float]) -> bool:
        """The vehicle is on the crossing, or comes too early, or is a driver that cannot stop gently any more."""
        world, start, stop = self.world, complex(*ends[:2]), complex(*ends[2:])
        width, way = abs(stop - start), (stop - start) / abs(stop - start)
        heading, speed = cmath.rect(1.0, world.yaw[row]), float(world.speed[row])
        place = complex(world.x[row], world.y[row]) + world.centre[row] * heading
        if abs(place - 0.5 * (start + stop)) >= 70.0:
            return False
        local, course = (place - start) / way, heading / way
        half = float(world.half_length[row])
        side = abs(course.real) * half + abs(course.imag) * float(world.half_width[row])
        depth = abs(course.imag) * half + abs(course.real) * float(world.half_width[row])
        gap = abs(local.imag) - depth - 0.5
        if gap < 0.0 and -side < local.real < width + side:
            return True
        if world.has_lane[row] and world.kind[row] != Kind.EGO:
            foot = min(max(local.real, 0.0), width)
            nears = ((foot - local) / course).real > 0.35 * abs(foot - local)
            across = -course.imag * math.copysign(1.0, local.imag) * speed
            passes = across > 0.3 and -2.0 < local.real + max(gap, 0.0) / across * course.real * speed < width + 2.0
            stops_in = speed * (1.0 + speed / 4.0) + 3.0
            is_late = max(abs(foot - local) - half, 0.0) < stops_in
            return is_late and (passes or (nears and speed > 0.3))
        comes = -course.imag * math.copysign(1.0, local.imag) * speed
        if comes <= 0.3:
            return False
        arrival = max(gap, 0.0) / comes
        hits = local.real + arrival * course.real * speed
        crossed = width / max(float(world.desired_speed[self.row]), 0.1) + 1.0
        return bool(-2.0 < hits < width + 2.0 and arrival < crossed)

    def go(self, free: float, wish: float) -> tuple[float, float]:
        """Speed and yaw until the next decision."""
        by_solid, around = self.by_solid()
        push = (wish * self.towards - self.velocity) / 0.5 + self.by_people() + around + by_solid
        most = 1.3 * wish
        if wish < free and abs(by_solid) > 1.0:  # it steps back
            push, most = -self.velocity / 0.5 + by_solid, max(most, 0.5)
        push *= min(1.0, 6.0 / max(abs(push), 6.0))
        after = self.velocity + 0.1 * push
        after *= min(abs(after), most) / max(abs(after), 0.05)
        if abs(after) < 0.05:
            return 0.0, float(self.world.yaw[self.row])
        return abs(after), cmath.phase(after)


@pytest.mark.parametrize("seed", range(40))
def test_people_wait_cross_and_step_back_as_one_by_one(seed: int, roads: tuple[Roads, SignalPlan]) -> None:
    world, rows = people_at_the_road(roads, seed)
    crossers = [Crosser(world, row) for row in rows]
    states, free, wishes = zip(*(one.mind_kerb() for one in crossers), strict=True)
    speed, yaw = np.array([one.go(*each) for one, *each in zip(crossers, free, wishes, strict=True)]).T
    walk(world)
    assert world.arc[rows] == pytest.approx([one.arc for one in crossers])
    assert world.yields[rows].tolist() == list(states)
    assert world.speed[rows] == pytest.approx(speed, abs=CLOSE)
    assert np.exp(1j * world.yaw[rows]) == pytest.approx(np.exp(1j * yaw), abs=CLOSE)


@pytest.mark.parametrize("body", [CAR, BUS])
@pytest.mark.parametrize("is_driver", [False, True])
def test_vehicle_endangers_a_crossing_from_any_side_and_at_any_angle_as_one_by_one(
    body: Body, roads: tuple[Roads, SignalPlan], *, is_driver: bool
) -> None:
    rng, world = np.random.default_rng(2 * (body is BUS) + is_driver), world_of(*roads)
    middle = 0.5 * APART
    path = np.array([[middle, -9.0], [middle + 3.0, 16.0]])
    uid = world.spawn(Kind.PEDESTRIAN, MAN, name="p", x=middle, y=-9.0, path=path, speed=1.2, yields=True)
    if is_driver:
        row = car(world, "a", middle, body=body)
    else:
        row = world.row(world.spawn(Kind.EGO, body, name="ego", x=middle, y=0.0))
    person = Crosser(world, world.row(uid))
    people = world.derived(People)
    one, speed = np.zeros(1, dtype=np.int64), np.array([1.2])
    found, expected = [], []
    for _ in range(160):
        away = cmath.rect(rng.choice([3.0, 8.0, 30.0]) * rng.uniform(0.0, 1.5), rng.uniform(-math.pi, math.pi))
        world.x[row], world.y[row] = middle + away.real, 1.7 + away.imag
        world.yaw[row] = rng.choice([rng.uniform(-3.1, 3.1), cmath.phase(-away) + rng.uniform(-1.5, 1.5)])
        world.speed[row] = rng.choice([0.0, 0.25, 0.35, 1.0, 1.0, 1.0]) * rng.uniform(1.0, 12.0)
        found.append(people._is_endangered(one, one, speed).item())
        expected.append(person.is_endangered(row, person.crossings.ends[0].tolist()))
    assert found == expected
    assert 25 < sum(expected) < 135


@pytest.mark.parametrize("seed", range(4))
def test_ways_over_the_road_lead_beside_the_path_to_the_other_kerb(seed: int, roads: tuple[Roads, SignalPlan]) -> None:
    world, rows = people_at_the_road(roads, seed)
    times, velocities = find_ways_over(world)
    assert not times[world.yields < COMMITTED].any()
    for row in rows:
        if world.yields[row] < COMMITTED:
            continue
        one = Crosser(world, row)
        crossing = int(world.yields[row]) - COMMITTED
        if crossing >= len(one.crossings.end):
            continue
        left = float(one.crossings.end[crossing]) - float(world.arc[row])
        assert times[row] == pytest.approx(max(left, 0.0) / max(float(world.speed[row]), 0.5))
        first, last = (complex(*end) for end in one.crossings.ends[crossing].reshape(2, 2))
        kerb = last - 1j * one.side * (last - first) / abs(last - first)
        there = one.place + times[row] * velocities[row]
        assert there == pytest.approx(kerb if left > 0.0 else one.place)
