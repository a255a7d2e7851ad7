"""The memory of all clients together: above the budget, the client that holds most is closed first.

Each client has its own limits, but a thousand clients at their limits would need more than any machine has. So the
memory of all of them is added up twice a second. Bytes that several clients wait for are stored once, so they are
counted once before any client is closed.
"""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Protocol

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.shell.websocket.connections import ServedConnection, address_of

BUDGET_PERIOD = 0.5
"""Time between two checks [s]: a server receives about 100 MB in this time."""

LEAST_BUDGET = 64 * 2**20
"""Smallest default [bytes]; a smaller one would close clients for one image on its way."""

_log = logging.getLogger("rosbridge_sim.server")


class Holder(Protocol):
    """A client for which the server holds memory."""

    @property
    def name(self) -> str:
        """Name of the client, for people."""

    @property
    def num_bytes_held(self) -> int:
        """Memory that the server holds for it [bytes]; shared bytes count in full."""

    def shared(self) -> Iterator[tuple[int, int]]:
        """Yield identity and size [bytes] of everything that it may share with others."""

    def evict(self, reason: str) -> None:
        """Close it, and release everything that it holds.

        Args:
            reason: text for the close frame.
        """


class HttpReader:
    """A connection that is no client (yet), as a `Holder`: the rest of an HTTP answer waits in its socket."""

    def __init__(self, socket: ServedConnection) -> None:
        self._socket = socket

    @property
    def name(self) -> str:
        """Address of the other side."""
        return address_of(self._socket)

    @property
    def num_bytes_held(self) -> int:
        """Bytes that wait in its socket, and bytes that were not read yet."""
        return self._socket.num_bytes_unsent + self._socket.num_bytes_held

    def shared(self) -> Iterator[tuple[int, int]]:
        """Yield nothing: each socket has its own copy of an answer."""
        return iter(())

    def evict(self, reason: str) -> None:
        """Cut the connection: HTTP has no close frame for the reason.

        Args:
            reason: text for the log.
        """
        _log.debug("%s is cut off: %s", self.name, reason)
        self._socket.transport.abort()


class MemoryBudget:
    """Checks the memory of all clients, and closes the largest ones while it is too much."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        bus: Bus,
        clients: Callable[[], Iterable[Holder]],
        budget: int | None,
        on_look: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Start the checks; `stop` ends them.

        Args:
            bus: the bus; its owners' accounts are part of the memory.
            clients: returns the connected clients, and other connections that may hold much.
            budget: largest memory of all of them [bytes]; None means no limit.
            on_look: called at each check with the memory of all of them [bytes].
        """
        self._loop = loop
        self._bus = bus
        self._clients = clients
        self._budget = budget
        self._on_look = on_look
        self._timer = loop.call_later(BUDGET_PERIOD, self._tick)

    def stop(self) -> None:
        """Stop the checks."""
        self._timer.cancel()

    def _tick(self) -> None:
        self._timer = self._loop.call_later(BUDGET_PERIOD, self._tick)
        self.look()

    def look(self) -> None:
        """Close clients, the largest first, until the rest is within the budget."""
        holders = [(client.num_bytes_held, client) for client in self._clients()]
        left = self._leftovers(holders)
        held = sum(size for size, _ in holders) + left
        self._on_look(held)
        if self._budget is None or held <= self._budget:
            return
        held -= _num_shared(client for _, client in holders)
        if held > self._budget:
            self._bus.topic_table.forget_orphans()
            held -= left - self._leftovers(holders)
        for size, client in sorted(holders, key=lambda holder: holder[0], reverse=True):
            if held <= self._budget:
                return
            text = f"all clients together hold {_mb(held)}, more than --memory-budget {_mb(self._budget)}"
            _log.warning("%s is closed: it holds %s; %s", client.name, _mb(size), text, extra={"client": client.name})
            client.evict(f"{text}; this one held most: {_mb(size)}")
            held -= size

    def _leftovers(self, holders: list[tuple[int, Holder]]) -> int:
        """Return the memory held for clients that are gone, such as latched messages [bytes]."""
        accounts = sum(account.num_bytes for account in self._bus.accounts.values())
        return max(0, self._bus.total.num_bytes - accounts) if holders or accounts else self._bus.total.num_bytes


def _num_shared(clients: Iterable[Holder]) -> int:
    """Return the number of bytes that were counted more than once."""
    seen: set[int] = set()
    num_shared = 0
    for client in clients:
        for identity, size in client.shared():
            if identity in seen:
                num_shared += size
            seen.add(identity)
    return num_shared


def _mb(num_bytes: int) -> str:
    return f"{num_bytes / 2**20:,.0f} MiB"


def default_budget() -> int:
    """Return half of the memory that this process may use [bytes]: of the machine, or of a smaller container."""
    limits = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")] if hasattr(os, "sysconf") else [2**32]
    for path in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):  # cgroups v2, v1
        try:
            text = Path(path).read_text(encoding="ascii").strip()
        except OSError:
            continue
        if text.isdigit():  # otherwise it is "max"
            limits.append(int(text))
    return max(LEAST_BUDGET, min(limits) // 2)
