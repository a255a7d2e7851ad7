"""The walk of pedestrians, decided one by one in plain complex numbers from the equations of the social force model."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from rosbridge_sim.world.people.people import walk
from rosbridge_sim.world.roads.paths import DX, DY, END, START, X, Y
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.road_factory import CAR

MAN = Body.box(0.45, 0.55, 1.7)
CARGO = Body.box(1.6, 1.2, 1.0)
CLOSE = 1e-9
REACH = 3.0
"""Others farther away do not push [m], and boxes whose middles are farther away than that and half of the longest."""

VIEW = math.cos(math.radians(100.0))


def crowd(seed: int, num: int = 26, *, has_corners: bool = False) -> World:
    """People on paths across one another, others who heed nobody, and vehicles and things among them."""
    rng, world = np.random.default_rng(seed), World(1)
    for i in range(num):
        x, y, yaw = *rng.uniform(-5.0, 5.0, 2), rng.uniform(-3.1, 3.1)
        way = np.array([math.cos(yaw), math.sin(yaw)])
        path = np.array([x, y]) + np.outer([-20.0, 40.0], way)
        if has_corners:  # near the end of the first part, or of the whole
            path = np.array([x, y]) + np.array(
                [-rng.uniform(0.5, 6.0) * way, (0.0, 0.0), *rng.uniform(-6.0, 6.0, (3, 2))]
            )
        heeds = i % 4 != 3
        row = world.row(
            world.spawn(
                *(Kind.PEDESTRIAN, MAN),
                name="p",
                x=x,
                y=y,
                path=path,
                is_loop=has_corners and i % 3 == 0,
                speed=rng.uniform(0.3, 2.0),
                yields=heeds,
            )
        )
        world.x[row] += rng.uniform(-1.0, 1.0)
        world.y[row] += rng.uniform(-1.0, 1.0)
        world.yaw[row] = rng.uniform(-3.1, 3.1)
        if has_corners:
            world.leg_start[row] = rng.uniform(0.0, world.path_length[row])
            leg = world.paths.of(int(world.uid[row]))
            leg = leg[leg[:, START] <= world.leg_start[row]][-1]
            world.x[row] += leg[X] + (world.leg_start[row] - leg[START]) * leg[DX] - x
            world.y[row] += leg[Y] + (world.leg_start[row] - leg[START]) * leg[DY] - y
        world.speed[row] = rng.choice([0.0, 1.0]) * rng.uniform(0.0, 2.0)
    for kind, body in [(Kind.VEHICLE, CAR), (Kind.OBSTACLE, CARGO), (Kind.EGO, CAR), (Kind.OBSTACLE, MAN)]:
        x, y = rng.uniform(-5.0, 5.0, 2)
        world.spawn(kind, body, name="s", x=x, y=y, yaw=rng.uniform(-3.1, 3.1))
    return world


class Walker:
    """One pedestrian, and what it decides.

    Attributes:
        arc: where it is on its path [m].
        towards: the direction that it wants to walk in.
        course: that of its path.
    """

    def __init__(self, world: World, row: int) -> None:
        self.world, self.row = world, row
        self.place = complex(world.x[row], world.y[row])
        self.velocity = cmath.rect(world.speed[row], world.yaw[row])
        self.legs: list[list[float]] = world.paths.of(int(world.uid[row])).tolist()
        self.length, self.is_loop = self.legs[-1][END], bool(world.is_loop[row])
        # An even share of the way from 0.3 to 0.9 m beside the path, by the id
        self.side = 0.3 + 0.6 * (int(world.uid[row]) * 0x9E3779B1 % 2**32 / 2**32)
        self.aim(self.project(float(world.leg_start[row])))

    def aim(self, arc: float) -> None:
        """Be at a place of the path, and walk to one ahead, to the right of it."""
        self.arc, leg = arc, self.leg_at(arc)
        self.course = complex(leg[DX], leg[DY])
        way = self.goal(arc) - self.place
        self.towards = way / max(abs(way), 0.05)

    def ahead(self, arc: float, distance: float) -> float:
        """A loop begins again, another path ends."""
        return math.fmod(arc + distance, self.length) if self.is_loop else min(arc + distance, self.length)

    def leg_at(self, arc: float) -> list[float]:
        """The straight part of the path."""
        return [leg for leg in self.legs if leg[START] <= arc][-1]

    def goal(self, arc: float) -> complex:
        """The place that it walks to."""
        arc = self.ahead(arc, 1.2)
        leg = self.leg_at(arc)
        course = complex(leg[DX], leg[DY])
        return complex(leg[X], leg[Y]) + (arc - leg[START] - 1j * self.side) * course

    def foot(self, arc: float) -> tuple[float, float, bool]:
        """The nearest place on a part of the path, its distance, and whether the part is over."""
        leg = self.leg_at(arc)
        start, course = complex(leg[X], leg[Y]), complex(leg[DX], leg[DY])
        along, length = ((self.place - start) * course.conjugate()).real, leg[END] - leg[START]
        on_leg = min(max(along, 0.0), length)
        return leg[START] + on_leg, abs(self.place - start - on_leg * course), along >= length

    def project(self, before: float) -> float:
        """Where it is on its path, from where it was."""
        here, away, is_over = self.foot(before)
        there, other, _ = self.foot(self.ahead(before, 1.2))
        arc = there if other < away or is_over else here
        is_there = abs(self.goal(arc) - self.place) < 0.6  # on the inner side of a corner
        return self.ahead(arc, 0.3) if is_there else arc

    def by_people(self) -> complex:
        """The ellipses of Helbing and Molnar, and the push of bodies that touch."""
        world, total = self.world, 0j
        for other in range(world.n):
            away = self.place - complex(world.x[other], world.y[other])
            if world.kind[other] != Kind.PEDESTRIAN or other == self.row or abs(away) >= REACH:
                continue
            step = 2.0 * cmath.rect(world.speed[other], world.yaw[other])
            near, far = abs(away), max(abs(away - step), 1e-3)
            half = 0.5 * math.sqrt(max((near + far) ** 2 - abs(step) ** 2, 1e-4))
            force = (
                2.1 / 0.3 * math.exp(-half / 0.3) * (near + far) / (4.0 * half) * (away / near + (away - step) / far)
            )
            force += 6.0 * math.exp((0.6 - near) / 0.15) * away / near
            is_seen = -(self.towards * away.conjugate()).real >= VIEW * near
            total += force if is_seen else 0.5 * force
        return total

    def by_solid(self) -> tuple[complex, complex]:
        """The push of boxes, and the way around those that are met."""
        world, total, around = self.world, 0j, 0j
        longest = float(world.half_length[world.kind != Kind.PEDESTRIAN].max(initial=0.0))
        for other in range(world.n):
            if world.kind[other] == Kind.PEDESTRIAN:
                continue
            turn = cmath.rect(1.0, -world.yaw[other])
            local = (self.place - complex(world.x[other], world.y[other])) * turn - world.centre[other]
            if abs(local) >= REACH + longest:
                continue
            half_length, half_width = world.half_length[other], world.half_width[other]
            beyond = complex(
                local.real - min(max(local.real, -half_length), half_length),
                local.imag - min(max(local.imag, -half_width), half_width),
            )
            body = world.half_width[self.row]
            outward = beyond / max(abs(beyond), 0.05)
            total += 10.0 * math.exp(-max(abs(beyond) - body, 0.0) / 0.2) * outward / turn
            against, course_against = ((way * turn * outward.conjugate()).real for way in (self.towards, self.course))
            if against < 0.0 and min(against, course_against) < -0.3 and abs(beyond) < body + 0.6:
                is_left = ((self.course * turn).conjugate() * (local - 0.3 * half_length)).imag >= 0.0
                around += 4.0 * (-1j if is_left else 1j) * outward / turn
        return total, around

    def decide(self) -> tuple[float, float]:
        """Speed and yaw until the next decision."""
        is_at_end = not self.is_loop and self.arc >= self.length - 1.0
        wish = 0.0 if is_at_end else float(self.world.desired_speed[self.row])
        by_solid, around = self.by_solid()
        push = (wish * self.towards - self.velocity) / 0.5 + self.by_people() + around + by_solid
        push *= min(1.0, 6.0 / max(abs(push), 6.0))
        after = self.velocity + 0.1 * push
        after *= min(abs(after), 1.3 * wish) / max(abs(after), 0.05)
        if abs(after) < 0.05:
            return 0.0, float(self.world.yaw[self.row])
        return abs(after), cmath.phase(after)


@pytest.mark.parametrize("has_corners", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_pedestrians_decide_as_one_by_one(seed: int, *, has_corners: bool) -> None:
    world = crowd(seed, has_corners=has_corners)
    rows = (world.yields > 0).nonzero()[0]
    walkers = [Walker(world, int(row)) for row in rows]
    speed, yaw = np.array([one.decide() for one in walkers]).T
    before = world.speed.copy()
    world.frame = 2
    walk(world)
    assert world.speed[rows] == pytest.approx(speed, abs=CLOSE)
    assert np.exp(1j * world.yaw[rows]) == pytest.approx(np.exp(1j * yaw), abs=CLOSE)
    assert world.accel[rows] == pytest.approx((speed - before[rows]) / 0.1, abs=10.0 * CLOSE)
    assert world.arc[rows] == pytest.approx([one.arc for one in walkers])
    assert world.leg_dx[rows] + 1j * world.leg_dy[rows] == pytest.approx(np.exp(1j * yaw), abs=CLOSE)
    assert world.leg_x[rows] + 1j * world.leg_y[rows] == pytest.approx([one.place for one in walkers])


def test_those_who_heed_nobody_do_not_decide() -> None:
    world = crowd(3)
    rows = ((world.yields == 0) & (world.kind == Kind.PEDESTRIAN)).nonzero()[0]
    before = world.speed[rows].copy(), world.yaw[rows].copy()
    world.frame = 2
    walk(world)
    assert (world.speed[rows].tolist(), world.yaw[rows].tolist()) == (before[0].tolist(), before[1].tolist())


def test_two_at_one_place_leave_it_to_opposite_sides() -> None:
    world = World(1)
    rows = []
    for _ in range(2):
        uid = world.spawn(
            Kind.PEDESTRIAN,
            MAN,
            name="p",
            x=5.0,
            y=0.0,
            path=np.array([[0.0, 0.0], [60.0, 0.0]]),
            speed=1.3,
            yields=True,
        )
        rows.append(world.row(uid))
    world.frame = 2
    walk(world)
    first, second = (world.speed[row] * math.sin(world.yaw[row]) for row in rows)
    assert first > 0.2 > -0.2 > second
