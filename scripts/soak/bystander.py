#!/usr/bin/env python3
"""A client that does no harm, in a process of its own, and measures how long the server keeps it waiting.

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
"""Between two calls [s]: a stall of 20 ms is seen whenever it begins, and the server has 1 % of a core to do."""

PATIENCE = 60.0
"""A server that gives no answer for so long is lost [s]."""

_CALL = json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "bystander"})


def main() -> int:
    """Measure until stdin ends."""
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
        sys.exit(f"bystander: the server has gone: {error}")
