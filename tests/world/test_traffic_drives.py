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
    "roundabout": ("roundabout", 24, 16.0, 0.4),
    "demo": ("demo", 12, 12.0, 0.3),
    "hills": ("hills", 16, 12.0, 0.4),
}
"""Scenario, vehicles besides its own, length [s], and the ego's throttle in the first half."""

KNOWN: Final[dict[str, list[tuple[float, ...]]]] = {
    "town": [
        (2.4366795, 25.8145151, 6.3906952, 0.0000000),
        (1.2548162, 26.4276687, 2.8054834, 0.0038226),
        (-1.0460872, 25.7224383, 2.1761748, 0.0040785),
        (-2.4002779, 26.6223805, 2.4156841, 0.0000000),
    ],
    "motorway": [
        (962.5538750, 1110.9825284, 33.5258584, 0.9188667),
        (941.9064324, 1111.2233281, 38.2678290, 0.0933264),
        (919.1748605, 1108.3980009, 40.7492607, 0.0092022),
        (898.1104956, 1102.0212355, 42.1537379, -0.1038879),
    ],
    "roundabout": [
        (114.8958181, 25.4293742, 12.1055130, 0.0000000),
        (120.8649320, 24.9352552, 11.9699547, -0.0177844),
        (130.2218783, 22.5356261, 10.4827208, 0.0013591),
        (137.6288887, 16.8308682, 9.3896761, 0.0065212),
    ],
    "demo": [
        (195.0304829, 95.4093249, 8.8626901, -0.3508563),
        (198.2243369, 95.5220759, 10.1666905, 0.1398900),
        (200.0825163, 99.0687853, 10.3871663, 0.0000000),
        (198.7453248, 103.2678419, 10.4220078, 0.3511297),
    ],
    "hills": [
        (-7.1876750, -11.6819901, 15.1671150, 0.0000000),
        (-3.1643785, -13.7758616, 17.0050017, 0.0000000),
        (-0.5868250, -15.8581629, 16.5540895, 0.0000000),
        (-2.5948343, -17.7594909, 15.8448401, 0.0000000),
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
