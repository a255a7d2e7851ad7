"""`topic hz`, `bw` and `delay`: rate, size and age of a topic's messages."""

from __future__ import annotations

import itertools
import math
import re
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import ClassVar, Final, Self, TypeAlias

from rosbridge_sim.cli.tools.sync_commands import why_silent
from rosbridge_sim.cli.tools.text import note, put, put_json
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute
from rosbridge_sim.cli.tools.tool_subscription import Listener, stamp_of
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.json_with_words import to_json
from rosbridge_sim.link.terminal_text import safe

REPORT_INTERVAL = 1.0
"""Time between two reports [s]."""

MAX_WINDOW = 50_000
"""Default number of messages to measure over: a quarter of an hour at 50 Hz."""


Statistics: TypeAlias = dict[str, float]
"""Figures of the last messages, by their names in JSON."""


def _bytes(number: float) -> str:
    """Return a number of bytes with one of the units of `ros2 topic bw`."""
    for unit in ("B", "KB", "MB"):
        if number < 1000:  # noqa: PLR2004 - as there
            return f"{number:.{0 if unit == 'B' and number == int(number) else 2}f} {unit}"
        number /= 1000
    return f"{number:.2f} GB"


# Meters


class Meter:
    """A measurement over the last messages.

    Attributes:
        form: the statistics in words, each at its name in JSON; the last one is the number of messages.
    """

    form: ClassVar[str]

    def __init__(self, window: int = MAX_WINDOW) -> None:
        """Begin without messages.

        Args:
            window: number of messages to measure over; at least 2.
        """
        self._samples: deque[tuple[float, float]] = deque(maxlen=window)

    @property
    def fields(self) -> list[str]:
        """Names of the statistics."""
        return re.findall(r"{(\w+)", self.form)

    def add(self, now: float, value: float = 0.0) -> None:
        """Add a message.

        Args:
            now: its arrival time [s].
            value: its size [B] or delay [s], if that is what is measured.
        """
        self._samples.append((now, value))

    def read(self) -> Statistics | None:
        """Return the statistics; None while there are too few messages."""
        if len(self._samples) < 2:  # noqa: PLR2004 - an interval has two ends
            return None
        times, values = zip(*self._samples, strict=True)
        return dict(zip(self.fields, (*self._judge(times, values), len(times)), strict=True))

    def _judge(self, times: Sequence[float], values: Sequence[float]) -> tuple[float, ...]:
        """Return the statistics of at least two messages, without their number."""
        raise NotImplementedError

    def text(self, report: Statistics) -> str:
        """Return the statistics in words."""
        return self.form.format(**report)

    async def prepare(self, listener: Listener) -> None:
        """Prepare the measurement before the first message."""

    def value_of(self, _msg: Frame, _listener: Listener) -> float | None:
        """Return a message's value; None if it does not count."""
        return 0.0


class Rates(Meter):
    """Mean rate [Hz], and the intervals between arrivals with their standard deviation [s]."""

    form = "average rate: {rate:.3f} Hz  min: {min:.4f} s  max: {max:.4f} s  std dev: {std_dev:.5f} s  window: {window}"

    def _judge(self, times: Sequence[float], _values: Sequence[float]) -> tuple[float, ...]:
        intervals = [after - before for before, after in itertools.pairwise(times)]
        mean, deviation = _mean(intervals)
        return 1 / mean if mean > 0 else math.inf, min(intervals), max(intervals), deviation


class Bandwidths(Meter):
    """Bytes per second [B/s], and sizes of messages as JSON, which is how they come [B]."""

    form = "average: {rate}/s  mean: {mean}  min: {min}  max: {max}  window: {window}"

    def _judge(self, times: Sequence[float], values: Sequence[float]) -> tuple[float, ...]:
        span = times[-1] - times[0]
        rate = sum(values[1:]) / span if span > 0 else math.inf
        return rate, _mean(values)[0], min(values), max(values)

    def text(self, report: Statistics) -> str:
        """Return the statistics in words, with units."""
        return self.form.format(**report | {name: _bytes(report[name]) for name in self.fields[:-1]})

    def value_of(self, msg: Frame, _listener: Listener) -> float:
        """Return a message's size [B]."""
        return len(to_json(msg))


