"""Parser of definition texts: the grammar of .msg, .srv and .action files.

It reads the grammar of ROS 1, and from that of ROS 2 everything that has no other meaning in ROS 1: bounded arrays and
strings, default values, three-part type names. Only text constants have a different meaning in both: in ROS 1 the
quotes around one belong to it. Every type name comes out as `pkg/Type`; the old short names `Header`, `time` and
`duration` are accepted only here. Errors name line and column.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, Literal, NoReturn

from rosbridge_sim.errors import DefinitionError
from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.names import Generation

INT_RANGES = {f"int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)} | {
    f"uint{n}": (0, 2**n - 1) for n in (8, 16, 32, 64)
}
"""Least and greatest value of each integer type."""

_WORD_RANGES = {"byte": (-128, 255), "char": (-128, 255)}
"""The sign of `byte` and `char` differs between ROS 1 and ROS 2: a constant may have the range of either."""

BASE_TYPES = frozenset(
    {*INT_RANGES, "bool", "float32", "float64", "string", "wstring", "byte", "char", "time", "duration"}
)

MAX_FLOAT32 = 3.4028235677973366e38
"""The first number that float32 rounds to infinity: half a step above its greatest one."""

MAX_ARRAY_LENGTH = 1 << 24
"""The longest fixed array [elements]: its default value alone takes 128 MB."""

MAX_DIGITS = 18
"""Most digits of a length in a type: such a number fits an int64. Python refuses to read thousands of digits."""

MAX_LINE_SHOWN = 300
"""Longest error text [characters]: it quotes a line, which may be a megabyte long."""

TYPE_TOKEN = re.compile(
    r"(?P<base>[A-Za-z]\w*(?:/\w+)*)(?:<=(?P<chars>\d+))?(?P<array>\[(?P<bound><=)?(?P<count>\d*)\])?(?=\s)", re.ASCII
)
NAME_TOKEN = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_SPACE = re.compile(r"\s*")
_QUALIFIED = re.compile(r"(?P<package>[A-Za-z]\w*)/(?:msg/)?(?P<type>[A-Za-z]\w*)", re.ASCII)
_OLD_NAMES = {
    "Header": "std_msgs/Header",
    "builtin_interfaces/Time": "time",
    "builtin_interfaces/Duration": "duration",
}


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message.

    Attributes:
        type: the base type, e.g. `float64`, `time`, or `pkg/Type`; never with an array suffix.
        name: as on the wire.
        array: None for a scalar, 0 for any length, N for exactly N elements (or at most N, see `is_bounded`).
        default: the default in the text, converted, a tuple for arrays; None if there is none.
        is_bounded: `array` is the greatest length, not the exact one.
        max_chars: the longest text of a bounded string [characters], or None.
        line: number of its line, from 1.
    """

    type: str
    name: str
    array: int | None = None
    default: object | None = None
    is_bounded: bool = False
    max_chars: int | None = None
    line: int = field(default=0, compare=False)

    @property
    def is_bytes(self) -> bool:
        """True for an array of bytes, which is base64 in JSON and `bytes` here."""
        return self.array is not None and self.type in {"uint8", "char"}

    @property
    def count(self) -> int:
        """Number of elements of an array with a fixed length; 0 for all other fields."""
        return 0 if self.is_bounded else self.array or 0

    @property
    def full_type(self) -> str:
        """The type with its array suffix, such as `float64[36]` or `string<=8[<=4]`."""
        chars = "" if self.max_chars is None else f"<={self.max_chars}"
        if self.array is None:
            return self.type + chars
        return f"{self.type}{chars}[{'<=' if self.is_bounded else ''}{self.array or ''}]"


@dataclass(frozen=True, slots=True)
class Constant:
    """A named value of a message.

    Attributes:
        type: a base type.
        name: its name.
        value: converted.
        text: the value as the definition writes it.
        line: number of its line, from 1.
    """

    type: str
    name: str
    value: object
    text: str
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Definition:
    """A parsed message, or one part of a service or an action.

    Attributes:
        name: `pkg/Type`.
        fields, constants: in the order of the text.
        text: the parsed text.
        source: where the text came from, for error texts.
        first_line: number of its first line there.
    """

    name: str
    fields: tuple[Field, ...]
    constants: tuple[Constant, ...]
    text: str
    source: str = field(default="", compare=False)
    first_line: int = field(default=1, compare=False)

    @property
    def package(self) -> str:
        """The part of the name before the slash."""
        return self.name.partition("/")[0]


def parse_message(name: str, text: str, source: str | None = None, ros: Generation = 1) -> Definition:
    """Return the definition in a .msg text.

    Args:
        name: `pkg/Type`; unqualified names in the text belong to its package.
        text: the whole file.
        source: name of the text in error texts; None for `name`.
        ros: the generation whose rule counts where both differ.

    Raises:
        DefinitionError: the text is wrong; it names line and column.
    """
    return _parse(name, text, source or name, 1, ros)


