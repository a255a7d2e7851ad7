"""Shared code of the client programs, run as `-m tests.end_to_end.clients.SUBJECT TRANSPORT PORT ROLE [WORDS]`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable

import roslibpy

__all__ = ["PATIENCE", "run", "say", "serve", "settle"]

PATIENCE = 60.0
"""[s]"""

UNITS = {"secs": 1.0, "nsecs": 1e-9, "sec": 1.0, "nanosec": 1e-9}
"""Of the parts of a time, in either generation [s]."""


def say(**seen: object) -> None:
    """Tell the test: it reads the output, line by line."""
    print(json.dumps(seen), flush=True)  # noqa: T201 - this is a program


def settle(ros: roslibpy.Ros) -> float:
    """Come back once the server has handled all that was sent before; its time [s].

    roslibpy's own get_time() does not know the time of ROS 2.
    """
    service = roslibpy.Service(ros, "/rosapi/get_time", "rosapi/GetTime")
    time = service.call(roslibpy.ServiceRequest(), timeout=PATIENCE)["time"]
    return float(sum(time[key] * unit for key, unit in UNITS.items() if key in time))


def serve() -> None:
    """Come back when stdin ends."""
    sys.stdin.read()


def run(**roles: Callable[..., None]) -> None:
    """Connect, and play the role that the command line names."""
    transport, port, role, *words = sys.argv[1:]
    ros = roslibpy.Ros("127.0.0.1", int(port), transport=transport)
    ros.run(timeout=PATIENCE)
    try:
        roles[role](ros, *words)
    finally:
        ros.terminate()
