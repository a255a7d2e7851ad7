"""Drives in Python in the process of a test: what the options of a driver and of a simulator do."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.job import LoadedJob
from rosbridge_sim.campaign_runs.simulator_options import simulator_options
from rosbridge_sim.campaigns.campaign import plan_runs
from tests.campaign_runs.conftest import CampaignFolder
from tests.support import ROOT

LOOP = ROOT / "rosbridge_sim" / "data" / "scenarios" / "loop.json"


@pytest.mark.parametrize(("speed", "least", "most"), [("", 6.5, 20.0), (", speed = 2.0", 4.0, 6.1)])
def test_driver_of_lanes_keeps_to_its_speed(folder: CampaignFolder, speed: str, least: float, most: float) -> None:
    text = f'scenario = "loop"\nseconds = 3.0\n[drivers]\nours = {{ own = "lanes"{speed} }}\n'
    (result,) = folder.drive(text)
    assert (result.verdict, result.frames) == ("pass", 150)
    assert least < result.scores["distance"] < most
    assert 0.0 < result.cpu < result.wall + 0.5


def test_options_of_a_simulator_have_a_changed_scenario_in_the_folder_of_the_run(
    folder: CampaignFolder, tmp_path: Path
) -> None:
    text = """\
        scenario = "loop"
        seconds = 0.1
        seeds = [7]
        [parameters]
        model = ["2015_Kia_K5"]
        [set]
        vehicle = "model"
        [drivers.d]
        command = ["x"]
        """
    loaded = LoadedJob(folder.job(text))
    (run,) = plan_runs(loaded.campaign)
    options = simulator_options(loaded, run, tmp_path)
    assert (options["seed"], options["port"], options["start"]) == (7, 0, "sync")
    assert options["scenario"] == str(tmp_path / "scenario.json")
    written = json.loads((tmp_path / "scenario.json").read_text())
    assert written["egoVehicle"]["modelName"] == "2015_Kia_K5"
    assert written["vehicleList"] == json.loads(LOOP.read_text())["vehicleList"]
    assert simulator_options(loaded, run, tmp_path, is_real_time=True)["start"] == "run"
    plain = LoadedJob(folder.job('scenario = "loop"\nseconds = 0.1\n[drivers]\nours = "lanes"\n'))
    assert "loop" in str(simulator_options(plain, plan_runs(plain.campaign)[0], tmp_path / "none")["scenario"])
