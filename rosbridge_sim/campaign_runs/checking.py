"""Checks of a campaign before it is driven: files, functions, scenarios and settings that are not there."""

from __future__ import annotations

import shutil
from pathlib import Path

from rosbridge_sim.campaign_runs.job import Job, LoadedJob, open_job
from rosbridge_sim.campaign_runs.simulator_options import check_settings
from rosbridge_sim.campaigns.campaign import Campaign, check_search, plan_runs
from rosbridge_sim.errors import DocumentError

__all__ = ["check_job", "find_scenario_mistakes"]


def check_job(job: Job) -> Campaign:
    """Return a campaign that can be driven, as far as that can be told before.

    A scenario that cannot be read is no mistake here: its runs become rows with the reason, beside those of others.

    Raises:
        DocumentError: parameters, functions, programs or settings cannot be used.
    """
    loaded = open_job(job)
    campaign = loaded.campaign
    if campaign.document.search is not None:
        check_search(campaign)
    else:
        plan_runs(campaign)
    _check_drivers(loaded)
    _ = loaded.checks
    return campaign


def find_scenario_mistakes(job: Job) -> list[str]:
    """Read each scenario as the first of its runs would, and return a line for each that cannot be driven.

    Args:
        job: a campaign that `check_job` has passed.
    """
    loaded = open_job(job)
    campaign = loaded.campaign
    runs = plan_runs(campaign) if campaign.document.search is None else []
    mistakes: list[str] = []
    for name in campaign.scenarios:
        first = next((run for run in runs if run.scenario == name), None)
        try:
            loaded.scenario(name, () if first is None else campaign.values_of(first).scenario)
        except DocumentError as error:
            mistakes.append(str(error))
    return mistakes


def _check_drivers(loaded: LoadedJob) -> None:
    campaign, source = loaded.campaign, loaded.campaign.source
    settings = [str(each.path[0]) for each in campaign.assignments if each.room == "setting"]
    for name, driver in campaign.drivers.items():
        check_settings(settings, f"{source}: drivers.{name}: ", has_server=driver.is_program)
        seconds = campaign.document.seconds
        if driver.real_time and driver.timeout <= seconds and "real_time_factor" not in settings:
            raise DocumentError(
                f"{source}: drivers.{name}.timeout: expected more than the {seconds:g} s of a drive in real time"
            )
        if driver.python is not None or driver.policy is not None:
            loaded.drivers_function(driver)
        elif driver.command is not None:
            word = driver.command[0]
            if "{" not in word and shutil.which(word) is None and not (Path(loaded.job.base) / word).is_file():
                raise DocumentError(f"{source}: drivers.{name}.command: there is no program {word!r}")
