"""Drivers that break their worker, by accident or not: each is a row with its reason, and the campaign goes on."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.results_folder import ResultsFolder
from tests.campaign_runs.conftest import CampaignFolder
from tests.campaign_runs.test_interruption import wait_for_ends

DRIVERS = """
import ctypes, os, pathlib, signal, sys, threading, time

HERE = pathlib.Path(__file__).parent
COMMAND = {"steering": 0.0, "accel": 1.0}
KEPT = []

def exits(seen):
    sys.exit(3)

def dies_well(seen):
    os._exit(0)

def crashes(seen):
    ctypes.string_at(0)

def hangs_in_c(seen):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        sum(range(10**7))

def leaks(seen):
    if seen.time == 0.0:
        KEPT.append(bytearray(b"x" * 90_000_000))
    return COMMAND

def eats(seen):
    KEPT.append(bytearray(b"x" * 2_000_000_000))

def forks(seen):
    if seen.time == 0.0:
        pid = os.fork()
        if pid == 0:
            time.sleep(600)
            os._exit(0)
        (HERE / "copy").write_text(str(pid))
    return COMMAND

def copies(seen):
    os.fork()  # the copy drives on
    return COMMAND

def floods(seen):
    for _ in range(20):
        os.write(1, b"x" * 1_000_000)
        print("y" * 1_000_000)
    return COMMAND

class Strange(Exception):
    def __str__(self):
        raise ValueError

def strange(seen):
    raise Strange

def colours(seen):
    raise ValueError("\\x1b[31mred\\nand more")

def waits(seen):
    time.sleep(0.02)
    return COMMAND

def dies_later(seen):
    if seen.time == 0.0:
        threading.Timer(0.3, os._exit, [9]).start()
    return COMMAND
"""

DAEMON = """
import os, sys, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        open("daemon.new", "w").write(str(os.getpid()))
        os.rename("daemon.new", "daemon")
        time.sleep(600)
    os._exit(0)
while not os.path.exists("daemon"):
    time.sleep(0.01)
sys.exit(4)
"""

NAMES = ("exits", "dies_well", "crashes", "hangs_in_c", "eats", "floods", "strange", "colours", "forks", "copies")

TIMEOUTS = {"dies_well": 0.5, "hangs_in_c": 0.5}
"""Longest drives of those that never end [s]."""


def run(folder: CampaignFolder, text: str, jobs: int) -> tuple[dict[str, int], str]:
    """Drive a campaign by the command; return its counts, and what it told beside them."""
    folder.write("hostile.py", DRIVERS)
    folder.write("c.toml", text)
    done = folder.command("run", "c.toml", "-o", "out", "--jobs", str(jobs), "--json")
    assert "Traceback" not in done.stderr
    counts: dict[str, int] = json.loads(done.stdout)
    return counts, done.stderr


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="Linux ends what has left its group")
def test_each_hostile_driver_is_a_row_and_the_campaign_goes_on(folder: CampaignFolder) -> None:
    folder.write("daemon.py", DAEMON)
    drivers = "".join(
        f'{name} = {{ python = "hostile.py:{name}", timeout = {TIMEOUTS.get(name, 120.0)}, memory_mb = 1000 }}\n'
        for name in NAMES
    )
    text = f'scenario = "loop"\nseconds = 0.1\n[drivers]\nours = "lanes"\n{drivers}'
    counts, told = run(folder, text + 'daemon = { command = ["{python}", "daemon.py"] }\nlast = "lanes"\n', 2)
    assert counts["runs"] == len(NAMES) + 3, told
    found = {
        result.run.driver: result.reason or result.verdict for result in ResultsFolder(folder.path / "out").results()
    }
    assert found == {
        "ours": "pass",
        "exits": "the driver failed: SystemExit: 3",
        "dies_well": "time-out: the worker hung, and was killed",
        "crashes": "the worker process died with signal 11: the driver crashed it, or the machine has no memory left",
        "hangs_in_c": "time-out: the worker hung, and was killed",
        "eats": "the driver failed: MemoryError",
        "floods": "pass",
        "strange": "the driver failed: Strange",
        "colours": "the driver failed: ValueError: \x1b[31mred",
        "forks": "pass",
        "copies": "pass",
        "daemon": "the program ended with code 4 after 0 frames",
        "last": "pass",
    }
    wait_for_ends([int((folder.path / name).read_text()) for name in ("copy", "daemon")])
    shown = folder.command("list", "out")
    assert shown.returncode == 0
    assert "\x1b" not in shown.stdout


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_worker_retires_when_drivers_have_left_too_much_memory(folder: CampaignFolder) -> None:
    """Twelve drives leave 90 MB each in their worker; 800 MB are allowed, and another worker comes beyond 560."""
    driver = 'leaks = { python = "hostile.py:leaks", memory_mb = 800 }'
    counts, told = run(folder, f'scenario = "loop"\nseconds = 0.1\nseeds = 12\n[drivers]\n{driver}\n', 1)
    assert counts["pass"] == 12, told
    assert len({result.worker for result in ResultsFolder(folder.path / "out").results()}) > 1


@pytest.mark.slow
def test_pool_that_gave_up_is_made_anew(folder: CampaignFolder) -> None:
    """The worker dies while it waits for a run: pebble then gives up its pool."""
    drivers = 'dies = "hostile.py:dies_later"\nwaits = "hostile.py:waits"'
    counts, told = run(folder, f'scenario = "loop"\nseconds = 0.1\nseeds = 6\n[drivers]\n{drivers}\n', 1)
    assert counts["runs"] == 12, told
    assert (folder.path / "out" / "runs.csv").is_file()
