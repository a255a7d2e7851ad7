from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.geometry import neighbours
from rosbridge_sim.world.geometry.neighbours import find_neighbours

SEED = 3


def test_neighbours_are_those_within_the_reach() -> None:
    x, y = np.random.default_rng(SEED).uniform(-20.0, 20.0, (2, 300))
    place, other = find_neighbours(x[:100], y[:100], x, y, 3.0)
    is_near = np.hypot(x[:100, None] - x, y[:100, None] - y) < 3.0
    assert (place.tolist(), other.tolist()) == tuple(indices.tolist() for indices in is_near.nonzero())


def test_pairs_of_a_heap_are_bounded() -> None:
    heap = np.zeros(2_000)
    place, _ = find_neighbours(heap, heap, heap, heap, 3.0)
    assert 2_000 <= len(place) <= neighbours.MAX_COMPARED, "it has 4,000,000"
    assert len(set(np.bincount(place).tolist())) == 1, "all have as many"


def test_heap_takes_no_neighbour_from_places_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(neighbours, "MAX_COMPARED", 3_000)
    x = np.append(np.zeros(500), [50.0, 51.0, 52.0])
    place, other = find_neighbours(x, np.zeros(503), x, np.zeros(503), 3.0)
    is_elsewhere = place >= 500
    assert list(zip(place[is_elsewhere], other[is_elsewhere], strict=True)) == [
        (a, b) for a in (500, 501, 502) for b in (500, 501, 502)
    ]
    assert len(place) <= 3_000
