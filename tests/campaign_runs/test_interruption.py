"""Ctrl-C, and workers that are killed: what is done is kept, and no process is left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.program_groups import NOTE, end_groups, note_group
from rosbridge_sim.campaign_runs.results_folder import ResultsFolder
from tests.campaign_runs.conftest import CampaignFolder

PATIENCE = 60.0
"""Longest wait for an event of a test [s]."""

STUBBORN = """
import os, signal, sys, time

def note(name):
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), name + ".new"), "w") as file:
        file.write(str(os.getpid()))
    os.rename(file.name, file.name.removesuffix(".new"))

def drive(seen):
    note("function")
    while True:
        try:
            time.sleep(0.01)
        except BaseException:
            pass  # it does not want to end

if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    if os.fork() == 0:
        note("child")
    else:
        note("program")
    time.sleep(30)
    note("finished")
"""

CAMPAIGN = """
scenario = "loop"
seconds = 0.2
[drivers]
ours = "lanes"
function = "stubborn.py:drive"
program = { command = ["{python}", "stubborn.py"] }
"""


def is_running(pid: int) -> bool:
    """Whether a process is there that was not killed; nobody may have read the end of a child's child."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_for(what: Callable[[], object], process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < end
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


def start(folder: CampaignFolder, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "rosbridge_sim", "campaign", "run", "c.toml", *words]
    return subprocess.Popen(
        command, cwd=folder.path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")
def test_ctrl_c_ends_workers_and_programs_that_do_not_want_to_and_keeps_what_is_done(folder: CampaignFolder) -> None:
    """The drivers would end after half a minute by themselves: none gets so far."""
    folder.write("stubborn.py", STUBBORN)
    folder.write("c.toml", CAMPAIGN)
    results = folder.path / "c_runs" / "results.jsonl"
    names = [folder.path / name for name in ("function", "program", "child")]
    with start(folder, "--jobs", "2") as process:
        wait_for(lambda: all(name.is_file() for name in names) and results.read_bytes().count(b"\n") == 1, process)
        pids = [int(name.read_text()) for name in names]
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, errors
    assert "--resume does the rest" in errors
    assert "Traceback" not in errors
    assert [pid for pid in pids if is_running(pid)] == []
    assert not (folder.path / "finished").exists()
    assert [result.run.driver for result in ResultsFolder(folder.path / "c_runs").results()] == ["ours"]
    assert "ours" in (folder.path / "c_runs" / "runs.csv").read_text()
    assert not (folder.path / "c_runs" / ".work").exists()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")
def test_program_of_a_worker_that_was_killed_ends_and_the_campaign_goes_on(folder: CampaignFolder) -> None:
    """As the system does it if there is no memory left: SIGKILL for the worker alone."""
    folder.write("stubborn.py", STUBBORN)
    folder.write("c.toml", CAMPAIGN.replace('function = "stubborn.py:drive"', ""))
    names = [folder.path / name for name in ("program", "child")]
    with start(folder, "--jobs", "1") as process:
        wait_for(lambda: all(name.is_file() for name in names), process)
        pids = [int(name.read_text()) for name in names]
        worker = int(Path(f"/proc/{pids[0]}/stat").read_text().rpartition(")")[2].split()[1])
        os.kill(worker, signal.SIGKILL)
        process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    found = {result.run.driver: result for result in ResultsFolder(folder.path / "c_runs").results()}
    assert found["ours"].verdict == "pass"
    assert found["program"].reason.startswith("the worker process died with signal 9")
    assert [pid for pid in pids if is_running(pid)] == []
    assert not (folder.path / "finished").exists()


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")
def test_group_is_ended_only_if_it_is_the_one_that_was_noted(tmp_path: Path) -> None:
    (tmp_path / "run-1-a").mkdir()
    note = tmp_path / "run-1-a" / NOTE
    with subprocess.Popen(["sleep", "30"], start_new_session=True) as process:
        note_group(note.parent, process.pid)
        number, began = note.read_text().split()
        note.write_text(f"{number} {int(began) - 1}\n")  # another process had this number before
        end_groups(tmp_path)
        assert process.poll() is None
        assert not note.exists()
        note_group(note.parent, process.pid)
        end_groups(tmp_path, "run-2-*")
        assert process.poll() is None
        end_groups(tmp_path, "run-1-*")
        assert process.wait(PATIENCE) == -signal.SIGKILL


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")
def test_group_is_ended_when_its_leader_has_gone(tmp_path: Path) -> None:
    (tmp_path / "run-1-a").mkdir()
    script = "sleep 30 & echo $!; exec 1>&-; wait $!; "
    with subprocess.Popen(["sh", "-c", script], start_new_session=True, stdout=subprocess.PIPE, text=True) as process:
        note_group(tmp_path / "run-1-a", process.pid)
        assert process.stdout is not None
        child = int(process.stdout.readline())
        process.kill()
        process.wait(PATIENCE)
        assert is_running(child)
        end_groups(tmp_path)
        end = time.monotonic() + PATIENCE
        while is_running(child):
            assert time.monotonic() < end
            time.sleep(0.01)
