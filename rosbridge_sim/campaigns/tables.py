"""The table of a campaign as CSV, as columns, and as JUnit XML for CI.

The table has what a drive determines: no times, hosts or dates. So it is the same, byte for byte, however many
processes drove the runs, and in whatever order. `times.csv` has the rest.
"""

from __future__ import annotations

import csv
import html
import io
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

from rosbridge_sim.campaigns.run_results import SCORES, Result

_FIRST: Final = ("run", "driver", "scenario", "seed")
_JUDGED: Final = ("verdict", "limit", "at", "x", "y", "reason")
_LAST: Final = ("frames", "state_hash")

Cell = str | int | float | bool | None


def columns_of(results: Sequence[Result], parameters: Sequence[str]) -> dict[str, list[Cell]]:
    """Return the table by columns: run, parameters, verdict, scores. A cell of a run that drove nothing is None.

    Args:
        results: in the order of the table.
        parameters: names of the parameters; one with the name of another column gets `parameter_` before it.
    """
    taken = {*_FIRST, *_JUDGED, *SCORES, *_LAST}
    names = {name: f"parameter_{name}" if name in taken else name for name in parameters}
    rows = [_row(result, names) for result in results]
    header = [*_FIRST, *names.values(), *_JUDGED, *SCORES, *_LAST]
    return {column: [row.get(column) for row in rows] for column in header}


def _row(result: Result, names: dict[str, str]) -> dict[str, Cell]:
    run = result.run
    first = result.breaches[0] if result.breaches else None
    return {
        "run": run.number,
        "driver": run.driver,
        "scenario": run.scenario,
        "seed": run.seed,
        **{column: run.parameters.get(name) for name, column in names.items()},
        "verdict": result.verdict,
        **({} if first is None else {"limit": first.limit, "at": first.time, "x": first.x, "y": first.y}),
        "reason": result.reason or None,
        **result.scores,
        "frames": result.frames,
        "state_hash": result.state_hash or None,
    }


def write_table(results: Sequence[Result], parameters: Sequence[str]) -> str:
    """Return `runs.csv`: a row for each run, with a header.

    Args:
        results: in the order of the table.
    """
    columns = columns_of(results, parameters)
    return _csv([list(columns), *zip(*columns.values(), strict=True)])


def write_times(results: Iterable[Result]) -> str:
    """Return `times.csv`: what each run took [s], which process drove it, and how often it was driven again.

    Args:
        results: in the order of the table.
    """
    rows: list[list[Cell]] = [
        [each.run.number, f"{each.wall:.4f}", f"{each.cpu:.4f}", each.worker, each.retries, each.trouble]
        for each in results
    ]
    header: list[Cell] = ["run", "wall", "cpu", "worker", "retries", "trouble"]
    return _csv([header, *rows])


def _csv(rows: Iterable[Iterable[Cell]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(map(_cell, row) for row in rows)
    return text.getvalue()


def _cell(value: Cell) -> str:
    """Return a cell. A text that a spreadsheet would take for a formula gets an apostrophe before it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = str(value)
    return f"'{text}" if isinstance(value, str) and text[:1] in {"=", "+", "-", "@"} else text


def write_junit(results: Sequence[Result], name: str) -> str:
    """Return the results as JUnit XML: a suite for each driver on each scenario, a test case for each run.

    Args:
        results: in the order of the table.
    """
    suites: dict[tuple[str, str], list[Result]] = {}
    for each in results:
        suites.setdefault((each.run.driver, each.run.scenario), []).append(each)
    lines = ['<?xml version="1.0" encoding="utf-8"?>', f"<testsuites {_counts(results)} name={_quoted(name)}>"]
    for (driver, scenario), members in suites.items():
        lines.append(f"  <testsuite name={_quoted(f'{driver} on {scenario}')} {_counts(members)}>")
        lines += [_case(each, f"{name}.{driver}.{scenario}") for each in members]
        lines.append("  </testsuite>")
    return "\n".join([*lines, "</testsuites>", ""])


def _counts(results: Sequence[Result]) -> str:
    num = Counter(each.verdict for each in results)
    seconds = sum(each.wall for each in results)
    return (
        f'tests="{len(results)}" failures="{num["fail"] + num["flaky"]}" errors="{num["error"]}"'
        f' skipped="{num["skipped"]}" time="{seconds:.3f}"'
    )


def _case(result: Result, group: str) -> str:
    title = f"run {result.run.number} {result.run.chosen}"
    head = f'    <testcase classname={_quoted(group)} name={_quoted(title)} time="{result.wall:.3f}"'
    if result.verdict == "pass":
        return f"{head}/>"
    tag = {"fail": "failure", "flaky": "failure", "error": "error", "skipped": "skipped"}[result.verdict]
    kind = "" if tag == "skipped" else f' type="{result.verdict}"'
    more = "\n".join(breach.told for breach in result.breaches)
    return f"{head}><{tag}{kind} message={_quoted(result.reason)}>{html.escape(_plain(more))}</{tag}></testcase>"


_NOT_XML: Final = re.compile(r"[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def _plain(text: str) -> str:
    return _NOT_XML.sub("?", text)


def _quoted(text: str) -> str:
    return f'"{html.escape(_plain(" ".join(text.split())))}"'
