"""Checks of a campaign before it is driven: files, functions, scenarios and settings that are not there."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from rosbridge_sim.campaign_runs.job import Job, LoadedJob, open_job
from rosbridge_sim.campaign_runs.simulator_options import check_settings
from rosbridge_sim.campaigns.assignments import path_text
from rosbridge_sim.campaigns.campaign import Campaign, check_search, is_skipped, plan_runs
from rosbridge_sim.campaigns.parameter_sets import middle_of
from rosbridge_sim.campaigns.run_results import Run
from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.printable import printable
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.scenario_model import why_without_effect
from rosbridge_sim.shell.config.loading import check_options
from rosbridge_sim.world.state.world import Kind


def check_job(job: Job) -> Campaign:
    """Return a campaign that can be driven, as far as that can be told before.

    A scenario that cannot be read is no mistake here: its runs become rows with the reason, beside those of others.

    Raises:
        DocumentError: parameters, targets, functions, programs or settings cannot be used.
    """
    loaded = open_job(job)
    campaign = loaded.campaign
    _check_targets(campaign)
    if campaign.document.search is not None:
        check_search(campaign)
        middle = middle_of(campaign.document, campaign.source)
        runs = [replace(group, number=1, parameters=middle) for group in campaign.groups()]
    else:
        runs = plan_runs(campaign)
    _check_drivers(loaded)
    _check_values(loaded, runs)
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


def _check_targets(campaign: Campaign) -> None:
    """Refuse places of the scenario that nothing reads: all runs would be the same.

    Raises:
        DocumentError: there is one.
    """
    if all(name.lower().endswith(".xosc") for name in campaign.scenarios):
        return  # these have parameters
    for each in campaign.assignments:
        if each.room == "scenario" and (why := why_without_effect(each.path)):
            raise DocumentError(f"{campaign.source}: set.'scenario.{path_text(each.path)}': {why}")


def _check_values(loaded: LoadedJob, runs: Sequence[Run]) -> None:
    """Refuse values that no run takes. An expression without a value is no mistake here, as it may have one elsewhere.

    Args:
        runs: of the campaign; of a search that in the middle of its ranges.

    Raises:
        DocumentError: there is one.
    """
    campaign = loaded.campaign
    checked: set[str] = set()
    for run in runs:
        try:
            if is_skipped(campaign, run.parameters, run.seed):
                continue
            values = campaign.values_of(run)
        except DocumentError:
            continue
        told = repr((values.settings, values.vehicle))
        if told in checked:
            continue
        checked.add(told)
        where = f"{campaign.source}: run {run.number}"
        try:
            check_options(values.settings)
        except SettingError as error:
            raise DocumentError(f"{where}: setting.{error}") from None
        catalogue = loaded.library.catalogue
        name = values.vehicle
        if name is not None and "catalogue" not in values.settings and catalogue.find(name) is None:
            near = catalogue.suggest(name, Kind.VEHICLE)
            raise DocumentError(f"{where}: vehicle: the catalogue has no {printable(name, 80)!r}{near}")


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
