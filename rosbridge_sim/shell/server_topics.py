"""Topics about the server itself: its clients, what they leave unread, and its log.

    /client_count        how many clients are connected; latched, at each change
    /connected_clients   their addresses and times of connection; latched, at each change
    /sim/clients         what each has sent, was given and leaves unread; once a second while it has a subscriber
    /sim/refusals        the last mistakes of clients, with reasons; latched, at changes, at most ten times a second
    /rosout              the log lines of this process, from level info on; clients may write there too

The first two are rosbridge_suite's. The server is the node `/rosbridge_websocket` here, as its clients are.
"""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Literal

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peer_base import WEBSOCKET_NODE_NAME
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.graph.ways import PolicyEffect, Use, Way
from rosbridge_sim.loose_types import JsonValue, Struct
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.refusals import RefusalLog, escape
from rosbridge_sim.shell.websocket.client import Client
from rosbridge_sim.shell.websocket.server import Server

__all__ = ["TOPICS", "WHO_IS_CONNECTED", "ServerTopics"]

TOPICS = ("/client_count", "/connected_clients", "/sim/clients", "/rosout", "/sim/refusals")
"""The names of all of these."""

WHO_IS_CONNECTED = PolicyEffect("learn who is connected", tuple(Way(Use.SUBSCRIBE, name) for name in TOPICS))
"""Other topics that stay open if clients may not listen to one of these."""

REPORT_PERIOD = 1.0
"""Between two messages on /sim/clients [s]."""

REFUSALS_PERIOD = 0.1
"""Shortest time between two messages on /sim/refusals [s]: a full one takes half a millisecond to make."""

MAX_COUNT = 2**32 - 1
"""Greatest number of refusals in a row that its field holds."""

_LOG_TYPES = {1: "rosgraph_msgs/Log", 2: "rcl_interfaces/Log"}
"""The type of `/rosout` in each ROS generation; Lichtblick tells the two apart by it."""

_LEVELS = {
    1: ((logging.CRITICAL, 16), (logging.ERROR, 8), (logging.WARNING, 4), (logging.INFO, 2)),
    2: ((logging.CRITICAL, 50), (logging.ERROR, 40), (logging.WARNING, 30), (logging.INFO, 20)),
}
"""Our levels, from the gravest on, as each of the two counts them."""


