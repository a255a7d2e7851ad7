"""Patterns of values over time, such as `$sine`: functions of the number and the time of a message.

Each value depends on the mock's seed and on the message alone, not on the messages that were sent before: a message
without a subscriber is not made. A random walk makes up for the steps that it has missed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import msgspec
import numpy as np

from rosbridge_sim.mock.mock_model import CounterPattern, RampPattern, SinePattern, WalkPattern

SECOND_NS: Final = 1_000_000_000

MAX_STEPS_AT_ONCE: Final = 100_000
"""Steps of a walk that are made in one array: 1 MB."""


class MessageTime(msgspec.Struct, frozen=True):
    """The message that is to be made.

    Attributes:
        number: of the message, from 0.
        time_ns: time since the start of the mock [ns].
        stamp: value of a `time` field, for its headers.
        request: of an answer, the request; of feedback and a result, the goal.
    """

    number: int
    time_ns: int
    stamp: Any
    request: Any = None


Part = Callable[[MessageTime], Any]
"""Returns the value of a field."""


class ConstantPart:
    """A part that always has the same value."""

    def __init__(self, value: Any) -> None:  # noqa: ANN401 - of any field
        self.value = value

    def __call__(self, _moment: MessageTime) -> Any:  # noqa: ANN401 - as above
        """Return the value."""
        return self.value


def make_sine(options: SinePattern) -> Part:
    """Return a sine over time."""
    turn = 2.0 * math.pi / (options.period * SECOND_NS)
    amplitude, phase, offset = options.amplitude, options.phase, options.offset
    return lambda moment: offset + amplitude * math.sin(moment.time_ns * turn + phase)


def make_ramp(options: RampPattern) -> Part:
    """Return a ramp over time."""
    length_ns = round(options.seconds * SECOND_NS)
    start, rise, is_repeated = options.start, options.end - options.start, options.repeat

    def ramp(moment: MessageTime) -> float:
        passed_ns = moment.time_ns % length_ns if is_repeated else min(moment.time_ns, length_ns)
        return start + rise * (passed_ns / length_ns)

    return ramp


def make_counter(options: CounterPattern) -> Part:
    """Return a counter of messages."""
    start, step, end = options.start, options.step, options.end
    if end is None:
        return lambda moment: start + step * moment.number
    length = (end - start) // step + 1
    return lambda moment: start + step * (moment.number % length)


def make_cycle(entries: Sequence[Part]) -> Part:
    """Return the parts one after another, again and again."""
    num = len(entries)
    return lambda moment: entries[moment.number % num](moment)


class RandomWalk:
    """A random walk. Its value at a message is the same whether the messages before were made or not."""

    def __init__(self, options: WalkPattern, seed: Sequence[int]) -> None:
        self._options = options
        self._random = np.random.default_rng(seed)
        self._number = 0
        self._free = options.start  # without bounds, which reflect: folding the sum is the same as reflecting each step

    def __call__(self, moment: MessageTime) -> float:
        """Return the value at a message; not before one that was asked for earlier."""
        while self._number < moment.number:
            num = min(moment.number - self._number, MAX_STEPS_AT_ONCE)
            self._number += num
            steps = self._random.standard_normal(num) * self._options.step
            steps[0] += self._free
            self._free = float(np.add.accumulate(steps)[-1])  # one by one, as steps that are made singly
        low, high = self._options.low, self._options.high
        if low is None or high is None:
            return self._free
        passed = (self._free - low) % (2.0 * (high - low))
        return low + min(passed, 2.0 * (high - low) - passed)
