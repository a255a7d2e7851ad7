"""Bag files for writing: a ROS 1 `.bag`, or MCAP as in ROS 2, either alone or in a rosbag2 folder.

The library rosbags writes the bytes. This module adds four things. `flush` ends the current chunk: the library waits
for a megabyte, which can be minutes of a small topic, and only a finished chunk can be recovered after a crash
(`repair.py`). Only the number of index entries is kept, not the entries, because these would fill the memory on a long
drive. Errors of the disk become `DocumentError`, one line each. And `flush` and `close` detect a bag that was deleted
or moved, because the system would keep writing without an error.
"""

from __future__ import annotations

import errno
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO, ClassVar

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag1 import WriterError as Writer1Error
from rosbags.rosbag2 import Writer as Writer2
from rosbags.rosbag2 import WriterError as Writer2Error
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.shell.bags import rosbags_internals as internals
from rosbridge_sim.shell.files.access_rights import why_not_writable

Channel = Connection
"""One topic in a bag."""

_DIGEST_SIZE = 32
"""Characters of an MD5 sum."""


class BagGoneError(DocumentError):
    """The file of a bag does not exist any more; the bag is closed."""


class Bag(ABC):
    """A bag that is being written. Each method raises DocumentError if the disk fails.

    Attributes:
        ros: ROS generation of the message bytes: ROS 1 bytes, or CDR.
    """

    ros: ClassVar[Generation]
    _path: Path
    _writer: Writer1 | Writer2

    @abstractmethod
    def add(self, topic: str, type_name: str, text: str, *, digest: str = "", latching: bool = False) -> Channel:
        """Add a topic.

        Args:
            topic: its absolute name; a name may be added again with another type.
            type_name: `pkg/Type`.
            text: its definition with those of all types in it, as from `Store.full_text`.
            digest: the generation's checksum of the definition; empty if it should be computed.
            latching: late subscribers get the last message, too.

        Returns:
            The topic, for `write`.
        """

    @abstractmethod
    def write(self, channel: Channel, stamp_ns: int, raw: bytes) -> None:
        """Add a message.

        Args:
            channel: from `add`.
            stamp_ns: time of the message [ns].
            raw: its bytes in the bag's generation.
        """

    @abstractmethod
    def flush(self) -> None:
        """Give everything to the system, so that a crash of this process does not lose it.

        Raises:
            BagGoneError: the file was deleted, moved or replaced. A moved file has got its index.
        """

    def close(self) -> None:
        """Write the index. A second call does nothing.

        Raises:
            BagGoneError: as for `flush`.
        """
        self._check_there()
        self._finish()

    def abort(self) -> None:
        """Leave the file as it is, without an index."""
        with suppress(OSError):
            self._writer.abort()

    @abstractmethod
    def _open_file(self) -> tuple[Path, BinaryIO] | None:
        """Return the path and the open file; None if the bag is not open."""

    @abstractmethod
    def _finish(self) -> None:
        """Write the index, if the bag is open."""

    def _check_there(self) -> None:
        open_file = self._open_file()
        why = None if open_file is None else _why_gone(*open_file)
        if why is not None:
            with suppress(DocumentError):
                self._finish()
            self.abort()
            raise BagGoneError(f"{self._path}: {why}")


def generation_of(path: Path) -> Generation:
    """Return the ROS generation of a bag, from its name.

    Raises:
        DocumentError: this kind of file cannot be written.
    """
    if path.suffix == ".db3":
        raise DocumentError(
            f"{path}: expected NAME.bag (ROS 1), NAME.mcap (ROS 2) or a folder's name; .db3 is not written"
        )
    return 1 if path.suffix == ".bag" else 2


def open_bag(path: Path) -> Bag:
    """Create a bag: `.bag` is ROS 1, `.mcap` is one file of ROS 2, any other name is a folder of ROS 2.

    Raises:
        DocumentError: the file exists already or cannot be created, or the installed rosbags does not fit.
    """
    if generation_of(path) == 1:
        return _Bag1(path)
    return _Bag2(path)


@lru_cache(maxsize=128)  # parsing takes 10 ms; a recording of the default scene has 41 types
def types_of(type_name: str, text: str) -> Typestore:
    """Return rosbags' own form of a type, as it is in ROS 2, with all types in it.

    Args:
        type_name: `pkg/Type`.
        text: its definition, with those of the types in it.
    """
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(text, type_name.replace("/", "/msg/")))
    return types


