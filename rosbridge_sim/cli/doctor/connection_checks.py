"""The checks of `rosbridge-sim doctor` that need the connection itself, or a clock."""

from __future__ import annotations

import asyncio
import json
import time
import urllib.parse
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from statistics import median
from typing import Any, Final

from websockets.exceptions import ConnectionClosed

from rosbridge_sim.cli.doctor.examined_server import NO_CONNECTION, ExaminedServer
from rosbridge_sim.doctor.check import Check
from rosbridge_sim.doctor.examination import CheckResult, Verdict
from rosbridge_sim.link.plain_client import PlainClient

_RFC = "RFC 6455"

NUM_TRIPS: Final = 100
RATE: Final = 50.0
"""Rate of the jitter check [Hz]."""


async def _works(client: PlainClient, server: ExaminedServer, topic: str) -> bool:
    """Return whether a publish of a client comes back to itself."""
    for op in ("advertise", "subscribe"):
        await client.send(json.dumps({"op": op, "topic": topic, "type": "std_msgs/String"}))
    await asyncio.sleep(server.settling)
    await client.send(json.dumps({"op": "publish", "topic": topic, "msg": {"data": "x"}}))
    until = asyncio.get_running_loop().time() + server.patience
    while not any('"publish"' in str(frame) for frame in client.frames):
        if client.ending is not None or not await client.wait(until):
            return False
    return True


async def _works_by(server: ExaminedServer, topic: str, **offer: Any) -> str:  # noqa: ANN401 - see `ExaminedServer.dial`
    """Return what is wrong with a connection by another URL, or that offers something; empty if nothing is."""
    try:
        async with server.dial(**offer) as client:
            return "" if await _works(client, server, topic) else "a publish did not come back"
    except NO_CONNECTION as error:
        return f"no connection: {error}"


async def _query(server: ExaminedServer, topic: str) -> str:
    parts = urllib.parse.urlsplit(server.url)
    query = f"{parts.query}&doctor=1" if parts.query else "doctor=1"
    url = urllib.parse.urlunsplit(parts._replace(path=parts.path or "/", query=query))
    return await _works_by(server, topic, url=url)


async def _deflate(server: ExaminedServer, topic: str) -> str:
    return await _works_by(server, topic, compression="deflate")


async def _ping(server: ExaminedServer, _topic: str) -> str:
    async with server.dial() as client:
        try:
            async with asyncio.timeout(server.patience):
                await (await client.connection.ping())
        except (TimeoutError, ConnectionClosed):
            return f"no pong within {server.patience:g} s"
    return ""


async def _close(server: ExaminedServer, _topic: str) -> str:
    async with server.dial() as client:
        pass
    code = client.connection.close_code
    return "" if code == 1000 else f"the close was not answered with 1000; got {code}"  # noqa: PLR2004 - RFC 6455, section 7.4.1


async def _many(server: ExaminedServer, topic: str) -> str:
    opening = [PlainClient.open(server.url, token=server.token, patience=server.dialling) for _ in range(20)]
    found = await asyncio.gather(*opening, return_exceptions=True)
    clients = [one for one in found if isinstance(one, PlainClient)]
    try:
        if len(clients) < len(found):
            return f"{len(clients)} of {len(found)} connections were made"
        return "" if await _works(clients[-1], server, topic) else "a publish did not come back"
    finally:
        await asyncio.gather(*(client.close() for client in clients))


async def _needs_token(server: ExaminedServer, _topic: str) -> str:
    with suppress(*NO_CONNECTION):
        async with server.dial(token=None) as client:
            await client.send(json.dumps({"op": "call_service", "id": "x", "service": "/rosapi/get_time"}))
            await client.wait(asyncio.get_running_loop().time() + server.patience)
            if any('"result":true' in str(frame).replace(" ", "") for frame in client.frames):
                return "a client without the token got an answer"
    return ""


# Times: these find figures, and no faults


