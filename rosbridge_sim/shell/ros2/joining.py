"""The gateway to ROS 2, made from the settings, and its node: of one library, or of two."""

from __future__ import annotations

import asyncio
import importlib.util
import logging
from collections.abc import Callable
from functools import partial
from typing import Any

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarService
from rosbridge_sim.graph.gateway.far_offers import FarOffers
from rosbridge_sim.graph.gateway.gateway import PERIOD, Gateway
from rosbridge_sim.graph.gateway.node_services import NodeServices
from rosbridge_sim.graph.gateway.quality import Quality, read_choice
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.ros2.cdr_types import CdrType, CdrTypes
from rosbridge_sim.graph.ros2.ros2_actions import Ros2Actions
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.graph.rosapi_services.remote_parameters import RemoteParameters
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.records import replace
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.clocks.scheduler import Scheduler
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.definitions import Texts, read_installed
from rosbridge_sim.shell.ros2.dds_library import why_no_library
from rosbridge_sim.shell.ros2.rclpy_actions import RclpyActions
from rosbridge_sim.shell.ros2.rclpy_node import RclpyNode
from rosbridge_sim.shell.ros2.rclpy_services import RclpyOffers, RclpyServices
from rosbridge_sim.shell.ros2.rclpy_types import InstalledTypes, share_folders, why_not_there
from rosbridge_sim.shell.ros2.ros2_node import NODE_BESIDE, NODE_NAME, Ros2Choices, Ros2Node


class JointNode:
    """Our node; see `FarNode`. The endpoints of other programs are those that rclpy sees."""

    def __init__(self, rclpy: RclpyNode, dds: Ros2Node) -> None:
        """Join two nodes in one domain into one.

        Args:
            rclpy: takes the topics whose types are installed.
            dds: takes the others.
        """
        self._rclpy, self._dds = rclpy, dds
        self._writers: dict[str, RclpyNode | Ros2Node] = {}
        self._readers: dict[str, RclpyNode | Ros2Node] = {}
        rclpy.hide(dds.program)

    def _side(self, cdr_type: CdrType) -> RclpyNode | Ros2Node:
        return self._rclpy if self._rclpy.types.has(cdr_type.name) else self._dds

    def open_writer(self, topic: str, cdr_type: CdrType, quality: Quality, *, is_sole: bool) -> None:
        """See `FarNode`."""
        side = self._writers[topic] = self._side(cdr_type)
        side.open_writer(topic, cdr_type, quality, is_sole=is_sole)

    def open_reader(self, topic: str, cdr_type: CdrType, quality: Quality) -> None:
        """See `FarNode`."""
        side = self._readers[topic] = self._side(cdr_type)
        side.open_reader(topic, cdr_type, quality)

    def close_writer(self, topic: str) -> None:
        """See `FarNode`."""
        self._writers.pop(topic).close_writer(topic)

    def close_reader(self, topic: str) -> None:
        """See `FarNode`."""
        self._readers.pop(topic).close_reader(topic)

    def write(self, topic: str, raw: bytes) -> bool:
        """See `FarNode`."""
        return self._writers[topic].write(topic, raw)

    def start(self) -> None:
        """Let messages come from now on."""
        self._rclpy.start()

    def stop(self) -> None:
        """Leave the domain."""
        self._rclpy.stop()
        self._dds.stop()


_log = logging.getLogger("rosbridge_sim.ros2")


class JoinedRos2:
    """A server as a node of ROS 2.

    Attributes:
        gateway: moves the messages.
    """

    def __init__(
        self, gateway: Gateway[CdrType], node: Ros2Node | RclpyNode | JointNode, offers: _Offers | None
    ) -> None:
        self.gateway = gateway
        self.node = node
        self._offers = offers

    def settle(self) -> None:
        """Open all writers and readers that are wanted now: while the world waits for its first frame."""
        for clock in (self.gateway, self._offers):
            while clock is not None and clock.next_due(0.0) is not None:
                clock.advance(asyncio.get_running_loop().time() + PERIOD)
        if not isinstance(self.node, Ros2Node):
            self.node.start()

    def stop(self) -> None:
        """Leave the graph. A second call does nothing."""
        now = asyncio.get_running_loop().time()
        self.gateway.leave(now)
        if self._offers is not None:
            self._offers.leave(now)
        self.node.stop()


class _Offers:
    """Services and actions of the bus for nodes, offered anew after each change of the bus; a clock of the server.

    Attributes:
        on_change: called if there is something to do.
    """

    def __init__(self, *pairs: tuple[FarOffers[Any], RclpyOffers[Any]]) -> None:
        self._pairs = pairs
        self._is_ended = False
        self._due: float | None = 0.0
        self.on_change: Callable[[], None] = lambda: None

    def mark(self) -> None:
        """Note that the bus has changed."""
        if self._due is None and not self._is_ended:
            self._due = asyncio.get_running_loop().time() + PERIOD
            self.on_change()

    def next_due(self, _now: float, /) -> float | None:
        """See `Clock`."""
        return self._due

    def advance(self, now: float, /) -> None:
        """See `Clock`."""
        if self._due is not None and now >= self._due:
            are_more = [far.offer(here.offered()) for here, far in self._pairs]
            self._due = now if any(are_more) else None

    def note_foreign(self, *found: list[FarService]) -> None:
        """Offer on the bus what nodes provide now."""
        for (here, far), foreign in zip(self._pairs, found, strict=True):
            here.set_foreign(foreign)
            far.keep_clients({one.name for one in foreign})

    def leave(self, now: float) -> None:
        """End all that nodes offer on the bus."""
        for here, _ in self._pairs:
            here.leave(now)

    def end(self, error: Exception) -> None:
        """See `Endable`."""
        _log.error("internal error; no service is offered to ROS 2 any more", exc_info=error)
        self._due, self._is_ended = None, True


