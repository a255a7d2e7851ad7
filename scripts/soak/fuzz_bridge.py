"""A simulator behind a bridge that damages frames now and then.

The simulator attaches to a proxy, and the proxy connects to a gateway of ours. The proxy drops, doubles, swaps, changes
and adds frames in both directions, and it cuts connections. So the simulator meets wrong answers, unexpected calls and
messages on its own topics. Most of the time it stays attached.
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

SHARE = 0.1
"""Share of damaged frames: most requests of a simulator that attaches again must pass."""

CUT_SHARE = 0.002
"""Share of frames after which the connection is cut: the simulator is then attached for about a second."""


class SpoilingProxy:
    """The proxy.

    Attributes:
        url: address for the simulator.
        is_spoiling: damage frames.
        num_spoiled, num_cut: numbers of damaged frames and of cut connections.
    """

    def __init__(self, target: str, seed: str, interface: Interface) -> None:
        """Prepare; the proxy does not listen yet.

        Args:
            target: URL of the gateway.
            seed: random seed.
            interface: topics and services for added frames.
        """
        self.url = ""
        self.is_spoiling = False
        self.num_spoiled = self.num_cut = 0
        self._target = target
        self._maker = FrameMaker(seed, interface)

    async def handle(self, near: ServerConnection) -> None:
        """Forward the frames of one connection in both directions, until either side ends.

        Args:
            near: the connection of the simulator.
        """
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
    """Run a proxy to a gateway, until the end of the block.

    Args:
        target: URL of the gateway.
        seed: random seed.
        interface: topics and services for added frames.

    Yields:
        The proxy.
    """
    proxy = SpoilingProxy(target, seed, interface)
    async with serve(
        proxy.handle, "127.0.0.1", 0, compression=None, max_size=None, ping_interval=None, close_timeout=1.0
    ) as server:
        (socket,) = server.sockets
        proxy.url = f"ws://127.0.0.1:{socket.getsockname()[1]}"
        yield proxy
