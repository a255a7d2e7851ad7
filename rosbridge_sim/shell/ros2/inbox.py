"""Work that threads of a library hand to the event loop, in order and bounded."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Final

MAX_WAITING: Final = 64
"""Most pieces of work that wait for the loop; then the threads wait, and what they read from fills up and drops."""

MAX_BYTES: Final = 32 * 2**20
"""Most bytes of messages that wait for the loop; one more may be beyond it."""

BYTES_PER_TURN: Final = 32 * 1024
"""Messages that one turn of the loop takes [bytes]; the rest waits for the next one."""

LEAST_SIZE: Final = 1024
"""Bytes that a short piece counts as: at most 32 of them are done in one turn."""

_log = logging.getLogger("rosbridge_sim.ros2")


class Inbox:
    """Work for the event loop.

    Attributes:
        on_work: called in the loop after each turn with work.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.on_work: Callable[[], None] = lambda: None
        self._loop = loop
        self._owner = threading.get_ident()
        self._waiting: deque[tuple[Callable[[], None], int]] = deque()
        self._num_bytes = 0
        self._is_due = False
        self._is_stopped = False
        self._room = threading.Condition()

    def put(self, work: Callable[[], None], size: int = 0) -> None:
        """Have a function called in the loop. Another thread than the loop's waits until there is room.

        Args:
            work: the function.
            size: bytes that it holds.
        """
        with self._room:
            if threading.get_ident() != self._owner:
                self._room.wait_for(lambda: self._has_room or self._is_stopped)
            if self._is_stopped:
                return
            self._waiting.append((work, size))
            self._num_bytes += size
            is_due, self._is_due = self._is_due, True
        if not is_due:
            with suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._run)

    def stop(self) -> None:
        """Drop all work, and let all threads go on. A second call does nothing."""
        with self._room:
            self._is_stopped = True
            self._waiting.clear()
            self._room.notify_all()

    @property
    def _has_room(self) -> bool:
        return len(self._waiting) < MAX_WAITING and self._num_bytes <= MAX_BYTES

    def _run(self) -> None:
        """Do as much as one turn of the loop allows."""
        done = 0
        while done <= BYTES_PER_TURN:
            with self._room:
                if not self._waiting:
                    self._is_due = False
                    break
                work, size = self._waiting.popleft()
                self._num_bytes -= size
                self._room.notify()
            try:
                work()
            except Exception as error:  # noqa: BLE001 - an internal error in one piece must not stop the others
                _log.error("internal error in work for ROS 2", exc_info=error)
            done += max(size, LEAST_SIZE)
        else:
            self._loop.call_soon(self._run)
        self.on_work()
