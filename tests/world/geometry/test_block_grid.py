"""Boxes by the cells that they lie in."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.geometry import block_grid
from rosbridge_sim.world.geometry.block_grid import BlockGrid


@pytest.mark.parametrize("part", [1, 7, 1 << 15])
def test_boxes_near_a_place_are_found_for_any_size_of_parts(monkeypatch: pytest.MonkeyPatch, part: int) -> None:
    monkeypatch.setattr(block_grid, "PART", part)
    chance = np.random.default_rng(3)
    low = chance.uniform(-200.0, 200.0, (60, 2))
    high = low + chance.uniform(0.0, 30.0, (60, 2))
    places = chance.uniform(-200.0, 200.0, (40, 2))
    index, box = BlockGrid(low, high, 5.0, 10.0).find(places)
    found = set(zip(index.tolist(), box.tolist(), strict=True))
    assert len(found) == len(index)
    assert [(i, b) for i, b in zip(index.tolist(), box.tolist(), strict=True)] == sorted(found)
    away = np.maximum(low - places[:, None], places[:, None] - high).max(axis=2)
    assert {(i, b) for i, b in np.argwhere(away <= 5.0).tolist()} <= found
    assert {(i, b) for i, b in np.argwhere(away > 40.0).tolist()}.isdisjoint(found)


def test_grid_without_boxes_finds_nothing() -> None:
    index, box = BlockGrid(np.zeros((0, 2)), np.zeros((0, 2))).find(np.zeros((3, 2)))
    assert len(index) == len(box) == 0
