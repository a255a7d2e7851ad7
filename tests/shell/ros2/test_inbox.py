"""Work from threads for the event loop: its order, its bounds, and its end."""

from __future__ import annotations

import asyncio
import logging
import threading

import pytest

from rosbridge_sim.shell.ros2.inbox import BYTES_PER_TURN, MAX_BYTES, MAX_WAITING, Inbox


async def in_thread(inbox: Inbox, done: list[int], num: int, size: int = 0) -> threading.Thread:
    """Start a thread that puts pieces of work into an inbox."""

    def put_all() -> None:
        for i in range(num):
            inbox.put(lambda i=i: done.append(i), size)  # type: ignore[misc] # a default of a lambda has no type

    thread = threading.Thread(target=put_all, daemon=True)
    thread.start()
    return thread


async def some_turns() -> None:
    """Let the loop do more turns than any work here takes."""
    for _ in range(20 * MAX_WAITING):
        await asyncio.sleep(0)


async def until_ended(thread: threading.Thread) -> None:
    await asyncio.get_running_loop().run_in_executor(None, thread.join)
    await asyncio.sleep(0)


async def test_everything_is_done_in_order_though_the_thread_has_to_wait() -> None:
    inbox = Inbox(asyncio.get_running_loop())
    done: list[int] = []
    turns: list[int] = []
    inbox.on_work = lambda: turns.append(len(done))
    await until_ended(await in_thread(inbox, done, 10 * MAX_WAITING))
    await some_turns()
    assert done == list(range(10 * MAX_WAITING))
    assert len(turns) > 10, "one turn does not do it all"


@pytest.mark.parametrize(("size", "most"), [(0, MAX_WAITING), (MAX_BYTES // 2, 3)])
async def test_a_thread_waits_while_too_much_is_undone(size: int, most: int) -> None:
    loop = asyncio.get_running_loop()
    inbox = Inbox(loop)
    done: list[int] = []
    thread = await in_thread(inbox, done, most + 1, size)
    thread.join(0.2)  # the loop does nothing meanwhile
    assert thread.is_alive()
    await until_ended(thread)


async def test_the_loop_s_own_work_never_waits_and_an_error_stops_no_other(caplog: pytest.LogCaptureFixture) -> None:
    inbox = Inbox(asyncio.get_running_loop())
    done: list[int] = []

    def fail() -> None:
        raise ValueError("a bug")

    for i in range(MAX_WAITING + 2):
        inbox.put(fail if i == 0 else lambda i=i: done.append(i))  # type: ignore[misc] # as above
    with caplog.at_level(logging.ERROR):
        await some_turns()
    assert done == list(range(1, MAX_WAITING + 2))
    assert "internal error" in caplog.text


async def test_large_messages_take_a_turn_each() -> None:
    inbox = Inbox(asyncio.get_running_loop())
    done: list[int] = []
    for i in range(3):
        inbox.put(lambda i=i: done.append(i), BYTES_PER_TURN + 1)  # type: ignore[misc] # as above
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert len(done) < 3
    await some_turns()
    assert done == [0, 1, 2]


async def test_stopping_lets_waiting_threads_go_on() -> None:
    inbox = Inbox(asyncio.get_running_loop())
    done: list[int] = []
    thread = await in_thread(inbox, done, MAX_WAITING + 1)
    inbox.stop()
    await until_ended(thread)
    inbox.put(lambda: done.append(-1))
    await asyncio.sleep(0)
    assert -1 not in done
