"""Totals of the data that clients have sent and received; the totals of clients that have left are kept.

Each client counts on its own objects, which are deleted with it. A counter of the whole server must not go down when a
client leaves, so its counts are added to a total at that moment.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from rosbridge_sim.shell.websocket.connected_client import Client


@dataclass(slots=True)
class ClientTotals:
    """Totals of some clients.

    Attributes:
        num_clients: number of clients.
        num_bytes_sent: bytes of messages given to their transports.
        num_frames_received: frames received from them.
        num_messages_sent: topic messages put into their outboxes.
        num_messages_dropped: topic messages of these that were dropped because the client did not read.
    """

    num_clients: int = 0
    num_bytes_sent: int = 0
    num_frames_received: int = 0
    num_messages_sent: int = 0
    num_messages_dropped: int = 0

    def add(self, client: Client) -> None:
        """Add the counts of a client."""
        session = client.peer.session
        self.num_clients += 1
        self.num_bytes_sent += client.num_bytes_sent
        self.num_frames_received += session.num_received
        self.num_messages_sent += session.num_sent
        self.num_messages_dropped += sum(client.outbox.dropped.values())

    def plus(self, clients: Iterable[Client]) -> ClientTotals:
        """Return the totals with those of more clients."""
        total = replace(self)
        for client in clients:
            total.add(client)
        return total
