from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

from rosbridge_sim.world.contacts.contacts_without_cars import find_without_cars
from rosbridge_sim.world.state.world import Body, Kind, World
from rosbridge_sim.world.step import step

MAN, CRATE = Body.box(0.4, 0.6, 1.7), Body.box(4.0, 1.0, 1.0)


def put(world: World, x: float, y: float = 0.0, yaw: float = 0.0, z: float = 0.0) -> int:
    return world.spawn(Kind.PEDESTRIAN, MAN, name="", x=x, y=y, z=z, yaw=yaw)


@pytest.mark.parametrize(
    ("place", "is_touching"),
    [
        ((0.39, 0.0, 0.0, 0.0), True),
        ((0.41, 0.0, 0.0, 0.0), False),
        ((0.4, 0.0, 0.0, 0.0), False),  # edge to edge
        ((0.0, 0.49, 0.0, math.pi / 2), True),
        ((0.0, 0.51, 0.0, math.pi / 2), False),
        ((0.1, 0.0, 1.69, 0.0), True),
        ((0.1, 0.0, 1.71, 0.0), False),  # on a bridge above
    ],
)
def test_two_pedestrians_touch_if_their_boxes_overlap(
    place: tuple[float, float, float, float], *, is_touching: bool
) -> None:
    world, (x, y, z, yaw) = World(), place
    ids = [put(world, 5.0), put(world, 5.0 + x, y, yaw, z)]
    assert find_without_cars(world).tolist() == ([ids] if is_touching else [])


def test_pairs_with_a_car_are_left_to_the_world() -> None:
    world = World()
    car, man, crate = (
        world.spawn(kind, body, name="", x=0.0, y=0.0)
        for kind, body in ((Kind.VEHICLE, Body()), (Kind.PEDESTRIAN, MAN), (Kind.OBSTACLE, CRATE))
    )
    assert find_without_cars(world).tolist() == [[man, crate]]
    step(world)
    assert world.contacts.tolist() == [[car, man], [car, crate]]
    assert find_without_cars(World()).tolist() == []


def test_a_crowd_has_the_pairs_of_a_look_at_each_two() -> None:
    random = np.random.default_rng(3)
    world, alone = World(), []
    for _ in range(18):
        x, y, yaw = random.uniform((0.0, 0.0, -3.0), (2.0, 2.0, 3.0)).tolist()
        put(world, x, y, yaw)
        alone.append((x, y, yaw))
    expected = []
    for (i, one), (j, other) in combinations(enumerate(alone), 2):
        pair = World()
        for x, y, yaw in (one, other):
            put(pair, x, y, yaw)
        if len(find_without_cars(pair)):
            expected.append([int(world.uid[i]), int(world.uid[j])])
    assert find_without_cars(world).tolist() == expected
    assert 20 < len(expected) < 140
