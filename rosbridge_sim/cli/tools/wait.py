"""`wait`: until a server takes clients, for scripts that start one and go on."""

from __future__ import annotations

import asyncio

from rosbridge_sim.cli.tools.client import open_bridge
from rosbridge_sim.errors import ConnectError
from rosbridge_sim.shell.websocket.bridge_errors import BridgeError, RefusedError

__all__ = ["wait_until_ready"]

PAUSE = 0.1
"""Between two attempts [s]: a start takes half a second to a second."""

ATTEMPT = 2.0
"""Longest time of one attempt [s]: a port that is open but served by nobody yet does not use up all the time."""


async def wait_until_ready(url: str, token: str | None, patience: float) -> int:
    """Come back with 0 once a WebSocket handshake has succeeded, which a simulator allows when all is loaded.

    Args:
        url: of the server.
        token: what lets us in, where something must.
        patience: how long it may take [s].

    Raises:
        RefusedError: it was not ready in time, or it does not let us in.
        BridgeError: the URL is none.
    """
    loop = asyncio.get_running_loop()
    until = loop.time() + patience
    while True:
        left = until - loop.time()
        try:
            async with open_bridge(url, token, min(ATTEMPT, max(left, PAUSE))):
                return 0
        except RefusedError as error:  # it was there, and went
            why: Exception = error
        except BridgeError as error:
            cause = error.__cause__
            if isinstance(cause, ConnectError) and cause.is_final:
                if cause.status is None:  # the URL or the token is none
                    raise
                raise RefusedError(str(error)) from None
            why = error
        if loop.time() + PAUSE >= until:
            raise RefusedError(f"not ready within {patience:g} s: {why}")
        await asyncio.sleep(PAUSE)
