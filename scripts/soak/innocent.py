#!/usr/bin/env python3
"""An honest client beside malicious ones: it repeats a few calls and messages, and checks the answers.

    python scripts/soak/innocent.py ws://127.0.0.1:9090 [/Ego_topic]

It offers a service and calls it, publishes and receives its own messages, calls rosapi, and reads the given topic. All
numbers of that topic must be finite. It runs until its stdin ends, and then prints its figures as one line of JSON. At
the first wrong answer, lost connection or long silence it prints the reason and exits with 1.
"""

from __future__ import annotations

import asyncio
import json
import math
import sys
import time
from collections import Counter
from typing import Any, NoReturn

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

PREFIX = "/innocent"
"""Prefix of its own topics and services, which the malicious clients do not use."""

PATIENCE = 60.0
"""Longest silence before a failure [s]; short stalls are measured elsewhere, here nothing may be lost."""

PAUSE = 0.005
"""Pause between two rounds [s]."""

Frame = dict[str, Any]


class InnocentError(Exception):
    """The server did something wrong."""


class Innocent:
    """The client.

    Attributes:
        num: counts of what it has seen.
        longest: longest wait for an answer [s].
    """

    def __init__(self, socket: ClientConnection, topic: str | None = None) -> None:
        self._socket = socket
        self._topic = topic
        self._waiting: dict[str, asyncio.Future[Frame]] = {}
        self._num = 0
        self.num: Counter[str] = Counter()
        self.longest = 0.0

    async def run(self, is_over: asyncio.Event) -> None:
        """Do everything in turn until the event is set.

        Args:
            is_over: the event.

        Raises:
            InnocentError: something was wrong.
        """
        reading = asyncio.create_task(self._read())
        try:
            await self._send("advertise_service", service=f"{PREFIX}/add", type="example_interfaces/AddTwoInts")
            await self._send("advertise", topic=f"{PREFIX}/chatter", type="std_msgs/String")
            await self._send("subscribe", topic=f"{PREFIX}/chatter", type="std_msgs/String")
            if self._topic is not None:
                await self._send("subscribe", topic=self._topic)
            is_first = True  # one round at least, also on a machine that is too busy to start this in time
            while is_first or not is_over.is_set():
                is_first = False
                working = asyncio.create_task(self._round())
                await asyncio.wait((working, reading), return_when=asyncio.FIRST_COMPLETED)
                if reading.done():
                    working.cancel()
                    await reading
                await working
                await asyncio.sleep(PAUSE)
        finally:
            reading.cancel()

    async def _round(self) -> None:
        self._num += 1
        a, b = self._num, self._num * 1_000_003
        values = (await self._ask(f"{PREFIX}/add", {"a": a, "b": b}))["values"]
        if values != {"sum": a + b}:
            raise InnocentError(f"{a} + {b} is {values}")
        self.num["calls"] += 1
        text = f"hello {self._num}"
        heard = self._expect(text)
        await self._send("publish", topic=f"{PREFIX}/chatter", msg={"data": text})
        await self._within(heard, f"the message {text!r}")
        self.num["messages"] += 1
        answer = await self._ask("/rosapi/service_type", {"service": f"{PREFIX}/add"})
        if answer["values"]["type"].replace("/srv/", "/") != "example_interfaces/AddTwoInts":
            raise InnocentError(f"/rosapi/service_type answers {answer['values']}")
        self.num["questions"] += 1

    def _expect(self, mark: str) -> asyncio.Future[Frame]:
        future = self._waiting[mark] = asyncio.get_running_loop().create_future()
        return future

    async def _ask(self, service: str, args: object) -> Frame:
        self._num += 1
        mark = f"innocent:{self._num}"
        answer = self._expect(mark)
        await self._send("call_service", service=service, args=args, id=mark)
        frame = await self._within(answer, f"the answer of {service}")
        if frame["result"] is not True:
            raise InnocentError(f"{service} was refused: {frame['values']}")
        return frame

    async def _within(self, future: asyncio.Future[Frame], what: str) -> Frame:
        begun = time.perf_counter()
        try:
            async with asyncio.timeout(PATIENCE):
                frame = await future
        except TimeoutError:
            raise InnocentError(f"waited {PATIENCE:g} s for {what}") from None
        self.longest = max(self.longest, time.perf_counter() - begun)
        return frame

    async def _send(self, op: str, **fields: object) -> None:
        await self._socket.send(json.dumps({"op": op, **fields}))

    async def _read(self) -> None:
        """Read all frames while the connection lasts."""
        try:
            async for data in self._socket:
                if isinstance(data, bytes):
                    raise InnocentError(f"a binary frame came: {data[:80]!r}")
                await self._take(json.loads(data, parse_constant=_refuse))
        except ConnectionClosed as error:
            raise InnocentError(f"the connection was lost: {error}") from None
        raise InnocentError("the connection was closed")

    async def _take(self, frame: Frame) -> None:
        match frame.get("op"):
            case "publish" if self._topic is not None and frame["topic"] == self._topic:
                _check_numbers(frame["msg"], self._topic)
                self.num["states"] += 1
            case "publish" if frame["topic"] == f"{PREFIX}/chatter":
                self._settle(frame["msg"]["data"], frame)
            case "call_service" if frame["service"] == f"{PREFIX}/add":
                args = frame["args"]
                values = {"sum": args["a"] + args["b"]}
                service, mark = frame["service"], frame["id"]
                await self._send("service_response", service=service, id=mark, values=values, result=True)
            case "service_response":
                self._settle(frame["id"], frame)
            case _:
                raise InnocentError(f"unexpected frame: {str(frame)[:300]}")

    def _settle(self, mark: str, frame: Frame) -> None:
        future = self._waiting.pop(mark, None)
        if future is None:
            raise InnocentError(f"unexpected answer: {str(frame)[:300]}")
        future.set_result(frame)


def _check_numbers(value: object, where: str) -> None:
    """Check that every number in a message is finite."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _check_numbers(inner, f"{where}.{key}")
    elif isinstance(value, list):
        for inner in value:
            _check_numbers(inner, f"{where}[]")
    elif value is None or (isinstance(value, float) and not math.isfinite(value)):
        raise InnocentError(f"{where} is {value}")


def _refuse(name: str) -> NoReturn:
    raise InnocentError(f"the server sent a bare {name}, which is not JSON")


async def _main(url: str, topic: str | None = None) -> int:
    is_over = asyncio.Event()
    asyncio.get_running_loop().add_reader(sys.stdin, is_over.set)
    async with connect(url, compression=None, max_size=None, ping_interval=None, proxy=None) as socket:
        innocent = Innocent(socket, topic)
        try:
            await innocent.run(is_over)
        except InnocentError as error:
            print(json.dumps({"error": str(error), **innocent.num}), flush=True)
            return 1
    print(json.dumps({"longest_ms": round(innocent.longest * 1e3, 1), **innocent.num}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(asyncio.run(_main(*sys.argv[1:])))
