"""Saved sensor data: folders, file names and refusals."""

from __future__ import annotations

import errno
import logging
import os
from pathlib import Path
from typing import NoReturn

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.quota import DataQuota
from rosbridge_sim.shell.files.sensor_data_store import DiskArchive

FILES = {"GPS_{}.csv": b"a,b\n1,2\n", "Ego-2/BOXES_{}.txt": b""}


def tree(root: Path) -> list[str]:
    """All that is in a folder, by its path from there."""
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if not path.is_dir())


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A data folder that is not there yet, in a folder that is all there is of the world."""
    return tmp_path / "world" / "data"


@pytest.mark.parametrize(
    ("folder", "place"),
    [
        ("", "SensorData"),
        ("SaveFile/SensorData", "SensorData"),
        ("SaveFile", ""),
        (".", ""),
        ("runs/a b/1.", "runs/a b/1."),
        ("./runs//a/", "runs/a"),
        ("runs\\a", "runs/a"),
        ("한국", "한국"),
    ],
)
def test_sensor_data_is_saved_in_the_named_folder(root: Path, folder: str, place: str) -> None:
    DiskArchive(root).save(folder, "shot", FILES)
    assert tree(root) == sorted(str(Path(place, name)) for name in ("GPS_shot.csv", "Ego-2/BOXES_shot.txt"))
    assert (root / place / "GPS_shot.csv").read_bytes() == b"a,b\n1,2\n"


def test_absolute_path_inside_the_data_folder_is_accepted(root: Path, tmp_path: Path) -> None:
    (tmp_path / "alias").symlink_to(root.parent)
    archive = DiskArchive(tmp_path / "alias" / "data")
    archive.save(str(root / "x"), "one", FILES)
    archive.save(str(tmp_path / "alias" / "data" / "y"), "two", FILES)
    assert [name for name in tree(root) if "GPS" in name] == ["x/GPS_one.csv", "y/GPS_two.csv"]


def test_path_with_the_servers_folder_name_is_relative_to_its_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    DiskArchive("data").save("", "shot", FILES)
    assert tree(tmp_path) == ["data/SensorData/Ego-2/BOXES_shot.txt", "data/SensorData/GPS_shot.csv"]


@pytest.mark.parametrize(
    "folder",
    [
        *("..", "../x", "a/../../x", "SaveFile/../..", "/", "/etc", "/usr/../etc", "//server/share", "~root/../../x"),
        *("C:\\MORAI\\SaveFile", "a\0b", "a\nb", "...", "x" * 2_000, "a/" * 3_000, "\ud800/../.."),
    ],
)
def test_folder_outside_the_data_folder_is_refused(root: Path, folder: str) -> None:
    root.mkdir(parents=True)
    with pytest.raises(DocumentError, match=r"^expected a folder within --data-dir, got '"):
        DiskArchive(root).save(folder, "shot", FILES)
    assert list(root.parent.rglob("*")) == [root]


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../x", "a/b", "a\\b", "a\0", "a\n", "C:x", "x*", "x" * 201, "/etc/passwd"]
)
def test_invalid_file_name_is_refused(root: Path, name: str) -> None:
    with pytest.raises(DocumentError, match=r"^expected a plain file name without a folder, got '"):
        DiskArchive(root).save("", name, FILES)
    assert not root.exists()


@pytest.mark.parametrize("link", ["out", "SensorData", "runs/Ego-2"])
def test_links_outside_the_data_folder_are_refused(root: Path, tmp_path: Path, link: str) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (root / link).parent.mkdir(parents=True)
    (root / link).symlink_to(outside)
    folder = {"out": "out/x", "SensorData": "", "runs/Ego-2": "runs"}[link]
    with pytest.raises(DocumentError, match="expected a folder within --data-dir"):
        DiskArchive(root).save(folder, "shot", FILES)
    assert list(outside.iterdir()) == []
    assert tree(root) == []


def test_circular_link_is_refused(root: Path) -> None:
    root.mkdir(parents=True)
    (root / "a").symlink_to(root / "b")
    (root / "b").symlink_to(root / "a")
    with pytest.raises(DocumentError, match=r"'a'|cannot be saved"):
        DiskArchive(root).save("a", "shot", FILES)


def test_existing_files_are_not_overwritten(root: Path) -> None:
    archive = DiskArchive(root)
    for i in range(9):
        archive.save("", "shot", {"GPS_{}.csv": str(i).encode()})
    texts = {path.name: path.read_text() for path in (root / "SensorData").iterdir()}
    assert texts == {f"GPS_shot{f'_{i + 1}' if i else ''}.csv": str(i) for i in range(9)}


def test_files_of_one_save_share_a_number(root: Path) -> None:
    folder = root / "SensorData"
    folder.mkdir(parents=True)
    (folder / "GPS_shot.csv").touch()
    (folder / "GPS_shot_2.csv").symlink_to(root / "nowhere")  # a link counts, wherever it leads
    archive = DiskArchive(root)
    archive.save("", "shot", FILES)
    assert (folder / "GPS_shot_3.csv").exists()
    assert (folder / "Ego-2" / "BOXES_shot_3.txt").exists()
    (folder / "GPS_shot.csv").unlink()
    archive.save("", "shot", FILES)
    assert (folder / "GPS_shot.csv").read_bytes() == b"a,b\n1,2\n"
    assert not (root / "nowhere").exists()


def test_full_disk_is_one_log_line_and_leaves_no_partial_save(
    root: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    open_file = Path.open
    num_opened = 0

    def open_until_full(path: Path, *args: object) -> object:
        nonlocal num_opened
        num_opened += 1
        if num_opened == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return open_file(path, *args)  # type: ignore[call-overload]  # what it was called with

    monkeypatch.setattr(Path, "open", open_until_full)
    with pytest.raises(DocumentError, match=r"^'shot' cannot be saved: No space left on device$"):
        DiskArchive(root).save("", "shot", FILES)
    assert tree(root) == []
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert caplog.messages[0].endswith("SensorData: sensor data cannot be saved: No space left on device")


@pytest.mark.parametrize(("max_bytes", "max_files"), [(2 * 8 - 1, None), (None, 2 * 2 + 3)])
def test_save_beyond_the_quota_is_refused_completely(root: Path, max_bytes: int | None, max_files: int | None) -> None:
    root.mkdir(parents=True)
    archive = DiskArchive(root, DataQuota(root, max_bytes, max_files, aside=never))
    files = {"Ego-2/GPS_{}.csv": b"12345678", "Ego-2/IMU_{}.csv": b""}
    archive.save("", "a", files)
    with pytest.raises(DocumentError, match="the quota of --data-dir is reached"):
        archive.save("new/folder", "b", files)
    assert sorted(path.name for path in root.rglob("*")) == ["Ego-2", "GPS_a.csv", "IMU_a.csv", "SensorData"]


def never(_work: object, _done: object) -> None:
    """Nothing here takes longer."""


def test_folders_of_a_failed_save_are_removed(root: Path) -> None:
    root.mkdir(parents=True)
    with pytest.raises(DocumentError, match="cannot be saved"):
        DiskArchive(root).save("a/b", "x" * 199, {"one/{}": b"", "two/" + "y" * 99 + "{}": b""})
    assert list(root.iterdir()) == []


@pytest.mark.parametrize("name", ["\ud800", "x" * 200])
def test_name_that_the_file_system_cannot_hold_is_refused(root: Path, name: str) -> None:
    blocker = root / "SensorData"
    root.mkdir(parents=True)
    blocker.write_text("a file where a folder should be")
    with pytest.raises(DocumentError, match="cannot be saved"):
        DiskArchive(root).save("", name, FILES)
    assert tree(root) == ["SensorData"]


def test_folder_is_logged_once(root: Path, caplog: pytest.LogCaptureFixture) -> None:
    archive = DiskArchive(root)
    with caplog.at_level(logging.INFO):
        for name in ("a", "b", "c"):
            archive.save(name, "shot", FILES)
    assert caplog.messages == [f"sensor data saved in {root / 'a'}"]


def test_partial_file_of_a_killed_process_does_no_harm(root: Path) -> None:
    place = root / "SensorData"
    place.mkdir(parents=True)
    outside = root.parent / "outside"
    outside.write_bytes(b"precious")
    (place / ".GPS_one.csv.part").symlink_to(outside)
    DiskArchive(root).save("", "one", FILES)
    assert tree(root) == ["SensorData/Ego-2/BOXES_one.txt", "SensorData/GPS_one.csv"]
    assert (place / "GPS_one.csv").read_bytes() == FILES["GPS_{}.csv"]
    assert outside.read_bytes() == b"precious"


def refuse_link(self: Path, target: Path) -> NoReturn:
    """Do as FAT does."""
    raise PermissionError(errno.EPERM, os.strerror(errno.EPERM), str(self), None, str(target))


def test_a_disk_without_links_takes_captures_too_and_nothing_is_overwritten(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "hardlink_to", refuse_link)
    for _ in range(2):
        DiskArchive(root).save("", "shot", FILES)
    assert tree(root) == [
        *("SensorData/Ego-2/BOXES_shot.txt", "SensorData/Ego-2/BOXES_shot_2.txt"),
        *("SensorData/GPS_shot.csv", "SensorData/GPS_shot_2.csv"),
    ]
    assert (root / "SensorData" / "GPS_shot.csv").read_bytes() == FILES["GPS_{}.csv"]


def test_capture_that_fails_on_a_disk_without_links_leaves_nothing(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path, target: Path) -> NoReturn:
        raise PermissionError(errno.EACCES, "another program has it open", str(self), None, str(target))

    monkeypatch.setattr(Path, "hardlink_to", refuse_link)
    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(DocumentError, match="another program has it open"):
        DiskArchive(root).save("", "shot", FILES)
    assert tree(root) == []
