"""The simulator, put together: a node with all its parts."""

from __future__ import annotations

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.captures import Archive
from rosbridge_sim.morai.crossings import Crossings
from rosbridge_sim.morai.inputs import Inputs
from rosbridge_sim.morai.loads import Loads
from rosbridge_sim.morai.network_settings import Networks
from rosbridge_sim.morai.node import Node, NodeSettings
from rosbridge_sim.morai.part import Part
from rosbridge_sim.morai.reading import AtOnce, Reader
from rosbridge_sim.morai.replays.recorded import Recordings
from rosbridge_sim.morai.replays.replay import Replay
from rosbridge_sim.morai.scenarios.scenario import Scenario
from rosbridge_sim.morai.sensors import Sensors
from rosbridge_sim.morai.services import Services
from rosbridge_sim.morai.stage import Library
from rosbridge_sim.morai.states import States
from rosbridge_sim.world.state import World

__all__ = ["make_node"]


def make_node(
    bus: Bus,
    world: World,
    library: Library,
    scenario: Scenario,
    settings: NodeSettings | None = None,
    *,
    archive: Archive | None = None,
    recordings: Recordings | None = None,
    networks: Networks | None = None,
    reader: Reader | None = None,
) -> Node:
    """The simulator with its opening scene, on the bus; the arguments and errors are those of `Node`.

    Args:
        bus: where its topics and services are.
        world: empty.
        library: where scenarios and maps come from.
        scenario: the opening scene.
        settings: None for the defaults.
        archive: where sensors' data is saved; None where there is no place for it.
        recordings: where those come from that are to be replayed; None for nowhere.
        networks: where scenarios' network settings are; None where there are none.
        reader: reads what clients load; None has everybody wait meanwhile.

    Raises:
        DocumentError: the scenario does not fit its map, or the network settings do not fit.
    """
    chosen = settings or NodeSettings()

    def make_parts(node: Node) -> list[Part]:
        """All there are, in the order in which their topics go out with a frame."""
        sensors = Sensors(node, archive)
        return [
            States(node),
            Crossings(node),
            sensors,
            Loads(node, reader or AtOnce(), networks),
            Services(node, sensors),
            Inputs(node),
            Replay(node, recordings, is_showing_drives=chosen.replay_info),
        ]

    return Node(bus, world, library, scenario, settings=chosen, make_parts=make_parts)
