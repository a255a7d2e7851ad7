"""Mistakes of clients, for the authors of these clients: lines in the log, and the list behind `/sim/refusals`.

A client is told about each mistake by a status or an answer, but many client libraries show neither. So the log has a
WARNING line for each client and reason. The first refusal is logged at once. Those of the same client and reason in the
next ten seconds share one line, with their number and the last text. Reasons are fixed words of the server
(`errors.Reason`), so no client can create lines with new texts. The limits of all log lines (`log_limits.py`) also
apply.
A refusal within these ten seconds costs 2 us to 5 us: it is counted, and its text is shortened but only escaped when it
is shown.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.shell.monitoring.masking import Mask, mask_of

REFUSALS_PERIOD: Final = 10.0
"""Time for which refusals of one client and reason share a line [s]: a wrong publish at 50 Hz gives six lines a minute.
"""

MAX_REFUSAL_TEXT: Final = 300
"""Characters of a text that are shown; the server's own texts are longer only if they quote a long text."""

MAX_REFUSED_NAME: Final = 100
"""Characters of a topic's or service's name that are shown."""

MAX_KINDS: Final = 2_000
"""Largest number of known pairs of client and reason, about 300 bytes each. The oldest is forgotten first."""

MAX_CLIENTS: Final = 20
"""Clients whose refusals are kept: more programs than a user debugs at once."""

MAX_KEPT: Final = 10
"""Refusals that are kept of one client, so that a client with many does not hide those of others."""

MAX_COUNT: Final = 2**32 - 1
"""Largest number that the message's field for equal refusals in a row can hold."""

_log = logging.getLogger("rosbridge_sim.server")


@dataclass(slots=True)
class _Kind:
    """The refusals of one client for one reason in the current period.

    Attributes:
        until: end of the period [s].
        last: the last refusal that is not logged yet.
        num_unsaid: number of refusals that are not logged yet.
    """

    until: float
    last: RefusedRequest
    num_unsaid: int = 0


@dataclass(slots=True)
class Noted:
    """A refusal that is kept, with its number of repetitions.

    Attributes:
        order: its position among all refusals.
        stamp_ns: time of the last one [ns, time of day].
        frame: frame number of the world at that time; -1 without a world.
        count: number of equal refusals in a row.
    """

    request: RefusedRequest
    order: int
    stamp_ns: int
    frame: int
    count: int = 1

    def fields(self, show: Callable[[str], str] = str) -> dict[str, str | int]:
        """Return what is told of it, beside the time.

        Args:
            show: writes texts of clients.
        """
        request = self.request
        return {
            "frame": self.frame,
            "client": request.client,
            "reason": request.reason.value,
            "op": request.op,
            "subject": show(request.subject),
            "text": show(request.text),
            "count": min(self.count, MAX_COUNT),
        }


