"""The graph of ROS 2 as rclpy shows it: endpoints of other programs, and the services and actions of their nodes.

rclpy tells of no changes, so each look compares the graph with what it was.
"""

from __future__ import annotations

import uuid
from collections import deque
from collections.abc import Iterator
from typing import Final

from rosbridge_sim.graph.actions import HIDDEN
from rosbridge_sim.graph.gateway.far_graph import Endpoint, FarService
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros2.ros2_names import dds_type, guid_text, is_name
from rosbridge_sim.shell.ros2.rclpy_types import RclpyObject
from rosbridge_sim.shell.ros2.ros2_node import NODE_BESIDE, NODE_NAME

LOOKS_PER_ROUND: Final = 50
"""In so many looks the endpoints of all topics are read again: an endpoint that replaces another one is found so.
Reading those of a topic takes a quarter of a millisecond."""

MAX_FOUND: Final = 20_000
"""Most topics, and most services, of the graph that are looked at."""


class GraphView:
    """The graph as it was seen last.

    Attributes:
        own: first 12 bytes of the identities of endpoints that are no other program's.
    """

    def __init__(self, library: RclpyObject, namespace: str) -> None:
        self._library = library
        self._namespace = namespace
        self.own = {self._own_program()}
        self._shapes: dict[str, tuple[int, int, tuple[str, ...]]] = {}
        self._endpoints: dict[str, dict[str, Endpoint]] = {}  # topic on the graph -> key -> endpoint
        self._next: deque[str] = deque()
        self._num_due = 0.0  # topics of `_next` that are to be read again
        self._services: object = None

    def _own_program(self) -> bytes:
        """Return the first 12 bytes of the identity of each endpoint of ours."""
        from rcl_interfaces.msg import ParameterEvent  # noqa: PLC0415 - a part of rclpy

        topic = f"{self._namespace}/_{NODE_NAME}_{uuid.uuid4().hex}"
        writer = self._library.create_publisher(ParameterEvent, topic, 1)
        infos = self._library.get_publishers_info_by_topic(topic)
        self._library.destroy_publisher(writer)
        return bytes(infos[0].endpoint_gid[:12]) if infos else b""

    def look_at_topics(self) -> tuple[list[Endpoint], list[Endpoint]]:
        """Return the endpoints of other programs that have come or changed, and those that have gone."""
        library = self._library
        shapes: dict[str, tuple[int, int, tuple[str, ...]]] = {}
        count_writers, count_readers = library.handle.get_count_publishers, library.handle.get_count_subscribers
        for far, kinds in library.get_topic_names_and_types():
            if far.startswith(self._namespace) and HIDDEN not in far and len(shapes) < MAX_FOUND:
                shapes[far] = count_writers(far), count_readers(far), tuple(kinds)
        changed = {far for far, shape in shapes.items() if self._shapes.get(far) != shape}
        changed |= self._shapes.keys() - shapes.keys()
        self._num_due += len(shapes) / LOOKS_PER_ROUND
        while self._num_due >= 1:
            self._num_due -= 1
            self._next.extend(() if self._next else shapes)
            changed.add(self._next.popleft())
        self._shapes = shapes
        found: list[Endpoint] = []
        lost: list[Endpoint] = []
        for far in changed:
            before = self._endpoints.pop(far, {})
            now = {one.key: one for one in self._read(far)} if far in shapes else {}
            if now:
                self._endpoints[far] = now
            if any(not one.is_named for one in now.values()):
                self._shapes.pop(far, None)  # look again
            lost += [one for key, one in before.items() if now.get(key) != one]
            found += [one for key, one in now.items() if before.get(key) != one]
        return found, lost

    def _read(self, far: str) -> Iterator[Endpoint]:
        """Yield the endpoints of other programs of a topic."""
        name = far.removeprefix(self._namespace)
        if not is_name(name):
            return
        for is_writer, infos in (
            (True, self._library.get_publishers_info_by_topic(far)),
            (False, self._library.get_subscriptions_info_by_topic(far)),
        ):
            for info in infos:
                gid = bytes(info.endpoint_gid)
                if gid[:12] not in self.own and "/msg/" in info.topic_type:
                    yield _endpoint(name, info, gid, is_writer=is_writer)

    def look_at_services(self) -> tuple[list[FarService], list[FarService]] | None:
        """Return the services and the actions of other nodes; None if they are the same as before."""
        library = self._library
        nodes = library.get_node_names_and_namespaces()
        # The names are those of clients, too, such as our own: the numbers tell whether a provider is there.
        count = library.handle.get_count_services
        services = [(*one, count(one[0])) for one in library.get_service_names_and_types()]
        state = sorted(nodes), services
        if state == self._services:
            return None
        found: list[FarService] = []
        actions: list[FarService] = []
        own = library.get_name(), library.get_namespace()
        for node, namespace in dict.fromkeys(nodes):
            if namespace == own[1] and node in {own[0], NODE_BESIDE}:
                continue
            full = f"{namespace.rstrip('/')}/{node}"
            try:
                provided = library.get_service_names_and_types_by_node(node, namespace)
            except Exception:  # noqa: BLE001, S112 - it has gone meanwhile
                continue
            for far, kinds in provided:
                name = far.removeprefix(self._namespace)
                if not far.startswith(self._namespace) or not is_name(name) or len(found) + len(actions) >= MAX_FOUND:
                    continue
                package, _, short = kinds[0].replace("/srv/", "/").replace("/action/", "/").partition("/")
                if HIDDEN not in name:
                    found.append(FarService(name, f"{package}/{short}"[:300], full))
                elif name.endswith(_SEND_GOAL):
                    kind = f"{package}/{short.removesuffix('_SendGoal')}"[:300]
                    actions.append(FarService(name.removesuffix(_SEND_GOAL), kind, full))
        self._services = state
        return found, actions


_SEND_GOAL: Final = f"{HIDDEN}send_goal"


def _endpoint(name: str, info: RclpyObject, gid: bytes, *, is_writer: bool) -> Endpoint:
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy  # noqa: PLC0415 - see above

    profile = info.qos_profile
    quality = Quality(
        is_reliable=profile.reliability != ReliabilityPolicy.BEST_EFFORT,
        is_latched=profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
    )
    is_named = not info.node_name.startswith("_NODE_NAME_UNKNOWN_")
    node = f"{info.node_namespace.rstrip('/')}/{info.node_name}" if is_named else ""
    return Endpoint(
        gid.hex(), name, dds_type(info.topic_type)[:300], is_writer, quality, node, is_named, guid_text(gid)
    )
