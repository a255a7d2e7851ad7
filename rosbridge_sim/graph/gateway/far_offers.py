"""Services and actions that nodes of a graph offer on the bus: their common part."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Iterable

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import HIDDEN
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarGraph, FarService
from rosbridge_sim.graph.gateway.sentences import OnceLog, name_some
from rosbridge_sim.graph.participant import OfferKind, Participant, is_guest
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.refusals import RefusedRequest


class FarOffers(ABC):
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

    def __init__(self, graph: FarGraph, bus: Bus, policy: Policy) -> None:
        self.name, self.address = graph.name, graph.title
        self.foreign: dict[str, FarService] = {}
        self._graph = graph
        self._bus = bus
        self._policy = policy
        self._log = OnceLog(graph.logger)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus."""
        self._log.notify(level, text)

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Guest`: another participant provides it from now on."""
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
                self._policy.check_offer(name)
                self._provide(one)
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

    @abstractmethod
    def _provide(self, one: FarService) -> None:
        """Offer one on the bus.

        Raises:
            PeerError: its type is not known here, or the bus has one of this name.
        """

    @abstractmethod
    def _withdraw(self, name: str) -> None:
        """End the offer of one on the bus."""

    def _check_free(self, owner: Participant | None) -> None:
        """Check who offers one of the same name.

        Raises:
            GraphError: another participant does.
        """
        if owner is not None and owner is not self:
            who = "a client of this server" if is_guest(owner) else owner.name
            article = "an" if self.kind == "action" else "a"
            raise GraphError(f"{who} provides {article} {self.kind} of this name", reason=Reason.NAME_TAKEN)

    def _refuse(self, name: str, reason: Reason | None, text: str, node: str = "") -> None:
        """Note that a node may not use one of ours, or did it wrongly."""
        who = f"{self.address} node {node}" if node else self.address
        refusal = RefusedRequest(who, reason or Reason.REFUSED, self.op, name, text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)
