"""Registrations of our node with the master: publishers, subscribers, services, and changes of parameters."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros1.master_parameters import MasterParameters
from rosbridge_sim.graph.ros1.master_view import Registration
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Choices
from rosbridge_sim.shell.ros1.xmlrpc_http import UnreachableError


class Registrations:
    """The registrations of our node.

    Attributes:
        known: what the master has from us, with the type of a topic.
        stale: what of it is registered once more, for the publishers of a topic in the answer.
        has_parameters: the master tells us of changes of parameters.
        uri: address of our own server.
        service_uri: address of our services.
        on_publishers: called with a topic's name there, and the addresses of its publishers.
        is_ending: nothing is registered any more.
    """

    uri: str
    service_uri: str
    on_publishers: Callable[[str, object], None]

    def __init__(self, choices: Ros1Choices, parameters: MasterParameters, log: OnceLog) -> None:
        """Register nothing yet; the addresses are set before the first registration."""
        self.known: dict[Registration, str] = {}
        self.stale: set[Registration] = set()
        self.has_parameters = self.is_ending = False
        self._choices = choices
        self._parameters = parameters
        self._log = log
        self._refused: set[Registration] = set()

    async def update(self, wanted: Mapping[Registration, str]) -> None:
        """Register what is wanted, end what is not wanted any more, and send changes of parameters.

        Args:
            wanted: registration -> type of a topic.

        Raises:
            UnreachableError: the master cannot be reached.
        """
        for one, type_name in list(self.known.items()):
            if wanted.get(one) != type_name and not self.is_ending:
                await self.end(one)
        for one, type_name in wanted.items():
            is_due = one in self.stale or one not in self.known
            if is_due and one not in self._refused and not self.is_ending:
                self.stale.discard(one)
                await self._register(one, type_name)
        await self._send_parameters()

    async def _register(self, one: Registration, type_name: str) -> None:
        self.known[one] = type_name  # before the answer: the end of this node must not lose it
        what = self.service_uri if one.kind == "Service" else type_name
        try:
            found = await self._choices.ask(f"register{one.kind}", one.name, what, self.uri)
        except asyncio.CancelledError:
            if not self.is_ending:  # the time for the next look has come, and the master has perhaps not heard of it
                self.known.pop(one, None)
            raise
        except GraphError as error:
            self.known.pop(one, None)
            if isinstance(error, UnreachableError):
                raise
            self._refused.add(one)
            self._log.tell(f"the master does not take {one.name}: {error}")
        else:
            if one.kind == "Subscriber":
                self.on_publishers(one.name, found)

    async def end(self, one: Registration) -> None:
        """End a registration.

        Raises:
            UnreachableError: the master cannot be reached.
        """
        try:
            await self._choices.ask(
                f"unregister{one.kind}", one.name, self.service_uri if one.kind == "Service" else self.uri
            )
        except UnreachableError:
            raise
        except GraphError:
            pass  # the master does not know it
        self.known.pop(one, None)  # not before: the end of this node must not lose it
        self.stale.discard(one)

    async def end_all(self) -> None:
        """End all registrations at once, as far as the master can be reached."""
        await asyncio.gather(*map(self.end, list(self.known)), return_exceptions=True)
        if self.has_parameters:
            self.has_parameters = False
            with suppress(GraphError):
                await self._choices.ask("unsubscribeParam", self.uri, "/")

    async def take_parameters(self) -> object:
        """Take all parameters of a master that does not tell us of them yet, and return them; None if it does.

        Raises:
            GraphError: the master cannot be reached.
        """
        if self.has_parameters:
            return None
        tree = await self._choices.ask("subscribeParam", self.uri, "/")
        self.has_parameters = True
        self._parameters.begin(tree)
        return tree

    async def _send_parameters(self) -> None:
        unsent = self._parameters.unsent
        while unsent and self.has_parameters:
            name = next(iter(unsent))
            value = unsent[name]
            with suppress(GraphError):  # deleted there already
                await (
                    self._choices.ask("deleteParam", name)
                    if value is None
                    else self._choices.ask("setParam", name, value)
                )
            if unsent.get(name) == value:
                unsent.pop(name, None)
