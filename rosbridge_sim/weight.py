"""The weight of a JSON text: the number of structs, lists, texts and numbers that a decoder would make from it.

A decoder is one call of a C library, and nothing else runs until it returns: five million `{}` in 15 MB take 0.3 s to 3
s, and forty times their size in memory. So a long text is weighed before it is decoded. Weighing takes linear time (0.4
ms per megabyte) and creates no objects, so it can be done for every long frame.
The first count takes all brackets, quotes and commas. It can only be too high, because characters inside texts count,
too. If it exceeds the bounds, `weigh_exactly` ignores the content of texts. It works in slices, because a text of 16 MB
may contain another JSON text.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from rosbridge_sim.records import Record

_SLICE = 256 * 1024
"""Bytes of one slice: they stay in the processor's cache; 1 ms of work if the content of texts is ignored."""

_SHORT, FEW = 2**20, 500
"""A text shorter than this, with fewer commas and brackets, has few numbers: 14 ms at most, whatever they are."""

_QUOTE, _BACKSLASH, _COMMA, _BRACE, _BRACKET = b'"\\,{['
_ZERO, _E, _PLUS, _MINUS = b"0e+-"
_LOWER = 0x20
"""The bit that turns an upper-case letter into a lower-case one."""

_BLOCK = 32
"""So many digits in a row count as one block; no float64 needs more than 17, and no slice ends within a block."""

_EIGHT_TRUE = np.uint64(0x0101010101010101)

_FAR_DIGIT = b"2"[0]
"""First digit of an exponent with three digits. From 200 on, of either sign, a number may be at the edge of float64.
With a smaller exponent that takes more than 60 digits in a row, and those are counted, too."""


@dataclass(frozen=True, slots=True)
class Weight:
    """Counts of the contents of a JSON text.

    Attributes:
        containers: structs and lists.
        texts: texts, with the names of fields.
        commas: nearly the largest possible number of numbers.
        extremes: numbers at the edge of float64, and blocks of digits in long numbers. It is an estimate, so it is not
            compared.
    """

    containers: int
    texts: int
    commas: int
    extremes: int = field(default=0, compare=False)


class Bounds(Record):
    """The largest weight for one call of a decoder. Texts and numbers are cheap; structs and extremes are not."""

    containers: int
    texts: int
    commas: int
    extremes: int = 2_000

    def excess(self, weight: Weight) -> str | None:
        """Return the part of a weight that exceeds the bounds, as words for an error; None if no part does."""
        for num, most, what in (
            (weight.containers, self.containers, "objects and lists"),
            (weight.texts, self.texts, "texts"),
            (weight.commas, self.commas, "values"),
            (weight.extremes, self.extremes, "numbers beyond 1e200 or of many digits"),
        ):
            if num > most:
                return f"at most {most:,} {what} are accepted, and it has {num:,}"
        return None


FULL = Bounds(containers=150_000, texts=800_000, commas=4_500_000)
"""Bounds of a frame. A MarkerArray of 5,000 markers with all fields has 100,000 containers and 350,000 texts. An
occupancy grid of 2,000 x 2,000 cells has 4 million numbers. More than a million values are decoded in parts, see
`protocol/long_lists.py`; the others take up to 50 ms. A number at the edge of
float64 takes msgspec 14 us, 500 times as long as another one: 2.5 million `1e308` in 16 MB took 34 s."""

LIGHT = Bounds(containers=15_000, texts=60_000, commas=320_000)
"""Bounds of a text that Python checks field by field, at 1 to 3 us each, and numbers at 0.2 us: 50 ms. A depth image of
640 x 480 pixels with NaN in it, the largest message that ordinary clients write in this way, has 307,200 numbers."""


def weigh(text: bytes | memoryview) -> Weight:
    """Return the largest possible weight of a JSON text: characters inside texts count like those outside.

    Args:
        text: in UTF-8; it may be invalid JSON.
    """
    if isinstance(text, bytes) and len(text) < _SHORT:  # for example an image, which has almost nothing to count
        commas, braces, brackets = (count_few(text, mark) for mark in (b",", b"{", b"["))
        if max(commas, braces, brackets) < FEW:
            containers = braces + brackets
            return Weight(containers, 2 * (commas + containers) + 1, commas)  # one of these is between two texts
    *_, weight = weigh_in_slices(text)
    return weight


