#!/usr/bin/env python3
"""A harmless client in its own process that measures how long the server lets it wait.

    python scripts/soak/bystander.py FD URL

It calls `/rosapi/get_time` a hundred times a second. FD is a socket: each line on it is answered with the figures since
the last one as a line of JSON: `num`, and `median` and `longest` in ms. It ends when the other end is closed.
"""

from __future__ import annotations

import json
import select
import socket
import sys
import time
from statistics import median

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PAUSE = 0.01
"""Pause between two calls [s]: a stall of 20 ms is always seen, and the calls use 1 % of a core of the server."""

PATIENCE = 60.0
"""Longest wait for an answer before the server counts as lost [s]."""

_CALL = json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "bystander"})


def main() -> int:
    """Measure until the other end of the socket is closed."""
    waits: list[float] = []
    channel = socket.socket(fileno=int(sys.argv[1]))
    with channel, connect(sys.argv[2], compression=None, ping_interval=None, proxy=None) as connection:
        while True:
            begun = time.perf_counter()
            connection.send(_CALL)
            connection.recv(PATIENCE)
            waits.append((time.perf_counter() - begun) * 1e3)
            if select.select([channel], [], [], PAUSE)[0]:
                if not channel.recv(1):
                    return 0
                figures = {"num": len(waits), "median": median(waits), "longest": max(waits)}
                channel.sendall(json.dumps(figures).encode() + b"\n")
                waits.clear()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ConnectionClosed as error:
        sys.exit(f"bystander: the connection is lost: {error}")
