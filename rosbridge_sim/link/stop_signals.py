"""Signals that end a program: the first one in good order, a second one at once, but with closed recordings.

SIGHUP, which a closing terminal sends, is one of them, unless it is ignored at the start, as under `nohup`. A second
signal is for a program that does not end: a function of the caller closes files, and some seconds later, or with a
third signal, the process ends in any case. The exit code is then 128 + the signal's number, as in a shell. A SIGHUP
never counts as a second signal: one closing terminal may send it twice, and service managers send it after SIGTERM.
Windows has no SIGHUP. It has SIGBREAK: for Ctrl-Break, for a console that closes, and when a program asks another one
to end (`CTRL_BREAK_EVENT`). Event loops on Windows do not handle signals, so Python's own handlers pass them to the
loop.
"""

from __future__ import annotations

import asyncio
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Final

HURRY: Final = 5.0
"""Time for closing files after a second signal [s]: the index of a recording of hours takes 0.1 s of CPU time."""

_NAMES: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""Signals that end a program; each system has some of them."""

_NEVER_SECOND: Final = "SIGHUP"


def stop_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this program. Call it at the start, because SIGHUP may be ignored then."""
    there = [signal.Signals[name] for name in _NAMES if hasattr(signal, name)]
    return tuple(one for one in there if one.name != "SIGHUP" or signal.getsignal(one) is not signal.SIG_IGN)


@contextmanager
def on_stop_signals(stop: Callable[[signal.Signals], None], hurry: Callable[[], None]) -> Iterator[None]:
    """Handle signals that end the program of the running loop; do nothing outside the main thread.

    Args:
        stop: the loop calls it with the first signal.
        hurry: closes files; the loop calls it after a second signal. Then, or `HURRY` later, or at once with a third
            signal, the process ends.
    """
    loop = asyncio.get_running_loop()
    numbers = stop_signals()
    ending = _Ending(loop, numbers, stop, hurry)
    try:
        ending.listen()
    except (RuntimeError, ValueError):  # not the main thread
        yield
        return
    try:
        yield
    finally:
        for number in numbers:
            if not _remove(loop, number):
                signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


def _remove(loop: asyncio.AbstractEventLoop, number: signal.Signals) -> bool:
    """Remove a handler of the loop; return True if there was one."""
    with suppress(NotImplementedError):  # the loops of Windows have no handlers
        return loop.remove_signal_handler(number)
    return False


@dataclass
class _Ending:
    """The end of a program: not begun, begun, or in a hurry."""

    _loop: asyncio.AbstractEventLoop
    _numbers: tuple[signal.Signals, ...]
    _stop: Callable[[signal.Signals], None]
    _hurry: Callable[[], None]
    _has_begun: bool = False
    _is_in_hurry: bool = False

    def listen(self) -> None:
        """Let the signals call `begin`.

        Raises:
            RuntimeError, ValueError: this is not the main thread.
        """
        for number in self._numbers:
            try:
                self._loop.add_signal_handler(number, self.begin, number)
            except NotImplementedError:  # on Windows
                signal.signal(number, self._take)

    def _take(self, number: int, _frame: FrameType | None) -> None:
        """Pass a signal to the loop, wherever the program is."""
        with suppress(RuntimeError):  # the loop is closed: all is done
            self._loop.call_soon_threadsafe(self.begin, signal.Signals(number))

    def begin(self, number: signal.Signals) -> None:
        """Handle the first signal, within the loop."""
        if self._has_begun:  # two signals came in one turn of the loop
            self._end_soon(number, None)
            return
        self._has_begun = True
        for other in self._numbers:  # from now on without the loop, which may be the part that does not end
            _remove(self._loop, other)
            signal.signal(other, self._end_soon)
        self._stop(number)

    def _end_soon(self, number: int, _frame: FrameType | None) -> None:
        """Handle a second or third signal, wherever the program is."""
        if signal.Signals(number).name == _NEVER_SECOND:
            return
        if self._is_in_hurry:
            os._exit(128 + number)
        self._is_in_hurry = True
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