@lru_cache(maxsize=128)  # it takes a millisecond
def _no_digest(type_name: str, text: str, ros: Generation) -> str:
    """Return the checksum of ROS 1 (MD5) or of ROS 2 (hash)."""
    types, full_name = types_of(type_name, text), type_name.replace("/", "/msg/")
    return types.generate_msgdef(full_name, ros_version=1)[1] if ros == 1 else types.hash_rihs01(full_name)


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Turn errors of the disk into one-line errors for people."""
    try:
        yield
    except (Writer1Error, Writer2Error, FileExistsError):
        raise DocumentError(f"{path}: exists already; recordings are not overwritten") from None
    except OSError as error:
        raise DocumentError(f"{path}: cannot be written: {_why_not(path, error)}") from None


def _why_not(path: Path, error: OSError) -> str:
    if error.errno in {errno.ENOSPC, errno.EDQUOT}:
        return "the disk is full"
    if error.errno in {errno.EACCES, errno.EPERM, errno.EROFS}:
        return why_not_writable(path.parent, error)
    text = os.strerror(error.errno or 0)
    return f"{text[0].lower()}{text[1:]}"


def _why_gone(path: Path, file: BinaryIO) -> str | None:
    """Return why the open file is not the file at `path`; None if it is."""
    try:
        there = path.stat()
    except FileNotFoundError:
        there = None
    except OSError:  # without access to the folder nothing is known about the file
        return None
    held = os.fstat(file.fileno())  # after the check of the path, so that a file deleted in between is seen as deleted
    if there is not None and os.path.samestat(held, there):
        return None
    if held.st_nlink == 0:
        return "was deleted during the recording: everything recorded is lost"
    return "was moved or replaced during the recording: the moved file has everything recorded until then"


class _Bag1(Bag):
    """A ROS 1 bag, format 2.0, uncompressed."""

    ros = 1
    _writer: Writer1

    def __init__(self, path: Path) -> None:
        self._path = path
        with _readable(path):
            self._writer = internals.new_writer1(path)
            self._writer.open()
            self.flush()

    def add(self, topic: str, type_name: str, text: str, *, digest: str = "", latching: bool = False) -> Channel:
        """See `Bag`."""
        if len(digest) != _DIGEST_SIZE:
            digest = _no_digest(type_name, text, 1)
        latched = 1 if latching else None
        for known in internals.connections_of(self._writer):
            if (known.topic, known.digest, known.ext.latching) == (topic, digest, latched):  # type: ignore[union-attr]
                return known
        full_name = type_name.replace("/", "/msg/")
        return self._writer.add_connection(topic, full_name, msgdef=text, md5sum=digest, latching=latched)

    def write(self, channel: Channel, stamp_ns: int, raw: bytes) -> None:
        """See `Bag`."""
        num_chunks = internals.num_chunks1(self._writer)
        with _readable(self._path):
            self._writer.write(channel, stamp_ns, raw)
        if internals.num_chunks1(self._writer) > num_chunks:
            internals.shorten_index1(self._writer)

    def flush(self) -> None:
        """See `Bag`."""
        self._check_there()
        with _readable(self._path):
            internals.end_chunk1(self._writer)
            internals.shorten_index1(self._writer)
            file = internals.file_of1(self._writer)
            if file is not None:
                file.flush()

    def _open_file(self) -> tuple[Path, BinaryIO] | None:
        file = internals.file_of1(self._writer)
        return None if file is None else (self._path, file)

    def _finish(self) -> None:
        if internals.file_of1(self._writer) is not None:
            with _readable(self._path):
                self._writer.close()


class _Bag2(Bag):
    """An MCAP file, uncompressed, with or without rosbag2's folder."""

    ros = 2
    _writer: Writer2

    def __init__(self, path: Path) -> None:
        self._path = path
        with _readable(path):
            self._writer = internals.new_writer2(path)
            if path.suffix == ".mcap":
                internals.open_file2(self._writer, path)
            else:
                self._writer.open()
            self.flush()

    def add(self, topic: str, type_name: str, text: str, *, digest: str = "", latching: bool = False) -> Channel:
        """See `Bag`."""
        del latching  # it belongs to QoS in ROS 2, which is not written here
        digest = digest or _no_digest(type_name, text, 2)
        full_name = type_name.replace("/", "/msg/")
        for known in internals.connections_of(self._writer):
            if (known.topic, known.msgtype) == (topic, full_name):
                return known
        return self._writer.add_connection(topic, full_name, msgdef=text, rihs01=digest)

    def write(self, channel: Channel, stamp_ns: int, raw: bytes) -> None:
        """See `Bag`."""
        with _readable(self._path):
            self._writer.write(channel, stamp_ns, raw)

    def flush(self) -> None:
        """See `Bag`."""
        self._check_there()
        open_file = internals.file_of2(self._writer)
        if open_file is None:
            return
        with _readable(self._path):
            internals.end_chunk2(self._writer)
            open_file[1].flush()

    def _open_file(self) -> tuple[Path, BinaryIO] | None:
        return internals.file_of2(self._writer)

    def _finish(self) -> None:
        if internals.file_of2(self._writer) is None:
            return
        internals.zero_times2(self._writer)
        with _readable(self._path):
            if self._path.suffix == ".mcap":
                internals.drop_metadata2(self._writer)
            self._writer.close()
