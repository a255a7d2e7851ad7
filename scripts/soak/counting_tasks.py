#!/usr/bin/env python3
"""`rosbridge-sim` that reports the number of tasks of its event loop and of objects in its memory on request.

    python scripts/soak/counting_tasks.py DESCRIPTOR serve --port 0

These numbers cannot be counted from outside a process. The descriptor is a socket: for each byte received there, a line
with both numbers is sent back; for a `!`, garbage is collected first. The other arguments are those of `rosbridge-sim`.
"""

from __future__ import annotations

import asyncio
import gc
import socket
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # works from a fresh clone, too

from rosbridge_sim.__main__ import main
from rosbridge_sim.shell import app


class _Counting(app.Simulator):
    """A simulator whose event loop also reads the descriptor."""

    channel: socket.socket

    async def start(self) -> None:
        """Start, and answer requests from now on."""
        await super().start()
        asyncio.get_running_loop().add_reader(self.channel, self._answer)

    def _answer(self) -> None:
        asked = self.channel.recv(100)
        if asked:
            if asked == b"!":
                gc.collect()
            self.channel.send(b"%d %d\n" % (len(asyncio.all_tasks()), sys.getallocatedblocks()))
        else:  # the other end is closed; the socket would stay readable for ever
            asyncio.get_running_loop().remove_reader(self.channel)


if __name__ == "__main__":
    _Counting.channel = socket.socket(fileno=int(sys.argv.pop(1)))
    app.Simulator = _Counting  # type: ignore[misc] # the one that `serve` builds
    sys.exit(main())
