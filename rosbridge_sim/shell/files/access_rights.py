"""Errors of files that may not be written, as lines that say which user is meant and what helps.

In a container the server is user 10001, and a folder that is mounted belongs to somebody else. "Permission denied"
alone names neither.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

__all__ = ["find_existing", "is_writable", "why_not_writable"]


def find_existing(folder: Path) -> Path:
    """Return the folder itself, or the innermost of its parents that is there."""
    folder = folder.absolute()
    return next((place for place in (folder, *folder.parents) if os.path.lexists(place)), folder)


def is_writable(folder: Path) -> bool:
    """Tell whether this process may make files in a folder, or may make the folder where it is not there yet."""
    place = find_existing(folder)
    return place.is_dir() and os.access(place, os.W_OK | os.X_OK)


def why_not_writable(folder: Path, error: OSError | None = None) -> str:
    """Return why nothing can be written into a folder, and what helps.

    Args:
        folder: in which something was to be written; it need not be there.
        error: what the system said; None takes it from the folder's rights.
    """
    number = errno.EACCES if error is None else error.errno
    place = find_existing(folder)
    if not place.is_dir():
        return f"{place} is no folder"
    if number == errno.EROFS:
        return f"{place} is mounted read-only; mount it so that it can be written, or name another folder"
    if number in {errno.EACCES, errno.EPERM}:
        return f"{_who()} may not write into {place}{_owner_of(place)}; {_advice(place)}"
    said = error.strerror if error is not None else None
    return said or str(error)


def _who() -> str:
    """Return the user of this process; Windows has no number for it."""
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
    return f"give it the folder (chown {os.geteuid()} {place}; for a container, on the host) or name another one"
