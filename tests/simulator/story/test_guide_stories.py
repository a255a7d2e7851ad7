"""The stories of `docs/guides/write_scenario.md`, told: each does what the page says, in both forms."""

from __future__ import annotations

import importlib.util
import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.story_files import StoryOptions
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.world.state.world import Kind, World
from tests.simulator.sim_harness import make_store
from tests.support import ROOT, miss

PAGE = Path(__file__).parents[3] / "docs" / "guides" / "write_scenario.md"
BLOCKS = {
    (name, kind): text
    for name, kind, text in re.findall(r"<!-- story: (.+?) -->\n```(\w+)\n(.*?)```", PAGE.read_text(), re.DOTALL)
}
SUFFIX = {"xml": "xosc", "json": "json"}


def begin(tmp_path: Path, name: str, kind: str) -> SimulatorNode:
    path = tmp_path / f"mine.{SUFFIX[kind]}"
    path.write_text(BLOCKS[name, kind])
    library = DiskLibrary(stories=StoryOptions(drives_ego=True))
    node = make_node(
        Bus(make_store()), World(), library, library.opening_scenario(str(path)), NodeSettings(start="sync")
    )
    assert node.context.scene.road_map.name in {"motorway", "track"}
    return node


def run_until(node: SimulatorNode, is_done: Callable[[World], bool], most: float) -> float:
    """The time at which something is so [s]; the ego keeps its speed where no story moves it."""
    world = node.context.world
    row = world.row(0)
    for frame in range(round(most * 50)):
        if is_done(world):
            return frame * 0.02
        if not world.is_ghost[row]:
            world.speed[row] = max(world.speed[row], 12.0)
        node.context.stepper.compute(0.0, is_tick=True, is_last=True)
    return math.inf


def other(world: World, kind: Kind) -> int:
    return int(world.rows(kind)[0])


def test_the_page_has_four_stories_in_both_forms(tmp_path: Path) -> None:
    names = {"cut-in", "jaywalker", "red light", "merge"}
    assert set(BLOCKS) == {(name, kind) for name in names for kind in SUFFIX}
    assert all(len(text.splitlines()) <= 30 for text in BLOCKS.values())
    assert all(begin(tmp_path, *block).context.scene.loaded.story for block in BLOCKS)


SPOILT = [
    ('"ego_within"', '"ego_witin"'),
    ('"seconds": 2.5', '"seconds": "soon"'),
    ('"left"', '"leftt"'),
    ('"events": [', '"events": [3, '),
    ('"initLinkRatio": 0.04', '"initLinkRatio": 4'),
]


def test_the_json_schema_takes_the_stories_and_refuses_spoilt_ones() -> None:
    if importlib.util.find_spec("jsonschema") is None:
        miss("needs jsonschema, which check-jsonschema brings: pip install -e '.[lint]'")
    from jsonschema import Draft202012Validator  # type: ignore[import-untyped] # noqa: PLC0415 - of an extra

    schema = json.loads((ROOT / "schemas" / "scenario.schema.json").read_text("utf-8"))
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    stories = {name: text for (name, kind), text in BLOCKS.items() if kind == "json"}
    assert len(stories) == 4
    assert all(validator.is_valid(json.loads(text)) for text in stories.values())
    for good, bad in SPOILT:
        assert good in stories["cut-in"]
        assert not validator.is_valid(json.loads(stories["cut-in"].replace(good, bad, 1))), bad


@pytest.mark.parametrize("kind", SUFFIX)
def test_a_car_cuts_in_before_the_ego(tmp_path: Path, kind: str) -> None:
    node = begin(tmp_path, "cut-in", kind)
    assert node.context.world.y[other(node.context.world, Kind.VEHICLE)] == -3.5
    time = run_until(node, lambda world: abs(world.y[other(world, Kind.VEHICLE)]) < 0.1, 12.0)
    assert 1.0 < time < 12.0
    world = node.context.world
    assert world.x[other(world, Kind.VEHICLE)] > world.x[world.row(0)]


@pytest.mark.parametrize("kind", SUFFIX)
def test_a_pedestrian_crosses_when_the_ego_is_near(tmp_path: Path, kind: str) -> None:
    node = begin(tmp_path, "jaywalker", kind)

    def walks(world: World) -> bool:
        return bool(world.y[other(world, Kind.PEDESTRIAN)] > -5.9)

    run_until(node, walks, 12.0)
    world = node.context.world
    row = world.row(0)
    away = math.hypot(world.x[row] - 120.0, world.y[row] + 4.0)
    assert 35.0 < away < 46.0
    assert run_until(node, lambda world: bool(world.y[other(world, Kind.PEDESTRIAN)] > 5.9), 12.0) < 12.0


@pytest.mark.parametrize("kind", SUFFIX)
def test_a_light_is_red_and_then_green(tmp_path: Path, kind: str) -> None:
    node = begin(tmp_path, "red light", kind)
    red = run_until(node, lambda world: world.signals.shown[0] == 1, 3.0)
    green = run_until(node, lambda world: world.signals.shown[0] == 16, 30.0)
    assert red <= 1.1
    assert green == pytest.approx(8.0, abs=0.1)


@pytest.mark.parametrize("kind", SUFFIX)
def test_a_car_merges(tmp_path: Path, kind: str) -> None:
    node = begin(tmp_path, "merge", kind)
    world = node.context.world
    assert world.y[other(world, Kind.VEHICLE)] == pytest.approx(-7.0, abs=0.5)
    assert run_until(node, lambda world: bool(abs(world.y[other(world, Kind.VEHICLE)] + 3.5) < 0.2), 20.0) < 20.0
