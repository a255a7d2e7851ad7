"""The time that everything is stamped with: one choice for a process.

A program on the far side compares our stamps with its own clock. That is simulated time where `/use_sim_time` is true,
and the time of day elsewhere; with the other one its transforms and message filters find nothing. So `auto` asks the
first far bridge that is to be told of us, once, and before anything is announced there. What was settled is never
changed: a clock that jumps hurts every program that listens. A bridge that disagrees is told of in the log.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Final, Literal

__all__ = ["PARAMETER", "Stamps", "says_simulated"]

PARAMETER: Final = "/use_sim_time"
"""The parameter by which programs of ROS 1 choose their clock."""


class Stamps:
    """The choice of one process.

    Attributes:
        is_open: it depends on a bridge that has not been asked yet; simulated time goes out meanwhile.
        is_wall: the time of day goes out.
    """

    def __init__(self, choice: Literal["sim", "wall", "auto"], use_wall: Callable[[float], None]) -> None:
        """The user's choice, which holds from now on.

        Args:
            choice: the time to use; `auto` leaves it to the first bridge.
            use_wall: called with monotonic time [s], once, when the time of day is to go out; perhaps now.
        """
        self.is_open = choice == "auto"
        self.is_wall = False
        self._use_wall = use_wall
        if choice == "wall":
            self._begin_wall(0.0)

    def settle(self, now: float, *, is_simulated: bool) -> None:
        """Have what a bridge says hold from now on; without effect once it is settled."""
        if self.is_open:
            self.is_open = False
            if not is_simulated:
                self._begin_wall(now)

    def _begin_wall(self, now: float) -> None:
        self.is_wall = True
        self._use_wall(now)


def says_simulated(value: object) -> bool:
    """Return whether a value of the parameter, as rosapi tells it in JSON, makes programs use simulated time.

    True and 1 do. A parameter that is not set is null, or an empty text, by the kind of server.
    """
    try:
        return isinstance(value, str) and bool(json.loads(value) == 1)
    except (ValueError, RecursionError):
        return False
