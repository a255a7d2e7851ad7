"""Checks of file names from clients, so that each name means one file on every system."""

from __future__ import annotations

import os
import re

from rosbridge_sim.errors import DocumentError

MAX_NAME = 200
"""Longest name of a scenario [characters]."""

MAX_NAME_BYTES = 255
"""Longest name of one file or folder [bytes], the limit of disks; 200 Korean characters have 600 bytes."""

_PLAIN = re.compile(r"(?!\.+$)[^\x00-\x1f\x7f<>:\"/\\|?*]+")
"""Characters that every system allows in a name; MORAI's own names use no others."""

_OF_WINDOWS = re.compile(r"(?:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³]) *(?:\..*)?|.*[. ]", re.IGNORECASE | re.DOTALL)
"""Names with a special meaning on Windows: devices, with any suffix and in any folder; and names whose last character
Windows removes, so that they mean another file."""


def is_plain_name(part: str, *, is_windows: bool = os.name == "nt") -> bool:
    """Return True if a text is the name of exactly one file or folder.

    Args:
        part: the text, without folders.
        is_windows: check for Windows, too.
    """
    return _PLAIN.fullmatch(part) is not None and not (is_windows and _OF_WINDOWS.fullmatch(part))


def safe_parts(name: str) -> tuple[str, ...]:
    """Return the parts of a client's name of a scenario: (NAME.json,) or (MAP, NAME.json); `.xosc` stays as it is.

    Args:
        name: NAME or MAP/NAME.

    Raises:
        DocumentError: it is not such a name.
    """
    parts = name.replace("\\", "/").split("/")
    is_plain = len(name) <= MAX_NAME and len(parts) <= len(("MAP", "NAME")) and all(map(is_file_name, parts))
    if not parts[-1].endswith((".json", ".xosc")):
        parts[-1] += ".json"
    if not is_plain or not is_file_name(parts[-1]):
        raise DocumentError(f"{name[:80]!r} is not a scenario's name: expected NAME or MAP/NAME within --scenario-path")
    return tuple(parts)


def is_file_name(part: str) -> bool:
    """Return True if a file or folder on a disk can have that name.

    Args:
        part: the text, without folders.
    """
    return is_plain_name(part) and len(part.encode("utf-8", "surrogatepass")) <= MAX_NAME_BYTES
