"""Everything that is used of the `rosbags` library beyond its documented interface, to write bags that survive a crash.

The library writes a chunk when it has a megabyte of messages, and an index at the end. Private parts of its writers are
needed for three things: to end a chunk earlier, to avoid an index entry in memory for each message, and to write an
MCAP file without rosbag2's folder. Other modules use only documented names of the library, and everything else from
here. A test checks that the library has these parts (`tests/shell/bags/test_rosbags_internals.py`). It names the tested
versions, which are those that `pyproject.toml` allows. With another version that does not fit, no bag is written, and
the error names the versions that fit.
Expected of `rosbags.rosbag1.Writer`:
    bio            the open file; None before opening and after closing
    connections    the list of all topics
    chunks         the written chunks, and the current one at the end. Each has `connections`: a topic's id -> an index
                   entry for each message; after the chunk is written, only their number counts
    write_chunk    writes the current chunk, if it is not empty, and begins another one

Expected of `rosbags.rosbag2.Writer`: `storage` (None before opening and after closing), `connections`, `metapath`,
`min_timestamp`. Expected of its `McapWriter`: `path`, `bio`, `close_chunk`, `message_start_time`, and `chunk` with
`msgs` and `message_start_time`.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, BinaryIO, cast

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from rosbridge_sim.errors import DocumentError

try:
    from rosbags.rosbag2 import storage_mcap
except ImportError:  # the error is raised when a bag is opened
    storage_mcap = None  # type: ignore[assignment] # as above

FITTING = ">=0.11.6,<0.12"
"""Versions that this module supports, as in `pyproject.toml`."""

_NO_TIME = 2**63 - 1
"""The library's value for "no stamp yet"."""


def _check(one: object, *names: str) -> None:
    """Check that an object or class of the library has these attributes.

    Raises:
        DocumentError: the installed version does not have them.
    """
    if not all(hasattr(one, name) for name in names):
        raise DocumentError(
            f"bags need rosbags {FITTING}, but {version('rosbags')} is installed: pip install 'rosbags{FITTING}'"
        )


def connections_of(writer: Writer1 | Writer2) -> Sequence[Connection]:
    """Return all topics so far."""
    return writer.connections


# ROS 1


def new_writer1(path: Path) -> Writer1:
    """Return a writer that has not created its file yet.

    Raises:
        DocumentError: the library's private parts are not as expected.
        WriterError: the file exists.
    """
    writer = Writer1(path)
    _check(writer, "bio", "chunks", "connections", "write_chunk", "abort")
    _check(writer.chunks[0], "connections")
    return writer


def file_of1(writer: Writer1) -> BinaryIO | None:
    """Return the open file; None if the bag is not open."""
    return writer.bio


def num_chunks1(writer: Writer1) -> int:
    """Return the number of chunks so far, with the current one."""
    return len(writer.chunks)


def end_chunk1(writer: Writer1) -> None:
    """Write the current chunk, however small it is."""
    writer.write_chunk(writer.chunks[-1])


def shorten_index1(writer: Writer1) -> None:
    """Reduce the index of the last written chunk to the number of messages of each topic."""
    for chunk in writer.chunks[-2:-1]:
        counted = {key: range(len(entries)) for key, entries in chunk.connections.items()}
        chunk.connections = cast("Any", counted)  # Any: from now on only their length is read


# ROS 2


class _OneFile:
    """A replacement for a folder: the library's MCAP storage then writes one given file."""

    def __init__(self, path: Path) -> None:
        self.name = path.stem
        self._path = path

    def __truediv__(self, _name: str) -> Path:
        return self._path


class _NoFile:
    """A replacement for the path of the folder's own file, which the library writes beside it and then moves there."""

    def with_suffix(self, _suffix: str) -> _NoFile:
        return self

    def write_text(self, text: str, _encoding: str) -> int:
        return len(text)

    def replace(self, target: _NoFile) -> _NoFile:
        return target


def new_writer2(path: Path) -> Writer2:
    """Return a writer of MCAP that has not created its folder or file yet.

    Raises:
        DocumentError: the library's private parts are not as expected.
        WriterError: the file exists.
    """
    _check(storage_mcap, "McapWriter", "decompress")
    _check(storage_mcap.McapWriter, "close_chunk")
    writer = Writer2(path, version=Writer2.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
    _check(writer, "storage", "connections", "metapath", "min_timestamp", "abort")
    return writer


def open_file2(writer: Writer2, path: Path) -> None:
    """Open a bag that is one MCAP file, without a folder.

    Args:
        writer: from `new_writer2`.
    """
    one_file = cast("Path", _OneFile(path))
    writer.storage = storage_mcap.McapWriter(one_file, CompressionMode.NONE)


def _storage(writer: Writer2) -> storage_mcap.McapWriter | None:
    return cast("storage_mcap.McapWriter | None", writer.storage)  # the requested plug-in


def file_of2(writer: Writer2) -> tuple[Path, BinaryIO] | None:
    """Return the path and the open file; None if the bag is not open."""
    storage = _storage(writer)
    return None if storage is None else (storage.path, storage.bio)


def end_chunk2(writer: Writer2) -> None:
    """Write the current chunk, unless it has no messages."""
    storage = _storage(writer)
    if storage is not None and storage.chunk.msgs:
        storage.close_chunk()


def zero_times2(writer: Writer2) -> None:
    """Set the times of a bag without messages to 0, as the format requires."""
    storage = _storage(writer)
    if storage is not None and storage.message_start_time == _NO_TIME:
        storage.message_start_time = writer.min_timestamp = 0
        storage.chunk.message_start_time = 0


def drop_metadata2(writer: Writer2) -> None:
    """Write the folder's own file nowhere: a bag that is one MCAP file has its contents, too."""
    writer.metapath = cast("Path", _NoFile())


def unpack_mcap(data: bytes, compression: str, size: int, crc: int) -> bytes:
    """Return the unpacked records of a chunk of MCAP, whose size and checksum are told by it."""
    return storage_mcap.decompress(data, compression, size, crc)
