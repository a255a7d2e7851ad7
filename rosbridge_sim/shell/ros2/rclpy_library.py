"""Our node on the graph of ROS 2 by rclpy, ROS 2's own client library; nothing else imports it.

One thread spins. It hands messages, requests and changes of the graph to the event loop through an `Inbox`, as bytes in
CDR. The loop publishes, calls and answers by itself, because these functions do not wait.
rclpy tells of no changes of the graph, so the thread compares it with what it was, ten times a second.
"""

from __future__ import annotations

import asyncio
import importlib
import importlib.util
import logging
import os
import sys
import threading
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeAlias

from rosbridge_sim.errors import DocumentError, GraphError
from rosbridge_sim.graph.actions import HIDDEN
from rosbridge_sim.graph.gateway.far_graph import Endpoint, FarService, OnReply
from rosbridge_sim.graph.gateway.node_services import NodeServices
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros2.cdr_types import CdrServiceType, CdrType
from rosbridge_sim.graph.ros2.ros2_names import dds_type, guid_text, is_name
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.shell.ros2.inbox import Inbox
from rosbridge_sim.shell.ros2.loopback import close_to_network
from rosbridge_sim.shell.ros2.ros2_node import NODE_BESIDE, NODE_NAME, Ros2Choices, Taker

PERIOD: Final = 0.1
"""Least time between two looks at the graph [s]."""

LOOK_SHARE: Final = 20
"""A look at the graph is followed by at least this many times its duration without one."""

TOPICS_PER_LOOK: Final = 20
"""Topics whose endpoints are read again in each look, in turn: an endpoint that replaces another one is found so."""

MAX_FOUND: Final = 20_000
"""Most topics, and most services, of the graph that are looked at."""

MAX_ECHOES: Final = 1_000
"""Messages of a topic that are remembered as our own: more than a subscription keeps."""

CLOCK_ERROR_NS: Final = 1_000
"""Rounding of a stamp of the library [ns]."""

SERVICES_PER_TURN: Final = 10
"""Services that one turn of the loop offers to nodes: one takes about a millisecond."""

READY_PERIOD: Final = 0.01
"""Time between two looks whether the provider of a service has been found [s]."""

MAX_SENT: Final = 10
"""Requests to one service that wait for an answer: a provider keeps 10 that it has not taken yet, and loses others."""

ANSWERS_PER_PERIOD: Final = 5
ANSWER_PERIOD: Final = 0.005
"""Most answers of one service in a period [s]."""

QUEUE_PATIENCE: Final = 1.0
"""Longest wait of a request for that [s], since a provider may also take many and answer late."""

SWEEP_PERIOD: Final = 1.0
"""Time between two looks for calls that have ended without an answer [s]."""

CALLS: Final = Quality(depth=1_000)
"""Of requests and answers: ROS 2's own depth of 10 loses some of 20 calls at once."""

SWITCH_INTERVAL: Final = 0.0005
"""Longest time for which the thread that spins keeps the event loop from going on [s]; 5 ms is Python's own."""

_log = logging.getLogger("rosbridge_sim.ros2")

_Class: TypeAlias = Any
"""A class or an object of rclpy, which is not there when types are checked."""


# The library and its types


def why_not_there() -> str | None:
    """Return why rclpy cannot be used; None if it can."""
    if importlib.util.find_spec("rclpy") is None:
        return "rclpy is not installed for this Python; source setup.bash of ROS 2 first"
    try:
        importlib.import_module("rclpy.executors")
    except Exception as error:  # noqa: BLE001 - a library with a part in C: any error means that it cannot be used here
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        return f"rclpy cannot be imported by Python {version}: {error!r:.200}"
    return None


def share_folders() -> list[Path]:
    """Return the folders with packages of ROS 2: those of the environment, then the one beside rclpy."""
    folders = [Path(one) / "share" for one in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if one]
    spec = importlib.util.find_spec("rclpy")
    if spec is not None and spec.origin is not None:
        folders += [at / "share" for at in Path(spec.origin).parents if (at / "share" / "rclpy").is_dir()][:1]
    return [folder for folder in dict.fromkeys(folders) if folder.is_dir()]


