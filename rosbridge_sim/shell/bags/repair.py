"""Repair of bags without an end: everything that a killed recorder wrote, up to its last complete chunk.

Both formats are a sequence of records, each with its length, and messages are in chunks. The index is at the end, so a
truncated file cannot be opened, but its chunks are complete. This module reads them one after the other, ignores any
index, and writes them into a new bag. A chunk with damage inside is skipped. The old file is not changed.
    ROS 1   a line of text, then records of a header (fields `name=value`, each with its length) and data
    MCAP    eight bytes, then records of a type number, a length, and the content
"""

from __future__ import annotations

import bz2
import os
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final, TypeVar

from lz4.frame import decompress as unpack_lz4  # type: ignore[import-untyped] # it has no type hints
from rosbags.rosbag2 import ReaderError
from rosbags.typesys import TypesysError

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.bags.bag import Bag, Channel, open_bag
from rosbridge_sim.shell.bags.rosbags_internals import unpack_mcap

_MAGIC1: Final = b"#ROSBAG V2.0\n"
_MAGIC2: Final = b"\x89MCAP0\r\n"

_MAX_RECORD: Final = 2**31
"""A longer record is damaged data [bytes]; both libraries end a chunk at a few megabytes."""

T = TypeVar("T")


@dataclass(slots=True)
class Recovered:
    """Counts of the contents of a bag.

    Attributes:
        num_messages: messages in all complete chunks.
        start_ns, end_ns: smallest and largest of their stamps [ns].
        num_damaged: chunks that were skipped.
        num_lost_bytes: bytes after the last complete record.
        lost_topics: topics whose definition is damaged, or is not in ROS 2's message format; a dict, to keep their
            order.
        is_complete: the bag has its end, so there is nothing to repair.
    """

    num_messages: int = 0
    start_ns: int = 2**63
    end_ns: int = 0
    num_damaged: int = 0
    num_lost_bytes: int = 0
    lost_topics: dict[str, None] = field(default_factory=dict)
    is_complete: bool = False


def repaired_name(path: Path) -> Path:
    """Return the default path of a repaired bag: `drive.repaired.bag` beside `drive.bag`."""
    return path.with_name(f"{path.stem}.repaired{path.suffix}")


def repair(path: Path, target: Path) -> Recovered:
    """Copy the complete parts of a bag into a new one of the same format.

    Args:
        path: `.bag`, `.mcap`, or a folder of rosbag2.
        target: path of the new bag, which must not exist.

    Returns:
        Counts of what was copied and lost.

    Raises:
        DocumentError: it is not a bag, or no part of it is complete; no new file is left then.
    """
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    if not files:
        raise DocumentError(f"{path}: expected a bag; there is no .mcap in this folder")
    found = Recovered()
    bag: Bag | None = None
    for file in files:
        try:
            with file.open("rb") as stream:
                copy = _format_of(stream, file)
                if bag is None:
                    bag = open_bag(target)
                    _check_format(bag, copy, target)
                copy(stream, bag, found)
        except OSError as error:
            raise DocumentError(f"{file}: cannot be read: {os.strerror(error.errno or 0).lower()}") from None
        except DocumentError:
            if bag is not None:
                bag.abort()
                _remove(target)
            raise
    assert bag is not None
    bag.close()
    if not found.num_messages:
        _remove(target)
        raise DocumentError(f"{path}: expected a complete chunk with messages; there is none")
    return found


_Copy = Callable[[BinaryIO, Bag, Recovered], None]


def _format_of(stream: BinaryIO, path: Path) -> _Copy:
    """Return the function that copies a file, chosen by the file's first bytes. The stream is then behind them."""
    start = stream.read(len(_MAGIC1))
    if start == _MAGIC1:
        return _copy1
    if start.startswith(_MAGIC2):
        stream.seek(len(_MAGIC2))
        return _copy2
    raise DocumentError(f"{path}: expected a ROS 1 bag (version 2.0) or MCAP; its first bytes are those of neither")


def _check_format(bag: Bag, copy: _Copy, target: Path) -> None:
    if (bag.ros == 1) != (copy is _copy1):
        raise DocumentError(f"{target}: expected the suffix of the broken bag, because the format stays the same")


def _remove(target: Path) -> None:
    """Delete the new bag."""
    with suppress(OSError):
        if target.is_dir():
            for file in target.iterdir():
                file.unlink()
            target.rmdir()
        else:
            target.unlink()


def _take(stream: BinaryIO, size: int) -> bytes:
    """Return the next bytes.

    Raises:
        EOFError: the file ends inside the record.
    """
    if size > _MAX_RECORD:
        raise EOFError
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data


def _records(data: bytes, read: Callable[[BinaryIO], T]) -> Iterator[T]:
    """Yield the records of a chunk.

    Raises:
        EOFError: the last one is cut off.
    """
    stream = BytesIO(data)
    while stream.tell() < len(data):
        yield read(stream)


class _Copier:
    """Writes messages into the new bag, and counts them."""

    def __init__(self, bag: Bag, found: Recovered) -> None:
        self.bag = bag
        self.found = found
        self.channels: dict[int, Channel] = {}

    def message(self, number: int, stamp_ns: int, raw: bytes) -> None:
        channel = self.channels.get(number)
        if channel is None:  # its topic was in a lost chunk
            return
        self.bag.write(channel, stamp_ns, raw)
        self.found.num_messages += 1
        self.found.start_ns = min(self.found.start_ns, stamp_ns)
        self.found.end_ns = max(self.found.end_ns, stamp_ns)


# ROS 1

_BAG_HEADER, _MESSAGE, _CHUNK, _CONNECTION = 3, 2, 5, 7
"""`op` of the records that are needed."""

