"""Tests in forks of the process that has collected them: files one at a time in each, those of one browser together.

To collect all tests takes longer than to run most files of them, so `--processes N` does it once and then forks. What a
fork reports goes to the hooks of the first process: `-x`, `--junitxml`, `--durations` and the summary are pytest's own.
At the end the files that took longest are listed, with the CPU time of the programs that they started.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import time
from collections import defaultdict
from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, cast

import pytest
from _pytest.runner import CallInfo

from tests import fork_server
from tests.cpu_time import cpu_time

__all__ = ["APART", "TOGETHER", "WORKER", "ForkedWorkers"]

_WITHOUT_BROWSER = {"test_code.py", "test_modules.py"}

TOGETHER = {
    f"tests/page/{path.name}": "pages"
    for path in sorted((Path(__file__).parent / "page").glob("test_*.py"))
    if path.name not in _WITHOUT_BROWSER
}
"""Files whose tests share Playwright and its Chromiums, whose start takes as long as five tests."""

APART = {
    "tests/end_to_end/test_sensor_programs.py",
    "tests/simulator/test_town_traffic.py",
    "tests/world/many_worlds/test_batch.py",
}
"""Files whose long tests share nothing, and take up to minutes: together they would keep one process busy alone."""

MANY_GROUPS = 30
"""From so many files on, some start programs, and it saves time to import the package once for those of all forks."""

MANY_WORKERS = 3
"""From so many forks on, one of them begins with the last files."""

WORKER = "TEST_WORKER"
"""Environment variable: the number of this process among those that run tests."""

SEND_AFTER = 0.1
"""What a fork reports within so long is sent together [s]: to wake the first process for it costs half a short test."""

_CONTEXT = multiprocessing.get_context("fork")


@dataclass
class _Worker:
    """A fork, as the first process knows it.

    Attributes:
        running: the test that has begun and not ended, as its place in the list of all, else -1; the fork sets it.
        takes_last: it takes the groups from the end of the list.
        waiting: tests that it was given and has not reported.
    """

    process: BaseProcess
    running: ctypes.c_int
    takes_last: bool
    waiting: list[int] = field(default_factory=list)


class ForkedWorkers:
    """The pytest plugin that takes the place of pytest's own loop over the tests.

    Args:
        num_workers: how many processes run tests at the same time.
        num_listed: how many files are listed at the end.
        prepare: makes once what many tests need. The first forks do not wait for it: with programs to start, they need
            the least of it.
    """

    def __init__(
        self, num_workers: int, num_listed: int, prepare: Callable[[pytest.Session], None] = lambda _: None
    ) -> None:
        self._num_workers, self._num_listed = num_workers, num_listed
        self._prepare = prepare
        self._num_forked = 0
        self._origin: fork_server.ForkServer | None = None
        self._workers: dict[Connection, _Worker] = {}
        self._groups: list[list[int]] = []
        self._costs: dict[str, tuple[float, float]] = defaultdict(lambda: (0.0, 0.0))

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self, session: pytest.Session) -> None:
        """Begin with the import for programs while tests are collected, if all of them are."""
        is_whole = session.config.args_source == pytest.Config.ArgsSource.TESTPATHS
        if is_whole and not session.config.option.collectonly:
            self._origin = fork_server.ForkServer()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        """Run all tests in forks."""
        if session.testsfailed or session.config.option.collectonly:
            return None  # pytest's own loop knows what to say
        reporter = session.config.pluginmanager.get_plugin("terminalreporter")
        if reporter is not None:
            reporter.showfspath = False  # tests of several files end in turns
        is_long = session.config.getoption("long", default=False)
        self._groups = _groups_of(session.items, apart=APART if is_long else set())
        if self._origin is None and len(self._groups) > MANY_GROUPS:
            self._origin = fork_server.ForkServer()
        try:
            self._run(session)
        finally:
            for connection, worker in self._workers.items():
                os.kill(worker.process.pid or 0, signal.SIGINT)  # as Ctrl-C does: what it has started is stopped
                connection.close()
            for worker in self._workers.values():
                worker.process.join()
            if self._origin is not None:
                self._origin.close()
        return True

    def _run(self, session: pytest.Session) -> None:
        num_wanted = min(self._num_workers, len(self._groups))
        while len(self._workers) < num_wanted:
            if len(self._workers) == num_wanted // 2:
                self._prepare(session)
            self._fork(session)
        while self._workers:
            for connection in wait(list(self._workers)):
                self._hear(session, cast("Connection", connection))
                if session.shouldfail:
                    raise session.Failed(session.shouldfail)
                if session.shouldstop:
                    raise session.Interrupted(session.shouldstop)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """List the files that took longest."""
        costs = sorted(self._costs.items(), key=lambda cost: cost[1][::-1], reverse=True)
        terminalreporter.section(f"{self._num_listed} files that took longest")
        for file, (wall, cpu) in costs[: self._num_listed]:
            terminalreporter.write_line(f"{wall:6.1f} s, CPU time {cpu:6.1f} s  {file}")
        cpu = sum(cpu for _, cpu in self._costs.values())
        terminalreporter.write_line(f"CPU time of all: {cpu + time.process_time():.0f} s")

    def _fork(self, session: pytest.Session) -> None:
        ours, theirs = _CONTEXT.Pipe()
        running = _CONTEXT.RawValue(ctypes.c_int, -1)
        number = self._num_forked % self._num_workers
        server = None if self._origin is None else fork_server.ForkServer(self._origin)
        process = _CONTEXT.Process(
            target=_work,
            args=(session, theirs, running, [ours, *self._workers]),
            kwargs={"number": number, "server": server},
        )
        process.start()
        theirs.close()
        if server is not None:
            server.let_go()
        self._num_forked += 1
        self._workers[ours] = _Worker(process, running, takes_last=self._lacks_last_taker())

    def _lacks_last_taker(self) -> bool:
        """Whether a further fork takes groups from the end: one of three or more does.

        Programs that tests wait for stand at the beginning, and what computes alone at the end. One fork with work that
        never waits keeps the processors busy meanwhile.
        """
        is_last = len(self._workers) == self._num_workers - 1 >= MANY_WORKERS - 1
        return is_last and not any(worker.takes_last for worker in self._workers.values())

    def _hear(self, session: pytest.Session, connection: Connection) -> None:
        """Take the next messages of a fork."""
        worker, hook = self._workers[connection], session.config.hook
        try:
            messages = connection.recv()
        except (EOFError, ConnectionResetError):
            self._bury(session, connection)
            return
        for kind, value in messages:
            if kind == "report":
                report = hook.pytest_report_from_serializable(config=session.config, data=value)
                hook.pytest_runtest_logreport(report=report)
            elif kind == "warning":
                hook.pytest_warning_recorded.call_historic(kwargs=value)
            elif kind == "end":
                i, location = value
                worker.waiting.remove(i)
                hook.pytest_runtest_logfinish(nodeid=session.items[i].nodeid, location=location)
            elif kind == "cost":
                file, wall, cpu = value
                self._costs[file] = self._costs[file][0] + wall, self._costs[file][1] + cpu
            else:  # it wants work
                worker.waiting = self._groups.pop(-1 if worker.takes_last else 0) if self._groups else []
                connection.send(list(worker.waiting))

    def _bury(self, session: pytest.Session, connection: Connection) -> None:
        """A fork has ended: in the midst of a test, that one has failed, and another fork runs the rest."""
        worker = self._workers.pop(connection)
        connection.close()
        worker.process.join()
        if worker.running.value >= 0:
            worker.waiting.remove(worker.running.value)
            item = session.items[worker.running.value]
            text = f"the process of the test ended with {worker.process.exitcode}"
            session.config.hook.pytest_runtest_logreport(
                report=pytest.TestReport(item.nodeid, item.location, {}, "failed", text, "call")
            )
        elif worker.process.exitcode:
            raise session.Failed(f"a process of tests ended between two of them with {worker.process.exitcode}")
        if worker.waiting:
            self._groups.insert(0, worker.waiting)
        if self._groups:
            self._fork(session)


def _groups_of(items: Iterable[pytest.Item], apart: Container[str]) -> list[list[int]]:
    """What is run in one process: the tests of a file, of several, or a single one; as places in the list of all."""
    groups: dict[str, list[int]] = defaultdict(list)
    for i, item in enumerate(items):
        file = _file_of(item)
        groups[item.nodeid if file in apart else TOGETHER.get(file, file)].append(i)
    return list(groups.values())


def _file_of(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]


# The side of a fork


def _work(
    session: pytest.Session,
    connection: Connection,
    running: ctypes.c_int,
    others: Iterable[Connection],
    *,
    number: int,
    server: fork_server.ForkServer | None,
) -> None:
    """Run the tests that the first process sends, until it sends none."""
    for other in others:
        other.close()
    if server is not None:
        fork_server.use(server)
    config = session.config
    os.environ[WORKER] = str(number)
    _have_own_files(config, number)
    config.pluginmanager.unregister(name="terminalreporter")
    sender = _Sender(config, connection)
    config.pluginmanager.register(sender)
    item: pytest.Item | None = None
    cpu = _cpu_time()
    try:
        while group := sender.ask():
            began = time.monotonic()
            for i, after in pairwise([*group, -1]):
                item, following = session.items[i], session.items[after] if after >= 0 else None
                running.value = i
                # Behind None all fixtures would end; behind the session, those of the file.
                config.hook.pytest_runtest_protocol(item=item, nextitem=following or session)
                running.value = -1
                sender.end(i, item)
                if following is None or _file_of(following) != _file_of(item):
                    before, cpu = cpu, _cpu_time()
                    sender.say("cost", (_file_of(item), time.monotonic() - began, cpu - before))
                    began = time.monotonic()
    except (KeyboardInterrupt, EOFError, BrokenPipeError, ConnectionResetError):
        connection.close()  # the first process was stopped, or has ended
    call = CallInfo.from_call(lambda: session._setupstate.teardown_exact(None), when="teardown")
    if item is not None and not connection.closed and call.excinfo is not None:
        report = config.hook.pytest_runtest_makereport(item=item, call=call)
        config.hook.pytest_runtest_logreport(report=report)
        sender.send()


def _cpu_time() -> float:
    """That of this process and of all that it has started [s]."""
    return cpu_time(os.getpid(), *fork_server.pids())


def _have_own_files(config: pytest.Config, number: int) -> None:
    """Give a fork its own folder, and its own files for what tests print."""
    factory = cast("pytest.TempPathFactory", config._tmp_path_factory)  # type: ignore[attr-defined]
    factory._basetemp = factory.getbasetemp() / f"worker{number}"
    factory._basetemp.mkdir(exist_ok=True)
    capture: Any = config.pluginmanager.get_plugin("capturemanager")
    capture.stop_global_capturing()
    capture.start_global_capturing()
    capture.suspend_global_capture(in_=True)


class _Sender:
    """The pytest plugin of a fork that sends what happens to the first process: of many short tests together."""

    def __init__(self, config: pytest.Config, connection: Connection) -> None:
        self._config, self._connection = config, connection
        self._messages: list[tuple[str, object]] = []
        self._sent = time.monotonic()
        self._has_failed = False

    def ask(self) -> list[int]:
        """The next tests to run."""
        self.say("ask", None)
        self.send()
        group: list[int] = self._connection.recv()
        return group

    def say(self, kind: str, value: object) -> None:
        """Have a message sent soon."""
        self._messages.append((kind, value))

    def end(self, i: int, item: pytest.Item) -> None:
        """Have it sent that a test has ended: at once if it has failed. What is lost with this process is run again."""
        self.say("end", (i, item.location))  # which is known here, and takes a tenth of a short test to find
        if self._has_failed or time.monotonic() - self._sent > SEND_AFTER:
            self.send()

    def send(self) -> None:
        """Send what is not sent yet."""
        self._connection.send(self._messages)
        self._messages, self._sent, self._has_failed = [], time.monotonic(), False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Have a report sent."""
        self._has_failed |= report.failed
        self.say("report", self._config.hook.pytest_report_to_serializable(config=self._config, report=report))

    def pytest_warning_recorded(self, warning_message: Any, when: str, nodeid: str, location: Any) -> None:  # noqa: ANN401 - as pytest has it
        """Have a warning sent."""
        value = {"warning_message": warning_message, "when": when, "nodeid": nodeid, "location": location}
        self.say("warning", value)
