"""Texts that are not JSON: what they are instead, in words that say what to do.

The parser's own words are about the grammar ("expected value at line 1 column 1"). The usual reasons are an encoding, a
comment, single quotes, or a file that is no text at all.
"""

from __future__ import annotations

import re
from typing import Final

_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff")
"""Byte order marks of UTF-16 and UTF-32."""

LOOKED_AT_TEXT: Final = 4_096
"""Beginning of a file in which zero bytes show that it is no text [bytes]."""

MAX_EXCERPT: Final = 20
"""Characters of a text that an error quotes."""

_JSON_PLACE: Final = re.compile(r"(?P<what>.*) at line (?P<line>\d+) column (?P<column>\d+)")


def explain_not_json(text: bytes, why: str, source: str) -> str:
    """Return the error for a text that is not JSON.

    Args:
        text: the text, with or without a byte order mark.
        why: the parser's words, such as `trailing comma at line 2 column 1`.
        source: the file's name.

    Returns:
        One line, with the place where there is one.
    """
    if text.startswith(_UTF_16):
        return f"{source}: expected UTF-8, got UTF-16; save the file as UTF-8"
    if b"\x00" in text[:LOOKED_AT_TEXT]:
        return f"{source}: expected a JSON document, got a binary file"
    try:
        text.decode()
    except UnicodeDecodeError as error:
        return _not_utf_8(text, error.start, source)
    place = _JSON_PLACE.fullmatch(why)
    if place is None:
        return f"{source}: not JSON: {why}"
    line, column = int(place["line"]), int(place["column"])
    return f"{source}:{line}:{column}: not JSON: {place['what']}{_hint(_rest(text, line, column), place['what'])}"


def _not_utf_8(text: bytes, at: int, source: str) -> str:
    if text.lstrip()[:1] not in {b"{", b"["}:
        return f"{source}: expected a JSON document, got a binary file"
    line, column = text.count(b"\n", 0, at) + 1, at - text.rfind(b"\n", 0, at)
    return f"{source}:{line}:{column}: not UTF-8: byte 0x{text[at]:02x}; save the file as UTF-8"


def _rest(text: bytes, line: int, column: int) -> str:
    """Return the text from a place on; the parser counts bytes."""
    lines = text.split(b"\n", line)
    rest = lines[line - 1][column - 1 :] if len(lines) >= line else b""
    return rest[: 4 * MAX_EXCERPT].decode(errors="replace").lstrip()


def _hint(rest: str, what: str) -> str:
    """Return what probably went wrong, for the end of the error; an empty text if it is not known."""
    if rest.startswith(("//", "/*", "#")):
        return "; JSON has no comments"
    if rest.startswith("'"):
        return "; JSON has double quotes"
    if what == "expected value" and rest:
        return f", got {rest.splitlines()[0][:MAX_EXCERPT]!r}"
    return ""
