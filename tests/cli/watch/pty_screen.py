"""A program in a pseudo-terminal, and what a person would see there."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Self

import pyte

from tests.support import PATIENCE, ROOT

__all__ = ["PtyScreen"]


class PtyScreen:
    """A program with a terminal of its own.

    Attributes:
        screen: what the terminal shows.
        written: everything that the program has written.
        process: the program.
    """

    def __init__(
        self,
        *words: str,
        columns: int = 80,
        lines: int = 24,
        environ: Mapping[str, str] | None = None,
        is_module: bool = True,
    ) -> None:
        self.screen = pyte.Screen(columns, lines)
        self.written = b""
        self._stream = pyte.ByteStream(self.screen)
        self._ours, theirs = pty.openpty()
        self._theirs = theirs
        self.resize(columns, lines)
        self.attributes = termios.tcgetattr(theirs)
        usual = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "COLORTERM")}
        self.process = subprocess.Popen(
            [sys.executable, *(("-m", "rosbridge_sim") if is_module else ()), *words],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            cwd=ROOT,
            env={**usual, "TERM": "xterm-256color", "PYTHONUTF8": "1", **(environ or {})},
            start_new_session=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(PATIENCE)
        os.close(self._ours)
        os.close(self._theirs)

    @property
    def text(self) -> str:
        return "\n".join(line.rstrip() for line in self.screen.display)

    def until(self, is_there: Callable[[], Any], why: str = "") -> None:
        """Read what the program writes until something holds."""
        end = time.monotonic() + PATIENCE
        while not is_there():
            assert time.monotonic() < end, f"{why}\n{self.text}"
            self._read(0.05)

    def until_text(self, text: str) -> None:
        self.until(lambda: text in self.text, f"expected {text!r} on the screen")

    def _read(self, seconds: float) -> None:
        if select.select([self._ours], [], [], seconds)[0]:
            data = os.read(self._ours, 65_536)
            self.written += data
            self._stream.feed(data)

    def press(self, keys: str) -> None:
        os.write(self._ours, keys.encode())

    def resize(self, columns: int, lines: int) -> None:
        fcntl.ioctl(self._ours, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        self.screen.resize(lines, columns)

    def send(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def end(self) -> int:
        """Wait for the end of the program; return its exit code."""
        self.until(lambda: self.process.poll() is not None, "the program does not end")
        while select.select([self._ours], [], [], 0.0)[0]:
            self._read(0.0)
        code = self.process.returncode
        assert isinstance(code, int)
        return code

    @property
    def is_stopped(self) -> bool:
        """The program is suspended; true once for each time."""
        return os.waitid(os.P_PID, self.process.pid, os.WSTOPPED | os.WNOHANG) is not None

    @property
    def is_restored(self) -> bool:
        """The terminal is as it was before the program: its modes, its screen and its cursor."""
        last = self.written.rfind
        return (
            termios.tcgetattr(self._theirs) == self.attributes
            and last(b"\x1b[?1049l") > last(b"\x1b[?1049h")
            and last(b"\x1b[?25h") > last(b"\x1b[?25l")
        )
