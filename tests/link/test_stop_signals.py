"""Signals that end the program, in real processes: recordings are readable afterwards."""

from __future__ import annotations

import os
import pty
import re
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.request import urlopen

import pytest

from tests import fork_server
from tests.conftest import Serve
from tests.fork_server import ForkedProgram
from tests.shell.bags.bag_reading import read_bag
from tests.support import PATIENCE, ServerProcess, read_line

pytestmark = pytest.mark.slow

KINDS = pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a"])

MAIN = "import sys; from rosbridge_sim.__main__ import main; sys.exit(main())"
WITHOUT_UVLOOP = f"import sys; sys.modules['uvloop'] = None; {MAIN}"

WAITING = "from rosbridge_sim.shell.websocket import server; server.CLOSE_TIMEOUT = 3600.0; "
"""Before the code of a server: it waits for its client until a second signal, however late that one comes."""


@contextmanager
def server_process(code: str, *flags: str) -> Iterator[tuple[ForkedProgram, int]]:
    """A server that records, and its port; a client that never hears that it goes keeps it from ending soon."""
    process = fork_server.popen(["-c", code, "serve", "--port", "0", *flags])
    with process:
        try:
            port = int(read_line(process).strip().rpartition(":")[2])
            with socket.create_connection(("127.0.0.1", port)) as client:
                client.sendall(
                    b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
                )
                assert client.recv(1024).startswith(b"HTTP/1.1 101")
                yield process, port
        finally:
            process.kill()


def wait_for(process: ForkedProgram, text: str) -> None:
    """Read its log until that comes; a program that does not say it in time is ended."""
    assert process.stderr is not None
    timer = threading.Timer(PATIENCE, process.kill)
    timer.start()
    try:
        while text not in (line := process.stderr.readline()):
            assert line, f"it ended before it said {text!r}"
    finally:
        timer.cancel()


@pytest.fixture(scope="module")
def server(moving_server: ServerProcess) -> ServerProcess:
    """The world of these tests moves."""
    return moving_server


@pytest.mark.parametrize(("name", "code"), [("a.bag", MAIN), ("a.mcap", MAIN), ("a", MAIN), ("a.bag", WITHOUT_UVLOOP)])
def test_second_signal_closes_the_recording_and_stops_the_server(tmp_path: Path, code: str, name: str) -> None:
    with server_process(WAITING + code, "--record", str(tmp_path / name)) as (process, _):
        process.send_signal(signal.SIGTERM)
        wait_for(process, "SIGTERM: stopping")
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 128 + signal.SIGINT
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
    assert read_bag(tmp_path / name)


@KINDS
def test_hangup_finishes_the_recording(serve: Serve, tmp_path: Path, name: str) -> None:
    server = serve("--record", str(tmp_path / name))
    assert server.stop(signal.SIGHUP) == 0
    assert "SIGHUP: stopping" in server.log
    assert read_bag(tmp_path / name)


def test_repeated_hangup_does_not_count_as_a_second_signal(tmp_path: Path) -> None:
    with server_process(MAIN, "--record", str(tmp_path / "a.bag")) as (process, _):
        process.send_signal(signal.SIGHUP)
        wait_for(process, "SIGHUP: stopping")
        process.send_signal(signal.SIGHUP)
        assert process.wait(PATIENCE) == 0
    assert read_bag(tmp_path / "a.bag")


def test_hangup_under_nohup_is_ignored(tmp_path: Path) -> None:
    ignoring = f"import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN); {MAIN}"
    with server_process(ignoring, "--record", str(tmp_path / "a.bag")) as (process, port):
        process.send_signal(signal.SIGHUP)
        with urlopen(f"http://127.0.0.1:{port}/healthz", timeout=PATIENCE) as answer:
            assert answer.status == 200
        process.send_signal(signal.SIGTERM)
        wait_for(process, "SIGTERM: stopping")
        assert process.wait(PATIENCE) == 0


@pytest.mark.parametrize(("command", "name"), [("serve", "a.bag"), ("serve", "a"), ("record", "a.mcap")])
def test_closed_terminal_leaves_a_readable_recording(
    tmp_path: Path, server: ServerProcess, command: str, name: str
) -> None:
    path = str(tmp_path / name)
    words = {"serve": ["serve", "--port", "0", "--record", path], "record": ["record", path, "--url", server.url]}
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, [sys.executable, "-m", "rosbridge_sim", *words[command]])  # noqa: S606 - our own program
    said = b""
    ready = {"serve": b"listening on .*\n", "record": b"messages, "}[command]
    while not re.search(ready, said):
        said += os.read(terminal, 1024)
    os.close(terminal)
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) >= 0, "it ended by itself, not by the signal"
    read_bag(tmp_path / name)


STUCK = """
import asyncio, os, sys, time
from rosbridge_sim.link import stop_signals
from rosbridge_sim.link.stop_signals import on_stop_signals

stop_signals.HURRY = 3600.0  # it is the third signal that ends this process

async def main():
    def stop(number):
        print("stopping", flush=True)
        while True:  # a loop that will never do anything else
            pass

    with on_stop_signals(stop, lambda: None):
        print("ready", flush=True)
        await asyncio.Event().wait()

if sys.argv[1] == "uvloop":
    import uvloop
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(main())

class DeafLoop(asyncio.SelectorEventLoop):  # handles no signals, like those of Windows
    def add_signal_handler(self, *_):
        raise NotImplementedError

    def remove_signal_handler(self, *_):
        raise NotImplementedError

with asyncio.Runner(loop_factory=DeafLoop if sys.argv[1] == "deaf" else None) as runner:
    runner.run(main())
"""


@pytest.mark.parametrize("loop", ["uvloop", "asyncio", "deaf"])
def test_third_signal_ends_a_stuck_event_loop_at_once(loop: str) -> None:
    with fork_server.popen(["-c", STUCK, loop]) as process:
        try:
            assert read_line(process) == "ready\n"
            process.send_signal(signal.SIGINT)
            assert read_line(process) == "stopping\n"
            process.send_signal(signal.SIGINT)
            process.send_signal(signal.SIGTERM)  # if both come at once, either may be handled as the third
            assert process.wait(PATIENCE) in {128 + signal.SIGINT, 128 + signal.SIGTERM}
        finally:
            process.kill()
