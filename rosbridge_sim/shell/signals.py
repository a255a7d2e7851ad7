"""Signals that end a program: the first one in good order, a second one at once, but not without closing recordings.

SIGHUP, which a closing terminal sends, is one of them, unless it is ignored at the start, as under `nohup`. A second
signal is for a program that does not come to its end: files are closed by what the caller gives for that, and one
second later the process is gone whatever that does. The exit code is then 128 + the signal's number, as a shell has it.
A SIGHUP is never a second signal: one closing terminal may send it twice, and service managers send it after SIGTERM.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Final

__all__ = ["on_stop_signals", "stop_signals"]

HURRY: Final = 1.0
"""How long a second signal leaves for closing files [s]; the index of a recording of hours takes a tenth of that."""


_URGENT: Final = (signal.SIGINT, signal.SIGTERM)


def stop_signals() -> tuple[signal.Signals, ...]:
    """The signals that end a program, as things are when it starts."""
    if sys.platform == "win32" or signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        return (signal.SIGINT, signal.SIGTERM)
    return (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def on_stop_signals(stop: Callable[[signal.Signals], None], hurry: Callable[[], None]) -> Iterator[None]:
    """Have signals end a program that the running loop runs; nothing happens beside the main thread.

    Args:
        stop: called with the first signal, by the loop.
        hurry: closes files; called by the loop after a second signal. Then, or `HURRY` later, the process ends.
    """
    loop = asyncio.get_running_loop()
    numbers = stop_signals()
    ending = _Ending(loop, numbers, stop, hurry)
    try:
        for number in numbers:
            loop.add_signal_handler(number, ending.begin, number)
    except (RuntimeError, ValueError):  # not the main thread
        yield
        return
    try:
        yield
    finally:
        for number in numbers:
            if not loop.remove_signal_handler(number):
                signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


class _Ending:
    """A program's end: not begun, begun, or in a hurry."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        numbers: tuple[signal.Signals, ...],
        stop: Callable[[signal.Signals], None],
        hurry: Callable[[], None],
    ) -> None:
        self._loop = loop
        self._numbers = numbers
        self._stop = stop
        self._hurry = hurry
        self._has_begun = False

    def begin(self, number: signal.Signals) -> None:
        """Take the first signal, within the loop."""
        if self._has_begun:  # two came in one turn of the loop
            self._end_soon(number, None)
            return
        self._has_begun = True
        for other in self._numbers:  # from now on without the loop's help: it may be what does not come to its end
            self._loop.remove_signal_handler(other)
            signal.signal(other, self._end_soon)
        self._stop(number)

    def _end_soon(self, number: int, _frame: FrameType | None) -> None:
        """Take a second signal, wherever the program is."""
        if number not in _URGENT:
            return
        timer = threading.Timer(HURRY, os._exit, (128 + number,))
        timer.daemon = True
        timer.start()
        with suppress(RuntimeError):  # the loop is closed: all is done
            self._loop.call_soon_threadsafe(self._end, number)

    def _end(self, number: int) -> None:
        try:
            self._hurry()
        finally:
            os._exit(128 + number)
