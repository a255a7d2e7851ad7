"""`rosbridge-sim campaign run`, `check` and `repeat`: the commands that drive, or would."""

from __future__ import annotations

import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NoReturn

from rosbridge_sim.campaign_runs.checking import check_job, find_scenario_mistakes
from rosbridge_sim.campaign_runs.job import Job, open_job, read_job
from rosbridge_sim.campaign_runs.merging import merge_folders
from rosbridge_sim.campaign_runs.pools import Pool, open_pool
from rosbridge_sim.campaign_runs.results_folder import ResultsFolder, read_text_of
from rosbridge_sim.campaign_runs.running import CampaignRunner, Progress
from rosbridge_sim.campaign_runs.searching import drive_search
from rosbridge_sim.campaign_runs.stored_folder import open_results, temporary_folder
from rosbridge_sim.campaign_runs.writing import write_all
from rosbridge_sim.campaigns.campaign import Campaign, plan_runs
from rosbridge_sim.campaigns.run_results import BAD, VERDICTS, Result, Run
from rosbridge_sim.cli.tools.text import note, put_json, put_lines, put_progress, put_table
from rosbridge_sim.errors import DocumentError

INTERRUPTED = 130

_LINE_EVERY = 10.0
"""Time between two lines of progress where there is no terminal [s]."""


_REDRAWN_EVERY = 0.1
"""The same on a terminal [s]."""


def run(
    file: str,
    output: str | None,
    *,
    num_jobs: int,
    num_retries: int,
    shard: tuple[int, int] | None,
    is_resumed: bool,
    is_dry: bool,
    ray: str | None,
    is_json: bool,
) -> int:
    """Drive all runs of a campaign.

    Args:
        output: folder of the results, or an address; None for one named after the file, here.
        num_retries: so often a run is driven again whose worker was killed.
        shard: number from 1 on, and their number, if only that part of the runs is driven here.
        is_dry: list the runs alone.
        ray: address of a Ray cluster, or `local`; None for processes.
        is_json: print the counts as JSON.

    Returns:
        0 if all runs pass or are skipped, 1 if not, 130 after Ctrl-C.

    Raises:
        DocumentError: the campaign cannot be driven.
    """
    path = Path(file)
    campaign = check_job(read_job(path, Path()))
    if shard is not None and campaign.document.search is not None:
        raise DocumentError(f"{campaign.source}: search: --shard has no part of it: each run depends on the others")
    runs = _planned(campaign, shard)
    if is_dry:
        _put_plan(campaign, runs, is_json=is_json)
        return 0
    with open_results(output if output is not None else f"{path.stem}_runs", tell=note) as folder:
        job = read_job(path, folder.path)
        folder.hold()  # before the pool: its end kills what the folder's drives have left behind
        try:
            pool = open_pool(job, num_jobs, ray)
            try:
                results = folder.begin(job, is_resumed=is_resumed)
            except DocumentError:
                pool.close(is_done=False)
                raise
            return _drive(job, campaign, runs, folder, pool, results=results, num_retries=num_retries, is_json=is_json)
        finally:
            folder.close()


def _planned(campaign: Campaign, shard: tuple[int, int] | None = None) -> list[Run]:
    """Return the runs of a campaign, or every n-th one: neighbours take about as long. A search has none before."""
    if campaign.document.search is not None:
        return []
    runs = plan_runs(campaign)
    return runs if shard is None else runs[shard[0] - 1 :: shard[1]]


def _num_runs(campaign: Campaign) -> int:
    search = campaign.document.search
    return search.budget * len(campaign.groups()) if search is not None else len(plan_runs(campaign))


