"""Our node on the graph of ROS 2: endpoints by DDS, their announcement, and the messages between threads and the loop.

Threads of the DDS library only report that something waits. The event loop takes it, a few messages in each turn.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.far_graph import Endpoint
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros2.cdr_types import CdrType
from rosbridge_sim.graph.ros2.discovery_info import (
    DISCOVERY_TOPIC,
    Distro,
    discovery_type,
    node_names,
    write_discovery,
)
from rosbridge_sim.graph.ros2.network_check import Discovery
from rosbridge_sim.graph.ros2.ros2_names import dds_topic, guid_text, topic_of
from rosbridge_sim.records import Record, replace
from rosbridge_sim.shell.ros2.dds_library import DdsDomain, DdsEndpoint, DdsReader, DdsTypes, DdsWriter, check_library
from rosbridge_sim.shell.ros2.inbox import BYTES_PER_TURN, LEAST_SIZE

NODE_NAME: Final = "rosbridge_sim"
"""Name of our node."""

NODE_BESIDE: Final = "rosbridge_sim_dds"
"""Name of the node of the DDS library beside one of rclpy."""

SOLE: Final = b"sole=1;"
"""User data of a publisher that must be the only one of its topic, for `ros2 check`. ROS 2 skips keys that it does not
know. Source: rmw/impl/cpp/key_value.hpp."""

ENDPOINTS_PER_TURN: Final = 10
"""Changes of endpoints that one turn of the loop takes, of writers and of readers each: one costs up to 0.7 ms."""

NAMES: Final = Quality(is_latched=True, depth=1_000)
"""Of the subscription to the names of nodes: each program there sends one message, which must not replace another's."""

NAME_PATIENCE: Final = 4.0
"""Longest wait for the name of an endpoint's node [s]: Fast DDS sends a lost message again after 3 s."""

MAX_KEYS: Final = 20_000
"""Most endpoints of other programs whose nodes are remembered by name."""

_log = logging.getLogger("rosbridge_sim.ros2")

_COMMON: Final = "<MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize>"
"""Messages of any size in datagrams that are as large as may be: with the library's own 1.4 kB, most clouds of points
were lost on loopback."""

_INTERNAL: Final = (
    "<Internal><WriterLingerDuration>0 s</WriterLingerDuration>"
    "<Watermarks><WhcHigh>16 MB</WhcHigh></Watermarks><MaxSampleSize>{max_size}B</MaxSampleSize></Internal>"
)
"""No wait for slow subscribers at the end; and more room for them than a large picture takes."""

_CONFIGS: Final = {
    "localhost": (
        '<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>'
        f"<AllowMulticast>false</AllowMulticast>{_COMMON}</General>"
        '<Discovery><Peers><Peer address="127.0.0.1"/></Peers><ParticipantIndex>auto</ParticipantIndex>'
        "<MaxAutoParticipantIndex>40</MaxAutoParticipantIndex></Discovery>"
    ),
    "multicast": f"<General><AllowMulticast>spdp</AllowMulticast>{_COMMON}</General>",
}
"""Configurations of Cyclone DDS. With `localhost` no packet leaves loopback, and none
comes from elsewhere (`loopback.py`)."""


def config_of(discovery: Discovery, max_message_size: int) -> str:
    """Return the configuration of the DDS library.

    Args:
        discovery: where other programs are looked for.
        max_message_size: longest message from the graph [bytes].
    """
    config = _CONFIGS[discovery] + _INTERNAL.format(max_size=max_message_size)
    return f'<CycloneDDS><Domain Id="any">{config}</Domain></CycloneDDS>'


class Ros2Choices(Record):
    """The settings of the node.

    Attributes:
        domain: number of the domain (`ROS_DOMAIN_ID`).
        distro: distribution of the other nodes.
        namespace: stands before all names on the graph; empty, or absolute without a slash at its end.
        discovery: where other programs are looked for.
        max_message_size: longest message from the graph [bytes].
        name: name of the node.
    """

    domain: int
    distro: Distro = "jazzy"
    namespace: str = ""
    discovery: Discovery = "localhost"
    max_message_size: int = 16 * 2**20
    name: str = NODE_NAME


OnMessage = Callable[[str, bytes, float], None]
"""`(topic, raw, now)`: a message has come."""

