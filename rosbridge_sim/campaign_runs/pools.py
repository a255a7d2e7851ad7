"""Pools that drive runs: processes of this machine, or tasks of a Ray cluster. Libraries do the scheduling.

Processes are pebble's: it kills a worker that takes too long, replaces one that has died, and says which task it had.
"""

from __future__ import annotations

import multiprocessing
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, Final, Protocol

from rosbridge_sim.campaign_runs.job import Job
from rosbridge_sim.campaign_runs.outcome import told_error
from rosbridge_sim.campaign_runs.program_groups import end_groups
from rosbridge_sim.campaign_runs.worker import KILLED, RETIRED, drive_in_worker, settle_worker
from rosbridge_sim.campaigns.run_results import Result, Run
from rosbridge_sim.errors import DocumentError


class Pool(Protocol):
    """Takes runs, and gives results later."""

    num_tasks: int
    """Tasks that should wait or run at a time."""

    def submit(self, runs: Sequence[Run], *, timeout: float, may_keep: bool) -> Future[list[Result]]:
        """Drive some runs of one driver.

        Args:
            timeout: longest time of all of them together [s].
            may_keep: as for `drive_runs`.
        """

    def why(self, error: BaseException, runs: Sequence[Run]) -> str:
        """Return what the error of a task means; empty if the task was lost by no fault of its runs.

        What its worker has left behind is removed.
        """

    def was_killed(self, error: BaseException) -> bool:
        """Return whether the error of a task means that its worker was killed from outside."""

    def close(self, *, is_done: bool) -> None:
        """End all workers; at once, if the runs are not done."""


TERM_TIMEOUT: Final = 0.6
"""Time from SIGTERM to SIGKILL of a worker [s]. Its program has 0.2 s, see `program_drives`."""


class LocalPool:
    """Processes of this machine.

    Attributes:
        num_tasks: two for each process, so that none waits for the next one.
    """

    def __init__(self, job: Job, num_jobs: int) -> None:
        try:
            import pebble  # noqa: PLC0415 - an extra
            from pebble.common.types import CONSTS  # noqa: PLC0415
        except ImportError:
            raise DocumentError(
                "campaigns need the extra rosbridge-sim[campaign]: pip install 'rosbridge-sim[campaign]'"
            ) from None
        CONSTS.term_timeout = TERM_TIMEOUT
        self._job, self._work = job, Path(job.folder) / ".work"
        self.num_tasks = 2 * num_jobs
        has_fork_server = "forkserver" in multiprocessing.get_all_start_methods() and _has_temporary_folder()
        context = multiprocessing.get_context("forkserver" if has_fork_server else "spawn")
        if has_fork_server:
            context.set_forkserver_preload(["rosbridge_sim.campaign_runs.worker"])
        self._make: Callable[[], Any] = lambda: pebble.ProcessPool(
            max_workers=num_jobs, initializer=settle_worker, context=context
        )
        self._pool = self._make()
        self._expired: type[BaseException] = pebble.ProcessExpired

    def submit(self, runs: Sequence[Run], *, timeout: float, may_keep: bool) -> Future[list[Result]]:
        """See `Pool`."""
        if not self._pool.active:  # pebble gives up if a worker dies between two tasks
            self._end()
            self._pool = self._make()
        future: Future[list[Result]] = self._pool.schedule(
            drive_in_worker, args=[self._job, runs], kwargs={"may_keep": may_keep}, timeout=timeout
        )
        return future

    def why(self, error: BaseException, runs: Sequence[Run]) -> str:
        """See `Pool`."""
        for run in runs:
            end_groups(self._work, f"run-{run.number}-*")
            for folder in self._work.glob(f"run-{run.number}-*"):
                shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, TimeoutError):
            return "time-out: the worker hung, and was killed"
        if isinstance(error, self._expired):
            code = getattr(error, "exitcode", None)
            if code == RETIRED:
                return ""
            how = f"signal {-code}" if isinstance(code, int) and code < 0 else f"code {code}"
            return f"the worker process died with {how}: the driver crashed it, or the machine has no memory left"
        if isinstance(error, BrokenProcessPool):
            return ""
        return f"an internal error: {told_error(error)}"

    def was_killed(self, error: BaseException) -> bool:
        """See `Pool`. A driver that kills its own process in this way cannot be told from it."""
        killed = {KILLED, -signal.SIGTERM, -getattr(signal, "SIGKILL", signal.SIGTERM)}
        return isinstance(error, self._expired) and getattr(error, "exitcode", None) in killed

    def close(self, *, is_done: bool) -> None:
        """See `Pool`."""
        if is_done:
            self._pool.close()
            self._pool.join()
        else:
            self._end()
        end_groups(self._work)

    def _end(self) -> None:
        """End all workers at once: pebble alone ends one after another."""
        self._pool.stop()
        workers = multiprocessing.active_children()
        for worker in workers:
            worker.terminate()
        end = time.monotonic() + TERM_TIMEOUT
        for worker in workers:
            worker.join(max(end - time.monotonic(), 0.0))
        for worker in workers:
            worker.kill()
        self._pool.join()


def open_pool(job: Job, num_jobs: int, ray: str | None) -> Pool:
    """Return processes of this machine, or a Ray cluster.

    Args:
        ray: address of a cluster, or `local`; None for processes.

    Raises:
        DocumentError: an extra is missing, or the cluster cannot be reached.
    """
    if ray is None:
        return LocalPool(job, num_jobs)
    from rosbridge_sim.campaign_runs.ray_pool import RayPool  # noqa: PLC0415 - an extra of 200 MB

    return RayPool(job, num_jobs, ray)


def _has_temporary_folder() -> bool:
    """Return whether this process can write temporary files: the socket of a fork server is one."""
    try:
        tempfile.gettempdir()
    except FileNotFoundError:
        return False
    return True
