#!/usr/bin/env python3
"""`rosbridge-sim` that reports numbers of its event loop and its memory on request.

    python scripts/soak/counting_tasks.py DESCRIPTOR serve --port 0

These numbers cannot be counted from outside a process. The descriptor is a socket. Each byte received there is a
question, and a line is sent back:

    ?   number of tasks of the event loop, and of objects in memory
    !   the same, after garbage was collected
    ~   longest CPU time of the loop's thread between two heartbeats since the last such question [ns]

A heartbeat is a timer of the loop. The CPU time between two of them is that of one long pass of the loop, also on a
busy machine, where the time of day has the time of other processes in it. The first `~` starts the heartbeat. The other
arguments are those of `rosbridge-sim`.
"""

from __future__ import annotations

import asyncio
import gc
import socket
import sys
from pathlib import Path
from time import thread_time_ns

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # works from a fresh clone, too

from rosbridge_sim.__main__ import main
from rosbridge_sim.shell import app

BEAT = 0.002
"""Time between two heartbeats [s]: the length of a client's turn."""


class _Heartbeat:
    """Timer of an event loop that measures the CPU time of the loop's thread between two of its calls."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._last_ns = thread_time_ns()
        self._longest_ns = 0
        self._beat()

    def _beat(self) -> None:
        self._note()
        self._loop.call_later(BEAT, self._beat)

    def _note(self) -> None:
        now = thread_time_ns()
        self._longest_ns = max(self._longest_ns, now - self._last_ns)
        self._last_ns = now

    def take(self) -> int:
        """Return the longest CPU time since the last call [ns], with the current one."""
        self._note()
        longest, self._longest_ns = self._longest_ns, 0
        return longest


class _Counting(app.Simulator):
    """A simulator whose event loop also reads the descriptor."""

    channel: socket.socket
    heartbeat: _Heartbeat | None = None

    async def start(self) -> None:
        """Start, and answer requests from now on."""
        await super().start()
        asyncio.get_running_loop().add_reader(self.channel, self._answer)

    def _answer(self) -> None:
        asked = self.channel.recv(100)
        if not asked:  # the other end is closed; the socket would stay readable for ever
            asyncio.get_running_loop().remove_reader(self.channel)
        elif asked == b"~":
            self.channel.send(b"%d\n" % self._take_longest())
        else:
            if asked == b"!":
                gc.collect()
            self.channel.send(b"%d %d\n" % (len(asyncio.all_tasks()), sys.getallocatedblocks()))

    def _take_longest(self) -> int:
        if self.heartbeat is None:
            self.heartbeat = _Heartbeat(asyncio.get_running_loop())
        return self.heartbeat.take()


if __name__ == "__main__":
    _Counting.channel = socket.socket(fileno=int(sys.argv.pop(1)))
    app.Simulator = _Counting  # type: ignore[misc] # the one that `serve` builds
    sys.exit(main())
