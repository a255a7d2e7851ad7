"""The topics and services of further egos: they come with an ego, and go with it."""

from __future__ import annotations

import logging
from typing import Final

from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.hooks import Hooks
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.registry import InterfaceRegistry
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices

__all__ = ["EgoInterfaces"]

MAX_GONE: Final = 1_000
"""Services of egos that have left which are remembered: a client may bring egos under ever new numbers."""

_log = logging.getLogger("rosbridge_sim.morai")


class EgoInterfaces:
    """The names of the egos behind the first one, whose names stay for good."""

    def __init__(self, interfaces: InterfaceRegistry, publishers: Publishers, hooks: Hooks) -> None:
        """No further ego yet.

        Args:
            interfaces: take the services and input topics.
            publishers: have the output topics.
            hooks: `on_new_ego` says what an ego has.
        """
        self._interfaces = interfaces
        self._publishers = publishers
        self._hooks = hooks
        self._bindings: dict[int, SubscribersServices] = {}  # by the egos' numbers
        self._gone: dict[str, int] = {}  # services of egos that have left, and the egos' numbers

    @property
    def num_remembered(self) -> int:
        """How many services of egos that have left `why_gone` knows."""
        return len(self._gone)

    def bind(self, ego: Ego) -> None:
        """Give a further ego its names.

        Raises:
            GraphError: a client has given one of the topics another type; `drop` takes back what was given.
        """
        bindings = self._bindings[ego.index] = SubscribersServices(self._interfaces, f"/Ego-{ego.index}/")
        for give in self._hooks.on_new_ego:
            give(ego, bindings)
        # only now: until all its services are back, none of them is to be taken for gone for good
        self._gone = {name: index for name, index in self._gone.items() if index != ego.index}
        _log.info("ego %d has come: %s...", ego.index, bindings.prefix)

    def drop(self, ego: Ego, now: float) -> None:
        """Take a further ego's names away."""
        bindings = self._bindings.pop(ego.index)
        for name in bindings.services:
            self._gone.pop(name, None)
            self._gone[name] = ego.index
        while len(self._gone) > MAX_GONE:
            del self._gone[next(iter(self._gone))]
        bindings.release(now)
        self._publishers.remove(bindings.prefix, now)
        _log.info("ego %d is gone: %s...", ego.index, bindings.prefix)

    def why_gone(self, service: str) -> str:
        """Return why a service of an ego that may come back is not there; an empty text for any other name."""
        index = self._gone.get(service)
        return "" if index is None else f"ego {index} has left"
