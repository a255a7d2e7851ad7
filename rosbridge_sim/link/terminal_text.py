"""Texts for a terminal: one line each, without control characters."""

from __future__ import annotations


def safe(text: str) -> str:
    """Return a text on one line, without characters that a terminal could take as a command."""
    return "".join(c if c.isprintable() else _escape(c) for c in text)


def _escape(char: str) -> str:
    """Return a character in the spelling that both YAML and Python use in quotes."""
    short = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}.get(char)
    code = ord(char)
    return short or (f"\\x{code:02x}" if code <= 0xFF else f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}")  # noqa: PLR2004 - the limits of these escapes
