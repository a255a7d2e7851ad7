"""Expressions that users write in files: `time > 2 and speed < 1.1 * limit` -> a function of named values.

The text is parsed by Python's own parser, and its tree is turned into closures: nothing is ever given to `eval`. There
are numbers, texts, True and False, names, arithmetic, comparisons, `and`, `or`, `not`, `a if c else b`, and the
functions of `FUNCTIONS`. There are no attributes, subscripts, calls of anything else, nor assignments. Length, depth,
number of parts and size of numbers are bounded, so an expression of a stranger costs at most some microseconds.

Where the caller allows it, an expression is followed over time: it may read fields of topics, such as
`/Ego_topic.velocity.x`, and has the functions of `RUNNING`, such as `max(speed)`: the greatest value so far. They keep
a number or two each, never the values themselves. `Following` has the state of one drive.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from keyword import iskeyword
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record
from rosbridge_sim.suggestions import hint

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
    "pow": (2, 2, math.pow),
    "sign": (1, 1, lambda value: (value > 0) - (value < 0)),
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

RUNNING: Final[dict[str, str]] = {
    "max": "greatest value so far",
    "min": "least value so far",
    "mean": "mean of the values so far",
    "first": "first value",
    "last": "value of before, where there is none now",
    "count": "number of frames in which it held",
    "ever": "it has held in a frame",
    "always": "it has held in all frames",
}
"""Functions of one argument over time, and what they return. A frame in which the argument has no value does not count;
before the first one that has, they have no value either."""


class TopicField(Record):
    """A field of a topic's messages.

    Attributes:
        text: as it was written; the name of its value.
        topic: absolute name of the topic.
        path: names of fields, and indices of lists.
    """

    text: str
    topic: str
    path: tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Expression:
    """A parsed expression; call it with the values of its names.

    Attributes:
        text: as it was written.
        where: place in the user's file, for errors.
        names: the names that it reads; those of fields of topics are their texts.
        fields: the fields of topics that it reads.
        running: function over time -> text of its call, which is the name of its value, and its argument; inner ones
            first.
    """

    text: str
    where: str
    names: frozenset[str]
    _work: _Part = field(repr=False, compare=False)
    fields: frozenset[TopicField] = frozenset()
    running: tuple[tuple[str, str, _Part], ...] = field(default=(), repr=False, compare=False)

    def __call__(self, values: Mapping[str, Value]) -> Value:
        """Return the value of the expression.

        Args:
            values: by name; all of `names` are there.

        Raises:
            DocumentError: a division by zero, a text where a number is needed, or a number that is too large.
        """
        return self.evaluate(self._work, values)

    def evaluate(self, part: _Part, values: Mapping[str, Value]) -> Value:
        """Return the value of a part of the expression; arguments and errors as for a call."""
        try:
            return part(values)
        except ZeroDivisionError:
            why = "a division by zero"
        except (OverflowError, ValueError):
            why = "a number outside the range of a function"
        except TypeError:
            why = "a text where a number is needed"
        raise DocumentError(f"{self.where}: {why} in {printable(self.text, 80)!r}")


class Following:
    """An expression that is followed through the frames of a drive: the values of its functions over time.

    Attributes:
        running: values of its functions over time, by the texts of their calls.
    """

    def __init__(self, expression: Expression) -> None:
        self.expression = expression
        self.running: dict[str, Value] = {}
        self._counts: dict[str, int] = {}

    def take(self, values: Mapping[str, Value]) -> None:
        """Take the values of the next frame.

        Raises:
            DocumentError: as for a call of the expression.
        """
        for function, text, argument in self.expression.running:
            try:
                value = self.expression.evaluate(argument, {**values, **self.running})
            except KeyError:
                continue
            num = self._counts[text] = self._counts.get(text, 0) + 1
            step = partial(_STEPS[function], self.running.get(text), value, num)
            self.running[text] = self.expression.evaluate(_constant_part(step), values)

    def value(self, values: Mapping[str, Value]) -> Value | None:
        """Return the value of the expression in the frame that was taken last; None if it has none.

        Args:
            values: of that frame, by name; those that there are.

        Raises:
            DocumentError: as for a call of the expression.
        """
        try:
            return self.expression({**values, **self.running} if self.running else values)
        except KeyError:
            return None


def _constant_part(compute: Callable[[], Value]) -> _Part:
    return lambda _values: compute()


def _mean(before: Value | None, value: Value, num: int) -> Value:
    old = 0.0 if before is None else _number(before)
    return old + (_number(value) - old) / num


def _extreme(choose: Callable[[float, float], float]) -> Callable[[Value | None, Value, int], Value]:
    return lambda before, value, _num: _number(value) if before is None else choose(_number(before), _number(value))


_STEPS: Final[dict[str, Callable[[Value | None, Value, int], Value]]] = {
    "max": _extreme(max),
    "min": _extreme(min),
    "mean": _mean,
    "first": lambda before, value, _num: value if before is None else before,
    "last": lambda _before, value, _num: value,
    "count": lambda before, value, _num: _number(before or 0) + bool(value),
    "ever": lambda before, value, _num: bool(value) or before is True,
    "always": lambda before, value, _num: bool(value) and before is not False,
}
"""Function over time -> its value after a frame, from its value before (None at first), the argument, and the number of
frames so far."""


def is_name(text: str) -> bool:
    """Return whether a text can be a name in expressions."""
    taken = text in FUNCTIONS or text in CONSTANTS or text in RUNNING
    return text.isidentifier() and text.isascii() and not iskeyword(text) and not taken


def parse_expression(
    text: str,
    where: str,
    known: frozenset[str] | None = None,
    *,
    is_followed: bool = False,
    numbers: frozenset[str] | None = None,
) -> Expression:
    """Parse an expression.

    Args:
        where: place in the user's file, for errors.
        known: names that may be used; None for any.
        is_followed: it may read fields of topics, and has the functions over time; see `Following`.
        numbers: of an expression that must be a condition, the known names that are none; None for any expression.

    Raises:
        DocumentError: it is no expression, is too long or too deep, uses a name that is not known, or is no condition.
        The text says where.
    """
    if len(text) > MAX_EXPRESSION_LENGTH:
        raise DocumentError(f"{where}: expected at most {MAX_EXPRESSION_LENGTH} characters, got {len(text):,}")
    shown = printable(text, 80)
    fields: dict[str, TopicField] = {}
    given = _without_topics(text, where, fields) if is_followed else text
    try:
        tree = ast.parse(given.strip(), mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        why = error.msg if isinstance(error, SyntaxError) else "too deep"
        raise DocumentError(f"{where}: expected an expression such as 'speed < 20', got {shown!r}: {why}") from None
    builder = _Builder(where, shown, known, fields, is_followed=is_followed)
    work = builder.build(tree.body, 0)
    if numbers is not None and not _is_condition(tree.body, numbers):
        raise DocumentError(f"{where}: expected a condition such as '{printable(text.strip(), 40)} < 5', got {shown!r}")
    return Expression(text, where, frozenset(builder.names), work, frozenset(fields.values()), tuple(builder.running))


def _is_condition(node: ast.expr, numbers: frozenset[str]) -> bool:
    """Return whether an expression that was built is true or false, and no number that is true unless it is 0."""
    match node:
        case ast.BoolOp(values=parts) | ast.Call(func=ast.Name(id="first" | "last"), args=parts):
            return all(_is_condition(part, numbers) for part in parts)
        case ast.IfExp(body=yes, orelse=no):
            return _is_condition(yes, numbers) and _is_condition(no, numbers)
        case ast.Call(func=ast.Name(id=name)):
            return name in {"ever", "always"}
        case ast.Name(id=name):  # a parameter or a field of a topic may be a switch
            return name not in numbers and name not in CONSTANTS
        case ast.Constant(value=value):
            return isinstance(value, bool)
    return isinstance(node, ast.Compare) or (isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not))


_TOKEN: Final = re.compile(
    r"""(?P<text>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")|(?P<operand>[\w.]*\w|[)\]])|(?P<space>\s+)|(?P<other>.)"""
)
_TOPIC: Final = re.compile(r"(?:/[A-Za-z_]\w*)+")
_PATH: Final = re.compile(r"(?:\.[A-Za-z_]\w*|\[\d{1,6}\])*")
_OPERATORS: Final = frozenset({"and", "or", "not", "if", "else"})


