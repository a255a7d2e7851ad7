"""The simulator, put together: a node with all its parts."""

from __future__ import annotations

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.command_topics import CommandTopics
from rosbridge_sim.morai.component import Component
from rosbridge_sim.morai.interfaces.network_settings import Networks
from rosbridge_sim.morai.loads import Loads
from rosbridge_sim.morai.reading import AtOnce, Reader
from rosbridge_sim.morai.replays.recording_builder import Recordings
from rosbridge_sim.morai.replays.replay import Replay
from rosbridge_sim.morai.scenarios.reader import Scenario
from rosbridge_sim.morai.scene import Library
from rosbridge_sim.morai.sensor_files import SensorDataStore
from rosbridge_sim.morai.sensors import Sensors
from rosbridge_sim.morai.services import Services
from rosbridge_sim.morai.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.morai.state_publishers import StatePublishers
from rosbridge_sim.morai.traffic_light_topics import TrafficLightTopics
from rosbridge_sim.world.state import World

__all__ = ["make_node"]


def make_node(
    bus: Bus,
    world: World,
    library: Library,
    scenario: Scenario,
    settings: NodeSettings | None = None,
    *,
    archive: SensorDataStore | None = None,
    recordings: Recordings | None = None,
    networks: Networks | None = None,
    reader: Reader | None = None,
) -> SimulatorNode:
    """The simulator with its opening scene, on the bus; the arguments and errors are those of `SimulatorNode`.

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

    def make_parts(node: SimulatorNode) -> list[Component]:
        """All there are, in the order in which their topics go out with a frame."""
        sensors = Sensors(node, archive)
        return [
            StatePublishers(node),
            TrafficLightTopics(node),
            sensors,
            Loads(node, reader or AtOnce(), networks),
            Services(node, sensors),
            CommandTopics(node),
            Replay(node, recordings, is_showing_drives=chosen.replay_info),
        ]

    return SimulatorNode(bus, world, library, scenario, settings=chosen, make_parts=make_parts)
