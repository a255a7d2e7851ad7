"""A canvas of characters on which lines are drawn as dots: eight Braille dots in each character.

A terminal's character is about twice as high as wide, so the dots (two side by side, four on top of each other) lie on
a square grid. Each character has one colour: that of the line that was drawn last.
"""

from __future__ import annotations

import unicodedata
from enum import Enum
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray

__all__ = ["DOTS_X", "DOTS_Y", "Canvas", "Ink", "fit"]

DOTS_X: Final = 2
DOTS_Y: Final = 4
"""Dots in a character, side by side and on top of each other."""

_BITS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
"""(DOTS_Y, DOTS_X) bit of each dot in the Unicode block of Braille patterns."""

_BRAILLE: Final = 0x2800

_PLAIN: Final = " .:*#"
"""Characters for 0, 1..2, 3..4, 5..6 and 7..8 dots, where the terminal has no Braille."""

MAX_DOTS: Final = 2_000_000
"""Dots that lines may take in one picture, those outside of it included: 50 ms of work. Farther ones are left out."""


class Ink(Enum):
    """A colour: the codes for terminals of 16 and of 256 colours."""

    NONE = ("", "")
    GRID = ("90", "38;5;238")
    ROAD = ("90", "38;5;245")
    WHITE = ("37", "38;5;253")
    YELLOW = ("33", "38;5;220")
    RED = ("31", "38;5;203")
    GREEN = ("32", "38;5;78")
    VEHICLE = ("94", "38;5;75")
    PEDESTRIAN = ("33", "38;5;214")
    OBSTACLE = ("37", "38;5;137")
    TRAIL = ("35", "38;5;133")
    EGO = ("1;95", "1;38;5;205")
    STRONG = ("1", "1")
    WARNING = ("1;31", "1;38;5;203")
    BAR = ("7", "7")


_INKS: Final = tuple(Ink)
_NUMBERS: Final = {ink: i for i, ink in enumerate(_INKS)}


class Canvas:
    """Characters in rows, top to bottom."""

    def __init__(self, width: int, height: int) -> None:
        """Make an empty canvas.

        Args:
            width: characters in a row, at least 1.
            height: rows, at least 1.
        """
        self.width, self.height = width, height
        self._dots = np.zeros((height, width), dtype=np.uint8)
        self._ink = np.zeros((height, width), dtype=np.uint8)
        self._texts: dict[tuple[int, int], tuple[str, Ink]] = {}

    def lines(self, ends: FloatArray, ink: Ink) -> None:
        """Draw straight lines.

        Args:
            ends: (k, 4) x and y of the first and of the second end [dots], from the top left corner.
            ink: their colour.
        """
        limit = np.array([self.width * DOTS_X, self.height * DOTS_Y], dtype=np.float64)
        low, high = np.minimum(ends[:, :2], ends[:, 2:]), np.maximum(ends[:, :2], ends[:, 2:])
        ends = ends[((high >= 0.0) & (low < limit)).all(axis=1) & np.isfinite(ends).all(axis=1)]
        way = ends[:, 2:] - ends[:, :2]
        num = np.ceil(np.abs(way).max(axis=1, initial=0.0)).astype(np.int64) + 1
        fits = np.cumsum(num) <= MAX_DOTS
        ends, way, num = ends[fits], way[fits], num[fits]
        if not len(num):
            return
        line = np.repeat(np.arange(len(num)), num)
        place = np.arange(len(line)) - np.repeat(np.cumsum(num) - num, num)
        part = place / np.maximum(num - 1, 1)[line]
        self.dots(np.floor(ends[line, :2] + part[:, None] * way[line]).astype(np.int64), ink)

    def dots(self, places: IntArray, ink: Ink) -> None:
        """Draw dots.

        Args:
            places: (k, 2) x and y [dots]; those outside are left out.
            ink: their colour.
        """
        x, y = places.T
        inside = (x >= 0) & (x < self.width * DOTS_X) & (y >= 0) & (y < self.height * DOTS_Y)
        x, y = x[inside], y[inside]
        np.bitwise_or.at(self._dots, (y // DOTS_Y, x // DOTS_X), _BITS[y % DOTS_Y, x % DOTS_X])
        self._ink[y // DOTS_Y, x // DOTS_X] = _NUMBERS[ink]

    def text(self, column: int, row: int, text: str, ink: Ink) -> None:
        """Write a text over the dots; what does not fit into the row is left out.

        Args:
            column: of its first character.
            row: from the top.
            text: characters of one column each, others become `?`.
            ink: its colour.
        """
        if not 0 <= row < self.height:
            return
        for i, char in enumerate(text):
            if 0 <= column + i < self.width:
                self._texts[row, column + i] = (char if _width(char) == 1 else "?"), ink

    def rows(self, *, num_colours: int, has_braille: bool) -> list[str]:
        """Return the rows as texts.

        Args:
            num_colours: 0, 16 or 256.
            has_braille: the terminal can show Braille.
        """
        counts = np.unpackbits(self._dots[:, :, None], axis=2).sum(axis=2)
        return [
            self._row(row, counts[row].tolist(), num_colours, has_braille=has_braille) for row in range(self.height)
        ]

    def _row(self, row: int, counts: list[int], num_colours: int, *, has_braille: bool) -> str:
        parts: list[str] = []
        now = Ink.NONE
        for column, (dots, ink_number) in enumerate(
            zip(self._dots[row].tolist(), self._ink[row].tolist(), strict=True)
        ):
            char, ink = " ", Ink.NONE
            text = self._texts.get((row, column))
            if text is not None:
                char, ink = text
            elif dots:
                char = chr(_BRAILLE + dots) if has_braille else _PLAIN[(counts[column] + 1) // 2]
                ink = _INKS[ink_number]
            if num_colours and ink is not now and char != " ":
                parts.append(paint(ink, num_colours))
                now = ink
            parts.append(char)
        if now is not Ink.NONE:
            parts.append("\x1b[0m")
        return "".join(parts).rstrip(" ") if now is Ink.NONE else "".join(parts)


def paint(ink: Ink, num_colours: int) -> str:
    """Return the control sequence that begins a colour; empty without colours."""
    code = ink.value[0] if num_colours <= 16 else ink.value[1]  # noqa: PLR2004 - the two columns of `Ink`
    return f"\x1b[0;{code}m" if code else "\x1b[0m"


def fit(text: str, width: int) -> str:
    """Return as much of a text as fits into so many columns.

    Args:
        text: without control characters.
        width: columns; Korean and Chinese characters take two.
    """
    for i, char in enumerate(text):
        width -= _width(char)
        if width < 0:
            return text[:i]
    return text


def columns(text: str) -> int:
    """Return the columns that a text takes."""
    return sum(map(_width, text))


def _width(char: str) -> int:
    if unicodedata.combining(char):
        return 0
    return 2 if unicodedata.east_asian_width(char) in "WF" else 1
