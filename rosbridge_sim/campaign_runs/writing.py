"""The tables and the report of a folder of results."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.campaign_runs.results_folder import ResultsFolder, run_folder
from rosbridge_sim.campaigns.campaign import Campaign
from rosbridge_sim.campaigns.report import MAX_DETAILS, Details, PageParts, write_report
from rosbridge_sim.campaigns.run_results import BAD, Result

__all__ = ["write_all"]

PAGE: Final = Path(__file__).resolve().parents[1] / "page" / "report"

MAX_READ: Final = 32 * 2**20
"""Longest kept file that is read for the page [bytes]; a trace of an hour has 40 MB, and is left out."""


def write_all(folder: ResultsFolder, campaign: Campaign, results: Sequence[Result], name: str) -> None:
    """Write the tables and the report anew.

    Args:
        results: in the order of the table.
        name: of the campaign.

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
    scene: Mapping[str, Any] = {}
    text = _read(place / "scene.json")
    if text:
        try:
            scene = json.loads(text)
        except ValueError:  # a full disk has cut it
            scene = {}
    files = {name: f"runs/{place.name}/{name}" for name in result.files}
    command = f"rosbridge-sim campaign repeat {folder.path} {number}"
    return Details(result, _read_trace(place / "trace.csv"), scene, _read(place / "log.txt"), files, command)


def _read(path: Path) -> str:
    """Return a kept file; empty if it is not there."""
    try:
        return path.read_text("utf-8", "replace") if path.stat().st_size <= MAX_READ else ""
    except OSError:
        return ""


def _read_trace(path: Path) -> dict[str, list[float]]:
    """Return the figures of a kept trace; empty if there is none, or a full disk has cut it."""
    rows = list(csv.reader(_read(path).splitlines()))
    try:
        numbers = [[float(cell) for cell in row] for row in rows[1:]]
        return {name: list(column) for name, column in zip(rows[0], zip(*numbers, strict=True), strict=True)}
    except (ValueError, IndexError):
        return {}
