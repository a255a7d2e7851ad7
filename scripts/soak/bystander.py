#!/usr/bin/env python3
"""A harmless client in its own process that measures how long the server lets it wait.

    python scripts/soak/bystander.py URL

It calls `/rosapi/get_time` a hundred times a second. For each line on stdin it writes the figures since the last one
as JSON: `num`, and `median` and `longest` in ms. It ends when stdin does.
"""

from __future__ import annotations

import json
import select
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
    """Measure until stdin ends.

    Returns:
        The exit code.
    """
    waits: list[float] = []
    with connect(sys.argv[1], compression=None, ping_interval=None, proxy=None) as socket:
        while True:
            begun = time.perf_counter()
            socket.send(_CALL)
            socket.recv(PATIENCE)
            waits.append((time.perf_counter() - begun) * 1e3)
            if select.select([sys.stdin], [], [], PAUSE)[0]:
                if not sys.stdin.readline():
                    return 0
                print(json.dumps({"num": len(waits), "median": median(waits), "longest": max(waits)}), flush=True)
                waits.clear()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ConnectionClosed as error:
        sys.exit(f"bystander: the connection is lost: {error}")
