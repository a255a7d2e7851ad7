"""What a part of the simulator has on the bus, so that it can be taken away again as a whole.

The world's own services and input topics stay as long as the simulator; those of a further ego come and go with it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.graph.bus import Bus, Handle, Owner, Subscription, Topic
from rosbridge_sim.schema.store import Message

__all__ = ["Bindings", "Take"]

Take = Callable[[Any, Owner, float], None]
"""`(message's struct, sender, now)`; a PeerError that it raises is told to the sender."""


class Bindings:
    """Services and input topics of `morai_msgs` types under one prefix.

    Attributes:
        prefix: `/` for the world and the first ego.
    """

    def __init__(self, owner: Owner, bus: Bus, prefix: str = "/") -> None:
        self.prefix = prefix
        self._owner = owner
        self._bus = bus
        self._services: list[str] = []
        self._subscriptions: list[Subscription] = []

    def provide(self, name: str, type_name: str, handle: Handle) -> None:
        """Offer a service, here alone.

        Raises:
            TypeNameError: there is no such type.
        """
        service = self._bus.provide(self._owner, self.prefix + name, _full(type_name), handle, is_exclusive=True)
        self._services.append(service.name)

    def listen(self, name: str, type_name: str, take: Take) -> None:
        """Take what is published on a topic.

        Raises:
            GraphError: somebody has given the topic another type.
            TypeNameError: there is no such type.
        """

        def deliver(_topic: Topic, message: Message, sender: Owner, now: float) -> None:
            take(message.value, sender, now)

        subscription = self._bus.subscribe(self._owner, self.prefix + name, deliver, type_name=_full(type_name))
        self._subscriptions.append(subscription)

    def has_type(self, type_name: str, *, is_service: bool = False) -> bool:
        """Whether the release in use has this type."""
        find = self._bus.store.service if is_service else self._bus.store.message
        try:
            find(_full(type_name))
        except TypeNameError:
            return False
        return True

    def release(self, now: float) -> None:
        """Take it all away; whoever waits for an answer is told."""
        for name in self._services:
            self._bus.withdraw(self._owner, name)
        for subscription in self._subscriptions:
            self._bus.unsubscribe(subscription, now)
        self._services.clear()
        self._subscriptions.clear()


def _full(type_name: str) -> str:
    return type_name if "/" in type_name else "morai_msgs/" + type_name