class InstalledTypes:
    """Classes of types for rclpy.

    A class is imported only if its definition is installed, because other programs name types, too.

    Attributes:
        texts: definitions of all installed types, by package, kind and name.
    """

    def __init__(self, texts: Mapping[tuple[str, str, str], str]) -> None:
        self.texts = texts
        self._classes: dict[str, _Class] = {}

    def has(self, name: str) -> bool:
        """Return whether a type is installed."""
        try:
            self.find(name)
        except GraphError:
            return False
        return True

    def find(self, name: str) -> _Class:
        """Return the class of a type.

        Args:
            name: `pkg/msg/Type`, `pkg/srv/Type` or `pkg/action/Type`.

        Raises:
            GraphError: it is not installed.
        """
        known = self._classes.get(name)
        if known is not None:
            return known
        package, kind, short = name.split("/")
        if (package, kind, short) not in self.texts:
            raise GraphError(f"{name} is not installed for ROS 2; build its package, and source its setup.bash")
        try:
            found = getattr(importlib.import_module(f"{package}.{kind}"), short)
            type(found).__import_type_support__()
        except Exception as error:  # noqa: BLE001 - generated code with a part in C
            raise GraphError(f"{name} cannot be used by rclpy: {error!r:.200}") from None
        self._classes[name] = found
        return found


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


# The node


