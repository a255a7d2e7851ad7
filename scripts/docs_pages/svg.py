"""Pieces of SVG that the generated pictures of the documentation share.

Colours come from `currentColor` and from two fills that are readable on a light and on a dark page, so one picture
serves both colour schemes of the site. No picture loads a font or anything else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

Point = tuple[float, float]
"""x to the right and y down [px]."""

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif"

INK = "#37474f"
PAPER = "#ffffff"
BOX_FILL = "#e3edf7"
PAUSED_FILL = "#fff3d6"

HEAD = 9.0
"""Length of an arrow's head [px]."""


def document(width: int, height: int, title: str, parts: Iterable[str]) -> str:
    """Return a whole SVG file on a white ground.

    Args:
        width: of the picture [px].
        height: of the picture [px].
        title: text for screen readers.
        parts: elements, the lowest first.
    """
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
        f' role="img" font-family="{FONT}" font-size="14">\n<title>{escape(title)}</title>\n'
        f'<rect width="{width}" height="{height}" rx="8" fill="{PAPER}"/>\n{body}\n</svg>\n'
    )


def text(at: Point, words: str, *, size: float = 14, anchor: str = "middle", weight: str = "normal") -> str:
    """Return one line of text.

    Args:
        at: where its baseline is.
        words: not escaped yet.
        size: of the font [px].
        anchor: `start`, `middle` or `end`.
        weight: of the font, as CSS has it.
    """
    return (
        f'<text x="{at[0]:g}" y="{at[1]:g}" font-size="{size:g}" font-weight="{weight}" text-anchor="{anchor}"'
        f' fill="{INK}">{escape(words)}</text>'
    )


def box(at: Point, size: Point, lines: Sequence[str], *, fill: str = BOX_FILL) -> str:
    """Return a rounded box with its first line in bold and the others small.

    Args:
        at: its upper left corner.
        size: width and height.
        lines: of text; at least one.
        fill: colour of its ground.
    """
    x, y = at
    width, height = size
    first = y + height / 2 - (len(lines) - 1) * 9 + 5
    parts = [
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="10" fill="{fill}" stroke="{INK}"/>',
        text((x + width / 2, first), lines[0], weight="bold"),
        *(text((x + width / 2, first + 18 * i), line, size=12) for i, line in enumerate(lines[1:], 1)),
    ]
    return "\n".join(parts)


def quadratic_point(start: Point, bend: Point, end: Point, share: float) -> Point:
    """Return the point of a quadratic Bezier curve at a parameter from 0 to 1."""
    a, b, c = (1 - share) ** 2, 2 * share * (1 - share), share**2
    return a * start[0] + b * bend[0] + c * end[0], a * start[1] + b * bend[1] + c * end[1]


def arrow(start: Point, end: Point, bend: Point | None = None) -> str:
    """Return a line with a head at its end, bent towards a point if one is given."""
    way = bend or ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    angle = math.atan2(end[1] - way[1], end[0] - way[0])
    sides = [
        f"{end[0] - HEAD * math.cos(angle + turn):.1f},{end[1] - HEAD * math.sin(angle + turn):.1f}"
        for turn in (-0.45, 0.45)
    ]
    return (
        f'<path d="M{start[0]:.1f},{start[1]:.1f} Q{way[0]:.1f},{way[1]:.1f} {end[0]:.1f},{end[1]:.1f}" fill="none"'
        f' stroke="{INK}" stroke-width="1.4"/>'
        f'<polygon points="{end[0]:.1f},{end[1]:.1f} {sides[0]} {sides[1]}" fill="{INK}"/>'
    )
