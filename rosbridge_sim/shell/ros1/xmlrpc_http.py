"""XML-RPC over HTTP on the event loop: calls of a master and of nodes, and our own node's server; and its sockets.

`xmlrpc.client.ServerProxy` would block the loop. Of HTTP there is as much as programs of ROS 1 use.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, ClassVar, Final
from urllib.parse import urlsplit

from rosbridge_sim.errors import GraphError
from rosbridge_sim.shell.ros1.xmlrpc_bodies import read_answer, read_call, write_answer, write_call
from rosbridge_sim.shell.websocket.dns import HostLookup

CALL_TIMEOUT: Final = 3.0
"""Longest wait for an answer [s]; a master answers in a millisecond."""

IDLE_TIMEOUT: Final = 30.0
"""Longest wait for the next request, or for the rest of one [s]."""

MAX_REQUEST: Final = 2**18
"""Longest body of a request, and of a node's answer [bytes]: a list of a thousand publishers has 60 kB."""

MAX_VALUES: Final = 5_000
"""Most values in one: reading them takes 20 ms."""

MAX_ANSWER: Final = 4 * 2**20
"""Longest answer of a master [bytes]: the graph of a thousand topics has 300 kB, a robot description one million."""

MAX_ANSWER_VALUES: Final = 50_000
"""Most values in one: reading so many takes 0.2 s. The graph of a thousand topics has 5,000."""

MAX_HEAD: Final = 16 * 1024
"""Longest head [bytes]."""

MAX_CONNECTIONS: Final = 100
"""Most connections at once to our server; rosmaster keeps one. One more takes the place of the longest idle one."""

Answer = Callable[[str, Sequence[Any]], list[Any]]
"""`(method, args)`: returns `[code, text, value]`. Mistakes in the arguments may raise."""


class UnreachableError(GraphError):
    """A server that cannot be reached, or does not answer in time."""


def address_of(uri: str, scheme: str = "http") -> tuple[str, int]:
    """Return host and port of a URI such as `http://robot:11311/`.

    Raises:
        GraphError: it is none.
    """
    try:
        parts = urlsplit(uri)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if host is None or port is None or not uri.startswith(f"{scheme}://"):
        raise GraphError(f"expected {scheme}://HOST:PORT; got {uri[:200]!r}")
    return host, port


async def call(uri: str, method: str, *args: object, is_master: bool = False) -> Any:  # noqa: ANN401 - any value
    """Return the value of an answer.

    Args:
        method: what to call.
        args: values of XML-RPC.
        is_master: the answer may be long: a node may be anyone's, and reading takes time.

    Raises:
        GraphError: it cannot be reached, refuses, or answers in another form; the text says which.
    """
    host, port = address_of(uri)
    body = write_call(method, args)
    head = f"POST /RPC2 HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: text/xml\r\nConnection: close\r\n"
    try:
        async with asyncio.timeout(CALL_TIMEOUT):
            reader, writer = await connect(host, port, MAX_HEAD)
            try:
                writer.write(f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body)
                max_size, max_values = (MAX_ANSWER, MAX_ANSWER_VALUES) if is_master else (MAX_REQUEST, MAX_VALUES)
                return read_answer((await _read_message(reader, max_size))[1], max_values)
            finally:
                writer.close()
    except (OSError, UnicodeError, asyncio.IncompleteReadError, asyncio.LimitOverrunError) as error:
        why = "no answer came in time" if isinstance(error, TimeoutError) else str(error)
        raise UnreachableError(f"{uri}: {method}: {why or repr(error)}") from error


async def addresses(host: str) -> list[str]:
    """Return the addresses of a host, best first; a dead name server blocks nothing.

    Raises:
        OSError, UnicodeError: it has none.
    """
    return ["127.0.0.1"] if host == "localhost" else await HostLookup(host).addresses(CALL_TIMEOUT)


async def connect(host: str, port: int, limit: int = 2**16) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """Connect to a server.

    Args:
        limit: size of the buffer of what comes [bytes].

    Raises:
        OSError, UnicodeError: it cannot be reached.
    """
    return await asyncio.open_connection((await addresses(host))[0], port, limit=limit)


def send(writer: asyncio.StreamWriter, data: bytes) -> None:
    """Write to a connection.

    Raises:
        ConnectionResetError: it has been closed, which uvloop takes for an error of the program.
    """
    if writer.is_closing():
        raise ConnectionResetError
    writer.write(data)