_Fields = dict[bytes, bytes]


def _copy1(stream: BinaryIO, bag: Bag, found: Recovered) -> None:
    copier = _Copier(bag, found)
    at = stream.tell()
    try:
        while True:
            at = stream.tell()
            fields, data = _record1(stream)
            op = fields.get(b"op", b"\0")[0]
            if op == _BAG_HEADER:
                found.is_complete = _number(fields[b"index_pos"]) > 0
            elif op == _CHUNK:
                _chunk1(fields, data, copier)
            elif op in {_MESSAGE, _CONNECTION}:
                _one1(fields, data, copier)
    except (EOFError, KeyError, IndexError, ValueError, struct.error):
        found.num_lost_bytes += stream.seek(0, os.SEEK_END) - at


def _record1(stream: BinaryIO) -> tuple[_Fields, bytes]:
    (header_size,) = struct.unpack("<I", _take(stream, 4))
    header = _take(stream, header_size)
    (data_size,) = struct.unpack("<I", _take(stream, 4))
    return _fields(header), _take(stream, data_size)


def _fields(header: bytes) -> _Fields:
    fields: _Fields = {}
    at = 0
    while at < len(header):
        (size,) = struct.unpack_from("<I", header, at)
        name, sign, value = header[at + 4 : at + 4 + size].partition(b"=")
        if not sign:
            raise EOFError
        fields[name] = value
        at += 4 + size
    return fields


def _number(value: bytes) -> int:
    return int.from_bytes(value, "little")


def _chunk1(fields: _Fields, data: bytes, copier: _Copier) -> None:
    """Copy a chunk's records: all of them or none."""
    try:
        records = list(_records(_unpack1(fields[b"compression"], data), _record1))
    except (OSError, ValueError, EOFError, RuntimeError, KeyError, struct.error):
        copier.found.num_damaged += 1
        return
    for inner, content in records:
        _one1(inner, content, copier)


def _unpack1(compression: bytes, data: bytes) -> bytes:
    if compression == b"none":
        return data
    if compression == b"bz2":
        return bz2.decompress(data)
    if compression == b"lz4":
        unpacked: bytes = unpack_lz4(data)
        return unpacked
    raise ValueError(compression)


def _one1(fields: _Fields, data: bytes, copier: _Copier) -> None:
    op = fields.get(b"op", b"\0")[0]
    if op == _CONNECTION:
        inner = _fields(data)
        copier.channels[_number(fields[b"conn"])] = copier.bag.add(
            fields[b"topic"].decode(),
            inner[b"type"].decode(),
            inner[b"message_definition"].decode(),
            digest=inner[b"md5sum"].decode(),
            latching=inner.get(b"latching") == b"1",
        )
    elif op == _MESSAGE:
        secs, nsecs = struct.unpack("<II", fields[b"time"])
        copier.message(_number(fields[b"conn"]), secs * 10**9 + nsecs, data)


# MCAP

_FOOTER2, _SCHEMA2, _CHANNEL2, _MESSAGE2, _CHUNK2 = 2, 3, 4, 5, 6
"""Type numbers of the records that are needed."""

_Schemas = dict[int, tuple[str, str | None]]
"""Number -> type and definition; None for a definition in a format that cannot be read."""


def _copy2(stream: BinaryIO, bag: Bag, found: Recovered) -> None:
    copier = _Copier(bag, found)
    schemas: _Schemas = {}
    at = stream.tell()
    try:
        while True:
            at = stream.tell()
            op, data = _record2(stream)
            if op == _FOOTER2:
                found.is_complete = True
                return
            if op == _CHUNK2:
                _chunk2(data, schemas, copier)
            else:
                _one2(op, data, schemas, copier)
    except (EOFError, ValueError, struct.error):
        found.num_lost_bytes += stream.seek(0, os.SEEK_END) - at


def _chunk2(data: bytes, schemas: _Schemas, copier: _Copier) -> None:
    """Copy a chunk's records: all of them or none."""
    try:
        size, crc = struct.unpack_from("<QI", data, 16)
        compression, at = _text(data, 28)
        records = list(_records(unpack_mcap(data[at + 8 :], compression, size, crc), _record2))
    except (EOFError, ReaderError, OSError, ValueError, RuntimeError, struct.error):
        copier.found.num_damaged += 1
        return
    for op, content in records:
        _one2(op, content, schemas, copier)


def _record2(stream: BinaryIO) -> tuple[int, bytes]:
    op, size = struct.unpack("<BQ", _take(stream, 9))
    return op, _take(stream, size)


def _one2(op: int, data: bytes, schemas: _Schemas, copier: _Copier) -> None:
    if op == _SCHEMA2:
        (number,) = struct.unpack_from("<H", data)
        name, at = _text(data, 2)
        encoding, at = _text(data, at)
        schemas[number] = name.replace("/msg/", "/"), _text(data, at)[0] if encoding == "ros2msg" else None
    elif op == _CHANNEL2:
        number, schema = struct.unpack_from("<HH", data)
        topic, _ = _text(data, 4)
        if number not in copier.channels and schema in schemas:
            name, text = schemas[schema]
            try:
                if text is not None:
                    copier.channels[number] = copier.bag.add(topic, name, text)
            except (TypesysError, KeyError, ValueError):
                text = None
            if text is None:
                copier.found.lost_topics[topic] = None
    elif op == _MESSAGE2:
        number, _, stamp_ns = struct.unpack_from("<HIQ", data)
        copier.message(number, stamp_ns, data[22:])


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Return a text that has its length in front, and the position behind it."""
    (size,) = struct.unpack_from("<I", data, at)
    return data[at + 4 : at + 4 + size].decode(), at + 4 + size