def merge(folders: Sequence[str], output: str, *, is_json: bool) -> int:
    """Write the results of some folders of one campaign into a new one.

    Args:
        folders: such as those of its shards.

    Returns:
        0 if all runs of the campaign are there, and pass or are skipped; else 1.

    Raises:
        DocumentError: the folders cannot be merged.
    """
    with ExitStack() as opened:
        into = opened.enter_context(open_results(output, tell=note))
        parts = [opened.enter_context(open_results(each, fetch=None)) for each in folders]
        job, name = read_text_of(parts[0].path)
        campaign = open_job(job).campaign
        try:
            results = merge_folders(parts, into)
            write_all(into, campaign, results, name)
        finally:
            into.close()
    _put_counts(results, into, is_json=is_json)
    missing = sorted({run.number for run in _planned(campaign)} - {result.run.number for result in results})
    if missing:
        told = f"{len(missing):,} runs have no result, the first is run {missing[0]}"
        note(f"{told}; `campaign run FILE --resume --output {into.title}` drives them")
    return int(bool(missing) or any(each.verdict in BAD for each in results))


def _drive(
    job: Job,
    campaign: Campaign,
    runs: Sequence[Run],
    folder: ResultsFolder,
    pool: Pool,
    *,
    results: list[Result],
    num_retries: int,
    is_json: bool,
) -> int:
    is_search = campaign.document.search is not None
    num = _num_runs(campaign) if is_search else len(runs)
    there = {result.run.number: result for result in results}
    bad = sum(result.verdict in BAD for result in results)
    progress = Progress(num, done=len(there), bad=bad, first=len(there))
    shower = _Shower(progress)

    def tell(result: Result) -> None:
        there[result.run.number] = result
        progress.done += 1
        progress.bad += result.verdict in BAD
        shower.show()

    used = sum(folder.size_of(each) for each in results)
    runner = CampaignRunner(campaign, folder, pool, tell, num_retries, used)
    is_done = False
    before = {signal.SIGINT: signal.getsignal(signal.SIGINT), signal.SIGTERM: signal.signal(signal.SIGTERM, _interrupt)}
    try:
        if is_search:
            drive_search(runner, there)
        else:
            runner.drive([each for each in runs if each.number not in there])
        is_done = True
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second one would leave workers behind
        shower.end()
        note("stopped: what is done is kept; --resume does the rest")
    finally:
        pool.close(is_done=is_done)
        for number, handler in before.items():
            signal.signal(number, handler)
        shower.end()
    if runner.trouble:
        raise DocumentError(f"{folder.title}: results could not be written: {runner.trouble}")
    ordered = [there[number] for number in sorted(there)]
    write_all(folder, campaign, ordered, Path(job.source).stem)
    _put_counts(ordered, folder, is_json=is_json)
    if not is_done:
        return INTERRUPTED
    return int(any(each.verdict in BAD for each in ordered))


def _interrupt(*_: object) -> NoReturn:
    raise KeyboardInterrupt