def _without_topics(text: str, where: str, fields: dict[str, TopicField]) -> str:
    """Return an expression with a name for each field of a topic, and note the fields by these names.

    A slash begins a topic where a value is expected; behind a value it divides.

    Raises:
        DocumentError: a topic has no field behind it.
    """
    parts: list[str] = []
    at, is_behind_value = 0, False
    while at < len(text):
        topic = None if is_behind_value else _TOPIC.match(text, at)
        if topic is not None:
            path = _PATH.match(text, topic.end())
            assert path is not None
            if not path[0].startswith("."):
                raise DocumentError(
                    f"{where}: expected a field behind the topic {topic[0]}, such as {topic[0]}.velocity.x"
                )
            steps = re.findall(r"\.(\w+)|\[(\d+)\]", path[0])
            written = TopicField(text[at : path.end()], topic[0], tuple(name or int(index) for name, index in steps))
            name = next((name for name, each in fields.items() if each == written), f"__field{len(fields)}__")
            fields[name] = written
            parts.append(name)
            at, is_behind_value = path.end(), True
            continue
        token = _TOKEN.match(text, at)
        assert token is not None
        parts.append(token[0])
        at = token.end()
        if token.lastgroup != "space":
            is_behind_value = token.lastgroup in {"text", "operand"} and token[0] not in _OPERATORS
    return "".join(parts)


