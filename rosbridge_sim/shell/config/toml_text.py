"""A TOML file, and the line of each of its keys: tomllib gives lines only for its own errors."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rosbridge_sim.errors import SettingError
from rosbridge_sim.shell.config.value_types import show_size

MAX_CONFIG_SIZE = 2**20
"""A longer file is not a settings file [bytes]."""


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """Return text and values of a TOML file.

    Raises:
        SettingError: it cannot be read, or is not valid TOML.
    """
    text = read_text(path)
    return text, parse_toml(text, path)


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """Return the values of a TOML text; arguments and errors as for `read_toml`."""
    import tomllib  # noqa: PLC0415 - most servers have no file

    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message, where = _split_place(str(error))
        raise SettingError(f"{path}{where}: not valid TOML: {message}") from None
    except RecursionError:
        raise SettingError(f"{path}: nested too deeply") from None
    except ValueError:  # Python's own limit: tomllib passes on the error of int()
        raise SettingError(f"{path}: expected numbers of at most {sys.get_int_max_str_digits()} digits") from None


def read_text(path: Path, max_bytes: int = MAX_CONFIG_SIZE, what: str = "a settings file") -> str:
    """Return the text of a settings file, or of another file that people write.

    Args:
        what: kind of file, for its errors.

    Raises:
        SettingError: it cannot be read, is too long, or is not UTF-8.
    """
    try:
        with path.open("rb") as file:
            content = file.read(max_bytes + 1)
    except OSError as error:
        raise SettingError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > max_bytes:
        raise SettingError(f"{path}: expected {what}; it is longer than {show_size(max_bytes)}")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise SettingError(f"{path}:{line}: expected UTF-8 text") from None


_PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


def _split_place(message: str) -> tuple[str, str]:
    """Return tomllib's message, and its place as `:line:column`; the library has both in one text."""
    match = _PLACE.search(message)
    if match is None:
        return message, ""
    line, column = match.groups()
    text = message[: match.start()]
    return (text, f":{line}:{column}") if line else (f"{text} at its end", "")


Lines = Mapping[tuple[str, ...], int]
"""Path of keys -> the first line of this key in a TOML text."""


def place_of(lines: Lines, keys: tuple[str, ...]) -> str:
    """Return `:line` of a key or table, else of the innermost table around it; empty if it is not known.

    Args:
        lines: from `lines_of`.
    """
    line = next((lines[keys[:n]] for n in range(len(keys), 0, -1) if keys[:n] in lines), None)
    return "" if line is None else f":{line}"


def lines_of(text: str) -> Lines:
    """Return the lines of all keys of a TOML text, as far as single lines show them.

    Args:
        text: the TOML text.
    """
    import tomllib  # noqa: PLC0415 - as above

    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    for number, line in enumerate(text.split("\n"), 1):
        try:
            found = list(_paths_of(tomllib.loads(line)))
        # A part of a longer value may have any content; its first line may still name a key.
        except (ValueError, RecursionError):
            match = re.match(r"\s*[\"']?([\w-]+)[\"']?\s*=", line)
            found = [(match[1],)] if match else []
        if line.lstrip().startswith("[") and found:
            table = found[-1]
            found = [path[:n] for path in found for n in range(1, len(path) + 1)]
        else:
            found = [table + path for path in found]
        for path in found:
            lines.setdefault(path, number)
    return lines


def _paths_of(document: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the paths of all keys of a document of one line, outer ones first."""
    for key, value in document.items():
        yield (key,)
        if isinstance(value, list) and value and isinstance(value[0], dict):
            value = value[0]  # noqa: PLW2901 - the table of a [[header]]
        if isinstance(value, dict):
            yield from ((key, *path) for path in _paths_of(value))
