"""The work of one worker: runs in, results out. Whatever goes wrong in a run becomes its row, never an exception."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import shutil
import signal
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from rosbridge_sim.campaign_runs.job import Job, LoadedJob, open_job
from rosbridge_sim.campaign_runs.outcome import Outcome, told_error, told_trace
from rosbridge_sim.campaign_runs.program_drives import drive_by_program
from rosbridge_sim.campaign_runs.program_groups import adopt_orphans, note_group
from rosbridge_sim.campaign_runs.python_drives import drive_in_python
from rosbridge_sim.campaign_runs.results_folder import run_folder
from rosbridge_sim.campaigns.campaign import is_skipped
from rosbridge_sim.campaigns.campaign_model import DriverItem
from rosbridge_sim.campaigns.drive_limits import judge_trace
from rosbridge_sim.campaigns.run_results import BAD, Breach, Result, Run, Verdict
from rosbridge_sim.campaigns.trace import FIGURES
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.records import replace

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]


def settle_worker() -> None:
    """Prepare a worker process for what drivers may do.

    It ends on SIGTERM without an exception, which a driver could catch, and leaves Ctrl-C to the campaign. It leads a
    group, so that copies of it can be ended. What compiled code prints goes nowhere; the rest is kept in the log.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: os._exit(KILLED))
    adopt_orphans()
    if hasattr(os, "setsid"):
        with contextlib.suppress(OSError):
            os.setsid()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)
    os.close(nowhere)


def drive_in_worker(job: Job, runs: Sequence[Run], *, may_keep: bool) -> list[Result]:
    """Drive and judge runs in a worker of a pool; arguments as for `drive_runs`.

    A worker in which drivers have left too much memory retires first, and another one takes the runs.
    """
    driver = open_job(job).campaign.drivers[runs[0].driver]
    place = Path(job.folder) / ".work" / f"worker-{os.getpid()}"
    if not place.is_dir():
        with contextlib.suppress(OSError):
            place.mkdir(parents=True)
            note_group(place, os.getpid())
    if not driver.is_program and data_size() > RETIRE_SHARE * driver.memory_mb * 2**20:
        os._exit(RETIRED)
    with limited_memory(driver):
        return drive_runs(job, runs, may_keep=may_keep)


KILLED: Final = 128 + signal.SIGTERM
"""Exit code of a worker that was told to end, as shells have it."""

RETIRED: Final = 75
"""Exit code of a worker that has retired; `EX_TEMPFAIL` of sysexits.h."""

RETIRE_SHARE: Final = 0.7
"""Share of a driver's `memory_mb` beyond which a worker takes no further run."""


def drive_runs(job: Job, runs: Sequence[Run], *, may_keep: bool = True) -> list[Result]:
    """Drive and judge some runs of one driver.

    Args:
        runs: the runs; more than one for a driver that takes a batch.
        may_keep: write the files of runs that the campaign wants to keep; False beyond its quota.
    """
    loaded = open_job(job)
    campaign = loaded.campaign
    driver = campaign.drivers[runs[0].driver]
    found: dict[int, Result] = {}
    driven: list[Run] = []
    for run in runs:
        try:
            if is_skipped(campaign, run.parameters, run.seed):
                found[run.number] = Result(run, "skipped", "skip_when holds")
            else:
                driven.append(run)
        except DocumentError as error:
            found[run.number] = Result(run, "error", str(error))
    if driven:
        found.update(_drive(loaded, driver, driven, may_keep=may_keep))
    return [found[run.number] for run in runs]


def _drive(loaded: LoadedJob, driver: DriverItem, runs: Sequence[Run], *, may_keep: bool) -> dict[int, Result]:
    """Drive runs as often as the campaign wants; return the results by the runs' numbers."""
    output = loaded.campaign.document.output
    judged: dict[int, list[Result]] = {run.number: [] for run in runs}
    who = f"{os.getpid()}@{platform.node()}"
    for attempt in range(loaded.campaign.document.repeat):
        began, cpu = time.perf_counter(), time.process_time()
        if driver.is_program:
            should_record = output.record and may_keep and output.keep != "none"
            outcomes = [drive_by_program(loaded, driver, run, record=should_record) for run in runs]
        else:
            outcomes = drive_in_python(loaded, driver, runs)
        wall, used = (time.perf_counter() - began) / len(runs), (time.process_time() - cpu) / len(runs)
        for run, outcome in zip(runs, outcomes, strict=True):
            verdict, reason, breaches = _judge(loaded, outcome)
            is_kept = may_keep and (output.keep == "all" or (output.keep == "failures" and verdict in BAD))
            files: tuple[str, ...] = ()
            trouble = ""
            if is_kept and (attempt == 0 or not any(each.files for each in judged[run.number])):
                files, trouble = _keep(loaded.job.folder, run, outcome)
            if outcome.work is not None:
                shutil.rmtree(outcome.work, ignore_errors=True)
            judged[run.number].append(
                Result(
                    run,
                    verdict,
                    printable(reason),
                    breaches,
                    outcome.trace.scores(),
                    len(outcome.trace.rows),
                    outcome.state_hash,
                    tuple(outcome.trace.path()),
                    (),
                    files,
                    trouble,
                    wall,
                    used,
                    who,
                )
            )
    return {number: _joined(results) for number, results in judged.items()}


