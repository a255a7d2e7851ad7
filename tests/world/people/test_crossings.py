"""Places where a path crosses the road, found place by place in plain Python."""

from __future__ import annotations

import cmath
import math
from itertools import pairwise
from typing import Final

import numpy as np
import pytest

from rosbridge_sim.world.people.crossings import Crossings, find_crossings
from rosbridge_sim.world.roads.paths import lay_segments
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from tests.world.road_factory import line, make

LANES: Final = {
    "a": (complex(-200.0, 0.0), 0.0),
    "b": (complex(-200.0, 4.2), 0.0),  # 0.7 m between the edges of both: no island
    "c": (complex(-200.0, 10.0), 0.0),  # 2.3 m: an island
    "d": (complex(-140.0, -140.0), math.pi / 4.0),
}
"""Start and heading of straight lanes of 400 m, 3.5 m wide."""

HALF: Final = 1.75 + 0.3
"""From its line on, a lane is the road for a body [m]: half of its width, and half of a body's."""


def roads_with(lights: list[tuple[float, float, bool]]) -> tuple[Roads, SignalPlan]:
    """The lanes, and lights at places; some of them are for pedestrians."""
    lanes = {}
    for name, (start, yaw) in LANES.items():
        points = [start + cmath.rect(20.0 * k, yaw) for k in range(21)]
        lanes[name] = (line(*[(point.real, point.imag) for point in points]), "")
    roads = make(**lanes)
    lit = [
        Light(f"w{i}", is_pedestrian=True, x=x, y=y) if is_pedestrian else Light(f"v{i}", lanes=(0,), x=x, y=y)
        for i, (x, y, is_pedestrian) in enumerate(lights)
    ]
    groups, lamps = tuple((i,) for i in range(len(lit))), (int(Lamp.GREEN),) * len(lit)
    return roads, SignalPlan(
        roads, lit, [Controller("c", 1, groups, (Phase(10, lamps),), (0,) * len(lit))] if lit else []
    )


def is_on_road(place: complex) -> bool:
    """Whether a body there reaches onto a lane."""
    return any(abs(((place - start) / cmath.rect(1.0, yaw)).imag) < HALF for start, yaw in LANES.values())


def find_one_by_one(corners: list[complex], side: float) -> list[tuple[float, float, complex, complex]]:
    """The kerbs of each crossing of a path: arc lengths and places."""
    lengths = [abs(there - here) for here, there in pairwise(corners)]
    ends = np.cumsum(lengths)
    total = float(ends[-1])
    num = max(2, math.ceil(total / 0.25) + 1)

    def at(i: int, aside: float = 0.0) -> complex:
        s = total * i / (num - 1)
        leg = min(int(np.searchsorted(ends, s, side="right")), len(lengths) - 1)
        course = (corners[leg + 1] - corners[leg]) / lengths[leg]
        return corners[leg] + (s - float(ends[leg]) + lengths[leg]) * course - 1j * aside * course

    runs: list[list[int]] = []
    for i in [i for i in range(num) if is_on_road(at(i))]:
        is_same = bool(runs) and (i == runs[-1][1] + 1 or (i - runs[-1][1]) * total / (num - 1) <= 1.2)
        if is_same:
            runs[-1][1] = i
        else:
            runs.append([i, i])
    most = int(2.0 * (num - 1) / total)
    for k, run in enumerate(runs):
        low = runs[k - 1][1] + 1 if k else 0
        high = runs[k + 1][0] - 1 if k + 1 < len(runs) else num - 1
        for which, step, limit in ((0, -1, low), (1, 1, high)):
            for _ in range(most if side > 0.0 else 0):
                if run[which] == limit or not is_on_road(at(run[which] + step, side)):
                    break
                run[which] += step
    return [(total * first / (num - 1), total * last / (num - 1), at(first), at(last)) for first, last in runs]


def found(corners: list[complex], side: float, lights: list[tuple[float, float, bool]]) -> Crossings:
    points = np.array([(corner.real, corner.imag, 0.0) for corner in corners])
    return find_crossings(lay_segments(points, is_loop=False, reach=0.5), *roads_with(lights), side)


@pytest.mark.parametrize("seed", range(40))
def test_crossings_are_the_parts_of_a_path_on_lanes_with_no_island_between(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = [complex(*rng.uniform((-50.0, -12.0), (50.0, 22.0))) for _ in range(int(rng.integers(2, 7)))]
    if seed % 4 == 0:  # straight over all, with its ends on the pavement
        corners = [complex(30.0, -8.0), complex(30.0 + rng.uniform(-9.0, 9.0), 16.0)]
    side = float(rng.choice([0.0, 0.9]))
    expected = find_one_by_one(corners, side)
    crossings = found(corners, side, [])
    assert crossings.start == pytest.approx([each[0] for each in expected], abs=1e-6)
    assert crossings.end == pytest.approx([each[1] for each in expected], abs=1e-6)
    places = np.array([(a.real, a.imag, b.real, b.imag) for _, _, a, b in expected]).reshape(-1, 4)
    assert crossings.ends == pytest.approx(places, abs=1e-6)
    assert crossings.light.tolist() == [-1] * len(expected)


def test_light_within_four_metres_of_either_kerb_belongs_to_a_crossing_the_nearest_one_first() -> None:
    corners = [complex(0.0, -9.0), complex(0.0, 17.0)]
    kerbs = find_one_by_one(corners, 0.0)
    near, far = kerbs[0][2], kerbs[1][3]
    for lights, expected in [
        ([(near.real - 3.9, near.imag, True)], [0, -1]),
        ([(near.real - 4.1, near.imag, True)], [-1, -1]),
        ([(near.real, near.imag - 1.0, False), (near.real, near.imag - 3.0, True)], [1, -1]),
        ([(near.real, near.imag - 3.0, True), (near.real, near.imag - 2.0, True)], [1, -1]),
        ([(far.real + 3.0, far.imag + 1.0, True), (near.real, near.imag - 3.0, True)], [1, 0]),
    ]:
        assert found(corners, 0.0, lights).light.tolist() == expected


def test_path_beside_the_road_has_no_crossing() -> None:
    crossings = found([complex(-30.0, -20.0), complex(-25.0, -20.0)], 0.9, [(0.0, 0.0, True)])
    assert (len(crossings.start), crossings.ends.shape, len(crossings.light)) == (0, (0, 4), 0)
