"""A setting's flag: its group, its values and its help text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

from rosbridge_sim.shell.config.value_types import SECRET, URLS, ValueType

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Flag:
    """Group, values and help text of a setting."""

    group: str
    kind: ValueType
    text: str


def flag(default: T, group: str, kind: ValueType, text: str) -> T:
    """Return a field of `Settings` with a flag. Its declared type is T, for the type checker."""
    metadata = {"flag": Flag(group, kind, text)}
    if isinstance(default, dict):
        return field(default_factory=lambda: dict(default), metadata=metadata)  # type: ignore[return-value]
    return field(default=default, metadata=metadata, repr=kind not in (SECRET, URLS))
