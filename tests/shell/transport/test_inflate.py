"""Compressed messages, inflated in slices: the same bytes as the library's, within bounds."""

from __future__ import annotations

import json
import random
import zlib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, ProtocolError
from websockets.extensions.permessage_deflate import PerMessageDeflate
from websockets.frames import Frame, Opcode

from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.transport.inflate import Deflated, LateDeflate, inflate
from tests.support import finish

MB = 2**20


def pair(*, is_fresh: bool) -> tuple[PerMessageDeflate, LateDeflate]:
    """A client's end of the extension, and the server's."""
    client = PerMessageDeflate(False, is_fresh, 12, 12)  # noqa: FBT003 - the library's own
    return client, LateDeflate(PerMessageDeflate(is_fresh, False, 12, 12), is_fresh=is_fresh, window_bits=12)  # noqa: FBT003 - the same


def deflated(client: PerMessageDeflate, server: LateDeflate, message: bytes) -> Deflated:
    frame = server.decode(client.encode(Frame(Opcode.TEXT, message)))
    assert isinstance(frame.data, Deflated)
    assert not frame.rsv1
    return frame.data


@given(st.lists(st.binary(max_size=300), max_size=5), st.booleans())
def test_messages_inflate_in_order_with_and_without_context_takeover(messages: list[bytes], is_fresh: bool) -> None:  # noqa: FBT001
    client, server = pair(is_fresh=is_fresh)
    for message in messages:
        data = deflated(client, server, message)
        assert finish(inflate(server, data, MB)) == message


@pytest.mark.parametrize("size", [0, 1, 2**18, 2**18 + 1, 3_000_000])
@pytest.mark.parametrize("is_random", [True, False])
def test_messages_of_any_size_are_inflated_in_slices(size: int, *, is_random: bool) -> None:
    client, server = pair(is_fresh=False)
    message = random.Random(0).randbytes(size) if is_random else bytes(size)  # noqa: S311 - the same each time
    data = deflated(client, server, message)
    assert sum(1 for _ in inflate(server, data, 4 * MB)) >= size // 2**18
    assert finish(inflate(server, deflated(client, server, b"next"), MB)) == b"next"


def test_message_that_inflates_beyond_the_limit_is_refused_midway() -> None:
    client, server = pair(is_fresh=False)
    data = deflated(client, server, bytes(8 * MB))
    assert len(data) < MB
    slices = inflate(server, data, MB)
    assert finish(slices) is None
    client, server = pair(is_fresh=False)
    assert sum(1 for _ in inflate(server, deflated(client, server, bytes(8 * MB)), MB)) < 10


def test_rubbish_is_a_zlib_error() -> None:
    _, server = pair(is_fresh=False)
    with pytest.raises(zlib.error):
        finish(inflate(server, Deflated(b"\xff" * 100), MB))


def test_control_frames_and_plain_messages_are_not_inflated() -> None:
    _, server = pair(is_fresh=False)
    for frame in (Frame(Opcode.PING, b"?"), Frame(Opcode.TEXT, b"plain"), Frame(Opcode.CONT, b"more")):
        assert server.decode(frame) is frame


def test_compressed_fragments_are_marked_and_a_sender_may_not_mark_one() -> None:
    _, server = pair(is_fresh=False)
    assert isinstance(server.decode(Frame(Opcode.TEXT, b"a", fin=False, rsv1=True)).data, Deflated)
    assert isinstance(server.decode(Frame(Opcode.CONT, b"b", fin=False)).data, Deflated)
    with pytest.raises(ProtocolError, match="RSV1"):
        server.decode(Frame(Opcode.CONT, b"c", rsv1=True))
    assert isinstance(server.decode(Frame(Opcode.CONT, b"c")).data, Deflated)
    assert type(server.decode(Frame(Opcode.TEXT, b"plain")).data) is bytes


async def talk(socket: ClientConnection, *ops: dict[str, Any]) -> list[dict[str, Any]]:
    """Send ops; what comes back until the answer to the last one."""
    for op in ops:
        await socket.send(json.dumps(op))
    await socket.send(json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "last"}))
    frames = [json.loads(await socket.recv())]
    while frames[-1].get("id") != "last":
        frames.append(json.loads(await socket.recv()))
    return frames[:-1]


async def test_compressing_client_is_served_in_order() -> None:
    async with (
        Simulator(port=0, compression=True, world=False) as sim,
        connect(sim.url, compression="deflate", max_size=None, proxy=None) as socket,
    ):
        text = "x" * 3_000_000
        heard = await talk(
            socket,
            {"op": "subscribe", "topic": "/t", "type": "std_msgs/String"},
            {"op": "publish", "topic": "/t", "msg": {"data": text}},
            {"op": "publish", "topic": "/t", "msg": {"data": "after"}},
        )
        while len(heard) < 2:
            heard.append(json.loads(await socket.recv()))
        assert [frame["msg"]["data"] for frame in heard] == [text, "after"]


async def test_decompression_bomb_disconnects_only_its_sender() -> None:
    async with (
        Simulator(port=0, compression=True, world=False, max_frame_size=MB) as sim,
        connect(sim.url, compression="deflate", max_size=None, proxy=None) as bomber,
        connect(sim.url, max_size=None, proxy=None) as other,
    ):
        await bomber.send("x" * (2 * MB))
        with pytest.raises(ConnectionClosed):
            await bomber.recv()
        assert bomber.close_code == 1009
        assert await talk(other) == []


@pytest.mark.parametrize("length", [0, 300_000])
@pytest.mark.parametrize("in_fragments", [False, True])
async def test_compressed_text_that_is_not_utf_8_disconnects_only_its_sender(
    length: int, *, in_fragments: bool
) -> None:
    async with (
        Simulator(port=0, compression=True, world=False) as sim,
        connect(sim.url, compression="deflate", max_size=None, proxy=None) as bad,
        connect(sim.url, max_size=None, proxy=None) as other,
    ):
        text = "가".encode() * length + b"\xff"
        await bad.send([text[:1], text[1:]] if in_fragments else text, text=True)
        with pytest.raises(ConnectionClosed):
            await bad.recv()
        assert bad.close_code == 1007
        assert bad.close_reason == f"text is not UTF-8: invalid start byte at byte {3 * length}"
        assert await talk(other) == []


async def test_compressed_texts_beyond_ascii_and_binary_frames_are_served() -> None:
    async with (
        Simulator(port=0, compression=True, world=False) as sim,
        connect(sim.url, compression="deflate", max_size=None, proxy=None) as socket,
    ):
        text = "가" * 300_000
        await socket.send(b"\xff\xff")  # no op, and no reason to close
        assert json.loads(await socket.recv())["op"] == "status"
        heard = await talk(
            socket,
            {"op": "subscribe", "topic": "/t", "type": "std_msgs/String"},
            {"op": "publish", "topic": "/t", "msg": {"data": text}},
        )
        await socket.send(f'{{"op":"publish","topic":"/t","msg":{{"data":"{text}"}}}}')
        while len(heard) < 2:
            heard.append(json.loads(await socket.recv()))
        assert [frame["msg"]["data"] for frame in heard] == [text, text]
