"""The two parameters that together explain most of what came out, for the first picture of the report.

They are judged as the picture is looked at: does a run end as its neighbours in the plane of the two do? The measure is
the share of the variance of the outcome that the mean of the nearest other runs explains. So a border that runs across
the plane counts, of which neither parameter alone shows much, and what chance puts in order among few samples does not.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.campaigns.run_results import BAD
from rosbridge_sim.campaigns.tables import Cell

NUM_NEIGHBOURS: Final = 5

NEIGHBOURS_ALONE: Final = 8
"""Along one parameter alone the neighbours are every eighth run, if these are more: the others differ in all else, and
the mean of five of them is mostly chance."""

MAX_LOOKED_AT: Final = 200
"""Most runs of a driver, most parameters and most drivers that are looked at, so that the work stays below a second."""
MAX_PARAMETERS: Final = 6
MAX_DRIVERS: Final = 3

OUTCOMES: Final = ("min_time_to_collision", "max_lane_offset", "max_jerk", "distance")
"""Scores that are looked at where all verdicts are the same; the first one that differs."""


def strongest_parameters(columns: Mapping[str, Sequence[Cell]], names: Sequence[str]) -> list[str]:
    """Return the two parameters that explain most of the verdicts, or of a score where all verdicts are the same.

    Args:
        names: of the columns of parameters; those that are no numbers are left out.

    Returns:
        The names, in their order in the table; fewer if there are fewer.
    """
    driven = [i for i, verdict in enumerate(columns["verdict"]) if verdict != "skipped"]
    numeric = [
        name
        for name in names
        if driven and all(type(columns[name][i]) in {int, float} for i in driven)  # a switch is none
    ]
    if len(numeric) <= 2:  # noqa: PLR2004 - a picture has two axes
        return numeric
    outcome = _outcome(columns, driven)
    by_driver: dict[str, list[int]] = {}
    for k, i in enumerate(driven):
        by_driver.setdefault(str(columns["driver"][i]), []).append(k)
    parts = [rows[:: -(-len(rows) // MAX_LOOKED_AT)] for rows in list(by_driver.values())[:MAX_DRIVERS]]
    places = {name: _ranks([columns[name][i] for i in driven]) for name in numeric}

    def strength(chosen: Iterable[str]) -> float:
        plane = np.stack([places[name] for name in chosen], axis=1)
        return sum(_explained(plane[rows], outcome[rows]) for rows in parts)

    if len(numeric) > MAX_PARAMETERS:
        first = sorted(numeric, key=lambda name: -strength([name]))[:MAX_PARAMETERS]
        numeric = [name for name in numeric if name in first]
    return list(max(combinations(numeric, 2), key=strength))


def _outcome(columns: Mapping[str, Sequence[Cell]], driven: Sequence[int]) -> npt.NDArray[np.float64]:
    """Return a number for each run: whether it is bad, or its rank by a score, which may be infinite."""
    bad = np.array([columns["verdict"][i] in BAD for i in driven], dtype=np.float64)
    if np.ptp(bad) == 0.0:
        for name in OUTCOMES:
            ranks = _ranks([columns[name][i] for i in driven])
            if np.ptp(ranks) > 0.0:
                return ranks
    return bad


def _ranks(values: Sequence[Cell]) -> npt.NDArray[np.float64]:
    """Return the ranks of numbers as shares of the greatest rank, so that the unit of a parameter does not count."""
    numbers = np.array([np.nan if value is None else float(value) for value in values])
    ranks = np.unique(numbers, return_inverse=True)[1].astype(np.float64)
    return ranks / max(float(ranks.max()), 1.0)


def _explained(places: npt.NDArray[np.float64], outcome: npt.NDArray[np.float64]) -> float:
    """Return the share of the variance that the neighbours explain; 0 where nothing differs."""
    variance = float(outcome.var())
    num = NUM_NEIGHBOURS if places.shape[1] > 1 else max(NUM_NEIGHBOURS, len(outcome) // NEIGHBOURS_ALONE)
    if variance == 0.0 or len(outcome) <= num:
        return 0.0
    distances = np.square(places[:, None] - places[None]).sum(axis=-1)
    np.fill_diagonal(distances, np.inf)
    nearest = np.argsort(distances, axis=1, kind="stable")[:, :num]
    return max(1.0 - float(np.square(outcome - outcome[nearest].mean(axis=1)).mean()) / variance, 0.0)
