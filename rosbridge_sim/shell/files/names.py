"""Names of files that clients may say, checked so that each names one file on every system."""

from __future__ import annotations

import os
import re

from rosbridge_sim.errors import DocumentError

__all__ = ["MAX_NAME", "is_file_name", "is_plain_name", "safe_parts"]

MAX_NAME = 200
"""Characters of a scenario's name."""

MAX_NAME_BYTES = 255
"""Bytes of one file's or folder's name: disks refuse a longer one, and 200 Korean characters have 600."""

_PLAIN = re.compile(r"(?!\.+$)[^\x00-\x1f\x7f<>:\"/\\|?*]+")
"""Characters that every system takes in a name, MORAI's own included."""

_OF_WINDOWS = re.compile(r"(?:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³]) *(?:\..*)?|.*[. ]", re.IGNORECASE | re.DOTALL)
"""Names with a meaning of their own on Windows: a device, with any suffix and in any folder; and those whose end it
drops, which then name another file."""


def is_plain_name(part: str, *, is_windows: bool = os.name == "nt") -> bool:
    """Tell whether a text names one file or folder here, and nothing else."""
    return _PLAIN.fullmatch(part) is not None and not (is_windows and _OF_WINDOWS.fullmatch(part))


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
    return is_plain_name(part) and len(part.encode("utf-8", "surrogatepass")) <= MAX_NAME_BYTES