async def _read_message(reader: asyncio.StreamReader, max_size: int) -> tuple[bytes, bytes]:
    """Return head and body of a message of HTTP.

    Raises:
        GraphError: it is none that we read.
    """
    head = await reader.readuntil(b"\r\n\r\n")
    lengths = [line.partition(b":")[2] for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:")]
    if len(lengths) != 1 or not lengths[0].strip().isdigit() or len(lengths[0]) > _MAX_DIGITS:
        raise GraphError("expected HTTP with a Content-Length")
    length = int(lengths[0])
    if length > max_size:
        raise GraphError(f"expected a body of at most {max_size:,} bytes; got {length:,}")
    return head, await reader.readexactly(length)


_MAX_DIGITS: Final = 12


class BoundedServer(ABC):
    """A server with a bounded number of connections; one more takes the place of the one that is idle for longest.

    Attributes:
        most: most connections at once.
        limit: size of the buffer of what comes over one [bytes].
        port: where it listens.
        idle: connections that may be ended for another one, longest idle first; all of them at their beginning.
    """

    most: ClassVar[int]
    limit: ClassVar[int]

    def __init__(self) -> None:
        """Listen nowhere yet."""
        self.port = 0
        self.idle: dict[asyncio.StreamWriter, None] = {}
        self._server: asyncio.Server | None = None
        self._connections: set[asyncio.StreamWriter] = set()

    async def start(self, host: str) -> None:
        """Listen on a free port of a host.

        Raises:
            OSError: the host cannot be used.
        """
        self._server = await asyncio.start_server(self._accept, host, 0, limit=self.limit)
        self.port = self._server.sockets[0].getsockname()[1]

    def stop_listening(self) -> None:
        """Take no more connections."""
        if self._server is not None:
            self._server.close()
            self._server = None

    def stop(self) -> None:
        """End all connections."""
        self.stop_listening()
        for writer in list(self._connections):
            writer.transport.abort()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        has_ended = self._server is None  # it came just before the end
        if has_ended or (len(self._connections) >= self.most and not self._make_room()):
            writer.transport.abort()
            return
        self._connections.add(writer)
        self.idle[writer] = None
        try:
            await self._serve(reader, writer)
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # the other side has gone, is silent, or speaks something else
        finally:
            self._forget(writer)
            writer.close()

    def _forget(self, writer: asyncio.StreamWriter) -> None:
        self._connections.discard(writer)
        self.idle.pop(writer, None)

    def _make_room(self) -> bool:
        """End the connection that is idle for longest; return False if none is idle."""
        longest = next(iter(self.idle), None)
        if longest is not None:
            self._forget(longest)
            longest.transport.abort()
        return longest is not None

    @abstractmethod
    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve a connection until its end."""


class XmlRpcServer(BoundedServer):
    """Our node's server of XML-RPC."""

    most = MAX_CONNECTIONS
    limit = MAX_HEAD

    def __init__(self, answer: Answer) -> None:
        """Listen nowhere yet.

        Args:
            answer: answers the calls.
        """
        super().__init__()
        self._answer = answer
        self._turn = asyncio.Lock()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while await self._serve_one(reader, writer):
                self.idle[writer] = self.idle.pop(writer, None)  # the last one now
        except GraphError as error:
            with suppress(OSError):
                send(writer, _http("400 Bad Request", str(error).encode(), "text/plain", is_last=True))

    async def _serve_one(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        """Answer a request; return False if it was the last one of its connection."""
        async with asyncio.timeout(IDLE_TIMEOUT):
            head, body = await _read_message(reader, MAX_REQUEST)
        if not head.startswith(b"POST "):
            raise GraphError("expected POST")
        async with self._turn:  # one body in a turn of the loop, however many connections there are
            method, args = read_call(body, MAX_VALUES)
            await asyncio.sleep(0)
        try:
            answer = self._answer(method, args)
        except (TypeError, ValueError, LookupError, AttributeError):
            answer = [-1, f"{method}: the arguments are not those of this method", 0]
        lines = head.lower()
        is_last = b"connection: close" in lines or b" http/1.0\r\n" in lines
        send(writer, _http("200 OK", write_answer(answer), "text/xml", is_last=is_last))
        async with asyncio.timeout(IDLE_TIMEOUT):
            await writer.drain()
        return not is_last


def _http(status: str, body: bytes, kind: str, *, is_last: bool) -> bytes:
    rest = "Connection: close\r\n" if is_last else ""
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n{rest}\r\n"
    return head.encode() + body
