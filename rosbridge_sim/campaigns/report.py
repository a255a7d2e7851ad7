"""The page of a campaign's results: one HTML file that loads nothing, with its data, pictures and script inside."""

from __future__ import annotations

import html
import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.campaigns.parameter_strength import strongest_parameters
from rosbridge_sim.campaigns.report_pictures import draw_curve, draw_scene
from rosbridge_sim.campaigns.run_results import BAD, SCORES, VERDICTS, Result
from rosbridge_sim.campaigns.tables import Cell, columns_of
from rosbridge_sim.records import Record

MAX_DETAILS: Final = 50
"""Most runs with pictures: 20 kB each. The others have their folder, and `campaign show`."""

MAX_LOG: Final = 6_000
"""Characters of a driver's output in the page, its end."""

MAX_AGAIN: Final = 20
"""Most runs that are named as driven again."""

MAX_PATHS: Final = 10_000
"""Most small pictures of paths; 0.3 kB each."""


class PageParts(Record):
    """The fixed parts of the page.

    Attributes:
        page: HTML with `{{name}}` where something is filled in.
        style, script: CSS and JavaScript.
    """

    page: str
    style: str
    script: str


class Details(Record):
    """Files of a run that did not pass.

    Attributes:
        result: of the run.
        trace: figure -> values over time; empty if nothing is kept.
        scene: lanes and neighbours, as `worker` writes them; empty if nothing is kept.
        log: what the driver printed.
        files: names -> links.
        command: repeats the run.
    """

    result: Result
    trace: Mapping[str, Sequence[float]]
    scene: Mapping[str, Any]
    log: str
    files: Mapping[str, str]
    command: str


def write_report(
    parts: PageParts, name: str, results: Sequence[Result], parameters: Sequence[str], details: Sequence[Details]
) -> str:
    """Return the page.

    Args:
        results: in the order of the table.
        details: of runs that did not pass, at most `MAX_DETAILS`.
    """
    counts = Counter(result.verdict for result in results)
    bad = sum(counts[verdict] for verdict in BAD)
    filled = {
        "title": html.escape(name),
        "style": parts.style,
        "outcome": "fail" if bad else "pass",
        "sentence": _sentence(len(results), bad),
        "counts": "".join(
            f'<li class="{verdict}"><strong>{counts[verdict]:,}</strong> {verdict}</li>'
            for verdict in VERDICTS
            if counts[verdict]
        ),
        "limits": _limits(results),
        "failures": _failures(details, bad),
        "data": _data(results, parameters, details),
        "script": parts.script,
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: filled[found[1]], parts.page)


def _sentence(num: int, bad: int) -> str:
    if not num:
        return "No run was driven."
    return f"{bad:,} of {num:,} runs did not pass." if bad else f"All {num:,} runs pass."


def _limits(results: Sequence[Result]) -> str:
    """Return a list of limits, and how many runs broke each."""
    broken = Counter(name for result in results for name in {breach.limit for breach in result.breaches})
    errors = Counter(result.reason for result in results if result.verdict == "error")
    rows = [f"<li><strong>{num:,}</strong> {html.escape(name)}</li>" for name, num in broken.most_common(20)]
    rows += [
        f'<li class="error"><strong>{num:,}</strong> {html.escape(reason)}</li>'
        for reason, num in errors.most_common(20)
    ]
    kept = f"<ul>{''.join(rows)}</ul>" if rows else "<p>Every limit was kept.</p>"
    again = [f"run {each.run.number}" for each in results if each.retries]
    if not again:
        return kept
    more = f" and {len(again) - MAX_AGAIN:,} more" if len(again) > MAX_AGAIN else ""
    told = f"Driven again, because the worker was killed: {', '.join(again[:MAX_AGAIN])}{more}."
    return f'{kept}<p id="again">{told}</p>'


def _failures(details: Sequence[Details], bad: int) -> str:
    if not bad:
        return "<p>None.</p>"
    told = "" if bad <= len(details) else f"<p>The first {len(details):,} of {bad:,}.</p>"
    return told + "\n".join(_section(each, is_open=i == 0) for i, each in enumerate(details))


def _section(each: Details, *, is_open: bool) -> str:
    result, run = each.result, each.result.run
    title = html.escape(f"{run.driver} on {run.scenario} {run.chosen}: {result.reason}")
    lines = [
        f'<details id="run-{run.number}"{" open" if is_open else ""}><summary>run {run.number} ',
        f'<strong class="{result.verdict}">{result.verdict}</strong> {title}</summary><div>',
    ]
    if result.breaches:
        rows = "".join(f"<li>{html.escape(breach.told)}</li>" for breach in result.breaches)
        lines.append(f"<ul>{rows}</ul>")
    if each.trace:
        at = result.breaches[0].time if result.breaches else None
        scene = draw_scene(each.trace, each.scene, f"map of run {run.number}")
        lines.append(
            f'<div class="pair"><figure>{scene}<figcaption>The last ten seconds: the way of the ego (line), its'
        )
        lines.append(" place at the end, and others around it (grey).</figcaption></figure><figure>")
        for figure, unit in (("speed", "m/s"), ("distance", "m"), ("time_to_collision", "s")):
            lines.append(draw_curve(each.trace["time"], each.trace[figure], figure, unit, at))
        lines.append("</figure></div>")
    links = " ".join(f'<a href="{html.escape(link)}">{html.escape(name)}</a>' for name, link in each.files.items())
    if links:
        lines.append(f"<p>Files: {links}</p>")
    lines.append(f"<p>Repeat it, to the state <code>{html.escape(result.state_hash or '-')}</code>:</p>")
    lines.append(f'<pre tabindex="0">{html.escape(each.command)}</pre>')
    if each.log.strip():
        lines.append(f'<p>The driver\'s output:</p><pre tabindex="0">{html.escape(each.log[-MAX_LOG:].strip())}</pre>')
    return "".join([*lines, "</div></details>"])


def _data(results: Sequence[Result], parameters: Sequence[str], details: Sequence[Details]) -> str:
    columns = columns_of(results, parameters)
    names = list(columns)
    first = names.index("seed") + 1
    chosen = names[first : first + len(parameters)]
    data = {
        "columns": {name: [_plain(value) for value in values] for name, values in columns.items()},
        "parameters": chosen,
        "strongest": strongest_parameters(columns, chosen),
        "scores": list(SCORES),
        "paths": [
            [number for place in result.path for number in place] or None if i < MAX_PATHS else None
            for i, result in enumerate(results)
        ],
        "shown": [each.result.run.number for each in details],
    }
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _plain(value: Cell) -> Cell:
    return None if isinstance(value, float) and not math.isfinite(value) else value
