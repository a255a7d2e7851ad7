"""A simulator behind a bridge that cannot be trusted: what passes between the two is spoiled now and then.

The simulator attaches to a proxy, and the proxy to a gateway of ours. Frames are lost, doubled, exchanged, bent and
added, in either direction, and connections are cut. So the simulator meets wrong answers, calls that nobody should
make, and messages on its own topics, but is attached all the same, most of the time.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from websockets.asyncio.client import connect
from websockets.asyncio.connection import Connection
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed, WebSocketException

from scripts.soak.fuzz_frames import FrameMaker, Interface

__all__ = ["SpoilingProxy", "spoiling"]

SHARE = 0.1
"""Of frames that are spoiled: most of what a simulator asks when it attaches again must come through."""

CUT_SHARE = 0.002
"""Of frames after which the connection is cut: it attaches for a second, then."""


class SpoilingProxy:
    """The proxy.

    Attributes:
        url: where the simulator dials.
        is_spoiling: whether it does any harm yet.
        num_spoiled, num_cut: frames, and connections.
    """

    def __init__(self, target: str, seed: str, interface: Interface) -> None:
        """A proxy that does not listen yet.

        Args:
            target: the gateway.
            seed: of all chance.
            interface: what frames that are added are about.
        """
        self.url = ""
        self.is_spoiling = False
        self.num_spoiled = self.num_cut = 0
        self._target = target
        self._maker = FrameMaker(seed, interface)

    async def handle(self, near: ServerConnection) -> None:
        """Carry the frames of one connection both ways, to the end of either."""
        with suppress(OSError, WebSocketException):
            async with connect(self._target, compression=None, max_size=None, ping_interval=None, proxy=None) as far:
                tasks = [asyncio.create_task(self._carry(*ends)) for ends in ((near, far), (far, near))]
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
                near.transport.abort()

    async def _carry(self, source: Connection, target: Connection) -> None:
        with suppress(ConnectionClosed):
            async for data in source:
                chance = self._maker.chance.random()
                if not self.is_spoiling or chance > SHARE:
                    await target.send(data)
                    continue
                if chance < CUT_SHARE:
                    self.num_cut += 1
                    return
                self.num_spoiled += 1
                for frame in self._maker.spoil(data):
                    await target.send(frame)


@asynccontextmanager
async def spoiling(target: str, seed: str, interface: Interface) -> AsyncIterator[SpoilingProxy]:
    """Run a proxy to a gateway, to the end of the block."""
    proxy = SpoilingProxy(target, seed, interface)
    async with serve(
        proxy.handle, "127.0.0.1", 0, compression=None, max_size=None, ping_interval=None, close_timeout=1.0
    ) as server:
        (socket,) = server.sockets
        proxy.url = f"ws://127.0.0.1:{socket.getsockname()[1]}"
        yield proxy
