"""Frames as a client reads them, and inboxes."""

from __future__ import annotations

import asyncio
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.client.frames import FrameReader, Inbox
from rosbridge_sim.errors import ConnectionLostError, FrameError


def test_object_is_a_frame_and_nothing_else_is() -> None:
    reader = FrameReader()
    assert reader.read('{"op": "status"}', 0.0) == {"op": "status"}
    for other in ("", "no JSON", "[1]", "3", "{}", b"\xa1", "[" * 100_000):
        assert reader.read(other, 0.0) is None


@given(st.binary() | st.text())
def test_any_message_gives_a_frame_or_none(data: bytes | str) -> None:
    assert FrameReader().read(data, 0.0) is None or json.loads(data)


def test_bare_nan_is_understood() -> None:
    frame = FrameReader().read('{"x": NaN}', 0.0)
    assert frame is not None
    assert frame["x"] != frame["x"]


def test_fragments_in_any_order_are_one_frame() -> None:
    text = json.dumps({"op": "publish", "msg": {"data": "한국"}}, ensure_ascii=False)
    pieces = [
        json.dumps({"op": "fragment", "id": "1", "num": i, "total": 3, "data": text[i * 20 : (i + 1) * 20]})
        for i in range(3)
    ]
    reader = FrameReader()
    assert [reader.read(pieces[i], 0.0) for i in (2, 0)] == [None, None]
    assert reader.read(pieces[1], 0.0) == {"op": "publish", "msg": {"data": "한국"}}


@pytest.mark.parametrize("piece", [{"id": 1}, {"id": 1, "num": 5, "total": 2, "data": ""}])
def test_fragment_that_cannot_be_used_is_an_error(piece: dict[str, object]) -> None:
    reader = FrameReader()
    with pytest.raises(FrameError):
        reader.read(json.dumps({"op": "fragment", **piece}), 0.0)
    assert reader.read('{"op": "status"}', 0.0) == {"op": "status"}


async def test_inbox_drops_the_oldest_first_and_counts_them() -> None:
    inbox = Inbox(2)
    for i in range(5):
        inbox.put({"i": i})
    assert inbox.num_dropped == 3
    assert [frame["i"] for frame in inbox.take()] == [3, 4]
    assert inbox.take() == []


async def test_inbox_wakes_all_who_wait() -> None:
    inbox = Inbox()
    waiting = [asyncio.create_task(inbox.next(None)) for _ in range(3)]
    await asyncio.sleep(0)
    for i in range(3):
        inbox.put({"i": i})
    frames = await asyncio.gather(*waiting)
    assert sorted(frame["i"] for frame in frames if frame) == [0, 1, 2]


async def test_inbox_gives_none_at_the_deadline_and_keeps_what_comes_later() -> None:
    inbox = Inbox()
    assert await inbox.next(asyncio.get_running_loop().time()) is None
    inbox.put({"i": 1})
    assert await inbox.next(0.0) == {"i": 1}


async def test_inbox_that_ends_gives_what_it_has_and_then_the_error() -> None:
    inbox = Inbox()
    inbox.put({"i": 1})
    inbox.end(ConnectionLostError("gone"))
    inbox.end(None)
    assert await inbox.next(None) == {"i": 1}
    for _ in range(2):
        with pytest.raises(ConnectionLostError, match="gone"):
            await inbox.next(None)
    assert inbox.is_ended
