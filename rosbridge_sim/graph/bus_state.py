"""State that all parts of a bus share: time, memory accounts, the things of each owner, and hooks for observers.

The parts are topics (`topic_table.py`), message delivery (`delivery.py`), services (`service_table.py`) and actions
(`actions.py`). Each gets this state, and `bus.py` connects them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from rosbridge_sim.graph.guard import Guard
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.topics_services import Call, Service, Subscription, Topic
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.schema.store import Store


def earliest(one: float | None, other: float | None) -> float | None:
    """Return the earlier of two times; None stands for never."""
    if one is None or other is None:
        return other if one is None else one
    return min(one, other)


class Agenda:
    """Due times of the parts of a process, so that the scheduler need not ask each part after each op.

    Attributes:
        first: earliest due time that a part has announced [s]. Announcements are never withdrawn, so it may be too
            early: then the scheduler asks the parts once in vain.
        is_touched: an op has changed something since the scheduler asked the other parts. A message from client to
            client changes nothing.
    """

    def __init__(self) -> None:
        self.first = -math.inf
        self.is_touched = True

    def announce(self, due: float | None) -> None:
        """Note that something has to be done at a time [s]; None stands for never."""
        if due is not None and due < self.first:
            self.first = due
            self.is_touched = True


@dataclass(slots=True)
class Holdings:
    """The things of one owner on the bus. Dicts are used as ordered sets; their values have no meaning."""

    published: dict[Topic, None] = field(default_factory=dict)
    subscriptions: dict[Subscription, None] = field(default_factory=dict)
    services: dict[Service, None] = field(default_factory=dict)
    calls: dict[Call, None] = field(default_factory=dict)


class BusState:
    """Shared state of one bus.

    Attributes:
        store: the types.
        time_ns: simulation time if there is a world, else the time of day [ns]; used by bags and rates.
        stamp_ns: time for stamps that a message leaves open [ns]: `time_ns`, or the time of day if that was chosen.
        agenda: due times of the parts.
        guard: limits the effect of internal errors.
        total: memory account of all owners together.
        accounts: accounts of owners with a limit, by owner.
        held: the things of each owner; see `holdings` and `held_by`.
        on_leave: called with `(owner, now)` after an owner has left.
        on_topic: called with a topic after a publisher or subscriber was added.
        on_holdings: called with an owner after a change of its publishers, subscriptions or services.
        on_refusal: called with each mistake that a client is told about.
    """

    def __init__(self, store: Store) -> None:
        self.store = store
        self.time_ns = 0
        self.stamp_ns = 0
        self.agenda = Agenda()
        self.guard = Guard()
        self.total = Account()
        self.accounts: dict[Participant, Account] = {}
        self.on_leave: list[Callable[[Participant, float], None]] = []
        self.on_topic: list[Callable[[Topic], None]] = []
        self.on_holdings: list[Callable[[Participant], None]] = []
        self.on_refusal: Callable[[RefusedRequest], None] = lambda _refusal: None
        self._own_account = Account(total=self.total)
        self.held: dict[Participant, Holdings] = {}

    def account_of(self, owner: Participant) -> Account:
        """Return the account that pays for an owner's memory."""
        return self.accounts.get(owner, self._own_account)

    def owners(self) -> list[Participant]:
        """Return all owners of anything, in order of arrival."""
        return list(self.held)

    def holdings(self, owner: Participant) -> Holdings:
        """Return the things of an owner; read only."""
        return self.held.get(owner) or Holdings()

    def held_by(self, owner: Participant) -> Holdings:
        """Return the things of an owner, to be changed (for the parts of the bus alone)."""
        held = self.held.get(owner)
        if held is None:
            held = self.held[owner] = Holdings()
        return held

    def forget_owner(self, owner: Participant) -> None:
        """Forget an owner that holds nothing any more (for the bus alone)."""
        self.held.pop(owner, None)
        self.accounts.pop(owner, None)

    def report_topic(self, topic: Topic) -> None:
        """Call the hooks for a topic with a new publisher or subscriber (for the parts of the bus alone)."""
        self.agenda.is_touched = True
        for hook in tuple(self.on_topic):
            self.guard.attempt(f"a look at {topic.name}", hook, topic)

    def report_holdings(self, owner: Participant) -> None:
        """Call the hooks for an owner whose things have changed (for the parts of the bus alone)."""
        for hook in tuple(self.on_holdings):
            self.guard.attempt(f"a look at what {owner.name} holds", hook, owner)
