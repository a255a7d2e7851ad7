"""What is said where a folder may not be written: which one, by which user, and what helps."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from rosbridge_sim.shell.files.access_rights import find_existing, is_writable, why_not_writable
from tests.support import PATIENCE, ROOT

ORDINARY_USER = 10_001


def test_folder_that_is_not_there_is_judged_by_the_innermost_one_that_is(tmp_path: Path) -> None:
    assert find_existing(tmp_path / "a" / "b") == tmp_path
    assert is_writable(tmp_path / "a" / "b")


def test_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert not is_writable(tmp_path / "file" / "sub")
    assert why_not_writable(tmp_path / "file" / "sub") == f"{tmp_path / 'file'} is not a folder"


@pytest.mark.skipif(sys.platform == "win32", reason="users have no numbers there")
@pytest.mark.parametrize("error", [None, PermissionError(errno.EACCES, "Permission denied")])
def test_refusal_names_folder_user_owner_and_what_helps(tmp_path: Path, error: OSError | None) -> None:
    tmp_path.chmod(0o755)
    uid = os.geteuid()
    assert why_not_writable(tmp_path / "new", error) == (
        f"user {uid} has no write access to {tmp_path} (owner {uid}, mode 755); change the owner"
        f" (chown {uid} {tmp_path}; for a container, on the host) or name another folder"
    )


def test_read_only_mount_and_other_errors_are_told_as_they_are(tmp_path: Path) -> None:
    assert "is mounted read-only" in why_not_writable(tmp_path, OSError(errno.EROFS, "Read-only file system"))
    assert why_not_writable(tmp_path, OSError(errno.ENOSPC, "No space left on device")) == "No space left on device"
    assert why_not_writable(tmp_path, OSError("strange")) == "strange"


PROGRAM = f"""
import os, sys
from pathlib import Path
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.files.access_rights import is_writable
from rosbridge_sim.shell.files.sensor_data_store import DiskArchive
from rosbridge_sim.shell.files.port_file import PortFile
import logging
logging.basicConfig(format="%(message)s", stream=sys.stdout)
folder = Path(sys.argv[1])
os.setgid({ORDINARY_USER}); os.setuid({ORDINARY_USER})
print(is_writable(folder), is_writable(folder / "new"))
for act in (
    lambda: DiskArchive(folder).save("", "one", {{"{{}}.txt": b""}}),
    lambda: open_bag(folder / "drive.bag"),
    lambda: open_bag(folder / "drive.mcap"),
    lambda: PortFile(folder / "port", 1),
):
    try:
        act()
    except DocumentError as error:
        print(error)
"""


@pytest.fixture
def place() -> Iterator[Path]:
    """Make a folder of this user that others may look at; pytest's own are closed to them."""
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="takes another user's identity")
def test_an_ordinary_user_is_told_the_folder_that_it_may_not_write(place: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(place)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    why = (
        f"user {ORDINARY_USER} has no write access to {place} (owner 0, mode 755); change the owner"
        f" (chown {ORDINARY_USER} {place}; for a container, on the host) or name another folder"
    )
    assert done.stdout.splitlines() == [
        "False False",
        f"{place / 'SensorData'}: sensor data cannot be saved: {why}",
        "'one' cannot be saved: Permission denied",
        f"{place / 'drive.bag'}: cannot be written: {why}",
        f"{place / 'drive.mcap'}: cannot be written: {why}",
        f"port-file {place / 'port'}: cannot be written: {why}",
    ]
