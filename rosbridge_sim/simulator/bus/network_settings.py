"""Network settings, as in MORAI's panel: names, switches and rates of the simulator's topics and services.

An *item* is one publisher, subscriber or service of the simulator: it publishes `/Ego_topic` and subscribes to
`/ctrl_cmd`. Its default name identifies it, even if it has another name on the bus. An `InterfaceChoice` sets some of
its properties; the others keep their defaults. In a TOML file:

    [publishers]
    "/Ego_topic" = { name = "/car/state", rate = 25, on = true }

The items of a further ego have the first ego's choices, with its own prefix: `/Ego-2/car/state`. A choice for its own
item, `/Ego-2/Ego_topic`, takes precedence.

This module checks the form of the settings. `registry` checks that the items exist and that their names are free.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from typing import Annotated, Final, NoReturn, Protocol

from msgspec import Meta

from rosbridge_sim.documents.document_model import DocumentType, Table, fields_of, show_json
from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.errors import DocumentError, GraphError
from rosbridge_sim.graph.participant import resolve
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import replace

MAX_RATE: Final = 120.0
"""Highest rate of a publisher that MORAI allows [Hz]."""

USUAL_RATE: Final = 50.0
"""Default rate of a publisher: once a frame [Hz]."""

MAX_SETTINGS_NAME: Final = 200
"""Longest name [characters]: the prefix of a further ego is added to it, and the bus takes 256."""

_FURTHER_EGO = re.compile(r"/Ego-\d+/")

Place = Callable[[tuple[str, ...]], str]
"""A path of keys, such as ("publishers", "/clock", "rate") -> the text for that place in an error."""


class InterfaceKind(Enum):
    """Kind of an item; the values are the tables of the settings."""

    PUBLISHER = "publishers"
    SUBSCRIBER = "subscribers"
    SERVICE = "services"

    @property
    def noun(self) -> str:
        """The kind as a singular noun, for texts."""
        return self.value.removesuffix("s")


@dataclass(frozen=True, slots=True)
class InterfaceChoice:
    """Choices for one item; None leaves a property as it is.

    Attributes:
        name: its name on the bus, absolute.
        is_on: true if it is on the bus.
        rate: publications a second [Hz]; only for publishers that publish with the frames.
        where: place of the choice in a file or flag, for errors.
    """

    name: str | None = None
    is_on: bool | None = None
    rate: float | None = None
    where: str = field(default="", compare=False)

    def over(self, base: InterfaceChoice) -> InterfaceChoice:
        """Return this choice, completed by another one.

        Args:
            base: gives the properties that this choice leaves open.
        """
        return InterfaceChoice(
            base.name if self.name is None else self.name,
            base.is_on if self.is_on is None else self.is_on,
            base.rate if self.rate is None else self.rate,
            base.where if self.name is None and base.name is not None else self.where or base.where,
        )


@lru_cache(maxsize=1024)
def _usual(name: str) -> InterfaceChoice:
    """Return the choice for an item of which no settings say anything."""
    return InterfaceChoice(name, is_on=True)


@dataclass(frozen=True, slots=True)
class NetworkSettings:
    """Choices for all items; none is required.

    Attributes:
        publishers, subscribers, services: default name -> choice.
    """

    publishers: Mapping[str, InterfaceChoice] = field(default_factory=dict)
    subscribers: Mapping[str, InterfaceChoice] = field(default_factory=dict)
    services: Mapping[str, InterfaceChoice] = field(default_factory=dict)

    def choices(self, kind: InterfaceKind) -> Mapping[str, InterfaceChoice]:
        """Return the choices for one kind of items.

        Returns:
            Default name -> choice.
        """
        choices: Mapping[str, InterfaceChoice] = getattr(self, kind.value)
        return choices

    def choice(self, kind: InterfaceKind, default: str, prefix: str = "/") -> InterfaceChoice:
        """Return the choice for an item, completed by the defaults; only the rate may be None.

        Args:
            default: its default name, without a prefix.
            prefix: `/` for an item of the world or the first ego, else the prefix of a further ego.
        """
        if not (self.services or self.publishers or self.subscribers):
            # The usual case, asked hundreds of times when a simulator starts or egos come.
            return _usual(default if prefix == "/" else prefix + default[1:])
        choices = self.choices(kind)
        choice = choices.get(default, _NOTHING).over(InterfaceChoice(default, is_on=True))
        if prefix == "/" or choice.name is None:
            return choice
        return choices.get(prefix + default[1:], _NOTHING).over(replace(choice, name=prefix + choice.name[1:]))

    def prefixes(self) -> list[str]:
        """Return the prefixes of all items with a choice.

        Returns:
            `/`, then the prefixes of further egos.
        """
        return list(
            dict.fromkeys(["/", *(split_prefix(name)[0] for kind in InterfaceKind for name in self.choices(kind))])
        )

    def over(self, base: NetworkSettings) -> NetworkSettings:
        """Return these settings, completed by others.

        Args:
            base: gives the properties that these settings leave open.
        """
        return NetworkSettings(**{kind.value: _over(self.choices(kind), base.choices(kind)) for kind in InterfaceKind})


DEFAULTS: Final = NetworkSettings()
"""The settings without any choice."""

_NOTHING: Final = InterfaceChoice()


def _over(choices: Mapping[str, InterfaceChoice], base: Mapping[str, InterfaceChoice]) -> dict[str, InterfaceChoice]:
    merged = dict(base)
    for name, choice in choices.items():
        merged[name] = choice.over(merged.get(name, _NOTHING))
    return merged


class Networks(Protocol):
    """Source of network settings that belong to scenarios; the shell reads them from the disk."""

    def network(self, scenario: str) -> NetworkSettings | None:
        """Return the network settings of a scenario.

        Args:
            scenario: its name, as a client gives it.

        Returns:
            The settings; None if it has none.

        Raises:
            DocumentError: the name is not valid, or the settings cannot be used.
        """


def split_prefix(name: str) -> tuple[str, str]:
    """Split the name of an item into its prefix and its default name.

    Args:
        name: for example `/Ego-2/Ego_topic`.

    Returns:
        The prefix (`/`, or that of a further ego), and the name without it, for example `/Ego-2/` and `/Ego_topic`.
    """
    match = _FURTHER_EGO.match(name)
    prefix = match[0] if match else "/"
    return prefix, "/" + name[len(prefix) :]


# Reading


def path_text(path: tuple[str, ...]) -> str:
    """Return a path of keys as TOML writes it; a long key is shortened."""
    return ".".join(map(_key_text, path))


def _key_text(key: str) -> str:
    short = key if len(key) <= MAX_SETTINGS_NAME else key[:MAX_SETTINGS_NAME] + "..."
    if re.fullmatch(r"[\w-]+", key, re.ASCII):
        return short
    return '"' + "".join(char if char.isprintable() else f"\\u{ord(char):04x}" for char in short) + '"'


OnMistake = Callable[[DocumentError], None]
"""Takes a mistake; if it does not raise the mistake, reading goes on with the next entry."""


def _raise(error: DocumentError) -> NoReturn:
    raise error


def read_choices(
    kind: InterfaceKind, table: object, place: Place = path_text, on_mistake: OnMistake = _raise
) -> dict[str, InterfaceChoice]:
    """Read one table of the settings.

    Args:
        table: from a TOML file or from Python.
        place: returns the text for a place in it, for errors.
        on_mistake: takes each mistake; by default the first one is raised.

    Returns:
        Absolute default name -> choice.

    Raises:
        DocumentError: raised by `on_mistake`.
    """
    top = (kind.value,)
    if not isinstance(table, Mapping):
        text = f'{place(top)}: expected a table such as "/NAME" = {{ on = true }}, got {show_json(table)}'
        on_mistake(DocumentError(text))
        return {}
    choices: dict[str, InterfaceChoice] = {}
    for name, entry in table.items():
        path = (*top, str(name))
        try:
            default = _read_name(name)
        except ValueError as error:
            on_mistake(DocumentError(f"{place(path)}: {error}, got {show_json(name)}"))
            continue
        if default in choices:
            on_mistake(DocumentError(f"{place(path)}: expected each {kind.noun} once"))
            continue
        is_read = isinstance(entry, InterfaceChoice)
        choices[default] = entry if is_read else _read_choice(kind, default, entry, path, place, on_mistake=on_mistake)
    return choices


def _read_choice(
    kind: InterfaceKind, default: str, entry: object, path: tuple[str, ...], place: Place, *, on_mistake: OnMistake
) -> InterfaceChoice:
    form = _PUBLISHER if kind is InterfaceKind.PUBLISHER else _ITEM
    checked = check_values(form, entry, lambda keys: place((*path, *map(str, keys))))
    for mistake in checked[1]:
        on_mistake(DocumentError(mistake.text))
    item = checked[0]
    if item is None:
        return InterfaceChoice()
    owner = "/" if item.name is None else split_prefix(item.name)[0]
    if owner not in ("/", split_prefix(default)[0]):
        text = f"{place((*path, 'name'))}: expected no name that begins with {owner}, which is an ego's"
        on_mistake(DocumentError(text))
    rate = item.rate if isinstance(item, _Publisher) else None
    return InterfaceChoice(item.name, item.on, rate, place(path))


def _read_name(name: object) -> str:
    with suppress(GraphError):
        absolute = resolve(name) if isinstance(name, str) else ""
        if 1 < len(absolute) <= MAX_SETTINGS_NAME:
            return absolute
    raise ValueError("expected the name of a topic or service, without blanks")


def _read_rate(rate: object) -> float:
    if isinstance(rate, (int, float)) and not isinstance(rate, bool) and 0.0 < rate <= MAX_RATE:
        return float(rate)
    raise ValueError(f"expected more than 0 and at most {MAX_RATE:g} Hz")


class _Item(Table, frozen=True, kw_only=True):
    """The choices for a subscriber or a service, as they are written."""

    name: Annotated[str, Meta(extra={"read": _read_name})] | None = None
    on: bool | None = None

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        """Return the table as a dict, which it need not be in Python."""
        if isinstance(value, Mapping):
            return dict(value)
        raise ValueError(f"expected a table of {', '.join(fields_of(cls))}")


class _Publisher(_Item, frozen=True, kw_only=True):
    """The choices for a publisher."""

    rate: Annotated[float, Meta(extra={"read": _read_rate})] | None = None


_ITEM: Final[DocumentType[_Item]] = DocumentType(_Item)
_PUBLISHER: Final[DocumentType[_Item]] = DocumentType(_Publisher)
