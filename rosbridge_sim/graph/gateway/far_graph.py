"""A graph of ROS nodes as the gateway sees it: endpoints, our node there, and all nodes as one participant of a bus."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.policy import Guest, Policy
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import Record
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType


class FarGraph(Record):
    """A kind of graph.

    Attributes:
        title: name in texts, such as `ROS 2`.
        name: stands for the name of a node in rosapi's lists.
        logger: name of its log.
        own_topics: topics that nodes there and this server each have for themselves.
        own_folders: prefixes of such topics, and of services.
        is_name: returns True if a topic may have a name there.
        type_of: returns `pkg/Type` for the name of a type there; None if it is no message.
        spell_type: returns the name of a type there for the name of a `FarType`.
        one_too_many: advice if another program publishes the same topic.
        endpoints_per_turn: writers and readers that one turn opens, by the time that the library takes for a new one.
        keeps_latched: our node keeps latched messages for late subscribers, so it gets them before there is one.
    """

    title: str
    name: str
    logger: str
    own_topics: frozenset[str]
    own_folders: tuple[str, ...]
    is_name: Callable[[str], bool]
    type_of: Callable[[str], str | None]
    spell_type: Callable[[str], str]
    one_too_many: str
    endpoints_per_turn: int
    keeps_latched: bool


class FarType(Protocol):
    """A message type as nodes there know it.

    Attributes:
        name: its name there.
        type: the type in the store of the bus.
        has_same_bytes: the bytes of the bus for `cbor-raw` are those of the graph.
    """

    name: str
    type: MessageType
    has_same_bytes: bool

    def encode(self, message: Message) -> bytes:
        """Return the bytes of a message, made once for all who want them.

        Raises:
            EncodingError: it cannot be written, because of an internal error.
        """

    def decode(self, raw: bytes, stamp_ns: int) -> Struct:
        """Return the checked value of a message.

        Args:
            raw: its bytes.
            stamp_ns: the present time, for a header without a stamp [ns].

        Raises:
            FieldError: the bytes are not a message of the type, or are too many.
        """


Type = TypeVar("Type", bound=FarType)
Given_contra = TypeVar("Given_contra", bound=FarType, contravariant=True)


class FarServiceType(Record):
    """A service type as nodes there know it.

    Attributes:
        name: its name there.
        request, response: its two messages.
        hash: identifies its definition there, such as the md5 sum; empty if nodes do not compare definitions.
    """

    name: str
    request: FarType
    response: FarType
    hash: str = ""


class FarService(Record):
    """A service of another program on the graph.

    Attributes:
        name: its name on our bus.
        type_name: `pkg/Type`.
        node: name of its node; empty if that is not known.
        hash: see `FarServiceType`; empty if the node tells none.
    """

    name: str
    type_name: str
    node: str = ""
    hash: str = ""


OnReply = Callable[[bool, bytes], None]
"""`(is_ok, body)`: the response in the bytes of the graph, or the reason as text."""


FarCall = Callable[[str, FarServiceType, bytes, Call, OnReply], None]
"""`(name, service, request, call, on_reply)`: call a service that a node provides, by its name on the bus, with a
request in the bytes of the graph. `on_reply` is called once, later, unless the call on the bus ends before."""


class Endpoint(Record):
    """A publisher or subscription of another program on the graph.

    Attributes:
        key: tells endpoints apart.
        topic: name of the topic on our bus.
        type_name: name of its type there.
        is_writer: it publishes.
        quality: what it offers or asks for.
        node: name of its node; empty if the node has not told its name.
        is_named: false if its node may still tell its name; then the endpoint will be noted again.
        program: GUID of its program, as `guid_text` writes it; empty where there are none.
    """

    key: str
    topic: str
    type_name: str
    is_writer: bool
    quality: Quality
    node: str
    is_named: bool = True
    program: str = ""


class FarNode(Protocol[Given_contra]):
    """Our node on the graph. Names of topics are those of our bus."""

    def open_writer(self, topic: str, far_type: Given_contra, quality: Quality, *, is_sole: bool) -> None:
        """Publish on a topic; other nodes see it from now on.

        Args:
            is_sole: its user data tells other nodes that it must be the only publisher of its topic.

        Raises:
            GraphError: the library refuses it.
        """

    def open_reader(self, topic: str, far_type: Given_contra, quality: Quality) -> None:
        """Subscribe to a topic. Its messages go to the gateway.

        Args:
            quality: what is asked for.

        Raises:
            GraphError: the library refuses it.
        """

    def close_writer(self, topic: str) -> None:
        """Stop to publish on a topic."""

    def close_reader(self, topic: str) -> None:
        """Stop to subscribe to a topic."""

    def write(self, topic: str, raw: bytes) -> bool:
        """Send a message on a topic that has a writer. It never waits for a slow subscriber.

        Args:
            raw: the message in the bytes of the graph.

        Returns:
            False if it was dropped, because too much waits for a slow subscriber already.
        """


Found = TypeVar("Found")
"""The type of a message, a service or an action, as nodes know it."""


class FarNodes(Guest, Generic[Found]):
    """All nodes of a graph, as a participant of the bus.

    Attributes:
        name: stands for the name of a node in rosapi's lists.
        address: stands for the address of a client, in the log.
        op: op of the bus that nodes do, for the account of refusals.
    """

    op: str

    def __init__(self, graph: FarGraph, bus: Bus, find: Callable[[str], Found], policy: Policy) -> None:
        """Hold nothing yet.

        Args:
            graph: the kind of graph.
            bus: our bus.
            find: returns the type of a name (`pkg/Type` in any spelling) as nodes there know it; raises PeerError if
                there is none, or nodes cannot exchange it.
            policy: rights of all clients.
        """
        self.name, self.address = graph.name, graph.title
        self.policy = policy
        self._graph = graph
        self._bus = bus
        self._find_type = find
        self._log = OnceLog(graph.logger)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus."""
        self._log.notify(level, text)

    def _report(self, name: str, reason: Reason | None, text: str, node: str = "") -> None:
        """Report a mistake of a node, as one of a client."""
        who = f"{self.address} node {node}" if node else self.address
        refusal = RefusedRequest(who, reason or Reason.REFUSED, self.op, name, text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)
