"""The lock of a folder of results: one process writes there. The system frees it when its holder ends in any way.

Windows has no such locks; two campaigns in one folder are not refused there.
"""

from __future__ import annotations

import contextlib
import os
import platform
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


class FolderLock:
    """A file that this process has locked.

    Args:
        path: of the file; it has the number of the process and the name of its machine while the lock is held.

    Raises:
        DocumentError: another process holds the lock.
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = printable(os.read(self._file, 200).decode("utf-8", "replace").strip(), 80) or "another process"
            os.close(self._file)
            raise DocumentError(
                f"{path.parent}: {holder} writes its results here; wait until it ends, or choose another --output"
            ) from None
        except OSError:
            return  # a file system without locks, as some that are mounted
        os.ftruncate(self._file, 0)
        os.write(self._file, f"process {os.getpid()} on {platform.node()}\n".encode())

    def release(self) -> None:
        """Let another process take the lock. The file stays: another one may wait for it."""
        with contextlib.suppress(OSError):
            os.ftruncate(self._file, 0)
        os.close(self._file)