class _Shower:
    """Shows the progress on stderr: one line that is written over on a terminal, else a line now and then."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._is_terminal = sys.stderr.isatty()
        self._last = time.monotonic()
        self._is_open = False

    def show(self) -> None:
        """Show the progress, if it is time."""
        now = time.monotonic()
        if self._is_terminal:
            if now - self._last > _REDRAWN_EVERY or self._progress.done == self._progress.num:
                self._last, self._is_open = now, True
                put_progress(self._progress.line(now))
        elif now - self._last > _LINE_EVERY:
            self._last = now
            note(self._progress.line(now))

    def end(self) -> None:
        """End the line."""
        if self._is_open:
            self._is_open = False
            sys.stderr.write("\n")
            sys.stderr.flush()


def _put_counts(results: list[Result], folder: ResultsFolder, *, is_json: bool) -> None:
    counts = Counter(result.verdict for result in results)
    num_again = sum(result.retries > 0 for result in results)
    report = folder.name_of("report.html")
    if is_json:
        told: dict[str, int] = {verdict: counts[verdict] for verdict in VERDICTS}
        more = {"again": num_again, "folder": folder.title, "report": report}
        put_json({"runs": len(results), **told, **more})
        return
    told_counts = ", ".join(f"{counts[verdict]:,} {verdict}" for verdict in VERDICTS if counts[verdict])
    put_lines(f"{len(results):,} runs: {told_counts or 'none'}")
    for result in [each for each in results if each.verdict in BAD][:_MOST_LISTED]:
        put_lines(f"  run {result.run.number} {result.verdict}: {result.reason}")
    if num_again:
        put_lines(f"driven again, because the worker was killed: {num_again:,}")
    put_lines(f"report: {report}")


_MOST_LISTED = 5


def _put_plan(campaign: Campaign, runs: Sequence[Run], *, is_json: bool) -> None:
    """List the runs; of a search what it would vary."""
    search = campaign.document.search
    if search is not None:
        num = len(campaign.groups())
        if is_json:
            put_json({"search": search.worst, "groups": num, "budget": search.budget})
        else:
            put_lines(f"a search for the least {search.worst}: {num} times at most {search.budget:,} runs")
        return
    for each in runs:
        if is_json:
            values = {"scenario": each.scenario, "driver": each.driver, "seed": each.seed}
            put_json({"run": each.number, **values, "parameters": dict(each.parameters)})
        else:
            put_lines(f"{each.number}  {each.title}")


def check(file: str, *, is_json: bool) -> None:
    """Explain a campaign's file, and read its scenarios.

    Raises:
        DocumentError: it has a mistake, or a scenario cannot be read.
    """
    path = Path(file)
    job = read_job(path, path.parent)
    campaign = check_job(job)
    if mistakes := find_scenario_mistakes(job):
        raise DocumentError("\n".join(mistakes))
    told = {
        "runs": _num_runs(campaign),
        "scenarios": list(campaign.scenarios),
        "drivers": list(campaign.drivers),
        "parameters": list(campaign.parameters),
        "seeds": len(campaign.seeds),
        "seconds": campaign.document.seconds,
        "repeat": campaign.document.repeat,
    }
    if is_json:
        put_json(told)
        return
    shown = {key: ", ".join(value) if isinstance(value, list) else f"{value:,}" for key, value in told.items()}
    put_table(("good", path.name), [(key, value) for key, value in shown.items() if value])


def repeat(folder: str, number: int, *, is_json: bool) -> int:
    """Drive one run again.

    Returns:
        0 if it ends with the same verdict and state, else 1.

    Raises:
        DocumentError: there is no such run.
    """
    with open_results(folder) as there:
        job, _ = read_text_of(there.path)
        before = there.result_of(number)
    with temporary_folder() as work:
        again = Job(job.text, job.source, job.base, work)
        campaign = open_job(again).campaign
        pool = open_pool(again, 1, None)
        results: list[Result] = []
        into = ResultsFolder(Path(work))
        is_done = False
        try:
            into.begin(again, is_resumed=False)
            results = CampaignRunner(campaign, into, pool, lambda _result: None).drive([before.run])
            is_done = True
        finally:
            pool.close(is_done=is_done)
            into.close()
        log = Path(work) / "runs" / f"{number:05d}" / "log.txt"
        output = log.read_text("utf-8") if log.is_file() else ""
    after = results[0]
    is_same = (after.verdict, after.state_hash) == (before.verdict, before.state_hash)
    if is_json:
        put_json({"same": is_same, "before": before.to_json(), "after": after.to_json()})
        return int(not is_same)
    put_lines(f"run {number}: {before.run.title}")
    put_lines(
        f"before: {before.verdict} {before.reason}\n        {before.frames} frames, state {before.state_hash or '-'}"
    )
    put_lines(f"now:    {after.verdict} {after.reason}\n        {after.frames} frames, state {after.state_hash or '-'}")
    put_lines("the same" if is_same else "not the same")
    if output.strip():
        put_lines(f"\nthe driver's output:\n{output.rstrip()}")
    return int(not is_same)
