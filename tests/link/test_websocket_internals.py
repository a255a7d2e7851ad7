"""The contract with the `websockets` library: what we use of it beyond its documented interface is there and behaves.

A new version of the library is tried by running this file, `test_server_connection.py`, `test_client_connection.py`,
`test_inflate.py`, `test_library_log.py`, `test_server.py`, `test_direct_handshake.py`, `test_upgrade_request.py` and
`test_unauthenticated.py` with it. If they pass, it joins `TRIED`.
"""

from __future__ import annotations

import ast
import asyncio
import logging
import re
import subprocess
import sys
import tomllib
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets import utils
from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed, ConnectionClosedOK
from websockets.frames import CloseCode, Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import State

from rosbridge_sim.link.websocket_internals import MessageConnection, apply_mask
from tests.support import PATIENCE, ROOT

TRIED = ("17.0", "17.0.1", "17.1", "17.2", "17.3", "17.4")
"""Versions with which this contract held. Version 16 closes the connection of a HEAD request without an answer."""

DOCUMENTED = {
    "websockets.asyncio.client": {"ClientConnection", "connect"},
    "websockets.asyncio.server": {"Server", "ServerConnection", "serve"},
    "websockets.datastructures": {"Headers"},
    "websockets.exceptions": {
        *("ConnectionClosed", "InvalidMessage", "InvalidStatus", "InvalidURI", "ProtocolError", "SecurityError"),
        "WebSocketException",
    },
    "websockets.extensions": {"Extension"},
    "websockets.extensions.base": {"ServerExtensionFactory"},
    "websockets.extensions.permessage_deflate": {"ServerPerMessageDeflateFactory"},
    "websockets.frames": {"CloseCode", "Frame", "Opcode"},
    "websockets.http11": {"Request", "Response"},
    "websockets.protocol": {"State"},
    "websockets.typing": {"ExtensionParameter"},
}
"""Module -> names in the library's reference, which any module of ours may use."""

UNDOCUMENTED = {
    *("available_extensions", "close_exc", "close_timeout", "connection_lost_waiter", "current_size"),
    *("keepalive", "keepalive_task", "max_message_size", "parser", "paused", "process_event", "protocol"),
    *("recv_messages", "send_data", "send_in_progress", "write_limit_high", "write_limit_low"),
}
"""Attributes of the library's connections and their cores that `websocket_internals.py` alone may use."""

FENCE = ROOT / "rosbridge_sim" / "link" / "websocket_internals.py"
OWN = {"max_message_size"}
"""Those that `MessageConnection` has itself, under the same name."""


def sources(pattern: str) -> Iterator[tuple[Path, ast.Module]]:
    """The modules in whose text a pattern is found."""
    for path in sorted((ROOT / "rosbridge_sim").rglob("*.py")):
        text = path.read_text()
        if path != FENCE and re.search(pattern, text, re.MULTILINE):
            yield path, ast.parse(text)


def test_other_modules_import_only_documented_names() -> None:
    strange = []
    for path, tree in sources(r"^\s*(from|import) +websockets"):
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "websockets":
                names = {alias.name for alias in node.names} - DOCUMENTED.get(node.module or "", set())
                strange += [f"{path.name}: {node.module}.{name}" for name in names]
            elif isinstance(node, ast.Import):
                strange += [
                    f"{path.name}: {one.name}" for one in node.names if one.name.partition(".")[0] == "websockets"
                ]
    assert strange == []


def test_other_modules_use_no_undocumented_attribute() -> None:
    strange = [
        f"{path.name}:{node.lineno}: {node.attr}"
        for path, tree in sources(rf"^(?!\s*(?:from|import) ).*\.\s*({'|'.join(UNDOCUMENTED - OWN)})\b")
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr in UNDOCUMENTED - OWN
    ]
    assert strange == []


def test_allowed_versions_are_the_tried_ones() -> None:
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    (line,) = (line for line in wanted if line.startswith("websockets"))
    first, last = TRIED[0].partition(".")[0], TRIED[-1].partition(".")[0]
    assert line == f"websockets>={first},<{int(last) + 1}"
    assert int(first) <= int(version("websockets").partition(".")[0]) <= int(last)


# Masking


@given(st.binary(max_size=300), st.binary(min_size=4, max_size=4))
def test_masking_follows_the_rfc_with_and_without_the_c_extension(data: bytes, key: bytes) -> None:
    expected = bytes(byte ^ key[i % 4] for i, byte in enumerate(data))
    for mask in (apply_mask, utils.apply_mask):
        for given_data in (data, bytearray(data), memoryview(bytearray(b"xx" + data))[2:]):
            for given_key in (key, bytearray(key)):
                found = mask(given_data, given_key)
                assert found == expected
                assert type(found) is bytes


WITHOUT_EXTENSION = """
import asyncio, json, sys
sys.modules["websockets.speedups"] = None  # as if it had not been built: its import fails
from websockets.asyncio.client import connect
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.link.websocket_internals import apply_mask

async def main():
    async with Simulator(port=0, world=False) as sim, connect(sim.url, proxy=None) as socket:
        await socket.send(json.dumps({"op": "subscribe", "topic": "/t", "type": "std_msgs/String"}))
        for text in ("a", "b" * 1_000, "c" * 100_000):
            await socket.send(json.dumps({"op": "publish", "topic": "/t", "msg": {"data": text}}))
            assert json.loads(await socket.recv())["msg"] == {"data": text}
    print(apply_mask.__module__)

asyncio.run(main())
"""


@pytest.mark.slow
def test_server_serves_without_the_c_extension_of_the_library() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTENSION], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.returncode) == ("websockets.utils\n", 0), done.stderr


# Connections


