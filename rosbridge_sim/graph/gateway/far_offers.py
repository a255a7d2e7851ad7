"""Services and actions that nodes of a graph offer on the bus: their common part."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Generic, TypeVar

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import HIDDEN, Action
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarGraph, FarService
from rosbridge_sim.graph.gateway.sentences import OnceLog, name_some
from rosbridge_sim.graph.participant import OfferKind, Participant
from rosbridge_sim.graph.policy import Guest, Policy, is_allowed
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.topics_services import Service

Offer = TypeVar("Offer")
"""The type of a service or an action, as nodes know it."""


class FarOffers(Guest, ABC, Generic[Offer]):
    """Services or actions of nodes, as a participant of the bus that offers them.

    Attributes:
        name: stands for the name of a node in rosapi's lists.
        address: stands for the address of a client, in the log.
        foreign: services or actions of nodes that are on the bus now, by name.
    """

    kind: OfferKind
    op: str
    """Op of the bus by which a node uses one of ours, for the account of refusals."""

    most: int
    """Most of them in each direction."""

    missing: Reason
    """The reason for one that does not exist."""

    def __init__(
        self,
        graph: FarGraph,
        bus: Bus,
        find: Callable[[str], Offer],
        policy: Policy,
        *,
        known: Mapping[str, Service | Action],
        check_use: Callable[[str], None],
        is_offered: Callable[[str, Participant], bool],
    ) -> None:
        """Offer nothing yet.

        Args:
            graph: the kind of graph.
            bus: our bus.
            find: returns the type of a name as nodes there know it; see `Gateway`.
            policy: rights of all clients.
            known: those on the bus, by name.
            check_use: raises GraphError if nodes must not use one of a name.
            is_offered: returns whether nodes may use one of an owner, for which the policy lets them.
        """
        self.name, self.address = graph.name, graph.title
        self.foreign: dict[str, FarService] = {}
        self._graph = graph
        self._bus = bus
        self.policy = policy
        self._find_type = find
        self._known = known
        self._check_use = check_use
        self._is_offered = is_offered
        self._log = OnceLog(graph.logger)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus."""
        self._log.notify(level, text)

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Participant`: another participant provides it from now on."""
        self.foreign.pop(name, None)
        self._log.tell(f"{kind} {name}: {why}")

    def leave(self, now: float) -> None:
        """End all of them. A second call does nothing."""
        self._bus.leave(self, now)
        self.foreign.clear()

    def set_foreign(self, found: Iterable[FarService]) -> None:
        """Offer on the bus what nodes provide, and end what they provide no more, which fails what waits for it.

        Args:
            found: all services, or all actions, of nodes.
        """
        wanted = {one.name: one for one in found if self._passes(one.name)}
        for name in [name for name, one in self.foreign.items() if wanted.get(name) != one]:
            del self.foreign[name]
            self._withdraw(name)
        failed: dict[str, list[str]] = {}
        for name, one in wanted.items():
            if name in self.foreign or len(self.foreign) >= self.most:
                continue
            try:
                self.policy.check_offer(name)
                found_type = self._find_type(one.type_name)
                self._check_free(name)
                self._provide(one, found_type)
            except PeerError as error:
                failed.setdefault(str(error), []).append(name)
                continue
            self.foreign[name] = one
        for why, names in failed.items():
            text = f"{self.kind} {name_some(names)} of {self.address} cannot be used: {why}"
            self._log.tell(text, logging.INFO)

    def _passes(self, name: str) -> bool:
        """Return whether a name may pass in either direction."""
        is_own = name.startswith(self._graph.own_folders)
        return not is_own and HIDDEN not in name and self._graph.is_name(name)

    def offered(self) -> dict[str, Offer]:
        """Return those of the bus that nodes may use, by name, with their types."""
        found: dict[str, Offer] = {}
        for name, one in self._known.items():
            if not self._may_offer(name, one.owner):
                continue
            if len(found) >= self.most:
                self._log.tell(f"more than {self.most:,} {self.kind}s on the bus: the others do not pass")
                break
            try:
                found[name] = self._find_type(one.type.name)
            except PeerError as error:
                self._log.tell(f"{self.kind} {name} does not pass: {error}", logging.INFO)
        return found

    def _may_offer(self, name: str, owner: Participant) -> bool:
        is_foreign = owner is not self and self._passes(name)
        return is_foreign and is_allowed(self._check_use, name) and self._is_offered(name, owner)

    def find(self, name: str) -> Offer:
        """Return the type of one of the bus.

        Raises:
            PeerError: there is none, or nodes must not use it.
        """
        one = self._known.get(name)
        if one is None or one.owner is self:
            raise GraphError(f"{self.kind} {name} does not exist here", reason=self.missing)
        self._check_use(name)
        if not self._may_offer(name, one.owner):
            raise GraphError(f"{self.kind} {name} is not offered to nodes", reason=Reason.NOT_ALLOWED)
        return self._find_type(one.type.name)

    @abstractmethod
    def _provide(self, one: FarService, found: Offer) -> None:
        """Offer one on the bus.

        Raises:
            PeerError: it has another definition there.
        """

    @abstractmethod
    def _withdraw(self, name: str) -> None:
        """End the offer of one on the bus."""

    def _check_free(self, name: str) -> None:
        """Raise GraphError if another participant offers one of the same name."""
        known = self._known.get(name)
        if known is not None and known.owner is not self:
            who = "a client of this server" if known.owner.is_guest else known.owner.name
            article = "an" if self.kind == "action" else "a"
            raise GraphError(f"{who} provides {article} {self.kind} of this name", reason=Reason.NAME_TAKEN)

    def _refuse(self, name: str, reason: Reason | None, text: str, node: str = "") -> None:
        """Note that a node may not use one of ours, or did it wrongly."""
        who = f"{self.address} node {node}" if node else self.address
        refusal = RefusedRequest(who, reason or Reason.REFUSED, self.op, name, text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)
