"""The type behind a name, also where nobody knows its package: then its messages are relayed unchecked."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable

from rosbridge_sim.errors import UnknownPackageError
from rosbridge_sim.graph.participant import resolve
from rosbridge_sim.schema.message_type import ActionType, MessageType, ServiceType
from rosbridge_sim.schema.opaque_types import OpaqueActionType, OpaqueServiceType, OpaqueType
from rosbridge_sim.schema.store import Store

__all__ = ["MAX_REMEMBERED_TYPES", "TypeResolver"]

MAX_REMEMBERED_TYPES = 10_000
"""Types that nobody knows, that are kept for their next user."""

_log = logging.getLogger("rosbridge_sim.graph")


class TypeResolver:
    """The types of one bus: those of its store, and opaque ones for packages that nobody knows."""

    def __init__(
        self, store: Store, types_in_use: Callable[[], Iterable[MessageType | OpaqueType]], *, is_strict: bool
    ) -> None:
        """No unknown type has been asked for.

        Args:
            store: the types that are known.
            types_in_use: the types of all topics; those of unknown packages among them are not forgotten.
            is_strict: refuse types of packages that nobody knows, in place of relaying them unchecked.
        """
        self._store = store
        self._types_in_use = types_in_use
        self._is_strict = is_strict
        self._opaque: dict[str, OpaqueType] = {}
        self._tidy_at = 0
        self._logged: dict[tuple[str, str], None] = {}  # services and actions, once each is in the log

    def message(self, name: str) -> MessageType | OpaqueType:
        """The type of a message; one that is only relayed where its whole package is unknown.

        Raises:
            GraphError: the name is too long.
            TypeNameError: the type cannot be had.
        """
        try:
            return self._store.message(name)
        except UnknownPackageError:
            if self._is_strict:
                raise
        canonical = self._store.canonical(name)
        opaque = self._opaque.get(canonical)
        if opaque is None:
            resolve(canonical)  # as long as a name may be
            if len(self._opaque) >= self._tidy_at:
                self._opaque = {each.name: each for each in self._types_in_use() if type(each) is OpaqueType}
                # not again before half as many have come, so that each type costs a constant amount of looking
                self._tidy_at = max(MAX_REMEMBERED_TYPES, len(self._opaque) * 3 // 2 + 1)
            opaque = self._opaque[canonical] = OpaqueType(canonical)
            near = self._store.near_package(canonical)
            _log.warning("%s: its package is unknown%s; messages of this type are relayed unchecked", canonical, near)
        return opaque

    def service(self, name: str) -> ServiceType | OpaqueServiceType:
        """The type of a service; one that is only relayed where its whole package is unknown.

        Raises:
            GraphError: the name is too long.
            TypeNameError: the type cannot be had.
        """
        try:
            return self._store.service(name)
        except UnknownPackageError:
            if self._is_strict:
                raise
        return OpaqueServiceType(self._log_unknown(name, "calls of this service"))

    def action(self, name: str) -> ActionType | OpaqueActionType:
        """The type of an action; one that is only relayed where its whole package is unknown.

        Raises:
            GraphError: the name is too long.
            TypeNameError: the type cannot be had.
        """
        try:
            return self._store.action(name)
        except UnknownPackageError:
            if self._is_strict:
                raise
        return OpaqueActionType(self._log_unknown(name, "goals of this action"))

    def _log_unknown(self, name: str, what: str) -> str:
        """Log once that a type of an unknown package is relayed; return its one spelling."""
        canonical = self._store.canonical(name)
        resolve(canonical)  # as long as a name may be
        if (canonical, what) not in self._logged:
            if len(self._logged) >= MAX_REMEMBERED_TYPES:
                self._logged.clear()
            self._logged[canonical, what] = None
            near = self._store.near_package(canonical)
            _log.warning("%s: its package is unknown%s; %s are relayed unchecked", canonical, near, what)
        return canonical
