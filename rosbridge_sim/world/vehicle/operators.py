"""Functions that equations of one car need beside `+ - * /`, for a written `Term` and for a recorded `Value`.

Both give the same bits: roots are correctly rounded in both, and the few other functions are numpy's in both.
"""

from __future__ import annotations

from typing import Protocol, TypeVar

from rosbridge_sim.world.state.recorded_equations import Value
from rosbridge_sim.world.state.written_equations import Term

V = TypeVar("V", Term, Value)
"""A number of one car, or one number for each car."""


class Operators(Protocol[V]):
    """Functions that differ for terms and values; the results have the same bits."""

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
