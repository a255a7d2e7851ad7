"""Blocks `rosbridge_sim` of JSON scenarios as they are read: what starts when, and mistakes."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.event_model import MAX_EVENTS
from rosbridge_sim.scenarios.events import read_saved_story
from rosbridge_sim.scenarios.openscenario.story import MAX_LOOKS
from rosbridge_sim.scenarios.openscenario.story_records import StoryText
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_check import read_draft
from rosbridge_sim.scenarios.scenario_model import UNTIL_EVENT
from rosbridge_sim.scenarios.scenario_reader import read_scenario

NEAR = {"when": {"ego_within": 20}, "change_lane": "left"}
LATER = {"time": 3}


def read(block: object, key: str = "vehicleList", **keys: object) -> Scenario:
    return read_scenario(text_of(block, key, **keys), "mine.json")


def text_of(block: object, key: str = "vehicleList", **keys: object) -> bytes:
    item = {"pos": {"x": 1, "y": 2}, "initPosition": {"pos": {"x": 1, "y": 2}}, **keys}
    return json.dumps({key: [{**item, "rosbridge_sim": block}]}).encode()


@pytest.mark.parametrize("key", ["vehicleList", "pedestrianList", "objectList"])
@pytest.mark.parametrize(
    ("block", "distance", "has_story"),
    [
        ({}, 7.0, False),
        (None, 7.0, False),
        ({"start_within": 12.5}, 12.5, False),
        ({"start_when": LATER}, UNTIL_EVENT, True),
    ],
)
def test_a_block_says_when_an_item_starts(key: str, block: object, distance: float, has_story: bool) -> None:  # noqa: FBT001
    scenario = read(block, key, activeDistance=7)
    (spawn,) = (*scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
    assert spawn.start_within == distance
    assert (scenario.story is not None) == has_story


@pytest.mark.parametrize(
    ("block", "line"),
    [
        ({"event": []}, "rosbridge_sim.event: expected one of start_within, start_when, events (did you mean events?)"),
        ({"events": [{**NEAR, "sekonds": 2}]}, "events[0].sekonds: expected one of when, change_lane,"),
        ({"events": [{"when": {"ego_within": 20}}]}, "events[0]: expected change_lane or speed_kmh"),
        (
            {"events": [{**NEAR, "change_lane": "lefd"}]},
            "events[0].change_lane: expected one of left, right, got 'lefd' (did you mean left?)",
        ),
        ({"events": [{**NEAR, "when": {}}]}, "events[0].when: expected time or ego_passes or ego_within or passes"),
        (
            {"events": [{**NEAR, "when": {"ego_within": -1}}]},
            "events[0].when.ego_within: expected at least 0.01, got -1",
        ),
        ({"events": [{**NEAR, "when": {"passes": {"s": 3}}}]}, "when.passes: expected link and s, or x and y"),
        ({"events": [{**NEAR, "when": {"passes": {"x": 3}}}]}, "when.passes: expected link and s, or x and y"),
        (
            {"events": [{**NEAR, "when": {"passes": {"link": "a", "x": 3, "y": 2}}}]},
            "when.passes: expected link and s, or x and y",
        ),
        ({"start_within": 3, "start_when": LATER}, "rosbridge_sim: expected start_within or start_when; got both"),
        ({"start_when": {"ego_within": 3}}, "start_when.ego_within: expected one of time, ego_passes"),
        ({"events": [NEAR] * (MAX_EVENTS + 1)}, "rosbridge_sim.events: expected at most 100"),
        ([], "rosbridge_sim: expected an object"),
    ],
)
def test_a_mistake_is_told_with_its_place(block: object, line: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read(block)
    assert line in str(caught.value)
    (mistake,) = read_draft(text_of(block), "mine.json").mistakes
    assert line in mistake


def test_people_have_no_events_and_lights_no_lanes() -> None:
    with pytest.raises(DocumentError, match="expected one of start_within, start_when"):
        read({"events": [NEAR]}, "pedestrianList")
    text = json.dumps({"rosbridge_sim": {"events": [{"when": {"ego_within": 3}, "light": "a", "state": "red"}]}})
    with pytest.raises(DocumentError, match=r"rosbridge_sim.events\[0\].when.ego_within: expected one of time"):
        read_scenario(text.encode(), "mine.json")


def test_there_are_at_most_as_many_triggers_as_a_frame_looks_at() -> None:
    block = {"start_when": {"time": 3, "ego_passes": {"x": 1, "y": 1}}}
    item = {"pos": {"x": 1, "y": 2}, "rosbridge_sim": block}
    with pytest.raises(DocumentError, match=r"mine.json: expected at most 1,000 conditions .* got 1,002"):
        read_scenario(json.dumps({"objectList": [item] * (MAX_LOOKS // 2 + 1)}).encode(), "mine.json")


@pytest.mark.parametrize(
    "text",
    [b"{", b"{}", b"[]", b'{"vehicles":{},"items":{},"scenario":{},"x":1}', b'{"vehicles":{"a":{"b":1}}}', b"<a"],
)
def test_a_text_of_a_snapshot_that_is_no_story_is_refused(text: bytes) -> None:
    with pytest.raises(DocumentError, match=r"mine.json"):
        read_saved_story(StoryText("mine.json", text))
