"""Pictures of the rooms of the package and of the arrows between them, from the imports in the sources."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from textwrap import wrap
from typing import Final

from scripts.docs_pages.svg import Point, arrow, box, document, text

PACKAGE: Final = "rosbridge_sim"


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture of the rooms in one folder.

    Attributes:
        folder: the folder within the package; empty for the package.
        rooms: upper left corner, size [px] and meaning of each room, the highest first. "." is the files beside them.
        size: of the picture [px].
        title: for people who cannot see it.
        floor: height of the line between rooms that do I/O and pure rooms [px]; 0 for none.
    """

    folder: str
    rooms: Mapping[str, tuple[Point, Point, str]]
    size: Point
    title: str
    floor: float = 0.0


PACKAGE_ROOMS: Final = Picture(
    "",
    {
        "cli": ((40, 30), (1020, 80), "commands of the command line, and the tools behind them"),
        "campaign_runs": ((300, 140), (760, 80), "workers, programs beside a simulator, folders of results"),
        "environments": ((300, 250), (540, 80), "environments for Gymnasium"),
        "worlds": ((220, 360), (620, 80), "many worlds without a server"),
        "doctor": ((40, 360), (160, 80), "checks of a rosbridge"),
        "contracts": ((40, 250), (160, 80), "what an app relies on"),
        "client": ((40, 470), (240, 80), "for programs and the command line"),
        "shell": ((300, 470), (540, 80), "sockets, tasks, clock, disk, signals"),
        "link": ((40, 580), (400, 80), "a client's connection; texts for terminals"),
        "simulator": ((250, 720), (590, 96), "kernel, scene, synchronous mode, topics and services"),
        "campaigns": ((860, 720), (200, 96), "plan, judge, report"),
        "mock": ((860, 856), (200, 96), "mocks of robots"),
        "graph": ((140, 856), (270, 96), "participants, topics, services, actions"),
        "morai": ((430, 856), (265, 96), "MORAI's messages, commands, releases"),
        "protocol": ((40, 992), (180, 80), "the wire of one client"),
        "schema": ((240, 992), (210, 80), "message definitions, compiled"),
        "scenarios": ((470, 992), (225, 80), "scenario files, models"),
        "scenery": ((715, 992), (145, 80), "what sensors see"),
        "maps": ((470, 1102), (370, 80), "maps without a format, and their readers"),
        "documents": ((40, 1212), (410, 96), "models of users' files, and their mistakes"),
        "world": ((470, 1212), (590, 96), "motion, lanes, lights, traffic: numpy"),
    },
    (1100, 1340),
    "Rooms of the package; an arrow leads from a room to a room below that it imports, and its words name all",
    floor=690.0,
)

SIMULATOR_ROOMS: Final = Picture(
    "simulator",
    {
        ".": ((40, 30), (920, 80), "node_factory makes all; simulator_node is what the shell sees"),
        "morai_services": ((40, 150), (290, 80), "MORAI's topics and services"),
        "sim_services": ((350, 150), (300, 80), "our topics and services under /sim/"),
        "snapshots": ((670, 150), (290, 80), "the whole state as bytes, and back"),
        "sensor_services": ((40, 270), (290, 80), "lists, adds, moves sensors"),
        "markers": ((350, 270), (300, 80), "map and scene as markers"),
        "replays": ((670, 270), (290, 80), "recorded drives"),
        "sensor_rigs": ((40, 390), (290, 80), "what is mounted on egos"),
        "story": ((670, 390), (290, 80), "stories of OpenSCENARIO"),
        "sensors": ((40, 510), (290, 80), "GPS, IMU, cameras, lidars, radars"),
        "sensor_data": ((40, 630), (180, 80), "points, boxes, files"),
        "kernel": ((240, 630), (720, 80), "context, hooks, the steps of frames"),
        "egos": ((40, 750), (600, 80), "egos: controls, odometry, transforms"),
        "sync": ((670, 750), (290, 80), "synchronous mode, barrier"),
        "scene": ((40, 870), (600, 80), "population of the world, and its map"),
        "bus": ((40, 990), (450, 80), "publishers, subscribers, services, names, rates"),
        "plain": ((510, 990), (450, 80), "values as plain data and bytes"),
    },
    (1000, 1100),
    "Rooms of the simulator; an arrow leads from a room to a room below that it imports, and its words name all",
)

