"""YAML of the user -> plain values and the line of each, without anything that a stranger's file could abuse.

The parser of `ruamel.yaml` finds the parts of the text, and this module makes the values: no object is ever made by a
tag. Size, depth, and the number of values with those of aliases are bounded. Words are read by the core schema of
YAML 1.2, as JSON has them: `yes`, `on` and dates are texts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, Final

from rosbridge_sim.documents.document_model import Place, path_of
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record

MAX_YAML_BYTES: Final = 500_000
"""Longest text [bytes]: the parser takes up to 14 us of CPU time for each."""

MAX_YAML_DEPTH: Final = 50
"""Deepest nesting: messages nest less than ten deep."""

MAX_YAML_VALUES: Final = 200_000
"""Most values of a text, those that aliases repeat among them: ten aliases of ten aliases, and so on, make billions."""

_WORDS: Final[dict[str, JsonValue]] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
    **{sign + word: float(f"{sign}inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
}
_WHOLE: Final = re.compile(r"[-+]?\d{1,40}|0x[0-9a-fA-F]{1,32}|0o[0-7]{1,40}")
_NUMBER: Final = re.compile(r"[-+]?(\.\d+|\d+(\.\d*)?)([eE][-+]?\d{1,9})?")


class YamlDocument(Record):
    """A YAML text that was read.

    Attributes:
        source: name of the file, for errors.
        value: what JSON can hold, and NaN and infinity.
        lines: line of each value, from 1, by its place.
    """

    source: str
    value: Any
    lines: Mapping[Place, int]

    def where(self, place: Place) -> str:
        """Return a place for an error: `robot.yaml:12: topics./odom.rate`."""
        line = f"{self.source}:{self.line(place)}"
        return f"{line}: {path}" if (path := path_of(place)) else line

    def line(self, place: Place) -> int:
        """Return the line of a place, or of the nearest one around it that was written there."""
        while place and place not in self.lines:
            place = place[:-1]
        return self.lines.get(place, 1)


def read_yaml(text: str | bytes, source: str, expected: str = "YAML") -> YamlDocument:
    """Read one YAML document.

    Args:
        text: the text, or its bytes in UTF-8.
        source: name of the file, for errors.
        expected: what a text may be, for the error about one that is no YAML.

    Raises:
        DocumentError: one line, such as `robot.yaml:3:17: ...`: it is no UTF-8 or YAML, too much, or has a tag, two
            documents or a key twice.
    """
    from ruamel.yaml import YAML  # noqa: PLC0415 - takes 40 ms, and most commands do not need it
    from ruamel.yaml.error import YAMLError  # noqa: PLC0415

    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            byte = error.object[error.start]
            raise DocumentError(f"{source}: expected a text in UTF-8, got byte {byte:#04x}") from None
    num_bytes = len(text.encode(errors="replace"))
    if num_bytes > MAX_YAML_BYTES:
        raise DocumentError(f"{source}: expected at most {MAX_YAML_BYTES:,} bytes, got {num_bytes:,}")
    builder = _Builder(source)
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            builder.take(event)
    except (YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or str(error).partition("\n")[0] or "nested too deeply"
        mark = getattr(error, "problem_mark", None)
        place = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise DocumentError(f"{source}{place}: expected {expected}: {printable(problem, 200)}") from None
    return YamlDocument(source, builder.value, builder.lines)


class _Open:
    """A list or an object that is not complete yet."""

    def __init__(self, made: list[Any] | dict[str, Any], place: Place, anchor: str | None, begin: int) -> None:
        self.made, self.place, self.anchor, self.begin = made, place, anchor, begin
        self.key: str | None = None


class _Builder:
    """Makes the values from the events of the parser."""

    def __init__(self, source: str) -> None:
        self.value: Any = None
        self.lines: dict[Place, int] = {}
        self._source = source
        self._open: list[_Open] = []
        self._anchors: dict[str, tuple[Any, int]] = {}
        self._num = 0
        self._num_documents = 0

    def take(self, event: Any) -> None:  # noqa: ANN401 - the library's events
        """Take the next event."""
        kind = type(event).__name__.removesuffix("Event")
        if kind == "DocumentStart":
            self._num_documents += 1
            if self._num_documents > 1:
                raise self._error(event, "expected one document, got another one behind ---")
        elif kind in {"MappingEnd", "SequenceEnd"}:
            done = self._open.pop()
            if done.anchor is not None:
                self._anchors[done.anchor] = done.made, self._num - done.begin + 1
        elif kind in {"Scalar", "Alias", "MappingStart", "SequenceStart"}:
            self._take_value(kind, event)

    def _take_value(self, kind: str, event: Any) -> None:  # noqa: ANN401 - as above
        if kind != "Alias" and event.tag is not None:
            raise self._error(event, f"expected no tags, got {printable(str(event.tag), 40)!r}")
        above = self._open[-1] if self._open else None
        if above is not None and isinstance(above.made, dict) and above.key is None:
            above.key = self._key(kind, event, above.made)
            return
        num = 1
        made: Any
        if kind == "Alias":
            if event.anchor not in self._anchors:
                raise self._error(event, f"no anchor &{printable(event.anchor, 40)} that is complete stands above")
            made, num = self._anchors[event.anchor]
        elif kind == "Scalar":
            made = _scalar(event.value) if event.implicit[0] else event.value
        else:
            made = {} if kind == "MappingStart" else []
        self._num += num
        if self._num > MAX_YAML_VALUES:
            raise self._error(event, f"expected at most {MAX_YAML_VALUES:,} values with those of aliases, got more")
        place = self._put(above, made, event)
        if kind in {"MappingStart", "SequenceStart"}:
            if len(self._open) >= MAX_YAML_DEPTH:
                raise self._error(event, f"expected at most {MAX_YAML_DEPTH} levels, got more")
            self._open.append(_Open(made, place, event.anchor, self._num))
        elif kind == "Scalar" and event.anchor is not None:
            self._anchors[event.anchor] = made, 1

    def _put(self, above: _Open | None, made: object, event: Any) -> Place:  # noqa: ANN401 - as above
        """Put a value where it belongs; return its place."""
        place: Place = ()
        if above is None:
            self.value = made
        elif isinstance(above.made, list):
            place = (*above.place, len(above.made))
            above.made.append(made)
        else:
            assert above.key is not None, "the event before was the key"
            place = (*above.place, above.key)
            above.made[above.key] = made
            above.key = None
        self.lines.setdefault(place, event.start_mark.line + 1)  # that of the key, if there is one
        return place

    def _key(self, kind: str, event: Any, there: dict[str, Any]) -> str:  # noqa: ANN401 - as above
        if kind != "Scalar":
            raise self._error(event, "expected a text as a key")
        key: str = event.value
        if key in there:
            raise self._error(event, f"expected each key once, got {printable(key, 60)!r} again")
        self.lines[(*self._open[-1].place, key)] = event.start_mark.line + 1
        return key

    def _error(self, event: Any, text: str) -> DocumentError:  # noqa: ANN401 - as above
        mark = event.start_mark
        return DocumentError(f"{self._source}:{mark.line + 1}:{mark.column + 1}: {text}")


def _scalar(text: str) -> JsonValue:
    """Return the value of a word without quotes."""
    if text in _WORDS:
        return _WORDS[text]
    if _WHOLE.fullmatch(text):
        return int(text, 0) if text[:2] in {"0x", "0o"} else int(text)
    return float(text) if len(text) < MAX_YAML_NUMBER and _NUMBER.fullmatch(text) else text


MAX_YAML_NUMBER: Final = 400
"""Longest number [characters]."""
