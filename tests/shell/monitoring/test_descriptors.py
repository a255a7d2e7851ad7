"""A server without free file descriptors: one log line, clear refusals, and recovery."""

from __future__ import annotations

import asyncio
import errno
import os
import resource
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import cast

import pytest

from rosbridge_sim.shell.monitoring.descriptors import QUIET, DescriptorWatch
from tests.shell.bags.bag_reading import read_bag
from tests.support import PATIENCE, ROOT, Client, read_line


class Loop:
    """As much of an event loop as the watch uses, with a clock that the test moves."""

    def __init__(self) -> None:
        self.now = 1_000.0
        self.timers: list[Callable[[], None]] = []
        self.passed_on: list[dict[str, object]] = []

    def time(self) -> float:
        return self.now

    def call_later(self, _delay: float, call: Callable[[], None]) -> Loop:
        self.timers.append(call)
        return self

    def cancel(self) -> None:
        self.timers.clear()

    def default_exception_handler(self, context: dict[str, object]) -> None:
        self.passed_on.append(context)

    def run(self, seconds: int) -> None:
        for _ in range(seconds):
            self.now += 1.0
            self.timers.pop()()


def test_missing_descriptors_are_one_log_line_per_minute(caplog: pytest.LogCaptureFixture) -> None:
    number: int | None = None

    def try_one() -> None:
        if number is not None:
            raise OSError(number, os.strerror(number))

    loop = Loop()
    watch = DescriptorWatch(cast("asyncio.AbstractEventLoop", loop), try_one)
    loop.run(5)
    assert caplog.messages == []
    number = errno.EMFILE
    loop.run(int(QUIET))
    (message,) = caplog.messages
    assert f"(this process may have {resource.getrlimit(resource.RLIMIT_NOFILE)[0]:,})" in message
    number = errno.ENFILE
    loop.run(1)
    assert caplog.messages[1].startswith("no file descriptors are left on this machine: ")
    number = errno.EIO
    loop.run(2 * int(QUIET))
    assert len(caplog.messages) == 2
    watch.stop()
    assert loop.timers == []


def test_event_loop_reports_of_missing_descriptors_share_one_line(caplog: pytest.LogCaptureFixture) -> None:
    loop = Loop()
    watch = DescriptorWatch(cast("asyncio.AbstractEventLoop", loop), lambda: None)
    report = {"message": "socket.accept() out of system resource", "exception": OSError(errno.EMFILE, "")}
    for _ in range(100):
        watch.take(cast("asyncio.AbstractEventLoop", loop), report)
    assert len(caplog.messages) == 1
    others: list[dict[str, object]] = [{"message": "a"}, {"message": "b", "exception": OSError(errno.EPIPE, "")}]
    for other in others:
        watch.take(cast("asyncio.AbstractEventLoop", loop), other)
    assert loop.passed_on == others


MAIN = """
import resource, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
if sys.argv.pop(1) == "asyncio":
    sys.modules["uvloop"] = None
from rosbridge_sim.__main__ import main
sys.exit(main())
"""


@pytest.mark.slow
@pytest.mark.parametrize("loop", ["uvloop", "asyncio"])
async def test_server_without_descriptors_logs_once_and_goes_on(tmp_path: Path, loop: str) -> None:
    with start(tmp_path, loop) as (process, port):
        async with await Client.open(f"ws://127.0.0.1:{port}") as client:
            await client.send("subscribe", topic="/rosout", type="rosgraph_msgs/Log")
            await client.settle()
            with ExitStack() as crowd:
                for _ in range(80):
                    crowd.enter_context(socket.create_connection(("127.0.0.1", port)))
                await client.message_where("/rosout", lambda line: line["msg"].startswith("no file descriptors"))
                await client.send("publish", topic="/SaveSensorData", type="morai_msgs/SaveSensorData", msg={}, id="a")
                assert "Too many open files" in (await client.take("status", id="a"))["msg"]
                replay = {"sim_process_status": 1, "replay_option": 1, "rosbag_file_name": "drive"}
                answer = await client.call("/Morai_SimProc", {"request": replay})
                assert answer["values"] == {"response": {"result": False}}
                assert "Too many open files" in (await client.take("status", level="error"))["msg"]
                await client.call("/Service_MoraiSL", {"request": {"file_name": "town", "delete_all": True}})
                assert "Too many open files" in (await client.take("status", level="error"))["msg"]
            assert "200 OK" in await asyncio.to_thread(read_health, port)
            await client.send("subscribe", topic="/gps", type="morai_msgs/GPSMessage")
            await client.message_where("/gps", lambda message: message["status"] == 1)  # a library had to be loaded
        process.terminate()
        assert process.wait(PATIENCE) == 0
    text = (tmp_path / "log.txt").read_text()
    assert text.count("no file descriptors are left (this process may have 64)") == 1
    assert "Traceback" not in text, text
    assert len(text) < 5_000, text
    read_bag(tmp_path / "a.mcap")


@contextmanager
def start(folder: Path, loop: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A server that may have few descriptors, and its port."""
    (folder / "data" / "Replay").mkdir(parents=True)
    (folder / "data" / "Replay" / "drive.bag").touch()
    words = ["serve", "--port", "0", "--data-dir", str(folder / "data"), "--record", str(folder / "a.mcap")]
    with (folder / "log.txt").open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-c", MAIN, loop, *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=log, text=True
        )
    with process:
        try:
            yield process, int(read_line(process).strip().rpartition(":")[2])
        finally:
            process.kill()


def read_health(port: int) -> str:
    """The first line of the page, asked for until it is there: descriptors may take a moment to be free."""
    for _ in range(10_000):
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), PATIENCE) as client:
            client.sendall(b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n")
            answer = client.recv(1024).decode()
            if answer:
                return answer.splitlines()[0]
    raise AssertionError("it never answers again")
