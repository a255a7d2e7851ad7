"""Values in the form that people read and write: output as YAML, input as JSON or YAML, and tables.

Output for people is YAML that can be read back; every character from outside that a terminal could take as a command is
escaped. Output for programs is one JSON value per line.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import cast

import orjson

from rosbridge_sim.errors import DocumentError, file_errors
from rosbridge_sim.link.json_with_words import to_json
from rosbridge_sim.link.terminal_text import safe

# Output


def put(text: str) -> None:
    """Print one or more lines on stdout at once, because the reader may wait for them."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def put_lines(text: str) -> None:
    """Print lines that have text from outside: what a terminal could take as a command is escaped."""
    put("\n".join(map(safe, text.split("\n"))))


def put_json(value: object) -> None:
    """Print a value as one line of JSON."""
    put(orjson.dumps(value).decode())


def show(value: object, text: str, *, is_json: bool) -> None:
    """Print a value as JSON, for programs, or as its text, for people."""
    put_json(value) if is_json else put(text)


def put_names(
    names: Sequence[str], types: Sequence[str] = (), *, is_count: bool = False, is_json: bool = False
) -> None:
    """Print names, one per line, as the tools of ROS 2 do.

    Args:
        types: types of all, to print them behind, in brackets; empty prints none.
        is_count: print only how many there are.
        is_json: print them as JSON, without types.
    """
    if is_count or is_json:
        put_json(len(names) if is_count else names)
        return
    for i, name in enumerate(names):
        put(safe(f"{name} [{types[i]}]" if types else name))


def put_record(value: object) -> None:
    """Print a value as one document of a YAML stream, with its separator line."""
    put(f"{render(value)}\n---")


def note(text: str) -> None:
    """Print a line for people on stderr, separate from the results on stdout."""
    sys.stderr.write(f"rosbridge-sim: {safe(text)}\n")
    sys.stderr.flush()


def put_progress(text: str) -> None:
    """Write over the line that shows people how far a command is, on a terminal; an empty text removes it."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")
        sys.stderr.flush()


def write_file(path: Path, text: str) -> None:
    """Write a file.

    Raises:
        DocumentError: it cannot be written.
    """
    with file_errors(path, "written"):
        path.write_text(text, encoding="utf-8")


def demand_new(path: Path) -> None:
    """Refuse to overwrite a file.

    Raises:
        DocumentError: it is there already.
    """
    if path.exists():
        raise DocumentError(f"{path}: is there already; choose another name, or delete it")


def put_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows with aligned columns below a header.

    Args:
        rows: the cells of each row.
    """
    lines = [list(header), *([safe(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        put("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())


# YAML


def render(value: object) -> str:
    """Return a JSON value as YAML: objects as blocks, lists of simple values on one line."""
    line = _inline(value)
    return line if line is not None else "\n".join(_block(value, ""))


class Flow(dict[str, object]):
    """An object of simple values and lists of them, which is written on one line: `{min: 1, max: 2}`."""


def _inline(value: object) -> str | None:
    """Return a value as text for the line of its key; None if it needs separate lines."""
    if isinstance(value, Flow):
        return "{" + ", ".join(f"{_scalar(key)}: {_inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, Mapping):
        return None if value else "{}"
    if isinstance(value, list):
        parts = [None if isinstance(one, (list, Mapping)) else _scalar(one) for one in value]
        return None if None in parts else f"[{', '.join(cast('list[str]', parts))}]"  # there is no None in it
    return _scalar(value)


def _block(value: object, pad: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, one in value.items():
            line = _inline(one)
            if line is not None:
                yield f"{pad}{_scalar(key)}: {line}"
            else:
                yield f"{pad}{_scalar(key)}:"
                yield from _block(one, pad + "  ")
    else:
        assert isinstance(value, list)
        for one in value:
            line = _inline(one)
            lines = [pad + "  " + line] if line is not None else list(_block(one, pad + "  "))
            yield f"{pad}- {lines[0][len(pad) + 2 :]}"
            yield from lines[1:]


def _scalar(value: object) -> str:
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) and value.casefold() not in _WORDS else _quote(value)
    if isinstance(value, float) and not math.isfinite(value):
        return {"nan": ".nan", "inf": ".inf", "-inf": "-.inf"}[str(value)]
    return json.dumps(value)


_PLAIN = re.compile(r"(?:[^\W\d]|/)(?:[\w/.+ -]*[\w/.+-])?")
"""Text that YAML reads as text without quotes."""

_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off"})
"""Text that some version of YAML reads as another type."""


def _quote(text: str) -> str:
    quoted = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + safe(quoted) + '"'


def leaves(value: object, path: str = "", sign: str = ".") -> Iterator[tuple[str, object]]:
    """Yield path and value of each part of a value that has no parts itself.

    Args:
        sign: stands between the names of a path; numbers of elements follow without it.
    """
    if isinstance(value, Mapping) and value:
        for key, one in value.items():
            yield from leaves(one, f"{path}{sign if path else ''}{key}", sign)
    elif isinstance(value, list) and value:
        for i, one in enumerate(value):
            yield from leaves(one, f"{path}{i}", sign)
    else:
        yield path, value


# Input


def read_body(text: str, where: str) -> object:
    """Return a value that a user wrote as JSON or as YAML (`{x: 1}`).

    Args:
        where: name of the input, for errors.

    Raises:
        DocumentError: it is neither, or has a value that JSON does not have.
    """
    try:
        value = json.loads(text)  # with the words NaN and Infinity
    except (ValueError, RecursionError):
        from rosbridge_sim.documents.yaml_reading import read_yaml  # noqa: PLC0415 - and msgspec, which most commands do not need

        value = read_yaml(text, where, "JSON, or YAML such as '{x: 1}'").value
    try:
        return json.loads(to_json(value))
    except TypeError as error:
        raise DocumentError(f"{where}: expected what JSON can hold: {error}") from None
