"""Topic messages that wait for a remote bridge and are replaced by newer ones if it does not keep up.

While the bridge keeps up, all messages leave in the order of their publication. Once the oldest has waited for
MAX_WAIT, the bridge is *behind*: then only the newest message of each topic is kept. They leave in rounds. In each
round every topic that has a message gets its turn once, small messages before large ones, because a program that
controls a car needs its state more than a list of all objects. Without rounds the smallest topics would take all turns.
The bridge has caught up when no message is left.
"""

from __future__ import annotations

from collections import Counter, deque
from typing import Final, NamedTuple

from rosbridge_sim.graph.attach.flow_control import AIM

MAX_WAIT: Final = AIM
"""Longest wait of a message while all are kept [s]: as long as the bridge itself may need, so that a burst of many
frames at once still arrives whole at a bridge that is fast."""


class WaitingMessage(NamedTuple):
    """A message that waits.

    Attributes:
        topic: name of its topic.
        frame: the message.
        since: monotonic time of its publication [s].
    """

    topic: str
    frame: bytes
    since: float


class FreshMessages:
    """The waiting messages of one socket.

    Attributes:
        is_behind: only the newest message of each topic is kept.
        num_offered: number of messages so far.
        dropped: topic -> number of messages that a newer one has replaced.
    """

    def __init__(self, max_bytes: int) -> None:
        """Begin without messages.

        Args:
            max_bytes: if more waits, it is behind [bytes]; the newest message of each topic always stays.
        """
        self.is_behind = False
        self.num_offered = 0
        self.dropped: Counter[str] = Counter()
        self._max_bytes = max_bytes
        self._all: deque[WaitingMessage] = deque()  # while it keeps up, oldest first
        self._num_bytes = 0  # of these
        self._newest: dict[str, WaitingMessage] = {}  # while it is behind
        self._round: list[str] = []  # topics that still have a turn, the next one last

    def __len__(self) -> int:
        return len(self._newest) if self.is_behind else len(self._all)

    def offer(self, message: WaitingMessage) -> None:
        """Add a message."""
        self.num_offered += 1
        if self.is_behind:
            self._replace(message)
            return
        self._all.append(message)
        self._num_bytes += len(message.frame)
        if self._num_bytes > self._max_bytes or message.since - self._all[0].since > MAX_WAIT:
            self._fall_behind()

    def forget(self, topic: str) -> None:
        """Drop the messages of a topic, because it is not advertised any more."""
        self._newest.pop(topic, None)
        if any(one.topic == topic for one in self._all):
            self._all = deque(one for one in self._all if one.topic != topic)
            self._num_bytes = sum(len(one.frame) for one in self._all)

    def take(self, now: float) -> WaitingMessage | None:
        """Remove and return the next message; None if none waits."""
        if self._all and now - self._all[0].since > MAX_WAIT:
            self._fall_behind()
        if not self.is_behind:
            if not self._all:
                return None
            message = self._all.popleft()
            self._num_bytes -= len(message.frame)
            return message
        while True:
            while self._round:
                found = self._newest.pop(self._round.pop(), None)
                if found is not None:
                    return found
            if not self._newest:
                self.is_behind = False
                return None
            self._round = sorted(self._newest, key=lambda topic: (-len(self._newest[topic].frame), topic))

    def _fall_behind(self) -> None:
        self.is_behind = True
        waiting, self._all, self._num_bytes = self._all, deque(), 0
        for message in waiting:
            self._replace(message)

    def _replace(self, message: WaitingMessage) -> None:
        if message.topic in self._newest:
            self.dropped[message.topic] += 1
        self._newest[message.topic] = message
