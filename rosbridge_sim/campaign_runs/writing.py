"""The tables and the report of a folder of results."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, TypedDict

import msgspec

from rosbridge_sim.campaign_runs.results_folder import ResultsFolder, run_folder
from rosbridge_sim.campaigns.campaign import Campaign
from rosbridge_sim.campaigns.report import MAX_DETAILS, Details, PageParts, write_report
from rosbridge_sim.campaigns.run_results import BAD, MOST, Result
from rosbridge_sim.campaigns.trace import FIGURES

PAGE: Final = Path(__file__).resolve().parents[1] / "page" / "report"

MAX_READ: Final = 32 * 2**20
"""Longest kept file that is read for the page [bytes]; a trace of an hour has 40 MB, and is left out."""


def write_all(folder: ResultsFolder, campaign: Campaign, results: Sequence[Result], name: str) -> None:
    """Write the tables and the report anew.

    Args:
        results: in the order of the table.

    Raises:
        DocumentError: the disk takes no more.
    """
    folder.write_tables(results, campaign.parameters, name)
    parts = PageParts(*((PAGE / f"report.{kind}").read_text("utf-8") for kind in ("html", "css", "js")))
    bad = [result for result in results if result.verdict in BAD]
    details = [_details(folder, result) for result in bad[:MAX_DETAILS]]
    folder.write("report.html", write_report(parts, name, results, campaign.parameters, details))


def _details(folder: ResultsFolder, result: Result) -> Details:
    number = result.run.number
    place = run_folder(folder.path, number)
    files = {name: f"runs/{place.name}/{name}" for name in result.files}
    command = f"rosbridge-sim campaign repeat {folder.title} {number}"
    return Details(
        result,
        _read_trace(place / "trace.csv"),
        _read_scene(place / "scene.json"),
        _read(place / "log.txt"),
        files,
        command,
    )


def _read(path: Path) -> str:
    """Return a kept file; empty if it is not there."""
    try:
        return path.read_text("utf-8", "replace") if path.stat().st_size <= MAX_READ else ""
    except OSError:
        return ""


def _read_trace(path: Path) -> dict[str, list[float]]:
    """Return the figures of a kept trace; empty if there is none, or it is no whole trace."""
    try:
        header, *rows = csv.reader(_read(path).splitlines())
        columns = zip(*([float(cell) for cell in row] for row in rows), strict=True)
        trace = {name: list(column) for name, column in zip(header, columns, strict=True)}
    except (ValueError, csv.Error):  # a full disk has cut it, or it was written by hand
        return {}
    is_whole = trace.keys() >= set(FIGURES) and all(abs(value) <= MOST for name in _PLACE for value in trace[name])
    return trace if is_whole else {}


_PLACE: Final = ("time", "x", "y")


class _Scene(TypedDict, total=False):
    """Lanes and neighbours of a kept run; see `draw_scene`."""

    roads: list[list[tuple[float, float]]]
    neighbours: list[tuple[float, list[tuple[float, float, float, float, float, float, float, str]]]]


def _read_scene(path: Path) -> dict[str, Any]:
    """Return the lanes and neighbours of a kept run; empty if there are none, or it is no whole file."""
    try:
        return {**msgspec.json.decode(_read(path) or "{}", type=_Scene)}
    except (ValueError, RecursionError):  # as above
        return {}
