"""Pools that drive runs: processes of this machine, or tasks of a Ray cluster. Libraries do the scheduling.

Processes are pebble's: it kills a worker that takes too long, replaces one that has died, and says which task it had.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence
from concurrent.futures import Future
from typing import Final, Protocol

from rosbridge_sim.campaign_runs.job import Job
from rosbridge_sim.campaign_runs.worker import drive_runs, settle_worker
from rosbridge_sim.campaigns.results import Result, Run
from rosbridge_sim.errors import DocumentError

__all__ = ["LocalPool", "Pool", "open_pool"]


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

    def why(self, error: BaseException) -> str:
        """Return what the error of a task means; empty if the task was lost by no fault of its runs."""

    def close(self, *, is_done: bool) -> None:
        """End all workers; at once, if the runs are not done."""


TERM_TIMEOUT: Final = 1.2
"""Time from SIGTERM to SIGKILL of a worker [s]. Its program has one second, see `program_drives`."""


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
        self._job = job
        self.num_tasks = 2 * num_jobs
        methods = multiprocessing.get_all_start_methods()
        context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
        if "forkserver" in methods:
            context.set_forkserver_preload(["rosbridge_sim.campaign_runs.worker"])
        self._pool = pebble.ProcessPool(max_workers=num_jobs, initializer=settle_worker, context=context)
        self._expired: type[BaseException] = pebble.ProcessExpired

    def submit(self, runs: Sequence[Run], *, timeout: float, may_keep: bool) -> Future[list[Result]]:
        """See `Pool`."""
        future: Future[list[Result]] = self._pool.schedule(
            drive_runs, args=[self._job, runs], kwargs={"may_keep": may_keep}, timeout=timeout
        )
        return future

    def why(self, error: BaseException) -> str:
        """See `Pool`."""
        if isinstance(error, TimeoutError):
            return "time-out: the worker hung, and was killed"
        if isinstance(error, self._expired):
            code = getattr(error, "exitcode", None)
            how = f"signal {-code}" if isinstance(code, int) and code < 0 else f"code {code}"
            return f"the worker process died with {how}: the driver crashed it, or the machine has no memory left"
        return f"an internal error: {type(error).__name__}: {error}"

    def close(self, *, is_done: bool) -> None:
        """See `Pool`."""
        if is_done:
            self._pool.close()
        else:
            self._pool.stop()
        self._pool.join()


def open_pool(job: Job, num_jobs: int, ray: str | None) -> Pool:
    """Return processes of this machine, or a Ray cluster.

    Args:
        job: the campaign.
        num_jobs: number of processes.
        ray: address of a cluster, or `local`; None for processes.

    Raises:
        DocumentError: an extra is missing, or the cluster cannot be reached.
    """
    if ray is None:
        return LocalPool(job, num_jobs)
    from rosbridge_sim.campaign_runs.ray_pool import RayPool  # noqa: PLC0415 - an extra of 200 MB

    return RayPool(job, num_jobs, ray)
