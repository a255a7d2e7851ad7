"""Rules of drivers give the same bits for arrays and for single numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_model import drive_free, firm_stop, follow, gap_wanted, keep_gap, stop
from rosbridge_sim.world.drivers.look_rules import foresee, slow_down
from rosbridge_sim.world.drivers.rule_operators import ARRAYS, written
from rosbridge_sim.world.geometry.planar import FloatArray

NUM = 400

SPEED, GAP, ACCEL, OWN, FACTOR = (0.0, 30.0), (0.01, 90.0), (-8.0, 3.0), (0.6, 2.6), (0.7, 1.3)
FIGURES = [OWN, OWN, FACTOR]
HERE = [(0.0, 50.0), (0.0, 50.0), (2.0, 900.0), (-4.0, 4.0), (2.0, 900.0), (-4.0, 4.0)]

RULES: list[tuple[Callable[..., Any], list[tuple[float, float]]]] = [
    (drive_free, [SPEED, SPEED, SPEED, OWN]),
    (stop, [ACCEL, SPEED, (-2.0, 60.0)]),
    (follow, [SPEED, GAP, SPEED, ACCEL, *FIGURES]),
    (gap_wanted, [SPEED, (-30.0, 30.0), *FIGURES]),
    (keep_gap, [OWN, GAP, GAP]),
    (firm_stop, [SPEED, ACCEL, (0.2, 0.6)]),
    (foresee, [SPEED, ACCEL, (1.0, 9.0), OWN, FACTOR, *FIGURES, (0.2, 0.6), *HERE]),
    (slow_down, [GAP, GAP, OWN, FACTOR, FACTOR, (0.0, 90.0), *[(2.0, 900.0)] * 4]),
]


def columns(ranges: list[tuple[float, float]]) -> list[FloatArray]:
    """Random numbers; a third of them are whole, or one of the ends, so that differences are 0 and ties occur."""
    rng = np.random.default_rng(len(ranges))
    found = []
    for low, high in ranges:
        values = rng.uniform(low, high, NUM)
        values[::3] = np.clip(np.rint(values[::3]), low, high)
        values[::11] = rng.choice([low, high], len(values[::11]))
        found.append(values + 0.0)  # no -0.0: nothing that drivers see has it
    return found


@pytest.mark.parametrize(("rule", "ranges"), RULES, ids=[rule.__name__ for rule, _ in RULES])
def test_rule_has_the_same_bits_for_arrays_and_for_single_numbers(
    rule: Callable[..., Any], ranges: list[tuple[float, float]]
) -> None:
    given = columns(ranges)
    results = rule(ARRAYS, *given)
    many = np.array(results if isinstance(results, tuple) else [results])
    one = written(rule, len(ranges))
    single = np.array([one(*row) for row in zip(*[column.tolist() for column in given], strict=True)]).T
    assert many.tobytes() == np.ascontiguousarray(single).tobytes()


def test_rule_is_written_once() -> None:
    assert written(stop, 3) is written(stop, 3)
