"""The picture of the rooms of the package and of the arrows between them, from the imports in the sources."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Final

from scripts.docs_pages.svg import Point, arrow, box, document, text

__all__ = ["draw_rooms", "read_arrows"]

PACKAGE: Final = "rosbridge_sim"

ROOMS: Final[dict[str, tuple[Point, Point, str]]] = {
    "cli": ((40, 30), (800, 92), "commands of the command line, and the tools behind them"),
    "client": ((40, 160), (800, 92), "client for programs and tests, blocking and asynchronous; used by the tools"),
    "shell": ((40, 290), (800, 92), "sockets, tasks, clock, disk, signals"),
    "morai": ((40, 436), (800, 92), "MORAI's services, units, scenarios and maps; synchronous mode"),
    "graph": ((40, 566), (480, 92), "participants, topics, services, parameters, actions, rosapi"),
    "protocol": ((40, 696), (230, 92), "the wire of one client"),
    "schema": ((290, 696), (230, 92), "message definitions, compiled"),
    "world": ((560, 566), (280, 92), "motion, lanes, lights, traffic: numpy"),
}
"""Upper left corner, size [px] and meaning of each room, the highest first."""

OUTSIDE_FLOOR: Final = 410.0
"""Height of the line between rooms that do I/O and pure rooms [px]."""


def read_arrows(root: Path) -> set[tuple[str, str]]:
    """Return the pairs of rooms of which the first imports something from the second.

    Args:
        root: folder of the package.
    """
    arrows = set()
    for path in sorted(root.rglob("*.py")):
        room = path.relative_to(root).parts[0]
        if room not in ROOMS:
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                parts = name.split(".")
                if parts[0] == PACKAGE and len(parts) > 1 and parts[1] in ROOMS and parts[1] != room:
                    arrows.add((room, parts[1]))
    return arrows


def draw_rooms(root: Path) -> str:
    """Return the rooms and their arrows as SVG; arrows that follow from two others are left out.

    Args:
        root: folder of the package.
    """
    arrows = read_arrows(root)
    order = list(ROOMS)
    parts = [
        arrow(*_ends(first, second))
        for first, second in sorted(arrows, key=lambda pair: (order.index(pair[0]), order.index(pair[1])))
        if not any((first, other) in arrows and (other, second) in arrows for other in ROOMS)
    ]
    parts.append(
        f'<line x1="20" y1="{OUTSIDE_FLOOR:g}" x2="860" y2="{OUTSIDE_FLOOR:g}" stroke="#b0481e" stroke-width="1.4"'
        ' stroke-dasharray="7 5"/>'
    )
    parts.append(text((860, OUTSIDE_FLOOR - 8), "above: sockets, tasks, clocks, files", size=12, anchor="end"))
    parts.append(text((860, OUTSIDE_FLOOR + 18), "below: the same calls give the same values", size=12, anchor="end"))
    for name, (at, size, meaning) in ROOMS.items():
        inner = sorted(one.name for one in (root / name).iterdir() if (one / "__init__.py").is_file())
        lines = [f"{name}/", meaning]
        if inner:
            lines.append("rooms within: " + ", ".join(inner))
        imported = [other for other in order if (name, other) in arrows]
        lines.append("imports: " + (", ".join(imported) or "no other room"))
        parts.append(box(at, size, lines))
    return document(880, 820, "Rooms of the package; an arrow leads from a room to a room that it imports", parts)


def _ends(first: str, second: str) -> tuple[Point, Point]:
    """Return where the arrow between two rooms starts and ends: straight down, in the middle of what both share."""
    (x1, y1), (width1, height1), _ = ROOMS[first]
    (x2, y2), (width2, _), _ = ROOMS[second]
    x = (max(x1, x2) + min(x1 + width1, x2 + width2)) / 2
    return (x, y1 + height1), (x, y2)
