"""Observations of a running system: rates of topics, and the values of each field, in bounded memory.

A field has a path: `pose.position.x`, and `ranges[]` for all elements of a list.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import Record

MAX_FIELDS: Final = 1_000
"""Fields of a topic that are looked at; no message of MORAI has a third of it."""

MAX_DEPTH: Final = 20
"""Messages within messages that are looked at."""

MAX_PATH: Final = 300
"""Longest path of a field that is looked at [characters]."""

MAX_ELEMENTS: Final = 100
"""Objects of a list that are looked at, of each message."""

MAX_VALUES: Final = 100
"""Different texts and flags of a field that are kept."""

MAX_TEXT: Final = 80
"""Longest text that is kept [characters]; longer ones are pictures, descriptions and the like."""

_TIMES: Final = ({"secs", "nsecs"}, {"sec", "nanosec"})


@dataclass(slots=True)
class SeenField:
    """The values of a field.

    Attributes:
        num: number of values.
        low, high: least and largest finite number; infinite if there is none.
        is_whole: all numbers are integers.
        step: difference of two numbers that follow each other, if it is always the same; None if it is not, or of an
            element of a list.
        num_not_finite: values that are NaN, infinite or null.
        words: different texts and flags, at most `MAX_VALUES`, else `is_open`.
        is_open: there were longer texts, or more of them.
        shortest, longest: lengths of lists.
        num_objects: values that are messages.
        is_time: one of them was a time or a duration.
    """

    num: int = 0
    low: float = math.inf
    high: float = -math.inf
    is_whole: bool = True
    step: float | None = None
    num_not_finite: int = 0
    words: dict[str | bool, None] = field(default_factory=dict)
    is_open: bool = False
    shortest: int = 2**63
    longest: int = -1
    num_objects: int = 0
    is_time: bool = False
    _last: float | None = None
    _has_step: bool = True

    @property
    def is_number(self) -> bool:
        """True if there were finite numbers."""
        return self.low <= self.high

    @property
    def kinds(self) -> set[str]:
        """Kind of its values: `number`, `text`, `flag`, `list`, `message`."""
        found = {"flag" if isinstance(word, bool) else "text" for word in self.words}
        found |= {"number"} if self.is_number or self.num_not_finite else set()
        found |= {"text"} if self.is_open else set()
        found |= {"list"} if self.longest >= 0 else set()
        return found | ({"message"} if self.num_objects else set())

    @property
    def is_constant(self) -> bool:
        """True if all values were the same number, text or flag."""
        return not self.num_not_finite and (
            self.low == self.high if self.is_number else len(self.words) == 1 and not self.is_open
        )

    @property
    def is_counter(self) -> bool:
        """True if the number grew by the same whole step each time."""
        return self.is_whole and self.step is not None and self.step > 0

    def add_number(self, value: float) -> None:
        """Take a number that is no element of a list."""
        self.num += 1
        if not _is_finite(value):
            self.num_not_finite += 1
            return
        if self._last is not None and self._has_step:
            step = value - self._last
            self._has_step = self.step is None or step == self.step
            self.step = step if self._has_step else None
        self._last = value
        self._widen(value, value, is_whole=isinstance(value, int))

    def add_numbers(self, values: list[float]) -> None:
        """Take the numbers in a list."""
        finite = [value for value in values if _is_finite(value)]
        self.num += len(values)
        self.num_not_finite += len(values) - len(finite)
        self._has_step = False
        if finite:
            self._widen(min(finite), max(finite), is_whole=self.is_whole and all(type(one) is int for one in finite))

    def _widen(self, low: float, high: float, *, is_whole: bool) -> None:
        self.low, self.high = min(self.low, low), max(self.high, high)
        self.is_whole = self.is_whole and is_whole

    def add_word(self, value: str | bool) -> None:  # noqa: FBT001 - a value of a message
        """Take a text or a flag."""
        self.num += 1
        if value in self.words:
            return
        if len(self.words) == MAX_VALUES or (isinstance(value, str) and len(value) > MAX_TEXT):
            self.is_open = True
        else:
            self.words[value] = None

    def add_length(self, length: int) -> None:
        """Take the length of a list."""
        self.num += 1
        self.shortest, self.longest = min(self.shortest, length), max(self.longest, length)


def _is_finite(number: float) -> bool:
    """Return whether a number is one of a message: no NaN, no infinity, and no integer that no float can hold."""
    return -_LARGEST < number < _LARGEST


_LARGEST: Final = 1e300


class SeenTopic:
    """The messages of a topic.

    Attributes:
        num: number of messages.
        fields: path -> field; the message itself has the empty path.
        sample: the first message; None before it came.
    """

    def __init__(self) -> None:
        self.num = 0
        self.fields: dict[str, SeenField] = {}
        self.sample: Mapping[str, JsonValue] | None = None
        self._first = self._last = 0.0

    @property
    def rate(self) -> float | None:
        """Mean rate [Hz]; None for fewer than two messages."""
        span = self._last - self._first
        return (self.num - 1) / span if self.num > 1 and span > 0 else None

    def add(self, now: float, message: Mapping[str, JsonValue]) -> None:
        """Take a message.

        Args:
            now: when it came [s].
            message: the message, as JSON has it.
        """
        self.num += 1
        self._last = now
        if self.sample is None:
            self.sample, self._first = message, now
        self._look("", message, 0)

    def num_missing(self, path: str) -> int:
        """Return how often a field was missing where the message that it is part of was there.

        An element of a list is never missing, because lists may be empty.
        """
        holder = parent_of(path)
        if holder.endswith("[]") and holder not in self.fields:
            return self.num_missing(holder)
        above = self.fields.get(holder)
        if above is None:
            return self.num
        if path.endswith("[]"):
            return above.num if above.longest < 0 else 0
        seen = self.fields.get(path)
        return max(0, above.num_objects - (seen.num if seen else 0))

    def _look(self, path: str, value: JsonValue, depth: int) -> None:
        seen = self._field(path)
        if seen is None:
            return
        if isinstance(value, dict):
            seen.num += 1
            seen.num_objects += 1
            seen.is_time = seen.is_time or value.keys() in _TIMES
            for name, one in value.items() if depth < MAX_DEPTH else ():
                if name.isidentifier():  # as all fields of ROS
                    self._look(f"{path}.{name}" if path else name, one, depth + 1)
        elif isinstance(value, list):
            seen.add_length(len(value))
            self._look_within(f"{path}[]", value, depth + 1)
        elif isinstance(value, (str, bool)):
            seen.add_word(value)
        else:
            seen.add_number(math.nan if value is None else value)

    def _look_within(self, path: str, values: list[JsonValue], depth: int) -> None:
        """Look at the elements of a list."""
        if all(one is None or type(one) in _NUMBERS for one in values):
            seen = self._field(path) if values else None
            if seen is not None:
                seen.add_numbers([math.nan if one is None else one for one in values])
        elif depth < MAX_DEPTH:
            for one in values[:MAX_ELEMENTS]:
                self._look(path, one, depth)

    def _field(self, path: str) -> SeenField | None:
        """Return a field; None if there are too many."""
        if path not in self.fields:
            if len(self.fields) >= MAX_FIELDS or len(path) > MAX_PATH:
                return None
            self.fields[path] = SeenField()
        return self.fields[path]


_NUMBERS: Final = (int, float)


def parent_of(path: str) -> str:
    """Return the path of the message or list that a field is part of: `a` of `a.b` and of `a[]`."""
    return path.removesuffix("[]") if path.endswith("[]") else path.rpartition(".")[0]


class SeenSystem(Record):
    """Observations of a system.

    Attributes:
        topics: name -> messages, of the topics that were watched.
        types: name -> type of all topics; None if the system does not tell.
        services: name -> type of all services; None if the system does not tell. An unknown type is empty.
        seconds: how long it was watched [s].
    """

    topics: Mapping[str, SeenTopic]
    types: Mapping[str, str] | None
    services: Mapping[str, str] | None
    seconds: float
