"""Damaged scenarios and maps: read, or refused in one error line."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.maps.georeference import Georeference
from rosbridge_sim.maps.map_check import describe_map, list_files
from rosbridge_sim.maps.map_formats import find_map_mistakes, read_map
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_check import find_oddities, place_draft, read_draft
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, read_scenario, sort_phases
from rosbridge_sim.shell.files.library import DATA
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.roads.signals import Signals
from rosbridge_sim.world.state.world import World
from tests.mutations import Edit, Flip, damage, edits, examples, flips, spoil
from tests.simulator.sim_harness import ALL, Client, make_store
from tests.simulator.small_maps import KOREAN, ROADRUNNER, tiny

SCENARIOS: dict[str, Any] = {
    **{path.stem: json.loads(path.read_bytes()) for path in sorted((DATA / "scenarios").glob("*.json"))},
    "saved": json.loads((Path(__file__).parents[1] / "scenarios" / "fixtures" / "saved.json").read_bytes()),
}
MAPS = {"korean": KOREAN, "roadrunner": ROADRUNNER}


@cache
def town() -> RoadMap:
    return read_map(files_of(DATA / "maps" / "town"), "town")


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.json")}


def is_one_line(text: str) -> bool:
    return 0 < len(text) < 1_000 and text.isprintable()


def explain(text: bytes) -> bool:
    """Read a scenario as the server does, then as `scenario check` does; whether it is good."""
    told = ""
    try:
        scenario = place_on_roads(read_scenario(text, "a.json"), town().roads)
        phases, notes = sort_phases(scenario, town().plan)
        assert len(phases) + len(notes) == len(scenario.phases)
    except DocumentError as error:
        told = str(error)
        assert is_one_line(told)
    draft = read_draft(text, "a.json")
    mistakes = list(draft.mistakes)
    if draft.scenario is not None:
        placed, more = place_draft(draft.scenario, town())
        mistakes += more
        assert all(map(is_one_line, find_oddities(placed, town().roads)))
    assert all(map(is_one_line, mistakes))
    assert bool(told) == bool(mistakes)
    return not told


@pytest.mark.slow
@examples(60)
@given(name=st.sampled_from(sorted(SCENARIOS)), changes=edits())
def test_scenario_with_odd_values_is_read_or_gives_one_error_line(name: str, changes: list[Edit]) -> None:
    explain(json.dumps(spoil(SCENARIOS[name], changes)).encode())


@examples(60)
@given(name=st.sampled_from(sorted(SCENARIOS)), changes=flips())
def test_damaged_scenario_is_read_or_gives_one_error_line(name: str, changes: list[Flip]) -> None:
    explain(damage(json.dumps(SCENARIOS[name]).encode(), changes))


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_undamaged_scenarios_are_valid(name: str) -> None:
    assert explain(json.dumps(SCENARIOS[name]).encode())


def survey(files: dict[str, bytes]) -> bool:
    """Read a map as the server does, then as `map info` does; whether it is good."""
    mistakes = find_map_mistakes(files, "maps/a")
    assert all(map(is_one_line, mistakes))
    list_files(files, files)
    try:
        road_map = read_map(files, "maps/a")
    except DocumentError as error:
        assert is_one_line(str(error))  # noqa: PT017 - either is right
        assert mistakes
        return False
    assert mistakes == []
    assert all(map(is_one_line, road_map.notes))
    json.dumps(describe_map(files, road_map), allow_nan=False)
    Georeference().locate(road_map, 1.0, 2.0)
    if len(road_map.roads):
        road_map.roads.nearest([0.0], [0.0], [0.0])
    Signals(road_map.plan).show(1_000)
    return True


@pytest.mark.slow
@examples(60)
@given(name=st.sampled_from(sorted(MAPS)), data=st.data())
def test_map_with_odd_values_is_read_or_gives_one_error_line(name: str, data: st.DataObject) -> None:
    files = dict(MAPS[name])
    for file in data.draw(st.lists(st.sampled_from(sorted(files)), min_size=1, max_size=2, unique=True)):
        files[file] = spoil(files[file], data.draw(edits()))
    survey({file: json.dumps(content).encode() for file, content in files.items()})


@examples(30)
@given(name=st.sampled_from(sorted(MAPS)), data=st.data())
def test_damaged_map_is_read_or_gives_one_error_line(name: str, data: st.DataObject) -> None:
    files = {file: json.dumps(content).encode() for file, content in MAPS[name].items()}
    file = data.draw(st.sampled_from(sorted(files)))
    files[file] = damage(files[file], data.draw(flips()))
    survey(files)


@pytest.mark.parametrize("name", sorted(MAPS))
def test_undamaged_maps_are_valid(name: str) -> None:
    assert survey({file: json.dumps(content).encode() for file, content in MAPS[name].items()})


# In a simulator that runs


class OneScenarioLibrary:
    """Whatever scenario is put there, under every name; the map of it is the small one."""

    def __init__(self) -> None:
        self.text = json.dumps(SCENARIOS["demo"]).encode()

    def scenario(self, name: str) -> Scenario:
        return read_scenario(self.text, f"{name}.json")

    def map(self, name: str) -> RoadMap:
        del name
        return tiny()


@examples(15)
@given(name=st.sampled_from(sorted(SCENARIOS)), changes=edits())
def test_load_of_an_odd_scenario_is_complete_or_changes_nothing(name: str, changes: list[Edit]) -> None:
    shelf = OneScenarioLibrary()
    shelf.text = json.dumps({"egoVehicle": {"initPosition": {"pos": {"x": 1.0, "y": 2.0, "z": 0.0}}}}).encode()
    bus, world = Bus(make_store()), World(seed=0)
    node = make_node(bus, world, shelf, shelf.scenario("first"), NodeSettings())
    client = Client(bus, "/loader")
    client.listen("/Ego_topic", "/Object_topic", "/CollisionData")
    before = world.digest()
    shelf.text = json.dumps(spoil(SCENARIOS[name], changes)).encode()
    answer = client.ask("/Service_MoraiSL", file_name="odd", **ALL)
    if not answer["result"]:
        assert world.digest() == before
    for i in range(4):
        node.advance(100.0 + i * 0.02)
    ego = client.messages("/Ego_topic")[-1]
    numbers = [*ego["position"].values(), *ego["velocity"].values(), ego["heading"]]
    assert all(map(math.isfinite, numbers))
