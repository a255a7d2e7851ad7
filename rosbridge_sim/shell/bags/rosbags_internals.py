"""All that we use of the `rosbags` library beyond its documented interface, to write bags that survive a crash.

The library writes a chunk when it has a megabyte of messages, and an index at the end. Its writers' insides are needed
to end a chunk earlier, to keep no index entry of each message in memory, and to write an MCAP file without rosbag2's
folder. Other modules of ours take documented names from the library, and everything else from here. A test holds the
library to what this module expects (`tests/shell/bags/test_rosbags_internals.py`). It names the versions that kept to
it, which are those that `pyproject.toml` allows. With another version that does not fit, no bag is written, and the
error says which versions do.

Expected of `rosbags.rosbag1.Writer`:

    bio            the open file; None before and after
    connections    the list of all topics
    chunks         those that were written, and behind them the one that is filled. Each has `connections`: a topic's id
                   -> an index entry for each message; once the chunk is written only their number counts
    write_chunk    writes a chunk, if there is anything in it, and begins another one

Expected of `rosbags.rosbag2.Writer`: `storage` (None before and after), `connections`, `metapath`, `min_timestamp`. Of
its `McapWriter`: `path`, `bio`, `close_chunk`, `message_start_time`, and `chunk` with `msgs` and `message_start_time`.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from rosbridge_sim.errors import DocumentError

if TYPE_CHECKING:
    from rosbags.rosbag2.storage_mcap import McapWriter
    from rosbags.rosbag2.storage_mcap import decompress as unpack_mcap
else:
    try:
        from rosbags.rosbag2.storage_mcap import McapWriter
        from rosbags.rosbag2.storage_mcap import decompress as unpack_mcap
    except ImportError:  # it is told when a bag is opened
        McapWriter = unpack_mcap = None

__all__ = [
    "FITTING",
    "connections_of",
    "end_chunk1",
    "end_chunk2",
    "file_of1",
    "file_of2",
    "new_writer1",
    "new_writer2",
    "num_chunks1",
    "open_file2",
    "redirect_metadata2",
    "shorten_index1",
    "unpack_mcap",
    "zero_times2",
]

FITTING = ">=0.11.6,<0.12"
"""Versions that this module fits, as `pyproject.toml` says it."""

_NO_TIME = 2**63 - 1
"""Start value of the library when it looks for the first stamp."""


def _misfit() -> DocumentError:
    return DocumentError(
        f"bags are written by rosbags, of which {version('rosbags')} is installed and {FITTING} is expected:"
        f" pip install 'rosbags{FITTING}'"
    )


def _check(one: object, *names: str) -> None:
    """Make sure that an object or a class of the library has these attributes.

    Raises:
        DocumentError: this version has them not.
    """
    if not all(hasattr(one, name) for name in names):
        raise _misfit()


def connections_of(writer: Writer1 | Writer2) -> Sequence[Connection]:
    """All topics so far."""
    return writer.connections


# ROS 1


def new_writer1(path: Path) -> Writer1:
    """A writer that has not made its file yet.

    Raises:
        DocumentError: the library's insides are others than those that this module knows.
        WriterError: there is such a file.
    """
    writer = Writer1(path)
    _check(writer, "bio", "chunks", "connections", "write_chunk", "abort")
    _check(writer.chunks[0], "connections")
    return writer


def file_of1(writer: Writer1) -> BinaryIO | None:
    """The file that is written; None where the bag is not open."""
    return writer.bio


def num_chunks1(writer: Writer1) -> int:
    """Chunks so far, with the one that is filled."""
    return len(writer.chunks)


def end_chunk1(writer: Writer1) -> None:
    """Write what is collected, however little it is."""
    writer.write_chunk(writer.chunks[-1])


def shorten_index1(writer: Writer1) -> None:
    """Keep of the chunk that was written last what its index will need: how many messages each topic has there."""
    for chunk in writer.chunks[-2:-1]:
        counted = {key: range(len(entries)) for key, entries in chunk.connections.items()}
        chunk.connections = cast("Any", counted)  # Any: only their length is read any more


# ROS 2


class _OneFile:
    """A stand-in for a folder, with which the library's MCAP storage writes one given file."""

    def __init__(self, path: Path) -> None:
        self.name = path.stem
        self._path = path

    def __truediv__(self, _name: str) -> Path:
        return self._path


def new_writer2(path: Path) -> Writer2:
    """A writer of MCAP that has not made its folder or file yet.

    Raises:
        DocumentError: the library's insides are others than those that this module knows.
        WriterError: there is such a file.
    """
    _check(McapWriter, "close_chunk")
    writer = Writer2(path, version=Writer2.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
    _check(writer, "storage", "connections", "metapath", "min_timestamp", "abort")
    return writer


def open_file2(writer: Writer2, path: Path) -> None:
    """Open a bag that is one MCAP file, without a folder around it."""
    one_file = cast("Path", _OneFile(path))
    writer.storage = McapWriter(one_file, CompressionMode.NONE)


def _storage(writer: Writer2) -> McapWriter | None:
    return cast("McapWriter | None", writer.storage)  # the plug-in that was asked for


def file_of2(writer: Writer2) -> tuple[Path, BinaryIO] | None:
    """The path and the file that is written; None where the bag is not open."""
    storage = _storage(writer)
    return None if storage is None else (storage.path, storage.bio)


def end_chunk2(writer: Writer2) -> None:
    """Write what is collected, unless there are no messages in it."""
    storage = _storage(writer)
    if storage is not None and storage.chunk.msgs:
        storage.close_chunk()


def zero_times2(writer: Writer2) -> None:
    """Have the times of a bag without messages be 0, as the format wants it."""
    storage = _storage(writer)
    if storage is not None and storage.message_start_time == _NO_TIME:
        storage.message_start_time = writer.min_timestamp = 0
        storage.chunk.message_start_time = 0


def redirect_metadata2(writer: Writer2, path: Path) -> None:
    """Have the folder's own file written somewhere else."""
    writer.metapath = path