OnEndpoints = Callable[[Sequence[Endpoint], Sequence[str], float], None]
"""`(found, lost, now)`: endpoints of other programs have come or changed, and those of some keys have gone."""


class Ros2Node:
    """Our node; see `FarNode`.

    Attributes:
        on_message, on_endpoints: get what comes.
        on_work: called after messages.
    """

    def __init__(self, choices: Ros2Choices, loop: asyncio.AbstractEventLoop) -> None:
        """Join the domain, and tell others of the node.

        Args:
            choices: see above.
            loop: takes what comes.

        Raises:
            DocumentError: the library is missing or refuses the domain.
        """
        check_library()
        self.on_message: OnMessage = lambda _topic, _raw, _now: None
        self.on_endpoints: OnEndpoints = lambda _found, _lost, _now: None
        self.on_work: Callable[[], None] = lambda: None
        self._choices = choices
        self._loop = loop
        config = config_of(choices.discovery, choices.max_message_size)
        is_local = choices.discovery == "localhost"
        self._domain = DdsDomain(choices.domain, config, b"enclave=/;", is_local=is_local)
        self._types = DdsTypes()
        self._writers: dict[str, DdsWriter] = {}
        self._readers: dict[str, DdsReader] = {}
        self._report_data: dict[str, Callable[[], None]] = {}  # of each topic with a reader
        self._waiting: set[str] = set()
        self._is_stopped = False
        self._nodes: dict[bytes, str] = {}
        self._unnamed: dict[bytes, Endpoint] = {}  # those whose node has not told its name yet
        self._discovery_type = self._types.make(*discovery_type(choices.distro))
        self._discovery = self._domain.open_writer(
            DISCOVERY_TOPIC, self._discovery_type, Quality(is_latched=True, depth=1), b""
        )
        self._report_names = self._report(self._take_names, DISCOVERY_TOPIC)
        self._others = self._domain.open_reader(DISCOVERY_TOPIC, self._discovery_type, NAMES, b"", self._report_names)
        self._report_endpoints = self._report(self._take_endpoints, "")
        self._endpoints = self._domain.watch(self._report_endpoints)
        self._is_changed = False
        self._announce()

    @property
    def program(self) -> bytes:
        """First 12 bytes of the identity of each endpoint of ours."""
        return self._domain.key[:12]

    def stop(self) -> None:
        """Leave the domain. A second call does nothing."""
        if not self._is_stopped:
            self._is_stopped = True
            self._domain.close()

    # As a `FarNode`

    def open_writer(self, topic: str, cdr_type: CdrType, quality: Quality, *, is_sole: bool) -> None:
        """See `FarNode`."""
        user_data = _user_data(cdr_type) + (SOLE if is_sole else b"")
        self._writers[topic] = self._domain.open_writer(
            dds_topic(topic, self._choices.namespace), self._data_type(cdr_type), quality, user_data
        )
        self._change()

    def open_reader(self, topic: str, cdr_type: CdrType, quality: Quality) -> None:
        """See `FarNode`."""
        report = self._report_data[topic] = self._report(lambda: self._take(topic), topic)
        self._readers[topic] = self._domain.open_reader(
            dds_topic(topic, self._choices.namespace),
            self._data_type(cdr_type),
            quality,
            _user_data(cdr_type),
            report,
        )
        self._change()

    def close_writer(self, topic: str) -> None:
        """See `FarNode`."""
        writer = self._writers.pop(topic, None)
        if writer is not None and not self._is_stopped:
            writer.close()
            self._change()

    def close_reader(self, topic: str) -> None:
        """See `FarNode`."""
        reader = self._readers.pop(topic, None)
        if reader is not None and not self._is_stopped:
            reader.close()
            self._change()

    def write(self, topic: str, raw: bytes) -> bool:
        """See `FarNode`."""
        return not self._is_stopped and self._writers[topic].write(raw)

    def _data_type(self, cdr_type: CdrType) -> type:
        """Return the library's class of a type.

        Raises:
            GraphError: the library cannot have it.
        """
        try:
            made: type = self._types.make(cdr_type.name, cdr_type.definitions)
        except Exception as error:  # noqa: BLE001 - a library that gets definitions of users
            raise GraphError(f"the DDS library cannot have {cdr_type.name}: {error!r:.200}") from None
        return made

    # Announcement of the node

    def _change(self) -> None:
        """Announce the node's endpoints anew, once for all changes of this turn."""
        if not self._is_changed:
            self._is_changed = True
            self._loop.call_soon(self._announce)

    def _announce(self) -> None:
        self._is_changed = False
        if self._is_stopped:
            return
        readers = [reader.key for reader in self._readers.values()]
        writers = [writer.key for writer in self._writers.values()]
        node = self._choices.namespace or "/", self._choices.name
        self._discovery.write(write_discovery(self._choices.distro, self._domain.key, node, readers, writers))

    # From the threads of the library to the loop

    def _report(self, take: Callable[[], None], key: str) -> Callable[[], None]:
        """Return a function for the threads of the library, which calls `take` once in the loop."""

        def run() -> None:
            self._waiting.discard(key)
            if not self._is_stopped:
                take()

        def report() -> None:
            if key not in self._waiting:
                self._waiting.add(key)
                with suppress(RuntimeError):  # the loop is closed
                    self._loop.call_soon_threadsafe(run)

        return report

    def _take(self, topic: str) -> None:
        """Give the waiting messages of a topic to the gateway, as many as a turn allows."""
        reader = self._readers.get(topic)
        size = 0
        while reader is not None:
            raw = reader.take()
            if raw is None:
                break
            if raw:
                self.on_message(topic, raw, self._loop.time())
            size += max(len(raw), LEAST_SIZE)
            if size > BYTES_PER_TURN:
                self._report_data[topic]()
                break
        self.on_work()

    def _take_names(self) -> None:
        """Learn the names of other nodes."""
        for _ in range(ENDPOINTS_PER_TURN):
            raw = self._others.take()
            if raw is None:
                return
            found = node_names(self._choices.distro, raw)
            if len(self._nodes) + len(found) <= MAX_KEYS:
                self._nodes.update(found)
                named = [key for key in found if key in self._unnamed] if self._unnamed else []
                self._note([replace(self._unnamed.pop(key), node=found[key], is_named=True) for key in named], [])
        self._report_names()

    def _take_endpoints(self) -> None:
        """Learn the endpoints of other programs, as many as a turn allows."""
        found: list[Endpoint] = []
        lost: list[str] = []
        self._take_names()
        for take, is_writer in zip(self._endpoints, (True, False), strict=True):
            for _ in range(ENDPOINTS_PER_TURN):
                try:
                    one = take()
                except Exception as error:  # noqa: BLE001 - a library that reads what others have announced
                    _log.info("an endpoint of another program cannot be read: %r", error)
                    continue
                if one is None:
                    break
                if not one.is_alive:
                    lost.append(one.key.hex())
                    self._nodes.pop(one.key, None)
                    self._unnamed.pop(one.key, None)
                elif one.participant != self._domain.key:
                    endpoint = self._endpoint(one, is_writer=is_writer)
                    if endpoint is not None:
                        found.append(endpoint)
                        self._wait_for_name(one.key, endpoint)
            else:
                self._report_endpoints()  # once for both kinds: each turn takes as many as the last one
        self._note(found, lost)

    def _wait_for_name(self, key: bytes, endpoint: Endpoint) -> None:
        if not endpoint.is_named and len(self._unnamed) < MAX_KEYS:
            if not self._unnamed:
                self._loop.call_later(NAME_PATIENCE, self._note_unnamed)
            self._unnamed[key] = endpoint

    def _note_unnamed(self) -> None:
        """Give the gateway the endpoints of programs that have told no name of a node."""
        unnamed, self._unnamed = list(self._unnamed.values()), {}
        self._note([replace(one, is_named=True) for one in unnamed], [])

    def _note(self, found: Sequence[Endpoint], lost: Sequence[str]) -> None:
        if not self._is_stopped and (found or lost):
            self.on_endpoints(found, lost, self._loop.time())

    def _endpoint(self, one: DdsEndpoint, *, is_writer: bool) -> Endpoint | None:
        topic = topic_of(one.topic, self._choices.namespace)
        if topic is None:
            return None
        node = self._nodes.get(one.key)
        program = guid_text(one.participant)
        return Endpoint(
            one.key.hex(), topic, one.type[:300], is_writer, one.quality, node or "", node is not None, program
        )


def _user_data(cdr_type: CdrType) -> bytes:
    return f"typehash={cdr_type.hash};".encode()
