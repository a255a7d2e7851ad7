"""Limits for the log, so that no client can fill a disk with lines.

Most lines are caused by clients: connections, status ops, mistakes. So each source of lines has a token bucket. Sources
are the client, if a line names one (`extra={"client": address}`), and the place in the code. A line beyond the limit is
dropped, and every few seconds one line says how many were dropped. Long lines are shortened.
The limits are filters of the loggers, not of a handler. So one decision protects stderr, `/rosout`, and the handlers of
a program that runs the server inside itself.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rosbridge_sim.shell.monitoring.masking import Mask, mask_of

LOGGERS: Final = tuple(
    f"rosbridge_sim{name}"
    for name in (
        *("", ".app", ".attach", ".bus", ".campaign", ".client", ".graph", ".mock", ".morai"),
        *(".page", ".recording", ".replay", ".ros1", ".ros2", ".server", ".storage", ".websockets"),
    )
)
"""All loggers of this package; a filter of a logger does not apply to its child loggers."""

MAX_LINE: Final = 500
"""Longest line [characters]; only a line with a client's text is longer."""

MAX_TRACEBACK: Final = 10_000
"""Longest traceback [characters]; its middle is removed first."""

TRACEBACK_COST: Final = 10
"""Number of lines that a traceback counts as."""

CLIENT_BURST, CLIENT_RATE = 50.0, 1.0
"""Lines of one client at once, and per second. A burst is useful, and one line per second is at most 50 MB a day."""

PLACE_BURST, PLACE_RATE = 200.0, 5.0
"""Lines from one place in the code at once, and per second, for all clients. Two hundred clients may connect at once,
with one line each."""

SUMMARY_PERIOD: Final = 10.0
"""Time between two lines that say how many were dropped [s]."""

MAX_SOURCES: Final = 1_000
"""Largest number of known sources; the one that was silent longest is forgotten."""

_log = logging.getLogger("rosbridge_sim.log")  # needs no limit: it writes one line per period
_formatter = logging.Formatter()


@dataclass(slots=True)
class _Source:
    """The source of lines: a client or a place in the code."""

    rate: float
    burst: float
    tokens: float
    at: float
    num_left_out: int = 0

    def has_token(self, now: float) -> bool:
        """Return True if another line may be written at monotonic time `now` [s]."""
        self.tokens = min(self.burst, self.tokens + (now - self.at) * self.rate)
        self.at = now
        return self.tokens >= 1.0


class LineLimiter(logging.Filter):
    """A filter that drops and shortens lines, from `start` to `stop`."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        clock: Callable[[], float] | None = None,
        *,
        mask: Mask = mask_of(None),  # noqa: B008 - the default has no state
    ) -> None:
        """Create a limiter that is not active yet.

        Args:
            loop: runs the timer for lines about dropped lines.
            clock: monotonic time [s]; None means that of the loop.
            mask: removes the token from lines with clients' texts.
        """
        super().__init__()
        self._mask = mask
        self._loop = loop
        self._clock = clock or loop.time
        self._sources: dict[str, _Source] = {}
        self._num_forgotten = 0  # dropped lines of forgotten sources
        self._level = logging.NOTSET  # the most severe level of the dropped lines
        self._lock = threading.Lock()  # threads that read replays write log lines, too
        self._timer: asyncio.TimerHandle | None = None

    def start(self) -> None:
        """Begin to limit the log of this package in this process."""
        for name in LOGGERS:
            logging.getLogger(name).addFilter(self)
        self._timer = self._loop.call_later(SUMMARY_PERIOD, self._tick)

    def stop(self) -> None:
        """End the limits. A second call does nothing."""
        for name in LOGGERS:
            logging.getLogger(name).removeFilter(self)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.flush()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return True if a line is written; shorten it if needed. Must not raise, because the caller only logs."""
        try:
            return self._judge(record)
        except Exception:  # noqa: BLE001 - e.g. values that do not fit the text; handlers report that on stderr
            return True

    def _judge(self, record: logging.LogRecord) -> bool:
        if record.levelno < logging.CRITICAL:
            with self._lock:
                if not self._admit(record):
                    return False
        _cut(record, self._mask)
        return True

    def flush(self) -> None:
        """Log one line about the lines dropped since the last call, if there are any."""
        with self._lock:
            left_out = {name: source.num_left_out for name, source in self._sources.items() if source.num_left_out}
            num_lines = sum(left_out.values()) + self._num_forgotten
            level, self._level, self._num_forgotten = self._level, logging.NOTSET, 0
            for name in left_out:
                self._sources[name].num_left_out = 0
        if num_lines:
            most = max(left_out, key=left_out.__getitem__, default="clients that are gone")
            num_others = len(left_out) - 1
            others = "" if num_others < 1 else " and 1 other" if num_others == 1 else f" and {num_others} others"
            _log.log(level, "... %s more lines of %s%s were left out", f"{num_lines:,}", most, others)

    def _tick(self) -> None:
        self._timer = self._loop.call_later(SUMMARY_PERIOD, self._tick)
        self.flush()

    def _admit(self, record: logging.LogRecord) -> bool:
        """Take the line's tokens, or count it as dropped."""
        now = self._clock()
        sources = [self._source(f"{record.filename}:{record.lineno}", PLACE_RATE, PLACE_BURST, now)]
        client = record.__dict__.get("client")
        if client:
            sources.append(self._source(str(client), CLIENT_RATE, CLIENT_BURST, now))
        for source in reversed(sources):
            if not source.has_token(now):
                source.num_left_out += 1
                self._level = max(self._level, record.levelno)
                return False
        for source in sources:
            source.tokens -= TRACEBACK_COST if record.exc_info else 1
        return True

    def _source(self, name: str, rate: float, burst: float, now: float) -> _Source:
        source = self._sources.pop(name, None)
        if source is None:
            source = _Source(rate, burst, burst, now)
            if len(self._sources) >= MAX_SOURCES:
                oldest = self._sources.pop(next(iter(self._sources)))
                self._num_forgotten += oldest.num_left_out
        self._sources[name] = source
        return source


def _cut(record: logging.LogRecord, mask: Mask) -> None:
    whole = record.getMessage()
    text = mask(whole)
    if len(text) > MAX_LINE:
        text = f"{text[:MAX_LINE]}... ({len(text) - MAX_LINE:,} more characters)"
    if text != whole:
        record.msg, record.args = text, ()
    if record.exc_info and not record.exc_text:
        whole = _formatter.formatException(record.exc_info)
        trace = mask(whole)
        if trace != whole:
            record.exc_text = trace
        if len(trace) > MAX_TRACEBACK:
            half = MAX_TRACEBACK // 2
            record.exc_text = f"{trace[:half]}\n... ({len(trace) - 2 * half:,} more characters)\n{trace[-half:]}"
