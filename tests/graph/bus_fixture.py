"""A bus with real types and clients without sockets, for the tests of this room."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from rosbridge_sim.doctor.check_frames import read_frame
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.protocol.outbox import BinaryFrame, Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.store import Store

__all__ = ["MemoryClients", "Wire", "make_bus", "make_peer", "make_store"]

SCHEMAS = Path(__file__).parents[2] / "schemas"


@cache
def make_store(ros: Generation = 1) -> Store:
    """All types of `schemas/`, one release of morai_msgs; made once, for nothing changes it."""
    texts = {}
    for path in sorted(p for p in SCHEMAS.glob("*/**/*") if p.suffix in {".msg", ".srv", ".action"}):
        package, *release, kind, _ = path.relative_to(SCHEMAS).parts
        if release in ([], ["22.R2"]):
            texts[package, kind, path.stem] = path.read_text()
    return Store(texts, ros=ros)


def make_bus() -> Bus:
    """A bus of its own."""
    return Bus(make_store())


def make_peer(bus: Bus) -> tuple[Peer, Outbox]:
    """A client whose socket never takes anything: all frames stay in its outbox."""
    outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
    return Peer(bus, Session(outbox, lambda _due: None)), outbox


class Wire:
    """A client in memory that sends ops and reads what comes back."""

    def __init__(self, bus: Bus, policy: Policy = OPEN) -> None:
        self.outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
        self.peer = Peer(bus, Session(self.outbox, lambda _due: None), policy=policy)

    def says(self, **op: object) -> list[dict[str, Any]]:
        """What comes back."""
        self.peer.receive(json.dumps(op).encode(), 0.0)
        return self.hears()

    def hears(self) -> list[dict[str, Any]]:
        return [json.loads(frame) for frame in self.outbox.take(2**40)]

    def calls(self, service: str, /, **args: object) -> dict[str, Any]:
        (answer,) = self.says(op="call_service", service=service, args=args, id="c")
        assert (answer["op"], answer["id"]) == ("service_response", "c")
        return answer

    def learns(self, method: str, /, **args: object) -> JsonValue:
        answer = self.calls(f"/rosapi/{method}", **args)
        assert answer["result"] is True, answer
        return answer["values"]


class MemoryClients:
    """Named clients on one bus, for the vectors."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._clients: dict[str, tuple[Peer, Outbox]] = {}

    def _client(self, name: str) -> tuple[Peer, Outbox]:
        if name not in self._clients:
            self._clients[name] = make_peer(self._bus)
        return self._clients[name]

    async def send(self, name: str, frame: str | bytes) -> None:
        self._client(name)[0].receive(frame if isinstance(frame, bytes) else frame.encode(), 0.0)

    async def received(self, name: str) -> list[Any]:
        frames = self._client(name)[1].take(2**40)
        return [read_frame(frame if isinstance(frame, BinaryFrame) else frame.decode()) for frame in frames]

    async def close(self, name: str) -> None:
        self._client(name)[0].leave(0.0)

    def leave_all(self) -> None:
        for peer, _ in self._clients.values():
            peer.leave(0.0)
