"""The state of a far side's rosapi (there, lost or back), found from what becomes of our calls to it.

Silence says nothing: a far side that is slow answers late. A refusal says that nobody serves the call. A single one may
be a time-out over there, so two in a row are a loss. Rosapi that never answered cannot be lost.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

__all__ = ["LOOK_PERIOD", "LOST_PERIOD", "RosapiChange", "RosapiWatch"]

LOOK_PERIOD: Final = 5.0
"""Between two calls that show that it is there [s]: a loss is noticed soon, and the calls are no load."""

LOST_PERIOD: Final = 1.0
"""Between two calls while it does not answer [s]."""

MAX_REFUSALS: Final = 1
"""Refused calls in a row that are no loss."""


class RosapiChange(Enum):
    """News that an answer or a refusal brings."""

    NOTHING_NEW = "nothing new"
    LOST = "lost"
    BACK = "back"


class RosapiWatch:
    """The state of one far side's rosapi.

    Attributes:
        due: when a call should show how it is [s]; None while there is no connection.
    """

    def __init__(self) -> None:
        """Nothing is connected."""
        self.due: float | None = None
        self._is_known = self._is_lost = False
        self._num_refusals = 0

    def start(self, now: float) -> None:
        """There is a connection on which all is announced; a second one changes nothing."""
        if self.due is None:
            self.due = now + LOOK_PERIOD

    def stop(self) -> None:
        """The connection is gone; the next one begins with nothing known."""
        self.due = None
        self._is_known = self._is_lost = False
        self._num_refusals = 0

    def note_asked(self, now: float) -> None:
        """A call was made, or its turn was passed over."""
        self.due = now + (LOST_PERIOD if self._is_lost else LOOK_PERIOD)

    def note_reply(self, now: float, *, is_answered: bool) -> RosapiChange:
        """A call was answered or refused."""
        if is_answered:
            was_lost, self._is_lost = self._is_lost, False
            self._is_known, self._num_refusals = True, 0
            return RosapiChange.BACK if was_lost else RosapiChange.NOTHING_NEW
        if not self._is_known or self._is_lost:
            return RosapiChange.NOTHING_NEW
        self._num_refusals += 1
        if self.due is not None:
            self.due = min(self.due, now + LOST_PERIOD)
        self._is_lost = self._num_refusals > MAX_REFUSALS
        return RosapiChange.LOST if self._is_lost else RosapiChange.NOTHING_NEW
