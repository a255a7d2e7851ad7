"""Status messages of the server, as a client keeps them: the latest, and the errors that nobody has heard of yet."""

from __future__ import annotations

from collections import deque

from rosbridge_sim.client.frames import Frame
from rosbridge_sim.records import Record

MAX_STATUSES = 100
"""Number of status messages that are kept; the oldest are dropped first. A person reads fewer."""


class Status(Record):
    """A status message of the server, from a `status` frame.

    Attributes:
        level: `info`, `warning` or `error`.
        text: the message.
        op_id: id of the op that the message is about; None if the server does not name one.
    """

    level: str
    text: str
    op_id: str | None


class Statuses:
    """The status messages of one connection.

    Attributes:
        latest: oldest first.
        num: how many have come so far.
    """

    def __init__(self) -> None:
        self.latest: deque[Status] = deque(maxlen=MAX_STATUSES)
        self.num = 0
        self._refusals: dict[str, Status] = {}  # errors not raised yet, by the ids of their ops

    def note(self, frame: Frame) -> Status:
        """Keep the message of a `status` frame, and return it."""
        op_id = frame.get("id")
        status = Status(str(frame.get("level")), str(frame.get("msg")), None if op_id is None else str(op_id))
        self.latest.append(status)
        self.num += 1
        op_name = (status.op_id or "").partition(":")[0]
        if status.level == "error" and op_name != "call_service" and len(self._refusals) < MAX_STATUSES:
            self._refusals.setdefault(status.op_id or f"status:{self.num}", status)
        return status

    def take_refusal(self, op_id: str) -> Status | None:
        """Remove and return the error about an op; None if there is none."""
        return self._refusals.pop(op_id, None)

    def take_refusals(self) -> list[Status]:
        """Remove and return all errors, oldest first."""
        refusals, self._refusals = self._refusals, {}
        return list(refusals.values())
