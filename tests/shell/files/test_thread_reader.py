"""Results of reads in threads return on the event loop: once, in time, and not after the end."""

from __future__ import annotations

import asyncio
import sys
import threading
import weakref
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files import thread_reader as reading
from rosbridge_sim.shell.files.thread_reader import MAX_THREADS, ThreadReader
from tests.support import PATIENCE

Outcome = str | DocumentError


class ReaderFixture:
    """A reader, and what it has handed over.

    Attributes:
        got: outcomes, in order.
    """

    def __init__(self, patience: float = reading.READ_PATIENCE) -> None:
        self.reader = ThreadReader(asyncio.get_running_loop(), patience)
        self.got: list[Outcome] = []
        self._changed = asyncio.Event()
        self.reader.on_done = self._changed.set

    def read(self, work: Callable[[], str]) -> None:
        self.reader.read(work, lambda outcome, _now: self.got.append(outcome), 0.0)

    async def until(self, num: int) -> None:
        async with asyncio.timeout(PATIENCE):
            while len(self.got) < num:
                self._changed.clear()
                await self._changed.wait()


class BlockedWork:
    """Work that takes until it is let go."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.has_begun = threading.Event()
        self.may_end = threading.Event()

    def __call__(self) -> str:
        self.has_begun.set()
        assert self.may_end.wait(PATIENCE)
        return self.text


async def test_work_runs_in_a_thread_and_its_result_returns_on_the_loop() -> None:
    desk = ReaderFixture()
    threads: list[int] = []
    here = threading.get_ident()

    def work() -> str:
        threads.append(threading.get_ident())
        return "read"

    desk.reader.read(work, lambda outcome, _now: desk.got.extend([outcome, str(threading.get_ident())]), 0.0)
    assert desk.got == []
    await desk.until(2)
    assert desk.got == ["read", str(here)]
    assert threads != [here]


async def test_document_error_is_returned_as_the_result() -> None:
    desk = ReaderFixture()

    def work() -> str:
        raise DocumentError("torn.json: it ends too soon")

    desk.read(work)
    await desk.until(1)
    assert str(desk.got[0]) == "torn.json: it ends too soon"
    assert desk.reader.num_bugs == 0


async def test_internal_failure_in_the_thread_still_answers(caplog: pytest.LogCaptureFixture) -> None:
    desk = ReaderFixture()

    def work() -> str:
        raise ZeroDivisionError

    desk.read(work)
    await desk.until(1)
    assert isinstance(desk.got[0], DocumentError)
    assert desk.reader.num_bugs == 1
    assert "ZeroDivisionError" in caplog.text


async def test_internal_failure_of_a_callback_is_counted_and_others_go_on(caplog: pytest.LogCaptureFixture) -> None:
    desk = ReaderFixture()

    def fail(_outcome: Outcome, _now: float) -> None:
        raise ZeroDivisionError

    desk.reader.read(lambda: "lost", fail, 0.0)
    desk.read(lambda: "read")
    await desk.until(1)
    assert desk.got == ["read"]
    assert desk.reader.num_bugs == 1
    assert "ZeroDivisionError" in caplog.text


async def test_number_of_threads_is_bounded_and_others_wait_in_order() -> None:
    desk = ReaderFixture()
    gates = [BlockedWork(str(i)) for i in range(MAX_THREADS + 3)]
    for gate in gates:
        desk.read(gate)
    first, waiting = gates[:MAX_THREADS], gates[MAX_THREADS:]
    for gate in first:
        assert await asyncio.to_thread(gate.has_begun.wait, PATIENCE)
    assert not any(gate.has_begun.is_set() for gate in waiting)
    for gate in waiting:
        gate.may_end.set()
    first[0].may_end.set()
    await desk.until(1 + len(waiting))
    assert desk.got == ["0", *(gate.text for gate in waiting)]
    first[1].may_end.set()
    await desk.until(len(gates))


async def test_stalled_read_times_out_and_its_late_result_is_ignored() -> None:
    desk = ReaderFixture(patience=0.01)
    stuck = [BlockedWork("late") for _ in range(MAX_THREADS)]
    for gate in stuck:
        desk.read(gate)
    desk.read(lambda: "in vain")  # its turn does not come in time
    await desk.until(MAX_THREADS + 1)
    assert all("the disk has not answered for 0.01 s" in str(outcome) for outcome in desk.got)
    desk.reader._patience = PATIENCE
    desk.read(lambda: "in time")
    for gate in stuck:
        gate.may_end.set()
    await desk.until(MAX_THREADS + 2)
    assert desk.got[-1] == "in time"


async def test_no_result_is_delivered_after_the_end() -> None:
    desk = ReaderFixture()
    gates = [BlockedWork(str(i)) for i in range(MAX_THREADS + 1)]
    for gate in gates:
        desk.read(gate)
    desk.reader.stop()
    desk.read(gates[-1])
    for gate in gates:
        gate.may_end.set()
    for thread in list(desk.reader._threads):
        await asyncio.to_thread(thread.join, PATIENCE)
    await asyncio.sleep(0)
    assert desk.got == []
    assert not gates[-1].has_begun.is_set()


async def test_stop_interrupts_reads_without_waiting() -> None:
    desk = ReaderFixture()
    has_begun = threading.Event()

    def work() -> str:
        while True:  # a document without end
            has_begun.set()

    desk.read(work)
    assert await asyncio.to_thread(has_begun.wait, PATIENCE)
    (thread,) = desk.reader._threads
    desk.reader.stop()
    desk.reader.stop()
    await asyncio.to_thread(thread.join, PATIENCE)
    assert not thread.is_alive()
    assert desk.got == []


async def test_interrupt_within_a_callback_is_not_printed_and_comes_again() -> None:
    desk = ReaderFixture()
    has_begun, is_behind = threading.Event(), threading.Event()

    def wait_for_the_interrupt(_reference: object) -> None:
        while True:
            has_begun.set()

    def work() -> str:
        document = BlockedWork("")
        reference = weakref.ref(document, wait_for_the_interrupt)
        del document  # the interpreter drops what its callback raises, and tells the hook: here pytest's, which fails
        assert reference() is None
        while True:
            is_behind.set()

    desk.read(work)
    assert await asyncio.to_thread(has_begun.wait, PATIENCE)
    (thread,) = desk.reader._threads
    desk.reader.stop()
    assert await asyncio.to_thread(is_behind.wait, PATIENCE)
    for _ in range(20):  # it has half a second each time
        await asyncio.to_thread(reading._await_end, [thread])
    assert not thread.is_alive()


async def test_stop_leaves_no_half_imported_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    desk, gate = ReaderFixture(), BlockedWork("")
    (tmp_path / "slow_library.py").write_text("import sys\nfor i in range(3):\n    sys.slow_gate()\nis_whole = True\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "slow_gate", gate, raising=False)

    def work() -> str:
        import_module("slow_library")
        return ""

    desk.read(work)
    assert await asyncio.to_thread(gate.has_begun.wait, PATIENCE)
    (thread,) = desk.reader._threads
    desk.reader.stop()
    gate.may_end.set()
    await asyncio.to_thread(thread.join, PATIENCE)
    assert sys.modules.pop("slow_library").is_whole
    assert desk.got == []
