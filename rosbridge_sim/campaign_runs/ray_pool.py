"""Runs as tasks of a Ray cluster.

Ray places them, retries those of lost nodes, and ships code and campaign with the job.

A run may be driven twice after a loss; its result is taken once, and a drive depends on nothing but its run.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.campaign_runs.job import Job
from rosbridge_sim.campaign_runs.worker import drive_runs
from rosbridge_sim.campaigns.run_results import Result, Run
from rosbridge_sim.errors import DocumentError

MAX_RETRIES: Final = 5
"""So often Ray drives a run again whose worker or node was lost."""

MAX_SHIPPED: Final = 100 * 2**20
"""Largest folder of a campaign that is sent to the cluster [bytes]: Ray's own limit."""


class RayPool:
    """Tasks of a Ray cluster.

    Attributes:
        num_tasks: two for each processor of the cluster at the start.

    Args:
        num_jobs: processors of a cluster that is started here (`local`).
        address: of a cluster that runs, or `local`.

    Raises:
        DocumentError: the extra `ray` is missing, the cluster cannot be reached, or the folder of the campaign is too
            large to be sent.
    """

    def __init__(self, job: Job, num_jobs: int, address: str) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray  # noqa: PLC0415 - an extra of more than 200 MB
        except ImportError:
            raise DocumentError("--ray needs the extra rosbridge-sim[ray]: pip install 'rosbridge-sim[ray]'") from None
        size = sum(file.stat().st_size for file in Path(job.base).rglob("*") if file.is_file())
        if size > MAX_SHIPPED:
            raise DocumentError(
                f"{job.base}: expected a folder of at most {MAX_SHIPPED >> 20} MB, because it is sent to the cluster"
                f" with the campaign; it has {size >> 20} MB: put the campaign into a folder of its own"
            )
        options: dict[str, Any] = {"runtime_env": {"working_dir": job.base}}
        if address == "local":
            options = {"num_cpus": num_jobs, "include_dashboard": False}
        try:
            ray.init(address, log_to_driver=False, **options)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise DocumentError(f"--ray {address}: {error}") from None
        self._ray: Any = ray
        self._job = job if address == "local" else Job(job.text, job.source, "", job.folder)
        self._drive = ray.remote(num_cpus=1, max_retries=MAX_RETRIES)(_drive_there)
        self.num_tasks = 2 * max(int(ray.cluster_resources().get("CPU", 1)), 1)
        self._flying: dict[Future[list[Result]], Any] = {}

    def submit(self, runs: Sequence[Run], *, timeout: float, may_keep: bool) -> Future[list[Result]]:
        """See `Pool`. The time-out of a driver in Python is its own: Ray has none for tasks."""
        del timeout
        task = self._drive.remote(self._job, tuple(runs), may_keep=may_keep)
        future: Future[list[Result]] = task.future()
        self._flying[future] = task
        future.add_done_callback(lambda done: self._flying.pop(done, None))
        return future

    def why(self, error: BaseException, runs: Sequence[Run]) -> str:
        """See `Pool`. What a worker has left on its node stays there."""
        del runs
        if isinstance(error, self._ray.exceptions.WorkerCrashedError):
            return "the worker process died: the driver crashed it, or the machine has no memory left"
        if isinstance(error, self._ray.exceptions.OutOfMemoryError):
            return "the worker process died: the machine has no memory left"
        if isinstance(error, self._ray.exceptions.RayTaskError):
            return f"an internal error: {str(error).strip().splitlines()[-1]}"
        return ""

    def was_killed(self, error: BaseException) -> bool:
        """See `Pool`. Ray itself has driven the run again."""
        del error
        return False

    def close(self, *, is_done: bool) -> None:
        """See `Pool`."""
        if not is_done:
            for task in list(self._flying.values()):
                self._ray.cancel(task, force=True)
        self._ray.shutdown()


def _drive_there(job: Job, runs: tuple[Run, ...], *, may_keep: bool) -> list[Result]:
    """Drive runs on a node. The campaign's folder was sent: it is the working folder of the task."""
    if not job.base:
        job = Job(job.text, job.source, str(Path.cwd()), job.folder)
    return drive_runs(job, runs, may_keep=may_keep)
