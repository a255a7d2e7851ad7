"""The number of messages and texts within a message, counted in its CDR before it is read.

Each of them becomes an object of Python, which takes about 12 us to read and check. Numbers and bytes cost next to
nothing, so a cloud of points may be large, and a list of thousands of small messages may not.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, Final

_BASE, _NAME, _ARRAY = 1, 2, 3
"""Kinds of fields, as rosbags numbers them; 4 is a sequence."""

_SIZES: Final = {"float32": 4, "float64": 8} | {
    f"{sign}int{bits}": bits // 8 for sign in ("", "u") for bits in (8, 16, 32, 64)
}


def count_objects(raw: bytes, name: str, definitions: Mapping[str, Any], most: int) -> tuple[int, int]:
    """Return the number of messages and texts in a message, and its length [bytes]; counting stops beyond `most`.

    Args:
        raw: CDR, with its four bytes of encapsulation.
        name: `pkg/msg/Type`.
        definitions: all types in it, in the form of rosbags: name -> fields.
        most: largest number that matters.

    Raises:
        struct.error, IndexError: the bytes end too early.
    """
    counter = _Counter(raw, definitions, most)
    counter.skip_message(name)
    return counter.count, counter.length


class _Counter:
    """A position in a message, and the number of objects before it."""

    def __init__(self, raw: bytes, definitions: Mapping[str, Any], most: int) -> None:
        self.count = 0
        self._at = 0
        self._raw = raw
        self._definitions = definitions
        self._most = most
        self._length = struct.Struct("<I" if raw[1] else ">I").unpack_from

    @property
    def length(self) -> int:
        """Bytes up to here, the four of encapsulation included."""
        return 4 + self._at

    def skip_message(self, name: str) -> None:
        if not self._definitions[name]:
            self._at += 1
        for _, (kind, rest) in self._definitions[name]:
            if self.count > self._most:
                return
            if kind in {_BASE, _NAME}:
                self._skip(kind, rest, 1)
            else:
                (inner_kind, inner), length = rest
                self._skip(inner_kind, inner, length if kind == _ARRAY else self._read_length())

    def _skip(self, kind: int, rest: Any, times: int) -> None:  # noqa: ANN401 - of rosbags
        if kind == _BASE and rest[0] not in {"string", "wstring"}:
            size = _SIZES.get(rest[0], 1)
            self._at += (-self._at % size if times else 0) + size * times
            return
        for _ in range(times):
            self.count += 1
            if self.count > self._most:
                return
            if kind == _BASE:
                length = self._read_length()
                self._at += length
            else:
                self.skip_message(rest)

    def _read_length(self) -> int:
        self._at += -self._at % 4
        (number,) = self._length(self._raw, 4 + self._at)
        self._at += 4
        return int(number)