def _joined(results: Sequence[Result]) -> Result:
    """Return the result of a run from those of its drives: that of the first bad one, else of the first."""
    verdicts: tuple[Verdict, ...] = tuple(each.verdict for each in results)
    chosen = next((each for each in results if each.verdict in BAD), results[0])
    if len(results) == 1:
        return chosen
    is_flaky = len(set(verdicts)) > 1
    if is_flaky:
        text = f"{verdicts.count('pass')} of {len(verdicts)} drives passed; {chosen.reason}"
        chosen = replace(chosen, verdict="flaky", reason=text)
    return replace(
        chosen,
        verdicts=verdicts,
        files=next((each.files for each in results if each.files), ()),
        trouble=next((each.trouble for each in results if each.trouble), ""),
        wall=sum(each.wall for each in results),
        cpu=sum(each.cpu for each in results),
    )


def _judge(loaded: LoadedJob, outcome: Outcome) -> tuple[Verdict, str, tuple[Breach, ...]]:
    """Return verdict, reason and breaches of a drive."""
    breaches: tuple[Breach, ...] = ()
    if outcome.trace.rows:
        try:
            own = outcome.own.end()
            breaches = judge_trace(outcome.trace, loaded.campaign.limits, loaded.checks, own)
        except DocumentError as error:
            outcome.error = outcome.error or str(error)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - the user's function
            outcome.error = outcome.error or f"a limit's function failed: {told_error(error)}"
            outcome.log += told_trace(error)
        outcome.error = outcome.error or outcome.own.trouble
    if outcome.error:
        return "error", outcome.error, breaches
    if breaches:
        first = breaches[0]
        return "fail", f"{first.limit} at {first.time:g} s: {first.text}", breaches
    return "pass", "", ()


def _keep(folder: str, run: Run, outcome: Outcome) -> tuple[tuple[str, ...], str]:
    """Write the files of a run.

    Returns:
        Their names; and why others are missing, if the disk took no more.
    """
    place = run_folder(folder, run.number)
    trace = outcome.trace
    lines = [",".join(FIGURES), *(",".join(f"{value:.6g}" for value in row) for row in trace.rows)]
    scene = {
        "roads": outcome.roads,
        "neighbours": [[each.time, [list(box) for box in each.boxes]] for each in trace.neighbours],
    }
    texts = {"trace.csv": "\n".join([*lines, ""]), "scene.json": json.dumps(scene), "log.txt": outcome.log}
    kept: list[str] = []
    name = "the folder"
    try:
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        for name, text in texts.items():
            if text:
                (place / name).write_text(text, encoding="utf-8")
                kept.append(name)
        for file in sorted(outcome.work.iterdir()) if outcome.work is not None else ():
            name = file.name
            if file.suffix in {".mcap", ".json"} and file.name == printable(file.name):  # else no table can name it
                shutil.move(file, place / name)
                kept.append(name)
    except OSError as error:
        with contextlib.suppress(OSError):
            (place / name).unlink()  # a part of it
        return tuple(kept), f"{name} of the run, and what comes behind it, is not kept: {error.strerror}"
    return tuple(kept), ""


def data_size() -> int:
    """Return the private memory of this process, as its bound counts it [bytes]; 0 where that cannot be told."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    except (OSError, ValueError, IndexError, AttributeError):
        return 0


@contextlib.contextmanager
def limited_memory(driver: DriverItem) -> Iterator[None]:
    """Bound the memory of this process to a driver's `memory_mb` meanwhile. Programs have a bound of their own.

    Args:
        driver: of the runs.
    """
    if resource is None or driver.is_program:
        yield
        return
    before, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = driver.memory_mb * 2**20
    resource.setrlimit(resource.RLIMIT_DATA, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (before, hard))
