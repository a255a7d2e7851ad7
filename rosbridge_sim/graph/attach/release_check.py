"""Comparison of the fields of `morai_msgs` at a remote bridge with ours.

A ROS machine with another release of the package refuses each message of a changed type, and its programs wait in
silence. So names and types of the fields of our types are asked for once everything is announced on a connection.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Final

import msgspec

from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.graph.attach.connection import Values
from rosbridge_sim.graph.attach.diagnostics import Diagnostics, plain_type
from rosbridge_sim.graph.attach.mirror_registry import MirrorRegistry
from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.typedefs import TypeDef, typedefs
from rosbridge_sim.schema.store import Store
from rosbridge_sim.suggestions import name_some

_END_OF_NAME: Final = re.compile(r"[\[<>, ]")
"""First character behind the name of a type: of its length, or of what a sequence holds."""

PACKAGE: Final = "morai_msgs"
"""The package that has several releases."""

Fields = dict[str, frozenset[tuple[str, str]]]
"""Type -> name and type of each of its fields; the type as both generations of ROS mean it."""

_SAME_TYPES: Final = {
    "byte": "octet",
    "char": "uint8",
    "boolean": "bool",
    "float": "float32",
    "double": "float64",
    "wstring": "string",
    "builtin_interfaces/Time": "time",
    "builtin_interfaces/Duration": "duration",
}
"""Other names of the same types: older ones, those of IDL, which rosapi of ROS 2 shows, and those of ROS 2."""


class _ToldType(Record):
    """A type as a remote rosapi tells it; see `TypeDef`."""

    type: str
    fieldnames: list[str]
    fieldtypes: list[str]
    fieldarraylen: list[int]


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
        """
        self.releases: Callable[[], Mapping[str, Store]] = dict
        self.on_mismatch: Callable[[str], None] = lambda _text: None
        self._diagnostics = diagnostics
        self._registry = registry
        self._store = store

    def ask(self, now: float) -> None:
        """Ask for the fields of our types. A type that the far side does not have is left out.

        A question about an unknown type may end rosapi of ROS 2, so only types of listed topics are asked for.
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
        shown = name_some(differing)
        text = f"its {PACKAGE} has other fields than ours in {shown}, so its programs get no such messages: {advice}"
        self._diagnostics.log_once(text)
        self.on_mismatch(text)


def _fields_in(values: Values | None) -> Fields:
    """Return the fields of all types of the package in an answer."""
    try:
        found = msgspec.convert((values or {}).get("typedefs", []), list[_ToldType])
    except msgspec.ValidationError:
        return {}
    return _fields(one for one in found if one.type.startswith(f"{PACKAGE}/"))


def _fields(found: Iterable[_ToldType | TypeDef]) -> Fields:
    return {
        plain_type(one.type): frozenset(
            (name.lstrip("_"), _spelled(kind, length))
            for name, kind, length in zip(one.fieldnames, one.fieldtypes, one.fieldarraylen, strict=False)
        )
        for one in found
    }


def _spelled(kind: str, length: int) -> str:
    """Return a field's type in one spelling for all servers; arrays of different lengths are one type here.

    rosapi of ROS 2 shows a bounded sequence with another length than ours, so only list or no list is compared.

    Args:
        kind: from `fieldtypes`.
        length: from `fieldarraylen`: -1 for no array.
    """
    is_list = length != -1 or kind.startswith("sequence<")
    base = plain_type(_END_OF_NAME.split(kind.removeprefix("sequence<"), maxsplit=1)[0])
    return _SAME_TYPES.get(base, base) + ("[]" if is_list else "")


def _differing(theirs: Fields, store: Store) -> list[str]:
    """Return the types whose fields differ from those of a store; a type that it lacks differs, too."""
    return sorted(name for name, fields in theirs.items() if _fields_of(name, store) != fields)


def _fields_of(name: str, store: Store) -> frozenset[tuple[str, str]] | None:
    try:
        return _fields(typedefs(store.message(name).spec)).get(name)
    except TypeNameError:
        return None
