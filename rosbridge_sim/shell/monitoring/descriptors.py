"""A watch over file descriptors: one log line when none is left, and not one for each refused connection.

Without free descriptors no client can connect and no file can be opened, but connected clients are served. Event loops
report this in different ways: asyncio logs each failed accept with a traceback, a hundred per second; uvloop closes new
connections without a message. So the watch tries to open a file once a second, and handles the loop's reports, too.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
from collections.abc import Callable
from typing import Any, Final

try:
    import resource  # imported at the start, because the import needs a descriptor
except ImportError:  # Windows does not have it, and the number of descriptors has no limit that could be read
    resource = None  # type: ignore[assignment] # as asked below


CHECK_PERIOD: Final = 1.0
"""Time between two checks [s]; one takes 10 us."""

QUIET: Final = 60.0
"""Shortest time between two log lines [s]."""

_log = logging.getLogger("rosbridge_sim.server")


class DescriptorWatch:
    """Logs a line when no descriptor is left, until `stop`."""

    def __init__(self, loop: asyncio.AbstractEventLoop, try_one: Callable[[], None] | None = None) -> None:
        """Start to watch.

        Args:
            try_one: uses a descriptor for a moment; raises OSError if there is none. None opens a file.
        """
        self._loop = loop
        self._try = try_one or _open_and_close
        self._told_at = float("-inf")
        self._timer = loop.call_later(CHECK_PERIOD, self._tick)

    def stop(self) -> None:
        """Stop watching. A second call does nothing."""
        self._timer.cancel()

    def take(self, _loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:  # Any: asyncio's own
        """Handle an error report of an event loop (`set_exception_handler`).

        Args:
            context: asyncio's description of the error.
        """
        error = context.get("exception")
        if not (isinstance(error, OSError) and self._tell(error)):
            self._loop.default_exception_handler(context)

    def _tick(self) -> None:
        self._timer = self._loop.call_later(CHECK_PERIOD, self._tick)
        try:
            self._try()
        except OSError as error:
            self._tell(error)

    def _tell(self, error: OSError) -> bool:
        """Log a lack of descriptors, but not too often; return True if the error is one."""
        if error.errno not in {errno.EMFILE, errno.ENFILE}:
            return False
        now = self._loop.time()
        if now - self._told_at >= QUIET:
            self._told_at = now
            _log.error(
                "no file descriptors are left%s: no client can connect and no file can be opened until some are free;"
                " close clients, or raise the limit (ulimit -n) and restart",
                _limit_of(error),
            )
        return True


def _open_and_close() -> None:
    os.close(os.open(os.devnull, os.O_RDONLY))


def _limit_of(error: OSError) -> str:
    """Return the reached limit in words."""
    if error.errno == errno.ENFILE:
        return " on this machine"
    return f" (this process may have {resource.getrlimit(resource.RLIMIT_NOFILE)[0]:,})" if resource else ""
