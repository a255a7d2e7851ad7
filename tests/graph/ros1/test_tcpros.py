"""Headers and messages of TCPROS: the bytes, cut at any place, and those of strangers."""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.ros1.tcpros import MAX_FIELDS, MessageCutter, read_header, with_length, write_header
from rosbridge_sim.protocol.client_memory import Account


def test_a_header_has_the_length_of_each_part_before_it() -> None:
    # as in wiki.ros.org/ROS/Connection Header
    header = write_header({"topic": "/a", "md5sum": "*"})
    assert header == b"\x18\0\0\0" + b"\x08\0\0\0topic=/a" + b"\x08\0\0\0md5sum=*"
    assert read_header(header[4:]) == {"topic": "/a", "md5sum": "*"}


def test_a_value_may_have_equal_signs_and_lines() -> None:
    fields = {"message_definition": "uint8 A=1\n====\nMSG: a/B"}
    assert read_header(write_header(fields)[4:]) == fields


@given(st.binary(max_size=60))
def test_any_bytes_are_a_header_or_malformed(data: bytes) -> None:
    with suppress(GraphError):
        assert all(isinstance(value, str) for value in read_header(data).values())


def test_a_header_of_endless_fields_is_refused() -> None:
    with pytest.raises(GraphError):
        read_header(with_length(b"a=") * (MAX_FIELDS + 1) + with_length(b"b="))


@given(st.lists(st.binary(max_size=9), max_size=6), st.lists(st.integers(0, 60), max_size=8))
def test_messages_are_the_same_however_they_are_cut(messages: list[bytes], cuts: list[int]) -> None:
    data = b"".join(map(with_length, messages))
    cutter = MessageCutter(6, Account(1000))
    got: list[bytes] = []
    places = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for start, end in pairwise(places):
        got += cutter.feed(data[start:end])
    assert got == [message for message in messages if len(message) <= 6]
    assert cutter.num_skipped == sum(len(message) > 6 for message in messages)


def test_a_message_of_four_gigabytes_takes_no_memory() -> None:
    cutter = MessageCutter(2**20, Account(2**30))
    assert not list(cutter.feed(b"\xff\xff\xff\xff"))
    for _ in range(100):
        assert not list(cutter.feed(bytes(2**16)))
    assert cutter.num_skipped == 1


def test_what_many_senders_have_begun_shares_one_room_and_a_promise_takes_none() -> None:
    room = Account(100)
    first, second = (MessageCutter(80, room) for _ in range(2))
    assert not list(first.feed(b"\x50\0\0\0"))
    assert (room.num_bytes, first.is_within) == (4, True)
    assert not list(first.feed(b"x" * 60))
    assert not list(second.feed(b"\x50\0\0\0" + b"x" * 40))
    assert (second.num_skipped, room.num_bytes) == (1, 64)
    assert list(second.feed(b"x" * 40 + with_length(b"hi"))) == [b"hi"], "it goes on after the message"
    assert list(first.feed(b"x" * 20)) == [b"x" * 80]
    assert (room.num_bytes, first.is_within) == (0, False)
    assert not list(first.feed(b"\x50\0\0\0x"))
    first.close()
    assert room.num_bytes == 0
