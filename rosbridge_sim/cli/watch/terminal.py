"""A terminal that shows one picture after the other, and that is as before when it is left: plain ANSI sequences.

The picture is on the terminal's other screen, so what was there before comes back. Only rows that have changed are
written, which saves most bytes of a connection by ssh.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, Final, Self

__all__ = ["Screen", "count_colours", "has_unicode", "read_keys", "split_keys"]

_ENTER: Final = "\x1b[?1049h\x1b[?25l\x1b[2J"
"""The other screen, without cursor, empty."""

_LEAVE: Final = "\x1b[0m\x1b[?25h\x1b[?1049l"

MAX_KEYS: Final = 1_024
"""Bytes of keys that are read at once: someone who leans on a key, or pastes."""

_CODES: Final = {"H": "up", "P": "down", "M": "right", "K": "left"}
"""Second characters of the arrow keys on Windows."""

_ARROWS: Final = {"A": "up", "B": "down", "C": "right", "D": "left"}


class Screen:
    """The terminal of this process, as a context: it is restored at the end, whatever happens."""

    def __init__(self) -> None:
        self._rows: list[str] = []
        self._size = (0, 0)
        self._is_in = False
        self._saved: Any = None  # the terminal's attributes, whose form is the system's

    def __enter__(self) -> Self:
        """Show the other screen."""
        self.enter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the terminal."""
        self.leave()

    def enter(self) -> None:
        """Show the other screen, and read keys without waiting for the end of a line."""
        if self._is_in:
            return
        self._is_in = True
        self._saved = _read_without_echo()
        self._rows = []
        _write(_ENTER)

    def leave(self) -> None:
        """Restore the terminal. A second call does nothing."""
        if not self._is_in:
            return
        self._is_in = False
        _restore(self._saved)
        with suppress(OSError):  # the terminal has gone
            _write(_LEAVE)

    def show(self, rows: Sequence[str]) -> None:
        """Show a picture.

        Args:
            rows: not more than the terminal has; each fits into its columns.
        """
        parts = []
        if self._size != (size := self.size()):
            self._size, self._rows = size, []
            parts.append("\x1b[0m\x1b[2J")
        for i, row in enumerate(rows):
            if i >= len(self._rows) or self._rows[i] != row:
                parts.append(f"\x1b[{i + 1};1H{row}\x1b[0m\x1b[K")
        self._rows = list(rows)
        if parts:
            _write("".join(parts))

    @staticmethod
    def size() -> tuple[int, int]:
        """Return columns and rows of the terminal; 80 and 24 where it does not say."""
        try:
            size = os.get_terminal_size(sys.stdout.fileno())
        except (OSError, ValueError):
            return 80, 24
        return size.columns or 80, size.lines or 24


def split_keys(text: str) -> list[str]:
    """Return the keys in what a terminal sends; other control sequences are left out."""
    keys = []
    i = 0
    while i < len(text):
        if text[i] != "\x1b":
            keys.append(text[i])
            i += 1
            continue
        end = i + 2
        if text[i + 1 : i + 2] in ("[", "O"):
            while end < len(text) and not "@" <= text[end] <= "~":
                end += 1
            if text[end : end + 1] in _ARROWS:
                keys.append(_ARROWS[text[end]])
            end += 1
        i = end
    return keys


def has_unicode(encoding: str | None) -> bool:
    """Return True if an encoding can show Braille and arrows."""
    try:
        "⣿↗●├".encode(encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def count_colours(environ: Mapping[str, str], *, is_terminal: bool) -> int:
    """Return how many colours to use: 0, 16 or 256.

    Args:
        environ: the environment; `NO_COLOR` turns colours off, see no-color.org.
        is_terminal: the output is a terminal.
    """
    term = environ.get("TERM", "")
    if not is_terminal or environ.get("NO_COLOR") or term == "dumb":
        return 0
    has_many = "256" in term or "kitty" in term or environ.get("COLORTERM") in ("truecolor", "24bit")
    return 256 if has_many or sys.platform == "win32" else 16


def _write(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


if sys.platform == "win32":
    import msvcrt

    def read_keys() -> list[str]:
        """Return the keys that were pressed; see below."""
        keys = []
        while msvcrt.kbhit() and len(keys) < MAX_KEYS:
            key = msvcrt.getwch()
            if key in ("\x00", "\xe0"):
                key = _CODES.get(msvcrt.getwch(), "")
            keys.append(key)
        return keys

    def _read_without_echo() -> Any:  # noqa: ANN401 - see `Screen`
        """Have the console understand the control sequences; return its former mode."""
        import ctypes  # noqa: PLC0415 - for Windows alone

        kernel = ctypes.windll.kernel32
        handle = kernel.GetStdHandle(-11)  # stdout
        mode = ctypes.c_uint32()
        if not kernel.GetConsoleMode(handle, ctypes.byref(mode)):
            return None
        kernel.SetConsoleMode(handle, mode.value | 0x4)  # ENABLE_VIRTUAL_TERMINAL_PROCESSING
        return mode.value

    def _restore(saved: Any) -> None:  # noqa: ANN401 - as above
        import ctypes  # noqa: PLC0415 - as above

        if saved is not None:
            kernel = ctypes.windll.kernel32
            kernel.SetConsoleMode(kernel.GetStdHandle(-11), saved)

else:
    import termios
    import tty

    def read_keys() -> list[str]:
        """Return the keys that were pressed, as `split_keys` does; `q` if the keyboard has gone."""
        try:
            data = os.read(sys.stdin.fileno(), MAX_KEYS)
        except OSError:
            return ["q"]
        return split_keys(data.decode("utf-8", "ignore")) if data else ["q"]

    def _read_without_echo() -> Any:  # noqa: ANN401 - see `Screen`
        """Have keys come one by one and without echo; return the former attributes, None without a terminal."""
        if not sys.stdin.isatty():
            return None
        saved = termios.tcgetattr(sys.stdin.fileno())
        tty.setcbreak(sys.stdin.fileno(), termios.TCSADRAIN)
        return saved

    def _restore(saved: Any) -> None:  # noqa: ANN401 - as above
        if saved is not None:
            with suppress(termios.error):  # the terminal has gone
                termios.tcsetattr(sys.stdin.fileno(), termios.TCSADRAIN, saved)