async def _arrivals(
    server: ExaminedServer, topic: str, num: int, period: float, size: int
) -> list[tuple[float, float]]:
    """Publish messages and return when each was sent and came [s]; the last ones may be missing.

    Args:
        server: the server.
        topic: topic of the messages.
        num: number of messages.
        period: time between two of them [s]; 0 sends the next one when one has come.
        size: length of each text [characters].
    """
    loop = asyncio.get_running_loop()
    times: list[tuple[float, float]] = []
    sent: list[float] = []

    def note(frame: str | bytes) -> bool:
        if '"publish"' in str(frame[:200]) and len(times) < len(sent):
            times.append((sent[len(times)], loop.time()))
        return False

    async with server.dial(on_frame=note) as client:
        for op in ("advertise", "subscribe"):
            await client.send(json.dumps({"op": op, "topic": topic, "type": "std_msgs/String"}))
        await asyncio.sleep(server.settling)
        frame = json.dumps({"op": "publish", "topic": topic, "msg": {"data": "x" * size}})
        begun = loop.time()
        for number in range(num):
            await asyncio.sleep(max(0.0, begun + number * period - loop.time()) if period else 0.0)
            sent.append(loop.time())
            await client.send(frame)
            until = loop.time() + server.patience
            while not period and len(times) < len(sent) and await client.wait(until):
                pass
        until = loop.time() + server.patience
        while len(times) < num and client.ending is None and await client.wait(until):
            pass
    return times


async def _round_trip(server: ExaminedServer, topic: str) -> str:
    waits = sorted(1e3 * (came - sent) for sent, came in await _arrivals(server, topic, NUM_TRIPS, 0.0, 50))
    if len(waits) < NUM_TRIPS:
        return f"{NUM_TRIPS - len(waits)} of {NUM_TRIPS} messages did not come back"
    return f"={median(waits):.2f} ms, the slowest of twenty {waits[-NUM_TRIPS // 20]:.2f} ms"


async def _jitter(server: ExaminedServer, topic: str) -> str:
    num = round(2 * RATE)
    times = await _arrivals(server, topic, num, 1 / RATE, 50)
    if len(times) < num:
        return f"{num - len(times)} of {num} messages did not come back"
    gaps = [after - before for (_, before), (_, after) in pairwise(times)]
    late = sorted(1e3 * abs(gap - 1 / RATE) for gap in gaps)
    return f"=gaps differ from {1e3 / RATE:.0f} ms by {median(late):.2f} ms, one in twenty by {late[-num // 20]:.2f} ms"


async def _load(server: ExaminedServer, topic: str, *, size: int, num: int) -> str:
    begun = time.perf_counter()
    times = await _arrivals(server, topic, num, 1e-9, size)
    taken = time.perf_counter() - begun
    if not times:
        return "no message came back"
    rate = len(times) / taken
    return f"={rate:,.0f} messages a second ({len(times)} of {num} came), {rate * size / 1e6:.1f} MB/s"


_WORK: Final[dict[str, tuple[str, str, Callable[[ExaminedServer, str], Awaitable[str]]]]] = {
    "connection/query": ("clients write a token there", "a query in the URL is accepted", _query),
    "connection/ping": (f"{_RFC}, section 5.5.2", "a ping is answered", _ping),
    "connection/close": (f"{_RFC}, section 7.1", "a close is answered with the same code", _close),
    "connection/compression": ("RFC 7692", "an offer to compress is accepted", _deflate),
    "connection/subprotocol": (
        f"{_RFC}, section 4.2.2",
        "an offer of a subprotocol is accepted, also of one that the server does not have",
        partial(_works_by, subprotocols=["rosbridge.v2"]),
    ),
    "connection/many": ("rosbridge_suite 0.11.17", "twenty clients are connected at the same time", _many),
    "connection/token": ("security", "a client without the token gets no answers", _needs_token),
    "timing/round-trip": ("a figure", "time from a publish until the message comes back", _round_trip),
    "timing/jitter": ("a figure", "regularity of a topic of 50 Hz", _jitter),
    "load/small": ("a figure", "throughput of messages of 50 characters", partial(_load, size=50, num=5_000)),
    "load/picture": ("a figure", "throughput of messages of 100 kB", partial(_load, size=100_000, num=100)),
    "load/large": ("a figure", "throughput of messages of 1 MB", partial(_load, size=1_000_000, num=10)),
}
"""Id of a check -> source, what is checked, and the function that does it.

It returns what is wrong, empty if nothing is; or behind `=` a figure, which is never wrong."""

CHECKS: Final[Sequence[Check]] = [Check(name, source, says, []) for name, (source, says, _) in _WORK.items()]


async def run(check: Check, server: ExaminedServer, prefix: str) -> CheckResult:
    """Run one of these checks.

    Args:
        check: the check.
        server: the server.
        prefix: namespace for its topic.
    """
    if check.id == "connection/token" and server.token is None:
        return CheckResult(check, Verdict.NOT_APPLICABLE, "no --token is given")
    text = await _WORK[check.id][2](server, f"{prefix}/t")
    if text.startswith("="):
        return CheckResult(check, Verdict.CONFORMS, text[1:])
    return CheckResult(check, Verdict.DEVIATES if text else Verdict.CONFORMS, text)
