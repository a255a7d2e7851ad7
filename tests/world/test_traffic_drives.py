"""Traffic with single track egos in it drives as it did: a change that nobody means shows here, wherever it is made.

Each drive has a few numbers at each of some moments: means over all rows, each with a weight of its own. They agree to
`CLOSE`, for the reason that `test_ego_drives.py` has. After a change that is meant to change how traffic
drives, `python -m tests.world.test_traffic_drives` prints them anew. What is right is for other tests to say.
"""

from __future__ import annotations

import sys
from typing import Final

import numpy as np
import pytest

from rosbridge_sim.scenarios.catalogue import BUILT_IN
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.world.demand import LaneSlots, keep_clear
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step

CLOSE: Final = 1e-5
"""Allowed difference of the means [m, m/s]: rounding of one frame is 1e-14, and braking drivers make it grow."""

MOMENTS: Final = 4
LIBRARY: Final = DiskLibrary()
MODELS: Final = [BUILT_IN.find(name) for name in ("2015_Kia_K5", "Van", "Bus", "2015_Kia_K5", "Truck", "Motorcycle")]

DRIVES: Final = {
    "town": ("town", 40, 16.0, 0.4),
    "motorway": ("motorway", 60, 16.0, 0.5),
    "roundabout": ("roundabout", 24, 8.0, 0.4),
    "demo": ("demo", 12, 8.0, 0.3),
    "hills": ("hills", 16, 12.0, 0.4),
}
"""Scenario, vehicles besides its own, length [s], and the ego's throttle in the first half."""

KNOWN: Final[dict[str, list[tuple[float, ...]]]] = {
    "town": [
        (2.5399235, 25.7964517, 6.3200492, 0.0000000),
        (1.8009535, 26.2267691, 2.9428585, 0.0038165),
        (-0.4870806, 24.5294821, 2.3939436, 0.0040782),
        (-1.8029499, 23.9092460, 2.5226266, 0.0000000),
    ],
    "motorway": [
        (962.5398653, 1111.0223242, 33.4442546, 0.8752381),
        (941.8308179, 1111.8557077, 38.0995904, 0.0248884),
        (918.4899069, 1109.5196033, 40.6492919, 0.1031374),
        (896.1018115, 1103.2773462, 42.3519692, -0.0939314),
    ],
    "roundabout": [
        (113.0270869, 24.1615616, 10.9276199, 0.0000000),
        (115.0128584, 25.3567760, 11.7353522, 0.0000000),
        (117.3876955, 25.7392719, 11.4777782, -0.0078780),
        (119.8343077, 24.9507936, 11.2294996, -0.0129632),
    ],
    "demo": [
        (194.2363871, 95.7753162, 8.0311666, 0.0000000),
        (196.2387907, 95.2071611, 9.1274203, 0.1963032),
        (198.5830449, 95.4490320, 9.6775803, 0.0861958),
        (200.2601349, 97.2869083, 10.0660967, 0.0000410),
    ],
    "hills": [
        (-7.1697660, -11.6553540, 15.0101493, 0.0000000),
        (-3.1242033, -13.5918427, 16.8336600, 0.0000000),
        (-0.6109814, -15.4736177, 16.4181180, 0.0000000),
        (-2.6380229, -17.3421742, 15.8373716, 0.0000000),
    ],
}
"""Of x, y, speed and lateral offset, at each quarter of a drive [m, m/s]."""


def scene_of(scenario: str, num: int) -> Scene:
    """A scenario with so many vehicles more, of several models, on free places of its lanes."""
    scene = Scene(World(7, Dynamics.SINGLE_TRACK), LIBRARY, LIBRARY.scenario(scenario), ego_gear=Gear.DRIVE)
    world, slots = scene.world, scene.world.roads.derived(LaneSlots.of)
    free = np.flatnonzero(keep_clear(world, slots, 14.0))
    chosen = free[np.random.default_rng(3).permutation(len(free))[:num]]
    models = [model for i in range(len(chosen)) if (model := MODELS[i % len(MODELS)]) is not None]
    with world.room_for(len(chosen)):
        rows = scene.add_vehicles(models, slots.speed[chosen])
        places = zip(rows.tolist(), slots.lane[chosen].tolist(), slots.s[chosen].tolist(), strict=True)
        keep_lanes(world, [LaneStart(row, lane, s, wander=0.15) for row, lane, s in places])
    return scene


def summary(world: World) -> tuple[float, ...]:
    """Means over the rows that are alive, of what traffic decides, with weights from 1 to 2."""
    rows = world.alive.nonzero()[0]
    weights = 1.0 + np.arange(len(rows)) / len(rows)
    columns = (world.x, world.y, world.speed, world.lateral)
    return tuple(float((column[rows] * weights).mean()) for column in columns)


def drive(name: str) -> list[tuple[float, ...]]:
    """Drive; return the numbers of each moment."""
    scenario, num, seconds, throttle = DRIVES[name]
    world = scene_of(scenario, num).world
    ego, found = int(world.rows(Kind.EGO)[0]), []
    num_frames = round(seconds / DT)
    for frame in range(1, num_frames + 1):
        if frame == num_frames // 2:  # from here on it brakes, also where that is in the way of others
            command(world, ego, mode=Mode.PEDALS, brake=0.4, steer=0.0)
        elif frame == 1:
            command(world, ego, mode=Mode.PEDALS, throttle=throttle, steer=0.01)
        step(world)
        if frame % (num_frames // MOMENTS) == 0:
            found.append(summary(world))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", DRIVES)
def test_traffic_drives_as_it_did(name: str) -> None:
    found = drive(name)
    assert found == [pytest.approx(numbers, rel=0.0, abs=CLOSE) for numbers in KNOWN[name]]


if __name__ == "__main__":
    for each in DRIVES:
        lines = "".join(f"        {tuple(round(value, 7) for value in values)},\n" for values in drive(each))
        sys.stdout.write(f'    "{each}": [\n{lines}    ],\n')
