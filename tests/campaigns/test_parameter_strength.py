"""The parameters that a report shows first are those that explain what came out."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rosbridge_sim.campaigns.parameter_strength import strongest_parameters
from rosbridge_sim.campaigns.tables import Cell

NAMES = ["a", "b", "c", "word", "switch"]


def columns_of(bad: Callable[[float, float, float], bool], num: int = 80) -> dict[str, list[Cell]]:
    """A table of samples of three numbers, a text and a switch, each driven by two drivers."""
    points = np.random.default_rng(3).random((num, 3)).tolist()
    rows = [(driver, *point) for point in points for driver in ("one", "two")]
    columns: dict[str, list[Cell]] = {"driver": [row[0] for row in rows]}
    for k, name in enumerate("abc"):
        columns[name] = [row[k + 1] for row in rows]
    columns["word"] = ["x"] * len(rows)
    columns["switch"] = [i % 2 == 0 for i in range(len(rows))]
    columns["verdict"] = ["fail" if bad(*row[1:]) else "pass" for row in rows]
    columns["min_time_to_collision"] = [1.0 / row[3] if row[3] > 0.5 else math.inf for row in rows]
    return columns


@pytest.mark.parametrize(
    ("bad", "found"),
    [
        (lambda _a, b, c: b + c > 1.2, ["b", "c"]),
        (lambda a, _b, c: abs(c - 0.5) < 0.1 or a > 0.8, ["a", "c"]),
        (lambda a, b, _c: a < 0.3 and b < 0.6, ["a", "b"]),
        (lambda a, b, _c: (a < 0.5) != (b < 0.5), ["a", "b"]),  # of which neither alone shows anything
    ],
)
def test_parameters_that_decide_are_found_also_by_a_band_in_the_middle(
    bad: Callable[[float, float, float], bool], found: list[str]
) -> None:
    assert strongest_parameters(columns_of(bad), NAMES) == found


def test_two_of_many_parameters_are_found() -> None:
    columns = columns_of(lambda a, b, _c: a + b > 1.2)
    rng = np.random.default_rng(5)
    others = {f"other{i}": rng.random(len(columns["a"])).tolist() for i in range(6)}
    assert strongest_parameters({**others, **columns}, [*others, "b", "c", "a"]) == ["b", "a"]


def test_score_counts_where_all_runs_pass() -> None:
    assert "c" in strongest_parameters(columns_of(lambda *_: False), NAMES)


def test_table_without_runs_or_with_skipped_ones_has_no_order_but_that_of_the_table() -> None:
    columns = columns_of(lambda *_: True)
    assert strongest_parameters({name: [] for name in columns}, NAMES) == []
    columns["verdict"] = ["skipped"] * len(columns["verdict"])
    assert strongest_parameters(columns, NAMES) == []
