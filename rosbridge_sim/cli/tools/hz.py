"""`topic hz`: rate and regularity of a topic's messages."""

from __future__ import annotations

import itertools
import math
import sys
from collections import deque
from dataclasses import dataclass
from typing import Self

from rosbridge_sim.cli.tools.sync_commands import why_silent
from rosbridge_sim.cli.tools.text import put, put_json
from rosbridge_sim.cli.tools.tool_client import Bridge, absolute
from rosbridge_sim.cli.tools.tool_subscription import Listener

__all__ = ["Rate", "Rates", "show_rate"]

REPORT_INTERVAL = 1.0
"""Time between two reports [s]."""

MAX_WINDOW = 50_000
"""Default number of messages to measure over: a quarter of an hour at 50 Hz."""


@dataclass(frozen=True, slots=True)
class Rate:
    """Statistics of the last intervals between messages.

    Attributes:
        rate: mean rate [Hz].
        shortest, longest: shortest and longest interval [s].
        deviation: standard deviation of the intervals [s].
        num_messages: number of messages in the measurement.
    """

    rate: float
    shortest: float
    longest: float
    deviation: float
    num_messages: int

    def __str__(self) -> str:
        return (
            f"average rate: {self.rate:.3f} Hz  min: {self.shortest:.4f} s  max: {self.longest:.4f} s"
            f"  std dev: {self.deviation:.5f} s  window: {self.num_messages}"
        )


class Rates:
    """Arrival times of the last messages."""

    def __init__(self, window: int = MAX_WINDOW) -> None:
        """Begin without messages.

        Args:
            window: number of messages to measure over; at least 2.
        """
        self._times: deque[float] = deque(maxlen=window)

    def add(self, now: float) -> None:
        """Add a message.

        Args:
            now: its arrival time [s].
        """
        self._times.append(now)

    def read(self) -> Rate | None:
        """Return the statistics; None before the second message."""
        times = list(self._times)
        if len(times) < 2:  # noqa: PLR2004 - an interval needs two messages
            return None
        intervals = [after - before for before, after in itertools.pairwise(times)]
        mean = (times[-1] - times[0]) / len(intervals)
        variance = sum((one - mean) ** 2 for one in intervals) / len(intervals)
        rate = 1 / mean if mean > 0 else math.inf
        return Rate(rate, min(intervals), max(intervals), math.sqrt(variance), len(times))


async def show_rate(
    bridge: Bridge,
    name: str,
    type_name: str | None,
    window: int | None,
    count: int | None,
    *,
    patience: float | None,
    is_json: bool,
) -> int:
    """Print the rate each second, and once more after `count` messages.

    Args:
        name: name of the topic.
        type_name: its type; None means that of an existing topic.
        window: number of messages to measure over; None means MAX_WINDOW.
        count: number of messages; None means no end.
        patience: longest wait for a message [s]; None means no limit.
        is_json: print one line of JSON per report.

    Raises:
        RefusedError: the topic does not exist, or no message came in time.
    """
    topic = absolute(name)
    listener = await Listener.open(bridge, topic, type_name)
    rates = Rates(window or MAX_WINDOW)
    num_messages = num_reported = 0
    report_at = bridge.now() + REPORT_INTERVAL
    give_up_at = math.inf if patience is None else bridge.now() + patience
    with _Line(is_json=is_json) as line:
        while num_messages != count:
            if await listener.next(min(report_at, give_up_at)) is not None:
                rates.add(bridge.now())
                num_messages += 1
                give_up_at = math.inf if patience is None else bridge.now() + patience
            elif patience is not None and bridge.now() >= give_up_at:
                raise await why_silent(bridge, topic, patience)
            if bridge.now() >= report_at:
                line.write(rates.read(), is_new=num_messages > num_reported)
                num_reported = num_messages
                report_at = max(report_at + REPORT_INTERVAL, bridge.now())
        line.write(rates.read(), is_new=True)
    return 0


class _Line:
    """Output of reports: in separate lines, or in one line of a terminal that is overwritten."""

    def __init__(self, *, is_json: bool) -> None:
        self._is_json = is_json
        self._is_terminal = not is_json and sys.stdout.isatty()
        self._is_open = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_open:
            put("")

    def write(self, rate: Rate | None, *, is_new: bool) -> None:
        """Print a report; `is_new` is True if a message came after the last one."""
        if self._is_json:
            fields = ("rate", "min", "max", "std_dev", "window")
            values = (rate.rate, rate.shortest, rate.longest, rate.deviation, rate.num_messages) if rate else ()
            put_json({**dict.fromkeys(fields), **dict(zip(fields, values, strict=False)), "is_new": is_new})
            return
        text = "no new messages" if rate is None or not is_new else str(rate)
        if self._is_terminal:
            sys.stdout.write(f"\r{text}\x1b[K")  # overwrite the last report, and erase its end
            sys.stdout.flush()
            self._is_open = True
        else:
            put(text)
