"""Lock step without ticks: after each frame the world waits until the egos that clients drive have been commanded.

It is for nodes of ROS 2, which cannot call the services of synchronous mode. A command belongs to a frame

- if its `header.stamp` is the frame's, that is its `/clock`;
- if it has no header, or a stamp of 0, and came after the topics of the frame were written.

The world waits for each ego that a client has commanded before, and for the first ego as long as there is none. An ego
that no client may command now is not waited for. At the deadline the frame goes on without: the last command holds. A
wait belongs to real time: ticks, `/sim/step` and a pause know nothing of it.
"""

from __future__ import annotations

import logging
import math

import msgspec

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.egos.ego import CtrlMode, Ego
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts

_log = logging.getLogger("rosbridge_sim.morai")


class CommandWait:
    """The wait of real time for the commands of a frame.

    Attributes:
        is_on: the world runs in lock step with commands.
        num_missed: frames that went on without a command.
    """

    def __init__(self, parts: SimulatorParts, deadline: float | None) -> None:
        """Wait for the first command.

        Args:
            deadline: longest wait for the commands of a frame [s]; None turns the lock step off.
        """
        self.is_on = deadline is not None
        self.num_missed = 0
        self._deadline = deadline or 0.0
        self._bus, self._egos, hooks = parts.bus, parts.egos, parts.hooks
        self._commanded: set[int] = set()  # egos whose command of the last frame has come, by their numbers
        self._since: float | None = None  # when the wait began [s]
        self._other_stamp: int | None = None  # of the last command that did not belong to its frame [ns]
        if self.is_on:
            hooks.after_frame.append(self._begin)
            hooks.on_new_scene.append(self._begin)
            hooks.on_restore.append(self._begin)
            hooks.on_mode_change.append(self._begin_time)

    def note(self, ego: Ego, message: Struct) -> None:
        """Take note that an ego follows a command.

        Args:
            message: the command as it came.
        """
        if not self.is_on:
            return
        stamp_ns = _stamp_of(message)
        if stamp_ns in {0, self._bus.stamp_ns}:
            self._commanded.add(ego.index)
        else:
            self._other_stamp = stamp_ns

    def until(self, now: float) -> float:
        """Return when the next frame may begin at the latest [s]; minus infinity if it need not wait.

        Args:
            now: monotonic time [s]; the first call behind a frame begins its wait.
        """
        if not self.is_on or not self._missing():
            return -math.inf
        if self._since is None:
            self._since = now
        return self._since + self._deadline

    def end(self) -> None:
        """Take note that the next frame begins now; log the first one that does so without a command."""
        missing = self._missing() if self.is_on else []
        if not missing:
            return
        self.num_missed += 1
        if self.num_missed == 1:
            _log.warning(
                "no command for ego %s came within %g s of the frame at %s s; the last command holds, and each frame"
                " waits as long%s",
                ", ".join(str(ego.index) for ego in missing),
                self._deadline,
                _seconds(self._bus.stamp_ns),
                self._hint(),
            )

    def _missing(self) -> list[Ego]:
        """Return the egos whose command has not come yet."""
        # Those that clients may command in real time.
        egos = [ego for ego in self._egos if ego.is_there and ego.ctrl_mode is CtrlMode.EXTERNAL and not ego.moved_by]
        driven = [ego for ego in egos if ego.commander is not None]
        if not driven:
            driven = [ego for ego in egos if ego is self._egos.first]
        return [ego for ego in driven if ego.index not in self._commanded]

    def _hint(self) -> str:
        if self._other_stamp is None:
            return ""
        stamp = _seconds(self._other_stamp)
        return (
            f". The last command has header.stamp {stamp} s: copy the stamp of the message that it answers, or leave 0"
        )

    def _begin(self, _now: float = 0.0) -> None:
        self._commanded.clear()
        self._since = None

    def _begin_time(self, _now: float) -> None:
        """Count anew after a pause or a master."""
        self._since = None


def _stamp_of(message: Struct) -> int:
    """Return the stamp of a message's header [ns]; 0 if it has no header."""
    header = getattr(message, "header", None)
    if header is None:
        return 0
    seconds, nanoseconds = msgspec.structs.astuple(header.stamp)
    return int(seconds * 1_000_000_000 + nanoseconds)


def _seconds(stamp_ns: int) -> str:
    return f"{stamp_ns / 1e9:.2f}"
