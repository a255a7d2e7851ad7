"""Written bags, read back by the library."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from pathlib import Path

import pytest
from rosbags.rosbag1 import Reader as Reader1

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags import bag as bag_module
from rosbridge_sim.shell.bags.bag import Bag, BagGoneError, open_bag
from rosbridge_sim.shell.files.definitions import read_definitions
from tests.shell.bags.bag_reading import read_bag

NAMES = ("drive.bag", "drive.mcap", "drive")

SECOND = 10**9


@pytest.fixture(scope="module")
def stores() -> dict[Generation, Store]:
    texts = read_definitions("22.R2")
    return {1: Store(texts, leniency=LENIENCY, ros=1), 2: Store(texts, leniency=LENIENCY, ros=2)}


def fill(bag: Bag, store: Store, count: int, text: str = "hello", *, start: int = 0) -> None:
    """Write `count` strings, one each second, into `/chatter`."""
    string = store.message("std_msgs/String")
    channel = bag.add("/chatter", "std_msgs/String", store.full_text("std_msgs/String"))
    for i in range(start, start + count):
        bag.write(channel, i * SECOND, string.encode_raw(string.struct_type(data=f"{text} {i}")))


@pytest.mark.parametrize("name", NAMES)
def test_written_messages_are_read_back(tmp_path: Path, stores: dict[Generation, Store], name: str) -> None:
    bag = open_bag(tmp_path / name)
    fill(bag, stores[bag.ros], 3)
    bag.flush()
    fill(bag, stores[bag.ros], 2, start=3)
    bag.close()
    bag.close()
    seen = [(topic, stamp_ns, message.data) for topic, stamp_ns, message in read_bag(tmp_path / name)]
    assert seen == [("/chatter", i * SECOND, f"hello {i}") for i in range(5)]


@pytest.mark.parametrize("name", NAMES)
def test_definition_of_many_topics_is_parsed_once(tmp_path: Path, name: str) -> None:
    bag_module._no_digest.cache_clear()
    bag = open_bag(tmp_path / name)
    for topic in ("/one", "/two", "/three"):
        bag.add(topic, "made_up/Speed", "float64 speed\n")
    bag.close()
    assert bag_module._no_digest.cache_info().misses == 1


@pytest.mark.parametrize("name", NAMES)
def test_bag_without_messages_is_valid(tmp_path: Path, stores: dict[Generation, Store], name: str) -> None:
    bag = open_bag(tmp_path / name)
    bag.flush()
    fill(bag, stores[bag.ros], 0)
    bag.flush()
    bag.close()
    assert read_bag(tmp_path / name) == []


@pytest.mark.parametrize("name", NAMES)
def test_flush_leaves_whole_chunks_on_the_disk(tmp_path: Path, stores: dict[Generation, Store], name: str) -> None:
    bag = open_bag(tmp_path / name)
    fill(bag, stores[bag.ros], 1, "first")
    bag.flush()
    fill(bag, stores[bag.ros], 1, "second")
    file = next(path for path in (tmp_path / name / "drive.mcap", tmp_path / name) if path.is_file())
    assert b"first" in file.read_bytes()
    assert b"second" not in file.read_bytes()
    bag.abort()


def test_long_bag_keeps_numbers_and_no_index_in_memory(tmp_path: Path, stores: dict[Generation, Store]) -> None:
    bag = open_bag(tmp_path / "long.bag")
    fill(bag, stores[1], 300, "x" * 10_000)  # three chunks that the library ends by itself
    bag.flush()
    kept = [entries for chunk in bag._writer.chunks for entries in chunk.connections.values()]  # type: ignore[union-attr]
    assert len(kept) >= 3
    assert all(isinstance(entries, range) for entries in kept)
    bag.close()
    assert len(read_bag(tmp_path / "long.bag")) == 300


def test_ros1_bag_has_the_md5_sums_of_ros(tmp_path: Path, stores: dict[Generation, Store]) -> None:
    bag = open_bag(tmp_path / "a.bag")
    for name in ("std_msgs/String", "geometry_msgs/PoseStamped"):
        bag.add("/" + name, name, stores[1].full_text(name), latching=name == "std_msgs/String")
    bag.close()
    with Reader1(tmp_path / "a.bag") as reader:
        digests = {connection.topic: connection.digest for connection in reader.connections}
        latching = {connection.topic: connection.ext.latching for connection in reader.connections}  # type: ignore[union-attr]
    # `rosmsg md5` of ROS Noetic
    assert digests["/std_msgs/String"] == "992ce8a1687cec8c8bd883ec73ca41d1"
    assert digests["/geometry_msgs/PoseStamped"] == "d3812c3cbc69362b77dc0b19b345f8f5"
    assert latching == {"/std_msgs/String": 1, "/geometry_msgs/PoseStamped": None}


@pytest.mark.parametrize("name", NAMES)
def test_repeated_topic_is_written_once(tmp_path: Path, stores: dict[Generation, Store], name: str) -> None:
    bag = open_bag(tmp_path / name)
    text = stores[bag.ros].full_text("std_msgs/String")
    assert bag.add("/a", "std_msgs/String", text) is bag.add("/a", "std_msgs/String", text)
    bag.close()


# What goes wrong


@pytest.mark.parametrize("name", NAMES)
def test_existing_file_is_not_overwritten(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"precious")
    with pytest.raises(DocumentError, match=f"{name}: exists already; recordings are not overwritten"):
        open_bag(tmp_path / name)
    assert (tmp_path / name).read_bytes() == b"precious"


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap"])
def test_missing_folder_is_an_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(DocumentError, match=f"{name}: cannot be written: no such file or directory"):
        open_bag(tmp_path / "nowhere" / name)


def test_unknown_format_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"a\.db3: expected NAME\.bag"):
        open_bag(tmp_path / "a.db3")


@pytest.fixture
def small_disk() -> Iterator[int]:
    """No file of this process may grow beyond so many bytes."""
    size = 20_000
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, old[1]))
    yield size
    resource.setrlimit(resource.RLIMIT_FSIZE, old)


@pytest.mark.parametrize("name", NAMES)
def test_full_disk_gives_one_error_line(
    tmp_path: Path, stores: dict[Generation, Store], small_disk: int, name: str
) -> None:
    bag = open_bag(tmp_path / name)
    fill(bag, stores[bag.ros], 10)
    bag.flush()
    fill(bag, stores[bag.ros], 1, "x" * small_disk)
    with pytest.raises(DocumentError, match=f"{name}: cannot be written: file too large"):
        bag.flush()
    bag.abort()
    bag.abort()


def file_of(path: Path) -> Path:
    """The file that is written: the bag itself, or the one in its folder."""
    return path / f"{path.name}.mcap" if path.is_dir() else path


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("step", ["flush", "close"])
def test_deleted_bag_is_reported_and_closed(
    tmp_path: Path, stores: dict[Generation, Store], name: str, step: str
) -> None:
    path = tmp_path / name
    bag = open_bag(path)
    fill(bag, stores[bag.ros], 3)
    bag.flush()
    file_of(path).unlink()
    with pytest.raises(BagGoneError) as caught:
        getattr(bag, step)()
    assert str(caught.value) == f"{path}: was deleted during the recording: everything recorded is lost"
    bag.abort()
    bag.close()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("step", ["flush", "close"])
@pytest.mark.parametrize("is_replaced", [True, False])
def test_moved_bag_gets_its_index_at_its_new_place(
    tmp_path: Path, stores: dict[Generation, Store], name: str, step: str, *, is_replaced: bool
) -> None:
    path = tmp_path / name
    bag = open_bag(path)
    fill(bag, stores[bag.ros], 3)
    moved = tmp_path / f"moved{file_of(path).suffix}"
    original = file_of(path)
    original.rename(moved)
    if is_replaced:
        original.write_text("somebody's notes")
    with pytest.raises(BagGoneError, match="was moved or replaced during the recording"):
        getattr(bag, step)()
    bag.abort()
    bag.close()
    assert [message.data for _, _, message in read_bag(moved)] == ["hello 0", "hello 1", "hello 2"]
    assert not is_replaced or original.read_text() == "somebody's notes"


def test_moved_bag_folder_gets_its_index(tmp_path: Path, stores: dict[Generation, Store]) -> None:
    path = tmp_path / "drive"
    bag = open_bag(path)
    fill(bag, stores[2], 3)
    path.rename(tmp_path / "moved")
    with pytest.raises(BagGoneError, match="was moved or replaced"):
        bag.flush()
    assert len(read_bag(tmp_path / "moved" / "drive.mcap")) == 3
    assert not path.exists()
