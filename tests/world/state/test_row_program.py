from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.state.row_program import RowProgram
from rosbridge_sim.world.state.world import Body, Kind, World


def five() -> World:
    world = World()
    for i in range(5):
        world.spawn(Kind.VEHICLE, Body(), name=str(i), x=float(i), y=10.0 * i)
    return world


@pytest.mark.parametrize("rows", [[0, 1, 2, 3, 4], [1, 2], [3], [0, 2, 4], [0, 4]])
def test_program_writes_only_its_rows(rows: list[int]) -> None:
    world = five()
    block = RowProgram(world, np.array(rows), "x", "speed", written_from="x")
    x, y, _, _ = block.values
    block.do(np.add, x, y, x)
    block.do(np.add, x, block.constant(0.5), x)
    for _ in range(2):
        block.run()
    assert world.x.tolist() == [i + 20.0 * i + 1.0 if i in rows else i for i in range(5)]
    assert world.y.tolist() == [0.0, 10.0, 20.0, 30.0, 40.0]


@pytest.mark.parametrize("rows", [[1, 2], [3], [0, 4]])
def test_program_sees_changes_between_two_runs(rows: list[int]) -> None:
    world = five()
    block = RowProgram(world, np.array(rows), "x", "speed", written_from="speed")
    x, _, _, speed = block.values
    block.do(np.copyto, speed, x)
    world.x[:] = 7.0
    block.run()
    assert world.speed[rows].tolist() == [7.0] * len(rows)


def test_program_does_not_restore_unwritten_columns() -> None:
    world = five()
    block = RowProgram(world, np.array([3]), "x", "speed", written_from="yaw")
    block.do(block.values.fill, 4.0)
    block.run()
    assert (world.x[3], world.y[3], world.yaw[3], world.speed[3]) == (3.0, 30.0, 4.0, 4.0)