class RclpyNode:
    """Our node; see `FarNode` and `FarCalls`.

    Attributes:
        gateway, services: get what comes; set before the first turn of the loop.
        inbox: takes the work for the loop.
        library: the node of rclpy, for the actions.
        types: the installed types.
        on_actions: gets the actions of nodes, if services or actions there have changed: name -> type, node.
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

        self.gateway: Taker | None = None
        self.services: NodeServices[CdrServiceType] | None = None
        self.inbox = Inbox(loop)
        self.types = types
        self.on_actions: Callable[[dict[str, tuple[str, str]]], None] = lambda _found: None
        self._namespace = choices.namespace
        self._loop = loop
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
        self._writers: dict[str, _Class] = {}
        self._readers: dict[str, _Class] = {}
        self._wanted: dict[str, tuple[_Class, Quality]] = {}  # readers
        self._foreign: dict[str, int] = {}  # topic -> number of publishers of other programs
        self._echoes: dict[str, deque[tuple[int, int, int]]] = {}
        self._offered: dict[str, tuple[CdrServiceType, _Class]] = {}
        self._clients: dict[str, _Class] = {}
        self._calls: dict[Call, tuple[_Class, _Class]] = {}
        self._num_sent: Counter[_Class] = Counter()  # requests without an answer yet, by client of rclpy
        self._is_sweeping = False
        self._log = OnceLog(_log.name)
        self.is_stopped = False
        self._view = _GraphView(self.library, choices.namespace)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.library)
        sys.setswitchinterval(min(sys.getswitchinterval(), SWITCH_INTERVAL))
        self._thread = threading.Thread(target=self._spin, name="rclpy", daemon=True)

    @property
    def full_name(self) -> str:
        """Full name of the node on the graph."""
        return f"{self._namespace}/{NODE_NAME}"

    def hide(self, program: bytes) -> None:
        """Take no notice of the endpoints of a program.

        Args:
            program: first 12 bytes of their identities.
        """
        self._view.own.add(program)

    def start(self) -> None:
        """Let messages come from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Leave the domain. A second call does nothing."""
        if self.is_stopped:
            return
        self.is_stopped = True
        self.inbox.stop()
        self._executor.wake()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)  # `stop` of a server takes two seconds at most
        with suppress(Exception):  # the library may be in the midst of something; the process ends anyway
            self._executor.shutdown(timeout_sec=0.1)
            self.library.destroy_node()
            self._context.try_shutdown()

    def _spin(self) -> None:
        next_look = 0.0
        while not self.is_stopped:
            try:
                self._executor.spin_once(timeout_sec=PERIOD)
                if time.monotonic() >= next_look:
                    start = time.monotonic()
                    self._look()
                    now = time.monotonic()
                    next_look = now + max(PERIOD, LOOK_SHARE * (now - start))
            except Exception as error:  # noqa: BLE001 - a library, and what it calls: one error must not end all
                if self.is_stopped or not self._context.ok():
                    return
                _log.error("internal error of rclpy", exc_info=error)
                time.sleep(PERIOD)

    # As a `FarNode`

    def serve(self, gateway: Taker) -> None:
        """Give messages and endpoints to a gateway."""
        self.gateway = gateway

    def open_writer(self, topic: str, cdr_type: CdrType, quality: Quality, *, is_sole: bool) -> None:
        """See `FarNode`. rclpy cannot tell other programs that a writer is the sole one."""
        found = self.types.find(cdr_type.name)
        del is_sole
        with self.errors():
            self._writers[topic] = self.library.create_publisher(
                found, self.far(topic), _profile(quality), event_callbacks=_no_events(is_writer=True)
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
            self._destroy(self.library.destroy_publisher, writer)
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
        reader = self._readers.get(topic)
        if reader is not None and not is_needed:
            self._destroy(self.library.destroy_subscription, self._readers.pop(topic))
        elif reader is None and is_needed and wanted is not None:
            found, quality = wanted
            with self.errors():
                self._readers[topic] = self.library.create_subscription(
                    found,
                    self.far(topic),
                    partial(_hand_message, self, topic),
                    _profile(quality),
                    event_callbacks=_no_events(is_writer=False),
                    raw=True,
                )

    def hand(self, topic: str, raw: bytes, stamp_ns: int) -> None:
        """Hand a message to the loop (for the thread that spins)."""
        self.inbox.put(lambda: self._receive(topic, raw, stamp_ns), len(raw))

    def _receive(self, topic: str, raw: bytes, stamp_ns: int) -> None:
        """Give a message to the gateway, unless it is our own."""
        echoes = self._echoes.get(topic)
        if echoes and any(start <= stamp_ns <= end and hash(raw) == key for start, end, key in echoes):
            return
        if self.gateway is not None and topic in self._readers:
            self.gateway.receive(topic, raw, self._loop.time())

    # The graph

    def _look(self) -> None:
        """Compare the graph with what it was, and hand the changes to the loop (in the thread that spins)."""
        found, lost = self._view.look_at_topics()
        services, actions = self._view.look_at_services()
        if found or lost or services is not None:
            self.inbox.put(lambda: self._note(found, lost, services, actions))

    def _note(
        self,
        found: list[Endpoint],
        lost: list[Endpoint],
        services: list[FarService] | None,
        actions: dict[str, tuple[str, str]],
    ) -> None:
        """Take changes of the graph."""
        for one, step in [(one, 1) for one in found] + [(one, -1) for one in lost]:
            if one.is_writer:
                self._foreign[one.topic] = self._foreign.get(one.topic, 0) + step
        for topic in {one.topic for one in (*found, *lost) if one.is_writer}:
            if not self._foreign[topic]:
                del self._foreign[topic]
            with suppress(GraphError):
                self._match_reader(topic)
        if self.gateway is not None and (found or lost):
            self.gateway.note_endpoints(found, [one.key for one in lost], self._loop.time())
        if services is not None and self.services is not None:
            self.services.set_foreign(services)
            names = {one.name for one in services}
            for name in [name for name in self._clients if name not in names]:
                self._destroy(self.library.destroy_client, self._clients.pop(name))
            self.on_actions(actions)

    # Services of nodes; see `FarCalls`

    def call(self, name: str, service: CdrServiceType, request: bytes, call: Call, on_reply: OnReply) -> None:
        """See `FarCalls`."""
        found = self.types.find(service.name)
        with self.errors():
            client = self._client(name, found)
            message = self.read_cdr(request, found.Request)
        self._calls[call] = client, None
        if not self._is_sweeping:
            self._is_sweeping = True
            self._loop.call_later(SWEEP_PERIOD, self._forget_ended_calls)
        self._send(client, message, call, on_reply, self._loop.time() + QUEUE_PATIENCE)

    def _client(self, name: str, found: _Class) -> _Class:
        if name not in self._clients:
            self._clients[name] = self.library.create_client(found, self.far(name), qos_profile=_profile(CALLS))
        return self._clients[name]

    def _send(self, client: _Class, message: _Class, call: Call, on_reply: OnReply, hurry_at: float) -> None:
        """Send a request as soon as the provider is found and has room: it would be lost before.

        Args:
            hurry_at: when it is sent though others wait for their answers [s].
        """
        if call.is_done or self.is_stopped:
            self._calls.pop(call, None)
            return
        try:
            has_room = self._num_sent[client] < MAX_SENT or self._loop.time() >= hurry_at
            if not (has_room and client.service_is_ready()):
                self._loop.call_later(READY_PERIOD, self._send, client, message, call, on_reply, hurry_at)
                return
            future = client.call_async(message)
        except Exception as error:  # noqa: BLE001 - of the library; its client has gone with the service, for example
            self._calls.pop(call, None)
            on_reply(False, f"the service cannot be called: {error!r:.200}".encode())  # noqa: FBT003 - see `OnReply`
            return
        self._calls[call] = client, future
        self._num_sent[client] += 1
        future.add_done_callback(partial(self._hand_reply, call, on_reply))

    def _hand_reply(self, call: Call, on_reply: OnReply, future: _Class) -> None:
        """Hand an answer to the loop (in the thread that spins)."""
        if future.cancelled():
            return
        error = future.exception()
        body = f"{error!r:.300}".encode() if error is not None else self.write_cdr(future.result())

        def reply() -> None:
            if call in self._calls:
                self._forget_call(call)
            on_reply(error is None, body)

        self.inbox.put(reply, len(body))

    def _forget_ended_calls(self) -> None:
        """Forget calls that have ended without an answer of their provider, such as by a time-out."""
        for call in [call for call in self._calls if call.is_done]:
            self._forget_call(call)
        self._is_sweeping = bool(self._calls) and not self.is_stopped
        if self._is_sweeping:
            self._loop.call_later(SWEEP_PERIOD, self._forget_ended_calls)

    def _forget_call(self, call: Call) -> None:
        client, future = self._calls.pop(call)
        if future is not None:
            self._num_sent[client] -= 1
            if not self._num_sent[client]:
                del self._num_sent[client]
            if not future.done():
                client.remove_pending_request(future)

    # Services of the bus

    def offer(self, wanted: Mapping[str, CdrServiceType]) -> bool:
        """Offer services to nodes, a few in one turn, and end others.

        Returns:
            True if there is more to do.
        """
        for name in [name for name, (service, _) in self._offered.items() if wanted.get(name) != service]:
            self._destroy(self.library.destroy_service, self._offered.pop(name)[1])
        missing: dict[str, list[str]] = {}
        num_made = 0
        for name, service in wanted.items():
            if name in self._offered:
                continue
            try:
                found = self.types.find(service.name)
            except GraphError:
                missing.setdefault(service.name.partition("/")[0], []).append(name)
                continue
            num_made += 1
            if num_made > SERVICES_PER_TURN:
                return True
            self._offered[name] = service, self._provide(name, found)
        for package, names in missing.items():
            self._log.tell(
                f"{len(names)} services are not offered to nodes, such as {names[0]}: {package} is not installed for"
                " ROS 2; build it, and source its setup.bash",
                logging.INFO,
            )
        return False

    def _provide(self, name: str, found: _Class) -> _Class:
        """Offer a service. Its answer comes later, from the loop, so the header of each request is kept until then."""
        request: list[_Class] = []

        def take(given: _Class, response: _Class) -> _Class:
            request[:] = [given]
            return response

        with self.errors():
            service = self.library.create_service(found, self.far(name), take, qos_profile=_profile(CALLS))
        send, pacer = service.send_response, Pacer(self._loop.call_later)

        def answer(response: _Class, header: _Class) -> None:
            pacer.do(lambda: name in self._offered and send(response, header))

        service.send_response = lambda _response, header: self._hand_request(name, found, request.pop(), header, answer)
        return service

    def _hand_request(
        self, name: str, found: _Class, request: _Class, header: _Class, answer: Callable[[_Class, _Class], None]
    ) -> None:
        """Hand a request to the loop (in the thread that spins)."""

        def on_reply(is_ok: bool, body: bytes) -> None:  # noqa: FBT001 - see `OnReply`
            if is_ok:
                answer(self.read_cdr(body, found.Response), header)
                return
            refusal = refusal_of(found.Response(), why := body.decode(errors="replace"))
            if refusal is not None:
                answer(refusal, header)
            else:
                self._log.tell(f"service {name}: a node that called it gets no answer, because the call failed: {why}")

        def run() -> None:
            if self.services is not None and name in self._offered:
                self.services.call("", name, raw, on_reply, self._loop.time())

        raw = self.write_cdr(request)
        self.inbox.put(run, len(raw))

    # Small parts

    def far(self, name: str) -> str:
        """Return the name on the graph of a name on the bus."""
        return self._namespace + name

    def run(self, work: Callable[[], object]) -> None:
        """Have a function called in the thread that spins."""
        if not self.is_stopped:
            self._executor.create_task(work)

    def _destroy(self, destroy: Callable[[_Class], object], one: _Class) -> None:
        """End something in the thread that spins, which may be waiting for it now."""
        self.run(lambda: destroy(one))

    def write_cdr(self, message: _Class) -> bytes:
        """Return a message of rclpy in CDR."""
        from rclpy.serialization import serialize_message  # noqa: PLC0415 - see above

        return bytes(serialize_message(message))

    def read_cdr(self, raw: bytes, found: _Class) -> _Class:
        """Return the message of a class of rclpy whose CDR is given."""
        from rclpy.serialization import deserialize_message  # noqa: PLC0415 - see above

        return deserialize_message(raw, found)

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Turn errors of the library into those of the graph."""
        try:
            yield
        except GraphError:
            raise
        except Exception as error:  # noqa: BLE001 - of the library
            raise GraphError(f"rclpy refuses it: {error!r:.200}") from None


