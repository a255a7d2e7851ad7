"""Plays the checks of `rosbridge_sim/doctor/checks/` exactly, against bare sessions and a live server.

The forms of frames and steps are those of `check_frames.py` and `check.py` in `rosbridge_sim/doctor/`.
When the steps are over, no client may have got anything else.
"""

from __future__ import annotations

import json
from collections import deque
from pathlib import Path
from typing import Any, Protocol

from rosbridge_sim.doctor.check_frames import agrees, write_frame

__all__ = ["CHECKS", "FOLDER", "Clients", "load_vectors", "play"]

FOLDER = Path(__file__).parent / "vectors"

CHECKS = Path(__file__).parent.parent / "rosbridge_sim" / "doctor" / "checks"


class Clients(Protocol):
    """Named clients of one server; each comes to life when it is first named."""

    async def send(self, name: str, frame: str | bytes) -> None: ...

    async def received(self, name: str) -> list[Any]:
        """All that has come for this client since it was last asked, read by `read_frame`.

        What follows from the frames that were sent is there.
        """

    async def close(self, name: str) -> None: ...


def load_vectors() -> list[dict[str, Any]]:
    """All checks, in order of file and line."""
    return [json.loads(line) for path in sorted(CHECKS.glob("*.jsonl")) for line in path.read_text().splitlines()]


async def play(vector: dict[str, Any], clients: Clients) -> None:
    """Play a vector; an AssertionError says which step went otherwise."""
    waiting: dict[str, deque[Any]] = {}
    unjudged: set[str] = set()
    for number, step in enumerate(vector["steps"], 1):
        ((key, value),) = step.items()
        name, action = key[:-1], key[-1]
        waiting.setdefault(name, deque())
        if action == ">":
            await clients.send(name, write_frame(value))
        elif action == "-":
            waiting[name].extend(await clients.received(name))
            await clients.close(name)
        elif action == "?":
            unjudged.add(name)
        elif action == "<":
            if not waiting[name]:
                waiting[name].extend(await clients.received(name))
            assert waiting[name], f"step {number}: {name} got nothing, expected {value}"
            frame = waiting[name].popleft()
            assert agrees(value, frame), f"step {number}: {name} got {frame}, expected {value}"
    for known, frames in waiting.items():
        frames.extend(await clients.received(known))
    left = {name: list(frames) for name, frames in waiting.items() if frames and name not in unjudged}
    assert not left, f"nobody expected {left}"
