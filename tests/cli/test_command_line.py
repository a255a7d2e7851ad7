"""The program as a user sees it: output, streams and exit codes."""

from __future__ import annotations

import asyncio
import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from websockets.exceptions import ConnectionClosed

from rosbridge_sim import __main__, __version__
from rosbridge_sim.cli.command_table import TOOLS
from tests import fork_server
from tests.conftest import Connect, Serve
from tests.cpu_time import communicate
from tests.support import PATIENCE, ROOT, read_line


def run(*words: str, code: str | None = None, **environ: str) -> subprocess.CompletedProcess[str]:
    """The whole life of a program that ends by itself."""
    command = [*(("-c", code) if code else ("-m", "rosbridge_sim")), *words]
    return fork_server.run(command, env={**os.environ, **environ})


def say(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Code, stdout and stderr of a command line that starts nothing."""
    monkeypatch.setattr(sys, "argv", ["rosbridge-sim", *words])
    code = __main__.main()
    out, err = capsys.readouterr()
    return code, out, err


# Commands that start nothing


def test_version_flag_prints_the_version(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert say(monkeypatch, capsys, "--version") == (0, f"rosbridge-sim {__version__}\n", "")


def test_printed_config_shows_the_settings_in_use(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROSBRIDGE_SIM_SEED", "77")
    code, out, err = say(monkeypatch, capsys, "serve", "--print-config", "--port", "4")
    assert (code, err) == (0, "")
    assert "\nport = 4\n" in out
    assert "\nseed = 77\n" in out


def test_mock_takes_the_options_of_a_configuration_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    config = tmp_path / "options.toml"
    config.write_text("port = 0\nros = 2\ndeny_service = ['/enable']\n")
    code, out, err = say(monkeypatch, capsys, "mock", "run", "robot.yaml", "--config", str(config), "--print-config")
    assert (code, err) == (0, "")
    expected = {'mock = "robot.yaml"', "port = 0", "ros = 2", 'deny-service = ["/enable"]', "world = false"}
    assert expected <= {*out.splitlines()}


@pytest.mark.slow
def test_help_without_a_command_is_the_help_of_serve() -> None:
    bare, named = run("--help"), run("serve", "--help")
    assert bare.returncode == named.returncode == 0
    assert bare.stdout == named.stdout
    assert bare.stdout.startswith("usage: rosbridge-sim [serve]")
    for flag in ("--port", "--version", "--print-config"):
        assert flag in bare.stdout
    about = re.split(r"[^a-z0-9]+", bare.stdout.partition("options:")[0])
    assert {"serve", "attach", *TOOLS} <= {*about}, "the text at the top names all commands"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--prot", "1"), "no such flag: --prot (did you mean --port?); --help lists them all"),
        (("serve", "--port", "x"), "--port: expected a whole number from 0 to 65,535; got 'x'"),
        (("sevre",), "no such command: sevre (did you mean serve?); --help lists them"),
        (("demo",), "no such command: demo; --help lists them"),
        (("atach", "h"), "no such command: atach (did you mean attach?); --help lists them"),
        (("attach", "h", "--port", "1"), "--port: is a flag of serve; attach has no clients of its own"),
        (
            ("attach", "ws://h:x"),
            "attach: expected URLs of rosbridges, each once, such as ws://192.168.0.5:9090; got ['ws://h:x']",
        ),
        (("--config", "/nowhere.toml"), "/nowhere.toml: cannot be read: No such file or directory"),
    ],
)
def test_usage_error_is_one_line_on_stderr_and_exit_code_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], line: str
) -> None:
    assert say(monkeypatch, capsys, *words) == (2, "", f"rosbridge-sim: {line}\n")


# Starts that fail


@pytest.mark.slow
def test_failed_start_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text("{")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        for words, said in (
            (("--port", port), "the port is in use"),
            (("--port", "0", "--scenario", str(tmp_path / "bad.json")), "bad.json:1:"),
            (("--port", "0", "--schema-path", str(tmp_path)), "found no definition"),
            (("attach",), "attach: expected URLs of rosbridges"),
            (("attach", "h", "--no-world"), "there is nothing to advertise"),
        ):
            done = run(*words, "--log-level", "warning")
            assert (done.returncode, done.stdout) == (2, "")
            assert done.stderr.startswith("rosbridge-sim: ")
            assert said in done.stderr
            assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_failed_world_ends_the_program_with_a_traceback_and_exit_code_1() -> None:
    broken = "import sys; from rosbridge_sim.simulator import node_factory; node_factory.step = None; "
    done = run("--port", "0", code=broken + "from rosbridge_sim.__main__ import main; sys.exit(main())")
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    assert "CRITICAL rosbridge_sim: stopped: the world has failed: TypeError" in done.stderr.splitlines()[-1]


# A server


@pytest.mark.slow
def test_first_stdout_line_has_the_url_and_healthz_answers(serve: Serve) -> None:
    server = serve()
    assert server.url == f"ws://127.0.0.1:{server.port}"
    with urlopen(f"http://127.0.0.1:{server.port}/healthz", timeout=PATIENCE) as answer:
        assert (answer.status, json.load(answer)["mode"]) == (200, "real_time")


@pytest.mark.slow
def test_server_with_a_failed_world_is_unhealthy_and_stops_with_exit_code_0(tmp_path: Path) -> None:
    code = "import sys; from rosbridge_sim.simulator import node_factory; node_factory.step = None; "
    code += "from rosbridge_sim.__main__ import main; sys.exit(main())"
    words = ["serve", "--port", "0", "--on-world-failure", "serve"]
    with (tmp_path / "log.txt").open("wb") as log:
        process = fork_server.popen(["-c", code, *words], stderr=log)
    with process:
        status, body = first_unhealthy(int(read_line(process).strip().rpartition(":")[2]))
        assert (status, json.loads(body)["reason"][:31]) == (503, "the world has failed: TypeError")
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    text = (tmp_path / "log.txt").read_text()
    assert text.count("Traceback") == text.count("CRITICAL") == 1


def first_unhealthy(port: int) -> tuple[int, bytes]:
    """The first answer of the health page that is not 200."""
    while True:
        try:
            urlopen(f"http://127.0.0.1:{port}/healthz", timeout=PATIENCE).close()
        except HTTPError as error:
            with error:
                return error.code, error.read()


@pytest.mark.slow
def test_settings_from_environment_and_file_reach_the_server(serve: Serve, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('host = "localhost"\nport = 1\n')
    server = serve(env={"ROSBRIDGE_SIM_CONFIG": str(tmp_path / "s.toml"), "ROSBRIDGE_SIM_SYNC_LAESE": "1"})
    assert server.url == f"ws://localhost:{server.port}"
    assert "SYNC_LAESE means nothing here (did you mean ROSBRIDGE_SIM_SYNC_LEASE?)" in server.log


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
async def test_signal_stops_the_server_with_exit_code_0_and_a_close_code_for_clients(
    serve: Serve, connect: Connect, number: signal.Signals
) -> None:
    server = serve()
    client = await connect(server.url)
    await client.settle()
    assert await asyncio.to_thread(server.stop, number) == 0
    with pytest.raises(ConnectionClosed):
        await client.read()
    assert client.socket.close_code == 1001


@pytest.mark.slow
def test_server_writes_one_line_to_stdout() -> None:
    with fork_server.popen(["-m", "rosbridge_sim", "--port", "0"]) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("rosbridge-sim listening on ws://127.0.0.1:")
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
        assert process.stdout.read() == ""


@pytest.mark.slow
def test_attach_prints_its_bridge_first_and_stops_on_a_signal_with_exit_code_0(serve: Serve) -> None:
    bridge = serve("--no-world", "--token", "sesame")
    url = f"{bridge.url}/?token=sesame"
    with fork_server.popen(["-m", "rosbridge_sim", "attach", url]) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == f"rosbridge-sim attached to {bridge.url}\n"
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
        assert process.stdout.read() == ""
        log = process.stderr.read()
    assert "sesame" not in log
    assert [line.partition(" attach: ")[2] for line in log.splitlines() if " attach: " in line][:2] == [
        f"{bridge.url}: dialling",
        f"{bridge.url}: connected",
    ]


@pytest.mark.slow
def test_attach_waits_for_a_missing_bridge_until_a_signal() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:  # it takes the connection, and says nothing
        url = f"ws://127.0.0.1:{mute.getsockname()[1]}"
        with fork_server.popen(["-m", "rosbridge_sim", "attach", url]) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            while "dialling" not in (line := process.stderr.readline()):
                assert line, "it ended before it dialled"
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 0
            assert process.stdout.read() == ""


@pytest.mark.slow
def test_signal_during_the_start_ends_the_server_quietly() -> None:
    early = "import os, signal, sys; from rosbridge_sim.shell import app; "
    early += "app.read_types = lambda *_: os.kill(os.getpid(), signal.SIGINT); "
    done = run("--port", "0", code=early + "from rosbridge_sim.__main__ import main; sys.exit(main())")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.slow
def test_log_has_one_line_per_event_for_any_client_text(serve: Serve) -> None:
    server = serve("--log-level", "debug")
    with socket.create_connection(("127.0.0.1", server.port)) as client:
        client.sendall(b"GET /\x1b[31m HTTP/1.1\r\nHost: x\r\n\r\n")
        select.select([client], [], [], PATIENCE)
    for line in server.log.splitlines():
        assert line.isprintable()


FULL = "rosbridge-sim: the output cannot be written: no space left on device\n"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("is_unbuffered", [False, True])
@pytest.mark.parametrize(
    "words", [["schema", "show", "std_msgs/String"], ["--print-config"], ["--port", "0", "--log-level", "error"]]
)
def test_full_output_device_is_one_line_and_exit_code_2(words: list[str], *, is_unbuffered: bool) -> None:
    command = ["-m", "rosbridge_sim", *words]
    with Path("/dev/full").open("w") as full:
        if is_unbuffered:  # it fails where it is written
            env = {**os.environ, "PYTHONUNBUFFERED": "1"}
            with fork_server.popen(command, env=env, stdout=full.fileno()) as program:
                err = communicate(program)[1]
            code = program.wait()
        else:  # it may fail when the interpreter ends, which is not the same in a fork
            env = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
            done = subprocess.run(
                [sys.executable, *command],
                cwd=ROOT,
                env=env,
                stdout=full,
                stderr=subprocess.PIPE,
                text=True,
                check=False,
            )
            code, err = done.returncode, done.stderr
    assert (code, err) == (2, FULL)
