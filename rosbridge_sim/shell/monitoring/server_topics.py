"""Topics about the server itself: its clients, their unread messages, and its log.

    /client_count        number of connected clients; latched, at each change
    /connected_clients   their addresses and times of connection; latched, at each change
    /sim/clients         traffic and unread bytes of each client; once a second while it has a subscriber
    /sim/topics          all topics with rate, size, publishers and subscribers; once a second while it has a subscriber
    /sim/refusals        the last mistakes of clients, with reasons; latched, at changes, at most ten times a second
    /rosout              log lines of this process from level info on; clients may publish there, too

The first two are rosbridge_suite's. The server publishes as the node `/rosbridge_websocket`, like its clients.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from itertools import takewhile

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.peers.peer_base import WEBSOCKET_NODE_NAME
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.graph.ways import PolicyEffect, Use, Way
from rosbridge_sim.loose_types import JsonValue, Struct
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.monitoring.log_page import LogPage
from rosbridge_sim.shell.monitoring.refusal_log import RefusalLog, escape
from rosbridge_sim.shell.monitoring.topic_report import TopicReport
from rosbridge_sim.shell.websocket.connected_client import Client
from rosbridge_sim.shell.websocket.server import Server

TOPICS = ("/client_count", "/connected_clients", "/sim/clients", "/rosout", "/sim/refusals", "/sim/topics")
"""Names of all these topics."""

WHO_IS_CONNECTED = PolicyEffect(
    "learn who is connected", tuple(Way(Use.SUBSCRIBE, name) for name in TOPICS), (Way(Use.SUBSCRIBE, "/sim/drivers"),)
)
"""The other topics that show the same, if clients may not subscribe to one of these."""

REPORT_PERIOD = 1.0
"""Time between two messages on /sim/clients [s]."""

REFUSALS_INTERVAL = 0.1
"""Shortest time between two messages on /sim/refusals [s]: making a full one takes half a millisecond."""

_LOG_TYPES = {1: "rosgraph_msgs/Log", 2: "rcl_interfaces/Log"}
"""Type of `/rosout` in each ROS generation; Lichtblick detects the generation by it."""

_LEVELS = {
    1: ((logging.CRITICAL, 16), (logging.ERROR, 8), (logging.WARNING, 4), (logging.INFO, 2)),
    2: ((logging.CRITICAL, 50), (logging.ERROR, 40), (logging.WARNING, 30), (logging.INFO, 20)),
}
"""Python's log levels and their numbers in each of the two types, most severe first."""