SHELL_ROOMS: Final = Picture(
    "shell",
    {
        ".": ((40, 30), (1040, 80), "app builds a server from settings, assembly its parts; attach dials bridges"),
        "monitoring": ((40, 150), (180, 80), "log, metrics, client topics"),
        "ros1": ((240, 150), (150, 80), "node of ROS 1"),
        "drawing": ((410, 150), (180, 80), "a process that draws; maps"),
        "bags": ((610, 150), (180, 80), "recordings on the disk"),
        "ros2": ((810, 150), (270, 80), "a node on the graph of ROS 2"),
        "websocket": ((40, 270), (330, 80), "the server, and the connections of its clients"),
        "rendering": ((390, 270), (200, 80), "OpenGL, Embree, JPEG"),
        "files": ((610, 270), (300, 80), "files of the user and of clients"),
        "mocking": ((930, 250), (150, 100), "mocks, faults"),
        "transport": ((40, 390), (155, 80), "bytes of a socket"),
        "page": ((215, 390), (155, 80), "files of the page"),
        "kernels": ((390, 390), (200, 80), "compiles loops in C"),
        "config": ((610, 390), (300, 80), "settings: flags, variables, a file"),
        "clocks": ((930, 390), (150, 80), "time of day, timers"),
    },
    (1120, 500),
    "Rooms of the shell; an arrow leads from a room to a room below that it imports, and its words name all",
)

WORLD_ROOMS: Final = Picture(
    "world",
    {
        "many_worlds": ((40, 30), (930, 80), "many small worlds in one set of arrays, moved by the same step"),
        ".": ((40, 140), (930, 80), "one step in a fixed order; scores; demand; saved worlds"),
        "kernels": ((40, 260), (490, 80), "loops in C for drivers on lanes"),
        "followers": ((40, 370), (490, 80), "entities on lanes and paths, self-driving egos"),
        "lane_changes": ((40, 480), (270, 80), "reasons, gaps, safety, motion"),
        "drivers": ((40, 590), (270, 80), "what a driver sees, wants, yields to"),
        "people": ((330, 590), (200, 80), "people on foot"),
        "vehicle": ((550, 590), (200, 80), "tyres, actuators, sensors"),
        "contacts": ((770, 590), (200, 80), "collisions and impacts"),
        "state": ((40, 710), (930, 80), "arrays with a row for each entity"),
        "roads": ((40, 830), (930, 80), "lanes, paths, stop lines, traffic lights"),
        "geometry": ((40, 950), (930, 80), "angles, polylines, grids, near pairs"),
    },
    (1010, 1060),
    "Rooms of the world; an arrow leads from a room to a room below that it imports, and its words name all",
)


def read_arrows(root: Path, picture: Picture = PACKAGE_ROOMS) -> set[tuple[str, str]]:
    """Return the pairs of rooms of a picture of which the first imports something from the second.

    Args:
        root: folder of the package.
        picture: the rooms.
    """
    folder = root / picture.folder
    base = ".".join([PACKAGE, *filter(None, [picture.folder])])
    arrows = set()
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).parts
        room = parts[0] if len(parts) > 1 else "."
        for name in _imports(path):
            if not name.startswith(base + "."):
                continue
            target = name.removeprefix(base + ".").partition(".")[0]
            if target not in picture.rooms and (folder / f"{target}.py").is_file():
                target = "."
            if {room, target} <= picture.rooms.keys() and room != target:
                arrows.add((room, target))
    return arrows


_FIRST_BODY = re.compile(r"^(?:@|class |def |async def )", re.MULTILINE)
_IMPORT = re.compile(r"\bimport\b")


