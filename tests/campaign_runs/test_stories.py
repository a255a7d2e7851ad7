"""Campaigns over stories: values are set, and Worlds refuses by name."""

from __future__ import annotations

import json

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
    with pytest.raises(
        DocumentError, match=r"mine: stories of OpenSCENARIO, and events of .* are told by a server or a campaign"
    ):
        Worlds(str(files.path / "mine.xosc"))


EVENTS = {
    "mapInfo": {"mapName": "motorway"},
    "egoVehicle": {"initPosition": {"initPositionMode": "Link", "initLink": "L2_00"}, "currentVelocity": 36},
    "vehicleList": [
        {
            "initPosition": {"initPositionMode": "Link", "initLink": "L3_00", "initLinkRatio": 0.3},
            "desiredVelocity": 36,
            "rosbridge_sim": {"events": [{"when": {"ego_within": 1}, "speed_kmh": 0, "seconds": 0}]},
        }
    ],
}
WITH_EVENTS = """
scenario = "events.json"
seconds = 1
[parameters]
near = [2, 80]
[set]
"scenario.vehicleList[0].rosbridge_sim.events[0].when.ego_within" = "near"
[drivers]
still = { python = "still.py:drive" }
"""


def test_a_campaign_tells_events_of_a_json_scenario(files: CampaignFolder) -> None:
    files.write("events.json", json.dumps(EVENTS))
    files.write(
        "still.py", "def drive(seen):\n    return {'steering': 0.0, 'accel': -5.0 * (seen.others(1)[0, 3] < -1.0)}\n"
    )
    results = files.drive(WITH_EVENTS)
    assert [result.reason for result in results] == ["", ""]
    on, brakes = (result.path[-1][0] - result.path[0][0] for result in results)
    assert brakes < on - 0.3  # the car ahead does
    with pytest.raises(DocumentError, match="events: stories of OpenSCENARIO, and events of rosbridge_sim blocks"):
        Worlds(str(files.path / "events.json"))
