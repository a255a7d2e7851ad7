"""XML-RPC over HTTP: what a client of the standard library sends, and what strangers send."""

from __future__ import annotations

import asyncio
import xmlrpc.client
from collections.abc import AsyncIterator, Sequence
from typing import Any

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.shell.ros1 import xmlrpc_http
from rosbridge_sim.shell.ros1.xmlrpc_bodies import read_answer, read_call, write_call
from rosbridge_sim.shell.ros1.xmlrpc_http import MAX_CONNECTIONS, XmlRpcServer, address_of, call


@pytest.fixture
async def server() -> AsyncIterator[XmlRpcServer]:
    def answer(method: str, args: Sequence[Any]) -> list[Any]:
        return [1, method, list(args)] if method != "no" else [-1, "not today", 0]

    server = XmlRpcServer(answer)
    await server.start("127.0.0.1")
    yield server
    server.stop()


async def test_both_sides_speak_with_the_standard_library(server: XmlRpcServer) -> None:
    uri = f"http://127.0.0.1:{server.port}"
    proxy = xmlrpc.client.ServerProxy(uri)
    assert await asyncio.to_thread(proxy.echo, "/me", [["TCPROS"]], 1.5) == [1, "echo", ["/me", [["TCPROS"]], 1.5]]
    assert await asyncio.to_thread(proxy.echo) == [1, "echo", []], "on the same connection"
    await asyncio.to_thread(proxy("close"))
    assert await call(uri, "echo", "가", {"a": True}) == ["가", {"a": True}]
    with pytest.raises(GraphError, match="refused: not today"):
        await call(uri, "no")
    with pytest.raises(GraphError, match="cannot write"):
        await call(uri, "echo", 2**40)


@pytest.mark.parametrize(
    "body",
    [
        b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x "xx">]><methodCall><methodName>&x;</methodName></methodCall>',
        b'<!DO<!--CTYPE a [<!ENTITY x "xx">]>',
        "<!DOCTYPE a>".encode("utf-16"),
        b"\xff\xfe\x00",
        b"<methodCall>",
        b"<methodResponse><params/></methodResponse>",
        b"<value>" * 60_000,
        b"<?xml version='1.0' encoding='cp037'?>" + "<!DOCTYPE a>".encode("cp037"),
        b"",
        write_call("a", [1]).replace(b"<int>1</int>", b"<array><data><value>" * 200 + b"</value></data></array>" * 200),
    ],
)
def test_bodies_of_strangers_are_refused(body: bytes) -> None:
    with pytest.raises(GraphError):
        read_call(body, 50_000)
    with pytest.raises(GraphError):
        read_answer(body, 50_000)


async def test_requests_of_strangers_end_their_connection_alone(
    server: XmlRpcServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = write_call("echo", [])
    for data, why in {
        b"GET / HTTP/1.1\r\nContent-Length: 0\r\n\r\n": b"expected POST",
        b"POST / HTTP/1.1\r\n\r\n": b"expected HTTP with a Content-Length",
        b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n": b"expected a body of at most",
        b"POST / HTTP/1.1\r\nContent-Length: 9\r\nContent-Length: 8\r\n\r\n": b"expected HTTP",
        b"POST / HTTP/1.1\r\nContent-Length: 1\r\n\r\nx": b"expected XML-RPC",
        b"POST / HTTP/1.0\r\nContent-Length: %d\r\n\r\n%b" % (len(body), body): b"200 OK",
        b"x" * 40_000: b"",
    }.items():
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(data)
        try:
            assert why in await reader.read()
        except ConnectionResetError:
            assert not why
        writer.close()
    monkeypatch.setattr(xmlrpc_http, "IDLE_TIMEOUT", 0.05)
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    assert await reader.read() == b"", "it says nothing"
    writer.close()
    monkeypatch.setattr(xmlrpc_http, "IDLE_TIMEOUT", 30.0)
    many = [await asyncio.open_connection("127.0.0.1", server.port) for _ in range(MAX_CONNECTIONS + 5)]
    assert await call(f"http://127.0.0.1:{server.port}", "echo", 1) == [1], "the idle ones make way"
    assert await many[0][0].read() == b""
    for _, writer in many:
        writer.close()


@pytest.mark.parametrize("uri", ["", "http://", "http://a", "ftp://a:1", "http://a:99999", "http://[", "rosrpc://a:1"])
def test_what_is_no_address_is_told(uri: str) -> None:
    with pytest.raises(GraphError, match="expected http://HOST:PORT"):
        address_of(uri)


def test_a_connection_that_is_closed_before_its_answer_is_no_error_of_uvloop(caplog: pytest.LogCaptureFixture) -> None:
    uvloop = pytest.importorskip("uvloop")

    async def main() -> None:
        own = XmlRpcServer(lambda _method, _args: [1, "", 0])
        await own.start("127.0.0.1")
        async with own._turn:  # as while another body is read
            asked = asyncio.create_task(call(f"http://127.0.0.1:{own.port}", "getPid", "/x"))
            while not own._turn._waiters:  # noqa: ASYNC110 - no event tells of it
                await asyncio.sleep(0)
            own.stop()
            with pytest.raises(GraphError):
                await asked
        await asyncio.sleep(0)

    uvloop.run(main())
    assert caplog.records == []
