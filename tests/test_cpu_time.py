"""CPU time of programs, and what ends those that take too much of it or none."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests import fork_server
from tests.cpu_time import communicate, cpu_time, run

AT_WORK = "import time\nwhile time.process_time() < 0.2: pass\nprint('done', flush=True)\n"


def test_cpu_time_has_that_of_programs_that_still_run() -> None:
    fork_server.run(["-c", "1"])  # there is a process that forks them
    before = cpu_time(*fork_server.pids())
    with fork_server.popen(["-c", f"{AT_WORK}input()"], stdin=subprocess.PIPE) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "done\n"
        assert cpu_time(*fork_server.pids()) - before > 0.15
        assert cpu_time(program.pid) > 0.15
        assert program.stdin is not None
        program.stdin.close()


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc")
def test_program_that_is_named_beside_its_parent_counts_once() -> None:
    with subprocess.Popen([sys.executable, "-Sc", f"{AT_WORK}input()"], stdin=-1, stdout=-1) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == b"done\n"
        whole = cpu_time(os.getpid())
        assert cpu_time(os.getpid(), program.pid) < whole + 0.1
        assert cpu_time(program.pid, os.getpid()) < whole + 0.1


def test_program_that_works_is_waited_for() -> None:
    with fork_server.popen(["-c", AT_WORK]) as program:
        assert communicate(program, patience=2.0) == ("done\n", "")
    assert run([sys.executable, "-Sc", "print('x')"]).stdout == "x\n"


@pytest.mark.parametrize("code", ["input()", "while True: pass"])
def test_program_without_cpu_time_and_one_with_too_much_are_killed(code: str) -> None:
    with fork_server.popen(["-c", code], stdin=subprocess.PIPE) as program:
        stdin, program.stdin = program.stdin, None
        with pytest.raises(subprocess.TimeoutExpired):
            communicate(program, limit=0.1, patience=0.05)
        assert program.wait() < 0
        assert stdin is not None
        stdin.close()


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc")
def test_threads_that_end_meanwhile_take_nothing_from_the_cpu_time() -> None:
    is_over = threading.Event()

    def start_threads() -> None:
        while not is_over.is_set():
            thread = threading.Thread(target=int)
            thread.start()
            thread.join()

    starter = threading.Thread(target=start_threads)
    starter.start()
    try:
        figures = [cpu_time(os.getpid()) for _ in range(100)]
    finally:
        is_over.set()
        starter.join()
    assert figures == sorted(figures)
