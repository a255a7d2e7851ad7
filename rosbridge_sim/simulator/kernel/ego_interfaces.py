"""Topics and services of further egos; they are added and removed together with an ego."""

from __future__ import annotations

import logging
from typing import Final

from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego, ego_prefix
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts

MAX_GONE: Final = 1_000
"""Largest number of remembered services of removed egos, because a client may add egos under ever new numbers."""

_log = logging.getLogger("rosbridge_sim.morai")


class EgoInterfaces:
    """Topics and services of all egos except the first one, whose names never go away."""

    def __init__(self, parts: SimulatorParts) -> None:
        """Start without further egos."""
        self._interfaces, self._publishers, self._hooks = parts.interfaces, parts.publishers, parts.hooks
        self._bindings: dict[int, SubscribersServices] = {}  # by the egos' numbers
        self._gone: dict[str, int] = {}  # services of egos that have left, and the egos' numbers

    def bind(self, ego: Ego) -> None:
        """Add the topics and services of a further ego.

        Raises:
            GraphError: a client has given one of the topics another type. `drop` removes what was added.
        """
        bindings = self._bindings[ego.index] = SubscribersServices(self._interfaces, ego_prefix(ego.index))
        for give in self._hooks.on_new_ego:
            give(ego, bindings)
        # last, because `why_gone` must explain a missing service until all of them are back
        self._gone = {name: index for name, index in self._gone.items() if index != ego.index}
        _log.info("ego %d added: %s...", ego.index, bindings.prefix)

    def drop(self, ego: Ego, now: float) -> None:
        """Remove the topics and services of a further ego."""
        bindings = self._bindings.pop(ego.index)
        for name in bindings.services:
            self._gone.pop(name, None)
            self._gone[name] = ego.index
        while len(self._gone) > MAX_GONE:
            del self._gone[next(iter(self._gone))]
        bindings.release(now)
        self._publishers.remove(bindings.prefix, now)
        _log.info("ego %d removed: %s...", ego.index, bindings.prefix)

    def why_gone(self, service: str) -> str:
        """Return the reason why a service of a removed ego is missing.

        Returns:
            A text for the client; empty for any other name.
        """
        index = self._gone.get(service)
        return "" if index is None else f"ego {index} has left"
