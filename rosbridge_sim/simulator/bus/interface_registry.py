"""The simulator's items on the bus, with the names, switches and rates of the network settings.

A component adds an `Interface` under its default name for each topic or service. While the simulator is built the items
are collected; `open` puts them on the bus. Later, items of further egos are added and removed. `change` replaces the
settings while the server runs: items with another name or switch leave the bus and come back, and the other items are
not touched. A call in progress is still answered, because such a call may be the one that changes the settings.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import ClassVar, Final

from rosbridge_sim.errors import DocumentError, GraphError, TypeNameError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.bus.network_settings import (
    DEFAULTS,
    InterfaceChoice,
    InterfaceKind,
    NetworkSettings,
    split_prefix,
)
from rosbridge_sim.suggestions import hint

MAX_MISTAKES: Final = 20
"""Largest number of mistakes in the settings that are reported at the start, one a line: a screen of a terminal."""

_log = logging.getLogger("rosbridge_sim.morai")


class Interface(ABC):
    """One publisher, subscriber or service of the simulator.

    Attributes:
        kind: publisher, subscriber or service.
        default: its default name, without the prefix of a further ego.
        prefix: `/`, or that of a further ego.
        type_name: package and type.
        rate: default publications a second [Hz]; None for an item without a rate.
        name: its name on the bus; None while it is not on the bus.
    """

    kind: ClassVar[InterfaceKind]

    def __init__(self, default: str, prefix: str, type_name: str, rate: float | None = None) -> None:
        self.default = default
        self.prefix = prefix
        self.type_name = type_name
        self.rate = rate
        self.name: str | None = None

    @abstractmethod
    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:
        """Put the item on the bus. Only `InterfaceRegistry` calls this and `release`.

        Args:
            owner: the simulator.

        Raises:
            GraphError: the name cannot be used.
        """

    @abstractmethod
    def release(self, owner: Participant, bus: Bus, now: float, *, is_gone: bool) -> None:
        """Remove the item from the bus.

        Args:
            owner: the simulator.
            is_gone: for good, and not to come back under another name.
        """

    @abstractmethod
    def why_not(self, owner: Participant, bus: Bus, name: str) -> str | None:
        """Return the reason why the item cannot have a name: another participant uses it.

        Args:
            owner: the simulator.

        Returns:
            A text for an error; None if the name is free.
        """

    def tune(self, rate: float) -> None:  # noqa: ARG002 - items with a rate use it
        """Set the rate.

        Args:
            rate: publications a second [Hz].
        """
        raise AssertionError(f"{self.default} has no rate")


def why_no_topic(owner: Participant, bus: Bus, name: str, type_name: str) -> str | None:
    """Return the reason why an owner cannot have a topic of this type.

    Settings are checked before any item moves. So a topic of another type that only the owner uses is no obstacle: its
    item will have another name by then. Clients are no obstacle either, because they give way.

    Args:
        owner: the simulator.

    Returns:
        A text for an error; None if the topic is free.
    """
    topic = bus.find_topic(name)
    if topic is not None:
        holders = {*topic.publishers, *(each.owner for each in topic.all_subscriptions if each.wanted is not None)}
        if {holder for holder in holders if not holder.is_guest} == {owner}:
            return None
    return bus.topic_table.type_conflict(name, type_name, owner)


class ListedInterface(Record):
    """An item of the world or the first ego, with the settings in force.

    Attributes:
        kind: publisher, subscriber or service.
        type_name: package and type.
        name: its name on the bus.
        is_on: true if it is on the bus.
        rate: publications a second [Hz]; None for an item without a rate.
    """

    kind: InterfaceKind
    default: str
    type_name: str
    name: str
    is_on: bool
    rate: float | None


class InterfaceRegistry:
    """All items of one owner.

    Attributes:
        settings: the settings in force.
        why_closed: the reason why services and input topics refuse everything; None while they do not.
        on_change: called with `now` when other settings come into force, before items get their new names.
    """

    def __init__(self, owner: Participant, bus: Bus, settings: NetworkSettings = DEFAULTS) -> None:
        """Start without items, and not open.

        Args:
            owner: the simulator.
        """
        self.settings = settings
        self.why_closed: str | None = None
        self.on_change: Callable[[float], None] = lambda _now: None
        self._owner = owner
        self._bus = bus
        self._items: list[Interface] = []
        self._elsewhere: set[tuple[InterfaceKind, str]] = set()
        self._is_open = False

    def add(self, item: Interface, *, is_everywhere: bool = True) -> None:
        """Add an item, and put it on the bus if the registry is open.

        Args:
            is_everywhere: every release has its type. If false, the item is left out where the release lacks the type,
                and
                settings may still name it, so that one file serves for all releases.

        Raises:
            GraphError: the name cannot be used; the item is not added.
            TypeNameError: there is no such type.
        """
        store, is_service = self._bus.store, item.kind is InterfaceKind.SERVICE
        try:
            # The error of a missing type would look for the nearest name, which is for users alone.
            is_there = is_everywhere or store.has(item.type_name, "srv" if is_service else "msg")
            if is_there:
                (store.service if is_service else store.message)(item.type_name)
        except TypeNameError:
            if is_everywhere:
                raise
            is_there = False
        if not is_there:
            self._elsewhere.add((item.kind, item.default))
            return
        if self._is_open:
            self._place(item, self.settings, 0.0)
        self._items.append(item)

    def open(self) -> None:
        """Put all items on the bus.

        Raises:
            DocumentError: the settings do not fit the items: all mistakes, one a line.
        """
        mistakes = list(dict.fromkeys(map(str, self._mistakes(self.settings))))
        if mistakes:
            more = [f"{len(mistakes) - MAX_MISTAKES:,} more mistakes"] if len(mistakes) > MAX_MISTAKES else []
            raise DocumentError("\n".join([*mistakes[:MAX_MISTAKES], *more]))
        self._is_open = True
        for item in self._items:
            self._place(item, self.settings, 0.0)

    def check_open(self) -> None:
        """Refuse a call or a message while the simulator cannot serve it.

        Raises:
            GraphError: with `why_closed`.
        """
        if self.why_closed is not None:
            raise GraphError(self.why_closed)

    def remove(self, items: Sequence[Interface], now: float) -> None:
        """Remove some items for good.

        Args:
            items: the items; one that is not on the bus is no error.
        """
        for item in items:
            if item.name is not None:
                item.release(self._owner, self._bus, now, is_gone=True)
                item.name = None
        gone = set(map(id, items))
        self._items = [item for item in self._items if id(item) not in gone]

    def check(self, settings: NetworkSettings) -> None:
        """Check that these settings can be used now; nothing changes.

        Raises:
            DocumentError: the first mistake: an unknown item, a rate for an item without one, or a name that cannot be
                used.
        """
        for mistake in self._mistakes(settings):
            raise mistake

    def _mistakes(self, settings: NetworkSettings) -> Iterator[DocumentError]:
        """Yield all mistakes in these settings.

        A conflict on the bus is left out at a place that has a mistake already.
        """
        mistakes = [*self._wrong_items(settings), *self._wrong_names(settings)]
        yield from mistakes
        told = tuple(map(str, mistakes))
        for item in self._items:
            name = _wanted(item, settings)
            why = item.why_not(self._owner, self._bus, name) if name is not None and name != item.name else None
            if why is not None:
                where = settings.choice(item.kind, item.default, item.prefix).where
                if not (where and any(text.startswith(f"{where}: ") for text in told)):
                    yield DocumentError(f"{where or f'{item.kind.noun} {item.default}'}: {why}")

    def change(self, settings: NetworkSettings, now: float) -> None:
        """Replace the settings.

        Args:
            settings: they passed `check`, and nothing on the bus has changed since.
        """
        moving = [item for item in self._items if _wanted(item, settings) != item.name]
        for item in moving:
            if item.name is not None:
                item.release(self._owner, self._bus, now, is_gone=False)
                item.name = None
        self.settings = settings
        # Before any message under a new name: a client that may not receive it may be subscribed to that name already.
        self._bus.guard.attempt("what follows other network settings", self.on_change, now)
        for item in self._items:
            self._place(item, settings, now)
        _log.info("network settings changed: %d items renamed, or turned on or off", len(moving))

    def name_of(self, kind: InterfaceKind, default: str, prefix: str = "/") -> str:
        """Return the name of an item on the bus.

        Args:
            default: its default name, without a prefix.
            prefix: `/`, or that of a further ego.

        Returns:
            The name; empty if there is none.
        """
        return self.settings.choice(kind, default, prefix).name or ""

    def is_elsewhere(self, default: str) -> bool:
        """Return whether an item exists in other releases only."""
        return any(name == default for _, name in self._elsewhere)

    def listing(self) -> Iterator[ListedInterface]:
        """Yield the items of the world and the first ego.

        Yields:
            Each item, by kind, in the order of addition.
        """
        for kind in InterfaceKind:
            for item in self._items:
                if item.kind is kind and item.prefix == "/":
                    choice = self.settings.choice(kind, item.default)
                    rate = None if item.rate is None else choice.rate or item.rate
                    yield ListedInterface(
                        kind, item.default, item.type_name, choice.name or "", bool(choice.is_on), rate
                    )

    def _place(self, item: Interface, settings: NetworkSettings, now: float) -> None:
        """Give an item the name, switch and rate of the settings."""
        if item.rate is not None:
            item.tune(settings.choice(item.kind, item.default, item.prefix).rate or item.rate)
        name = _wanted(item, settings)
        if name is not None and name != item.name:
            item.bind(self._owner, self._bus, name, now)
            item.name = name

    def _wrong_items(self, settings: NetworkSettings) -> Iterator[DocumentError]:
        """Yield a mistake for each choice of an unknown item; a further ego need not exist yet."""
        rates = {(item.kind, item.default): item.rate for item in self._items}
        for kind in InterfaceKind:
            for name, choice in settings.choices(kind).items():
                _, default = split_prefix(name)
                if (kind, default) in self._elsewhere:
                    continue
                if (kind, default) not in rates:
                    yield DocumentError(f"{choice.where}: {self._no_such(kind, default)}")
                elif choice.rate is not None and rates[kind, default] is None:
                    yield DocumentError(f"{choice.where}: expected no rate: it is published only when it changes")

    def _no_such(self, kind: InterfaceKind, default: str) -> str:
        """Return the error text for an unknown item."""
        others = [item.kind.noun for item in self._items if item.default == default]
        known = {item.default for item in self._items if item.kind is kind}
        near = f"; {default} is a {others[0]}" if others else hint(default, known)
        return f"the simulator has no such {kind.noun}{near}"

    def _wrong_names(self, settings: NetworkSettings) -> Iterator[DocumentError]:
        """Yield a mistake for each name that two items have.

        A publisher and a subscriber with the same default name may share another name.
        """
        ours = dict.fromkeys((item.kind, item.default) for item in self._items)
        taken: dict[tuple[bool, str], tuple[InterfaceKind, str, InterfaceChoice]] = {}
        for prefix in settings.prefixes():
            for kind, default in ours:
                choice = settings.choice(kind, default, prefix)
                if not choice.is_on or choice.name is None:
                    continue
                item = prefix + default[1:]
                other_kind, other, theirs = taken.setdefault(
                    (kind is InterfaceKind.SERVICE, choice.name), (kind, item, choice)
                )
                if (other_kind, other) != (kind, item) and (other_kind is kind or other != item):
                    yield DocumentError(
                        f"{choice.where or theirs.where}: expected different names for {other} and {item};"
                        f" got {choice.name} for both"
                    )


def _wanted(item: Interface, settings: NetworkSettings) -> str | None:
    """Return the name that the settings give to an item; None if it is off."""
    choice = settings.choice(item.kind, item.default, item.prefix)
    return choice.name if choice.is_on else None
