"""Sets of parameters of a campaign: grids, lists, chance, and Latin hypercubes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from rosbridge_sim.campaigns.campaign_model import MAX_RUNS, MAX_VALUES, CampaignDocument, ParameterItem, ParameterValue
from rosbridge_sim.campaigns.run_results import Point
from rosbridge_sim.errors import DocumentError

_DIGITS: Final = 12
"""Significant digits of computed values: 0.1 + 0.2 is 0.3, in the table and in the world."""


def expand_parameters(document: CampaignDocument, source: str) -> list[Point]:
    """Return the sets of parameters that a campaign drives, in the order of its table.

    Args:
        document: the campaign; one that searches has none but the fixed ones.
        source: name of the file, for errors.

    Returns:
        The sets, at least one.

    Raises:
        DocumentError: a parameter lacks what the sampling needs, or there are too many sets.
    """
    items = {name: _item(value) for name, value in document.parameters.items()}
    if not items:
        return [{}]
    _check_numbers(items, document, source)
    if document.sampling in {"random", "latin hypercube"}:
        return _draw(items, document)
    columns = {name: _values_of(item, f"{source}: parameters.{name}") for name, item in items.items()}
    if document.sampling == "list":
        lengths = {name: len(values) for name, values in columns.items()}
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise DocumentError(
                f'{source}: sampling "list": expected equally many values of each parameter, got {told}'
            )
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return [dict(zip(columns, row, strict=True)) for row in itertools.product(*columns.values())]


def ranges_of(document: CampaignDocument, source: str) -> dict[str, ParameterItem]:
    """Return the parameters that a search varies.

    Args:
        source: name of the file, for errors.

    Raises:
        DocumentError: there is none, or one has no range.
    """
    items = {name: _item(value) for name, value in document.parameters.items()}
    for name, item in items.items():
        if item.low is None or item.high is None or item.low == item.high:
            raise DocumentError(f"{source}: parameters.{name}: a search needs a range: low and high")
    if not items:
        raise DocumentError(f"{source}: parameters: a search needs at least one with low and high")
    return items


def middle_of(document: CampaignDocument, source: str) -> Point:
    """Return the middle of the ranges of a search; arguments and errors as for `ranges_of`."""
    return {name: place_in(item, 0.5) for name, item in ranges_of(document, source).items()}


def has_switch(value: ParameterItem | Sequence[ParameterValue]) -> bool:
    """Return whether `true` or `false` is among the values of a parameter."""
    return any(isinstance(each, bool) for each in _item(value).values or ())


def place_in(item: ParameterItem, share: float) -> ParameterValue:
    """Return the value at a share of a range, or of a list.

    Args:
        share: 0 to 1.
    """
    if item.values is not None:
        return item.values[min(int(share * len(item.values)), len(item.values) - 1)]
    assert item.low is not None
    assert item.high is not None
    value = item.low + (item.high - item.low) * share
    return round(value) if item.whole else tidy(value)


def tidy(value: float) -> float:
    """Return a number with twelve significant digits."""
    return float(f"{value:.{_DIGITS}g}")


def _item(value: ParameterItem | Sequence[ParameterValue]) -> ParameterItem:
    return value if isinstance(value, ParameterItem) else ParameterItem(values=list(value))


def _check_numbers(items: Mapping[str, ParameterItem], document: CampaignDocument, source: str) -> None:
    """Refuse too many sets, before they are made.

    Raises:
        DocumentError: there are too many.
    """
    lengths = [item.num or 1 if item.values is None else len(item.values) for item in items.values()]
    if document.sampling == "grid" and (num := math.prod(lengths)) > MAX_RUNS:
        got = f"{num:,}" if num < MAX_RUNS**3 else "far more"
        raise DocumentError(f"{source}: parameters: expected at most {MAX_RUNS:,} sets, got {got}; take fewer values")
    num = len(items) * document.samples if document.sampling in {"random", "latin hypercube"} else sum(lengths)
    if num > MAX_VALUES:
        raise DocumentError(f"{source}: parameters: expected at most {MAX_VALUES:,} values together, got {num:,}")


def _values_of(item: ParameterItem, where: str) -> Sequence[ParameterValue]:
    if item.values is not None:
        return item.values
    if item.num is None:
        raise DocumentError(f"{where}: a grid needs num, the number of values from low to high")
    shares = [i / (item.num - 1) for i in range(item.num)] if item.num > 1 else [0.5]
    return [place_in(item, share) for share in shares]


def _draw(items: Mapping[str, ParameterItem], document: CampaignDocument) -> list[Point]:
    """Draw sets by chance; of a Latin hypercube each n-th part of each range has exactly one of n values."""
    rng, num = np.random.default_rng(document.sampling_seed), document.samples
    columns: dict[str, list[ParameterValue]] = {}
    for name, item in items.items():
        shares = rng.random(num)
        if document.sampling == "latin hypercube":
            shares = (rng.permutation(num) + shares) / num
        columns[name] = [place_in(item, share) for share in shares.tolist()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
