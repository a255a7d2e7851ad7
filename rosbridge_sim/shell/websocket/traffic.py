"""Totals of what clients have sent and were given; those of clients that have left are kept.

Each client counts for itself, on objects that go with it. A counter of the whole server must not go back when a client
leaves, so its counts are added up here at that moment.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rosbridge_sim.shell.websocket.client import Client

__all__ = ["Traffic"]


@dataclass(slots=True)
class Traffic:
    """Totals of some clients.

    Attributes:
        num_clients: how many clients it is of.
        num_bytes_sent: handed to their transports in messages [bytes].
        num_frames_received: frames that came from them.
        num_messages_sent: messages of topics that went into their outboxes.
        num_messages_dropped: of those, the ones that were forgotten because the client did not read.
    """

    num_clients: int = 0
    num_bytes_sent: int = 0
    num_frames_received: int = 0
    num_messages_sent: int = 0
    num_messages_dropped: int = 0

    def add(self, client: Client) -> None:
        """Add what a client has counted so far."""
        session = client.peer.session
        self.num_clients += 1
        self.num_bytes_sent += client.num_bytes_sent
        self.num_frames_received += session.num_received
        self.num_messages_sent += session.num_sent
        self.num_messages_dropped += sum(client.outbox.dropped.values())

    def plus(self, clients: Iterable[Client]) -> Traffic:
        """Return the totals with those of further clients."""
        total = Traffic(
            self.num_clients,
            self.num_bytes_sent,
            self.num_frames_received,
            self.num_messages_sent,
            self.num_messages_dropped,
        )
        for client in clients:
            total.add(client)
        return total
