"""Ctrl-C, and workers that are killed: what is done is kept, and no process is left behind."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.program_groups import NOTE, end_groups, note_group
from rosbridge_sim.campaign_runs.results_folder import ResultsFolder
from rosbridge_sim.cli.command_table import TOOLS
from rosbridge_sim.errors import DocumentError
from tests import fork_server
from tests.campaign_runs.conftest import CampaignFolder
from tests.fork_server import ForkedProgram

PATIENCE = 60.0
"""Longest wait for an event of a test [s]."""

ENDING = 20.0
"""Longest wait for the end of a killed process [s]: those of these tests end by themselves after 30 s or more."""

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


def wait_for_ends(pids: Iterable[int]) -> None:
    """Wait until processes have ended that were killed: the one that kills them may end before."""
    end = time.monotonic() + ENDING
    while left := [pid for pid in pids if is_running(pid)]:
        assert time.monotonic() < end, left
        time.sleep(0.01)


def wait_for(what: Callable[[], object], process: ForkedProgram) -> None:
    end = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < end
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


IN_A_SESSION = "import os, sys; os.setsid(); from rosbridge_sim.__main__ import main; sys.exit(main())"


def start(folder: CampaignFolder, *words: str) -> ForkedProgram:
    return fork_server.popen(["-c", IN_A_SESSION, "campaign", "run", "c.toml", *words], cwd=folder.path)


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
    wait_for_ends(pids)
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
    with start(folder, "--jobs", "1", "--retry-killed", "0") as process:
        wait_for(lambda: all(name.is_file() for name in names), process)
        pids = [int(name.read_text()) for name in names]
        worker = int(Path(f"/proc/{pids[0]}/stat").read_text().rpartition(")")[2].split()[1])
        os.kill(worker, signal.SIGKILL)
        process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    found = {result.run.driver: result for result in ResultsFolder(folder.path / "c_runs").results()}
    assert found["ours"].verdict == "pass"
    assert found["program"].reason.startswith("the worker process died with signal 9")
    wait_for_ends(pids)
    assert not (folder.path / "finished").exists()


KILLED = """
import os, pathlib, signal

def drive(seen):
    killed = pathlib.Path(__file__).with_name(f"killed-{seen.seed}")
    if seen.seed < 2 and (seen.seed == 0 or not killed.exists()):
        killed.touch()
        os.kill(os.getpid(), signal.SIGTERM if seen.seed else signal.SIGKILL)
    return {"steering": 0.0, "accel": 0.0}
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs signals")
def test_run_whose_worker_was_killed_is_driven_again_and_that_is_told(folder: CampaignFolder) -> None:
    """The worker of seed 0 is killed each time, that of seed 1 once, that of seed 2 never."""
    folder.write("killed.py", KILLED)
    folder.write("c.toml", 'scenario = "loop"\nseconds = 0.1\nseeds = 3\n[drivers]\nf = "killed.py:drive"\n')
    done = folder.command("run", "c.toml", "--jobs", "2")
    assert done.returncode == 1, done.stderr
    assert "driven again, because the worker was killed: 2\n" in done.stdout
    results = ResultsFolder(folder.path / "c_runs").results()
    assert [(each.verdict, each.retries) for each in results] == [("error", 1), ("pass", 1), ("pass", 0)]
    assert results[0].reason.startswith("the worker process died with signal 9")
    table = list(csv.DictReader((folder.path / "c_runs" / "times.csv").read_text().splitlines()))
    assert [row["retries"] for row in table] == ["1", "1", "0"]
    page = (folder.path / "c_runs" / "report.html").read_text()
    assert "Driven again, because the worker was killed: run 1, run 2." in page


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs flock")
def test_second_campaign_in_a_folder_is_refused_until_the_first_has_ended_however_it_ends(
    folder: CampaignFolder, capfd: pytest.CaptureFixture[str]
) -> None:
    folder.write("c.toml", 'scenario = "loop"\nseconds = 0.1\n')
    holder = "from rosbridge_sim.campaign_runs.results_folder import FolderLock\n"
    holder += "import time; from pathlib import Path\n"
    holder += "lock = FolderLock(Path('out/.lock')); print('held', flush=True); time.sleep(600)"
    work = folder.path / "out" / ".work" / "run-1-a"
    work.mkdir(parents=True)
    command = [sys.executable, "-c", holder]
    with subprocess.Popen(command, cwd=folder.path, stdout=subprocess.PIPE, start_new_session=True) as process:
        note_group(work, process.pid)
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        words = ("run", str(folder.path / "c.toml"), "--output", str(folder.path / "out"), "--jobs", "1")
        assert TOOLS["campaign"](words) == 2
        told = capfd.readouterr().err
        assert f"out: process {process.pid} on " in told
        assert told.count("\n") == 1
        assert process.poll() is None, "its workers are noted, and must not be ended as left-overs"
        assert not (folder.path / "out" / "campaign.toml").exists()
        process.kill()
    job = folder.job('scenario = "loop"\nseconds = 0.1\n')
    first, second = ResultsFolder(folder.path / "out"), ResultsFolder(folder.path / "out")
    first.begin(job, is_resumed=False)  # the lock of a dead process is none
    with pytest.raises(DocumentError, match=f"process {os.getpid()} on .* writes its results here"):
        second.begin(job, is_resumed=True)
    second.close()
    first.close()
    second.begin(job, is_resumed=True)
    second.close()


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
        wait_for_ends([child])
