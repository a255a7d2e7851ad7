"""Frames of a rosbridge as a client reads them, and the inboxes in which they wait."""

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

MAX_SIZE = 2**28
"""Longest frame that is read [bytes]: an image or a point cloud as base64 has a tenth of it."""

Frame = dict[str, Any]
"""A JSON object from the server. Its contents are not checked, so its values can have any type."""


class FrameReader:
    """A reader of frames, whole or in fragments. It accepts any bytes."""

    def __init__(self) -> None:
        self._pieces = Defragmenter(MAX_SIZE)

    def read(self, data: str | bytes, now: float) -> Frame | None:
        """Return the frame in a WebSocket message; None if the message completes no frame.

        Args:
            data: the message. Data that is not a JSON object is ignored.

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
    """Return the JSON object in a text; an empty one if the text is not a JSON object."""
    value: object
    try:
        value = orjson.loads(data)
    except orjson.JSONDecodeError:
        try:
            value = json.loads(data)  # some servers write a bare NaN, which is not JSON
        except (ValueError, RecursionError):
            value = None
    return value if isinstance(value, dict) else {}


def absolute(name: str) -> str:
    """Return a name with a leading slash, because `chatter` and `/chatter` are one topic. An empty name stays empty.

    Args:
        name: name of a topic or service.
    """
    return name if name.startswith("/") or not name else f"/{name}"


class Inbox:
    """Frames or messages in order of arrival, for tasks of one event loop.

    Attributes:
        num_dropped: number of the oldest items that were dropped because they were not taken in time.
    """

    def __init__(self, keep: int | None = None) -> None:
        """Create an empty inbox.

        Args:
            keep: largest number of items; if more come, the oldest is dropped first. None means no limit.
        """
        self.num_dropped = 0
        self._items: deque[Frame] = deque(maxlen=keep)
        self._news = asyncio.Event()
        self._is_ended = False
        self._error: Exception | None = None

    def put(self, item: Frame) -> None:
        """Append an item.

        Args:
            item: a frame or a message.
        """
        self.num_dropped += len(self._items) == self._items.maxlen
        self._items.append(item)
        self._news.set()

    def end(self, error: Exception | None) -> None:
        """Accept no more items. A waiting task gets the items that are left, then the error.

        Args:
            error: the error to raise; None for an end without error.
        """
        if not self._is_ended:
            self._is_ended, self._error = True, error
            self._news.set()

    @property
    def is_ended(self) -> bool:
        """True if no item is left and no more can come."""
        return self._is_ended and not self._items

    async def next(self, until: float | None) -> Frame | None:
        """Return the next item; None if no item comes in time, or if no more items can come.

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
        """Remove and return all items."""
        items = list(self._items)
        self._items.clear()
        return items
