"""`wait`: wait until a server accepts clients, for scripts that start one."""

from __future__ import annotations

import asyncio

from rosbridge_sim.cli.tools.tool_client import open_bridge
from rosbridge_sim.errors import ConnectError
from rosbridge_sim.link.bridge_errors import BridgeError, RefusedError

PAUSE = 0.1
"""Time between two attempts [s]; a server starts in half a second to a second."""

ATTEMPT = 2.0
"""Longest time of one attempt [s], so that an open port without a running server does not use up all the time."""


async def wait_until_ready(url: str, token: str | None, patience: float) -> int:
    """Wait for a successful WebSocket handshake, which a simulator allows when everything is loaded.

    Args:
        token: token of the server; None sends none.
        patience: longest wait [s].

    Returns:
        The exit code, 0.

    Raises:
        RefusedError: it was not ready in time, or it refuses the token or the client.
        BridgeError: the URL is not valid.
    """
    loop = asyncio.get_running_loop()
    until = loop.time() + patience
    while True:
        left = until - loop.time()
        try:
            async with open_bridge(url, token, min(ATTEMPT, max(left, PAUSE))):
                return 0
        except RefusedError as error:  # the server closed the connection again
            why: Exception = error
        except BridgeError as error:
            cause = error.__cause__
            if isinstance(cause, ConnectError) and cause.is_final:
                if cause.status is None:  # the URL or the token is malformed
                    raise
                raise RefusedError(str(error)) from None
            why = error
        if loop.time() + PAUSE >= until:
            raise RefusedError(f"not ready within {patience:g} s: {why}")
        await asyncio.sleep(PAUSE)