class RefusalLog:
    """Logs and keeps the refused requests of clients.

    Attributes:
        on_change: called after each refusal.
        total: number of refusals since the start.
        counts: number of refusals by reason.
        mask: removes the token from texts.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        frame: Callable[[], int] = lambda: -1,
        *,
        is_quiet: bool = False,
        clock: Callable[[], float] | None = None,
        mask: Mask = mask_of(None),  # noqa: B008 - the default has no state
    ) -> None:
        """Create a log without refusals.

        Args:
            loop: runs the timer that ends the periods.
            frame: returns the frame number of the world.
            is_quiet: keep refusals, but write no lines.
            clock: monotonic time [s]; None means that of the loop.
            mask: removes the token from clients' texts.
        """
        self.on_change: Callable[[], None] = lambda: None
        self.total = 0
        self.counts = dict.fromkeys(Reason, 0)
        self._loop = loop
        self._clock = clock or loop.time
        self._frame = frame
        self._is_quiet = is_quiet
        self.mask = mask
        self._kinds: dict[tuple[str, Reason], _Kind] = {}
        self._kept: dict[str, deque[Noted]] = {}
        self._timer: asyncio.TimerHandle | None = None

    def stop(self) -> None:
        """Write the lines that are left, and none later."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.flush(float("inf"))

    def note(self, request: RefusedRequest) -> None:
        """Record a refusal."""
        self.total += 1
        self.counts[request.reason] += 1
        if request.text != (text := self.mask(request.text)) or request.subject != self.mask(request.subject):
            request = request._replace(text=text, subject=self.mask(request.subject))
        request = _shorten(request)  # before the comparison, so that a repeated long text counts as equal
        self._keep(request)
        if not self._is_quiet:
            self._say_or_count(request)
        self.on_change()

    def kept(self) -> list[Noted]:
        """Return the kept refusals, oldest first."""
        return sorted((noted for each in self._kept.values() for noted in each), key=lambda noted: noted.order)

    def flush(self, now: float) -> None:
        """Write a line for each ended period that has refusals without a line."""
        for key, kind in list(self._kinds.items()):
            if kind.until > now:
                continue
            if not kind.num_unsaid:
                del self._kinds[key]
                continue
            request = kind.last
            more = f"{kind.num_unsaid:,} more {_verb(request)} ({request.reason.value}), the last one: {_line(request)}"
            _log.warning("%s: %s", request.client, more, extra={"client": request.client})
            kind.until, kind.num_unsaid = now + REFUSALS_PERIOD, 0

    def _keep(self, request: RefusedRequest) -> None:
        kept = self._kept.pop(request.client, None)
        if kept is None:
            kept = deque(maxlen=MAX_KEPT)
            if len(self._kept) >= MAX_CLIENTS:
                del self._kept[next(iter(self._kept))]
        self._kept[request.client] = kept
        last = kept[-1] if kept else None
        stamp_ns, frame = time.time_ns(), self._frame()
        if last is not None and last.request == request:
            last.order, last.stamp_ns, last.frame, last.count = self.total, stamp_ns, frame, last.count + 1
        else:
            kept.append(Noted(request, self.total, stamp_ns, frame))

    def _say_or_count(self, request: RefusedRequest) -> None:
        """Write a line now, or count the refusal for the line at the end of the period."""
        now = self._clock()
        key = (request.client, request.reason)
        kind = self._kinds.get(key)
        if kind is not None and (now < kind.until or kind.num_unsaid):
            kind.num_unsaid += 1
            kind.last = request
            return
        self._kinds.pop(key, None)
        if len(self._kinds) >= MAX_KINDS:
            del self._kinds[next(iter(self._kinds))]
        self._kinds[key] = _Kind(now + REFUSALS_PERIOD, request)
        text = f"{_line(request)} ({request.reason.value})"
        _log.warning("%s: %s: %s", request.client, _verb(request), text, extra={"client": request.client})
        if self._timer is None:
            self._timer = self._loop.call_later(REFUSALS_PERIOD, self._end_periods)

    def _end_periods(self) -> None:
        self._timer = None
        self.flush(self._clock())
        if self._kinds:
            self._timer = self._loop.call_later(REFUSALS_PERIOD, self._end_periods)


def cut(text: str, max_length: int = MAX_REFUSAL_TEXT) -> str:
    """Return a text, or both ends of a text that is too long, because the advice of an error is at its end.

    Args:
        max_length: longest result [characters].
    """
    if len(text) <= max_length:
        return text
    end = max_length // 3
    return f"{text[: max_length - end - 5]} ... {text[-end:]}"


def escape(text: str, max_length: int = MAX_REFUSAL_TEXT) -> str:
    """Return a client's text as one printable line.

    Args:
        max_length: longest result [characters].
    """
    shown = cut(text, max_length)
    return shown if shown.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in shown)


def _verb(request: RefusedRequest) -> str:
    """Return what was done with a request: one with a warning was not refused as a whole."""
    return "warned" if request.reason is Reason.WARNING else "refused"


def _line(request: RefusedRequest) -> str:
    """Return op, subject and text; a text that begins with the subject does not repeat it."""
    text = request.text.removeprefix(f"{request.subject}: ")
    what = f"{request.op} {escape(request.subject, MAX_REFUSED_NAME)}".strip()
    return f"{what}: {escape(text)}" if what else escape(text)


def _shorten(request: RefusedRequest) -> RefusedRequest:
    """Return the same refusal with texts that are only as long as they are shown."""
    if len(request.text) <= MAX_REFUSAL_TEXT and len(request.subject) <= MAX_REFUSED_NAME:
        return request
    return request._replace(text=cut(request.text), subject=cut(request.subject, MAX_REFUSED_NAME))
