"""Command line of the tools: usage errors, help, sources of the URL, and no import cost for `serve`."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rosbridge_sim import __main__
from rosbridge_sim.cli.command_table import TOOLS
from tests.cli.tool_fixture import run
from tests.support import PATIENCE, ROOT, ServerProcess


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ("topic",),
            "topic: expected a command: list, info, type, find, echo, hz, bw, delay, pub; see",
        ),
        (("schema", "lsit"), "no such command: lsit (did you mean list?); expected list, show"),
        (("topic", "list", "--foo"), "unrecognized arguments: --foo; see rosbridge-sim topic --help"),
        (("topic", "list", "--verb"), "unrecognized arguments: --verb"),
        (("topic", "echo"), "the following arguments are required: NAME"),
        (("topic", "echo", "/x", "-n", "0"), "-n/--count: expected a number from 1 on; got '0'"),
        (("topic", "echo", "/x", "--field", "a..b"), "--field: expected a path such as a.b or list[0].c; got 'a..b'"),
        (("topic", "hz", "/x", "-w", "1"), "-w/--window: expected a number from 2 to 1,000,000; got '1'"),
        (("topic", "pub", "/x", "p/A", "--rate", "nan"), "-r/--rate: expected times a second, at most 10,000"),
        (("topic", "list", "--timeout", "0"), "--timeout: expected seconds; got '0'"),
        (("service", "call", "/x", "--timeout", "-1"), "--timeout: expected"),
    ],
)
def test_usage_error_is_one_line_and_exit_code_2(words: tuple[str, ...], line: str) -> None:
    done = run(*words)
    assert (done.code, done.out) == (2, "")
    assert done.complaint.startswith(line)


def test_help_shows_the_url_of_the_environment_without_its_token(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROSBRIDGE_SIM_URL", "ws://far:1/?token=s3same")
    monkeypatch.setenv("ROSBRIDGE_SIM_TOKEN", "s3same")
    monkeypatch.setattr(sys, "argv", ["rosbridge-sim", "topic", "echo", "--help"])
    with pytest.raises(SystemExit):
        __main__.main()
    said = capsys.readouterr().out
    assert "[ws://far:1]" in said
    assert "s3same" not in said


@pytest.mark.parametrize(
    "words", [("topic", "list", "--tokn", "s3same"), ("topic", "list", "x?token=s3same", "-z=s3same")]
)
def test_usage_error_next_to_a_token_does_not_show_the_token(words: tuple[str, ...]) -> None:
    done = run(*words)
    assert done.code == 2
    assert done.complaint.startswith("unrecognized arguments: -")
    assert "s3same" not in done.complaint


def test_main_dispatches_every_tool_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["rosbridge-sim", "schema", "show", "std_msgs/String"])
    assert __main__.main() == 0
    assert capsys.readouterr() == ("# A text.\n\nstring data  # a text\n", "")
    for name in TOOLS:
        monkeypatch.setattr(sys, "argv", ["rosbridge-sim", name, "--no-such-flag"])
        assert __main__.main() == 2


@pytest.mark.parametrize("words", [["--help"], ["echo", "--help"]])
def test_help_lists_every_command(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        TOOLS["topic"](words)
    assert ended.value.code == 0
    out = capsys.readouterr().out
    for word in ("--field", "--once", "--url", "--token") if len(words) > 1 else ("list", "info", "echo", "hz", "pub"):
        assert word in out


def test_url_and_token_can_come_from_the_environment(server: ServerProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROSBRIDGE_SIM_URL", server.url)
    monkeypatch.setenv("ROSBRIDGE_SIM_TOKEN", "two words")
    assert run("topic", "list").complaint.startswith("--token: ")
    assert run("topic", "list", "--token", "one").code == 0


@pytest.mark.slow
def test_terminal_without_korean_letters_gets_an_escaped_answer(server: ServerProcess) -> None:
    command = [sys.executable, "-m", "rosbridge_sim", "topic", "echo", "/tools/차량", "--url", server.url]
    env = {"PATH": "", "PYTHONIOENCODING": "ascii", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("rosbridge-sim: no topic /tools/\\ucc28\\ub7c9 here")
