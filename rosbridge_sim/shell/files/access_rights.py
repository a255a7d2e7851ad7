"""Errors about folders without write access, as lines that name the user and the remedy.

In a container the server is user 10001, and a mounted folder belongs to another user. The system's "Permission denied"
names neither.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path


def find_existing(folder: Path) -> Path:
    """Return the folder itself, or its nearest parent that exists."""
    folder = folder.absolute()
    return next((place for place in (folder, *folder.parents) if os.path.lexists(place)), folder)


def is_writable(folder: Path) -> bool:
    """Return True if this process may create files in a folder, or may create the folder itself.

    Args:
        folder: the folder; it need not exist.
    """
    place = find_existing(folder)
    return place.is_dir() and os.access(place, os.W_OK | os.X_OK)


def why_not_writable(folder: Path, error: OSError | None = None) -> str:
    """Return why nothing can be written into a folder, and what to do.

    Args:
        folder: the folder; it need not exist.
        error: the system's error; None finds the reason from the folder's rights.
    """
    number = errno.EACCES if error is None else error.errno
    place = find_existing(folder)
    if not place.is_dir():
        return f"{place} is not a folder"
    if number == errno.EROFS:
        return f"{place} is mounted read-only; mount it with write access, or name another folder"
    if number in {errno.EACCES, errno.EPERM}:
        return f"{_who()} has no write access to {place}{_owner_of(place)}; {_advice(place)}"
    said = error.strerror if error is not None else None
    return said or str(error)


def _who() -> str:
    """Return the user of this process; Windows has no user number."""
    return f"user {os.geteuid()}" if hasattr(os, "geteuid") else "this user"


def _owner_of(place: Path) -> str:
    if not hasattr(os, "geteuid"):
        return ""
    try:
        status = place.stat()
    except OSError:
        return ""
    return f" (owner {status.st_uid}, mode {stat.S_IMODE(status.st_mode):03o})"


def _advice(place: Path) -> str:
    if not hasattr(os, "geteuid"):
        return "name another folder"
    return f"change the owner (chown {os.geteuid()} {place}; for a container, on the host) or name another folder"