class _Builder:
    """Turns a tree into closures; counts its parts."""

    def __init__(
        self,
        where: str,
        shown: str,
        known: frozenset[str] | None,
        fields: Mapping[str, TopicField],
        *,
        is_followed: bool,
    ) -> None:
        self.names: set[str] = set()
        self.running: list[tuple[str, str, _Part]] = []
        self._where, self._shown, self._known, self._fields = where, shown, known, fields
        self._is_followed = is_followed
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
                function = _BINARY[type(op)]
                left, right = self.build(node.left, depth + 1), self.build(node.right, depth + 1)
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
        if name in self._fields:
            text = self._fields[name].text
            self.names.add(text)
            return lambda values: values[text]
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
        if self._is_followed and name in RUNNING and (len(given) == 1 or name not in FUNCTIONS):
            return self._over_time(name, given, depth)
        if name in self._fields:
            raise self._error(f"expected no parentheses behind {self._fields[name].text}")
        if name not in FUNCTIONS:
            there = [*FUNCTIONS, *(each for each in RUNNING if self._is_followed and each not in FUNCTIONS)]
            raise self._error(f"no function {name}(){hint(name, there)}; there are {', '.join(there)}")
        least, most, function = FUNCTIONS[name]
        if not least <= len(given) <= most:
            raise self._error(f"{name}(): expected {least if least == most else f'{least} to {most}'} arguments")
        args = [self.build(each, depth) for each in given]
        return lambda values: _bounded(function(*[_number(arg(values)) for arg in args]))

    def _over_time(self, name: str, given: list[ast.expr], depth: int) -> _Part:
        if len(given) != 1:
            raise self._error(f"{name}(): expected 1 argument")
        argument = self.build(given[0], depth)
        text = ast.unparse(given[0])
        for placed, each in self._fields.items():
            text = text.replace(placed, each.text)
        text = f"{name}({text})"
        if all(text != other for _, other, _ in self.running):
            self.running.append((name, text, argument))
        return lambda values: values[text]


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
