"""Forked programs: each has arguments, output, signals and an end of its own."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests import fork_server
from tests.support import PATIENCE, read_line

pytestmark = pytest.mark.slow


def run(tmp_path: Path, *words: str, module: str = "rosbridge_sim") -> tuple[int, str, str]:
    """The exit code, the output and the log of a program that ends by itself."""
    with (tmp_path / "log").open("wb") as stderr:
        program = fork_server.start(module, words, os.environ, stderr)
    with program.stdout:
        return program.wait(PATIENCE), program.stdout.read(), (tmp_path / "log").read_text()


def test_program_has_its_arguments_and_its_output(tmp_path: Path) -> None:
    code, out, err = run(tmp_path, "--version")
    assert (code, err) == (0, "")
    assert out.startswith("rosbridge-sim ")


def test_program_has_the_exit_code_of_its_mistake(tmp_path: Path) -> None:
    code, out, err = run(tmp_path, "--prot", "0")
    assert (code, out) == (2, "")
    assert err.startswith("rosbridge-sim: ")


def test_program_that_does_not_exist_fails_alone(tmp_path: Path) -> None:
    assert run(tmp_path, module="tests.nothing")[0] == 1
    assert run(tmp_path, "--version")[0] == 0


def test_killed_program_has_the_number_of_its_signal(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as stderr:
        words = ("serve", "--port", "0", "--no-world")
        program, other = (fork_server.start("rosbridge_sim", words, os.environ, stderr) for _ in range(2))
    with program.stdout, other.stdout:
        assert read_line(program)
        assert read_line(other)
        with pytest.raises(subprocess.TimeoutExpired):
            program.wait(0.0)
        program.kill()
        assert program.wait(PATIENCE) == -signal.SIGKILL
        assert other.poll() is None
        other.send_signal(signal.SIGINT)
        assert other.wait(PATIENCE) == 0


def test_programs_end_with_the_tests_that_started_them(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as stderr:
        server = fork_server.ForkServer()
        program = server.start("rosbridge_sim", ("serve", "--port", "0", "--no-world"), os.environ, stderr)
    with program.stdout:
        assert read_line(program)
        server.close()
        assert program.stdout.read() == ""  # its end closes the pipe


def test_program_keeps_no_descriptor_of_another(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as stderr:
        words = ("serve", "--port", "0", "--no-world")
        programs = [fork_server.start("rosbridge_sim", words, os.environ, stderr) for _ in range(2)]
    counts = []
    for program in programs:
        with program.stdout:
            assert read_line(program)
            counts.append(len(os.listdir(f"/proc/{program.pid}/fd")))  # noqa: PTH208 - a count, not paths
            program.kill()
            program.wait(PATIENCE)
    assert counts[0] == counts[1]
