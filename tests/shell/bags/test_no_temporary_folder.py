"""Bags and campaigns where no folder for temporary files can be written, as in a read-only container."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.shell.bags.bag_reading import read_bag
from tests.support import ROOT

READ_ONLY = """
import errno, os, sys
FOLDER = sys.argv[1]
def refuse(event, args):
    if event == "os.mkdir" or (event == "open" and args[2] & (os.O_CREAT | os.O_WRONLY | os.O_RDWR)):
        if isinstance(args[0], (str, os.PathLike)) and not os.path.abspath(args[0]).startswith((FOLDER, "/dev/")):
            raise OSError(errno.EROFS, "Read-only file system", args[0])
sys.addaudithook(refuse)
"""
"""Refuse all files and folders outside one folder, as such a container does."""

BAG = """
from pathlib import Path
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.repair import repair, repaired_name
for name in sys.argv[2:]:
    path = Path(sys.argv[1]) / name
    bag = open_bag(path)
    raw = b"\\1\\0\\0\\0x" if bag.ros == 1 else b"\\0\\1\\0\\0\\2\\0\\0\\0x\\0"
    bag.write(bag.add("/t", "std_msgs/String", "string data\\n"), 5, raw)
    if not name.startswith("killed"):
        bag.close()
    else:
        bag.flush()
        bag.abort()
        repair(path, repaired_name(path))
"""
MAIN = """
import rosbridge_sim.__main__
sys.argv[1:] = sys.argv[2:]
sys.exit(rosbridge_sim.__main__.main())
"""


def run(code: str, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a program that can write into one folder alone."""
    command = [sys.executable, "-B", "-c", READ_ONLY + code, str(folder), *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_bag_is_closed_or_repaired_and_readable(tmp_path: Path) -> None:
    done = run(BAG, tmp_path, "a.mcap", "a.bag", "a", "killed.mcap", "killed.bag")
    assert (done.returncode, done.stderr) == (0, "")
    for name in ("a.mcap", "a.bag", "a", "killed.repaired.mcap", "killed.repaired.bag"):
        assert [message.data for _, _, message in read_bag(tmp_path / name)] == ["x"], name


@pytest.mark.slow
def test_campaign_is_explained(tmp_path: Path) -> None:
    pytest.importorskip("pebble")
    file = tmp_path / "c.toml"
    file.write_text('scenario = "town"\nseconds = 2\n[drivers]\nmine = "follow.py:drive"\n')
    (tmp_path / "follow.py").write_text("def drive(state):\n    return {}\n")
    done = run(MAIN, tmp_path, "campaign", "check", str(file))
    assert (done.returncode, done.stderr) == (0, "")


def record(path: Path, *command: str, is_deleted: bool = False) -> tuple[int, str]:
    """Have a server record, and stop it; return its exit code and its log."""
    words = ["serve", "--port", "0", "--no-page", "--start", "sync", "--record", str(path)]
    server = subprocess.Popen(
        [sys.executable, "-B", *command, *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert server.stdout is not None
    line = server.stdout.readline()
    if is_deleted:
        path.unlink(missing_ok=True)
    server.send_signal(signal.SIGTERM)
    _, log = server.communicate()
    assert "listening" in line, log
    return server.returncode, log


@pytest.mark.slow
def test_server_records_and_ends_with_0(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    code, log = record(path, "-c", READ_ONLY + MAIN, str(tmp_path))
    assert code == 0, log
    assert read_bag(path)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="an open file cannot be deleted there")
def test_server_whose_recording_is_lost_ends_with_2(tmp_path: Path) -> None:
    code, log = record(tmp_path / "drive.mcap", "-m", "rosbridge_sim", is_deleted=True)
    assert (code, "was deleted during the recording" in log) == (2, True)
