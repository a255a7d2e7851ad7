"""Expressions that users write in files: `time > 2 and speed < 1.1 * limit` -> a function of named values.

The text is parsed by Python's own parser, and its tree is turned into closures: nothing is ever given to `eval`. There
are numbers, texts, True and False, names, arithmetic, comparisons, `and`, `or`, `not`, `a if c else b`, and the
functions of `FUNCTIONS`. There are no attributes, subscripts, calls of anything else, nor assignments. Length, depth,
number of parts and size of numbers are bounded, so an expression of a stranger costs at most some microseconds.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from keyword import iskeyword
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.suggestions import hint

__all__ = ["FUNCTIONS", "MAX_EXPRESSION_LENGTH", "Expression", "Value", "is_name", "parse_expression"]

Value = float | int | bool | str
"""A value of an expression; bool and int keep their types."""

MAX_EXPRESSION_LENGTH: Final = 500
"""Longest text [characters]."""

MAX_PARTS: Final = 200
"""Most operators, names and numbers together."""

MAX_EXPRESSION_DEPTH: Final = 100
"""Deepest nesting; Python's parser itself allows 200 parentheses."""

MAX_WHOLE: Final = 2**53
"""A whole number beyond this becomes a float, so that no number takes more than eight bytes."""

MAX_DIGITS: Final = 300
"""Longest whole number that is written out: it still is a float."""

_Part = Callable[[Mapping[str, Value]], Value]