class _Listening(MessageConnection):
    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)
        self.heard: list[tuple[bytes, bool, bool]] = []
        self.on_message: Callable[[], None] = lambda: None

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        assert bytes(last).endswith(message[-1:])  # type: ignore[call-overload] # bytes of some kind
        self.heard.append((message, is_text, self.is_in_fragments))
        self.on_message()


class AtServer(_Listening, ServerConnection):
    pass


class AtClient(_Listening, ClientConnection):
    pass


@asynccontextmanager
async def two_ends(**options: object) -> AsyncIterator[tuple[AtClient, AtServer]]:
    """A client, and the server's end of its connection."""
    served: asyncio.Future[AtServer] = asyncio.get_running_loop().create_future()

    async def handle(socket: ServerConnection) -> None:
        assert isinstance(socket, AtServer)
        served.set_result(socket)
        await socket.wait_closed()

    settings: dict[str, object] = {"compression": None, "logger": logging.getLogger("quiet"), **options}
    async with serve(handle, "127.0.0.1", 0, create_connection=AtServer, **settings) as server:  # type: ignore[arg-type] # several
        url = f"ws://127.0.0.1:{next(iter(server.sockets)).getsockname()[1]}"
        async with connect(url, create_connection=AtClient, proxy=None, max_size=None) as socket:
            assert isinstance(socket, AtClient)
            yield socket, await served


async def test_process_event_gets_frames_in_order_and_at_once() -> None:
    async with two_ends() as (client, served):
        frames = [
            Frame(Opcode.TEXT, b"", fin=False),
            Frame(Opcode.PING, b"?"),
            Frame(Opcode.CONT, b"ab", fin=False),
            Frame(Opcode.CONT, b"c"),
            Frame(Opcode.BINARY, b"\xff"),
            Frame(Opcode.TEXT, b"d"),
        ]
        seen = []
        for one in frames:  # the library's own entry: nothing of it may be put off to a later turn
            served.data_received(one.serialize(mask=True))
            seen.append((len(served.heard), served.is_in_fragments))
        assert seen == [(0, True), (0, True), (0, True), (1, False), (2, False), (3, False)]
        assert served.heard == [(b"abc", True, False), (b"\xff", False, False), (b"d", True, False)]
        await (await client.ping())  # the connection is as good as before


async def test_message_size_limit_can_be_changed_later() -> None:
    async with two_ends(max_size=1_000) as (client, served):
        assert served.max_message_size == 1_000
        served.limit_message_size(2_000)
        served.data_received(Frame(Opcode.TEXT, b"x" * 2_000).serialize(mask=True))
        served.limit_message_size(10)
        served.data_received(Frame(Opcode.TEXT, b"y" * 10).serialize(mask=True))
        assert [len(message) for message, _, _ in served.heard] == [2_000, 10]
        served.data_received(Frame(Opcode.TEXT, b"z" * 11).serialize(mask=True)[:2])  # by what it says alone
        await client.wait_closed()
        assert client.close_code == CloseCode.MESSAGE_TOO_BIG
        assert len(served.heard) == 2


async def test_failed_connection_gets_a_reason_and_is_cut_off() -> None:
    async with two_ends(close_timeout=0.01) as (client, served):
        assert served.is_open
        assert not served.lost.done()
        served.fail(CloseCode.INVALID_DATA, "because")
        assert not served.is_open
        served.fail(CloseCode.INVALID_DATA, "once is enough")
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait([served.lost])
            await client.wait_closed()
        assert (client.close_code, client.close_reason) == (CloseCode.INVALID_DATA, "because")
        assert isinstance(served.end, ConnectionClosed)
        assert served.state is State.CLOSED


async def test_peer_that_does_not_close_is_cut_off() -> None:
    async with two_ends(close_timeout=0.01) as (client, served):
        client.transport.pause_reading()
        served.fail(CloseCode.INVALID_DATA, "because")
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait([served.lost])
        client.transport.resume_reading()


async def test_normal_close_is_detected() -> None:
    async with two_ends() as (client, served):
        await client.close()
        await served.wait_closed()
    for socket in (client, served):
        assert isinstance(socket.end, ConnectionClosedOK)


async def test_flush_sends_the_output_of_the_core() -> None:
    async with two_ends() as (client, served):
        is_heard = asyncio.Event()
        client.on_message = is_heard.set
        served.core.send_text(b"a")
        served.core.send_binary(memoryview(b"bc"), fin=False)
        served.core.send_continuation(b"d", fin=True)
        assert served.flush() == 3 + 4 + 3
        assert served.flush() == 0
        async with asyncio.timeout(PATIENCE):
            while len(client.heard) < 2:
                is_heard.clear()
                await is_heard.wait()
        assert [message for message, _, _ in client.heard] == [b"a", b"bcd"]


async def test_free_room_follows_the_transport() -> None:
    async with two_ends() as (client, served):
        told: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        served.on_room = lambda: told.set_result(served.is_full)
        assert not served.is_full
        client.transport.pause_reading()
        while not served.is_full:
            served.transport.write(Frame(Opcode.BINARY, bytes(2**16)).serialize(mask=False))
        assert not told.done()
        client.transport.resume_reading()
        async with asyncio.timeout(PATIENCE):
            assert await told is False


@pytest.mark.parametrize("is_refused", [False, True])
async def test_extensions_can_be_refused_while_a_request_is_judged(is_refused: bool) -> None:  # noqa: FBT001
    def judge(socket: ServerConnection, _request: Request) -> None:
        assert isinstance(socket, AtServer)
        if is_refused:
            socket.refuse_extensions()

    async with two_ends(compression="deflate", process_request=judge) as (client, _):
        assert bool(client.core.extensions) is not is_refused
        if not is_refused:
            kind = type(client.core.extensions[0])
            assert client.extension(kind).name == "permessage-deflate"
