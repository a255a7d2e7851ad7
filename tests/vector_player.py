"""Plays the vectors of `tests/vectors/`: frames in, frames out, the same against bare sessions and a live server.

A vector is one JSON line: an id of our own, the source of its claim, what it says, and steps of one key each:

    {"a>": {...}} or {"a>": "text"}   client `a` sends an object, or a text as it stands
    {"a<": {...}}                     the next frame that `a` gets is exactly this; a text that starts with `~`
                                      is a regular expression for that place
    {"a-": "close"}                   `a` goes away

When the steps are over, no client may have got anything else.
"""

from __future__ import annotations

import json
import re
from collections import deque
from pathlib import Path
from typing import Any, Protocol

__all__ = ["Clients", "load_vectors", "play"]

FOLDER = Path(__file__).parent / "vectors"


class Clients(Protocol):
    """Named clients of one server; each comes to life when it is first named."""

    async def send(self, name: str, frame: str) -> None: ...

    async def received(self, name: str) -> list[str]:
        """All that has come for this client since it was last asked."""

    async def close(self, name: str) -> None: ...


def load_vectors() -> list[dict[str, Any]]:
    """All vectors, in order of file and line."""
    return [json.loads(line) for path in sorted(FOLDER.glob("*.jsonl")) for line in path.read_text().splitlines()]


async def play(vector: dict[str, Any], clients: Clients) -> None:
    """Play a vector; an AssertionError says which step went otherwise."""
    waiting: dict[str, deque[Any]] = {}
    for number, step in enumerate(vector["steps"], 1):
        ((key, value),) = step.items()
        name, action = key[:-1], key[-1]
        waiting.setdefault(name, deque())
        if action == ">":
            await clients.send(name, value if isinstance(value, str) else json.dumps(value))
        elif action == "-":
            await clients.close(name)
        for known, frames in waiting.items():
            frames.extend(json.loads(frame) for frame in await clients.received(known))
        if action == "<":
            assert waiting[name], f"step {number}: {name} got nothing, expected {value}"
            frame = waiting[name].popleft()
            assert _agrees(value, frame), f"step {number}: {name} got {frame}, expected {value}"
    left = {name: list(frames) for name, frames in waiting.items() if frames}
    assert not left, f"nobody expected {left}"


def _agrees(expected: Any, got: Any) -> bool:  # noqa: ANN401 - any JSON value
    if isinstance(expected, str) and expected.startswith("~"):
        return isinstance(got, str) and re.fullmatch(expected[1:], got, re.DOTALL) is not None
    if isinstance(expected, dict):
        return (
            isinstance(got, dict)
            and expected.keys() == got.keys()
            and all(_agrees(v, got[k]) for k, v in expected.items())
        )
    if isinstance(expected, list):
        return isinstance(got, list) and len(expected) == len(got) and all(map(_agrees, expected, got))
    return type(expected) is type(got) and bool(expected == got)
