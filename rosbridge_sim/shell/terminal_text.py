"""Texts that a terminal can show: one line each, and nothing in them that it could take for a command."""

from __future__ import annotations

__all__ = ["safe"]


def safe(text: str) -> str:
    """Return a text on one line, without what a terminal could take for a command."""
    return "".join(c if c.isprintable() else _escape(c) for c in text)


def _escape(char: str) -> str:
    """A character as both YAML and Python write it in quotes."""
    short = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}.get(char)
    code = ord(char)
    return short or (f"\\x{code:02x}" if code <= 0xFF else f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}")  # noqa: PLR2004 - what the letters stand for
