"""Comparison of the fields of `morai_msgs` at a remote bridge with ours.

A ROS machine with another release of the package refuses each message of a changed type, and its programs wait in
silence. So the fields of our types are asked for once everything is announced on a connection.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.graph.attach.connection import Values
from rosbridge_sim.graph.attach.diagnostics import Diagnostics, plain_type
from rosbridge_sim.graph.attach.mirror_registry import MirrorRegistry
from rosbridge_sim.schema.store import Store
from rosbridge_sim.schema.typedefs import typedefs

__all__ = ["ReleaseCheck"]

PACKAGE: Final = "morai_msgs"
"""The package that has several releases."""

Fields = dict[str, frozenset[str]]
"""Type -> names of its fields."""


class ReleaseCheck:
    """The comparison for one remote bridge.

    Attributes:
        releases: returns the types of each release, by its name for `--release`.
        on_mismatch: called with the text of the log if the far side has other fields.
    """

    def __init__(self, diagnostics: Diagnostics, registry: MirrorRegistry, store: Store) -> None:
        """Create one that knows no releases.

        Args:
            diagnostics: gets the finding.
            registry: the announced items; its first connection is asked.
            store: our types.
        """
        self.releases: Callable[[], Mapping[str, Store]] = dict
        self.on_mismatch: Callable[[str], None] = lambda _text: None
        self._diagnostics = diagnostics
        self._registry = registry
        self._store = store

    def ask(self, now: float) -> None:
        """Ask for the fields of our types. A type that the far side does not have is left out.

        A question about an unknown type may end rosapi of ROS 2, so only types of listed topics are asked for.

        Args:
            now: monotonic time [s].
        """
        first = self._registry.first
        names = dict.fromkeys(
            item.type
            for item in self._registry.items.values()
            if item.kind == "topic" and item.is_confirmed and item.type.partition("/")[0] == PACKAGE
        )
        theirs: Fields = {}
        num_open = len(names)

        def on_answer(values: Values | None, _now: float) -> None:
            nonlocal num_open
            num_open -= 1
            theirs.update(_fields_in(values))
            if not num_open:
                self._compare(theirs)

        for name in names:
            first.ask("/rosapi/message_details", on_answer, now, type=name)

    def _compare(self, theirs: Fields) -> None:
        differing = _differing(theirs, self._store)
        if not differing:
            return
        fitting = [name for name, store in self.releases().items() if not _differing(theirs, store)]
        advice = f"use --release {fitting[0]}" if fitting else "no release here fits; give its package by --schema-path"
        shown = ", ".join(differing[:3]) + (f" and {len(differing) - 3} more" if len(differing) > 3 else "")  # noqa: PLR2004 - a line
        text = f"its {PACKAGE} has other fields than ours in {shown}, so its programs get no such messages: {advice}"
        self._diagnostics.log_once(text)
        self.on_mismatch(text)


def _fields_in(values: Values | None) -> Fields:
    """Return the fields of all types of the package in an answer."""
    fields: Fields = {}
    found = values.get("typedefs") if values is not None else None
    for each in found if isinstance(found, list) else ():
        name, names = (each.get("type"), each.get("fieldnames")) if isinstance(each, dict) else (None, None)
        if isinstance(name, str) and name.startswith(f"{PACKAGE}/") and isinstance(names, list):
            fields[plain_type(name)] = frozenset(one.lstrip("_") for one in names if isinstance(one, str))
    return fields


def _differing(theirs: Fields, store: Store) -> list[str]:
    """Return the types whose fields differ from those of a store; a type that it lacks differs, too."""
    return sorted(name for name, fields in theirs.items() if _fields_of(name, store) != fields)


def _fields_of(name: str, store: Store) -> frozenset[str] | None:
    try:
        found = typedefs(store.message(name).spec)
    except TypeNameError:
        return None
    return next(
        (frozenset(each.fieldnames) for each in found if plain_type(each.type) == name),
        None,
    )
