"""Functions in Python and programs drive the same worlds: equal states, topics, limits, settings."""

from __future__ import annotations

import pytest

from rosbridge_sim.campaigns.run_results import Result
from tests.campaign_runs.conftest import CampaignFolder

FUNCTION = """
import numpy as np

COMMANDS = {commands}

def drive(seen):
    command = COMMANDS[int(np.max(np.round(seen.time / 0.1)))]
    return {{name: value for name, value in command.items()}}
"""

PROGRAM = """
import sys
from rosbridge_sim.client import Client

WIRE = {{"accel": "acceleration", "throttle": "accel", "brake": "brake", "speed": "velocity", "steering": "steering"}}
KIND = {{"throttle": 1, "speed": 2, "accel": 3}}

with Client(sys.argv[1]) as client:
    client.start_sync(step_ms=100)
    for command in {commands}:
        told = {{WIRE[name]: value * 3.6 if name == "speed" else value for name, value in command.items()}}
        kind = next(KIND[name] for name in command if name in KIND)
        client.step(1, commands={{0: {{"longlCmdType": kind, **told}}}})
"""

COMMANDS = [
    {"steering": 0.0, "accel": 1.0},
    {"steering": 0.05, "accel": 2.0},
    {"steering": -0.05, "throttle": 0.5, "brake": 0.0},
    {"steering": 0.0, "throttle": 0.0, "brake": 0.3},
]

DRIVERS = """
function = "function.py:drive"
batch = { python = "function.py:drive", batch = 2 }
program = { command = ["{python}", "program.py", "{url}"] }
"""


@pytest.fixture
def both(folder: CampaignFolder) -> CampaignFolder:
    """The same commands by a function and by a program."""
    folder.write("function.py", FUNCTION.format(commands=COMMANDS))
    folder.write("program.py", PROGRAM.format(commands=COMMANDS))
    return folder


def by_driver(results: list[Result], *, seed: int = 0) -> dict[str, Result]:
    return {result.run.driver: result for result in results if result.run.seed == seed}


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    ["", '"setting.dynamics" = "\'kinematic\'"\n"setting.traffic" = 4', '"setting.creep" = true\nvehicle = "\'Van\'"'],
    ids=["default", "many worlds", "nodes"],
)
def test_equal_commands_end_in_the_same_state_with_each_kind_of_driver(both: CampaignFolder, settings: str) -> None:
    """Settings of the third case are those of a server, so functions drive the node of a simulator."""
    results = both.drive(f'scenario = "motorway"\nseconds = 0.4\nseeds = 2\n[set]\n{settings}\n[drivers]\n{DRIVERS}')
    assert [result.verdict for result in results] == ["pass"] * 6, [result.reason for result in results]
    for seed in (0, 1):
        found = by_driver(results, seed=seed)
        assert len({result.state_hash for result in found.values()}) == 1
        assert len({tuple(result.scores.items()) for result in found.values()}) == 1
    assert results[0].state_hash != results[1].state_hash


@pytest.mark.slow
def test_limits_over_topics_are_the_same_for_each_kind_of_driver(both: CampaignFolder) -> None:
    results = both.drive(
        f"""
        scenario = "motorway"
        seconds = 0.4
        seeds = 2
        [limits.own.fast]
        always = "max(/Ego_topic.velocity.x) < 0.2"
        [limits.own.kept]
        end = "count(/Ego_topic.velocity.x > 0) >= 15 and last(/Ego_topic.accel) == /Ego_topic.accel"
        [limits.own.near]
        end = "/Object_topic.npc_list[0].position.x < 0 and first(/Object_topic.num_of_npcs) > 0"
        [drivers]{DRIVERS}ours = "lanes"
        """
    )
    assert [result.verdict for result in results] == ["fail"] * 8, [result.reason for result in results]
    for seed in (0, 1):
        found = by_driver(results, seed=seed)
        own = found.pop("ours")
        assert len({(result.breaches, result.state_hash) for result in found.values()}) == 1
        assert "fast" in {breach.limit for breach in own.breaches}
    fast, near = results[0].breaches
    assert (fast.limit, near.limit) == ("fast", "near")
    assert fast.text.startswith("expected max(/Ego_topic.velocity.x) < 0.2; /Ego_topic.velocity.x 0.2")
    assert near.time == 0.4


