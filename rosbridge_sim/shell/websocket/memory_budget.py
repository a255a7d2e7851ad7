"""The memory of all clients together: when it passes the budget, the client that holds most loses first.

Each client has bounds of its own; a thousand of them at their bounds would still be more than any machine has. So what
all of them make the server hold is added up twice a second. Bytes that several clients wait for are held once, and are
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

__all__ = ["Holder", "MemoryBudget", "default_budget"]

BUDGET_PERIOD = 0.5
"""Between two looks [s]: a server takes in some 100 MB meanwhile."""

LEAST_BUDGET = 64 * 2**20
"""A smaller default would close clients for one image in flight [bytes]."""

_log = logging.getLogger("rosbridge_sim.server")


class Holder(Protocol):
    """A client that makes the server hold memory."""

    @property
    def name(self) -> str:
        """The client, for people to read."""

    @property
    def num_bytes_held(self) -> int:
        """Memory that the server holds for it, shared bytes in full [bytes]."""

    def shared(self) -> Iterator[tuple[int, int]]:
        """Identity and size of each thing that it may share with others [bytes]."""

    def evict(self, reason: str) -> None:
        """Close it, with that reason, and let go of all it holds."""


class MemoryBudget:
    """Looks at what all clients hold, and closes the largest ones while that is too much.

    Attributes:
        num_evicted: clients closed for it.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, bus: Bus, clients: Callable[[], Iterable[Holder]], budget: int
    ) -> None:
        """Look from now on, until `stop`.

        Args:
            loop: has the timer.
            bus: its owners' accounts are a part of what is held.
            clients: those that are connected.
            budget: the most that all of them may hold [bytes].
        """
        self.num_evicted = 0
        self._loop = loop
        self._bus = bus
        self._clients = clients
        self._budget = budget
        self._timer = loop.call_later(BUDGET_PERIOD, self._tick)

    def stop(self) -> None:
        """Look no more."""
        self._timer.cancel()

    def _tick(self) -> None:
        self._timer = self._loop.call_later(BUDGET_PERIOD, self._tick)
        self.look()

    def look(self) -> None:
        """Close clients, the largest first, until the rest is within the budget."""
        holders = [(client.num_bytes_held, client) for client in self._clients()]
        held = sum(size for size, _ in holders) + self._leftovers(holders)
        if held <= self._budget:
            return
        held -= _num_shared(client for _, client in holders)
        if held > self._budget:
            self._bus.forget_orphans()
        for size, client in sorted(holders, key=lambda holder: holder[0], reverse=True):
            if held <= self._budget:
                return
            self.num_evicted += 1
            text = f"all clients together hold {_mb(held)}, more than --memory-budget {_mb(self._budget)}"
            _log.warning("%s is closed: it holds %s; %s", client.name, _mb(size), text, extra={"client": client.name})
            client.evict(f"{text}; this one held most: {_mb(size)}")
            held -= size

    def _leftovers(self, holders: list[tuple[int, Holder]]) -> int:
        """Memory held for clients that are gone: latched messages, for a while [bytes]."""
        accounts = sum(account.num_bytes for account in self._bus.accounts.values())
        return max(0, self._bus.total.num_bytes - accounts) if holders or accounts else self._bus.total.num_bytes


def _num_shared(clients: Iterable[Holder]) -> int:
    """The bytes that were counted more than once."""
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
    """Half of the memory that this process may use: the machine's, or the container's where that is less [bytes]."""
    limits = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")] if hasattr(os, "sysconf") else [2**32]
    for path in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):  # cgroups v2, v1
        try:
            text = Path(path).read_text(encoding="ascii").strip()
        except OSError:
            continue
        if text.isdigit():  # else it is "max"
            limits.append(int(text))
    return max(LEAST_BUDGET, min(limits) // 2)
