"""Tests that run with `--long` alone, by group: `long_tests.toml` names them, and the quick tests that stay for each.

`python -m tests.long_tests` prints the table of `CONTRIBUTING.md`.

A test that is long for a reason of its own has the mark `long`. Those of the table have a quick relative, so that the
promise is tested without them, too.
"""

from __future__ import annotations

import re
import tomllib
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

__all__ = ["GROUPS", "LongGroup", "find_mistakes", "is_long", "table"]

TESTS = Path(__file__).parent


@dataclass(frozen=True)
class LongGroup:
    """A group of long tests.

    Attributes:
        what: of the group, in one line.
        long: patterns: a file, `file::test`, or `file::test[PARAMETERS]`, where `*` stands for any text.
        quick: patterns of the tests that stay; they are quick where they match a pattern of `long`, too.
    """

    what: str
    long: tuple[str, ...]
    quick: tuple[str, ...]


def _read() -> tuple[LongGroup, ...]:
    groups = tomllib.loads((TESTS / "long_tests.toml").read_text("utf-8"))["group"]
    return tuple(LongGroup(group["what"], tuple(group["long"]), tuple(group["quick"])) for group in groups)


GROUPS = _read()
"""All groups."""


def is_long(test: str) -> bool:
    """Whether a test, as `file::test[PARAMETERS]` within `tests/`, is one of a group's long ones."""
    file, _, rest = test.partition("::")
    return any(
        any(_matches(rest, pattern) for pattern in long) and not any(_matches(rest, pattern) for pattern in quick)
        for long, quick in _patterns().get(file, ())
    )


def find_mistakes(tests: Iterable[str]) -> list[str]:
    """The patterns that match none of all tests, and quick ones that match a long test.

    Args:
        tests: all of them, as `file::test[PARAMETERS]` within `tests/`.
    """
    by_file: dict[str, list[str]] = defaultdict(list)
    for test in tests:
        file, _, rest = test.partition("::")
        by_file[file].append(rest)
    mistakes = []
    for group in GROUPS:
        for pattern in (*group.long, *group.quick):
            file, _, rest = pattern.partition("::")
            found = [test for test in by_file.get(file, ()) if _matches(test, rest)]
            if not (TESTS / file).is_file():
                mistakes.append(f"{pattern}: no such file")
            elif file in by_file and not found:
                mistakes.append(f"{pattern}: no test has this name")
            elif found and pattern in group.quick and all(is_long(f"{file}::{test}") for test in found):
                mistakes.append(f"{pattern}: expected a test without --long")
    return mistakes


def table() -> str:
    """Return the groups as a table of Markdown."""
    lines = ["| with `--long` alone | tests | quick tests of the same promises |", "|---|---|---|"]
    for group in GROUPS:
        files, stay = ({pattern.partition("::")[0]: None for pattern in some} for some in (group.long, group.quick))
        lines.append(f"| {group.what} | {_list(files)} | {_list(stay)} |")
    return "\n".join(lines) + "\n"


def _list(files: Iterable[str]) -> str:
    return ", ".join(f"`{file}`" for file in files)


@cache
def _patterns() -> dict[str, list[tuple[list[str], list[str]]]]:
    """The long and the quick patterns of each file, by group."""
    found: dict[str, list[tuple[list[str], list[str]]]] = defaultdict(list)
    for group in GROUPS:
        for file in {pattern.partition("::")[0] for pattern in group.long}:
            long, quick = (
                [pattern.partition("::")[2] for pattern in patterns if pattern.partition("::")[0] == file]
                for patterns in (group.long, group.quick)
            )
            found[file].append((long, [pattern for pattern in quick if pattern]))
    return found


def _matches(test: str, pattern: str) -> bool:
    """Whether `test[PARAMETERS]` is meant by a pattern: that of a file, of a test, or of some cases of a test."""
    name, _, parameters = test.partition("[")
    wanted, _, cases = pattern.partition("[")
    return not pattern or (_is_like(name, wanted) and (not cases or _is_like(parameters, cases)))


def _is_like(text: str, pattern: str) -> bool:
    """Whether a pattern, in which `*` stands for any text, and every other character for itself, means a text."""
    if "*" not in pattern:  # as most are: compiling all of them would take longer than the rest of the work
        return text == pattern
    return _compiled(pattern).fullmatch(text) is not None


@cache
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(".*".join(map(re.escape, pattern.split("*"))), re.DOTALL)


if __name__ == "__main__":
    print(table(), end="")  # noqa: T201 - it is asked for
