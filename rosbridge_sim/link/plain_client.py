"""A connection to any rosbridge that hands over frames as they come, also those that no honest server sends."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from rosbridge_sim.link.library_log import quiet

MAX_FRAME = 64 * 2**20
"""Longest frame that is taken from a server [bytes]."""

MAX_FRAMES = 20_000
"""Most frames that a connection takes; behind them it is no longer read."""

MAX_BYTES = 2 * MAX_FRAME
"""Most bytes that a connection takes."""

CLOSE_TIMEOUT = 1.0
"""Longest wait for the other side's part of a close [s]."""


OnFrame = Callable[[str | bytes], bool]
"""Takes a frame; True means that it is done with."""


class PlainClient:
    """A connection. A frame is a text or bytes; after the last one stands why the connection ended.

    Attributes:
        connection: that of the library.
        frames: frames that came and were not taken, oldest first.
        ending: code and reason of the close, once the connection has ended.
    """

    def __init__(self, connection: ClientConnection, on_frame: OnFrame | None) -> None:
        self.connection = connection
        self.frames: list[str | bytes] = []
        self.ending: tuple[int, str] | None = None
        self._on_frame = on_frame
        self._changed = asyncio.Event()
        self._reader = asyncio.get_running_loop().create_task(self._read())

    @classmethod
    async def open(
        cls,
        url: str,
        *,
        token: str | None = None,
        patience: float = 5.0,
        on_frame: OnFrame | None = None,
        **offer: Any,  # noqa: ANN401 - arguments of the library
    ) -> PlainClient:
        """Connect.

        Args:
            url: full URL.
            token: token of the server; None sends none.
            patience: longest wait for the connection [s].
            on_frame: called with each frame; True means that it is done with.
            offer: what the handshake offers: `compression`, `subprotocols`.

        Raises:
            OSError, ValueError, WebSocketException: there is no connection; see `why_not`.
        """
        connection = await connect(
            url,
            additional_headers={"Authorization": f"Bearer {token}"} if token else {},
            open_timeout=patience,
            close_timeout=CLOSE_TIMEOUT,
            ping_interval=None,
            max_size=MAX_FRAME,
            proxy=None,
            logger=quiet,
            **{"compression": None, **offer},
        )
        return cls(connection, on_frame)

    async def _read(self) -> None:
        num_frames = num_bytes = 0
        why = ""
        try:
            async for frame in self.connection:
                if self._on_frame is None or not self._on_frame(frame):
                    self.frames.append(frame)
                self._changed.set()
                num_frames, num_bytes = num_frames + 1, num_bytes + len(frame)
                if num_frames >= MAX_FRAMES or num_bytes >= MAX_BYTES:
                    why = f"it sends more than {MAX_FRAMES:,} frames or {MAX_BYTES // 10**6} MB"
                    break
        except ConnectionClosed:
            pass
        finally:
            self.ending = (self.connection.close_code or 1006, why or self.connection.close_reason or "")
            self._changed.set()

    async def send(self, frame: str | bytes) -> None:
        """Send a frame; if the connection has ended, nothing is sent."""
        with suppress(ConnectionClosed):
            await self.connection.send(frame)

    async def wait(self, until: float) -> bool:
        """Wait for the next frame, or for the end of the connection; return False if neither comes in time.

        Args:
            until: time of the event loop [s].
        """
        self._changed.clear()
        try:
            async with asyncio.timeout_at(until):
                await self._changed.wait()
        except TimeoutError:
            return False
        return True

    async def close(self) -> None:
        """Close the connection."""
        await self.connection.close()
        self._reader.cancel()
        with suppress(asyncio.CancelledError):
            await self._reader