SUFFIXES: Final[Mapping[Literal["srv", "action"], tuple[str, ...]]] = {
    "srv": ("Request", "Response"),
    "action": ("Goal", "Result", "Feedback"),
}
"""Ends of the names of the messages in the text of a service or of an action."""


def parse_parts(
    kind: Literal["srv", "action"], name: str, text: str, source: str | None = None, ros: Generation = 1
) -> tuple[Definition, ...]:
    """Return the definitions in a .srv or .action text, named by `SUFFIXES`; see `parse_message`.

    Raises:
        DefinitionError: the text is wrong, or has not as many `---` lines as the kind needs.
    """
    suffixes = SUFFIXES[kind]
    source = source or name
    lines = text.split("\n")
    borders = [i for i, line in enumerate(lines) if line.strip() == "---"]
    wanted = len(suffixes) - 1
    if len(borders) != wanted:
        line = borders[wanted] + 1 if len(borders) > wanted else len(lines)
        count = "one line" if wanted == 1 else f"{wanted} lines"
        what = "a service" if kind == "srv" else "an action"
        raise DefinitionError(source, line, 1, f"{what} needs exactly {count} '---', found {len(borders)}")
    starts = [0, *(border + 1 for border in borders)]
    ends = [*borders, len(lines)]
    return tuple(
        _parse(name + suffix, "\n".join(lines[start:end]), source, start + 1, ros)
        for suffix, start, end in zip(suffixes, starts, ends, strict=True)
    )


parse_service = partial(parse_parts, "srv")
parse_action = partial(parse_parts, "action")


def _skip_space(line: str, at: int) -> int:
    match = _SPACE.match(line, at)
    return match.end() if match else at


def _parse(name: str, text: str, source: str, first_line: int, ros: Generation) -> Definition:
    fields: list[Field] = []
    constants: list[Constant] = []
    names: set[str] = set()
    text = text.removeprefix("\ufeff").replace("\r\n", "\n")
    for number, line in enumerate(text.split("\n"), first_line):
        item = _Line(source, number, line, name.partition("/")[0], ros).parse()
        if item is None:
            continue
        if item.name in names:
            raise DefinitionError(source, number, line.find(item.name) + 1, f"{item.name} is defined twice")
        names.add(item.name)
        if isinstance(item, Field):
            fields.append(item)
        else:
            constants.append(item)
    return Definition(name, tuple(fields), tuple(constants), text, source, first_line)


