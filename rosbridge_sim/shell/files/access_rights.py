"""Errors about folders without write access, as lines that name the user and the remedy.

In a container the server is user 10001, and a mounted folder belongs to another user. The system's "Permission denied"
names neither.
"""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
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
        return _say_no_access(place)
    said = error.strerror if error is not None else None
    return said or str(error)


def _say_no_access(place: Path) -> str:
    if not hasattr(os, "geteuid"):  # Windows has no user number
        return f"this user has no write access to {place}; name another folder"
    user = os.geteuid()
    owner = ""
    with suppress(OSError):
        status = place.stat()
        owner = f" (owner {status.st_uid}, mode {stat.S_IMODE(status.st_mode):03o})"
    advice = f"change the owner (chown {user} {place}; for a container, on the host) or name another folder"
    return f"user {user} has no write access to {place}{owner}; {advice}"
