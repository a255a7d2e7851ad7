"""Grids around egos: against each cell and entity looked at one by one."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim import Worlds
from rosbridge_sim.world.vehicle.ground import are_on_road
from rosbridge_sim.worlds.occupancy import num_cells


def slow_grid(worlds: Worlds, size: float, step: float) -> np.ndarray:
    world, row = worlds.world(0), 0
    num = round(size / step)
    grid = np.zeros((4, num, num))
    cos, sin = np.cos(world.yaw[row]), np.sin(world.yaw[row])
    entities = []
    for other in np.flatnonzero(world.alive):
        x = world.x[other] + world.centre[other] * np.cos(world.yaw[other]) - world.x[row]
        y = world.y[other] + world.centre[other] * np.sin(world.yaw[other]) - world.y[row]
        if other != row:
            entities.append((np.hypot(x, y), other, x * cos + y * sin, y * cos - x * sin))
    for i in range(num):
        for j in range(num):
            ahead, left = (i + 0.5) * step - 0.5 * size, (j + 0.5) * step - 0.5 * size
            x, y = world.x[row] + ahead * cos - left * sin, world.y[row] + ahead * sin + left * cos
            grid[3, i, j] = are_on_road(world.roads, np.array([x]), np.array([y]), world.z[[row]])[0]
            for _, other, forward, aside in sorted(entities):
                turn = world.yaw[other] - world.yaw[row]
                east, north = ahead - forward, left - aside
                along = abs(east * np.cos(turn) + north * np.sin(turn))
                across = abs(north * np.cos(turn) - east * np.sin(turn))
                is_in_box = along <= world.half_length[other] and across <= world.half_width[other]
                if is_in_box or max(abs(east), abs(north)) <= 0.5 * step:
                    grid[0, i, j] = 1.0
                    grid[1, i, j] = world.speed[other] * np.cos(turn) - world.speed[row]
                    grid[2, i, j] = world.speed[other] * np.sin(turn)
                    break
    return grid


@pytest.mark.parametrize(("scenario", "size", "step"), [("parking", 30.0, 2.0), ("town", 60.0, 4.0)])
def test_grid_has_the_entities_and_the_road(scenario: str, size: float, step: float) -> None:
    worlds = Worlds(scenario, seed=3)
    x, y, yaw = (float(values[0, 0]) for values in worlds.egos(("x", "y", "yaw")).values())
    worlds.place(0, x=x, y=y, yaw=yaw + 0.4, speed=2.0)
    worlds.spawn(0, "2015_Kia_K5", x=x + 6.0, y=y + 3.0, yaw=yaw + 1.0, speed=5.0)
    grid = worlds.grids(size, step)[0, 0]
    assert grid == pytest.approx(slow_grid(worlds, size, step), abs=1e-9)
    assert grid[0].sum() >= 1.0
    assert 0.0 < grid[3].mean() < 1.0


def test_largest_grid_is_allowed_and_a_cell_is_the_least() -> None:
    assert (num_cells(256.0, 1.0), num_cells(0.4, 1.0), num_cells(2.6, 1.0)) == (256, 1, 3)
    for size, step in ((0.0, 1.0), (1.0, 0.0), (256.5, 1.0), (float("nan"), 1.0)):
        with pytest.raises(ValueError, match="size, step"):
            num_cells(size, step)


def test_grids_of_worlds_with_different_crowds_have_their_own_alone() -> None:
    worlds = Worlds("loop", 2)
    for world in range(2):
        for uid in worlds.world(world).uid[: worlds.world(world).n][1:].tolist():
            worlds.remove(world, uid)
    x, y, yaw = (float(values[0, 0]) for values in worlds.egos(("x", "y", "yaw")).values())
    worlds.spawn(1, "2015_Kia_K5", x=x + 9.0 * np.cos(yaw), y=y + 9.0 * np.sin(yaw), yaw=yaw)
    grids = worlds.grids(40.0, 2.0)
    assert grids[0, 0, :3].sum() == 0.0
    assert grids[1, 0, 0].sum() > 0.0


def test_grids_of_too_many_cells_are_refused() -> None:
    with pytest.raises(ValueError, match=r"size, step: expected 1\.\.256 cells a side, got 300 and 1"):
        Worlds("loop").grids(300, 1)
