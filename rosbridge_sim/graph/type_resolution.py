"""The type for a name. If its package is unknown, its messages are relayed unchecked."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable

from rosbridge_sim.errors import UnknownPackageError
from rosbridge_sim.graph.participant import resolve
from rosbridge_sim.schema.message_type import ActionType, MessageType, ServiceType
from rosbridge_sim.schema.opaque_types import OpaqueActionType, OpaqueServiceType, OpaqueType
from rosbridge_sim.schema.store import Store

MAX_REMEMBERED_TYPES = 10_000
"""Largest number of unknown types that are remembered."""

_log = logging.getLogger("rosbridge_sim.graph")


class TypeResolver:
    """The types of one bus: those of its store, and opaque ones for unknown packages."""

    def __init__(
        self, store: Store, types_in_use: Callable[[], Iterable[MessageType | OpaqueType]], *, is_strict: bool
    ) -> None:
        """Create a resolver.

        Args:
            types_in_use: returns the types of all topics; unknown types among them stay remembered.
            is_strict: refuse types of unknown packages; otherwise their messages are relayed unchecked.
        """
        self._store = store
        self._types_in_use = types_in_use
        self._is_strict = is_strict
        self._opaque: dict[str, OpaqueType] = {}
        self._tidy_at = 0
        self._logged: dict[tuple[str, str], None] = {}  # unknown types that were logged, and their use

    def message(self, name: str) -> MessageType | OpaqueType:
        """Return the type of a message; an opaque one if its whole package is unknown.

        Args:
            name: name of the type, in any accepted spelling.

        Raises:
            GraphError: the name is too long.
            TypeNameError: the type does not exist.
        """
        try:
            return self._store.message(name)
        except UnknownPackageError as error:
            canonical = self._relay(name, "messages of this type", error)
        opaque = self._opaque.get(canonical)
        if opaque is None:
            if len(self._opaque) >= self._tidy_at:
                self._opaque = {each.name: each for each in self._types_in_use() if type(each) is OpaqueType}
                # wait until half as many new ones have come, so that each type costs constant time
                self._tidy_at = max(MAX_REMEMBERED_TYPES, len(self._opaque) * 3 // 2 + 1)
            opaque = self._opaque[canonical] = OpaqueType(canonical)
        return opaque

    def service(self, name: str) -> ServiceType | OpaqueServiceType:
        """Return the type of a service; see `message`."""
        try:
            return self._store.service(name)
        except UnknownPackageError as error:
            return OpaqueServiceType(self._relay(name, "calls of this service", error))

    def action(self, name: str) -> ActionType | OpaqueActionType:
        """Return the type of an action; see `message`."""
        try:
            return self._store.action(name)
        except UnknownPackageError as error:
            return OpaqueActionType(self._relay(name, "goals of this action", error))

    def _relay(self, name: str, what: str, error: UnknownPackageError) -> str:
        """Log once that a type of an unknown package is relayed; return its canonical name.

        Raises:
            UnknownPackageError: the given one, if such types are refused.
        """
        if self._is_strict:
            raise error
        canonical = self._store.canonical(name)
        resolve(canonical)  # as long as a name may be
        if (canonical, what) not in self._logged:
            if len(self._logged) >= MAX_REMEMBERED_TYPES:
                self._logged.clear()
            self._logged[canonical, what] = None
            near = self._store.near_package(canonical)
            _log.warning("%s: its package is unknown%s; %s are relayed unchecked", canonical, near, what)
        return canonical
