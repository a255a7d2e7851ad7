"""An event loop in a thread of its own, for callers that block."""

from __future__ import annotations

import asyncio
import atexit
import concurrent.futures
import threading
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

__all__ = ["LoopStoppedError", "LoopThread"]

T = TypeVar("T")


class LoopStoppedError(RuntimeError):
    """Work for a loop that has been stopped."""


class LoopThread:
    """A running event loop in a thread of its own. All methods but `stop` are for other threads.

    The thread is a daemon, so a program that forgets `stop` can still end; the interpreter then calls it at its exit.
    """

    def __init__(self, name: str) -> None:
        """Start the thread and wait until its loop runs.

        Args:
            name: of the thread, for debuggers.
        """
        ready: concurrent.futures.Future[asyncio.AbstractEventLoop] = concurrent.futures.Future()
        self._lock = threading.Lock()  # what is handed to the loop before its end is known is cancelled, and not lost
        self._is_ending = False
        self._thread = threading.Thread(target=self._run_loop, args=(ready,), name=name, daemon=True)
        self._thread.start()
        self._loop = ready.result()
        atexit.register(self.stop)

    def _run_loop(self, ready: concurrent.futures.Future[asyncio.AbstractEventLoop]) -> None:
        # A runner cancels what is left in the loop at the end, and closes it.
        with asyncio.Runner() as runner:
            runner.run(self._wait_for_end(ready))

    async def _wait_for_end(self, ready: concurrent.futures.Future[asyncio.AbstractEventLoop]) -> None:
        self._end = asyncio.Event()
        ready.set_result(asyncio.get_running_loop())
        await self._end.wait()

    @property
    def is_alive(self) -> bool:
        """Whether `stop` has not been called yet."""
        return not self._is_ending

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine in the loop and return its result. An interrupt of the caller cancels it.

        Args:
            work: not started yet.

        Raises:
            LoopStoppedError: the loop has been stopped, or is stopped meanwhile.
            RuntimeError: the caller is in the loop's own thread, where it would wait for itself.
        """
        name = self._thread.name
        if threading.current_thread() is self._thread:
            work.close()
            raise RuntimeError(f"{name}: a call from the loop's own thread would wait for itself")
        with self._lock:
            if self._is_ending:
                work.close()
                raise LoopStoppedError(f"{name}: the loop has been stopped")
            future = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return future.result()
        except concurrent.futures.CancelledError:
            raise LoopStoppedError(f"{name}: the loop was stopped meanwhile") from None
        except BaseException:
            future.cancel()  # nothing, unless the caller was interrupted
            raise

    def call(self, function: Callable[[], T]) -> T:
        """Call a function in the loop's thread and return its result; errors as for `run`."""

        async def work() -> T:
            return function()

        return self.run(work())

    def stop(self) -> None:
        """Cancel what still runs in the loop, and end the thread; twice is no error."""
        atexit.unregister(self.stop)
        with self._lock:
            if not self._is_ending:
                self._is_ending = True
                self._loop.call_soon_threadsafe(self._end.set)
        if threading.current_thread() is not self._thread:
            self._thread.join()
