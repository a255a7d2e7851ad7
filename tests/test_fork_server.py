"""Forked programs: each has arguments, output, signals and an end of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests import fork_server
from tests.support import PATIENCE, read_line

pytestmark = pytest.mark.slow


def run(*words: str, module: str = "rosbridge_sim") -> tuple[int, str, str]:
    """The exit code, the output and the log of a program that ends by itself."""
    done = fork_server.run(["-m", module, *words])
    return done.returncode, done.stdout, done.stderr


def test_program_has_its_arguments_and_its_output() -> None:
    code, out, err = run("--version")
    assert (code, err) == (0, "")
    assert out.startswith("rosbridge-sim ")


def test_program_has_the_exit_code_of_its_mistake() -> None:
    code, out, err = run("--prot", "0")
    assert (code, out) == (2, "")
    assert err.startswith("rosbridge-sim: ")


def test_program_that_does_not_exist_fails_alone() -> None:
    assert run(module="tests.nothing")[0] == 1
    assert run("--version")[0] == 0


def test_killed_program_has_the_number_of_its_signal(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as stderr:
        words = ("serve", "--port", "0", "--no-world")
        program, other = (fork_server.start("rosbridge_sim", words, os.environ, stderr) for _ in range(2))
    with program, other:
        assert read_line(program)
        assert read_line(other)
        with pytest.raises(subprocess.TimeoutExpired):
            program.wait(0.0)
        program.kill()
        assert program.wait(PATIENCE) == -signal.SIGKILL
        assert other.poll() is None
        other.send_signal(signal.SIGINT)
        assert other.wait(PATIENCE) == 0


def test_program_that_is_gone_before_its_end_is_noticed_takes_a_signal() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        gone.wait(PATIENCE)
    status, far_status = os.pipe()  # nothing is written to it
    program = fork_server.ForkedProgram(gone.pid, status, None, None, None)
    program.kill()
    assert program.poll() is None
    os.close(far_status)
    os.close(status)


def test_server_forked_of_another_ends_alone_and_with_it_what_it_started(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as stderr:
        origin = fork_server.ForkServer(fork_server.server())
        own = fork_server.ForkServer(origin)
        serve = ["-m", "rosbridge_sim", "serve", "--port", "0", "--no-world"]
        program = own.start(serve, env=os.environ, stderr=stderr.fileno())
        assert program.stdout is not None
        with program.stdout:
            assert read_line(program)
            own.close()
            assert program.stdout.read() == ""  # its end closes the pipe
        with origin.start(["-c", "print('here')"], env=os.environ, stderr=stderr.fileno()) as other:
            assert read_line(other) == "here\n"
        origin.close()


def test_program_keeps_no_descriptor_of_another(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as stderr:
        words = ("serve", "--port", "0", "--no-world")
        programs = [fork_server.start("rosbridge_sim", words, os.environ, stderr) for _ in range(2)]
    counts = []
    for program in programs:
        with program:
            assert read_line(program)
            counts.append(len(os.listdir(f"/proc/{program.pid}/fd")))  # noqa: PTH208 - a count, not paths
            program.kill()
            program.wait(PATIENCE)
    assert counts[0] == counts[1]


def test_file_and_code_have_streams_folder_and_variables_of_their_own(tmp_path: Path) -> None:
    code = "import os, sys\nprint(os.getcwd(), os.environ['OWN'], sys.argv[1:], __name__, file=sys.stderr)\n"
    code += "for line in sys.stdin:\n    print(line.strip())\nraise SystemExit('the end')"
    (tmp_path / "program.py").write_text(code)
    for command in (["-c", code, 1], [tmp_path / "program.py", 1]):
        with fork_server.popen(command, cwd=tmp_path, env={"OWN": "x"}, stdin=subprocess.PIPE) as program:
            assert program.stdin is not None
            program.stdin.write("안녕\n")
            out, err = program.communicate(PATIENCE)
        assert (program.returncode, out, err) == (1, "안녕\n", f"{tmp_path} x ['1'] __main__\nthe end\n")


def test_traceback_of_a_program_goes_to_its_stderr() -> None:
    done = fork_server.run(["-c", "1 / 0"])
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith("ZeroDivisionError: division by zero\n")


REFUSING = """
import asyncio
from rosbridge_sim.shell.files import message_types
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.page import web_page
from tests import kept_work

def refuse(*args, **kwargs):
    raise AssertionError(args)

kept_work.read_map = kept_work.read_scenario = message_types.read_definitions = web_page.join_modules = refuse

async def main():
    for options in ({}, {"scenario": "town", "release": "26.R1"}, {"ros": 2}):
        async with Simulator(Settings(port=0, **options)):
            web_page.page_files()

asyncio.run(main())
"""
"""A program that fails where it would read something anew."""


def test_program_finds_the_usual_scenes_their_types_and_the_page_read() -> None:
    done = fork_server.run(["-c", REFUSING])
    assert done.returncode == 0, done.stderr


STARTING = """
import multiprocessing, os, subprocess, sys, threading
from rosbridge_sim.shell.drawing import drawing_process
from tests.test_fork_server import tell

if __name__ == "__main__":
    threading.Thread(target=threading.Event().wait, daemon=True).start()
    context = multiprocessing.get_context("forkserver")
    worker = context.Process(target=tell, args=[os.getpid()])
    worker.start()
    worker.join()
    print("code", worker.exitcode)
    command = [sys.executable, "-c", drawing_process._START, *sys.path]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={"OWN": "x"}) as drawing:
        print(open(f"/proc/{drawing.pid}/cmdline").read() == open("/proc/self/cmdline").read())
        print(sorted(os.listdir(f"/proc/{drawing.pid}/fd"), key=int)[:3])
        print(drawing.communicate()[0])
    print(drawing.returncode)
"""
"""A program that starts a worker of `multiprocessing`, and what draws for sensors."""


def tell(parent: int) -> None:
    """Say whose child this process is, if it is not that of its parent; and end as one that has failed."""
    print(os.getppid() != parent, os.environ["OWN"])  # noqa: T201 - what the test reads
    raise SystemExit(3)


def test_programs_of_a_program_are_forks_of_it_with_streams_and_ends_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(STARTING)
    done = fork_server.run([tmp_path / "program.py"], env={**os.environ, "OWN": "안녕"})
    assert done.stderr == ""
    assert done.stdout.splitlines() == ["True 안녕", "code 3", "True", "['0', '1', '2']", "b''", "0"]
