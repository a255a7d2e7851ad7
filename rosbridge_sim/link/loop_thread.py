"""An event loop in its own thread, for callers without asyncio."""

from __future__ import annotations

import asyncio
import atexit
import concurrent.futures
import threading
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, TypeVar

T = TypeVar("T")


class LoopStoppedError(RuntimeError):
    """A call of a loop that has been stopped."""


class LoopCall(concurrent.futures.Future[T]):
    """A coroutine for the loop, for whose result a thread waits.

    It costs less than `asyncio.run_coroutine_threadsafe`, which passes the result through two futures and another round
    of the loop.
    """

    def __init__(self, work: Coroutine[Any, Any, T]) -> None:
        super().__init__()
        self._work = work
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start the coroutine; called in the loop."""
        self._task = asyncio.get_running_loop().create_task(self._carry_out())
        self._task.add_done_callback(self._note_end)

    def interrupt(self) -> None:
        """Cancel the coroutine; called in the loop."""
        if self._task is not None:
            self._task.cancel()

    async def _carry_out(self) -> None:
        try:
            self.set_result(await self._work)
        except BaseException as error:  # noqa: BLE001 - for the thread that waits
            self.set_exception(error)

    def _note_end(self, _task: asyncio.Task[None]) -> None:
        if not self.done():  # cancelled before its first step
            self._work.close()
            self.set_exception(asyncio.CancelledError())


class LoopThread:
    """A running event loop in its own thread. All methods but `stop` must be called from other threads.

    The thread is a daemon, so a program that forgets `stop` can still end; the interpreter then calls `stop` at exit.
    """

    def __init__(self, name: str) -> None:
        """Start the thread and wait until its loop runs.

        Args:
            name: name of the thread, for debuggers.
        """
        ready: concurrent.futures.Future[asyncio.AbstractEventLoop] = concurrent.futures.Future()
        self._lock = threading.Lock()  # work given to the loop just before its end is cancelled, not lost
        self._is_ending = False
        self._thread = threading.Thread(target=self._run_loop, args=(ready,), name=name, daemon=True)
        self._thread.start()
        self._loop = ready.result()
        atexit.register(self.stop)

    def _run_loop(self, ready: concurrent.futures.Future[asyncio.AbstractEventLoop]) -> None:
        # At its end, a runner cancels the tasks that are left, and closes the loop.
        with asyncio.Runner() as runner:
            runner.run(self._wait_for_end(ready))

    async def _wait_for_end(self, ready: concurrent.futures.Future[asyncio.AbstractEventLoop]) -> None:
        self._end = asyncio.Event()
        ready.set_result(asyncio.get_running_loop())
        await self._end.wait()

    @property
    def is_alive(self) -> bool:
        """True until `stop` is called."""
        return not self._is_ending

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine in the loop. An interrupt of the caller cancels it.

        Args:
            work: a coroutine that was not started.

        Returns:
            The result of the coroutine.

        Raises:
            LoopStoppedError: the loop is stopped, or was stopped during the call.
            RuntimeError: the caller is in the loop's own thread, and would wait for itself.
        """
        name = self._thread.name
        if threading.current_thread() is self._thread:
            work.close()
            raise RuntimeError(f"{name}: a call from the loop's own thread would wait for itself")
        with self._lock:
            if self._is_ending:
                work.close()
                raise LoopStoppedError(f"{name}: the loop has been stopped")
            call = LoopCall(work)
            self._loop.call_soon_threadsafe(call.start)
        try:
            return call.result()
        except asyncio.CancelledError:
            raise LoopStoppedError(f"{name}: the loop was stopped meanwhile") from None
        except BaseException:
            if not call.done():  # the caller was interrupted
                with suppress(RuntimeError):  # the loop is closed
                    self._loop.call_soon_threadsafe(call.interrupt)
            raise

    def call(self, function: Callable[[], T]) -> T:
        """Call a function in the loop's thread; errors as for `run`.

        Returns:
            The result of the function.
        """

        async def work() -> T:
            return function()

        return self.run(work())

    def stop(self) -> None:
        """Cancel all tasks of the loop, and end the thread. A second call does nothing."""
        atexit.unregister(self.stop)
        with self._lock:
            if not self._is_ending:
                self._is_ending = True
                self._loop.call_soon_threadsafe(self._end.set)
        if threading.current_thread() is not self._thread:
            self._thread.join()
