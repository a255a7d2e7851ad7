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
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NoReturn, Protocol

from rosbridge_sim.errors import DocumentError, GraphError
from rosbridge_sim.graph.participant import resolve
from rosbridge_sim.records import replace
from rosbridge_sim.suggestions import hint

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
        choices = self.choices(kind)
        if not choices:  # the usual case, asked hundreds of times when egos come
            return InterfaceChoice(default if prefix == "/" else prefix + default[1:], is_on=True)
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
        text = f'{place(top)}: expected a table such as "/NAME" = {{ on = true }}; got {_shown(table)}'
        on_mistake(DocumentError(text))
        return {}
    choices: dict[str, InterfaceChoice] = {}
    for name, entry in table.items():
        path = (*top, str(name))
        try:
            default = _read_name(name, kind, path, place)
            if default in choices:
                raise DocumentError(f"{place(path)}: expected each {kind.noun} once")  # noqa: TRY301 - as the others
        except DocumentError as error:
            on_mistake(error)
            continue
        is_read = isinstance(entry, InterfaceChoice)
        choices[default] = entry if is_read else _read_choice(kind, default, entry, path, place, on_mistake=on_mistake)
    return choices


def _read_choice(
    kind: InterfaceKind, default: str, entry: object, path: tuple[str, ...], place: Place, *, on_mistake: OnMistake
) -> InterfaceChoice:
    keys = ["name", "rate", "on"] if kind is InterfaceKind.PUBLISHER else ["name", "on"]
    if not isinstance(entry, Mapping):
        on_mistake(DocumentError(f"{place(path)}: expected a table of {', '.join(keys)}; got {_shown(entry)}"))
        return InterfaceChoice()
    for key in entry:
        if key not in keys:
            text = f"{place((*path, str(key)))}: expected {', '.join(keys[:-1])} or {keys[-1]}{hint(str(key), keys)}"
            on_mistake(DocumentError(text))
    name, rate, is_on = entry.get("name"), entry.get("rate"), entry.get("on")
    try:
        if name is not None:
            name = _read_own_name(name, kind, default, (*path, "name"), place)
    except DocumentError as error:
        on_mistake(error)
        name = None
    if not (is_on is None or isinstance(is_on, bool)):
        on_mistake(DocumentError(f"{place((*path, 'on'))}: expected true or false; got {_shown(is_on)}"))
        is_on = None
    try:
        if rate is not None:
            rate = _read_rate(rate, (*path, "rate"), place)
    except DocumentError as error:
        on_mistake(error)
        rate = None
    return InterfaceChoice(name, is_on, rate, place(path))


def _read_own_name(name: object, kind: InterfaceKind, default: str, path: tuple[str, ...], place: Place) -> str:
    """Return the name that an item is given; it may not begin with another ego's prefix."""
    absolute = _read_name(name, kind, path, place)
    owner = split_prefix(absolute)[0]
    if owner not in ("/", split_prefix(default)[0]):
        raise DocumentError(f"{place(path)}: expected no name that begins with {owner}, which is an ego's")
    return absolute


def _read_name(name: object, kind: InterfaceKind, path: tuple[str, ...], place: Place) -> str:
    what = "service" if kind is InterfaceKind.SERVICE else "topic"
    try:
        absolute = resolve(name) if isinstance(name, str) else ""
    except GraphError:
        absolute = ""
    if not 1 < len(absolute) <= MAX_SETTINGS_NAME:
        raise DocumentError(f"{place(path)}: expected the name of a {what}, without blanks; got {_shown(name)}")
    return absolute


def _read_rate(rate: object, path: tuple[str, ...], place: Place) -> float:
    is_number = isinstance(rate, (int, float)) and not isinstance(rate, bool)
    if not (is_number and isinstance(rate, (int, float)) and 0.0 < rate <= MAX_RATE):
        raise DocumentError(f"{place(path)}: expected more than 0 and at most {MAX_RATE:g} Hz; got {_shown(rate)}")
    return float(rate)


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."  # noqa: PLR2004 - a line of a terminal