class _Line(Record):
    """One line of a definition, with its place for error texts."""

    source: str
    number: int
    line: str
    package: str
    ros: Generation

    def fail(self, at: int, text: str) -> NoReturn:
        if len(text) > MAX_LINE_SHOWN:
            text = text[:MAX_LINE_SHOWN] + "..."
        raise DefinitionError(self.source, self.number, at + 1, text)

    def parse(self) -> Field | Constant | None:
        """Return what the line defines: `type name`, `type name = value` or `type name default`, and a comment."""
        line = self.line
        start = _skip_space(line, 0)
        if line[start : start + 1] in {"", "#"}:
            return None
        type_match = TYPE_TOKEN.match(line, start)
        if type_match is None:
            self.fail(start, f"expected a type and a name, found {line[start:].strip()!r}")
        at = _skip_space(line, type_match.end())
        name_match = NAME_TOKEN.match(line, at)
        if name_match is None:
            self.fail(at, f"expected the name of a field, found {line[at:].strip() or 'the end of the line'!r}")
        at = _skip_space(line, name_match.end())
        rest = line[at:]
        if rest.startswith("="):
            return self.constant(type_match, name_match[0], _skip_space(line, at + 1))
        plain = self.field(type_match, name_match[0])
        if rest[:1] in {"", "#"}:
            return plain
        if at == name_match.end():
            self.fail(at, f"{line[name_match.start() :].split()[0]!r} is no name of a field")
        return replace(plain, default=self.default(plain, at))

    def field(self, match: re.Match[str], name: str) -> Field:
        base = self.resolve(match)
        chars = match["chars"]
        for digits in ("chars", "count"):
            if len(match[digits] or "") > MAX_DIGITS:
                self.fail(match.start(digits), f"expected a length of at most {MAX_DIGITS} digits")
        if chars is not None and base not in {"string", "wstring"}:
            self.fail(match.start("chars"), f"only a string can be bounded, not {base}")
        array = None
        if match["array"]:
            array = int(match["count"] or 0)
            if (match["count"] and not 0 < array <= MAX_ARRAY_LENGTH) or (match["bound"] and not match["count"]):
                self.fail(
                    match.start("array"), f"an array's length is from 1 to {MAX_ARRAY_LENGTH}, found {match['array']}"
                )
        return Field(
            base,
            name,
            array,
            is_bounded=bool(match["bound"]),
            max_chars=None if chars is None else int(chars),
            line=self.number,
        )

    def resolve(self, match: re.Match[str]) -> str:
        """Return the base type, or the full name of a nested type."""
        base = match["base"]
        if base in BASE_TYPES:
            return base
        if "/" not in base:
            return _OLD_NAMES.get(base) or f"{self.package}/{base}"
        qualified = _QUALIFIED.fullmatch(base)
        if qualified is None:
            self.fail(match.start(), f"{base} is not a valid type string")
        full = f"{qualified['package']}/{qualified['type']}"
        return _OLD_NAMES.get(full, full)

    def constant(self, match: re.Match[str], name: str, at: int) -> Constant:
        base = match["base"]
        if base not in BASE_TYPES - {"time", "duration"} or match["array"] or match["chars"]:
            self.fail(match.start(), f"a constant cannot be of type {match[0]}")
        if base in {"string", "wstring"}:
            # Everything after `=` belongs to the text in ROS 1, also quotes and `#`.
            text = self.line[at:].strip()
            value: object = self.quoted(base, text, at) if self.ros != 1 else text
        else:
            text = self.line[at:].partition("#")[0].strip()
            value = self.convert(base, text, at)
        return Constant(base, name, value, text, line=self.number)

    def quoted(self, base: str, text: str, at: int) -> str:
        """Return a text constant by the rule of ROS 2: without quotes and comment, unless quotes do not match."""
        try:
            return self.literal(base, at) if text else ""
        except DefinitionError:
            return text

    def default(self, plain: Field, at: int) -> object:
        """Return the default value after a field's name, which ROS 2 text may have."""
        base = plain.type
        if base not in BASE_TYPES - {"time", "duration"}:
            self.fail(at, f"a field of type {plain.full_type} cannot have a default value")
        if plain.array is None:
            value = self.convert(base, self.literal(base, at), at)
            self.check_chars(plain, value, at)
            return value
        text = self.line[at:].strip()
        match = re.match(r"\[(.*)\]\s*(?:#.*)?$", text)
        if match is None:
            self.fail(at, f"expected a list of values for {plain.full_type}, found {text!r}")
        if base in {"string", "wstring"}:
            parts = self.texts(match[1], at)
        else:
            parts = [part.strip() for part in match[1].split(",")] if match[1].strip() else []
        values = tuple(self.convert(base, part, at) for part in parts)
        if plain.array and (len(values) > plain.array or (len(values) < plain.array and not plain.is_bounded)):
            self.fail(at, f"{len(values)} values do not fit {plain.full_type}")
        for value in values:
            self.check_chars(plain, value, at)
        return values

    def literal(self, base: str, at: int) -> str:
        """Return the text of a single default value, without quotes and comment."""
        text = self.line[at:].strip()
        if base not in {"string", "wstring"} or text[0] not in "'\"":
            return text.partition("#")[0].strip()
        values = self.texts(text, at)
        if len(values) != 1:
            self.fail(at, f"expected one text, found {text!r}")
        return values[0]

    def texts(self, text: str, at: int) -> list[str]:
        """Return quoted texts that are separated by commas, by Python's rules for quotes, escapes and comments."""
        try:
            values = ast.literal_eval(f"[{text}\n]")
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            values = [None]
        if not all(isinstance(value, str) for value in values):
            self.fail(at, f"expected text in quotes, found {text!r}")
        return list(values)

    def check_chars(self, plain: Field, value: object, at: int) -> None:
        if plain.max_chars is not None and isinstance(value, str) and len(value) > plain.max_chars:
            self.fail(at, f"{value!r} is longer than {plain.full_type} allows")

    def convert(self, base: str, text: str, at: int) -> object:
        """Return the value that a literal stands for, checked against the range of its type."""
        if base in {"string", "wstring"}:
            return text
        if base == "bool":
            if text.lower() not in {"true", "false", "1", "0"}:
                self.fail(at, f"expected true or false, found {text!r}")
            return text.lower() in {"true", "1"}
        is_float = base in {"float32", "float64"}
        try:
            value = float(text) if is_float else int(text, 10 if text.lstrip("+-")[:2].isdigit() else 0)
        except ValueError:
            self.fail(at, f"expected a {base} value, found {text!r}")
        if is_float:
            if base == "float32" and MAX_FLOAT32 <= abs(value) < math.inf:
                self.fail(at, f"{text} is out of the range of float32")
            return value
        low, high = INT_RANGES.get(base) or _WORD_RANGES[base]
        if not low <= value <= high:
            self.fail(at, f"{value} is out of the range of {base}, {low} to {high}")
        return value
