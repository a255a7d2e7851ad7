"""Values as a person reads and writes them: YAML-like out, JSON or YAML in, and tables.

What is printed for a person is YAML that reads back as the value; every character of a stranger's that a terminal
could take for a command is escaped in it. What is printed for a program is one JSON value a line.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import cast

import orjson

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.terminal_text import safe

__all__ = ["note", "put", "put_json", "put_record", "put_table", "read_body", "render"]


# Out


def put(text: str) -> None:
    """A line, or several, on stdout: now, since whoever reads may wait for it."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def put_json(value: object) -> None:
    """The value as one line of JSON."""
    put(orjson.dumps(value).decode())


def put_record(value: object) -> None:
    """The value as one document of a stream: YAML, and the line that ends it."""
    put(f"{render(value)}\n---")


def note(text: str) -> None:
    """A line for the person at the terminal, that is not what was asked for: on stderr."""
    sys.stderr.write(f"rosbridge-sim: {safe(text)}\n")
    sys.stderr.flush()


def put_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Rows with aligned columns below a header."""
    lines = [list(header), *([safe(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        put("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())


# YAML


def render(value: object) -> str:
    """A JSON value as YAML: objects as blocks, lists of plain values on one line."""
    line = _inline(value)
    return line if line is not None else "\n".join(_block(value, ""))


def _inline(value: object) -> str | None:
    """The value on the line of its key; None for what needs lines of its own."""
    if isinstance(value, Mapping):
        return None if value else "{}"
    if isinstance(value, list):
        parts = [None if isinstance(one, (list, Mapping)) else _scalar(one) for one in value]
        return None if None in parts else f"[{', '.join(cast('list[str]', parts))}]"  # None was looked for
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
"""Text that YAML takes for text though it stands without quotes."""

_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off"})
"""Text that one YAML or another takes for something else."""


def _quote(text: str) -> str:
    quoted = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + safe(quoted) + '"'


# In


def read_body(text: str, where: str) -> object:
    """The value that a person wrote, as JSON or in the laxer YAML (`{x: 1}`).

    Args:
        text: what was written.
        where: what an error calls it.

    Raises:
        DocumentError: it is neither, or holds what JSON cannot.
    """
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError:
        value = _read_yaml(text, where)
    try:
        return orjson.loads(orjson.dumps(value))  # NaN is null on the wire, and a date is the text that it was
    except TypeError as error:
        raise DocumentError(f"{where}: expected what JSON can hold: {error}") from None


def _read_yaml(text: str, where: str) -> object:
    from ruamel.yaml import YAML  # noqa: PLC0415 - 40 ms that most commands do without
    from ruamel.yaml.error import YAMLError  # noqa: PLC0415

    try:
        return cast("object", YAML(typ="safe", pure=True).load(text))
    except (YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or str(error).partition("\n")[0] or "nested too deeply"
        mark = getattr(error, "problem_mark", None)
        place = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise DocumentError(f"{where}{place}: expected JSON, or YAML such as '{{x: 1}}': {safe(problem)}") from None
