"""Our node on the graph of ROS 2 by rclpy, ROS 2's own client library; nothing else imports it.

One thread spins, and one takes messages and looks at the graph (`rclpy_readers.py`). They hand messages, requests and
changes of the graph to the event loop through an `Inbox`, as bytes in CDR. The loop publishes, calls and answers by
itself, because these functions do not wait. rclpy tells of no changes of the graph, so each look compares it with what
it was.
"""

from __future__ import annotations

import asyncio
import logging
import os
import sys
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

from rosbridge_sim.errors import DocumentError, GraphError
from rosbridge_sim.graph.actions import HIDDEN
from rosbridge_sim.graph.gateway.far_graph import Endpoint, FarService
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros2.cdr_types import CdrType
from rosbridge_sim.graph.ros2.ros2_names import dds_type, guid_text, is_name
from rosbridge_sim.shell.ros2.inbox import Inbox
from rosbridge_sim.shell.ros2.loopback import close_to_network
from rosbridge_sim.shell.ros2.rclpy_readers import PERIOD, RclpyReaders
from rosbridge_sim.shell.ros2.rclpy_types import InstalledTypes, RclpyObject, no_events, rclpy_errors, rclpy_quality
from rosbridge_sim.shell.ros2.ros2_node import NODE_BESIDE, NODE_NAME, OnEndpoints, OnMessage, Ros2Choices

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


MAX_ECHOES: Final = 1_000
"""Messages of a topic that are remembered as our own: more than a subscription keeps."""

CLOCK_ERROR_NS: Final = 1_000
"""Rounding of a stamp of the library [ns]."""

READY_PERIOD: Final = 0.01
"""Time between two looks whether the provider of a service has been found [s]."""

SWITCH_INTERVAL: Final = 0.0005
"""Longest time for which the thread that spins keeps the event loop from going on [s]; 5 ms is Python's own."""

_log = logging.getLogger("rosbridge_sim.ros2")


@contextmanager
def _environment(discovery: str) -> Iterator[None]:
    """Set where rclpy looks for nodes, while it starts."""
    wanted = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST" if discovery == "localhost" else "SUBNET"}
    if discovery == "localhost":
        wanted |= {"ROS_STATIC_PEERS": "", "ROS_LOCALHOST_ONLY": ""}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, text in before.items():
            if text is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = text


