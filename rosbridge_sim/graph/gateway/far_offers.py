"""Services and actions that nodes of a graph offer on the bus: their common part."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import HIDDEN, Action
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarGraph, FarNodes, FarService, Found
from rosbridge_sim.graph.participant import OfferKind, Participant
from rosbridge_sim.graph.policy import Policy, is_allowed
from rosbridge_sim.graph.topics_services import Service
from rosbridge_sim.suggestions import name_some


class FarOffers(FarNodes[Found], ABC):
    """Services or actions of nodes, as a participant of the bus that offers them.

    Attributes:
        foreign: services or actions of nodes that are on the bus now, by name.
        is_offered: returns whether nodes may use one of a name and an owner, for which the policy lets them.
    """

    kind: OfferKind
    most: int
    """Most of them in each direction."""

    missing: Reason
    """The reason for one that does not exist."""

    _known: Mapping[str, Service | Action]
    """Those on the bus, by name."""

    _check_use: Callable[[str], None]
    """Raises GraphError if nodes must not use one of a name."""

    def __init__(self, graph: FarGraph, bus: Bus, find: Callable[[str], Found], policy: Policy) -> None:
        """Offer nothing yet; see `FarNodes`."""
        super().__init__(graph, bus, find, policy)
        self.foreign: dict[str, FarService] = {}
        self.is_offered: Callable[[str, Participant], bool] = lambda _name, _owner: True

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

    def offered(self) -> dict[str, Found]:
        """Return those of the bus that nodes may use, by name, with their types."""
        found: dict[str, Found] = {}
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
        return is_foreign and is_allowed(self._check_use, name) and self.is_offered(name, owner)

    def find(self, name: str) -> Found:
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
    def _provide(self, one: FarService, found: Found) -> None:
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
