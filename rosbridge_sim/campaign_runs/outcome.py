"""Outcome of one drive: its trace, its log, and the reason if it ended early."""

from __future__ import annotations

import io
import traceback
from dataclasses import dataclass, field
from pathlib import Path

from rosbridge_sim.campaigns.own_limits import OwnLimits
from rosbridge_sim.campaigns.trace import Trace
from rosbridge_sim.printable import MAX_QUOTED, printable

HEAD = 32 * 1024
TAIL = 96 * 1024
"""Bytes of a driver's output that are kept, of its beginning and of its end."""


@dataclass(slots=True)
class Outcome:
    """One drive.

    Attributes:
        trace: of the frames that were driven.
        own: the user's own limits, judged so far.
        state_hash: of the world at the end.
        error: why it could not be driven to its end; empty if it was.
        log: what the driver printed, and how it ended.
        roads: lines of the lanes near the end, for a picture; (x, y) each [m].
        work: folder of the drive's own files, such as a recording; None for none.
    """

    trace: Trace
    own: OwnLimits
    state_hash: str = ""
    error: str = ""
    log: str = ""
    roads: list[list[tuple[float, float]]] = field(default_factory=list)
    work: Path | None = None


def told_error(error: BaseException) -> str:
    """Return kind and first line of an error of the user's code, without what no file can hold."""
    kind = printable(type(error).__name__, MAX_QUOTED)
    try:
        text = printable(str(error).partition("\n")[0], MAX_QUOTED)
    except (Exception, SystemExit):  # noqa: BLE001 - the user's class
        text = ""
    return f"{kind}: {text}" if text else kind


def told_trace(error: BaseException) -> str:
    """Return the traceback of an error of the user's code, as it may be kept."""
    output = KeptOutput()
    output.writelines(traceback.format_exception(error))
    return output.text


class KeptOutput(io.TextIOBase):
    """The beginning and the end of a driver's output. The middle is counted, not kept. Texts may be printed into it."""

    def __init__(self) -> None:
        super().__init__()
        self._head = bytearray()
        self._tail = bytearray()
        self._num = 0

    def write(self, text: str) -> int:
        """Take a piece of text; return its length."""
        self.take(text.encode("utf-8", "backslashreplace"))
        return len(text)

    def take(self, data: bytes) -> None:
        """Take a piece of the output."""
        self._num += len(data)
        room = HEAD - len(self._head)
        if room > 0:
            self._head += data[:room]
            data = data[room:]
        if data:
            self._tail += data[-TAIL:]
            if len(self._tail) > 2 * TAIL:
                del self._tail[:-TAIL]

    @property
    def text(self) -> str:
        """The beginning and the end of the output, with the number of bytes between that are left out."""
        tail = bytes(self._tail[-TAIL:])
        left_out = self._num - len(self._head) - len(tail)
        gap = f"\n... {left_out:,} bytes are left out ...\n".encode() if left_out else b""
        return (bytes(self._head) + gap + tail).decode("utf-8", "backslashreplace")
