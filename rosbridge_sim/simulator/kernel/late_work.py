"""Work for a client's message that waits for turns of its own: all of it at once would delay the other clients.

A large message fills a turn by its decoding alone. What it brings about is done in the passes of the event loop that
follow, one part in every second one. In the passes between, the world moves, so no flood of messages stops it. The
client is held meanwhile, so its messages take effect in their order. The last part alone changes something.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from typing import Final

from rosbridge_sim.errors import PeerError
from rosbridge_sim.graph.guard import Guard
from rosbridge_sim.graph.participant import Notify, Participant
from rosbridge_sim.simulator.kernel.sync_driver import SyncDriver

MAX_WAITING: Final = 8
"""Works that wait at most, because each holds a message of up to 20 MB. Further ones are done at once, each in the turn
of its client."""

Parts = Generator[None, None, None]
"""Does a part of some work up to each `yield`; it raises a PeerError for a mistake of the client."""


class LateWork:
    """The work of all clients that waits, oldest first.

    Attributes:
        waiting: the parts of each work, and what releases its client.
        has_turns: an event loop calls `take_turn`; otherwise all parts are done at once.
    """

    def __init__(self, sync_driver: SyncDriver, guard: Guard) -> None:
        """Wait for nothing.

        Args:
            guard: notes internal errors, which end only the work that has them.
        """
        self.has_turns = False
        self._sync_driver = sync_driver
        self._guard = guard
        self.waiting: deque[tuple[Parts, Callable[[float], None]]] = deque()
        self._had_turn = False

    def do(self, parts: Parts, client: Participant, source: str) -> None:
        """Do some work, later if there are turns and not too much waits.

        Args:
            client: held until it is done, and told its mistakes.
            source: name of the topic or service, for these.

        Raises:
            PeerError: a mistake, if it is done at once.
        """
        if self.has_turns and len(self.waiting) < MAX_WAITING:
            told = _tell_mistakes(parts, client.notifier(), source)
            self.waiting.append((told, self._sync_driver.hold(client)))
        else:
            for _ in parts:
                pass

    def take_turn(self, now: float) -> bool:
        """Do one part of the oldest work, in every second call.

        Returns:
            False if none was done, because none waits or it is the world's turn.
        """
        self._had_turn = bool(self.waiting) and not self._had_turn
        if not self._had_turn:
            return False
        parts, release = self.waiting[0]
        try:
            next(parts)
        except StopIteration:
            self._end(release, now)
        except Exception as error:  # noqa: BLE001 - our own bug, whatever it is
            self._guard.note("a part of the work for a message", error)
            self._end(release, now)
        return True

    def _end(self, release: Callable[[float], None], now: float) -> None:
        self.waiting.popleft()
        release(now)


def _tell_mistakes(parts: Parts, notify: Notify, source: str) -> Parts:
    try:
        yield from parts
    except PeerError as error:
        notify("error", f"{source}: {error}")
