"""The simulator, put together: a node with all its parts."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.crossings import Crossings
from rosbridge_sim.morai.inputs import Inputs
from rosbridge_sim.morai.node import Node, NodeSettings
from rosbridge_sim.morai.scenario import Scenario
from rosbridge_sim.morai.services import Services
from rosbridge_sim.morai.stage import Library
from rosbridge_sim.morai.states import States
from rosbridge_sim.world.state import World

__all__ = ["make_node"]

PARTS: Final = (States, Crossings, Services, Inputs)
"""In the order in which their topics go out with a frame."""


def make_node(
    bus: Bus, world: World, library: Library, scenario: Scenario, settings: NodeSettings | None = None
) -> Node:
    """The simulator with its opening scene, on the bus; the arguments and errors are those of `Node`.

    Args:
        bus: where its topics and services are.
        world: empty.
        library: where scenarios and maps come from.
        scenario: the opening scene.
        settings: None for the defaults.

    Raises:
        DocumentError: the scenario does not fit its map, or a rate is none.
    """
    return Node(bus, world, library, scenario, settings=settings or NodeSettings(), parts=PARTS)
