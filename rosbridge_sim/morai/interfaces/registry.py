"""The simulator's items on the bus: each under the name, with the switch and at the rate that the settings say.

A component adds an `Interface` under its default name for each topic or service. While the simulator is built these are
collected; `open` brings them onto the bus. From then on a further ego's come and go, and `change` exchanges the
settings while all goes on: what changes its name or its switch leaves the bus and comes back, everything else does not
notice. A call that is in flight meanwhile is still answered, for what asks for other settings is such a call itself.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

from rosbridge_sim.errors import DocumentError, GraphError, TypeNameError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Guest, Participant
from rosbridge_sim.morai.interfaces.network_settings import (
    DEFAULTS,
    InterfaceChoice,
    InterfaceKind,
    NetworkSettings,
    split_prefix,
)
from rosbridge_sim.suggestions import hint

__all__ = ["Interface", "InterfaceRegistry", "ListedInterface", "why_no_topic"]

MAX_MISTAKES: Final = 20
"""Mistakes in the settings of the start that are told, one a line: a screen of a terminal."""

_log = logging.getLogger("rosbridge_sim.morai")


class Interface(ABC):
    """One publisher, subscriber or service of the simulator.

    Attributes:
        kind: which of these.
        default: its default name, without the prefix of a further ego.
        prefix: `/`, or that of a further ego.
        type_name: package and type.
        rate: publications a second if nobody says anything else [Hz]; None where there is no such thing.
        name: what it is called on the bus; None while it is not there.
    """

    kind: ClassVar[InterfaceKind]

    def __init__(self, default: str, prefix: str, type_name: str, rate: float | None = None) -> None:
        """An item that is not on the bus yet."""
        self.default = default
        self.prefix = prefix
        self.type_name = type_name
        self.rate = rate
        self.name: str | None = None

    @abstractmethod
    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:
        """Be on the bus under this name (for `InterfaceRegistry` alone, and so is `release`).

        Raises:
            GraphError: the name cannot be had.
        """

    @abstractmethod
    def release(self, owner: Participant, bus: Bus, now: float, *, is_gone: bool) -> None:
        """Leave the bus; for good, or to come back under another name."""

    @abstractmethod
    def why_not(self, owner: Participant, bus: Bus, name: str) -> str | None:
        """Why it cannot be called so, as others have something there; None where nothing is in the way."""

    def tune(self, rate: float) -> None:  # noqa: ARG002 - those that have one use it
        """Go out so often [Hz]."""
        raise AssertionError(f"{self.default} has no rate")


def why_no_topic(owner: Participant, bus: Bus, name: str, type_name: str) -> str | None:
    """Why an owner cannot have a topic of this type; one of another type that it has alone is no obstacle.

    For settings are checked before anything moves, and what the owner has there will have another name by then. Clients
    are no obstacle either: they give way.
    """
    topic = bus.find_topic(name)
    if topic is not None:
        holders = {*topic.publishers, *(each.owner for each in topic.all_subscriptions if each.wanted is not None)}
        if {holder for holder in holders if not isinstance(holder, Guest)} == {owner}:
            return None
    return bus.type_conflict(name, type_name, owner)


@dataclass(frozen=True, slots=True)
class ListedInterface:
    """One of the first ego's items, or the world's, as the settings in force have it.

    Attributes:
        kind: what it is.
        default: its default name.
        name: what it is called.
        is_on: whether it is there.
        rate: publications a second [Hz]; None where there is no such thing.
    """

    kind: InterfaceKind
    default: str
    name: str
    is_on: bool
    rate: float | None


class InterfaceRegistry:
    """All items of one owner.

    Attributes:
        settings: those in force.
        why_closed: why services and input topics refuse everything; None while they do not.
        on_change: called with `now` when other settings come into force, before items have the new names.
    """

    def __init__(self, owner: Participant, bus: Bus, settings: NetworkSettings = DEFAULTS) -> None:
        """No items yet, and closed."""
        self.settings = settings
        self.why_closed: str | None = None
        self.on_change: Callable[[float], None] = lambda _now: None
        self._owner = owner
        self._bus = bus
        self._items: list[Interface] = []
        self._elsewhere: set[tuple[InterfaceKind, str]] = set()
        self._is_open = False

    def add(self, item: Interface, *, is_everywhere: bool = True, now: float = 0.0) -> None:
        """Take an item in, and onto the bus if it is open.

        Args:
            item: a new one.
            is_everywhere: every release has its type. Where one does not, there is no such item, and settings that
                speak of it do no harm: one file serves for all releases.
            now: monotonic time [s].

        Raises:
            GraphError: the name cannot be had; the item is not taken in.
            TypeNameError: there is no such type.
        """
        find = self._bus.store.service if item.kind is InterfaceKind.SERVICE else self._bus.store.message
        try:
            find(item.type_name)
        except TypeNameError:
            if is_everywhere:
                raise
            self._elsewhere.add((item.kind, item.default))
            return
        if self._is_open:
            self._place(item, self.settings, now)
        self._items.append(item)

    def open(self) -> None:
        """Bring all items onto the bus.

        Raises:
            DocumentError: the settings do not fit them: all mistakes, one a line.
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
            GraphError: it cannot, and the text says why.
        """
        if self.why_closed is not None:
            raise GraphError(self.why_closed)

    def remove(self, items: Sequence[Interface], now: float) -> None:
        """Let go of some items for good."""
        for item in items:
            if item.name is not None:
                item.release(self._owner, self._bus, now, is_gone=True)
                item.name = None
        self._items = [item for item in self._items if item not in items]

    def check(self, settings: NetworkSettings) -> None:
        """See whether these settings can be used now; nothing is changed.

        Raises:
            DocumentError: an item that there is not, a rate where there is none, or a name that cannot be had; the
                first mistake.
        """
        for mistake in self._mistakes(settings):
            raise mistake

    def _mistakes(self, settings: NetworkSettings) -> Iterator[DocumentError]:
        """All that is wrong with these settings. Of a place with a mistake, what is on the bus says nothing new."""
        mistakes = [*self._wrong_items(settings), *self._wrong_names(settings)]
        yield from mistakes
        told = tuple(map(str, mistakes))
        for item in self._items:
            name = _wanted(item, settings)
            if name is not None and name != item.name:
                why = item.why_not(self._owner, self._bus, name)
                where = settings.choice(item.kind, item.default, item.prefix).where
                if why is not None and not (where and any(text.startswith(f"{where}: ") for text in told)):
                    yield DocumentError(f"{where or f'{item.kind.noun} {item.default}'}: {why}")

    def change(self, settings: NetworkSettings, now: float) -> None:
        """Have other settings from here on. They must have been checked, with nothing done on the bus since."""
        moving = [item for item in self._items if _wanted(item, settings) != item.name]
        for item in moving:
            if item.name is not None:
                item.release(self._owner, self._bus, now, is_gone=False)
                item.name = None
        self.settings = settings
        # Before anything is said under a new name: a client that may not hear it may be listening there already.
        self._bus.guard.attempt("what follows other network settings", self.on_change, now)
        for item in self._items:
            self._place(item, settings, now)
        _log.info("network settings: %d items have another name, or were turned on or off", len(moving))

    def name_of(self, kind: InterfaceKind, default: str, prefix: str = "/") -> str:
        """What an item is called, if it is there."""
        return self.settings.choice(kind, default, prefix).name or ""

    def listing(self) -> Iterator[ListedInterface]:
        """The items of the world and the first ego, by kind, in the order in which they were added."""
        for kind in InterfaceKind:
            for item in self._items:
                if item.kind is kind and item.prefix == "/":
                    choice = self.settings.choice(kind, item.default)
                    rate = None if item.rate is None else choice.rate or item.rate
                    yield ListedInterface(kind, item.default, choice.name or "", bool(choice.is_on), rate)

    def _place(self, item: Interface, settings: NetworkSettings, now: float) -> None:
        """Have an item where the settings want it, and at their rate."""
        if item.rate is not None:
            item.tune(settings.choice(item.kind, item.default, item.prefix).rate or item.rate)
        name = _wanted(item, settings)
        if name is not None and name != item.name:
            item.bind(self._owner, self._bus, name, now)
            item.name = name

    def _wrong_items(self, settings: NetworkSettings) -> Iterator[DocumentError]:
        """Items that something is chosen about and that are not there; a further ego need not be there yet."""
        rates = {(item.kind, item.default): item.rate for item in self._items}
        for kind in InterfaceKind:
            for name, choice in settings.choices(kind).items():
                _, default = split_prefix(name)
                if (kind, default) in self._elsewhere:
                    continue
                if (kind, default) not in rates:
                    yield DocumentError(f"{choice.where}: {self._no_such(kind, default)}")
                elif choice.rate is not None and rates[kind, default] is None:
                    yield DocumentError(f"{choice.where}: expected no rate: it goes out whenever there is news")

    def _no_such(self, kind: InterfaceKind, default: str) -> str:
        """What to say of an item that there is not."""
        others = [item.kind.noun for item in self._items if item.default == default]
        known = {item.default for item in self._items if item.kind is kind}
        near = f"; {default} is a {others[0]}" if others else hint(default, known)
        return f"the simulator has no such {kind.noun}{near}"

    def _wrong_names(self, settings: NetworkSettings) -> Iterator[DocumentError]:
        """Names of several items. A publisher and a subscriber that share their default name may share another."""
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
    """What an item is to be called; None where it is off."""
    choice = settings.choice(item.kind, item.default, item.prefix)
    return choice.name if choice.is_on else None
