"""Results of checks of files (verdicts): good, with remarks, or with mistakes; for many files, with a total."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.cli.tools.text import put, put_json
from rosbridge_sim.link.terminal_text import safe

CheckReport = Mapping[str, Any]
"""A JSON object with `file`, `mistakes` and `remarks`."""

MAX_LISTED: Final = 5
"""Mistakes and remarks of a file that are shown among many files; the command for a single file shows all."""


def exit_code(accounts: Iterable[CheckReport], *, is_strict: bool) -> int:
    """Return 1 if a file has mistakes, or has remarks and they count; else 0."""
    return int(any(one["mistakes"] or (is_strict and one["remarks"]) for one in accounts))


def put_verdict(account: CheckReport) -> None:
    """Print the result for a file on one line."""
    counts = [_plural(len(account[key]), key.removesuffix("s")) for key in ("mistakes", "remarks") if account[key]]
    put(f"{safe(account['file'])}: {', '.join(counts) or 'good'}")


class Verdicts:
    """The results for many files, each printed as soon as it is known."""

    def __init__(self, command: str, num: int, *, is_json: bool) -> None:
        """Begin without results.

        Args:
            command: command that shows everything about a single file.
            is_json: print one JSON value per line for programs.
        """
        self._command = command
        self._num = num
        self._is_json = is_json
        self._counts = {"good": 0, "with remarks": 0, "with mistakes": 0}
        self._codes = {False: 0, True: 0}
        # If the results go to a file, the terminal shows the progress.
        self._has_progress = sys.stderr.isatty() and not sys.stdout.isatty()

    def begin(self, file: str) -> None:
        """Begin with the next file."""
        if self._has_progress:
            done = sum(self._counts.values())
            sys.stderr.write(f"\r\x1b[K[{done + 1:,}/{self._num:,}] {safe(file)}")
            sys.stderr.flush()

    def add(self, account: CheckReport) -> None:
        """Print the result for the current file."""
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
        """Print the totals.

        Args:
            is_strict: remarks count like mistakes.

        Returns:
            The exit code for all files.
        """
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