def weigh_in_slices(text: bytes | memoryview) -> Iterator[Weight]:
    """Yield the largest possible weight of a JSON text so far, as `weigh`, after each slice of half a millisecond.

    Args:
        text: in UTF-8; it may be invalid JSON.
    """
    data = np.frombuffer(text, np.uint8)
    containers = quotes = commas = extremes = 0
    for start in range(0, max(len(data), 1), _SLICE):
        part = data[start : start + _SLICE]
        containers += int(np.count_nonzero(part == _BRACE)) + int(np.count_nonzero(part == _BRACKET))
        quotes += int(np.count_nonzero(part == _QUOTE))
        commas += int(np.count_nonzero(part == _COMMA))
        extremes += _count_extremes(data, start, part, None)
        yield Weight(containers, quotes // 2, commas, extremes)


def count_few(text: bytes, mark: bytes) -> int:
    """Count a character up to `FEW`. If it is rare, this takes a tenth of the time of `bytes.count`."""
    position, num = text.find(mark), 0
    while position >= 0 and num < FEW:
        num += 1
        position = text.find(mark, position + 1)
    return num


def weigh_exactly(text: bytes | memoryview) -> Iterator[Weight]:
    """Yield the weight of a JSON text so far, after each slice of a millisecond of work.

    Args:
        text: in UTF-8. For invalid JSON the counts mean nothing, and a decoder refuses it.
    """
    data = np.frombuffer(text, np.uint8)
    containers = quotes = commas = extremes = 0
    is_inside = is_escaped = False
    for start in range(0, max(len(data), 1), _SLICE):
        part = data[start : start + _SLICE]
        marks, is_escaped = real_quotes(part, is_escaped=is_escaped)
        # After an odd number of quotes, a character is inside a text.
        inside = np.bitwise_xor.accumulate(marks) if is_inside is False else np.bitwise_xor.accumulate(marks) ^ 1
        outside = inside == 0
        containers += int(np.count_nonzero(((part == _BRACE) | (part == _BRACKET)) & outside))
        commas += int(np.count_nonzero((part == _COMMA) & outside))
        quotes += int(np.count_nonzero(marks))
        extremes += _count_extremes(data, start, part, outside)
        is_inside = bool(inside[-1]) if len(inside) else is_inside
        yield Weight(containers, quotes // 2, commas, extremes)


def _count_extremes(
    data: npt.NDArray[np.uint8], start: int, part: npt.NDArray[np.uint8], outside: npt.NDArray[np.bool_] | None
) -> int:
    """Return the number of exponents from 200 on, and of blocks of digits, in a slice.

    Args:
        data: the whole text, because a number may continue behind the slice.
        outside: True for characters outside texts; None counts all.
    """
    is_digit = (part - _ZERO) < 10  # noqa: PLR2004 - wraps around below zero
    marks = (part | _LOWER) == _E
    if outside is not None:
        is_digit &= outside
        marks &= outside
    whole = len(part) // _BLOCK * _BLOCK
    eights = is_digit[:whole].view(np.uint64) == _EIGHT_TRUE
    num_blocks = int(np.count_nonzero(eights.reshape(-1, _BLOCK // 8).all(axis=1))) if eights.any() else 0
    at = np.flatnonzero(marks) + start + 1
    at = at[at + 5 <= len(data)]  # a sign and four digits; the end of a number always follows
    at += (data[at] == _PLUS) | (data[at] == _MINUS)
    for i in range(3):  # step by step: few of the letters in an image's base64 are followed by a digit
        at = at[(data[at + i] - _ZERO) < 10]  # noqa: PLR2004 - as above
    # a fourth digit, because an exponent may begin with zeros
    is_far = (data[at] >= _FAR_DIGIT) | ((data[at + 3] - _ZERO) < 10)  # noqa: PLR2004 - as above
    return num_blocks + int(np.count_nonzero(is_far))


def real_quotes(part: npt.NDArray[np.uint8], *, is_escaped: bool) -> tuple[npt.NDArray[np.uint8], bool]:
    """Return the quotes that begin or end a text, as ones among zeros, and True if the next character is escaped.

    Args:
        is_escaped: its first character is escaped by a backslash.
    """
    marks = (part == _QUOTE).astype(np.uint8)
    slashes = np.flatnonzero(part == _BACKSLASH)
    if is_escaped and len(part):
        marks[0] = 0
        if len(slashes) and slashes[0] == 0:  # the escaped character is a backslash itself
            slashes = slashes[1:]
    if not len(slashes):
        return marks, False
    # Runs of backslashes: the character behind a run of odd length is escaped.
    is_first = np.concatenate(([True], np.diff(slashes) != 1))
    firsts = slashes[is_first]
    lengths = np.diff(np.append(np.flatnonzero(is_first), len(slashes)))
    behind = (firsts + lengths)[lengths % 2 == 1]
    inner = behind[behind < len(part)]
    marks[inner] = 0
    return marks, len(inner) < len(behind)


def claim(size: int) -> None:
    """Raise MemoryError if there is not enough memory for a text.

    msgspec (0.22) does not check if it got memory for a text, and writes to address 0: the process dies. The text is at
    most as long as its body, so if this allocation succeeds, that one does, too.

    Args:
        size: length of the body [bytes].

    Raises:
        MemoryError: the memory cannot be allocated.
    """
    np.empty(size + 64, np.uint8)  # never written to; an ASCII str takes 41 bytes in addition to its characters
