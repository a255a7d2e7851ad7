"""The files of a mock: bags of each form, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.mock.mock_model import MockRecording
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.shell.mocking import mock_files
from rosbridge_sim.shell.mocking.mock_files import DiskMockFiles, read_mock
from tests.mock.mock_runs import MockRun

TEXTS = read_definitions("22.R2")
NAMES = ("drive.bag", "drive_mcap", "drive_db3")


def write_bag(path: Path) -> None:
    """Three scans 0.1 s apart, and a word with the first."""
    if path.suffix == ".bag":
        types = get_typestore(Stores.ROS1_NOETIC)
        writer: Any = Writer1(path)
    else:
        types = get_typestore(Stores.ROS2_HUMBLE)
        plugin = StoragePlugin.MCAP if path.name.endswith("mcap") else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
    make = types.types
    with writer:
        scans = writer.add_connection("/scan", "sensor_msgs/msg/LaserScan", typestore=types)
        words = writer.add_connection("/word", "std_msgs/msg/String", typestore=types)
        serialize = types.serialize_ros1 if path.suffix == ".bag" else types.serialize_cdr
        for i in range(3):
            stamp = make["builtin_interfaces/msg/Time"](sec=5, nanosec=i)
            seq = {"seq": 9} if path.suffix == ".bag" else {}
            header = make["std_msgs/msg/Header"](stamp=stamp, frame_id="laser", **seq)
            numbers = [float(i)] * 7
            ranges = np.array([i, i + 0.5], np.float32)
            scan = make["sensor_msgs/msg/LaserScan"](header, *numbers, ranges, np.zeros(0, np.float32))
            at = 10**18 + i * 100_000_000
            writer.write(scans, at, serialize(scan, "sensor_msgs/msg/LaserScan"))
        word = make["std_msgs/msg/String"](data="hello")
        writer.write(words, 10**18, serialize(word, "std_msgs/msg/String"))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("ros", [1, 2])
def test_recording_of_either_ros_is_played_in_a_loop(tmp_path: Path, name: str, ros: Generation) -> None:
    write_bag(tmp_path / name)
    run = MockRun(f"recordings: [{{file: {name}}}]", files=DiskMockFiles(tmp_path, TEXTS), ros=ros)
    run.listen("/scan")
    run.listen("/word")
    run.run(0.55)
    scans = run.heard("/scan")
    assert [list(scan.ranges) for scan in scans] == [[0, 0.5], [1, 1.5], [2, 2.5]] * 2
    assert scans[4].angle_increment == 1
    assert scans[0].header.frame_id == "laser"
    stamps = [scan.header.stamp for scan in scans]
    assert {stamp.secs if ros == 1 else stamp.sec for stamp in stamps} == {100}
    assert [word.data for word in run.heard("/word")] == ["hello"] * 2
    if ros == 1:
        assert [scan.header.seq for scan in scans] == list(range(6))


def test_speed_and_topics_are_chosen(tmp_path: Path) -> None:
    write_bag(tmp_path / "drive.bag")
    files = DiskMockFiles(tmp_path, TEXTS)
    recording = files.record(MockRecording(file="drive.bag", topics=["/sc*"], speed=2.0), {"/other"})
    assert [(track.name, track.times_ns) for track in recording.tracks] == [("/scan", [0, 50_000_000, 100_000_000])]
    assert recording.length_ns == 150_000_000


def test_recording_that_cannot_be_played_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_bag(tmp_path / "drive.bag")
    (tmp_path / "bad.bag").write_bytes(b"#ROSBAG V2.0\nno")
    files = DiskMockFiles(tmp_path, TEXTS)
    for recording, others, text in (
        (MockRecording(file="none.bag"), (), "none.bag: cannot be read: "),
        (MockRecording(file="bad.bag"), (), "bad.bag: is not a bag, or has no index"),
        (MockRecording(file="drive.bag", topics=["/sacn"]), (), r"no topic /sacn is recorded \(did you mean /scan\?\)"),
        (MockRecording(file="drive.bag"), ("/scan", "/word"), "expected messages of topics that `topics` does not"),
    ):
        with pytest.raises(DocumentError, match=text):
            files.record(recording, others)
    monkeypatch.setattr(mock_files, "MAX_RECORDED", 100)
    with pytest.raises(DocumentError, match=r"drive\.bag: expected at most 100 bytes of recorded messages"):
        files.record(MockRecording(file="drive.bag"), ())


def test_files_beside_the_mock_are_read_up_to_a_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.jpg").write_bytes(b"12345")
    monkeypatch.setattr(mock_files, "MAX_FILE", 5)
    assert DiskMockFiles(tmp_path, TEXTS).read("a.jpg") == b"12345"
    (tmp_path / "a.jpg").write_bytes(b"123456")
    with pytest.raises(DocumentError, match="expected at most 5 bytes"):
        DiskMockFiles(tmp_path, TEXTS).read("a.jpg")


@pytest.mark.parametrize("text", ["", "# nothing yet\n"])
def test_empty_file_is_a_mistake(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(DocumentError, match=r"^x.yaml: expected topics, .* got an empty file$"):
        read_mock(tmp_path / "x.yaml")


def test_mark_of_utf_8_is_no_part_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_bytes(b"\xef\xbb\xbfseed: 3\n")
    assert read_mock(tmp_path / "a.yaml").value == {"seed": 3}
