"""Turn signals: before and in turns at intersections, and not in bends."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.followers.lane_following import view_driver
from rosbridge_sim.world.followers.turn_signals import find_turn_signals
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World
from tests.world.lane_drives import NOSE, lane_of, world_of
from tests.world.road_factory import arc, car, ego, line, make


def junction(first: str = "way") -> Roads:
    """A way in from the west, and three ways on; the one ahead goes through a bend afterwards."""
    lanes = {
        "way": (line((-100, 0), (0, 0)), "left right ahead"),
        "left": (arc(0, 15, 15, -90, 90), "north"),
        "right": (arc(0, -10, 10, 90, -90), "south"),
        "ahead": (line((0, 0), (15, 0)), "bend"),
        "north": (line((15, 15), (15, 100)), ""),
        "south": (line((10, -10), (10, -100)), ""),
        "bend": (arc(15, 40, 40, -90, 90), "end"),
        "end": (line((55, 40), (55, 100)), ""),
    }
    return make(**{first: lanes[first], **lanes})


def shown(world: World, row: int) -> int:
    return int(find_turn_signals(world, np.array([row]))[0])


@pytest.mark.parametrize("first", ["way", "left"])
@pytest.mark.parametrize(("to", "signal"), [("left north", 1), ("right south", 2), ("ahead bend", 0)])
def test_driver_signals_before_and_in_a_turn_at_an_intersection(to: str, signal: int, first: str) -> None:
    world = world_of(junction(first))
    route = f"way {to}"
    far, near = (car(world, "way", 100.0 - NOSE - away, route=route) for away in (31.0, 29.0))
    fast, slow = (car(world, "way", 100.0 - NOSE - 40.0, speed=speed, route=route) for speed in (14.0, 13.0))
    turn, following = to.split()
    inside, through = car(world, turn, 10.0), car(world, following, 1.0)
    rows = np.array([far, near, fast, slow, inside, through])
    assert find_turn_signals(world, rows).tolist() == [0, signal, signal, 0, signal, 0]
    assert [shown(world, row) for row in rows.tolist()] == find_turn_signals(world, rows).tolist()
    seen = view_driver(world, near)
    assert seen is not None
    assert (seen.signal, lane_of(world, near)) == (signal, "way")


def test_signal_of_a_lane_change_comes_before_that_of_a_turn() -> None:
    world = world_of(junction())
    row = car(world, "way", 90.0, route="way left north")
    world.signal[row] = 2
    assert shown(world, row) == 2


def test_what_follows_no_lane_has_no_signals_of_a_driver() -> None:
    world = World()
    assert shown(world, ego(world, 0.0, 0.0)) == 0
