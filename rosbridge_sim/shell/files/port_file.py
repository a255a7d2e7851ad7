"""A file with the port, for programs that start a server with `--port 0` and wait until it listens.

The file appears completely or not at all: it is written under another name, then renamed. It is removed when the server
stops, but only if it is still the file that this server wrote, because a second server may have replaced it.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.access_rights import why_not_writable


class PortFile:
    """A file with the number of a port and a line end."""

    def __init__(self, path: str | Path, port: int) -> None:
        """Write the file; an existing one is replaced.

        Args:
            path: path of the file; its folder must exist. A link is followed.

        Raises:
            DocumentError: it cannot be written; nothing has changed.
        """
        try:
            self._path = Path(path).resolve()
            if self._path.exists() and not self._path.is_file():
                raise DocumentError(f"port-file {path}: expected a file or an unused name; got something else")
            part = self._path.with_name(f".{self._path.name[:_MAX_PART]}.{os.getpid()}.part")
            try:
                part.write_text(f"{port}\n", "ascii")
                self._stat = part.stat()
                part.replace(self._path)
            except OSError:
                with suppress(OSError):
                    part.unlink()
                raise
        except (OSError, RuntimeError, ValueError) as error:  # a loop of links, or an invalid name
            raise DocumentError(f"port-file {path}: cannot be written: {_why(path, error)}") from None

    def remove(self) -> None:
        """Remove the file, if it is still the one that was written. A second call does nothing."""
        with suppress(OSError):
            if os.path.samestat(self._path.stat(), self._stat):
                self._path.unlink()


_MAX_PART = 200
"""Characters of the name that are used in the name of the unfinished file; disks allow 255 bytes."""


def _why(path: str | Path, error: OSError | RuntimeError | ValueError) -> str:
    """Return why a file cannot be written, and what to do."""
    if isinstance(error, FileNotFoundError):
        return f"the folder {Path(path).absolute().parent} does not exist; create it first"
    if isinstance(error, OSError):
        return why_not_writable(Path(path).absolute().parent, error)
    return str(error)
