"""The contract with the `rosbags` library: what we use of it beyond its documented interface is there and behaves.

A new version of the library is tried by running this file, `test_bag.py`, `test_repair.py`, `test_bag_recorder.py`,
`test_recordings.py` and `tests/schema/definitions/test_standard.py` with it. If they pass, it joins `TRIED`.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest
from rosbags.rosbag1 import Reader as Reader1

from rosbridge_sim.shell.bags import rosbags_internals as internals
from tests import fork_server
from tests.shell.bags.bag_reading import read_bag
from tests.support import ROOT

TRIED = ("0.11.6", "0.11.7", "0.11.8", "0.11.9")
"""Versions with which this contract held. Writers of older ones have no `abort`, or no MCAP of their own."""

DOCUMENTED = {
    "rosbags.interfaces": {"Connection", "MessageDefinitionFormat", "Nodetype"},
    "rosbags.interfaces.typing": {"Fielddefs", "Typesdict"},
    "rosbags.rosbag1": {"Reader", "Writer", "WriterError"},
    "rosbags.rosbag2": {"Reader", "ReaderError", "Writer", "WriterError"},
    "rosbags.typesys": {"Stores", "TypesysError", "get_types_from_msg", "get_typestore"},
    "rosbags.typesys.store": {"Typestore"},
}
"""Module -> public names, which any module of ours may use."""

UNDOCUMENTED = {"bio", "chunks", "close_chunk", "metapath", "min_timestamp", "write_chunk", "FIELDDEFS"}
"""Attributes of the library's writers and stores that `rosbags_internals.py` alone may use."""

FENCE = ROOT / "rosbridge_sim" / "shell" / "bags" / "rosbags_internals.py"
TEXT = "string data\n"
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def users() -> Iterator[tuple[Path, ast.Module]]:
    """The modules of ours that name the library, apart from the one that may."""
    for path in sorted((ROOT / "rosbridge_sim").rglob("*.py")):
        text = path.read_text()
        if path != FENCE and "rosbags" in text:
            yield path, ast.parse(text)


@pytest.mark.slow  # some twenty files are parsed
def test_other_modules_use_only_documented_names_of_rosbags() -> None:
    strange = []
    for path, tree in users():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "rosbags":
                names = {alias.name for alias in node.names} - DOCUMENTED.get(node.module or "", set())
                strange += [f"{path.name}: {node.module}.{name}" for name in names]
            elif isinstance(node, ast.Attribute) and node.attr in UNDOCUMENTED:
                strange.append(f"{path.name}:{node.lineno}: {node.attr}")
    assert strange == []


def test_allowed_versions_are_the_tried_ones() -> None:
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    (line,) = (line for line in wanted if line.startswith("rosbags"))
    major, minor, _ = map(int, TRIED[-1].split("."))
    assert line == f"rosbags>={TRIED[0]},<{major}.{minor + 1}" == "rosbags" + internals.FITTING
    assert version("rosbags").startswith(f"{major}.{minor}.")


def test_ros_1_chunks_can_be_closed_with_message_counts_only(tmp_path: Path) -> None:
    path = tmp_path / "x.bag"
    writer = internals.new_writer1(path)
    assert internals.file_of1(writer) is None
    writer.open()
    file = internals.file_of1(writer)
    assert file is not None
    internals.end_chunk1(writer)  # there is nothing in it: as good as never
    assert internals.num_chunks1(writer) == 1
    topic = writer.add_connection("/t", "std_msgs/msg/String", msgdef=TEXT, md5sum="0" * 32)
    assert list(internals.connections_of(writer)) == [topic]
    for i in range(6):
        writer.write(topic, i, b"\1\0\0\0x")
        if i % 2:
            internals.end_chunk1(writer)
            internals.shorten_index1(writer)
            file.flush()
            assert internals.num_chunks1(writer) == 2 + i // 2
            assert len(writer.chunks[-2].connections[topic.id]) == 2
    writer.close()
    assert internals.file_of1(writer) is None
    with Reader1(path) as reader:
        assert [stamp for _, stamp, _ in reader.messages()] == list(range(6))
        assert reader.connections[0].msgcount == 6


@pytest.mark.parametrize("name", ["x.mcap", "x"])
def test_ros_2_chunks_can_be_closed(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    writer = internals.new_writer2(path)
    assert internals.file_of2(writer) is None
    if name == "x":
        writer.open()
    else:
        internals.open_file2(writer, path)
    open_file = internals.file_of2(writer)
    assert open_file is not None
    written, file = open_file
    assert written == (path if name == "x.mcap" else path / "x.mcap")
    topic = writer.add_connection("/t", "std_msgs/msg/String", msgdef=TEXT, rihs01=HASH)
    internals.end_chunk2(writer)
    file.flush()
    size = written.stat().st_size
    for i in range(2):
        writer.write(topic, i + 5, b"\0\1\0\0\2\0\0\0x\0")
        internals.end_chunk2(writer)
        file.flush()
        assert written.stat().st_size > size
        size = written.stat().st_size
    if name == "x.mcap":
        internals.drop_metadata2(writer)
    writer.close()
    assert internals.file_of2(writer) is None
    assert [(topic, stamp, message.data) for topic, stamp, message in read_bag(path)] == [
        ("/t", 5, "x"),
        ("/t", 6, "x"),
    ]
    assert sorted(each.name for each in tmp_path.rglob("*")) == (
        ["x.mcap"] if name == "x.mcap" else ["metadata.yaml", "x", "x.mcap"]
    )


def test_empty_ros_2_bag_has_zero_times(tmp_path: Path) -> None:
    path = tmp_path / "x"
    writer = internals.new_writer2(path)
    writer.open()
    internals.zero_times2(writer)
    writer.close()
    assert "nanoseconds_since_epoch: 0\n" in (path / "metadata.yaml").read_text()
    assert read_bag(path) == []


OTHER = """
import sys
from pathlib import Path
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import storage_mcap
del {gone}  # as if a version had given it up
for name in [name for name in sys.modules if name.startswith("rosbridge_sim.shell.bags")]:
    del sys.modules[name]  # what this process has been forked with
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.bags.bag import open_bag
try:
    open_bag(Path(sys.argv[1]))
except DocumentError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gone", "name"),
    [
        ("Writer.write_chunk", "x.bag"),
        ("storage_mcap.McapWriter.close_chunk", "x.mcap"),
        ("storage_mcap.decompress", "x.mcap"),
    ],
)
def test_unsupported_library_version_is_reported_before_a_file_is_created(tmp_path: Path, gone: str, name: str) -> None:
    path = tmp_path / name
    done = fork_server.run(["-c", OTHER.format(gone=gone), str(path)])
    assert done.stdout == (
        f"bags need rosbags >=0.11.6,<0.12, but {version('rosbags')} is installed:"
        " pip install 'rosbags>=0.11.6,<0.12'\n"
    ), done.stderr
    assert not path.exists()
