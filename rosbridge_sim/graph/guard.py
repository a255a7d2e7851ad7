"""Failures of our own code, or of a library below it: only the owner that is concerned is hurt.

    a message cannot be encoded     it is dropped for that encoding and its publisher is told; nobody is closed
    what belongs to one owner       that owner alone ends (`Guarded.fail`): a client is closed with code 1011, a bridge
    fails                           is dialled anew, a recording ends; all others go on
    what serves all fails           the request that met the failure is lost, and its sender is told; the service stays
    anything else                   it is logged and counted, and the rest goes on

Everything is logged with its traceback, a failure of encoding once for each type and reason, and counted.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import ParamSpec, Protocol, runtime_checkable

from rosbridge_sim.errors import EncodingError

__all__ = ["Guard", "Guarded"]

MAX_LOGGED_FAILURES = 1_000
"""Failures of encoding that are remembered, so that each is logged once; beyond them they are only counted."""

P = ParamSpec("P")

_log = logging.getLogger("rosbridge_sim.graph")


@runtime_checkable
class Guarded(Protocol):
    """An owner that stands for one client, bridge or recording, and so can end alone."""

    def fail(self, error: Exception) -> None:
        """End, because something that was done for it has failed. Must not raise, and may be called again."""


class Guard:
    """Counts and logs the failures of one bus.

    Attributes:
        num_faults: failures in all, each counted once, here and nowhere else.
        num_unencoded: messages among them that could not be encoded, each counted for each listener.
    """

    def __init__(self) -> None:
        self.num_faults = 0
        self.num_unencoded = 0
        self._logged: set[tuple[str, str]] = set()

    def blame(self, concerned: object, error: Exception) -> None:
        """End the owner whose state has failed.

        Args:
            concerned: an owner of the bus.
            error: the failure.

        Raises:
            Exception: `error` itself, which the caller has to log and count: this owner cannot end alone.
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
        """End the owner whose state has failed; where it cannot end alone, log and count the failure.

        For what is done on behalf of another owner, which must not hear of it.
        """
        if isinstance(concerned, Guarded):
            self.blame(concerned, error)
        else:
            self.note("something that was done for a part of the server", error)

    def attempt(self, what: str, act: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> None:
        """Do something whose failure must not keep the rest from being done.

        Args:
            what: the thing done, for the log.
            act: does it.
            *args: its arguments.
            **kwargs: those with names.
        """
        try:
            act(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - a bug of ours, whatever it is
            self.note(what, error)

    def note(self, what: str, error: Exception) -> None:
        """Log and count a failure that concerns nobody else."""
        self.num_faults += 1
        _log.error("%s has failed; this is a bug of ours, and the rest goes on", what, exc_info=error)

    def note_encoding(self, where: str, error: EncodingError) -> None:
        """Log and count a message that could not be encoded for a listener.

        Args:
            where: the topic or service.
            error: the failure; its cause is what the encoder raised.
        """
        self.num_unencoded += 1
        self.num_faults += 1
        key = (where, str(error))
        if key not in self._logged and len(self._logged) < MAX_LOGGED_FAILURES:
            self._logged.add(key)
            _log.error("%s: a message is dropped: %s", where, error, exc_info=error)
