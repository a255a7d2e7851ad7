"""An event loop in a thread of its own: results, errors and the end reach the caller."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from rosbridge_sim.link.loop_thread import LoopCall, LoopStoppedError, LoopThread
from tests.support import PATIENCE, ROOT


@pytest.fixture
def thread() -> Iterator[LoopThread]:
    thread = LoopThread("test")
    yield thread
    thread.stop()


async def echo(value: object) -> object:
    await asyncio.sleep(0)
    if isinstance(value, Exception):
        raise value
    return value


def test_results_and_errors_reach_the_caller(thread: LoopThread) -> None:
    assert thread.run(echo(3)) == 3
    with pytest.raises(KeyError):
        thread.run(echo(KeyError("x")))
    assert thread.call(threading.current_thread) is not threading.current_thread()


def test_call_from_its_own_thread_is_refused(thread: LoopThread) -> None:
    with pytest.raises(RuntimeError, match="test: a call from the loop's own thread would wait for itself"):
        thread.call(lambda: thread.call(threading.current_thread))


def test_stop_cancels_what_still_runs_and_twice_is_no_error(thread: LoopThread) -> None:
    has_begun = threading.Event()

    async def wait() -> None:
        has_begun.set()
        await asyncio.Event().wait()

    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(lambda: thread.run(wait()))
        assert has_begun.wait(PATIENCE)
        thread.stop()
        with pytest.raises(LoopStoppedError, match="was stopped meanwhile"):
            waiting.result(PATIENCE)
    thread.stop()
    with pytest.raises(LoopStoppedError, match="has been stopped"):
        thread.run(echo(3))
    assert not thread.is_alive


@pytest.mark.slow
def test_call_that_is_cancelled_before_its_first_step_ends_too() -> None:
    async def cancel(call: LoopCall[object]) -> None:
        call.start()
        call.interrupt()
        await asyncio.wait(asyncio.all_tasks() - {asyncio.current_task()})

    call = LoopCall(echo(3))
    asyncio.run(cancel(call))
    assert call.done()
    with pytest.raises(asyncio.CancelledError):
        call.result()


def test_program_that_forgets_to_stop_ends_all_the_same() -> None:
    program = (
        "from rosbridge_sim.link.loop_thread import LoopThread\n"
        "import asyncio\n"
        "async def wait():\n"
        "    try:\n"
        "        await asyncio.Event().wait()\n"
        "    finally:\n"
        "        print('cleaned up')\n"
        "async def begin():\n"
        "    global task\n"
        "    task = asyncio.create_task(wait())\n"
        "    await asyncio.sleep(0)\n"
        "LoopThread('test').run(begin())\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "cleaned up\n", "")