class Pacer:
    """Work that is done at once, but only a few pieces in each period.

    A node keeps 10 answers that it has not taken yet, and loses the others; then it waits for ever.
    """

    def __init__(self, call_later: Callable[[float, Callable[[], None]], object]) -> None:
        self._call_later = call_later
        self._waiting: deque[Callable[[], object]] = deque()
        self._num_done: int | None = None  # in this period; None if there is none

    def do(self, work: Callable[[], object]) -> None:
        """Do something now, or when there is room for it."""
        self._waiting.append(work)
        if self._num_done is None:
            self._begin()
        else:
            self._go_on()

    def _begin(self) -> None:
        self._num_done = 0 if self._waiting else None
        if self._num_done is not None:
            self._call_later(ANSWER_PERIOD, self._begin)
            self._go_on()

    def _go_on(self) -> None:
        while self._waiting and self._num_done is not None and self._num_done < ANSWERS_PER_PERIOD:
            self._num_done += 1
            self._waiting.popleft()()


def _hand_message(node: RclpyNode, topic: str, raw: bytes, info: Mapping[str, int]) -> None:
    node.hand(topic, raw, info["source_timestamp"])


def refusal_of(response: _Class, why: str) -> _Class | None:
    """Return the response for a call that failed: `success` is false, and `message` says why; None if it lacks these.

    ROS 2 has no way to fail a call.

    Args:
        response: a response with default values.
    """
    if getattr(response, "success", None) is not False:
        return None
    for name in ("message", "status_message", "reason", "error_message"):
        if getattr(response, name, None) == "":
            setattr(response, name, why)
            break
    return response


