"""The state that all parts of a bus share."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.bus_state import earliest


@pytest.mark.parametrize(
    ("one", "other", "first"),
    [(None, None, None), (1.0, None, 1.0), (None, 2.0, 2.0), (2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (0.0, None, 0.0)],
)
def test_never_is_later_than_any_time(one: float | None, other: float | None, first: float | None) -> None:
    assert earliest(one, other) == first