class RclpyNode:
    """Our node; see `FarNode`.

    Attributes:
        on_message, on_endpoints: get what comes, as those of `Ros2Node`.
        inbox: takes the work for the loop.
        library: the node of rclpy, for services and actions.
        types: the installed types.
        on_offers: gets the services and the actions of nodes, if any have changed.
        is_stopped: it has left the domain.
    """

    def __init__(self, choices: Ros2Choices, types: InstalledTypes, loop: asyncio.AbstractEventLoop) -> None:
        """Join the domain.

        Args:
            choices: see `Ros2Choices`.
            types: the installed types.
            loop: takes what comes.

        Raises:
            DocumentError: rclpy refuses the domain.
        """
        import rclpy  # noqa: PLC0415 - 0.5 s, and only with --ros2-domain
        from rclpy.context import Context  # noqa: PLC0415
        from rclpy.executors import SingleThreadedExecutor  # noqa: PLC0415
        from rclpy.node import Node  # noqa: PLC0415
        from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

        self.on_message: OnMessage = lambda _topic, _raw, _now: None
        self.on_endpoints: OnEndpoints = lambda _found, _lost, _now: None
        self.inbox = Inbox(loop)
        self.types = types
        self.on_offers: Callable[[list[FarService], list[FarService]], None] = lambda _services, _actions: None
        self._namespace = choices.namespace
        self.loop = loop
        self._context = Context()
        try:
            with _environment(choices.discovery):
                rclpy.init(
                    args=[],
                    context=self._context,
                    domain_id=choices.domain,
                    signal_handler_options=SignalHandlerOptions.NO,
                )
                self.library = Node(
                    NODE_NAME,
                    context=self._context,
                    namespace=choices.namespace or None,
                    use_global_arguments=False,
                    enable_rosout=False,
                    start_parameter_services=False,
                )
        except Exception as error:  # noqa: BLE001 - a library with a part in C
            raise DocumentError(f"ros2-domain: rclpy cannot join domain {choices.domain}: {error!r:.300}") from None
        if choices.discovery == "localhost":
            close_to_network(choices.domain)
        self._writers: dict[str, RclpyObject] = {}
        self._readers = RclpyReaders(self.library, self._hand, self._look)
        self._wanted: dict[str, tuple[RclpyObject, Quality]] = {}  # readers
        self._foreign: dict[str, int] = {}  # topic -> number of publishers of other programs
        self._echoes: dict[str, deque[tuple[int, int, int]]] = {}
        self._log = OnceLog(_log.name)
        self.is_stopped = False
        self._view = GraphView(self.library, choices.namespace)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.library)
        self._work: deque[Callable[[], object]] = deque()
        self._is_at_work = False
        sys.setswitchinterval(min(sys.getswitchinterval(), SWITCH_INTERVAL))
        self._thread = threading.Thread(target=self._spin, name="rclpy", daemon=True)

    def hide(self, program: bytes) -> None:
        """Take no notice of the endpoints of a program.

        Args:
            program: first 12 bytes of their identities.
        """
        self._view.own.add(program)

    def start(self) -> None:
        """Let messages come from now on."""
        self._thread.start()
        self._readers.start()

    def stop(self) -> None:
        """Leave the domain. A second call does nothing."""
        if self.is_stopped:
            return
        self.is_stopped = True
        self.inbox.stop()
        self._readers.stop()
        self._executor.create_task(self._do_work)
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)  # `stop` of a server takes two seconds at most
        with suppress(Exception):  # the library may be in the midst of something; the process ends anyway
            self._executor.shutdown(timeout_sec=0.1)
            self.library.destroy_node()
            self._context.try_shutdown()

    def _spin(self) -> None:
        while not self.is_stopped:
            try:
                self._executor.spin_once()  # a time-out would be a timer of the library, made anew each time
            except Exception as error:  # noqa: BLE001 - a library, and what it calls: one error must not end all
                if self.is_stopped or not self._context.ok():
                    return
                _log.error("internal error of rclpy", exc_info=error)
                time.sleep(PERIOD)

    def _do_work(self) -> None:
        """Do what others have left for the thread that spins."""
        self._is_at_work = False
        while self._work:
            try:
                self._work.popleft()()
            except Exception as error:  # noqa: BLE001 - see `_spin`
                _log.error("internal error in work with rclpy", exc_info=error)

    # As a `FarNode`

    def open_writer(self, topic: str, cdr_type: CdrType, quality: Quality, *, is_sole: bool) -> None:
        """See `FarNode`. rclpy cannot tell other programs that a writer is the sole one."""
        found = self.types.find(cdr_type.name)
        del is_sole
        with rclpy_errors():
            self._writers[topic] = self.library.create_publisher(
                found, self.far(topic), rclpy_quality(quality), event_callbacks=no_events(is_writer=True)
            )
        self._match_reader(topic)

    def open_reader(self, topic: str, cdr_type: CdrType, quality: Quality) -> None:
        """See `FarNode`."""
        self._wanted[topic] = self.types.find(cdr_type.name), quality
        self._match_reader(topic)

    def close_writer(self, topic: str) -> None:
        """See `FarNode`."""
        writer = self._writers.pop(topic, None)
        self._echoes.pop(topic, None)
        if writer is not None and not self.is_stopped:
            self.destroy(self.library.destroy_publisher, writer)
            self._match_reader(topic)

    def close_reader(self, topic: str) -> None:
        """See `FarNode`."""
        self._wanted.pop(topic, None)
        if not self.is_stopped:
            self._match_reader(topic)

    def write(self, topic: str, raw: bytes) -> bool:
        """See `FarNode`."""
        if self.is_stopped:
            return False
        start = time.time_ns()
        try:
            self._writers[topic].publish(raw)
        except Exception as error:  # noqa: BLE001 - of the library
            self._log.tell(f"{topic}: rclpy cannot publish a message: {error!r:.200}")
            return False
        if topic in self._wanted:
            echoes = self._echoes.setdefault(topic, deque(maxlen=MAX_ECHOES))
            echoes.append((start - CLOCK_ERROR_NS, time.time_ns() + CLOCK_ERROR_NS, hash(raw)))
        return True

    def _match_reader(self, topic: str) -> None:
        """Subscribe if that is wanted. A topic of ours waits for another publisher, because we would hear ourselves.

        Raises:
            GraphError: the library refuses it.
        """
        wanted = self._wanted.get(topic)
        is_needed = wanted is not None and (topic not in self._writers or self._foreign.get(topic, 0) > 0)
        far = self.far(topic)
        if far in self._readers and not is_needed:
            self.destroy(self.library.destroy_subscription, self._readers.close(far))
        elif far not in self._readers and is_needed and wanted is not None:
            self._readers.open(far, *wanted)

    def _hand(self, far: str, raw: bytes, stamp_ns: int) -> None:
        """Hand a message to the loop (in the thread that takes messages)."""
        self.inbox.put(lambda: self._receive(far.removeprefix(self._namespace), raw, stamp_ns), len(raw))

    def _receive(self, topic: str, raw: bytes, stamp_ns: int) -> None:
        """Give a message to the gateway, unless it is our own."""
        echoes = self._echoes.get(topic)
        if echoes and any(start <= stamp_ns <= end and hash(raw) == key for start, end, key in echoes):
            return
        if self.far(topic) in self._readers:
            self.on_message(topic, raw, self.loop.time())

    # The graph

    def _look(self) -> None:
        """Compare the graph with what it was, and hand the changes to the loop (in the thread that takes messages)."""
        with self.library.handle:  # so that the node does not end meanwhile
            found, lost = self._view.look_at_topics()
            offers = self._view.look_at_services()
        if found or lost:
            self.inbox.put(lambda: self._note(found, lost))
        if offers is not None:
            self.inbox.put(lambda: self.on_offers(*offers))

    def _note(self, found: list[Endpoint], lost: list[Endpoint]) -> None:
        """Take changes of topics."""
        for one, step in [(one, 1) for one in found] + [(one, -1) for one in lost]:
            if one.is_writer:
                self._foreign[one.topic] = self._foreign.get(one.topic, 0) + step
        for topic in {one.topic for one in (*found, *lost) if one.is_writer}:
            if not self._foreign[topic]:
                del self._foreign[topic]
            with suppress(GraphError):
                self._match_reader(topic)
        self.on_endpoints(found, [one.key for one in lost], self.loop.time())

    # Small parts

    def far(self, name: str) -> str:
        """Return the name on the graph of a name on the bus."""
        return self._namespace + name

    def run(self, work: Callable[[], object]) -> None:
        """Have a function called in the thread that spins, after those before it: tasks of rclpy have no order."""
        if not self.is_stopped:
            self._work.append(work)
            if not self._is_at_work:
                self._is_at_work = True
                self._executor.create_task(self._do_work)

    def destroy(self, destroy: Callable[[RclpyObject], object], one: RclpyObject) -> None:
        """End something in the thread that spins, which may be waiting for it now."""
        self.run(lambda: destroy(one))
