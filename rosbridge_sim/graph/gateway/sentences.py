"""Sentences about nodes on a graph, and the log that has each of them once."""

from __future__ import annotations

import logging
from typing import Final

from rosbridge_sim.printable import printable

MAX_LINES: Final = 200
"""Most lines that a log takes once each: a graph could make us remember any number of them."""

MAX_LINE: Final = 400
"""Longest line that has text of nodes in it [characters]."""


def node_text(node: str, program: str) -> str:
    """Return the text for a node in messages: its name, if it is known, and the GUID of its program."""
    known = f"GUID {program}" if program else ""
    return f"{node} ({known})" if node and known else node or (f"a program ({known})" if known else "a program there")


class OnceLog:
    """Lines of a log, each of which is written once."""

    def __init__(self, logger: str) -> None:
        self._log = logging.getLogger(logger)
        self._told: set[str] = set()

    def tell(self, text: str, level: int = logging.WARNING, key: str = "") -> None:
        """Write a line, unless it is known.

        Args:
            text: the line.
            level: its level.
            key: the same for lines that say the same with other values; empty takes the text.
        """
        key = key or text
        if key not in self._told and len(self._told) < MAX_LINES:
            self._told.add(key)
            self._log.log(level, "%s", printable(text, MAX_LINE))

    def notify(self, level: str, text: str) -> None:
        """Write a notice of the bus.

        Args:
            level: its level by name, such as `warning`.
        """
        self.tell(text, logging.getLevelNamesMapping().get(level.upper(), logging.WARNING))
