#!/usr/bin/env python3
"""Drive the Autobahn TestSuite's cases against an echo on our socket class, and against the library's own echo.

    ./.venv/bin/python scripts/autobahn.py [CASE ...]

A CASE is an id or a pattern (`6.*`); without one, all 517 run, in about twenty minutes. The exit code is 1 if a case
passes at the reference and fails here. `kosoku` (PyPI) runs Autobahn's own case files.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from math import inf
from typing import Any

from kosoku import FailureError, run_fuzzingclient
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.transport.inflate import Deflated, LateDeflate, LateDeflateFactory, inflate
from rosbridge_sim.shell.transport.server_connection import DirectConnection
from rosbridge_sim.shell.transport.text_check import TextCheck

MAX_SIZE = 2**26
"""Largest message [bytes]; the longest one of a case is 16 MB."""


class Echo:
    """Echo that sends each message of a connection back unchanged."""

    def __init__(self, socket: DirectConnection) -> None:
        self._socket = socket

    def begin(self) -> float:
        """Return the end of a turn, which has no limit; see `Receiver`.

        Returns:
            Infinity.
        """
        return inf

    def receive(self, message: bytes) -> bool:
        """Send a message back.

        Args:
            message: as it was received, perhaps compressed.

        Returns:
            True: reading may go on.
        """
        socket = self._socket
        is_text = socket.is_text
        if isinstance(message, Deflated):
            inflated = self._inflate(message)
            if inflated is None:
                return True
            message = inflated
        socket.send_messages([message if is_text else BinaryFrame(message)])
        while socket.unsent:
            socket.send_more()
        return True

    def _inflate(self, message: Deflated) -> bytes | None:
        extension = self._socket.extension(LateDeflate)
        slices = inflate(extension, message, MAX_SIZE)
        while True:
            try:
                next(slices)
            except StopIteration as end:
                inflated: bytes = end.value
                break
        if self._socket.is_text:
            check = TextCheck(inflated)
            while check.step():
                pass
            if check.fault:
                self._socket.refuse(check.fault)
                return None
        return inflated

    def wait(self, *, had_turn: bool) -> None:
        """Go on in the loop's next turn.

        Args:
            had_turn: not used.
        """
        assert isinstance(had_turn, bool)
        self._socket.loop.call_soon(self._go_on)

    def _go_on(self) -> None:
        if self._socket.go_on(inf):
            self.wait(had_turn=True)


async def _serve_direct(socket: ServerConnection) -> None:
    assert isinstance(socket, DirectConnection)
    socket.listen(Echo(socket))
    await socket.wait_closed()


async def _serve_reference(socket: ServerConnection) -> None:
    try:
        async for message in socket:
            await socket.send(message)
    except ConnectionClosed:
        pass


@asynccontextmanager
async def _listening(*, is_direct: bool) -> AsyncIterator[str]:
    """Yield the address of an echo on a free loopback port."""
    options: dict[str, Any] = {"compression": "deflate"}
    if is_direct:
        options = {
            "compression": None,
            "extensions": [LateDeflateFactory()],
            "create_connection": DirectConnection,
        }
    server = await serve(
        _serve_direct if is_direct else _serve_reference,
        "127.0.0.1",
        0,
        max_size=MAX_SIZE,
        max_queue=None,
        close_timeout=1,
        logger=logging.getLogger("quiet"),
        **options,
    )
    async with server:
        yield f"127.0.0.1:{server.sockets[0].getsockname()[1]}"


async def run(cases: Sequence[str] = (), *, is_direct: bool) -> dict[str, str]:
    """Run cases against an echo.

    Args:
        cases: ids or patterns; none means all.
        is_direct: use our socket class for the echo, else the library's.

    Returns:
        Case id -> verdict: `OK` and the like, for the messages and for the end of the connection.
    """
    async with _listening(is_direct=is_direct) as address:
        try:
            results = await run_fuzzingclient(address, list(cases) or None, None, concurrency=1)
        except FailureError as failure:
            results = failure.results
    return {
        result.case_id: ("" if result.passed else "not passed: ")
        + f"{result.behavior.value}, close {result.behavior_close.value}"
        for result in results
    }


def compare(ours: dict[str, str], reference: dict[str, str]) -> list[str]:
    """Return a line for each case that passes at the reference and fails here.

    Args:
        ours: case id -> verdict of our socket class.
        reference: case id -> verdict of the library's.
    """
    return [
        f"{case}: {ours.get(case, 'not run')}; the reference: {verdict}"
        for case, verdict in reference.items()
        if not verdict.startswith("not") and ours.get(case, "not").startswith("not")
    ]


def main() -> int:
    """Run both echoes and print the differences."""
    parser = argparse.ArgumentParser(description="Autobahn's cases against our socket class and the reference")
    parser.add_argument("cases", nargs="*", help="case ids or patterns such as 6.*; all without one")
    given = parser.parse_args()
    logging.getLogger("quiet").setLevel(logging.CRITICAL)
    found = {}
    for name, is_direct in (("reference", False), ("ours", True)):
        found[name] = verdicts = asyncio.run(run(given.cases, is_direct=is_direct))
        num_passed = sum(not verdict.startswith("not") for verdict in verdicts.values())
        print(f"{name}: {num_passed} of {len(verdicts)} cases pass")
    ours, reference = found["ours"], found["reference"]
    for case, verdict in reference.items():
        if ours.get(case) != verdict:
            print(f"  {case}: {ours.get(case, 'not run')}; the reference: {verdict}")
    worse = compare(ours, reference)
    print(f"{len(worse)} cases pass at the reference and not here")
    return bool(worse)


if __name__ == "__main__":
    raise SystemExit(main())