def join_ros2(settings: Settings, bus: Bus, policy: Policy, texts: Texts, scheduler: Scheduler) -> JoinedRos2:
    """Join the domain of the settings, and move messages from now on.

    Args:
        settings: all settings; `ros2_domain` is set.
        policy: rights of all clients.
        scheduler: calls the gateway.

    Raises:
        DocumentError: the library is missing or refuses the domain.
    """
    assert settings.ros2_domain is not None
    choices = Ros2Choices(
        settings.ros2_domain,
        settings.ros2_distro,
        settings.ros2_namespace,
        settings.ros2_discovery,
        settings.max_frame_size,
    )
    loop = asyncio.get_running_loop()
    rclpy: RclpyNode | None = None
    dds: Ros2Node | None = None
    if is_through_rclpy(settings.ros2_through):
        installed = read_installed(share_folders())
        rclpy = RclpyNode(choices, InstalledTypes(installed), loop)
        rclpy.inbox.on_work = scheduler.look
        known = set(bus.store.packages())
        bus.store.add({key: text for key, text in installed.items() if key[0] not in known})
        texts = {**texts, **installed}  # the classes of rclpy have the installed definitions
        store = Store(texts, leniency=LENIENCY, ros=2)
    if rclpy is None or (settings.ros2_through == "auto" and why_no_library() is None):
        dds = Ros2Node(choices if rclpy is None else replace(choices, name=NODE_BESIDE), loop)
        dds.on_work = scheduler.look
    if rclpy is None:
        store = bus.store if bus.store.ros == 2 else Store(texts, leniency=LENIENCY, ros=2)  # noqa: PLR2004 - a generation
    types = CdrTypes(bus.store, store)
    # A new endpoint takes rclpy less than a millisecond, and the DDS library up to 40.
    graph = ROS2_GRAPH if dds else replace(ROS2_GRAPH, endpoints_per_turn=10)
    libraries = [one for one in (rclpy, dds) if one is not None]
    node = JointNode(rclpy, dds) if rclpy and dds else libraries[0]
    gateway = Gateway(
        graph,
        bus,
        types.find,
        node,
        policy,
        topics=Rule(settings.ros2_topics),
        qualities=[read_choice(text) for text in settings.ros2_qos],
    )
    for one in libraries:
        one.on_message = gateway.receive
    libraries[0].on_endpoints = gateway.note_endpoints  # both see the same
    gateway.on_change = scheduler.look
    scheduler.add(gateway)
    offers = None
    if rclpy is not None:
        offers = _make_offers(settings, rclpy, bus, types, policy)
        offers.on_change = scheduler.look
        scheduler.add(offers)
    where = f"ROS_DOMAIN_ID={settings.ros2_domain}"
    if settings.ros2_discovery == "localhost":
        variable = (
            "ROS_LOCALHOST_ONLY=1" if settings.ros2_distro == "humble" else "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
        )
        where += f" {variable}"
    through = "through rclpy" if offers else "topics alone, through DDS"
    name = f"{settings.ros2_namespace}/{NODE_NAME}"
    _log.info("node %s of ROS 2 (%s): other nodes see it with %s", name, through, where)
    return JoinedRos2(gateway, node, offers)


def _make_offers(settings: Settings, rclpy: RclpyNode, bus: Bus, types: CdrTypes, policy: Policy) -> _Offers:
    far_services, far_actions = RclpyServices(rclpy), RclpyActions(rclpy)
    services = NodeServices(ROS2_GRAPH, bus, types.find_service, policy, far_services.call)
    parameters = RemoteParameters(bus, policy, lambda service: service.owner is services)
    services.check_request = parameters.check_request
    actions = Ros2Actions(bus, types, policy, far_actions.send_goal)
    services.is_offered = actions.is_offered = partial(is_for_nodes, settings)
    far_services.services, far_actions.actions = services, actions
    offers = _Offers((services, far_services), (actions, far_actions))
    services.on_change = offers.mark
    rclpy.on_offers = offers.note_foreign
    return offers


def is_through_rclpy(choice: str) -> bool:
    """Return whether rclpy is below the node.

    Raises:
        DocumentError: it is wanted, and cannot be used.
    """
    why_not = None if choice == "dds" else why_not_there()
    if choice == "rclpy" and why_not is not None:
        raise DocumentError(f"ros2-through: {why_not}")
    if why_not is not None and importlib.util.find_spec("rclpy") is not None:
        _log.warning("%s: the DDS library is used, with topics alone", why_not)
    return choice != "dds" and why_not is None


def is_for_nodes(settings: Settings, name: str, owner: Participant) -> bool:
    """Return whether nodes may call a service of an owner.

    Programs of other machines have shown no token, and the services of the server change files and the world. So it
    offers none of its own to them, unless it was told which.
    """
    rule = Rule(settings.ros2_services)
    is_near = settings.ros2_discovery == "localhost"
    return rule.admits(name) and (bool(rule.allow) or is_near or owner.is_guest)
