"""Clients of the long runs in this folder: one that speaks rosbridge, and bare sockets; and what they leave behind."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self

import orjson
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from scripts.soak.harness import PATIENCE, Frame, GoneError, RefusedError, SoakError


class Client:
    """A rosbridge client that reads all the time.

    Attributes:
        socket: the WebSocket.
        num_heard: messages by topic.
        told: texts of status frames of level error.
        on_op: additional functions for frames, by op.
        is_leaving: the end of the connection is expected.
        num_calls: calls so far; the id of the next one is `call-N`, with the next number.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self.socket = connection
        self.num_heard: Counter[str] = Counter()
        self.told: list[str] = []
        self.on_op: dict[str, Callable[[Frame], None]] = {}
        self.is_leaving = False
        self.num_calls = 0
        self._waiting: dict[str, asyncio.Future[Frame]] = {}
        self._wanted: dict[str, asyncio.Future[Frame]] = {}
        self._reading = asyncio.get_running_loop().create_task(self._read())

    @classmethod
    async def open(cls, url: str) -> Client:
        """Connect a client.

        Args:
            url: of the server.

        Returns:
            The client.

        Raises:
            GoneError: the server does not accept it.
        """
        try:
            async with asyncio.timeout(PATIENCE):
                return cls(await connect(url, compression=None, max_size=None, ping_interval=None, proxy=None))
        except (OSError, WebSocketException) as error:
            raise GoneError(f"no connection to {url}: {error!r}") from None

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def send(self, op: str, **fields: object) -> None:
        """Send an op.

        Args:
            op: its name.
            fields: of the op.

        Raises:
            GoneError: the connection is closed.
        """
        await self.send_raw(orjson.dumps({"op": op, **fields}).decode())

    async def send_raw(self, frame: str | bytes) -> None:
        """Send a frame as it is.

        Args:
            frame: text, or bytes for a binary one.

        Raises:
            GoneError: the connection is closed.
        """
        try:
            await self.socket.send(frame)
        except ConnectionClosed as error:
            raise GoneError(f"the server closed the connection: {error}") from None

    async def answer(self, op: str, **fields: object) -> Frame:
        """Send an op with an id, and wait for the frame with this id.

        Args:
            op: its name.
            fields: of the op.

        Raises:
            GoneError: the connection is closed.
            SoakError: there is no answer.
        """
        self.num_calls += 1
        mark = f"call-{self.num_calls}"
        future: asyncio.Future[Frame] = asyncio.get_running_loop().create_future()
        self._waiting[mark] = future
        try:
            await self.send(op, id=mark, **fields)
            async with asyncio.timeout(PATIENCE):
                return await future
        except TimeoutError:
            raise SoakError(f"no answer to {op} {fields} within {PATIENCE:.0f} s") from None
        finally:
            self._waiting.pop(mark, None)

    async def call(self, service: str, args: object = None, **fields: object) -> Frame:
        """Call a service.

        Args:
            args: of the call.
            fields: further fields of the op.

        Returns:
            The values of the answer.

        Raises:
            RefusedError: it was refused.
            SoakError: there is no answer.
        """
        answer = await self.answer("call_service", service=service, args=args or {}, **fields)
        if not answer["result"]:
            raise RefusedError(f"{service}: {answer['values']}")
        values: Frame = answer["values"]
        return values

    async def request(self, service: str, **request: object) -> Frame:
        """Call a service of the simulator, which wraps its request and its response.

        Args:
            request: fields of the request.

        Returns:
            Fields of the response.

        Raises:
            RefusedError: it was refused.
            SoakError: there is no answer.
        """
        values = await self.call(service, {"request": request})
        response: Frame = values["response"]
        return response

    async def next_message(self, topic: str) -> Frame:
        """Wait for the next message of a topic that is subscribed to already.

        Returns:
            The message.

        Raises:
            GoneError: the connection is closed.
            SoakError: there is none.
        """
        future = self._wanted.get(topic)
        if future is None:
            future = self._wanted[topic] = asyncio.get_running_loop().create_future()
        try:
            async with asyncio.timeout(PATIENCE):
                return await asyncio.shield(future)
        except TimeoutError:
            raise SoakError(f"no message on {topic} within {PATIENCE:.0f} s") from None

    async def close(self) -> None:
        """Close the connection in order."""
        self.is_leaving = True
        await self.socket.close()
        await self._reading

    async def cut(self, *, is_reset: bool = False) -> None:
        """Cut the connection.

        Args:
            is_reset: by a reset (RST), else as after a crash (FIN).
        """
        self.is_leaving = True
        if is_reset:
            reset(self.socket.transport)
        self.socket.transport.abort()
        await self._reading

    async def _read(self) -> None:
        try:
            async for data in self.socket:
                self._take(data)
        except ConnectionClosed:
            pass
        finally:
            gone = GoneError(
                "the connection is closed"
                if self.is_leaving
                else f"the server closed the connection: {self.socket.close_code} {self.socket.close_reason}"
            )
            for future in [*self._waiting.values(), *self._wanted.values()]:
                if not future.done():
                    future.set_exception(gone)
                    future.exception()  # an answer that no code waits for is not a mistake

    def _take(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            self.num_heard["binary"] += 1
            if "binary" in self.on_op:
                self.on_op["binary"]({"data": data})
            return
        frame: Frame = orjson.loads(data)
        op = frame["op"]
        if op == "publish":
            self.num_heard[frame["topic"]] += 1
            wanted = self._wanted.pop(frame["topic"], None)
            if wanted is not None:
                wanted.set_result(frame["msg"])
        elif op == "status":
            self.told.append(frame["msg"])
        elif op in {"service_response", "action_result"}:
            waiting = self._waiting.get(frame.get("id", ""))
            if waiting is not None and not waiting.done():
                waiting.set_result(frame)
        if op in self.on_op:
            self.on_op[op](frame)


# Bare sockets


def handshake() -> bytes:
    """Return the request that opens a WebSocket."""
    return (
        b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )


async def open_raw(
    port: int, *, is_greeting: bool = True, buffer: int = 1 << 16
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """Open a bare socket, which answers no pings and reads nothing beyond its buffer.

    Args:
        port: of the server.
        is_greeting: do the handshake.
        buffer: size of its receive buffer [bytes].

    Returns:
        Its reader and writer.

    Raises:
        GoneError: the server does not accept it.
    """
    plain = socket.socket()
    plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    plain.setblocking(False)  # noqa: FBT003 - the standard library's own
    try:
        async with asyncio.timeout(PATIENCE):
            await asyncio.get_running_loop().sock_connect(plain, ("127.0.0.1", port))
            reader, writer = await asyncio.open_connection(sock=plain, limit=buffer)
            if is_greeting:
                writer.write(handshake())
                answer = await reader.readuntil(b"\r\n\r\n")
                if not answer.startswith(b"HTTP/1.1 101"):
                    writer.transport.abort()
                    raise GoneError(f"the handshake was answered {answer[:80]!r}")
    except (OSError, EOFError) as error:
        plain.close()
        raise GoneError(f"no connection: {error!r}") from None
    return reader, writer


def masked(payload: bytes, first: int = 0x81) -> bytes:
    """Return a WebSocket frame of a client, masked with zeros.

    Args:
        payload: its content.
        first: its first byte.
    """
    size = len(payload)
    if size < 126:
        head = bytes((first, 0x80 | size))
    elif size < 2**16:
        head = struct.pack("!BBH", first, 0xFE, size)
    else:
        head = struct.pack("!BBQ", first, 0xFF, size)
    return head + bytes(4) + payload


def reset(transport: asyncio.BaseTransport) -> None:
    """End a connection with a reset (RST).

    Args:
        transport: of the connection.
    """
    plain = transport.get_extra_info("socket")
    if plain is not None:
        with suppress(OSError):
            plain.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


# What is left behind


async def census(client: Client) -> dict[str, list[str]]:
    """Return the names on the bus, as rosapi lists them.

    Args:
        client: asks.

    Returns:
        Kind -> names.
    """
    return {
        "topics": sorted((await client.call("/rosapi/topics"))["topics"]),
        "services": sorted((await client.call("/rosapi/services"))["services"]),
        "nodes": sorted((await client.call("/rosapi/nodes"))["nodes"]),
        "action servers": sorted((await client.call("/rosapi/action_servers"))["action_servers"]),
    }


def differences(before: Mapping[str, Sequence[str]], after: Mapping[str, Sequence[str]]) -> list[str]:
    """Return one line for each list that has changed.

    Args:
        before: kind -> names.
        after: kind -> names.
    """
    lines = []
    for name, names in before.items():
        gone, new = sorted(set(names) - set(after[name])), sorted(set(after[name]) - set(names))
        if gone or new:
            lines.append(f"{name}: gone {gone}, left behind {new}")
    return lines
