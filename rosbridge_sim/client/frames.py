"""Frames of a rosbridge as a client reads them, and inboxes in which they wait."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from typing import Any

import msgspec
import orjson

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.fragments import Defragmenter
from rosbridge_sim.protocol.ops import Fragment

__all__ = ["MAX_SIZE", "Frame", "FrameReader", "Inbox", "absolute"]

MAX_SIZE = 2**28
"""Longest frame that is read [bytes]: an image or a point cloud as base64 has a tenth of it."""

Frame = dict[str, Any]
"""A JSON object from the server. Nothing in it has been checked, so its values are of any type."""


class FrameReader:
    """Reads frames, also those that come in fragments. Any bytes give a frame, a text about a fault, or nothing."""

    def __init__(self) -> None:
        """Hold no fragments yet."""
        self._pieces = Defragmenter(MAX_SIZE)

    def read(self, data: str | bytes, now: float) -> Frame | None:
        """Return the frame in a WebSocket message; None where it completes none.

        Args:
            data: the message; what is no JSON object is passed over.
            now: monotonic time [s].

        Raises:
            FrameError: a fragment that cannot be used.
        """
        frame = _parse(data)
        if frame.get("op") == "fragment":
            try:
                whole = self._pieces.add(msgspec.convert(frame, Fragment), now)
            except msgspec.ValidationError as error:
                raise FrameError(str(error)) from None
            frame = _parse(whole or b"")
        return frame or None


def _parse(data: str | bytes) -> Frame:
    """Return the JSON object in a text; an empty one if there is none."""
    value: object
    try:
        value = orjson.loads(data)
    except orjson.JSONDecodeError:
        try:
            value = json.loads(data)  # some servers write a bare NaN, which is no JSON
        except (ValueError, RecursionError):
            value = None
    return value if isinstance(value, dict) else {}


def absolute(name: str) -> str:
    """Return the name with its leading slash: `chatter` and `/chatter` are one topic. An empty name stays one."""
    return name if name.startswith("/") or not name else f"/{name}"


class Inbox:
    """Frames or messages in order of arrival, for tasks of one event loop.

    Attributes:
        num_dropped: the oldest ones that had to go because nobody took them.
    """

    def __init__(self, keep: int | None = None) -> None:
        """Hold nothing.

        Args:
            keep: how many wait at most; then the oldest is dropped first. None sets no limit.
        """
        self.num_dropped = 0
        self._items: deque[Frame] = deque(maxlen=keep)
        self._news = asyncio.Event()
        self._is_ended = False
        self._error: Exception | None = None

    def put(self, item: Frame) -> None:
        """Append an item."""
        self.num_dropped += len(self._items) == self._items.maxlen
        self._items.append(item)
        self._news.set()

    def end(self, error: Exception | None) -> None:
        """Let nothing more come: whoever waits gets what is there, then the error, or None for an end in order."""
        if not self._is_ended:
            self._is_ended, self._error = True, error
            self._news.set()

    @property
    def is_ended(self) -> bool:
        """Whether nothing more comes and nothing is left."""
        return self._is_ended and not self._items

    async def next(self, until: float | None) -> Frame | None:
        """Return the next item; None if none comes until then, or if none comes any more.

        Args:
            until: time of the event loop [s]; None waits without a limit.

        Raises:
            ConnectionLostError: the connection has ended.
        """
        if not self._items:
            try:
                async with asyncio.timeout_at(until):
                    while not self._items and not self._is_ended:
                        self._news.clear()
                        await self._news.wait()
            except TimeoutError:
                return None
        if self._items:
            return self._items.popleft()
        if self._error is not None:
            raise self._error
        return None

    def take(self) -> list[Frame]:
        """Return all that is there, and keep none of it."""
        items = list(self._items)
        self._items.clear()
        return items
