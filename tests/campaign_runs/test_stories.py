"""Campaigns over scenarios of OpenSCENARIO: parameters are set, and Worlds refuses by name."""

from __future__ import annotations

import pytest

from rosbridge_sim.campaign_runs.checking import check_job, find_scenario_mistakes
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.worlds.worlds import Worlds
from tests.campaign_runs.conftest import CampaignFolder
from tests.simulator.story.story_texts import by_entity, event, group, link, speed, story, teleport

PARAMETERS = (
    '<ParameterDeclarations><ParameterDeclaration name="v" parameterType="double" value="10"/></ParameterDeclarations>'
)
STORY = story(
    {
        "Ego": teleport(link("L1_00", 20)) + speed("<AbsoluteTargetSpeed value='$v'/>"),
        "Car": teleport(link("L1_00", 90)),
    },
    group("Car", event("go", speed(5), by_entity("Ego", '<TraveledDistanceCondition value="5"/>'))),
    more=PARAMETERS,
)
CAMPAIGN = """
scenario = "mine.xosc"
seconds = 0.5
[parameters]
wish = [5, 10]
[set]
"scenario.{}" = "2 * wish"
[drivers]
still = {{ python = "still.py:drive" }}
"""


@pytest.fixture
def files(folder: CampaignFolder) -> CampaignFolder:
    folder.write("mine.xosc", STORY)
    folder.write("still.py", "def drive(seen):\n    return {'steering': 0.0, 'accel': 0.0}\n")
    return folder


def test_a_function_drives_the_ego_of_a_story_with_the_parameters_of_each_run(files: CampaignFolder) -> None:
    results = files.drive(CAMPAIGN.format("v"))
    assert [result.reason for result in results] == ["", ""]
    ways = [result.path[-1][0] - result.path[0][0] for result in results]
    assert ways == pytest.approx([5.0, 10.0], abs=0.5)


def test_a_limit_judges_a_drive_by_the_verdict_of_the_story(files: CampaignFolder) -> None:
    hurry = by_entity("Ego", '<TraveledDistanceCondition value="7"/>')
    evaluation = f"<Evaluation><FailureConditionGroup>{hurry}</FailureConditionGroup></Evaluation>"
    files.write("mine.xosc", STORY.replace("</OpenSCENARIO>", f"{evaluation}</OpenSCENARIO>"))
    limit = """[limits.own.story]\nend = '/sim/story.verdict.result != "failure"'\n"""
    slow, fast = files.drive(CAMPAIGN.format("v") + limit)
    assert (slow.verdict, fast.verdict) == ("pass", "fail")
    assert "story" in fast.reason


def test_a_parameter_that_the_story_lacks_is_told(files: CampaignFolder) -> None:
    job = files.job(CAMPAIGN.format("w"))
    check_job(job)
    assert find_scenario_mistakes(job) == ["mine.xosc: no parameter 'w'"]
    assert "expected scenario.NAME" in find_scenario_mistakes(files.job(CAMPAIGN.format("a.b")))[0]


def test_worlds_refuse_a_story_by_name(files: CampaignFolder) -> None:
    with pytest.raises(DocumentError, match="mine: stories of OpenSCENARIO are told by a server or a campaign"):
        Worlds(str(files.path / "mine.xosc"))
