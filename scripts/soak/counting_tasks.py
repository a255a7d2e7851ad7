#!/usr/bin/env python3
"""`rosbridge-sim` that says how many tasks its event loop has, whenever it is asked.

    python scripts/soak/counting_tasks.py DESCRIPTOR serve --port 0

Nothing outside a process can count its tasks. The descriptor is a socket: for each byte that comes there, the number
goes back, a line each. Everything else is the command line as it is.
"""

from __future__ import annotations

import asyncio
import socket
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # works from a fresh clone, too

from rosbridge_sim.__main__ import main
from rosbridge_sim.shell import app


class _Counting(app.Simulator):
    """A simulator whose loop also listens to the descriptor."""

    channel: socket.socket

    async def start(self) -> None:
        """Start, and answer from now on."""
        await super().start()
        asyncio.get_running_loop().add_reader(self.channel, self._answer)

    def _answer(self) -> None:
        if self.channel.recv(100):
            self.channel.send(b"%d\n" % len(asyncio.all_tasks()))
        else:  # the other end is gone, and would be readable for ever
            asyncio.get_running_loop().remove_reader(self.channel)


if __name__ == "__main__":
    _Counting.channel = socket.socket(fileno=int(sys.argv.pop(1)))
    app.Simulator = _Counting  # type: ignore[misc] # the one that `serve` builds
    sys.exit(main())
