"""Rules of drivers, written once: for arrays of many drivers, and for the numbers of one driver.

A rule is a function of numbers that gets the functions that it needs beside `+ - * /` as its first argument. With
`ARRAYS` it computes with arrays, one number for each driver. `written` makes a function of single floats of it. Both
give the same bits: each operation is rounded correctly in both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final, Protocol, TypeVar

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.state.written_equations import Script, Term, WrittenOperators

V = TypeVar("V", Term, FloatArray)
"""A number of one driver, or one number for each driver."""


class RuleOperators(Protocol[V]):
    """Functions that differ for terms and arrays; the results have the same bits."""

    def least(self, a: V, b: V | float, /) -> V:
        """Return the smaller one."""

    def most(self, a: V, b: V | float, /) -> V:
        """Return the greater one."""

    def pick(self, condition: V, if_positive: V | float, otherwise: V | float, /) -> V:
        """Return the second argument where the first one is positive, else the third one."""

    def root(self, a: V, /) -> V:
        """Return the square root of a number >= 0."""


class _ArrayOperators:
    least, most, root = np.fmin, np.fmax, np.sqrt

    def pick(
        self, condition: FloatArray, if_positive: FloatArray | float, otherwise: FloatArray | float, /
    ) -> FloatArray:
        return np.where(condition > 0.0, if_positive, otherwise)


ARRAYS: Final = _ArrayOperators()


@cache
def written(rule: Callable[..., Any], num: int) -> Callable[..., tuple[float, ...]]:
    """Return a rule as a function of `num` floats, which returns the floats that the rule returns.

    Args:
        rule: gets operators and `num` numbers; returns a number or several.
    """
    script = Script(num)
    results = rule(WrittenOperators(script, is_any=True), *script.given)
    return script.compile_rule(results if isinstance(results, Sequence) else (results,))
