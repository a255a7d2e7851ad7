"""Verdicts on files: good, with remarks, with mistakes; of one, or of many with a count at the end."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.cli.tools.text import put, put_json
from rosbridge_sim.shell.terminal_text import safe

__all__ = ["Verdicts", "exit_code", "put_verdict"]

CheckReport = Mapping[str, Any]
"""A JSON object with `file`, `mistakes` and `remarks`."""

MAX_LISTED: Final = 5
"""Mistakes of a file that are shown among many files, and as many remarks: the command for one file shows all."""


def exit_code(accounts: Iterable[CheckReport], *, is_strict: bool) -> int:
    """Return 1 if a file has mistakes, or if it has remarks and those count; else 0."""
    return int(any(one["mistakes"] or (is_strict and one["remarks"]) for one in accounts))


def put_verdict(account: CheckReport) -> None:
    """Show the verdict on a file, on one line."""
    counts = [_plural(len(account[key]), key.removesuffix("s")) for key in ("mistakes", "remarks") if account[key]]
    put(f"{safe(account['file'])}: {', '.join(counts) or 'good'}")


class Verdicts:
    """The verdicts on many files, each shown as soon as it is known."""

    def __init__(self, command: str, num: int, *, is_json: bool) -> None:
        """No verdict yet.

        Args:
            command: what shows all about a single file.
            num: how many files there will be.
            is_json: one JSON value a line, for a program.
        """
        self._command = command
        self._num = num
        self._is_json = is_json
        self._counts = {"good": 0, "with remarks": 0, "with mistakes": 0}
        self._codes = {False: 0, True: 0}
        # Where the verdicts go elsewhere, the terminal shows how far it is.
        self._has_progress = sys.stderr.isatty() and not sys.stdout.isatty()

    def begin(self, file: str) -> None:
        """Take up the next file."""
        if self._has_progress:
            done = sum(self._counts.values())
            sys.stderr.write(f"\r\x1b[K[{done + 1:,}/{self._num:,}] {safe(file)}")
            sys.stderr.flush()

    def add(self, account: CheckReport) -> None:
        """Show the verdict on the file that was taken up."""
        verdict = "with mistakes" if account["mistakes"] else "with remarks" if account["remarks"] else "good"
        self._counts[verdict] += 1
        for is_strict in self._codes:
            self._codes[is_strict] |= exit_code([account], is_strict=is_strict)
        if self._is_json:
            put_json(account)
            return
        put_verdict(account)
        self._put_lines("mistake", account["mistakes"])
        self._put_lines("remark", account["remarks"])

    def end(self, *, is_strict: bool) -> int:
        """Show the count, and return the exit code of all."""
        if self._has_progress:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
        if not self._is_json:
            counts = ", ".join(f"{num:,} {verdict}" for verdict, num in self._counts.items() if num)
            put(f"{_plural(self._num, 'file')}: {counts}")
        return self._codes[is_strict]

    def _put_lines(self, what: str, lines: Sequence[str]) -> None:
        for line in lines[:MAX_LISTED]:
            put(f"  {what}: {safe(line)}")
        if len(lines) > MAX_LISTED:
            put(
                f"  ... and {_plural(len(lines) - MAX_LISTED, f'{what}')} more; rosbridge-sim {self._command} shows all"
            )


def _plural(num: int, what: str) -> str:
    return f"{num:,} {what}{'' if num == 1 else 's'}"
