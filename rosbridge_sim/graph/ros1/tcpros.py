"""TCPROS: the header of a connection between nodes of ROS 1, and the bytes of messages after it.

Everything has its length before it: four bytes, little-endian. A header is a list of `name=value`, each with its
length, and its own length before all of them. Source: wiki.ros.org/ROS/Connection%20Header.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.protocol.client_memory import Account

MAX_HEADER: Final = 2**18
"""Longest header [bytes]: the definition of the longest real type in it has 40 kB."""

MAX_FIELDS: Final = 100
"""Most fields of a header; the longest real one has ten."""

_LENGTH: Final = struct.Struct("<I")


def write_header(fields: Mapping[str, str]) -> bytes:
    """Return a header, with its length before it.

    Args:
        fields: name -> value.
    """
    lines = [f"{name}={value}".encode() for name, value in fields.items()]
    return with_length(b"".join(with_length(line) for line in lines))


def with_length(body: bytes) -> bytes:
    """Return bytes with their length before them."""
    return _LENGTH.pack(len(body)) + body


def read_header(data: bytes) -> dict[str, str]:
    """Return the fields of a header, name -> value.

    Args:
        data: the header without the length before it.

    Raises:
        GraphError: it is malformed.
    """
    fields: dict[str, str] = {}
    at = num = 0
    while at < len(data):
        num += 1
        length = _LENGTH.unpack_from(data, at)[0] if at + _LENGTH.size <= len(data) else len(data)
        at += _LENGTH.size
        name, equals, value = data[at : at + length].partition(b"=")
        at += length
        if at > len(data) or not equals or num > MAX_FIELDS:
            raise GraphError(f"malformed connection header: expected fields name=value; got {data[:60]!r}")
        fields[name.decode(errors="replace")] = value.decode(errors="replace")
    return fields


class MessageCutter:
    """Cuts a stream of bytes into messages; one that is too long is skipped, and takes no memory.

    Attributes:
        num_skipped: messages that were too long.
    """

    def __init__(self, max_size: int, room: Account) -> None:
        """Start at the length of a message.

        Args:
            max_size: longest message [bytes].
            room: for messages that are not complete; `close` gives back what they have.
        """
        self.num_skipped = 0
        self._room = room
        self._taken = 0
        self._max_size = max_size
        self._data = bytearray()
        self._skip = 0  # bytes of a message that is too long

    @property
    def is_within(self) -> bool:
        """True if memory is taken for a message that is not complete."""
        return self._taken > 0

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the messages that are complete with these bytes; all of them must be taken before the next call."""
        if self._skip:
            skipped = min(self._skip, len(data))
            self._skip -= skipped
            data = data[skipped:]
        buffer = self._data
        buffer += data
        at = 0
        while len(buffer) - at >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(buffer, at)
            end = at + _LENGTH.size + length
            if length > self._max_size:
                self._skip_rest(end - len(buffer))
            elif end > len(buffer):
                break
            else:
                yield bytes(memoryview(buffer)[at + _LENGTH.size : end])
            at = min(end, len(buffer))
        del buffer[:at]
        self.close()
        if self._room.take(len(buffer)):
            self._taken = len(buffer)
        elif len(buffer) >= _LENGTH.size:
            self._skip_rest(_LENGTH.size + _LENGTH.unpack_from(buffer)[0] - len(buffer))
            buffer.clear()

    def _skip_rest(self, num_bytes: int) -> None:
        self.num_skipped += 1
        self._skip = max(0, num_bytes)

    def close(self) -> None:
        """Give back the memory of a message that is not complete."""
        self._room.give(self._taken)
        self._taken = 0
