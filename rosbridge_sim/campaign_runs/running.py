"""Running a campaign: which runs are left, who drives them, and what is written as the results come.

The library of the pool schedules, kills and replaces. Here is only what is ours: a result for each run exactly once, a
row with its reason for a task that was lost, the quota of files, and an end in two seconds on Ctrl-C.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from typing import Final

from rosbridge_sim.campaign_runs.pools import Pool
from rosbridge_sim.campaign_runs.results_folder import ResultsFolder
from rosbridge_sim.campaigns.campaign import Campaign
from rosbridge_sim.campaigns.run_results import BAD, Result, Run
from rosbridge_sim.records import replace

Tell = Callable[[Result], None]

SPARE: Final = 30.0
"""A task may take this much longer than its drives, for maps that are read at first [s]."""

RESERVED: Final = 32 * 2**20
"""Room on the disk that is left to the table and the report [bytes]: 100,000 rows take 30 MB."""

MAX_LOSSES: Final = 3
"""So often a run is given to another worker, if its own was lost by no fault of it."""


def cut_into_tasks(campaign: Campaign, runs: Iterable[Run]) -> Iterator[tuple[Run, ...]]:
    """Yield runs that are driven together: those of a driver that takes batches, else one each.

    Args:
        runs: in the order of the table.
    """
    waiting: list[Run] = []
    for run in runs:
        most = max(campaign.drivers[run.driver].batch, 1)
        if waiting and (waiting[0].driver != run.driver or waiting[0].scenario != run.scenario or len(waiting) >= most):
            yield tuple(waiting)
            waiting = []
        waiting.append(run)
    if waiting:
        yield tuple(waiting)


@dataclass(slots=True)
class CampaignRunner:
    """Drives runs and writes their results.

    Attributes:
        folder: takes the results.
        pool: drives.
        tell: called with each result, for the progress.
        num_retries: so often a run is driven again whose worker was killed from outside.
        used: bytes of the files that are kept.
        trouble: why the disk does not take the results; empty if it does.
    """

    campaign: Campaign
    folder: ResultsFolder
    pool: Pool
    tell: Tell
    num_retries: int = 0
    used: int = 0
    trouble: str = ""
    _losses: dict[int, int] = field(default_factory=dict)
    _kills: dict[int, int] = field(default_factory=dict)

    def drive(self, runs: Sequence[Run]) -> list[Result]:
        """Drive runs; return their results in the order of their numbers.

        Args:
            runs: each is driven once.

        Raises:
            KeyboardInterrupt: Ctrl-C; the results so far are written.
        """
        tasks = cut_into_tasks(self.campaign, runs)
        flying: dict[Future[list[Result]], tuple[tuple[Run, ...], str]] = {}
        again: list[tuple[Run, ...]] = []
        results: list[Result] = []
        while True:
            while len(flying) < self.pool.num_tasks:
                task = again.pop() if again else next(tasks, None)
                if task is None:
                    break
                why_not = self._why_not_keep()
                flying[self._submit(task, may_keep=not why_not)] = task, why_not
            if not flying:
                return sorted(results, key=lambda result: result.run.number)
            done, _ = wait(flying, timeout=1.0, return_when=FIRST_COMPLETED)
            for future in done:
                task, why_not = flying.pop(future)
                error = future.exception()
                if error is None:
                    found = future.result()
                elif len(task) > 1:  # one of them did it: each alone
                    self.pool.why(error, task)
                    again += [(run,) for run in task]
                    continue
                else:
                    why_lost = self._why_lost(error, task[0])
                    if not why_lost:
                        again.append(task)
                        continue
                    found = [Result(task[0], "error", why_lost)]
                results += [self._take(result, why_not) for result in found]

    def _why_lost(self, error: BaseException, run: Run) -> str:
        """Return why a run has no result; empty if it is driven again."""
        why = self.pool.why(error, (run,))
        if why and self.pool.was_killed(error):
            kills = self._kills.get(run.number, 0)
            if kills < self.num_retries:
                self._kills[run.number] = kills + 1
                return ""
        if why:
            return why
        lost = self._losses[run.number] = self._losses.get(run.number, 0) + 1
        return "" if lost <= MAX_LOSSES else f"the worker was lost {lost} times"

    def _why_not_keep(self) -> str:
        """Return why files of further runs are not kept; empty if they are."""
        quota = self.campaign.document.output.quota_mb
        if self.used >= quota * 2**20:
            return f"files are not kept: the quota of {quota:,} MB is used up"
        if self.folder.free < RESERVED:
            return f"files are not kept: the disk has less than {RESERVED >> 20} MB left"
        return ""

    def _submit(self, task: tuple[Run, ...], *, may_keep: bool) -> Future[list[Result]]:
        driver = self.campaign.drivers[task[0].driver]
        document = self.campaign.document
        seconds = driver.timeout * document.repeat * len(task) + SPARE * driver.is_program
        return self.pool.submit(task, timeout=seconds, may_keep=may_keep)

    def _take(self, result: Result, why_not: str) -> Result:
        output = self.campaign.document.output
        if num_retries := self._kills.get(result.run.number, 0):
            result = replace(result, retries=num_retries)
        if result.files:
            self.used += self.folder.size_of(result)
            if self.used > output.quota_mb * 2**20:
                self.used -= self.folder.size_of(result)
                self.folder.drop(result)
                why_not = f"files are not kept: they are beyond the quota of {output.quota_mb:,} MB"
                result = replace(result, files=())
        is_wanted = output.keep == "all" or (output.keep == "failures" and result.verdict in BAD)
        if why_not and is_wanted and not result.files:
            result = replace(result, trouble=why_not)
        self.trouble = self.folder.append(result)
        self.tell(result)
        return result


@dataclass(slots=True)
class Progress:
    """Progress of a campaign.

    Attributes:
        num: runs in all.
        done: runs that have a result.
        bad: those that did not pass.
        began: monotonic time of the start [s].
        first: results that were there at the start.
    """

    num: int
    done: int = 0
    bad: int = 0
    began: float = field(default_factory=time.monotonic)
    first: int = 0

    def line(self, now: float) -> str:
        """Return a line of text: counts, rate, failures, time left."""
        seconds = max(now - self.began, 1e-3)
        rate = (self.done - self.first) / seconds
        left = (self.num - self.done) / rate if rate > 0 else 0.0
        share = self.done / max(self.num, 1)
        bar = ("#" * int(share * _BAR)).ljust(_BAR, ".")
        told = f"{int(left) // 60}:{int(left) % 60:02d} left" if rate > 0 else "..."
        return f"[{bar}] {self.done:,} of {self.num:,}  {rate:.1f}/s  {self.bad:,} not passed  {told}"


_BAR: Final = 24
