"""The component of stories: its state in snapshots and hashes, loads, resets, and `/sim/story`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.openscenario.grammar import GRAMMAR
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.egos.ego import CtrlMode
from rosbridge_sim.simulator.scene.load import WHOLE
from rosbridge_sim.simulator.snapshots.node_state import NodeState
from rosbridge_sim.simulator.snapshots.saved_loads import unpack_load
from rosbridge_sim.simulator.story.stories import Stories
from rosbridge_sim.world.state.world import Gear
from tests.simulator.sim_harness import Client
from tests.simulator.story.story_texts import (
    Telling,
    after,
    at,
    event,
    group,
    lane_change,
    link,
    longitudinal,
    routing,
    scenario_of,
    speed,
    state_of,
    story,
    teleport,
)

FOLLOW = routing(
    '<FollowTrajectoryAction><Trajectory name="t" closed="false"><Shape><Polyline>'
    f"<Vertex>{at(50, 3.5)}</Vertex><Vertex>{at(80, 3.5)}</Vertex><Vertex>{at(90, 9)}</Vertex></Polyline></Shape>"
    "</Trajectory><TimeReference><None/></TimeReference></FollowTrajectoryAction>"
)
TEXT = story(
    {"Ego": teleport(link("middle", 20)) + speed(10), "Car": teleport(link("left", 50)) + speed(8), "walker": ""},
    group(
        "Car",
        event("faster", speed(14, "cubic", "time", 3), after(0.5)),
        event("follow", FOLLOW, state_of("event", "faster", "endTransition", delay=0.3)),
    ),
    group("Ego", event("change", lane_change('<RelativeTargetLane entityRef="Ego" value="-1"/>'), after(1)), name="g2"),
    group(
        "walker",
        event("appear", teleport(at(120, 6)), after(2)),
        event("walk", speed(1.5), after(2.5)),
        name="g3",
    ),
)


def hashes(telling: Telling, num: int, *, each: int = 1) -> list[str]:
    """So many hashes, each behind so many frames."""
    state, found = NodeState(telling.node.context, telling.node.components), []
    for _ in range(num):
        telling.run(0.02 * each)
        found.append(state.hash())
    return found


def test_the_same_story_has_the_same_hashes_while_it_is_told() -> None:
    first = hashes(Telling(TEXT), 70, each=3)
    assert first == hashes(Telling(TEXT), 70, each=3)
    assert len(set(first)) == 70


@pytest.mark.parametrize("frames", [10, 60, 130, 200])
def test_a_restored_story_goes_on_to_the_bit(frames: int) -> None:
    telling = Telling(TEXT)
    telling.run(frames * 0.02)
    state = NodeState(telling.node.context, telling.node.components)
    saved = state.save()
    expected = hashes(telling, 30, each=2)
    state.restore(saved, 0.0, before_undo=lambda: None)
    assert hashes(telling, 30, each=2) == expected


def test_a_snapshot_of_another_process_is_read_and_goes_on() -> None:
    one, other = Telling(TEXT), Telling(TEXT)
    one.run(2.6)
    state = NodeState(one.node.context, one.node.components)
    plain = state.save().to_plain()
    there = NodeState(other.node.context, other.node.components)
    parsed = there.parse(plain, lambda _: other.node.context.scene.road_map)
    there.restore(parsed, 0.0, expected_hash=state.hash(), before_undo=lambda: None)
    assert hashes(other, 30, each=2) == hashes(one, 30, each=2)


def test_actions_with_the_largest_numbers_are_saved_and_go_on() -> None:
    limits = '<DynamicConstraints maxAccelerationRate="1" maxDecelerationRate="0"/>'
    entries = f'{limits}<SpeedProfileEntry speed="1e9"/><SpeedProfileEntry time="1e9" speed="-5"/>'
    profile = longitudinal(f'<SpeedProfileAction followingMode="follow">{entries}</SpeedProfileAction>')
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Car" continuous="true" freespace="true" timeGap="1e9">'
        '<DynamicConstraints maxAcceleration="1e9"/></LongitudinalDistanceAction>'
    )
    init = {"Ego": teleport(link("middle", 20)) + speed(10), "Car": teleport(link("left", 50)) + speed(8)}
    groups = group("Car", event("p", profile, after(0.2))), group("Ego", event("k", keep, after(0.3)), name="g2")
    telling = Telling(story(init, *groups))
    telling.run(1.0)
    state = NodeState(telling.node.context, telling.node.components)
    saved = state.save()
    expected = hashes(telling, 30)
    state.restore(saved, 0.0, before_undo=lambda: None)
    assert hashes(telling, 30) == expected


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("start", 10_000),
        ("values", {"a": "b"}),
        ("actors", {}),
        ("running", [{"number": 0, "entity": "Car", "numbers": {}, "points": []}]),
        ("running", [{"number": 5, "entity": "Nobody", "numbers": {}, "points": []}]),
        ("board", 3),
        ("lights", {"light": "pink"}),
        ("lights", {f"light {i}": "red" for i in range(1_000)}),
        ("running", [{"number": -2, "entity": "Ego", "numbers": {"at": 1.0}, "points": []}]),
        ("running", [{"number": 7, "entity": "Car", "numbers": {}, "points": [(1.0,)]}]),
    ],
)
def test_a_state_that_no_story_has_is_refused_and_changes_nothing(key: str, value: object) -> None:
    telling = Telling(TEXT)
    telling.run(1.0)
    component = telling.node.component(Stories)
    data = component.save_state()
    assert isinstance(data, dict)
    with pytest.raises(ValueError, match=r"story|state"):
        component.load_state({**data, key: value}, 0.0)


def test_an_action_that_goes_on_twice_is_refused() -> None:
    telling = Telling(TEXT)
    telling.run(1.0)
    component = telling.node.component(Stories)
    data = component.save_state()
    assert isinstance(data, dict)
    component.load_state(data, 0.0)
    with pytest.raises(ValueError, match="expected a state of the story"):
        component.load_state({**data, "running": (*data["running"], data["running"][0])}, 0.0)


def test_a_load_keeps_its_story_as_texts() -> None:
    telling = Telling(TEXT)
    load = telling.node.context.scene.loaded
    again = unpack_load(tuple(load.packed), lambda _: load.road_map)
    assert again.story is not load.story
    assert again.packed == load.packed


def test_a_reset_begins_the_story_again() -> None:
    telling = Telling(TEXT)
    first = hashes(telling, 30)
    telling.node.context.scene_changes.reset(None, 0.0)
    assert telling.running.time() == 0.0
    assert hashes(telling, 30) == first


def test_another_scenario_ends_the_story_and_gives_the_ego_back() -> None:
    telling = Telling(TEXT)
    telling.run(0.1)
    context = telling.node.context
    ego = context.egos.first
    assert ego.set_ctrl_mode(CtrlMode.KEYBOARD) == "ctrl_mode KEYBOARD refused: a story moves ego 0"
    assert ego.shift(Gear.REVERSE) == "gear REVERSE refused: a story moves ego 0"
    plain = replace(scenario_of(TEXT), story=None)
    context.scene_changes.carry_out(context.scene.prepare(plain, WHOLE), is_pausing=False, now=0.0)
    assert telling.node.component(Stories).running is None
    assert context.egos.first.set_ctrl_mode(CtrlMode.KEYBOARD) is None
    assert hashes(telling, 5)


def test_an_ego_that_the_story_drives_says_so_and_stays_with_it_behind_a_replay() -> None:
    telling = Telling(TEXT)
    client = Client(telling.node.context.bus, "me")
    values = client.call("/sim/describe", {"id": 0}).values
    assert isinstance(values, Message)
    assert json.loads(values.json)["controlled_by"] == "story"
    ego = telling.node.context.egos.first
    ego.moved_by = ""  # as a replay leaves it
    telling.run(0.02)
    assert ego.moved_by == "story"


def test_a_story_is_loaded_whole() -> None:
    context = Telling(TEXT).node.context
    with pytest.raises(DocumentError, match="a story is loaded whole"):
        context.scene.prepare(scenario_of(TEXT), replace(WHOLE, pedestrians=False))


def test_the_service_tells_elements_conditions_and_entities() -> None:
    telling = Telling(TEXT)
    telling.run(1.5)
    client = Client(telling.node.context.bus, "me")
    values = client.call("/sim/story", {}).values
    assert isinstance(values, Message)
    answer = json.loads(values.json)
    assert answer["result"]
    told = answer["story"]
    assert told["time"] == pytest.approx(1.5)
    elements = {each["name"]: each for each in told["elements"]}
    assert (elements["faster"]["state"], elements["faster"]["executions"]) == ("running", 1)
    assert elements["follow"]["state"] == "standby"
    assert told["elements"][elements["faster"]["parent"]]["kind"] == "Maneuver"
    times = [each for each in told["conditions"] if each["kind"] == "SimulationTimeCondition"]
    assert times[0]["value"] == pytest.approx(1.5)
    assert dict(zip(told["entities"], told["ids"], strict=True))["walker"] == 2**32 - 1


EVALUATED = story(
    {"Ego": teleport(link("middle", 20)) + speed(10)},
    end=f"<Evaluation><FailureConditionGroup>{after(0.5)}</FailureConditionGroup></Evaluation>",
)


def test_the_score_has_the_verdict_of_the_story() -> None:
    telling = Telling(EVALUATED)
    client = Client(telling.node.context.bus, "me")

    def verdict(name: str) -> dict[str, object]:
        values = client.call(name, {}).values
        assert isinstance(values, Message)
        answer = json.loads(values.json)
        found: dict[str, object] = answer["verdict"] if name == "/sim/score" else answer["story"]["verdict"]
        return found

    undecided = {"result": "undecided", "group": "", "time": -1.0, "reason": ""}
    assert verdict("/sim/score") == undecided
    telling.run(0.6)
    found = verdict("/sim/score")
    assert (found["result"], found["group"], found["time"]) == ("failure", "FailureConditionGroup 1", 0.5)
    assert re.fullmatch(r"story.xosc: line \d+: SimulationTimeCondition 'c' \(0.5\)", str(found["reason"]))
    assert verdict("/sim/story") == found
    state = NodeState(telling.node.context, telling.node.components)
    saved = state.save()
    telling.node.context.scene_changes.reset(None, 0.0)
    assert verdict("/sim/score") == undecided
    state.restore(saved, 0.0, before_undo=lambda: None)
    assert verdict("/sim/score") == found


@pytest.mark.parametrize(("group", "frame"), [(1, 3), (-2, 0), (0, -1)])
def test_a_verdict_that_no_story_has_is_refused(group: int, frame: int) -> None:
    component = Telling(EVALUATED).node.component(Stories)
    data = component.save_state()
    assert isinstance(data, dict)
    board = data["board"]
    assert isinstance(board, dict)
    with pytest.raises(ValueError, match="state of the story"):
        component.load_state({**data, "board": {**board, "verdict_group": group, "verdict_frame": frame}}, 0.0)


def test_the_page_of_the_docs_names_each_action_condition_and_position() -> None:
    page = (Path(__file__).parents[3] / "docs/reference/openscenario.md").read_text()
    words = set(re.findall(r"\w+", page))
    wrappers = {"LongitudinalAction", "LateralAction", "RoutingAction", "PrivateAction", "GlobalAction"}
    wrappers |= {"InfrastructureAction", "TrafficSignalAction", "EntityAction", "SetAction", "ModifyAction", "Action"}
    wrappers |= {"AssignControllerAction", "OverrideControllerValueAction", "ByEntityCondition", "ByValueCondition"}
    wrappers |= {"EntityCondition", "Condition", "Position", "TargetPosition", "InRoutePosition"}
    kinds = {tag for tag in GRAMMAR if re.search("(Action|Condition|Position)$", tag)}
    assert kinds - wrappers - words == set()
    assert {tag for tag, row in GRAMMAR.items() if row.is_refused} - words == set()