def _no_events(*, is_writer: bool) -> _Class:
    """Return the choice to be told of no events, of which rclpy would wait for several with each endpoint."""
    from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks  # noqa: PLC0415 - see above

    return (PublisherEventCallbacks if is_writer else SubscriptionEventCallbacks)(use_default_callbacks=False)


def _profile(quality: Quality) -> _Class:
    """Return a quality as rclpy has it."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: PLC0415 - see above

    return QoSProfile(
        depth=max(1, quality.depth),
        reliability=ReliabilityPolicy.RELIABLE if quality.is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if quality.is_latched else DurabilityPolicy.VOLATILE,
    )


class _GraphView:
    """The graph as the thread that spins has seen it last.

    Attributes:
        own: first 12 bytes of the identities of endpoints that are no other program's.
    """

    def __init__(self, library: _Class, namespace: str) -> None:
        self._library = library
        self._namespace = namespace
        self.own = {self._own_program()}
        self._shapes: dict[str, tuple[int, int, tuple[str, ...]]] = {}
        self._endpoints: dict[str, dict[str, Endpoint]] = {}  # topic on the graph -> key -> endpoint
        self._next: deque[str] = deque()
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
        for far, kinds in library.get_topic_names_and_types():
            if far.startswith(self._namespace) and HIDDEN not in far and len(shapes) < MAX_FOUND:
                shapes[far] = library.count_publishers(far), library.count_subscribers(far), tuple(kinds)
        changed = {far for far, shape in shapes.items() if self._shapes.get(far) != shape}
        changed |= self._shapes.keys() - shapes.keys()
        for _ in range(min(TOPICS_PER_LOOK, len(shapes))):
            if not self._next:
                self._next.extend(shapes)
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

    def look_at_services(self) -> tuple[list[FarService] | None, dict[str, tuple[str, str]]]:
        """Return the services of other nodes, None if they are the same as before; and actions: name -> type, node."""
        library = self._library
        nodes = library.get_node_names_and_namespaces()
        services = library.get_service_names_and_types()
        state = sorted(nodes), services
        if state == self._services:
            return None, {}
        found: list[FarService] = []
        actions: dict[str, tuple[str, str]] = {}
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
                if not far.startswith(self._namespace) or not is_name(name) or len(found) >= MAX_FOUND:
                    continue
                package, _, short = kinds[0].replace("/srv/", "/").replace("/action/", "/").partition("/")
                if HIDDEN not in name:
                    found.append(FarService(name, f"{package}/{short}"[:300], full))
                elif name.endswith(_SEND_GOAL):
                    actions[name.removesuffix(_SEND_GOAL)] = f"{package}/{short.removesuffix('_SendGoal')}"[:300], full
        self._services = state
        return found, actions


_SEND_GOAL: Final = f"{HIDDEN}send_goal"


def _endpoint(name: str, info: _Class, gid: bytes, *, is_writer: bool) -> Endpoint:
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
