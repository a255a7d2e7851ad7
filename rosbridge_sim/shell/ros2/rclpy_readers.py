"""The subscriptions of our node by rclpy, with a thread that takes their messages, and looks at the graph in between.

rclpy's executor makes its set of what to wait for anew, twice for each message, which took longer than all else. Here a
set lasts until a subscription comes or goes.
rclpy tells of no changes of the graph, so the thread compares it with what it was, ten times a second.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Final

from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.shell.ros2.rclpy_types import RclpyObject, no_events, rclpy_errors, rclpy_quality

PERIOD: Final = 0.1
"""Least time between two looks at the graph, and the time without messages after an internal error [s]."""

LOOK_SHARE: Final = 20
"""A look at the graph is followed by at least this many times its duration without one."""

_log = logging.getLogger("rosbridge_sim.ros2")


class RclpyReaders:
    """Subscriptions by topic. All methods are for the loop."""

    def __init__(self, library: RclpyObject, take: Callable[[str, bytes, int], None], look: Callable[[], None]) -> None:
        """Subscribe to nothing yet.

        Args:
            library: the node of rclpy.
            take: gets each message, in the thread: name of its topic on the graph, CDR, and when it was sent [ns].
            look: looks at the graph, in the thread.
        """
        from rclpy.callback_groups import MutuallyExclusiveCallbackGroup  # noqa: PLC0415 - only with --ros2-domain
        from rclpy.guard_condition import GuardCondition  # noqa: PLC0415

        self._library = library
        self._take = take
        self._look = look
        self._next_look = 0.0
        self._readers: dict[str, RclpyObject] = {}
        self._wake = GuardCondition(callback=None, callback_group=None, context=library.context)
        self._group = MutuallyExclusiveCallbackGroup()
        self._group.add_entity(self)
        self._group.beginning_execution(self)  # for ever, so that the executor leaves these subscriptions alone
        self._is_changed = self._is_stopped = False
        self._thread = threading.Thread(target=self._run, name="rclpy messages", daemon=True)

    def __contains__(self, far: str) -> bool:
        return far in self._readers

    def start(self) -> None:
        """Let messages come from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Take no more messages."""
        self._is_stopped = True
        self._change()
        if self._thread.is_alive():
            self._thread.join(timeout=0.5)  # `stop` of a server takes two seconds at most

    def open(self, far: str, found: RclpyObject, quality: Quality) -> None:
        """Subscribe to a topic.

        Args:
            far: its name on the graph.
            found: the class of its type.

        Raises:
            GraphError: the library refuses it.
        """
        with rclpy_errors():
            self._readers[far] = self._library.create_subscription(
                found,
                far,
                lambda _raw: None,
                rclpy_quality(quality),
                callback_group=self._group,
                event_callbacks=no_events(is_writer=False),
                raw=True,
            )
        self._change()

    def close(self, far: str) -> RclpyObject:
        """Take no more messages of a topic, and return what is to be destroyed."""
        reader = self._readers.pop(far)
        self._change()
        return reader

    def _change(self) -> None:
        self._is_changed = True
        self._wake.trigger()

    # The thread

    def _run(self) -> None:
        while not self._is_stopped:
            try:
                self._take_until_change()
            except Exception as error:  # noqa: BLE001 - a library, and what it calls: one error must not end all
                if self._is_stopped or not self._library.context.ok():
                    return
                _log.error("internal error in a message of rclpy", exc_info=error)
                time.sleep(PERIOD)

    def _take_until_change(self) -> None:
        """Take messages, and look at the graph, until a subscription comes or goes."""
        from rclpy.impl.implementation_singleton import rclpy_implementation  # noqa: PLC0415 - see above

        self._is_changed = False
        readers: dict[int, tuple[str, RclpyObject, RclpyObject]] = {}  # by the library's own identity
        with ExitStack() as held:  # so that none of them is destroyed meanwhile
            for far, reader in list(self._readers.items()):
                with suppress(rclpy_implementation.InvalidHandle):  # it has ended just now
                    held.enter_context(reader.handle)
                    readers[reader.handle.pointer] = far, reader.handle, reader.msg_type
            held.enter_context(self._library.context.handle)
            waiting = rclpy_implementation.WaitSet(len(readers), 1, 0, 0, 0, 0, self._library.context.handle)
            while not self._is_changed:
                waiting.clear_entities()
                waiting.add_guard_condition(self._wake.handle)
                for _, handle, _ in readers.values():
                    waiting.add_subscription(handle)
                waiting.wait(max(0, int((self._next_look - time.monotonic()) * 1e9)))
                for pointer in waiting.get_ready_entities("subscription"):
                    far, handle, found = readers[pointer]
                    taken = handle.take_message(found, True)  # noqa: FBT003 - of the library: as bytes
                    if taken is not None:
                        self._take(far, taken[0], taken[1]["source_timestamp"])
                start = time.monotonic()
                if start >= self._next_look:
                    self._look()
                    now = time.monotonic()
                    self._next_look = now + max(PERIOD, LOOK_SHARE * (now - start))
