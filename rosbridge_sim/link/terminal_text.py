"""Texts for a terminal: one line each, without control characters."""

from __future__ import annotations


def safe(text: str) -> str:
    """Return a text on one line, without characters that a terminal could take as a command."""
    # The codec has the spelling that both YAML and Python use in quotes.
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
