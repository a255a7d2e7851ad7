"""The walk of pedestrians, decided one by one in plain complex numbers from the equations of the social force model."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from rosbridge_sim.world.people.people import walk
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.road_factory import CAR

MAN = Body.box(0.45, 0.55, 1.7)
CARGO = Body.box(1.6, 1.2, 1.0)
CLOSE = 1e-9
REACH = 3.0
"""Others farther away do not push [m], and boxes whose middles are farther away than that and half of the longest."""

VIEW = math.cos(math.radians(100.0))


def crowd(seed: int, num: int = 26) -> World:
    """People on paths across one another, others who heed nobody, and vehicles and things among them."""
    rng, world = np.random.default_rng(seed), World(1)
    for i in range(num):
        x, y, yaw = *rng.uniform(-5.0, 5.0, 2), rng.uniform(-3.1, 3.1)
        way = np.array([math.cos(yaw), math.sin(yaw)])
        start = np.array([x, y]) - 20.0 * way
        heeds = i % 4 != 3
        row = world.row(
            world.spawn(
                *(Kind.PEDESTRIAN, MAN),
                name="p",
                x=x,
                y=y,
                path=np.array([start, start + 60.0 * way]),
                speed=rng.uniform(0.3, 2.0),
                yields=heeds,
            )
        )
        world.x[row] += rng.uniform(-1.0, 1.0)
        world.y[row] += rng.uniform(-1.0, 1.0)
        world.yaw[row] = rng.uniform(-3.1, 3.1)
        world.speed[row] = rng.choice([0.0, 1.0]) * rng.uniform(0.0, 2.0)
    for kind, body in [(Kind.VEHICLE, CAR), (Kind.OBSTACLE, CARGO), (Kind.EGO, CAR), (Kind.OBSTACLE, MAN)]:
        x, y = rng.uniform(-5.0, 5.0, 2)
        world.spawn(kind, body, name="s", x=x, y=y, yaw=rng.uniform(-3.1, 3.1))
    return world


class Walker:
    """One pedestrian, and what it decides."""

    def __init__(self, world: World, row: int) -> None:
        self.world, self.row = world, row
        self.place = complex(world.x[row], world.y[row])
        self.velocity = cmath.rect(world.speed[row], world.yaw[row])
        segment = world.paths.of(int(world.uid[row]))[0]
        start, self.course = complex(segment[2], segment[3]), complex(segment[5], segment[6])
        self.arc = max(((self.place - start) * self.course.conjugate()).real, 0.0)
        # An even share of the way from 0.3 to 0.9 m beside the path, by the id
        share = int(world.uid[row]) * 0x9E3779B1 % 2**32 / 2**32
        goal = start + (self.arc + 1.2) * self.course - 1j * self.course * (0.3 + 0.6 * share)
        way = goal - self.place
        self.towards = way / max(abs(way), 0.05)

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
        wish = float(self.world.desired_speed[self.row])
        by_solid, around = self.by_solid()
        push = (wish * self.towards - self.velocity) / 0.5 + self.by_people() + around + by_solid
        push *= min(1.0, 6.0 / max(abs(push), 6.0))
        after = self.velocity + 0.1 * push
        after *= min(abs(after), 1.3 * wish) / max(abs(after), 0.05)
        if abs(after) < 0.05:
            return 0.0, float(self.world.yaw[self.row])
        return abs(after), cmath.phase(after)


@pytest.mark.parametrize("seed", range(12))
def test_pedestrians_decide_as_one_by_one(seed: int) -> None:
    world = crowd(seed)
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
