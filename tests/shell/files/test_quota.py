"""Quota of the data folder: counting, refusals, recounts and warnings."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.quota import COUNT_PERIOD, FILES_AT_ONCE, MANY_FILES, DataQuota, Usage, in_thread
from tests.conftest import Connect
from tests.support import PATIENCE


class QuotaFixture:
    """A clock that the test moves, and work that waits until the test has it done."""

    def __init__(self) -> None:
        self.now = 1_000.0
        self.waiting: list[tuple[Callable[[], Usage], Callable[[Usage], None]]] = []

    def quota(self, root: Path, max_bytes: int | None = None, max_files: int | None = None) -> DataQuota:
        return DataQuota(root, max_bytes, max_files, aside=self.put_aside, clock=lambda: self.now)

    def put_aside(self, work: Callable[[], Usage], done: Callable[[Usage], None]) -> None:
        self.waiting.append((work, done))

    def work(self) -> None:
        """Do what waits."""
        while self.waiting:
            work, done = self.waiting.pop(0)
            done(work())


def fits(quota: DataQuota, num_bytes: int, num_files: int) -> bool:
    try:
        quota.check(num_bytes, num_files)
    except DocumentError:
        return False
    return True


def test_all_files_count_except_recordings_and_link_targets(tmp_path: Path) -> None:
    root = tmp_path / "data"
    (root / "a" / "b").mkdir(parents=True)
    (root / "a" / "b" / "x.csv").write_bytes(b"12345")
    (root / "y.txt").write_bytes(b"123")
    for name in ("drive.bag", "drive.mcap", "drive.db3"):
        (root / name).write_bytes(bytes(1_000))
    (tmp_path / "outside").write_bytes(bytes(1_000))
    (root / "out").symlink_to(tmp_path)
    link_size = (root / "out").lstat().st_size
    quota = QuotaFixture().quota(root, 8 + link_size + 10, 5 + 2)
    assert fits(quota, 10, 2)
    assert not fits(quota, 11, 2)
    assert not fits(quota, 10, 3)


def test_missing_folder_is_empty(tmp_path: Path) -> None:
    quota = QuotaFixture().quota(tmp_path / "nowhere", 10, 10)
    assert fits(quota, 10, 10)
    assert not fits(quota, 11, 1)


def test_quota_without_a_limit_counts_nothing(tmp_path: Path) -> None:
    setting = QuotaFixture()
    assert fits(setting.quota(tmp_path), 2**60, 2**60)
    assert setting.waiting == []


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ((10, None), "10 of 10 bytes; delete files or raise --data-quota"),
        ((None, 2), "2 of 2 files; delete some or raise --data-quota-files"),
    ],
)
def test_refusal_names_the_quota_and_its_flag_and_is_logged_once_a_minute(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, limits: tuple[int | None, int | None], said: str
) -> None:
    setting = QuotaFixture()
    quota = setting.quota(tmp_path, *limits)
    quota.check(10, 2)
    quota.add(10, 2, "/SaveSensorData")
    for _ in range(5):
        with pytest.raises(DocumentError) as caught:
            quota.check(1, 1)
        assert str(caught.value) == f"the quota of --data-dir is reached: {said}"
    assert caplog.messages == [f"{tmp_path}: {caught.value}"]
    setting.now += COUNT_PERIOD
    assert not fits(quota, 1, 1)
    assert len(caplog.messages) == 2


def test_used_up_quota_is_recounted_in_a_thread_at_most_once_a_minute(tmp_path: Path) -> None:
    setting = QuotaFixture()
    (tmp_path / "x").write_bytes(b"12345")
    quota = setting.quota(tmp_path, 5)
    (tmp_path / "x").unlink()
    assert not fits(quota, 1, 1)
    assert setting.waiting == []
    setting.now += COUNT_PERIOD
    assert not fits(quota, 1, 1)
    assert not fits(quota, 1, 1)
    assert len(setting.waiting) == 1
    setting.work()
    assert fits(quota, 5, 1)
    (tmp_path / "y").write_bytes(b"12345")
    quota.add(5, 1, "/SaveSensorData")
    assert not fits(quota, 1, 1)
    assert setting.waiting == []


def test_large_folder_is_counted_in_a_thread_and_adds_later_writes(tmp_path: Path) -> None:
    setting = QuotaFixture()
    for i in range(FILES_AT_ONCE + 5):
        (tmp_path / str(i)).touch()
    quota = setting.quota(tmp_path, None, FILES_AT_ONCE + 10)
    assert len(setting.waiting) == 1
    quota.check(0, 5)
    quota.add(0, 5, "/SaveSensorData")
    setting.work()
    assert not fits(quota, 0, 1)


def test_count_ends_when_it_is_stopped_or_beyond_the_quota(tmp_path: Path) -> None:
    for i in range(FILES_AT_ONCE + 5):
        (tmp_path / str(i)).write_bytes(b"1")
    for max_bytes, max_files, is_stopped, found in (
        (None, FILES_AT_ONCE + 2, False, FILES_AT_ONCE + 3),
        (FILES_AT_ONCE + 1, None, False, FILES_AT_ONCE + 2),
        (None, 2 * FILES_AT_ONCE, True, FILES_AT_ONCE + 1),
    ):
        setting = QuotaFixture()
        quota = setting.quota(tmp_path, max_bytes, max_files)
        if is_stopped:
            quota.stop()
        ((work, _),) = setting.waiting
        assert work() == Usage(found, found)


def test_many_files_in_a_minute_give_one_warning_with_client_and_flag(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    setting = QuotaFixture()
    quota = setting.quota(tmp_path, None, 200_000)
    for _ in range(5):  # a pace that is just not worth a word
        quota.add(0, MANY_FILES // 5 - 1, "/SaveSensorData")
        setting.now += COUNT_PERIOD / 4
    assert caplog.messages == []
    for _ in range(5):
        quota.add(0, MANY_FILES, "/SaveSensorData")
    (message,) = caplog.messages
    assert "files were written within a minute, the last by /SaveSensorData" in message
    assert "--data-quota-files limits them (now at most 200,000)" in message
    setting.now += COUNT_PERIOD
    quota.add(0, MANY_FILES, "/SaveSensorData")
    assert len(caplog.messages) == 2
    assert {record.levelno for record in caplog.records} == {logging.WARNING}


async def test_count_runs_in_a_thread_and_reports_to_the_loop() -> None:
    loop = asyncio.get_running_loop()
    counted: asyncio.Future[tuple[bool, Usage]] = loop.create_future()
    is_elsewhere: list[bool] = []

    def work() -> Usage:
        is_elsewhere.append(threading.current_thread() is not threading.main_thread())
        return Usage(1, 2)

    def done(usage: Usage) -> None:
        counted.set_result((threading.current_thread() is threading.main_thread(), usage))

    in_thread(loop)(work, done)
    async with asyncio.timeout(PATIENCE):
        assert await counted == (True, Usage(1, 2))
    assert is_elsewhere == [True]


async def test_client_is_notified_of_a_used_up_quota(connect: Connect, tmp_path: Path) -> None:
    async with Simulator(port=0, start="sync", data_dir=tmp_path, data_quota_files=4) as sim:
        client = await connect(sim.url)
        for mark in ("a", "b"):
            await client.send("publish", topic="/SaveSensorData", type="morai_msgs/SaveSensorData", msg={}, id=mark)
        told = await client.take("status", id="b")
        assert told["msg"].endswith(
            "the quota of --data-dir is reached: 4 of 4 files; delete some or raise --data-quota-files"
        )
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await client.ask("/SyncModeCtrlCmd", frame=1, command={}, sensor_capture=True)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        assert (await client.take("status", level="error"))["msg"].startswith("sensor_capture: the quota of --data-dir")
    assert len(list((tmp_path / "SensorData").iterdir())) == 3
