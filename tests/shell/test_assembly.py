"""Parts of a server made from its settings."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.shell.assembly import make_simulator_node
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.world.people.known_crossings import KnownCrossings
from tests.graph.bus_fixture import make_store


@pytest.mark.slow
def test_first_frames_of_the_opening_scene_find_the_crossings_of_its_people() -> None:
    node = make_simulator_node(Bus(make_store()), Settings(scenario="town"), None, None)
    crossings = node.world.roads.derived(KnownCrossings)
    found = set(crossings._table.numbers)
    assert found
    for _ in range(10):
        node.context.stepper.compute(0.0, is_tick=True, is_last=True)
    assert set(crossings._table.numbers) == found, "a frame has looked for some"