class ServerTopics(Participant):
    """The topics on which a server reports about itself."""

    name = WEBSOCKET_NODE_NAME

    def __init__(
        self,
        bus: Bus,
        server: Server,
        loop: asyncio.AbstractEventLoop,
        refusals: RefusalLog | None = None,
        policy: Policy = OPEN,
        *,
        ages: Callable[[float], Mapping[str, float]] | None = None,
    ) -> None:
        """Advertise the topics and follow the server's clients and this process's log, until `stop`.

        Args:
            refusals: the refused requests of clients; None creates a new list.
            policy: the rights of clients; `/sim/topics` tells only what it allows.
            ages: returns how old topic messages are at each remote bridge [s], by its URL; takes monotonic time [s].
        """
        self.bus = bus
        self._server = server
        self._loop = loop
        self._ages = ages
        count, connected, clients, log, refused, topics = TOPICS
        log_topic = bus.advertise(self, log, _LOG_TYPES[bus.store.ros])
        self._count = self._advertise(count, "std_msgs/Int32", depth=1)
        self._connected = self._advertise(connected, "rosbridge_msgs/ConnectedClients", depth=1)
        self._clients = self._advertise(clients, "rosbridge_sim_msgs/Clients")
        self._topics = self._advertise(topics, "rosbridge_sim_msgs/Topics")
        self._topic_report = TopicReport(bus, policy)
        self._log = _LogTopic(self, log_topic, loop)
        logging.getLogger("rosbridge_sim").addHandler(self._log)
        self._refused = self._advertise(refused, "rosbridge_sim_msgs/Refusals", depth=1)
        self._refusals = RefusalLog(loop) if refusals is None else refusals
        self._refusals.on_change = self._tell_refusals_soon
        log_page = self._log_page = LogPage(self._refusals)
        server.pages.render_log = lambda has_warnings: log_page.render(has_warnings=has_warnings)
        self._refusals_at = float("-inf")  # time of the last message on /sim/refusals [s]
        self._refusals_timer: asyncio.TimerHandle | None = None
        bus.on_refusal = self._refusals.note
        self._entries: dict[Client, Struct] = {}
        self._soon: asyncio.Handle | None = None
        server.on_clients = self.tell_clients_soon
        self._timer = loop.call_later(REPORT_PERIOD, self._tick)
        self._tell_clients()
        self._tell_refusals()

    def stop(self) -> None:
        """Stop all messages."""
        self._timer.cancel()
        self._topic_report.stop()
        if self._refusals_timer is not None:
            self._refusals_timer.cancel()
        self._refusals.on_change = lambda: None
        self._refusals.stop()
        self._log_page.stop()
        if self._soon is not None:
            self._soon.cancel()
        logging.getLogger("rosbridge_sim").removeHandler(self._log)

    def publish(self, topic: Topic, **fields: JsonValue) -> None:
        """Publish a message."""
        self.bus.announce(self, topic, Message(topic.type, topic.type.struct_type(**fields)), self._loop.time())

    def tell_clients_soon(self) -> None:
        """Publish the clients in the next turn of the loop, once for all changes in this one."""
        if self._soon is None:
            self._soon = self._loop.call_soon(self._tell_clients)

    def _tell_clients(self) -> None:
        self._soon = None
        store = self.bus.store
        known = self._entries
        new = list(takewhile(lambda client: client not in known, reversed(self._server.clients)))
        for client in reversed(new):
            make = store.message("rosbridge_msgs/ConnectedClient").struct_type
            known[client] = make(ip_address=client.host, connection_time=store.time_value(client.connected_ns))
        if len(known) > len(self._server.clients):  # some have left
            self._entries = {client: known[client] for client in self._server.clients}
        self.publish(self._count, data=len(self._entries))
        self.publish(self._connected, clients=list(self._entries.values()))

    def _tell_refusals_soon(self) -> None:
        """Publish the refusals at the end of this turn, or later if the last message is too recent."""
        if self._refusals_timer is None:
            due = max(self._refusals_at + REFUSALS_INTERVAL, self._loop.time())
            self._refusals_timer = self._loop.call_at(due, self._tell_refusals)

    def _tell_refusals(self) -> None:
        self._refusals_timer = None
        self._refusals_at = self._loop.time()
        store = self.bus.store
        make = store.message("rosbridge_sim_msgs/Refusal").struct_type
        refusals = [
            make(stamp=store.time_value(noted.stamp_ns), **noted.fields(escape)) for noted in self._refusals.kept()
        ]
        self.publish(self._refused, header=self.stamp(), total=self._refusals.total, refusals=refusals)

    def stamp(self) -> Struct:
        """Return a header with the time of day, because these topics are about the process, not about the world."""
        store = self.bus.store
        return store.message("std_msgs/Header").struct_type(stamp=store.time_value(time.time_ns()))

    def _advertise(self, name: str, type_name: str, *, depth: int = 0) -> Topic:
        return self.bus.advertise(self, name, type_name, depth=depth, is_exclusive=True)

    def _tick(self) -> None:
        self._timer = self._loop.call_later(REPORT_PERIOD, self._tick)
        if self._clients.has_listener:
            self.bus.guard.attempt("the report on clients", self._tell_statuses)
        if self._topics.has_listener:
            self.bus.guard.attempt("the report on topics", self._tell_topics)
        else:
            self._topic_report.stop()

    def _tell_topics(self) -> None:
        fields = self._topic_report.take([client.outbox for client in self._server.clients], self._loop.time())
        self.publish(self._topics, header=self.stamp(), **fields)

    def _tell_statuses(self) -> None:
        statuses = []
        for client in tuple(self._server.clients):
            if client.has_failed:  # already counted and logged; its closing may take a second
                continue
            try:
                statuses.append(self._status(client))
            except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
                self.bus.guard.blame(client.peer, error)
        make = self.bus.store.message("rosbridge_sim_msgs/BridgeStatus").struct_type
        ages = {} if self._ages is None else self._ages(self._loop.time())
        bridges = [make(url=url, age=age) for url, age in ages.items()]
        self.publish(self._clients, header=self.stamp(), clients=statuses, bridges=bridges)

    def _status(self, client: Client) -> Struct:
        store = self.bus.store
        session, outbox = client.peer.session, client.outbox
        dropped = sorted((topic, count) for topic, count in outbox.dropped.items() if count)
        return store.message("rosbridge_sim_msgs/ClientStatus").struct_type(
            address=client.peer.address,
            connection_time=store.time_value(client.connected_ns),
            frames_received=session.num_received,
            frames_refused=session.num_refused + client.peer.num_errors,
            messages_sent=session.num_sent,
            bytes_sent=client.num_bytes_sent,
            bytes_held=client.num_bytes_held,
            bytes_waiting=client.num_bytes_waiting,
            dropped_topics=[topic for topic, _ in dropped],
            dropped_counts=[count for _, count in dropped],
        )


class _LogTopic(logging.Handler):
    """Sends log records to `/rosout`."""

    def __init__(self, reports: ServerTopics, topic: Topic, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__(logging.INFO)
        self._ros = reports.bus.store.ros
        self._reports = reports
        self._topic = topic
        self._loop = loop
        self._is_sending = False

    def emit(self, record: logging.LogRecord) -> None:
        # skip lines logged by this very call, to avoid a loop, and lines of other threads, which must not use the bus
        if self._is_sending or not self._topic.has_listener or not self._is_here():
            return
        self._is_sending = True
        try:
            # ROS 1 has a header and a list of topics, ROS 2 a bare stamp
            own = {"header": self._reports.stamp()} if self._ros == 1 else {"stamp": self._reports.stamp().stamp}
            self._reports.publish(
                self._topic,
                **own,
                level=next((number for level, number in _LEVELS[self._ros] if record.levelno >= level), 1),
                name="/" + record.name.replace(".", "/"),
                msg=record.getMessage(),
                file=record.filename,
                function=record.funcName or "",
                line=record.lineno,
            )
        except Exception as error:  # noqa: BLE001 - the caller only logs something and must not fail
            self._reports.bus.guard.note("/rosout", error)
        finally:
            self._is_sending = False

    def _is_here(self) -> bool:
        try:
            return asyncio.get_running_loop() is self._loop
        except RuntimeError:
            return False
