"""What the Python programs share. Each is run as `-m tests.end_to_end.clients.SUBJECT TRANSPORT PORT ROLE [WORDS]`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable

import roslibpy

__all__ = ["PATIENCE", "run", "say", "serve", "settle"]

PATIENCE = 20.0
"""[s]"""


def say(**seen: object) -> None:
    """Tell the test: it reads the output, line by line."""
    print(json.dumps(seen), flush=True)  # noqa: T201 - this is a program


def settle(ros: roslibpy.Ros) -> roslibpy.Time:
    """Come back once the server has handled all that was sent before; its time."""
    return ros.get_time()


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
