"""Traffic lights as they are now: what each shows, where each intersection stands, and who has taken a light over.

What a light shows is a function of the frame alone: of when its intersection's cycle began, and of whether somebody has
forced it. Nothing is counted up, so nothing drifts. A step compares one number, and looks things up in the `plan` only
when some colour changes.

A forced group shows what it was told until its intersection comes to its next phase, or for ever where nothing runs it.
Setting an intersection's phase counts as coming to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import BoolArray, IntArray
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.signal_plan import UNSET, Lamp, SignalPlan

__all__ = ["Signals", "SignalsSnapshot", "light_ahead"]

NEVER: Final = 2**62
"""A frame that does not come."""


@dataclass(frozen=True, slots=True)
class SignalsSnapshot:
    """A copy of the state; the plan is shared, nobody writes into it."""

    plan: SignalPlan
    frame: int
    origin: IntArray
    forced: IntArray
    until: IntArray


class Signals:
    """The lights of a map at a frame.

    Attributes:
        plan: which there are.
        frame: what the rest is true for.
        shown: (lights,) int64, the sum of the lamps that are lit, or `UNSET`.
        phase: (controllers,) int64.
        may_enter: (lanes,) bool: no light forbids to enter; a yellow one does.
    """

    __slots__ = (
        "_forced",
        "_next_change",
        "_origin",
        "_spell",
        "_until",
        "frame",
        "may_enter",
        "phase",
        "plan",
        "shown",
    )

    def __init__(self, plan: SignalPlan, frame: int = 0) -> None:
        """All intersections at the beginning of their first phase, nothing forced."""
        self.plan = plan
        self._origin = np.full(len(plan.controllers), frame, dtype=np.int64)
        self._forced = np.zeros(plan.num_groups, dtype=np.int64)
        self._until = np.full(plan.num_groups, -1, dtype=np.int64)  # the frame at which it is free again
        self._next_change = NEVER
        self.show(frame)

    def advance(self, frame: int) -> None:
        """Be at a frame not before the one that it is at."""
        if frame < self._next_change:
            self.frame = frame
        else:
            self.show(frame)

    def show(self, frame: int) -> None:
        """Work everything out for a frame."""
        plan = self.plan
        self.frame = frame
        into = (frame - self._origin) % plan.cycle
        spell = self._spell = plan.spell.searchsorted(plan.base + into, side="right") - 1
        self.phase = plan.spell_phase[spell]
        value = np.full(plan.num_groups, UNSET, dtype=np.int64)
        run = np.flatnonzero(plan.controller >= 0)
        value[run] = plan.colours[spell[plan.controller[run]], plan.slot[run]]
        is_forced = self._until > frame
        value[is_forced] = self._forced[is_forced]

        self.shown = value[plan.group]
        is_warning = plan.is_warning & ~is_forced[plan.group]
        self.shown[is_warning] = Lamp.YELLOW
        ends = plan.spell_end[spell] - plan.base - into + frame
        changes = np.concatenate([ends[plan.num_phases > 0], self._until[is_forced]])
        self._next_change = int(changes.min(initial=NEVER))
        self._judge(is_forced)

    def _judge(self, is_forced: BoolArray) -> None:
        """Which lanes may be entered. What is dark or unset, or only warns, forbids nothing."""
        plan = self.plan
        light = plan.light_of_lane
        if not len(self.shown):
            self.may_enter = np.ones(len(light), dtype=bool)
            return
        shown = self.shown[light]
        is_silent = (light < 0) | (shown <= 0) | plan.is_warning[light] & ~is_forced[plan.group[light]]
        self.may_enter = is_silent | (shown & plan.pass_of_lane != 0)

    # Intersections

    def elapsed(self, controller: int) -> int:
        """For how many frames an intersection has been in its phase."""
        return self._into(controller) - int(self.plan.phase_start[self._spell[controller]])

    def remaining(self, controller: int) -> int:
        """In how many frames its next phase begins, yellow included."""
        return int(self.plan.phase_end[self._spell[controller]]) - self._into(controller)

    def phase_length(self, controller: int, phase: int) -> int:
        """How many frames a phase lasts, yellow included.

        Raises:
            IndexError: there is no such phase.
        """
        start, end = self._phase_span(controller, phase)
        return end - start

    def set_phase(self, controller: int, phase: int, elapsed: int = 0) -> None:
        """Put an intersection into a phase, so many frames after its beginning; nothing in it is forced any more.

        Raises:
            IndexError: there is no such phase.
            ValueError: it does not last that long.
        """
        start, end = self._phase_span(controller, phase)
        if not 0 <= elapsed < end - start:
            raise ValueError(f"phase {phase} has {end - start} frames, there is none {elapsed} after its beginning")
        self._origin[controller] = self.frame - start - elapsed
        self._until[self.plan.controller == controller] = -1
        self.show(self.frame)

    def _into(self, controller: int) -> int:
        return int((self.frame - self._origin[controller]) % self.plan.cycle[controller])

    def _phase_span(self, controller: int, phase: int) -> tuple[int, int]:
        """Where in the cycle a phase begins and ends."""
        plan = self.plan
        if not 0 <= phase < plan.num_phases[controller]:
            raise IndexError(f"{plan.controllers[controller].name} has no phase {phase}")
        base = int(plan.base[controller])
        first = int(plan.spell.searchsorted(base))
        spell = first + int(plan.spell_phase[first : first + self._num_spells(controller)].searchsorted(phase))
        return int(plan.phase_start[spell]), int(plan.phase_end[spell])

    def _num_spells(self, controller: int) -> int:
        base, cycle = self.plan.base[controller], self.plan.cycle[controller]
        return int(self.plan.spell.searchsorted(base + cycle) - self.plan.spell.searchsorted(base))

    # Lights

    def force(self, light: int, value: int) -> None:
        """Have a light, and all others of its group, show a sum of lamps until its intersection's next phase."""
        group = self.plan.group[light]
        controller = int(self.plan.controller[group])
        is_run = controller >= 0 and self.plan.num_phases[controller] > 0
        self._forced[group] = value
        self._until[group] = self.frame + self.remaining(controller) if is_run else NEVER
        self.show(self.frame)

    def release(self, light: int) -> None:
        """Hand a light and its group back."""
        self._until[self.plan.group[light]] = -1
        self.show(self.frame)

    # The whole of it

    def snapshot(self) -> SignalsSnapshot:
        """Return a copy that `restored` takes."""
        return SignalsSnapshot(self.plan, self.frame, self._origin.copy(), self._forced.copy(), self._until.copy())

    @classmethod
    def restored(cls, saved: SignalsSnapshot) -> Signals:
        """The lights as the snapshot has them; it stays good for another time."""
        signals = cls(saved.plan)
        signals._origin, signals._forced = saved.origin.copy(), saved.forced.copy()
        signals._until = saved.until.copy()
        signals.show(saved.frame)
        return signals

    def digest(self) -> bytes:
        """What distinguishes this state from another."""
        is_forced = self._until > self.frame
        forced = np.where(is_forced, self._forced, 0)
        until = np.where(is_forced, self._until, 0)
        into = (self.frame - self._origin) % self.plan.cycle
        return self.plan.digest + into.tobytes() + forced.tobytes() + until.tobytes()


def light_ahead(roads: Roads, plan: SignalPlan, lane: int, s: float, reach: float) -> int | None:
    """The light of the stop line that comes next for whoever is on a lane, or None.

    Lanes fork: then it is the nearest stop line on any of them. Of the lanes that begin there, the one that goes
    straightest on says which light; so somebody who has not said where he will turn is told of the main one.

    Args:
        roads: the lanes.
        plan: their lights.
        lane: where he is.
        s: how far along it [m].
        reach: how far ahead a stop line may be [m].
    """
    ahead = [(float(roads.length[lane]) - s, lane)]
    seen = {lane}
    while ahead:
        way, here = ahead.pop(0)
        if way > reach:
            return None
        following = roads.successors(here).tolist()
        lit = [other for other in following if plan.light_of_lane[other] >= 0]
        if lit:
            return int(plan.light_of_lane[min(lit, key=lambda other: abs(float(roads.turn[other])))])
        for other in following:
            if other not in seen:
                seen.add(other)
                ahead.append((way + float(roads.length[other]), other))
        ahead.sort()
    return None
