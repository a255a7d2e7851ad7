"""Parts of sentences about nodes and names on a graph."""

from __future__ import annotations

from collections.abc import Sequence


def node_text(node: str, program: str) -> str:
    """Return the text for a node in messages: its name, if it is known, and the GUID of its program."""
    known = f"GUID {program}" if program else ""
    return f"{node} ({known})" if node and known else node or (f"a program ({known})" if known else "a program there")


def name_some(names: Sequence[str], most: int = 3) -> str:
    """Return the first names of a list, and how many more there are."""
    shown, more = ", ".join(names[:most]), len(names) - most
    return f"{shown} and {more} more" if more > 0 else shown
