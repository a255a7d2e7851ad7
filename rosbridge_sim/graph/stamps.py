"""The clock for all stamps: one choice for the whole process.

A program on the far side compares our stamps with its own clock. That is simulated time if `/use_sim_time` is true, and
the time of day otherwise. With the wrong clock, its transforms and message filters find nothing. So `auto` asks the
first remote bridge once, before anything is announced there. The choice never changes after that, because a clock that
jumps breaks every program that listens. If another bridge has a different setting, the log says so.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Final, Literal

PARAMETER: Final = "/use_sim_time"
"""The parameter that selects the clock of ROS 1 programs."""


class Stamps:
    """The choice for one process.

    Attributes:
        is_open: a bridge still has to be asked; stamps are simulated time until then.
        is_wall: stamps are the time of day.
    """

    def __init__(self, choice: Literal["sim", "wall", "auto"], use_wall: Callable[[float], None]) -> None:
        """Set the user's choice.

        Args:
            choice: the clock to use; `auto` asks the first bridge.
            use_wall: called once with monotonic time [s] when stamps change to the time of day, perhaps now.
        """
        self.is_open = choice == "auto"
        self.is_wall = False
        self._use_wall = use_wall
        if choice == "wall":
            self._begin_wall(0.0)

    def settle(self, now: float, *, is_simulated: bool) -> None:
        """Use the clock of a bridge; no effect if the choice is already made.

        Args:
            is_simulated: programs there use simulated time.
        """
        if self.is_open:
            self.is_open = False
            if not is_simulated:
                self._begin_wall(now)

    def _begin_wall(self, now: float) -> None:
        self.is_wall = True
        self._use_wall(now)


def says_simulated(value: object) -> bool:
    """Return True if a value of the parameter makes programs use simulated time: True or 1.

    Args:
        value: value in rosapi's JSON; null or an empty text, by the kind of server, if the parameter is not set.
    """
    try:
        return isinstance(value, str) and bool(json.loads(value) == 1)
    except (ValueError, RecursionError):
        return False