class ServerTopics:
    """The topics on which a server speaks of itself.

    Attributes:
        bus: where they are.
    """

    name = WEBSOCKET_NODE_NAME

    def __init__(
        self, bus: Bus, server: Server, loop: asyncio.AbstractEventLoop, refusals: RefusalLog | None = None
    ) -> None:
        """Advertise the topics and follow the server's clients and this process's log, until `stop`.

        Args:
            bus: where the topics are.
            server: has the clients that are reported.
            loop: has the timers.
            refusals: what clients were refused; None for a log of its own.
        """
        self.bus = bus
        self._server = server
        self._loop = loop
        count, connected, clients, log, refused = TOPICS
        self._count = self._advertise(count, "std_msgs/Int32", depth=1, is_exclusive=True)
        self._connected = self._advertise(connected, "rosbridge_msgs/ConnectedClients", depth=1, is_exclusive=True)
        self._clients = self._advertise(clients, "rosbridge_sim_msgs/Clients", is_exclusive=True)
        self._log = _LogTopic(self, self._advertise(log, _LOG_TYPES[bus.store.ros]), bus.store.ros, loop)
        logging.getLogger("rosbridge_sim").addHandler(self._log)
        self._refused = self._advertise(refused, "rosbridge_sim_msgs/Refusals", depth=1, is_exclusive=True)
        self._refusals = RefusalLog(loop) if refusals is None else refusals
        self._refusals.on_change = self._tell_refusals_soon
        self._refusals_at = float("-inf")  # when they were told last [s]
        self._refusals_timer: asyncio.TimerHandle | None = None
        bus.on_refusal = self._refusals.note
        self._entries: dict[Client, Struct] = {}
        self._soon: asyncio.Handle | None = None
        server.on_clients = self.tell_clients_soon
        self._timer = loop.call_later(REPORT_PERIOD, self._tick)
        self._tell_clients()
        self._tell_refusals()

    def stop(self) -> None:
        """Say nothing more."""
        self._timer.cancel()
        if self._refusals_timer is not None:
            self._refusals_timer.cancel()
        self._refusals.on_change = lambda: None
        self._refusals.stop()
        if self._soon is not None:
            self._soon.cancel()
        logging.getLogger("rosbridge_sim").removeHandler(self._log)

    def notify(self, level: str, text: str) -> None:
        """Ignore a message of the bus: this participant asks for nothing."""

    def publish(self, topic: Topic, **fields: JsonValue) -> None:
        """Send a message made from its fields."""
        self.bus.announce(self, topic, Message(topic.type, self._struct(topic)(**fields)), self._loop.time())

    def tell_clients_soon(self) -> None:
        """Publish the clients in the next turn of the loop: once, however many come and go in this one."""
        if self._soon is None:
            self._soon = self._loop.call_soon(self._tell_clients)

    def _tell_clients(self) -> None:
        self._soon = None
        store = self.bus.store
        known = self._entries
        for client in self._server.clients:
            if client not in known:
                make = store.message("rosbridge_msgs/ConnectedClient").struct_type
                known[client] = make(ip_address=client.host, connection_time=store.time_value(client.connected_ns))
        self._entries = {client: known[client] for client in self._server.clients}
        self.publish(self._count, data=len(self._entries))
        self.publish(self._connected, clients=list(self._entries.values()))

    def _tell_refusals_soon(self) -> None:
        """Tell what was refused: at the end of this turn, or a while after the last time."""
        if self._refusals_timer is None:
            due = max(self._refusals_at + REFUSALS_PERIOD, self._loop.time())
            self._refusals_timer = self._loop.call_at(due, self._tell_refusals)

    def _tell_refusals(self) -> None:
        self._refusals_timer = None
        self._refusals_at = self._loop.time()
        store = self.bus.store
        make = store.message("rosbridge_sim_msgs/Refusal").struct_type
        refusals = [
            make(
                stamp=store.time_value(noted.stamp_ns),
                frame=noted.frame,
                client=noted.request.client,
                reason=noted.request.reason.value,
                op=noted.request.op,
                subject=escape(noted.request.subject),
                text=escape(noted.request.text),
                count=min(noted.count, MAX_COUNT),
            )
            for noted in self._refusals.kept()
        ]
        self.publish(self._refused, header=self.stamp(), total=self._refusals.total, refusals=refusals)

    def stamp(self) -> Struct:
        """A header with the time of day: these topics are about this process, not about the world in it."""
        store = self.bus.store
        return store.message("std_msgs/Header").struct_type(stamp=store.time_value(time.time_ns()))

    def _advertise(self, name: str, type_name: str, *, depth: int = 0, is_exclusive: bool = False) -> Topic:
        return self.bus.advertise(self, name, type_name, depth=depth, is_exclusive=is_exclusive)

    def _struct(self, topic: Topic) -> type[Struct]:
        struct_type: type[Struct] = self.bus.store.message(topic.type.name).struct_type
        return struct_type

    def _tick(self) -> None:
        self._timer = self._loop.call_later(REPORT_PERIOD, self._tick)
        if self._clients.has_listener:
            self.bus.guard.attempt("the report on clients", self._tell_statuses)

    def _tell_statuses(self) -> None:
        statuses = []
        for client in tuple(self._server.clients):
            if client.has_failed:  # counted and told already; its closing may take a second
                continue
            try:
                statuses.append(self._status(client))
            except Exception as error:  # noqa: BLE001 - a bug of ours in what is that client's alone
                self.bus.guard.blame(client.peer, error)
        self.publish(self._clients, header=self.stamp(), clients=statuses)

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

    def __init__(
        self, reports: ServerTopics, topic: Topic, ros: Literal[1, 2], loop: asyncio.AbstractEventLoop
    ) -> None:
        super().__init__(logging.INFO)
        self._ros = ros
        self._reports = reports
        self._topic = topic
        self._loop = loop
        self._is_sending = False

    def emit(self, record: logging.LogRecord) -> None:
        # what sending itself logs would never come to an end; another thread must not touch the bus
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