@pytest.mark.slow
def test_states_with_and_without_topics_are_equal(both: CampaignFolder) -> None:
    """A node moves its world as `Worlds` does."""
    text = 'scenario = "roundabout"\nseconds = 0.4\n[set]\n"setting.traffic" = 3\n'
    text += '[drivers]\nours = "lanes"\nf = "function.py:drive"\n'
    without = both.drive(text)
    with_topics = both.drive(text + '[limits.own.a]\nend = "/Ego_topic.velocity.x < 99"\n')
    assert [each.state_hash for each in without] == [each.state_hash for each in with_topics]
    assert [each.verdict for each in with_topics] == ["pass", "pass"], with_topics[0].reason


@pytest.mark.slow
def test_topic_that_says_nothing_is_an_error_with_its_name(both: CampaignFolder) -> None:
    text = 'scenario = "loop"\nseconds = 0.04\n[drivers]\nf = "function.py:drive"\n[limits.own.a]\nend = "{} < 99"\n'
    (silent,) = both.drive(text.format("/Ego_topik.velocity.x"))
    assert (silent.verdict, silent.frames) == ("error", 2)
    assert silent.reason.endswith("limits.own.a.end: /Ego_topik.velocity.x has no value: no message came that has it")
    (wrong,) = both.drive(text.format("/Ego_topic.velocty.x"))
    assert (wrong.verdict, wrong.frames) == ("error", 1)
    assert "/Ego_topic.velocty.x: no field 'velocty' (did you mean velocity?)" in wrong.reason


@pytest.mark.slow
def test_drive_ends_when_an_expression_over_topics_holds(both: CampaignFolder) -> None:
    text = 'scenario = "loop"\nseconds = 9\nend_when = "/Ego_topic.velocity.x > 0.05"\n'
    (result,) = both.drive(f'{text}[drivers]\nf = "function.py:drive"\n')
    assert result.verdict == "pass", result.reason
    assert 1 < result.frames < 20
    assert result.scores["max_speed"] > 0.05


@pytest.mark.slow
def test_topics_of_the_program_itself_can_be_judged(folder: CampaignFolder) -> None:
    """The program ends before the drive does: no frame is added in real time meanwhile."""
    folder.write(
        "plans.py",
        """
        import sys
        from rosbridge_sim.client import Client
        with Client(sys.argv[1]) as client:
            client.start_sync(step_ms=20)
            for i in range(10):
                client.publish("/plan", {"data": float(i)}, "std_msgs/Float64")
                client.step(1)
        """,
    )
    (result,) = folder.drive(
        """
        scenario = "loop"
        seconds = 2
        [limits.own.plan]
        always = "max(/plan.data) < 5"
        [drivers]
        program = { command = ["{python}", "plans.py", "{url}"] }
        """
    )
    assert (result.verdict, result.reason) == (
        "fail",
        "plan at 0.12 s: expected max(/plan.data) < 5; /plan.data 5, max(/plan.data) 5",
    )
    assert result.frames == 10


@pytest.mark.slow
def test_settings_reach_the_simulator_of_a_driver_in_python(both: CampaignFolder) -> None:
    """The topic is that of another release, and the model one of the user's catalogue beside the campaign."""
    both.write("models.csv", "DataID,name,class,length,width,height,wheelbase\n9001,Tiny,car,2.0,1.0,1.2,1.4\n")
    (result,) = both.drive(
        """
        scenario = "loop"
        seconds = 0.1
        [set]
        "setting.release" = "'26.R1'"
        "setting.catalogue" = "'models.csv'"
        vehicle = "'Tiny'"
        [limits.own.near]
        end = "/Ego_topic.lateral_offset > 99"
        [drivers]
        f = "function.py:drive"
        """
    )
    assert "; /Ego_topic.lateral_offset " in result.reason


def test_map_that_is_missing_is_a_row(both: CampaignFolder) -> None:
    (result,) = both.drive(
        """
        scenario = "loop"
        seconds = 0.1
        [set]
        "setting.map" = "'nowhere'"
        [drivers]
        f = "function.py:drive"
        """
    )
    assert (result.verdict, result.frames) == ("error", 0)
    assert "nowhere" in result.reason
