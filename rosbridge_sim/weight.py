"""The weight of a JSON text: how many structs, lists, texts and numbers a decoder would make of it.

A decoder is one call of a C library, and nothing else runs before it returns: five million `{}` in 15 MB take 0.3 s to
3 s, and forty times their bytes. So a long text is weighed before it is decoded. Weighing is linear and cheap (0.4 ms a
megabyte), makes nothing, and so can be done for every long frame.

The first look counts brackets, quotes and commas wherever they stand. That can only be too much: those inside texts
count, too. Where it is too much for the bounds, `weigh_exactly` leaves out what stands inside texts, in slices, because
a text of 16 MB may hold another JSON text.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

__all__ = ["FULL", "LIGHT", "Bounds", "Weight", "claim", "weigh", "weigh_exactly"]

_SLICE = 256 * 1024
"""Bytes that are looked at in one go: they stay in the processor's cache; 1 ms of work where texts are left out."""

_SHORT, _FEW = 2**20, 500
"""A text shorter than this with fewer commas and brackets has few numbers, whatever they look like: 14 ms at most."""

_QUOTE, _BACKSLASH, _COMMA, _BRACE, _BRACKET = b'"\\,{['
_ZERO, _E, _PLUS, _MINUS = b"0e+-"
_LOWER = 0x20
"""The bit that makes a small letter of a capital one."""

_BLOCK = 32
"""Digits in a row that count once; no float64 needs more than 17, and no slice ends within a block."""

_EIGHT_TRUE = np.uint64(0x0101010101010101)

_FAR_DIGIT = b"2"[0]
"""First digit of an exponent of three. From 200 on, of either sign, a number may be at the edge of float64; with a
smaller exponent that takes more than 60 digits in a row, and those count."""


@dataclass(frozen=True, slots=True)
class Weight:
    """What a JSON text holds.

    Attributes:
        containers: structs and lists.
        texts: texts, the names of fields among them.
        commas: as many numbers as it can hold, nearly.
        extremes: numbers at the edge of float64, and blocks of digits in long ones: an estimate, so no part of
            comparisons.
    """

    containers: int
    texts: int
    commas: int
    extremes: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Bounds:
    """The most that one call of a decoder is given. Texts and numbers are cheap; structs and extremes are not."""

    containers: int
    texts: int
    commas: int
    extremes: int = 2_000

    def excess(self, weight: Weight) -> str | None:
        """Return what a weight has too much of, as words for an error; None where it is within the bounds."""
        for num, most, what in (
            (weight.containers, self.containers, "objects and lists"),
            (weight.texts, self.texts, "texts"),
            (weight.commas, self.commas, "values"),
            (weight.extremes, self.extremes, "numbers beyond 1e200 or of many digits"),
        ):
            if num > most:
                return f"at most {most:,} {what} are taken, and it has {num:,}"
        return None


FULL = Bounds(containers=150_000, texts=800_000, commas=4_500_000)
"""Bounds of a frame. A MarkerArray of 5,000 markers has 100,000 containers and 350,000 texts with all fields written
out; an occupancy grid of 2,000 x 2,000 cells has 4 million numbers. Decoding that much takes 20 to 100 ms. A number at
the edge of float64 takes msgspec 14 us, 500 times as long as another: 2.5 million `1e308` in 16 MB took it 34 s."""

LIGHT = Bounds(containers=15_000, texts=60_000, commas=320_000)
"""Bounds of what is checked field by field in Python, at 1 to 3 us each, and numbers 0.2 us: 50 ms. A depth image of
640 x 480 with NaN in it, the largest message that ordinary clients spell that way, has 307,200 numbers."""


def weigh(text: bytes | memoryview) -> Weight:
    """Count what a JSON text holds at most: characters inside texts count as if they stood outside.

    Args:
        text: in UTF-8; need not be JSON.
    """
    if isinstance(text, bytes) and len(text) < _SHORT:  # an image, for one: next to nothing in it counts
        commas, braces, brackets = (_count_few(text, mark) for mark in (b",", b"{", b"["))
        if max(commas, braces, brackets) < _FEW:
            containers = braces + brackets
            return Weight(containers, 2 * (commas + containers) + 1, commas)  # between two texts stands one of these
    data = np.frombuffer(text, np.uint8)
    containers = quotes = commas = extremes = 0
    for start in range(0, len(data), _SLICE):
        part = data[start : start + _SLICE]
        containers += int(np.count_nonzero(part == _BRACE)) + int(np.count_nonzero(part == _BRACKET))
        quotes += int(np.count_nonzero(part == _QUOTE))
        commas += int(np.count_nonzero(part == _COMMA))
        extremes += _count_extremes(data, start, part, None)
    return Weight(containers, quotes // 2, commas, extremes)


def _count_few(text: bytes, mark: bytes) -> int:
    """Count a character up to _FEW; where it is rare that takes a tenth of the time that `bytes.count` takes."""
    position, num = text.find(mark), 0
    while position >= 0 and num < _FEW:
        num += 1
        position = text.find(mark, position + 1)
    return num


def weigh_exactly(text: bytes | memoryview) -> Iterator[Weight]:
    """Count what a JSON text holds; yields the weight so far after each slice, a millisecond of work.

    Args:
        text: in UTF-8. Where it is no JSON, the figures mean nothing, and a decoder refuses it.
    """
    data = np.frombuffer(text, np.uint8)
    containers = quotes = commas = extremes = 0
    is_inside = is_escaped = False
    for start in range(0, max(len(data), 1), _SLICE):
        part = data[start : start + _SLICE]
        marks, is_escaped = _real_quotes(part, is_escaped=is_escaped)
        # An odd number of quotes so far: the character stands inside a text.
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
    """Count the exponents from 200 on, and the blocks of digits, in a slice.

    Args:
        data: the whole text: a number may go on behind the slice.
        start: where the slice begins.
        part: the slice.
        outside: where it stands outside texts; None counts everywhere.
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
    at = at[at + 5 <= len(data)]  # a sign and four digits; what ends a number follows in any case
    at += (data[at] == _PLUS) | (data[at] == _MINUS)
    for i in range(3):  # step by step: few of the letters in an image's base64 are followed by a digit
        at = at[(data[at + i] - _ZERO) < 10]  # noqa: PLR2004 - as above
    # a fourth digit: zeros may stand in front of an exponent
    is_far = (data[at] >= _FAR_DIGIT) | ((data[at + 3] - _ZERO) < 10)  # noqa: PLR2004 - as above
    return num_blocks + int(np.count_nonzero(is_far))


def _real_quotes(part: npt.NDArray[np.uint8], *, is_escaped: bool) -> tuple[npt.NDArray[np.uint8], bool]:
    """The quotes that begin or end a text, as ones among zeros, and whether the next character is escaped.

    Args:
        part: of the text.
        is_escaped: its first character follows a backslash that counts.
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
    """Raise MemoryError if there is no memory for so many bytes.

    msgspec (0.22) does not look whether it got the memory for a text, and writes to address 0: the process is gone. The
    text is at most as long as its body, so where this succeeds, that does.
    """
    np.empty(size + 64, np.uint8)  # not written to; behind the characters, a str of ASCII takes 41 bytes
