"""The search for the worst parameters: CMA-ES by the library `cma`, asked and told in batches.

The method is that of Hansen and Ostermeier (2001). It works on shares 0..1 of the ranges. A run that failed by an error
counts as harmless, so that the search does not end in a corner where nothing can be driven. The least value is the
worst; among failed runs the order stays that of the expression.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from rosbridge_sim.campaigns.campaign_model import CampaignDocument
from rosbridge_sim.campaigns.parameter_sets import place_in, ranges_of
from rosbridge_sim.campaigns.run_results import SCORES, Point, Result
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import parse_expression

HARMLESS: Final = 1e6
"""Value of a run that nothing can be said about, and the most that counts: an infinite time to collision is this."""

SIGMA: Final = 0.3
"""First step, as a share of the ranges: cma's advice for a box of 1."""


MakeStrategy = Callable[[list[float], float, dict[str, Any]], Any]
"""Makes an object with `ask`, `tell`, `stop` and `popsize`, as cma has it; the library publishes no types."""


class Search:
    """A search for the parameters of the worst run.

    Attributes:
        num_asked: runs so far.

    Args:
        document: the campaign; its parameters have ranges.
        source: name of the file, for errors.
        make: `cma.CMAEvolutionStrategy`, which takes the first place, the first step, and options.

    Raises:
        DocumentError: a range or the expression cannot be used.
    """

    def __init__(self, document: CampaignDocument, source: str, make: MakeStrategy) -> None:
        assert document.search is not None
        self._items = ranges_of(document, source)
        self._budget = document.search.budget
        self._worst = parse_expression(
            document.search.worst, f"{source}: search.worst", frozenset({*SCORES, *self._items})
        )
        self.num_asked = 0
        self._asked: list[Any] = []
        num = max(len(self._items), 2)  # cma has no search in one dimension; the second one changes nothing
        options = {"seed": document.search.seed, "bounds": [0.0, 1.0], "verbose": -9, "maxfevals": self._budget}
        self._cma = make(num * [0.5], SIGMA, options)

    def ask(self) -> list[Point]:
        """Return the next sets of parameters; empty when the budget is spent or the search has come to rest."""
        if self.num_asked >= self._budget or self._cma.stop():
            return []
        self._asked = self._cma.ask()[: self._budget - self.num_asked]
        self.num_asked += len(self._asked)
        return [
            {
                name: place_in(item, float(share))
                for (name, item), share in zip(self._items.items(), shares, strict=False)
            }
            for shares in self._asked
        ]

    def tell(self, results: Sequence[Result]) -> None:
        """Learn from the results of the last `ask`.

        Args:
            results: one for each set, in the same order.
        """
        if len(self._asked) == self._cma.popsize:
            self._cma.tell(self._asked, [self._value(result) for result in results])

    def _value(self, result: Result) -> float:
        if not result.scores or result.verdict in {"error", "skipped"}:
            return HARMLESS
        try:
            value = float(self._worst({**result.run.parameters, **result.scores}))
        except (DocumentError, ValueError):
            return HARMLESS
        return HARMLESS if math.isnan(value) else max(-HARMLESS, min(value, HARMLESS))
