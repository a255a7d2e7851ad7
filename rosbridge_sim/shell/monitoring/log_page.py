"""The page `/log.json`: the last mistakes of clients and warnings of the server, for those without the web page.

Refusals are those of `/sim/refusals`. Warnings are lines of the log from level warning on, without those that tell of a
refusal. At most 200 of each are kept, and each text is cut, so the page has at most about 300 kB.
"""

from __future__ import annotations

import json
import logging
from collections import deque
from typing import Final

from rosbridge_sim.shell.monitoring import refusal_log
from rosbridge_sim.shell.monitoring.refusal_log import RefusalLog, escape

MAX_WARNINGS: Final = 200
"""Warnings that are kept: as many as refusals."""


class LogPage(logging.Handler):
    """Keeps warnings, and writes the page."""

    def __init__(self, refusals: RefusalLog) -> None:
        """Keep the warnings of this process from now on, until `stop`.

        Args:
            refusals: of clients, with the mask that removes the token from texts.
        """
        super().__init__(logging.WARNING)
        self._refusals = refusals
        self._warnings: deque[dict[str, object]] = deque(maxlen=MAX_WARNINGS)
        logging.getLogger("rosbridge_sim").addHandler(self)

    def stop(self) -> None:
        """Keep no more warnings."""
        logging.getLogger("rosbridge_sim").removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a warning; may be called in any thread."""
        if record.pathname != refusal_log.__file__:
            self._warnings.append(
                {
                    "time": round(record.created, 3),
                    "level": record.levelname.lower(),
                    "logger": record.name,
                    "text": escape(self._refusals.mask(record.getMessage())),
                }
            )

    def render(self, *, has_warnings: bool) -> bytes:
        """Return the page as JSON: each list from the oldest to the newest one, times in seconds since 1970.

        Args:
            has_warnings: whether the asking program may read the log.
        """
        refusals = [{"time": round(noted.stamp_ns * 1e-9, 3), **noted.fields()} for noted in self._refusals.kept()]
        warnings = list(self._warnings) if has_warnings else []
        page = {"total_refusals": self._refusals.total, "refusals": refusals, "warnings": warnings}
        return f"{json.dumps(page)}\n".encode()
