"""Names of files that clients may say, checked so that each names one file on every system."""

from __future__ import annotations

import re

from rosbridge_sim.errors import DocumentError

__all__ = ["MAX_NAME", "PLAIN_NAME", "is_file_name", "safe_parts"]

MAX_NAME = 200
"""Characters of a scenario's name."""

MAX_NAME_BYTES = 255
"""Bytes of one file's or folder's name: disks refuse a longer one, and 200 Korean characters have 600."""

PLAIN_NAME = re.compile(r"(?!\.+$)[^\x00-\x1f\x7f<>:\"/\\|?*]+")
"""What names one file or folder on every system, MORAI's own included."""


def safe_parts(name: str) -> tuple[str, ...]:
    """Return the parts of a client's name of a scenario: (NAME.json,) or (MAP, NAME.json).

    Raises:
        DocumentError: it is no such name.
    """
    parts = name.replace("\\", "/").split("/")
    is_plain = len(name) <= MAX_NAME and len(parts) <= len(("MAP", "NAME")) and all(map(is_file_name, parts))
    if not parts[-1].endswith(".json"):
        parts[-1] += ".json"
    if not is_plain or not is_file_name(parts[-1]):
        raise DocumentError(f"{name[:80]!r} is no name of a scenario: expected NAME or MAP/NAME within --scenario-path")
    return tuple(parts)


def is_file_name(part: str) -> bool:
    """Tell whether a disk can have a file or folder of that name."""
    return PLAIN_NAME.fullmatch(part) is not None and len(part.encode("utf-8", "surrogatepass")) <= MAX_NAME_BYTES
