"""`rosbridge-sim campaign list`, `show`, `report` and `compare`: what is in folders of results."""

from __future__ import annotations

import math

from rosbridge_sim.campaign_runs.results_folder import read_origin, read_text_of, run_folder
from rosbridge_sim.campaign_runs.stored_folder import open_results
from rosbridge_sim.campaigns.comparison import compare_results
from rosbridge_sim.campaigns.run_results import Result
from rosbridge_sim.cli.tools.text import note, put_json, put_lines, put_table

MAX_LOG_SHOWN = 4_000
"""Characters of a driver's output that `show` prints, its end."""


def list_runs(folder: str, verdict: str | None, *, is_json: bool) -> None:
    """List the runs of a folder of results.

    Args:
        verdict: only the runs with this one; None for all.
        is_json: a JSON value on each line.

    Raises:
        DocumentError: it is no such folder.
    """
    results = [each for each in _results(folder) if verdict in {None, each.verdict}]
    if is_json:
        for each in results:
            put_json(each.to_json())
    else:
        rows = [(str(each.run.number), each.verdict, each.run.title, each.reason) for each in results]
        put_table(("run", "verdict", "what", "reason"), rows)


def show(folder: str, number: int, *, is_json: bool) -> None:
    """Explain one run.

    Raises:
        DocumentError: there is no such run.
    """
    place = run_folder("", number)
    with open_results(folder, fetch=(place.as_posix(),)) as opened:
        read_origin(opened.path)
        result = opened.result_of(number)
        log = opened.path / place / "log.txt"
        text = log.read_text("utf-8", "replace") if log.is_file() else ""
    if is_json:
        put_json(result.to_json())
        return
    put_lines(f"run {number}: {result.run.title}\nverdict: {result.verdict} {result.reason}".rstrip())
    for breach in result.breaches:
        put_lines(f"  {breach.told}")
    if result.verdicts:
        put_lines(f"drives: {', '.join(result.verdicts)}")
    put_table(("score", "value"), [(name, _number(value)) for name, value in result.scores.items()])
    put_lines(f"frames: {result.frames}\nstate: {result.state_hash or '-'}")
    for name in result.files:
        put_lines(f"file: {opened.name_of((place / name).as_posix())}")
    if result.retries:
        put_lines(f"driven again, because the worker was killed: {result.retries} times")
    if result.trouble:
        put_lines(result.trouble)
    put_lines(f"repeat: rosbridge-sim campaign repeat {opened.title} {number}")
    if text:
        put_lines(f"\nthe driver's output:\n{text[-MAX_LOG_SHOWN:].rstrip()}")


def report(folder: str) -> None:
    """Write tables and report anew.

    Raises:
        DocumentError: it is no such folder, or cannot be written.
    """
    from rosbridge_sim.campaign_runs.job import open_job  # noqa: PLC0415 - imports all that drives, and pictures
    from rosbridge_sim.campaign_runs.writing import write_all  # noqa: PLC0415 - as above

    with open_results(folder, fetch=None, tell=note) as opened:
        job, name = read_text_of(opened.path)
        write_all(opened, open_job(job).campaign, opened.results(), name)
    put_lines(opened.name_of("report.html"))


def compare(before: str, after: str, *, may_lack: bool, is_json: bool) -> int:
    """List what changed between two folders.

    Args:
        may_lack: runs that are missing in `after` are no failure.

    Returns:
        1 if runs that passed do so no longer, or are missing, else 0.

    Raises:
        DocumentError: one is no such folder.
    """
    found = compare_results(_results(before), _results(after))
    if is_json:
        put_json(found.to_json())
    else:
        for line in found.lines():
            put_lines(line)
    return int(bool(found.regressions) or (bool(found.missing) and not may_lack))


def _results(folder: str) -> list[Result]:
    with open_results(folder) as opened:
        read_origin(opened.path)
        return opened.results()


def _number(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.6g}"
