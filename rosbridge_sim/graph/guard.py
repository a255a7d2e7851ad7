"""Internal errors, in this package or in a library: only the owner concerned is affected.

    a message cannot be encoded     it is dropped for that encoding and its publisher is told; no connection closes
    work for one owner fails        only that owner ends (`Guarded.fail`): a client is closed with code 1011, a bridge
                                    is dialled again, a recording ends; all others go on
    work for all owners fails       the request that caused it is lost, and its sender is told; the service stays
    anything else                   it is logged and counted, and the rest goes on

Every error is logged with its traceback and counted. A failed encoding is logged once for each type and reason.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import ParamSpec, Protocol, runtime_checkable

from rosbridge_sim.errors import EncodingError

MAX_LOGGED_FAILURES = 1_000
"""Encoding failures that are remembered, so that each is logged once. More of them are only counted."""

P = ParamSpec("P")

_log = logging.getLogger("rosbridge_sim.graph")


@runtime_checkable
class Guarded(Protocol):
    """An owner that represents one client, bridge or recording, and so can be ended alone."""

    def fail(self, error: Exception) -> None:
        """End, because work for this owner has failed. Must not raise, and may be called again."""


class Guard:
    """Counts and logs the internal errors of one bus.

    Attributes:
        num_faults: number of all internal errors; each is counted here once.
    """

    def __init__(self) -> None:
        self.num_faults = 0
        self._logged: set[tuple[str, str]] = set()

    def blame(self, concerned: object, error: Exception) -> None:
        """End the owner whose work has failed.

        Raises:
            Exception: `error` itself, if this owner cannot be ended alone. The caller must log and count it.
        """
        if not isinstance(concerned, Guarded):
            raise error
        try:
            concerned.fail(error)
        except Exception as second:
            if second is error:
                raise
            self.note("the end of an owner", second)  # the log shows the first failure as its context
        self.num_faults += 1

    def contain(self, concerned: object, error: Exception) -> None:
        """End the owner whose work has failed; log and count the failure if that is not possible.

        For work on behalf of another owner, which must not see this failure.
        """
        if isinstance(concerned, Guarded):
            self.blame(concerned, error)
        else:
            self.note("something that was done for a part of the server", error)

    def attempt(self, what: str, act: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> None:
        """Call a function; log and count its failure, because the rest must still be done.

        Args:
            what: name of the work, for the log.
        """
        try:
            act(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - any internal error
            self.note(what, error)

    def note(self, what: str, error: Exception) -> None:
        """Log and count an internal error that affects no owner.

        Args:
            what: name of the failed work.
        """
        self.num_faults += 1
        _log.error("%s has failed; this is a bug of ours, and the rest goes on", what, exc_info=error)

    def note_encoding(self, where: str, error: EncodingError) -> None:
        """Log and count a message that could not be encoded for a subscriber.

        Args:
            where: the topic or service.
            error: the failure; its cause is the error of the encoder.
        """
        self.num_faults += 1
        key = (where, str(error))
        if key not in self._logged and len(self._logged) < MAX_LOGGED_FAILURES:
            self._logged.add(key)
            _log.error("%s: a message is dropped: %s", where, error, exc_info=error)
