"""Equations written with `+ - * /`, written out once as the source of one Python function of single floats.

A function that computes with numbers gets `Term`s in their place. Each operation on them adds a line to a `Script`, and
`compile` makes a function of the lines. It has no calls but those that numbers need, so it takes half of the time of
the equations themselves. `recorded_equations` does the same for arrays; both give the same bits.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, wrap_angle

_NAME: Final = re.compile(r"\bb\d+\b")
"""A name that a line gives to a number."""

_MADE_AND_USED: Final = 2
"""Places where such a name stands if the number is used once: the line that makes it, and the one that uses it."""


class Term:
    """A number that the function will have."""

    __slots__ = ("_script", "name")

    def __init__(self, script: Script, name: str) -> None:
        self._script = script
        self.name = name

    def __add__(self, other: Term | float) -> Term:
        return self._script.write("{} + {}", self, other)

    def __radd__(self, other: float) -> Term:
        return self._script.write("{} + {}", other, self)

    def __sub__(self, other: Term | float) -> Term:
        return self._script.write("{} - {}", self, other)

    def __rsub__(self, other: float) -> Term:
        return self._script.write("{} - {}", other, self)

    def __mul__(self, other: Term | float) -> Term:
        return self._script.write("{} * {}", self, other)

    def __rmul__(self, other: float) -> Term:
        return self._script.write("{} * {}", other, self)

    def __truediv__(self, other: Term | float) -> Term:
        return self._script.write("{} / {}", self, other)

    def __rtruediv__(self, other: float) -> Term:
        return self._script.write("{} / {}", other, self)

    def __neg__(self) -> Term:
        return self._script.write("-{}", self)


class Script:
    """The lines of a function of some numbers.

    Attributes:
        given: the numbers that the function gets.
    """

    def __init__(self, num: int) -> None:
        self.given = [Term(self, f"a{i}") for i in range(num)]
        self.lines = [f"{', '.join(term.name for term in self.given)}, = given"]

    def write(self, form: str, *args: Term | float) -> Term:
        """Add a line that computes one number.

        Args:
            form: an expression, with `{}` or `{0}`, `{1}` for the arguments.
            args: terms of this script, or finite numbers.
        """
        term = Term(self, f"b{len(self.lines)}")
        names = [arg.name if isinstance(arg, Term) else f"({float(arg)!r})" for arg in args]
        self.lines.append(f"{term.name} = {form.format(*names)}")
        return term

    def write_cell(self, function: str, arg: Term) -> Term:
        """Add lines that compute a function of numpy: as for an array of one number, which has its own rounding."""
        self.lines += [f"cell[0] = {arg.name}", f"{function}(cell, cell)"]
        return self.write("cell.item()")

    def compile(self, results: Sequence[Term]) -> Callable[[Sequence[float], FloatArray], tuple[float, ...]]:
        """Return the function.

        It takes the numbers of `given` and an array of one number, which it uses meanwhile; it returns the numbers of
        `results`. The array is the caller's, so that worlds in several threads can share the function.
        """
        function: Callable[[Sequence[float], FloatArray], tuple[float, ...]] = self._make("given, cell", 0, results)
        return function

    def compile_rule(self, results: Sequence[Term]) -> Callable[..., tuple[float, ...]]:
        """Return a function that takes the numbers of `given` one by one, for lines without functions of numpy."""
        return self._make(", ".join(term.name for term in self.given), 1, results)

    def _make(self, parameters: str, begin: int, results: Sequence[Term]) -> Callable[..., tuple[float, ...]]:
        lines = _nest([*self.lines[begin:], f"return {', '.join(term.name for term in results)},"])
        source = f"def function({parameters}):\n" + "".join(f"    {line}\n" for line in lines)
        space: dict[str, Any] = {"sin": np.sin, "cos": np.cos, "arctan": np.arctan, "sqrt": math.sqrt, "wrap": _wrap}
        exec(compile(source, f"<equations of {len(self.given)} numbers>", "exec"), space)  # noqa: S102 - our own lines
        function: Callable[..., tuple[float, ...]] = space["function"]
        return function


class WrittenOperators:
    """The functions of `operators.Operators` for terms.

    Args:
        script: gets the lines.
        is_any: the answer to every `is_any`.
    """

    forms: ClassVar[Mapping[str, str]] = {
        "least": "({1} if {1} < {0} else {0}) + 0.0",
        "most": "({1} if {1} > {0} else {0}) + 0.0",
        "pick": "{1} if {0} > 0.0 else {2}",
        "magnitude": "abs({})",
        "root": "sqrt({})",
        "wrap": f"{{0}} if {-math.pi!r} < {{0}} <= {math.pi!r} else wrap({{0}})",
    }

    def __init__(self, script: Script, *, is_any: bool) -> None:
        self._script = script
        self._is_any = is_any

    def least(self, a: Term, b: Term | float, /) -> Term:
        """Return the smaller one; 0 without a sign."""
        return self._script.write(self.forms["least"], a, b)

    def most(self, a: Term, b: Term | float, /) -> Term:
        """Return the greater one; 0 without a sign."""
        return self._script.write(self.forms["most"], a, b)

    def pick(self, condition: Term, if_positive: Term | float, otherwise: Term | float, /) -> Term:
        """Return the second argument where the first one is positive, else the third one."""
        return self._script.write(self.forms["pick"], condition, if_positive, otherwise)

    def is_any(self, _a: Term, /) -> bool:
        """Return what the script is written for."""
        return self._is_any

    def magnitude(self, a: Term, /) -> Term:
        """Return the amount."""
        return self._script.write(self.forms["magnitude"], a)

    def root(self, a: Term, /) -> Term:
        """Return the square root of a number >= 0."""
        return self._script.write(self.forms["root"], a)

    def sin(self, a: Term, /) -> Term:
        """Return the sine."""
        return self._by_numpy("sin", a)

    def cos(self, a: Term, /) -> Term:
        """Return the cosine."""
        return self._by_numpy("cos", a)

    def arctan(self, a: Term, /) -> Term:
        """Return the arc tangent."""
        return self._by_numpy("arctan", a)

    def wrap(self, a: Term, /) -> Term:
        """Return an angle within (-pi, pi]; one inside keeps its bits."""
        return self._script.write(self.forms["wrap"], a)

    def _by_numpy(self, function: str, a: Term) -> Term:
        return self._script.write_cell(function, a)


def _nest(lines: Sequence[str]) -> list[str]:
    """Return lines with each number that is used once in the place where it is used: it needs no name then."""
    nested: dict[str, str] = {}
    uses = Counter(word for line in lines for word in _NAME.findall(line))
    left = []
    for each in lines:
        line = _NAME.sub(lambda found: nested.get(found[0], found[0]), each)
        name, _, expression = line.partition(" = ")
        if uses[name] == _MADE_AND_USED and "cell" not in line:
            nested[name] = f"({expression})"
        else:
            left.append(line)
    return left


def _wrap(angle: float) -> float:
    return float(wrap_angle(angle))
