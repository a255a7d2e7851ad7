"""Functions that equations of one car need beside `+ - * /`, for a Python float and for a `recorded.Value`.

Both give the same bits: roots are correctly rounded in both, and the few other functions are numpy's in both.
"""

from __future__ import annotations

import math
from typing import Final, Protocol, TypeVar

import numpy as np

from rosbridge_sim.world.geometry.planar import wrap_angle
from rosbridge_sim.world.state.recorded_equations import Value

__all__ = ["FLOATS", "Operators", "V"]

V = TypeVar("V", float, Value)
"""A number of one car, or one number for each car."""


class Operators(Protocol[V]):
    """Functions that differ for floats and arrays; the results have the same bits."""

    def least(self, a: V, b: V | float, /) -> V:
        """Return the smaller one; 0 without a sign."""

    def most(self, a: V, b: V | float, /) -> V:
        """Return the greater one; 0 without a sign."""

    def pick(self, condition: V, if_positive: V | float, otherwise: V | float, /) -> V:
        """Return the second argument where the first one is positive, else the third one."""

    def is_any(self, a: V, /) -> bool:
        """Return whether any number may be positive."""

    def magnitude(self, a: V, /) -> V:
        """Return the amount."""

    def root(self, a: V, /) -> V:
        """Return the square root of a number >= 0."""

    def sin(self, a: V, /) -> V:
        """Return the sine."""

    def cos(self, a: V, /) -> V:
        """Return the cosine."""

    def arctan(self, a: V, /) -> V:
        """Return the arc tangent."""

    def wrap(self, a: V, /) -> V:
        """Return an angle within (-pi, pi]; one inside keeps its bits."""


class _Floats:
    """Operators of single floats. The functions of numpy get an array of one element, which they write into."""

    def __init__(self) -> None:
        self._cell = np.zeros(1)

    def least(self, a: float, b: float, /) -> float:
        return (b if b < a else a) + 0.0  # noqa: FURB136 - `min` takes three times as long

    def most(self, a: float, b: float, /) -> float:
        return (b if b > a else a) + 0.0  # noqa: FURB136 - the same

    def pick(self, condition: float, if_positive: float, otherwise: float, /) -> float:
        return if_positive if condition > 0.0 else otherwise

    def is_any(self, a: float, /) -> bool:
        return a > 0.0

    def magnitude(self, a: float, /) -> float:
        return abs(a)

    def root(self, a: float, /) -> float:
        return math.sqrt(a)

    def sin(self, a: float, /) -> float:
        cell = self._cell
        cell[0] = a
        np.sin(cell, cell)
        return cell.item()

    def cos(self, a: float, /) -> float:
        cell = self._cell
        cell[0] = a
        np.cos(cell, cell)
        return cell.item()

    def arctan(self, a: float, /) -> float:
        cell = self._cell
        cell[0] = a
        np.arctan(cell, cell)
        return cell.item()

    def wrap(self, a: float, /) -> float:
        return a if -math.pi < a <= math.pi else wrap_angle(a).item()


FLOATS: Final[Operators[float]] = _Floats()
