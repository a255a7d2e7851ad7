"""Plays the vectors of `tests/vectors/`: frames in, frames out, the same against bare sessions and a live server.

A vector is one JSON line: an id of our own, the source of its claim, what it says, and steps of one key each:

    {"a>": {...}} or {"a>": "text"}   client `a` sends an object, or a text as it stands
    {"a<": {...}}                     the next frame that `a` gets is exactly this; a text that starts with `~`
                                      is a regular expression for that place
    {"a-": "close"}                   `a` goes away

A binary frame is written {"$hex": "..."} where it is sent, and {"$cbor": ...} where it is got: the CBOR value in it,
with byte strings as {"$hex": ...} and tagged ones as {"$tag": number, "$hex": ...}.

When the steps are over, no client may have got anything else.
"""

from __future__ import annotations

import json
import re
from collections import deque
from pathlib import Path
from typing import Any, Protocol

import cbor2

from rosbridge_sim.loose_types import JsonValue

__all__ = ["FOLDER", "Clients", "load_vectors", "play", "read_frame"]

FOLDER = Path(__file__).parent / "vectors"


class Clients(Protocol):
    """Named clients of one server; each comes to life when it is first named."""

    async def send(self, name: str, frame: str | bytes) -> None: ...

    async def received(self, name: str) -> list[Any]:
        """All that has come for this client since it was last asked, read by `read_frame`."""

    async def close(self, name: str) -> None: ...


def read_frame(frame: str | bytes) -> JsonValue:
    """What a frame of the server's says: the value of a text frame, or of a binary one under `$cbor`."""
    return {"$cbor": _plain(cbor2.loads(frame))} if isinstance(frame, bytes) else json.loads(frame)


def _plain(value: Any) -> Any:  # noqa: ANN401 - any CBOR value to any JSON value
    if isinstance(value, cbor2.CBORTag):
        return {"$tag": value.tag, **_plain(value.value)}
    if isinstance(value, bytes):
        return {"$hex": value.hex()}
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    return "NaN" if value != value else value  # noqa: PLR0124 - only NaN differs from itself


def _write_frame(value: JsonValue) -> str | bytes:
    if isinstance(value, dict) and value.keys() == {"$hex"}:
        return bytes.fromhex(value["$hex"])
    return value if isinstance(value, str) else json.dumps(value)


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
            await clients.send(name, _write_frame(value))
        elif action == "-":
            await clients.close(name)
        for known, frames in waiting.items():
            frames.extend(await clients.received(known))
        if action == "<":
            assert waiting[name], f"step {number}: {name} got nothing, expected {value}"
            frame = waiting[name].popleft()
            assert _agrees(value, frame), f"step {number}: {name} got {frame}, expected {value}"
    left = {name: list(frames) for name, frames in waiting.items() if frames}
    assert not left, f"nobody expected {left}"


def _agrees(expected: JsonValue, got: JsonValue) -> bool:
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
