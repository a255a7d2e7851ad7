"""Campaigns of a test: their files, drives in the test's own process, as a worker drives, and the command."""

from __future__ import annotations

import subprocess
import textwrap
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.checking import check_job
from rosbridge_sim.campaign_runs.job import Job, read_job
from rosbridge_sim.campaign_runs.running import cut_into_tasks
from rosbridge_sim.campaign_runs.worker import drive_runs
from rosbridge_sim.campaigns.campaign import plan_runs
from rosbridge_sim.campaigns.run_results import Result
from tests import fork_server


class CampaignFolder:
    """A folder with the files of a campaign.

    Attributes:
        path: the folder; results are in `out` within it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def write(self, name: str, text: str) -> Path:
        file = self.path / name
        file.write_text(textwrap.dedent(text))
        return file

    def job(self, text: str) -> Job:
        return read_job(self.write("c.toml", text), self.path / "out")

    def drive(self, text: str) -> list[Result]:
        """Drive all runs in this process."""
        job = self.job(text)
        campaign = check_job(job)
        return [each for task in cut_into_tasks(campaign, plan_runs(campaign)) for each in drive_runs(job, task)]

    def command(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run `rosbridge-sim campaign WORDS...` in the folder, with workers of its own."""
        return fork_server.run(["-m", "rosbridge_sim", "campaign", *words], cwd=self.path)


@pytest.fixture
def folder(tmp_path: Path) -> CampaignFolder:
    return CampaignFolder(tmp_path)