def parse_imports(text: str) -> ast.Module:
    """Return a tree that has all imports of a source: only of its head, where nothing is imported behind it.

    The head ends before the first function or class. In most files it is a tenth of the text.
    """
    head = text[: found.start()] if (found := _FIRST_BODY.search(text)) else text
    try:
        return ast.parse(text if _IMPORT.search(text, len(head)) else head)
    except SyntaxError:  # a line of the docstring begins like a class
        return ast.parse(text)


@cache
def _imports(path: Path) -> list[str]:
    imports = []
    for node in ast.walk(parse_imports(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom):
            imports += [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            imports += [alias.name for alias in node.names]
    return imports


def draw_rooms(root: Path, picture: Picture = PACKAGE_ROOMS) -> str:
    """Return the rooms and their arrows as SVG.

    Arrows that follow from two others are left out, and those to a room that is not straight below: the words in the
    box name all rooms that it imports.

    Args:
        root: folder of the package.
        picture: the rooms.
    """
    arrows = read_arrows(root, picture)
    order = list(picture.rooms)
    parts = [
        arrow(*ends)
        for first, second in sorted(arrows, key=lambda pair: (order.index(pair[0]), order.index(pair[1])))
        if not any((first, other) in arrows and (other, second) in arrows for other in order)
        if (ends := _ends(picture, first, second))
    ]
    width, height = picture.size
    if picture.floor:
        floor, right = picture.floor, width - 20
        parts.append(
            f'<line x1="20" y1="{floor:g}" x2="{right:g}" y2="{floor:g}" stroke="#b0481e" stroke-width="1.4"'
            ' stroke-dasharray="7 5"/>'
        )
        end = width - 260  # between the arrows that cross the line
        parts.append(text((end, floor - 8), "above: sockets, tasks, clocks, files", size=12, anchor="end"))
        parts.append(text((end, floor + 18), "below: the same calls give the same values", size=12, anchor="end"))
    for name, (at, size, meaning) in picture.rooms.items():
        lines = [f"{name}/" if name != "." else FILES, meaning]
        lines += _imports_in_words(picture, name, arrows)
        parts.append(box(at, size, lines))
    return document(int(width), int(height), picture.title, parts)


def _imports_in_words(picture: Picture, name: str, arrows: set[tuple[str, str]]) -> list[str]:
    """Return lines with the rooms that a room imports; a longer list than a line has those that it does not import."""
    (_, y), (width, height), _ = picture.rooms[name]
    below = [other for other, (at, _, _) in picture.rooms.items() if at[1] >= y + height]
    imported = [other for other in picture.rooms if (name, other) in arrows]
    missing = [other for other in below if other not in imported]
    most = int(width / LETTER) - 2
    words = f"imports: {_listed(imported) or 'no other room'}"
    if len(words) > most and 3 * len(missing) < len(imported) and set(imported) <= set(below):
        words = "imports: all rooms below" + (f" but {_listed(missing)}" if missing else "")
    num = len(wrap(words, most))
    return next(lines for size in range(len(words) // num, most + 1) if len(lines := wrap(words, size)) == num)


def _listed(rooms: Sequence[str]) -> str:
    return ", ".join(FILES if room == "." else room for room in rooms)


FILES: Final = "files beside the rooms"

LETTER: Final = 6.0
"""Mean width of a letter of the small font [px]."""


def _ends(picture: Picture, first: str, second: str) -> tuple[Point, Point] | None:
    """Return where the arrow between two rooms starts and ends: straight down, in the middle of what both share.

    None if they share no column, or the second one is above.
    """
    (x1, y1), (width1, height1), _ = picture.rooms[first]
    (x2, y2), (width2, _), _ = picture.rooms[second]
    left, right = max(x1, x2), min(x1 + width1, x2 + width2)
    if left >= right or y2 < y1 + height1:
        return None
    return ((left + right) / 2, y1 + height1), ((left + right) / 2, y2)
