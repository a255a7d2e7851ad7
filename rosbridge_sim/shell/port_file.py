"""A file that names the port, for programs that start a server with `--port 0` and wait until it listens.

The file appears whole or not at all: it is written under another name, then renamed. It goes when the server stops, but
only where it is still the one that this server wrote: a second server may have taken the name meanwhile.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.access_rights import why_not_writable

__all__ = ["PortFile"]


class PortFile:
    """A file with the number of a port and a line end in it."""

    def __init__(self, path: str | Path, port: int) -> None:
        """Write it; a file that is there already is replaced.

        Args:
            path: of the file; its folder must be there. A link is followed.
            port: the number.

        Raises:
            DocumentError: it cannot be written; nothing has changed.
        """
        try:
            self._path = Path(path).resolve()
            if self._path.exists() and not self._path.is_file():
                raise DocumentError(f"port-file {path}: expected a file, or a name that is free; got something else")
            part = self._path.with_name(f".{self._path.name[:_MAX_PART]}.{os.getpid()}.part")
            try:
                part.write_text(f"{port}\n", "ascii")
                self._stat = part.stat()
                part.replace(self._path)
            except OSError:
                with suppress(OSError):
                    part.unlink()
                raise
        except (OSError, RuntimeError, ValueError) as error:  # links in a circle, a name that is none
            raise DocumentError(f"port-file {path}: cannot be written: {_why(path, error)}") from None

    def remove(self) -> None:
        """Remove it, if it is still the one that was written. Twice is no error."""
        with suppress(OSError):
            if os.path.samestat(self._path.stat(), self._stat):
                self._path.unlink()


_MAX_PART = 200
"""Characters of the name in that of the unfinished file; a disk takes 255 bytes."""


def _why(path: str | Path, error: OSError | RuntimeError | ValueError) -> str:
    """Return why a file cannot be written, and what helps."""
    if isinstance(error, FileNotFoundError):
        return f"the folder {Path(path).absolute().parent} is not there; make it first"
    if isinstance(error, OSError):
        return why_not_writable(Path(path).absolute().parent, error)
    return str(error)
