"""Bags that were cut off or damaged, made readable again."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.bags.bag import Bag, open_bag
from rosbridge_sim.shell.bags.repair import repair, repaired_name
from tests.cli.tool_fixture import run
from tests.conftest import Connect
from tests.mutations import examples
from tests.shell.bags.bag_reading import read_bag
from tests.support import ServerProcess

SECOND = 10**9

NAMES = ("drive.bag", "drive.mcap", "drive")


def raw_of(ros: int, text: str) -> bytes:
    """A std_msgs/String as ROS 1 bytes or as CDR."""
    data = text.encode()
    return (
        struct.pack("<I", len(data)) + data
        if ros == 1
        else b"\0\1\0\0" + struct.pack("<I", len(data) + 1) + data + b"\0"
    )


def fill(bag: Bag, num_chunks: int) -> None:
    """Chunks of two messages, one of each second."""
    channel = bag.add("/chatter", "std_msgs/String", "string data")
    for i in range(2 * num_chunks):
        bag.write(channel, i * SECOND, raw_of(bag.ros, f"hello {i}"))
        if i % 2:
            bag.flush()


def file_of(path: Path) -> Path:
    return path / f"{path.name}.mcap" if path.is_dir() else path


def words_in(path: Path) -> list[str]:
    return [message.data for _, _, message in read_bag(path)]


HELLO = [f"hello {i}" for i in range(6)]


@pytest.mark.parametrize("name", NAMES)
def test_bag_without_an_end_keeps_its_complete_chunks(tmp_path: Path, name: str) -> None:
    bag = open_bag(tmp_path / name)
    fill(bag, 3)
    bag.abort()
    before = file_of(tmp_path / name).read_bytes()
    target = repaired_name(tmp_path / name)
    found = repair(tmp_path / name, target)
    assert words_in(target) == HELLO
    assert (found.num_messages, found.start_ns, found.end_ns) == (6, 0, 5 * SECOND)
    assert (found.num_damaged, found.num_lost_bytes, found.is_complete) == (0, 0, False)
    assert file_of(tmp_path / name).read_bytes() == before


@pytest.mark.parametrize("name", NAMES)
def test_truncated_chunk_is_lost_alone(tmp_path: Path, name: str) -> None:
    bag = open_bag(tmp_path / name)
    fill(bag, 3)
    bag.abort()
    file = file_of(tmp_path / name)
    content = file.read_bytes()
    cut = content.rindex(b"hello 5") + 3
    file.write_bytes(content[:cut])
    found = repair(tmp_path / name, tmp_path / ("new" + (tmp_path / name).suffix))
    assert words_in(tmp_path / ("new" + (tmp_path / name).suffix)) == HELLO[:4]
    assert found.num_lost_bytes > 0


@pytest.mark.parametrize("name", NAMES)
def test_intact_bag_is_copied(tmp_path: Path, name: str) -> None:
    bag = open_bag(tmp_path / name)
    fill(bag, 3)
    bag.close()
    result = run("bag", "repair", str(tmp_path / name))
    target = repaired_name(tmp_path / name)
    assert (result.code, result.out) == (0, f"{target}: 6 messages from 0.00 s to 5.00 s; nothing was missing\n")
    assert read_bag(target)[0][:2] == read_bag(tmp_path / name)[0][:2]


@pytest.mark.parametrize("compression", Writer1.CompressionFormat)
def test_compressed_chunks_of_other_recorders_are_read(tmp_path: Path, compression: Writer1.CompressionFormat) -> None:
    writer = Writer1(tmp_path / "a.bag")
    writer.set_compression(compression)
    writer.open()
    channel = writer.add_connection(
        "/chatter", "std_msgs/msg/String", msgdef="string data", md5sum="992ce8a1687cec8c8bd883ec73ca41d1"
    )
    writer.write(channel, 0, raw_of(1, "hello"))
    writer.write_chunk(writer.chunks[-1])
    writer.abort()
    repair(tmp_path / "a.bag", tmp_path / "b.bag")
    assert words_in(tmp_path / "b.bag") == ["hello"]


def test_compressed_mcap_is_read(tmp_path: Path) -> None:
    writer = Writer2(tmp_path / "a", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    writer.open()
    channel = writer.add_connection(
        "/chatter",
        "std_msgs/msg/String",
        msgdef="string data",
        rihs01="RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    )
    writer.write(channel, 0, raw_of(2, "hello"))
    writer.close()
    file = tmp_path / "a" / "a.mcap"
    file.write_bytes(file.read_bytes()[:-60])
    repair(tmp_path / "a", tmp_path / "b")
    assert words_in(tmp_path / "b") == ["hello"]


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap"])
def test_damaged_chunk_is_skipped(tmp_path: Path, name: str) -> None:
    bag = open_bag(tmp_path / name)
    fill(bag, 3)
    bag.abort()
    content = bytearray((tmp_path / name).read_bytes())
    at = content.index(b"hello 2")
    if name.endswith(".bag"):
        at = content.index(b"op=\x02", at) - 8  # the length of the next record's header
        content[at : at + 4] = b"\xff\xff\xff\x7f"
    else:
        at = content.index(b"\x05", at + 7)  # the next message
        content[at + 1 : at + 9] = b"\xff" * 8
    (tmp_path / name).write_bytes(content)
    found = repair(tmp_path / name, tmp_path / f"new.{name}")
    assert words_in(tmp_path / f"new.{name}") == [*HELLO[:2], *HELLO[4:]]
    assert found.num_damaged == 1


@examples(40)
@given(
    name=st.sampled_from(["drive.bag", "drive.mcap"]),
    at=st.integers(0, 10_000),
    junk=st.binary(min_size=1, max_size=12),
)
def test_any_damage_gives_a_bag_or_one_error_line(
    tmp_path_factory: pytest.TempPathFactory, name: str, at: int, junk: bytes
) -> None:
    folder = tmp_path_factory.mktemp("junk")
    bag = open_bag(folder / name)
    fill(bag, 3)
    bag.abort()
    content = bytearray((folder / name).read_bytes())
    at %= len(content)
    content[at : at + len(junk)] = junk
    (folder / name).write_bytes(content)
    try:
        repair(folder / name, folder / f"new.{name}")
    except DocumentError as error:
        assert "\n" not in str(error)  # noqa: PT017 - either is right
        assert not (folder / f"new.{name}").exists()


# Mistakes


def complaint(*words: str) -> str:
    result = run("bag", "repair", *words)
    assert result.code == 2
    return result.complaint


def test_file_that_is_no_bag_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "a.bag").write_text("no bag at all, but a text")
    (tmp_path / "empty").mkdir()
    assert "a.bag: expected a ROS 1 bag (version 2.0) or MCAP; its first bytes are those of neither" in complaint(
        str(tmp_path / "a.bag")
    )
    assert "there is no .mcap in this folder" in complaint(str(tmp_path / "empty"))
    assert "nowhere.bag: cannot be read: no such file or directory" in complaint(str(tmp_path / "nowhere.bag"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag", "empty"]


def test_bag_without_a_chunk_leaves_no_output_file(tmp_path: Path) -> None:
    open_bag(tmp_path / "a.bag").abort()
    assert "a.bag: expected a complete chunk with messages; there is none" in complaint(str(tmp_path / "a.bag"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag"]


def test_repair_overwrites_nothing_and_keeps_the_format(tmp_path: Path) -> None:
    bag = open_bag(tmp_path / "a.bag")
    fill(bag, 1)
    bag.abort()
    (tmp_path / "b.bag").write_text("precious")
    path = str(tmp_path / "a.bag")
    assert "b.bag: exists already" in complaint(path, "--output", str(tmp_path / "b.bag"))
    assert (tmp_path / "b.bag").read_text() == "precious"
    assert "expected the suffix of the broken bag" in complaint(path, "-o", str(tmp_path / "c.mcap"))
    assert not (tmp_path / "c.mcap").exists()


# The whole


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
async def test_flushed_messages_of_a_killed_recorder_are_recovered(tmp_path: Path, connect: Connect, name: str) -> None:
    server = ServerProcess(tmp_path / "log.txt", ["--record", str(tmp_path / name)])
    try:
        client = await connect(server.url)
        await client.send("subscribe", topic="/clock")
        seconds = 0.0
        while seconds < 1.5:  # the first flush is after one
            clock = (await client.message("/clock"))["clock"]
            seconds = clock["secs"] + clock["nsecs"] * 1e-9
    finally:
        server.kill()
    result = run("bag", "repair", str(tmp_path / name), "--json").json
    seen = read_bag(repaired_name(tmp_path / name))
    stamps = [stamp_ns for topic, stamp_ns, _ in seen if topic == "/Ego_topic"]
    assert stamps == [frame * 20_000_000 for frame in range(1, len(stamps) + 1)]
    assert result["messages"] == len(seen)
    assert stamps
