"""The state of a remote rosapi (present, lost or back), found from the answers to our calls.

No answer proves nothing, because a slow bridge answers late. A refusal shows that the service does not exist. A single
refusal may be a time-out inside the bridge, so two in a row count as a loss. A rosapi that never answered cannot be
lost.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

LOOK_PERIOD: Final = 5.0
"""Time between two calls that check if it is there [s]: short enough to notice a loss soon, long enough to be no load.
"""

LOST_PERIOD: Final = 1.0
"""Time between two calls while it does not answer [s]."""

MAX_REFUSALS: Final = 1
"""Refused calls in a row that do not count as a loss."""


class RosapiChange(Enum):
    """Result of an answer or a refusal."""

    NOTHING_NEW = "nothing new"
    LOST = "lost"
    BACK = "back"


class RosapiWatch:
    """The state of one remote rosapi.

    Attributes:
        due: when the next call should check it [s]; None while there is no connection.
    """

    def __init__(self) -> None:
        self.due: float | None = None
        self._is_known = self._is_lost = False
        self._num_refusals = 0

    def start(self, now: float) -> None:
        """Begin to watch, because everything is announced on a connection. A second call changes nothing."""
        if self.due is None:
            self.due = now + LOOK_PERIOD

    def stop(self) -> None:
        """Forget the state, because the connection is gone."""
        self.due = None
        self._is_known = self._is_lost = False
        self._num_refusals = 0

    def note_asked(self, now: float) -> None:
        """Note that a call was made or left out."""
        self.due = now + (LOST_PERIOD if self._is_lost else LOOK_PERIOD)

    def note_reply(self, now: float, *, is_answered: bool) -> RosapiChange:
        """Note the answer or refusal of a call.

        Args:
            is_answered: it was answered, not refused.

        Returns:
            The change that it shows.
        """
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
