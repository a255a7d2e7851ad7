"""Texts that are not JSON: what they are instead, in words that say what to do.

The parser's own words are about the grammar ("Expecting value: line 1 column 1"). The usual reasons are an encoding, a
comment, single quotes, or a file that is no text at all.
"""

from __future__ import annotations

import json
from typing import Final

_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff")
"""Byte order marks of UTF-16 and UTF-32."""

LOOKED_AT_TEXT: Final = 4_096
"""Beginning of a file in which zero bytes show that it is no text [bytes]."""

MAX_EXCERPT: Final = 20
"""Characters of a text that an error quotes."""

_WORDS: Final = {
    "Expecting value": "expected a value",
    "Expecting property name enclosed in double quotes": "expected a key in double quotes",
    "Extra data": "expected nothing behind its end",
    "Unterminated string starting at": "a text that begins here has no end",
    "Invalid control character at": "a control character in a text",
}
"""The parser's words -> ours."""


def explain_not_json(text: bytes, error: Exception, source: str) -> str:
    """Return the error for a text that is not JSON.

    Args:
        text: the text, without a byte order mark of UTF-8.
        error: that of Python's decoder or parser.

    Returns:
        One line, with the place where there is one.
    """
    if text.startswith(_UTF_16):
        return f"{source}: expected UTF-8, got UTF-16; save the file as UTF-8"
    if b"\x00" in text[:LOOKED_AT_TEXT]:
        return f"{source}: expected a JSON document, got a binary file"
    if isinstance(error, UnicodeDecodeError):
        return _not_utf_8(text, error.start, source)
    if not isinstance(error, json.JSONDecodeError):
        half = isinstance(error, UnicodeEncodeError)
        why = "an escape such as \\ud800 is half a character" if half else "a number is too long"
        return f"{source}: not JSON: {'nested too deeply' if isinstance(error, RecursionError) else why}"
    doc, at, what = error.doc, error.pos, _WORDS.get(error.msg, error.msg.replace("Expecting", "expected"))
    rest = doc[at:].lstrip()
    comma = len(doc[:at].rstrip()) - 1
    if error.msg.startswith("Illegal trailing") or (doc[comma:at].startswith(",") and rest.startswith(("]", "}"))):
        at, what = (comma if rest.startswith(("]", "}")) else at), "trailing comma"
    elif not rest:
        what = "the text ends too early"
    line, column = doc.count("\n", 0, at) + 1, at - doc.rfind("\n", 0, at)
    return f"{source}:{line}:{column}: not JSON: {what}{_hint(rest[:MAX_EXCERPT], error.msg)}"


def _not_utf_8(text: bytes, at: int, source: str) -> str:
    if text.lstrip()[:1] not in {b"{", b"["}:
        return f"{source}: expected a JSON document, got a binary file"
    line, column = text.count(b"\n", 0, at) + 1, at - text.rfind(b"\n", 0, at)
    return f"{source}:{line}:{column}: not UTF-8: byte 0x{text[at]:02x}; save the file as UTF-8"


def _hint(rest: str, what: str) -> str:
    """Return what probably went wrong, for the end of the error; an empty text if it is not known."""
    if rest.startswith(("//", "/*", "#")):
        return "; JSON has no comments"
    if rest.startswith("'"):
        return "; JSON has double quotes"
    return f", got {rest.splitlines()[0]!r}" if what == "Expecting value" and rest else ""
