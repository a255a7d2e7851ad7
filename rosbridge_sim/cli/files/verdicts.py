"""Results of checks of files (verdicts): good, with remarks, or with mistakes; for many files, with a total."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.cli.tools.text import note, put, put_json, put_progress
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.scenario import Spawn

CheckReport = Mapping[str, Any]
"""A JSON object with `file`, `mistakes` and `remarks`."""

MAX_LISTED: Final = 5
"""Mistakes and remarks of a file that are shown among many files; the command for a single file shows all."""


def put_whole(account: CheckReport, show: Callable[[Any], None], *, is_json: bool, is_strict: bool) -> int:
    """Print the result for a single file, and return the exit code; see `put_verdicts`.

    Args:
        show: prints all of it for people.
    """
    (put_json if is_json else show)(account)
    return int(bool(account["mistakes"] or (is_strict and account["remarks"])))


def draw(picture: str | None, what: str, road_map: RoadMap | None, spawns: Sequence[Spawn] = ()) -> None:
    """Draw a map and what stands on it, or print why not.

    Args:
        picture: path of the file; None draws nothing.
        what: what has mistakes if there is no map.

    Raises:
        DocumentError: the picture cannot be written.
    """
    if picture is None:
        return
    from rosbridge_sim.shell.drawing.map_picture import draw_map  # noqa: PLC0415 - it needs Pillow, only for pictures

    nothing = f"--picture: nothing is drawn, because the {what} has mistakes"
    if left_out := nothing if road_map is None else draw_map(road_map, Path(picture), spawns):
        note(left_out)


def put_verdict(account: CheckReport) -> None:
    """Print the result for a file on one line."""
    counts = [_plural(len(account[key]), key.removesuffix("s")) for key in ("mistakes", "remarks") if account[key]]
    put(f"{safe(account['file'])}: {', '.join(counts) or 'good'}")


def put_verdicts(
    command: str, files: Sequence[str], account_of: Callable[[str], CheckReport], *, is_json: bool, is_strict: bool
) -> int:
    """Print the results for many files, each as soon as it is known, and the totals.

    Args:
        command: command that shows everything about a single file.
        account_of: returns the report on a file; a `DocumentError` is its mistake.
        is_json: print one JSON value per line for programs.
        is_strict: remarks count like mistakes.

    Returns:
        The exit code: 1 if a file has mistakes, or has remarks and they count; else 0.
    """
    counts = {"good": 0, "with remarks": 0, "with mistakes": 0}
    has_progress = not sys.stdout.isatty()  # if the results go to a file, the terminal shows it
    for number, file in enumerate(files, 1):
        if has_progress:
            put_progress(f"[{number:,}/{len(files):,}] {safe(file)}")
        try:
            account = account_of(file)
        except DocumentError as error:
            account = {"file": file, "is_good": False, "mistakes": [str(error)], "remarks": []}
        counts["with mistakes" if account["mistakes"] else "with remarks" if account["remarks"] else "good"] += 1
        if is_json:
            put_json(account)
            continue
        put_verdict(account)
        for what in ("mistake", "remark"):
            lines = account[f"{what}s"]
            for line in lines[:MAX_LISTED]:
                put(f"  {what}: {safe(line)}")
            if len(lines) > MAX_LISTED:
                put(f"  ... and {_plural(len(lines) - MAX_LISTED, what)} more; rosbridge-sim {command} shows all")
    if has_progress:
        put_progress("")
    if not is_json:
        shown = ", ".join(f"{num:,} {verdict}" for verdict, num in counts.items() if num)
        put(f"{_plural(len(files), 'file')}: {shown}")
    return int(bool(counts["with mistakes"] or (is_strict and counts["with remarks"])))


def put_lines(title: str, lines: Sequence[str]) -> None:
    """Print lines with a title, if there are some."""
    if lines:
        put(f"\n{title}:")
        for line in lines:
            put(f"  {safe(line)}")


def _plural(num: int, what: str) -> str:
    return f"{num:,} {what}{'' if num == 1 else 's'}"
