"""State that all parts of a bus share: time, accounts, what each owner holds, and the hooks for who wants to know.

The parts are the topics (`topic_table.py`), the messages on them (`delivery.py`), services (`service_table.py`) and
actions (`actions.py`). They get this state, and `bus.py` ties them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from rosbridge_sim.graph.guard import Guard
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.topics_services import Call, Service, Subscription, Topic
from rosbridge_sim.protocol.account import Account
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store

__all__ = ["BusState", "Holdings"]


@dataclass(slots=True)
class Holdings:
    """Things that one owner has on the bus; dicts for their order, the values mean nothing."""

    published: dict[Topic, None] = field(default_factory=dict)
    subscriptions: dict[Subscription, None] = field(default_factory=dict)
    services: dict[Service, None] = field(default_factory=dict)
    calls: dict[Call, None] = field(default_factory=dict)


class BusState:
    """Shared state of one bus.

    Attributes:
        store: the types.
        time_ns: simulation time where there is a world, else the time of day [ns]; bags and rates count in it.
        stamp_ns: the time for stamps that a message leaves open [ns]: `time_ns`, or the time of day if that is chosen.
        guard: sees to it that a failure of ours hurts as few as possible.
        total: what all owners together make this process hold.
        accounts: those of owners that have a limit, by owner.
        on_leave: called with `(owner, now)` after an owner has left.
        on_topic: called with a topic after an owner has begun to publish or to listen there.
        on_holdings: called with an owner after it has begun or ceased to publish, to listen or to serve somewhere.
        on_refusal: called with each mistake that a client is told of.
        on_message: called with each message before it is delivered; None for nothing. It may not raise.
        num_published: messages since the start.
    """

    def __init__(self, store: Store) -> None:
        self.store = store
        self.time_ns = 0
        self.stamp_ns = 0
        self.guard = Guard()
        self.total = Account()
        self.accounts: dict[Participant, Account] = {}
        self.on_leave: list[Callable[[Participant, float], None]] = []
        self.on_topic: list[Callable[[Topic], None]] = []
        self.on_holdings: list[Callable[[Participant], None]] = []
        self.on_refusal: Callable[[RefusedRequest], None] = lambda _refusal: None
        self.on_message: Callable[[Topic, Message], None] | None = None
        self.num_published = 0
        self._own_account = Account(total=self.total)
        self._holdings: dict[Participant, Holdings] = {}

    def account_of(self, owner: Participant) -> Account:
        """The account that pays for what an owner makes this process hold."""
        return self.accounts.get(owner, self._own_account)

    def owners(self) -> list[Participant]:
        """All who hold anything, in order of arrival."""
        return list(self._holdings)

    def holdings(self, owner: Participant) -> Holdings:
        """Return the things of an owner, to be read and not changed."""
        return self._holdings.get(owner) or Holdings()

    def held_by(self, owner: Participant) -> Holdings:
        """Return the things of an owner, to be changed (for the parts of the bus alone)."""
        held = self._holdings.get(owner)
        if held is None:
            held = self._holdings[owner] = Holdings()
        return held

    def forget_owner(self, owner: Participant) -> None:
        """Forget an owner that holds nothing any longer (for the bus alone)."""
        self._holdings.pop(owner, None)
        self.accounts.pop(owner, None)

    def report_topic(self, topic: Topic) -> None:
        """Call the hooks for a topic that has one publisher or listener more (for the parts of the bus alone)."""
        for hook in tuple(self.on_topic):
            self.guard.attempt(f"a look at {topic.name}", hook, topic)

    def report_holdings(self, owner: Participant) -> None:
        """Call the hooks for an owner whose holdings have changed (for the parts of the bus alone)."""
        for hook in tuple(self.on_holdings):
            self.guard.attempt(f"a look at what {owner.name} holds", hook, owner)
