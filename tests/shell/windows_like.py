"""Run the command line as on Windows, as far as Linux can: without what Python has on POSIX systems alone.

    python tests/shell/windows_like.py serve --port 0

Modules of POSIX systems and uvloop cannot be imported; `os` and `signal` lack what they lack there; the event loop
handles no signals; its clock moves in steps of 1/64 s, and waits end at such a step. SIGUSR1 stands in for SIGBREAK.
"""

from __future__ import annotations

import asyncio
import enum
import math
import os
import selectors
import signal
import sys
import time
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import NoReturn

POSIX_MODULES = frozenset({"fcntl", "grp", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty", "uvloop"})

POSIX_NAMES = (
    *("O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_SYNC", "O_DSYNC", "fchmod", "fchown", "chown"),
    *("fork", "forkpty", "getuid", "geteuid", "getgid", "getegid", "getpgid", "killpg", "mkfifo", "nice", "pathconf"),
    *("pread", "pwrite", "posix_fadvise", "sched_getaffinity", "setsid", "statvfs", "sync", "sysconf"),
)

POSIX_SIGNALS = ("SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGWINCH")

TICK = 1 / 64
"""Step of the clocks of Windows [s]."""


class Blocker(MetaPathFinder):
    """Finds none of the modules that are not there."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        del path, target
        if name.partition(".")[0] in POSIX_MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None


def _raise(*_: object, **__: object) -> NoReturn:
    raise NotImplementedError


def forget_posix() -> None:
    """Take away what Windows has not."""
    for name in POSIX_MODULES:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, Blocker())
    for name in POSIX_NAMES:
        if hasattr(os, name):
            delattr(os, name)
    for name in POSIX_SIGNALS:
        if hasattr(signal, name):
            delattr(signal, name)
    asyncio.SelectorEventLoop.add_signal_handler = _raise  # type: ignore[method-assign, unused-ignore]
    asyncio.SelectorEventLoop.remove_signal_handler = _raise  # type: ignore[method-assign, unused-ignore]


def rename_signals() -> None:
    """Have SIGUSR1 be known as SIGBREAK, and no signal as SIGHUP."""
    number = signal.SIGUSR1
    names = {one.name: one.value for one in signal.Signals if one.name not in POSIX_SIGNALS} | {"SIGBREAK": int(number)}
    signal.Signals = enum.IntEnum("Signals", names)  # type: ignore[misc]
    signal.SIGBREAK = signal.Signals["SIGBREAK"]  # type: ignore[attr-defined, unused-ignore]


def coarsen_clock() -> None:
    """Have the event loop's clock move in steps, and its waits end at one."""
    fine, info, select = time.monotonic, time.get_clock_info, selectors.DefaultSelector.select

    def coarse() -> float:
        return math.floor(fine() / TICK) * TICK

    def describe(name: str) -> object:
        found = info(name)  # type: ignore[arg-type]
        found.resolution = TICK if name == "monotonic" else found.resolution
        return found

    def wait(self: selectors.DefaultSelector, timeout: float | None = None) -> object:
        if timeout is not None and timeout > 0:
            now = fine()
            timeout = math.ceil((now + timeout) / TICK) * TICK - now
        return select(self, timeout)

    time.monotonic = coarse
    time.get_clock_info = describe  # type: ignore[assignment]
    selectors.DefaultSelector.select = wait  # type: ignore[method-assign, assignment]


if __name__ == "__main__":
    rename_signals()
    forget_posix()
    coarsen_clock()
    from rosbridge_sim.__main__ import main

    sys.exit(main())
