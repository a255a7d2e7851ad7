"""The commands that wait for their frames in synchronous mode; `sync` says which of them come in, and when."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Generic

from rosbridge_sim.simulator.sync.sync_parts import C


class WaitingCommands(Generic[C]):
    """Commands in the order in which they will be carried out: by frame, then by arrival.

    Attributes:
        queue: a heap of (frame, order of arrival, command); read only for others.
    """

    def __init__(self) -> None:
        self.queue: list[tuple[int, int, C]] = []
        self._num_arrived = 0
        self._unready: dict[C, int] = {}  # commands that wait and are not ready, with their frames

    def enter(self, command: C, frame: int) -> None:
        """Have a command carried out before the next frame, behind those that wait for it already.

        Call it just before `take_turn` carries out a tick to which the command belongs.

        Args:
            command: what `due` gives back.
        """
        self._num_arrived += 1
        heapq.heappush(self.queue, (frame + 1, self._num_arrived, command))

    def ready(self, command: C) -> None:
        """Note that a command that was not ready can now be carried out; one that was dropped is no error."""
        self._unready.pop(command, None)

    def withdraw(self, command: C) -> None:
        """Forget a command that was not ready; one that was dropped is no error."""
        if self._unready.pop(command, None) is not None:
            self.queue = [entry for entry in self.queue if entry[2] is not command]
            heapq.heapify(self.queue)

    def drop(self, is_void: Callable[[C], bool]) -> int:
        """Drop some of the waiting commands. Call `take_turn` afterwards, if one of them may have been not ready.

        Args:
            is_void: returns true for a command to drop.

        Returns:
            The number of dropped commands.
        """
        kept = [entry for entry in self.queue if not is_void(entry[2])]
        num_dropped = len(self.queue) - len(kept)
        if num_dropped:
            self._unready = {command: due for command, due in self._unready.items() if not is_void(command)}
            self.queue = kept
            heapq.heapify(self.queue)
        return num_dropped

    def due(self, frame: int) -> list[C]:
        """Remove and return the commands to be carried out before a frame.

        Args:
            frame: the frame to be computed.

        Returns:
            The commands, in their order.
        """
        due: list[C] = []
        while self.queue and self.queue[0][0] <= frame:
            due.append(heapq.heappop(self.queue)[2])
        return due

    def waiting(self) -> list[tuple[int, C]]:
        """Return the commands that wait with their frames, in the order in which they will be carried out."""
        return [(frame, command) for frame, _, command in sorted(self.queue, key=lambda entry: entry[:2])]

    @property
    def has_unready(self) -> bool:
        """Return whether a command that waits cannot be carried out yet."""
        return bool(self._unready)

    def _is_early(self, end: int) -> bool:
        """Return whether a command of a frame up to this one is not ready."""
        return bool(self._unready) and min(self._unready.values()) <= end