class Delays(Meter):
    """Delays: time of the arrival minus the stamp in the header [s].

    The time of the arrival is the last message on the server's `/clock`: simulated time, or with `--stamps wall` the
    time of day. If the server has no `/clock`, it is the time of day of this machine.
    """

    form = "average delay: {mean:.3f} s  min: {min:.3f} s  max: {max:.3f} s  std dev: {std_dev:.5f} s  window: {window}"

    def _judge(self, _times: Sequence[float], values: Sequence[float]) -> tuple[float, ...]:
        mean, deviation = _mean(values)
        return mean, min(values), max(values), deviation

    async def prepare(self, listener: Listener) -> None:
        """Subscribe to the clock, and print the definition of the delay."""
        clock = await listener.watch_clock()
        self._has_clock = clock is not None
        if clock is None:
            note(
                "delay = the time of day here - header.stamp: there is no /clock, so the clocks of both machines count"
            )
        else:
            note(f"delay = {clock} - header.stamp: the age of the content, without the time of the transport")

    def value_of(self, msg: Frame, listener: Listener) -> float | None:
        """Return a message's delay [s]; None before the first message of the clock.

        Raises:
            RefusedError: it has no stamp.
        """
        header = msg.get("header")
        if not isinstance(header, dict) or "stamp" not in header:
            raise RefusedError(f"no header.stamp in the messages of {safe(listener.topic)}, so they have no delay")
        now_ns = listener.clock_ns if self._has_clock else time.time_ns()
        return None if now_ns is None else (now_ns - stamp_of(header, "stamp")) / 1e9


def _mean(values: Sequence[float]) -> tuple[float, float]:
    """Return mean and standard deviation."""
    mean = sum(values) / len(values)
    return mean, math.sqrt(sum((one - mean) ** 2 for one in values) / len(values))


METERS: Final[dict[str, Callable[[int], Meter]]] = {"hz": Rates, "bw": Bandwidths, "delay": Delays}
"""Name of the command -> its meter."""


async def measure(
    bridge: Bridge,
    command: str,
    name: str,
    type_name: str | None,
    *,
    window: int | None,
    count: int | None,
    patience: float | None,
    is_json: bool,
) -> None:
    """Print the statistics each second, and once more after `count` messages.

    Args:
        command: key of `METERS`.
        window: number of the last messages to measure over; None means all that fit.
        type_name: its type; None means that of an existing topic.
        count: number of messages; None means no end.
        patience: longest wait for a message [s]; None means no limit.
        is_json: print one line of JSON per report.

    Raises:
        RefusedError: the topic does not exist, has no such value, or no message came in time.
    """
    meter = METERS[command](window or MAX_WINDOW)
    topic = absolute(name)
    listener = await Listener.open(bridge, topic, type_name)
    await meter.prepare(listener)
    num_messages = num_reported = 0
    report_at = bridge.now() + REPORT_INTERVAL
    longest = math.inf if patience is None else patience
    give_up_at = bridge.now() + longest
    with _Line(meter, is_json=is_json) as line:
        while num_messages != count:
            msg = await listener.next(min(report_at, give_up_at))
            if msg is not None:
                value = meter.value_of(msg, listener)
                if value is not None:
                    meter.add(bridge.now(), value)
                    num_messages += 1
                give_up_at = bridge.now() + longest
            elif bridge.now() >= give_up_at:
                raise await why_silent(bridge, topic, longest)
            if bridge.now() >= report_at:
                line.write(is_new=num_messages > num_reported)
                num_reported = num_messages
                report_at = max(report_at + REPORT_INTERVAL, bridge.now())
        line.write(is_new=True)


class _Line:
    """Output of reports: in separate lines, or in one line of a terminal that is overwritten."""

    def __init__(self, meter: Meter, *, is_json: bool) -> None:
        self._meter = meter
        self._is_json = is_json
        self._is_terminal = not is_json and sys.stdout.isatty()
        self._is_open = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_open:
            put("")

    def write(self, *, is_new: bool) -> None:
        """Print a report; `is_new` is True if a message came after the last one."""
        report = self._meter.read()
        if self._is_json:
            put_json({**(report or dict.fromkeys(self._meter.fields)), "is_new": is_new})
            return
        text = "no new messages" if report is None or not is_new else self._meter.text(report)
        if self._is_terminal:
            sys.stdout.write(f"\r{text}\x1b[K")  # overwrite the last report, and erase its end
            sys.stdout.flush()
            self._is_open = True
        else:
            put(text)