_BINARY: Final[dict[type[ast.operator], Callable[[float, float], float]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: math.pow,
}
_COMPARE: Final[dict[type[ast.cmpop], Callable[[float, float], bool]]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


def _clamp(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


FUNCTIONS: Final[dict[str, tuple[int, int, Callable[..., float]]]] = {
    "abs": (1, 1, abs),
    "min": (2, 8, min),
    "max": (2, 8, max),
    "clamp": (3, 3, _clamp),
    "round": (1, 1, round),
    "floor": (1, 1, math.floor),
    "ceil": (1, 1, math.ceil),
    "sqrt": (1, 1, math.sqrt),
    "exp": (1, 1, math.exp),
    "log": (1, 1, math.log),
    "sin": (1, 1, math.sin),
    "cos": (1, 1, math.cos),
    "tan": (1, 1, math.tan),
    "atan2": (2, 2, math.atan2),
    "hypot": (2, 2, math.hypot),
    "radians": (1, 1, math.radians),
    "degrees": (1, 1, math.degrees),
}
"""Name -> fewest and most arguments, and the function. Angles are in radians."""

CONSTANTS: Final[dict[str, float]] = {"pi": math.pi, "inf": math.inf}


@dataclass(frozen=True, slots=True)
class Expression:
    """A parsed expression; call it with the values of its names.

    Attributes:
        text: as it was written.
        where: place in the user's file, for errors.
        names: the names that it reads.
    """

    text: str
    where: str
    names: frozenset[str]
    _work: _Part = field(repr=False, compare=False)

    def __call__(self, values: Mapping[str, Value]) -> Value:
        """Return the value of the expression.

        Args:
            values: by name; all of `names` are there.

        Raises:
            DocumentError: a division by zero, a text where a number is needed, or a number that is too large.
        """
        try:
            return self._work(values)
        except ZeroDivisionError:
            why = "a division by zero"
        except (OverflowError, ValueError):
            why = "a number outside the range of a function"
        except TypeError:
            why = "a text where a number is needed"
        raise DocumentError(f"{self.where}: {why} in {printable(self.text, 80)!r}")


def is_name(text: str) -> bool:
    """Return whether a text can be a name in expressions."""
    return text.isidentifier() and text.isascii() and not iskeyword(text) and text not in {*FUNCTIONS, *CONSTANTS}


def parse_expression(text: str, where: str, known: frozenset[str] | None = None) -> Expression:
    """Parse an expression.

    Args:
        text: the expression.
        where: place in the user's file, for errors.
        known: names that may be used; None for any.

    Returns:
        The expression.

    Raises:
        DocumentError: it is no expression, is too long or too deep, or uses a name that is not known. The text says
        where.
    """
    if len(text) > MAX_EXPRESSION_LENGTH:
        raise DocumentError(f"{where}: expected at most {MAX_EXPRESSION_LENGTH} characters, got {len(text):,}")
    shown = printable(text, 80)
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        why = error.msg if isinstance(error, SyntaxError) else "too deep"
        raise DocumentError(f"{where}: expected an expression such as 'speed < 20', got {shown!r}: {why}") from None
    builder = _Builder(where, shown, known)
    work = builder.build(tree.body, 0)
    return Expression(text, where, frozenset(builder.names), work)


class _Builder:
    """Turns a tree into closures; counts its parts."""

    def __init__(self, where: str, shown: str, known: frozenset[str] | None) -> None:
        self.names: set[str] = set()
        self._where, self._shown, self._known = where, shown, known
        self._parts = 0

    def build(self, node: ast.expr, depth: int) -> _Part:
        self._parts += 1
        if self._parts > MAX_PARTS or depth > MAX_EXPRESSION_DEPTH:
            raise DocumentError(
                f"{self._where}: expected at most {MAX_PARTS} parts, nested at most {MAX_EXPRESSION_DEPTH} deep,"
                f" got more in {self._shown!r}"
            )
        match node:
            case ast.Constant(value=bool() | int() | float() | str() as value):
                return self._constant(value)
            case ast.Name(id=name):
                return self._name(name)
            case ast.UnaryOp() | ast.BoolOp() | ast.IfExp():
                return self._logic(node, depth + 1)
            case ast.BinOp(op=op) if type(op) in _BINARY:
                function, left, right = (
                    _BINARY[type(op)],
                    self.build(node.left, depth + 1),
                    self.build(node.right, depth + 1),
                )
                return lambda values: _bounded(function(_number(left(values)), _number(right(values))))
            case ast.Compare():
                return self._comparison(node, depth)
            case ast.Call(func=ast.Name(id=name), keywords=[]):
                return self._call(name, node.args, depth + 1)
            case ast.Attribute(attr=name):
                raise self._error(f"expected a name without points, got '.{name}'")
        raise self._error("expected numbers, names, arithmetic, comparisons, and, or, not, if-else, and functions")

    def _error(self, what: str) -> DocumentError:
        return DocumentError(f"{self._where}: {what}, in {self._shown!r}")

    def _constant(self, value: Value) -> _Part:
        if isinstance(value, int) and abs(value) >= 10**MAX_DIGITS:
            raise self._error(f"expected numbers of at most {MAX_DIGITS} digits")
        kept = value if isinstance(value, str | bool) else _bounded(value)
        return lambda _values: kept

    def _name(self, name: str) -> _Part:
        if name in CONSTANTS:
            return self._constant(CONSTANTS[name])
        if self._known is not None and name not in self._known:
            near = hint(name, sorted(self._known)) or f"; there are {', '.join(sorted(self._known))}"
            raise self._error(f"no value {name!r}{near}")
        self.names.add(name)
        return lambda values: values[name]

    def _logic(self, node: ast.UnaryOp | ast.BoolOp | ast.IfExp, depth: int) -> _Part:
        if isinstance(node, ast.IfExp):
            asked, yes, no = (self.build(each, depth) for each in (node.test, node.body, node.orelse))
            return lambda values: yes(values) if asked(values) else no(values)
        if isinstance(node, ast.BoolOp):
            parts = [self.build(each, depth) for each in node.values]
            if isinstance(node.op, ast.And):
                return lambda values: all(part(values) for part in parts)
            return lambda values: any(part(values) for part in parts)
        one = self.build(node.operand, depth)
        if isinstance(node.op, ast.Not):
            return lambda values: not one(values)
        if isinstance(node.op, ast.Invert):
            raise self._error("expected not in place of ~")
        sign = -1 if isinstance(node.op, ast.USub) else 1
        return lambda values: sign * _number(one(values))

    def _comparison(self, node: ast.Compare, depth: int) -> _Part:
        parts = [self.build(each, depth + 1) for each in (node.left, *node.comparators)]
        tests: list[Callable[[Value, Value], bool]] = []
        for op in node.ops:
            if isinstance(op, ast.Eq):
                tests.append(operator.eq)
            elif isinstance(op, ast.NotEq):
                tests.append(operator.ne)
            elif type(op) in _COMPARE:
                tests.append(_ordered(_COMPARE[type(op)]))
            else:
                raise self._error("expected <, <=, >, >=, == or !=")

        def compare(values: Mapping[str, Value]) -> bool:
            left = parts[0](values)
            for test, part in zip(tests, parts[1:], strict=True):
                right = part(values)
                if not test(left, right):
                    return False
                left = right
            return True

        return compare

    def _call(self, name: str, given: list[ast.expr], depth: int) -> _Part:
        if name not in FUNCTIONS:
            raise self._error(f"no function {name}(){hint(name, FUNCTIONS)}; there are {', '.join(FUNCTIONS)}")
        least, most, function = FUNCTIONS[name]
        if not least <= len(given) <= most:
            raise self._error(f"{name}(): expected {least if least == most else f'{least} to {most}'} arguments")
        args = [self.build(each, depth) for each in given]
        return lambda values: _bounded(function(*[_number(arg(values)) for arg in args]))


def _number(value: Value) -> float:
    if isinstance(value, str):
        raise TypeError
    return value


def _ordered(test: Callable[[float, float], bool]) -> Callable[[Value, Value], bool]:
    return lambda left, right: test(_number(left), _number(right))


def _bounded(value: float) -> float:
    """Return a number of at most eight bytes."""
    if isinstance(value, int) and not -MAX_WHOLE <= value <= MAX_WHOLE:
        return float(value)
    return value
