"""The gateway to ROS 2, made from the settings."""

from __future__ import annotations

import asyncio
import logging

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.gateway import PERIOD, Gateway
from rosbridge_sim.graph.gateway.quality import read_choice
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.ros2.cdr_types import CdrType, CdrTypes
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.clocks.scheduler import Scheduler
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.definitions import Texts
from rosbridge_sim.shell.ros2.ros2_node import Ros2Choices, Ros2Node

_log = logging.getLogger("rosbridge_sim.ros2")


class JoinedRos2:
    """A server as a node of ROS 2.

    Attributes:
        gateway: moves the messages.
    """

    def __init__(self, gateway: Gateway[CdrType], node: Ros2Node) -> None:
        self.gateway = gateway
        self.node = node

    def settle(self) -> None:
        """Open all writers and readers that are wanted now: while the world waits for its first frame."""
        while self.gateway.next_due(0.0) is not None:
            self.gateway.advance(asyncio.get_running_loop().time() + PERIOD)

    def stop(self) -> None:
        """Leave the graph. A second call does nothing."""
        self.gateway.leave(asyncio.get_running_loop().time())
        self.node.stop()


def join_ros2(settings: Settings, bus: Bus, policy: Policy, texts: Texts, scheduler: Scheduler) -> JoinedRos2:
    """Join the domain of the settings, and move messages from now on.

    Args:
        settings: all settings; `ros2_domain` is set.
        bus: the bus of the server.
        policy: rights of all clients.
        texts: definitions of types.
        scheduler: calls the gateway.

    Raises:
        DocumentError: the library is missing or refuses the domain.
    """
    assert settings.ros2_domain is not None
    node = Ros2Node(
        Ros2Choices(
            settings.ros2_domain,
            settings.ros2_distro,
            settings.ros2_namespace,
            settings.ros2_discovery,
            settings.max_frame_size,
        ),
        asyncio.get_running_loop(),
    )
    store = bus.store if bus.store.ros == 2 else Store(texts, leniency=LENIENCY, ros=2)  # noqa: PLR2004 - a generation
    gateway = Gateway(
        ROS2_GRAPH,
        bus,
        CdrTypes(bus.store, store),
        node,
        policy,
        topics=Rule(settings.ros2_topics),
        qualities=[read_choice(text) for text in settings.ros2_qos],
    )
    node.gateway = gateway
    node.on_work = gateway.on_change = scheduler.look
    scheduler.add(gateway)
    where = f"ROS_DOMAIN_ID={settings.ros2_domain}"
    if settings.ros2_discovery == "localhost":
        variable = (
            "ROS_LOCALHOST_ONLY=1" if settings.ros2_distro == "humble" else "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
        )
        where += f" {variable}"
    _log.info("node %s of ROS 2: other nodes see it with %s", node.full_name, where)
    return JoinedRos2(gateway, node)
