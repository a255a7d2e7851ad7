"""Exit codes: each one in the table of `docs/operation.md` is what programs really end with, and there is no other."""

from __future__ import annotations

import re
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests import fork_server
from tests.fork_server import ForkedProgram
from tests.support import PATIENCE, ROOT

BROKEN_WORLD = (
    "import sys; from rosbridge_sim.simulator import node_factory; node_factory.step = None; "
    "from rosbridge_sim.__main__ import main; sys.exit(main())"
)


@contextmanager
def start(*words: str, code: str | None = None) -> Iterator[ForkedProgram]:
    """Start a program; it is killed where it has not ended by itself."""
    with fork_server.popen([*(("-c", code) if code else ("-m", "rosbridge_sim")), *words]) as process:
        try:
            yield process
        finally:
            process.kill()


def end_of(*words: str, code: str | None = None) -> int:
    with start(*words, code=code) as process:
        process.communicate(timeout=PATIENCE)
        return process.wait()


WAITING = (
    "import sys; from rosbridge_sim.shell.websocket import server; server.CLOSE_TIMEOUT = 3600.0; "
    "from rosbridge_sim.__main__ import main; sys.exit(main())"
)
"""A server that waits for a client until a second signal, however late that one comes."""


def served(stop: Callable[[ForkedProgram, int], None], code: str | None = None) -> int:
    """Start a server, stop it in some way; its exit code."""
    with start("--port", "0", code=code) as process:
        assert process.stdout is not None
        stop(process, int(process.stdout.readline().strip().rpartition(":")[2]))
        process.communicate(timeout=PATIENCE)
        return process.wait()


def one_signal(process: ForkedProgram, _port: int) -> None:
    process.send_signal(signal.SIGTERM)


def second_signal(number: signal.Signals) -> Callable[[ForkedProgram, int], None]:
    def stop(process: ForkedProgram, port: int) -> None:
        with socket.create_connection(("127.0.0.1", port)) as client:  # one that does not hear that the server goes
            client.sendall(
                b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
            )
            assert client.recv(1024).startswith(b"HTTP/1.1 101")
            process.send_signal(signal.SIGTERM)
            assert process.stderr is not None
            while "SIGTERM: stopping" not in (line := process.stderr.readline()):
                assert line, "it ended before it said that it would"
            process.send_signal(number)
            process.wait(PATIENCE)

    return stop


def bad_scenario(tmp_path: Path) -> int:
    (tmp_path / "bad.json").write_text("{}{")
    return end_of("scenario", "check", str(tmp_path / "bad.json"))


def nobody_answers(_tmp_path: Path) -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    return end_of("topic", "list", "--url", f"ws://127.0.0.1:{port}")


def ctrl_c(_tmp_path: Path) -> int:
    with (
        socket.create_server(("127.0.0.1", 0)) as mute,
        start("topic", "list", "--url", f"ws://127.0.0.1:{mute.getsockname()[1]}") as process,
        mute.accept()[0],  # it takes the connection, and says nothing
    ):
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)
        return process.wait()


CASES: dict[str, tuple[int, Callable[[Path], int]]] = {
    "a server that a signal ends": (0, lambda _: served(one_signal)),
    "a command that is done": (0, lambda _: end_of("schema", "list")),
    "a world that fails": (1, lambda _: end_of("--port", "0", code=BROKEN_WORLD)),
    "a file with mistakes": (1, bad_scenario),
    "a mistake in the settings": (2, lambda _: end_of("--prot", "1")),
    "a scenario that cannot be used": (2, lambda _: end_of("--port", "0", "--scenario", "nothing")),
    "no rosbridge": (2, nobody_answers),
    "a second signal, SIGINT": (130, lambda _: served(second_signal(signal.SIGINT), WAITING)),
    "Ctrl-C": (130, ctrl_c),
    "a second signal, SIGTERM": (143, lambda _: served(second_signal(signal.SIGTERM), WAITING)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_program_ends_with_the_code_of_the_table(name: str, tmp_path: Path) -> None:
    code, run = CASES[name]
    assert run(tmp_path) == code


def test_table_has_these_codes_and_no_other() -> None:
    text = (ROOT / "docs/operation.md").read_text("utf-8").partition("\n### Exit codes\n")[2].partition("\n#")[0]
    codes = [int(code) for code in re.findall(r"^\| (\d+) \|", text, re.MULTILINE)]
    assert codes == sorted({code for code, _ in CASES.values()})
