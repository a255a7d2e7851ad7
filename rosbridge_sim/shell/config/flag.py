"""A setting's flag: its group, its values and its help text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeVar

from rosbridge_sim.shell.config.value_types import FILE, PATTERNS, SECRET, SWITCH, URLS, ValueType, item_choices

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Flag:
    """Group, values and help text of a setting."""

    group: str
    kind: ValueType
    text: str


class FlagGroup:
    """A group of flags. Its functions return fields of `Settings`, declared for the type checker as their values."""

    def __init__(self, title: str) -> None:
        self._title = title

    def flag(self, default: T, kind: ValueType, text: str) -> T:
        """Return a field with values of this kind."""
        metadata = {"flag": Flag(self._title, kind, text)}
        if isinstance(default, dict):
            return field(default_factory=lambda: dict(default), metadata=metadata)  # type: ignore[return-value]
        return field(default=default, metadata=metadata, repr=kind not in (SECRET, URLS))

    def switch(self, text: str, *, on: bool = False) -> bool:
        """Return a field that is True or False; `on` is its default."""
        return self.flag(on, SWITCH, text)

    def several(self, text: str, kind: ValueType = PATTERNS) -> tuple[str, ...]:
        """Return a field with any number of values; it has none by default."""
        return self.flag((), kind, text)

    def optional(self, text: str, kind: ValueType = FILE) -> Any:  # noqa: ANN401 - of the kind, or None
        """Return a field that is None by default."""
        return self.flag(None, kind, text)

    def table(self, name: str, text: str) -> dict[str, Any]:
        """Return a field with a table of the settings file, of which a default setting has no entry."""
        return self.flag({}, item_choices(name), text)

    def choice(self, default: T, text: str, *, none: str = "") -> T:
        """Return a field with the words of its type, a `Literal`; the word `none` stands for None."""
        return field(default=default, metadata={"choice": (self._title, text, none)})
