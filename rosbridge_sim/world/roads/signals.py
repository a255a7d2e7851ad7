"""Traffic lights as they are now: what each shows, the phase of each intersection, and which lights are forced.

What a light shows is a function of the frame alone: of when the cycle of its intersection began, and of whether it is
forced. Nothing is counted up, so nothing drifts. A step compares one number, and reads the `plan` only when some colour
changes.

A forced group keeps its value until the next phase of its intersection begins; without a controller it keeps it for
ever. Setting the phase of an intersection counts as its beginning.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, IntArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import UNSET, Lamp, SignalPlan

NEVER_FRAME: Final = 2**62
"""A frame that is never reached."""

FREE: Final = -1
"""Frame at which the forcing of a light ends, of a light that is not forced."""


class SignalsSnapshot(Record):
    """A copy of the state of all lights; the plan, which never changes, is shared."""

    plan: SignalPlan
    frame: int
    origin: IntArray
    forced: IntArray
    until: IntArray


class Look(NamedTuple):
    """The lights at a frame, or those of many worlds, (w, ...) each.

    Attributes:
        shown, may_enter: as in `Signals`.
        interval: (controllers,) int64, row of the present interval of the cycle.
        next_change: (), the first frame at which a light shows something else.
    """

    shown: IntArray
    may_enter: BoolArray
    interval: IntArray
    next_change: IntArray


def look_at(plan: SignalPlan, frame: int | IntArray, origin: IntArray, forced: IntArray, until: IntArray) -> Look:
    """Return what lights show at a frame, or those of many worlds, each at its own.

    Args:
        frame: the frame, or (w, 1) int64.
        origin: (controllers,) int64, or (w, controllers), frames at which the cycles began.
        forced: (groups,) int64, or (w, groups), values of those that are forced.
        until: the same shape, frames at which they are free again.
    """
    into = (frame - origin) % plan.cycle
    interval = plan.interval_start.searchsorted(plan.base + into, side="right") - 1
    value = np.full(forced.shape, UNSET, dtype=np.int64)
    run = np.flatnonzero(plan.controller >= 0)
    value[..., run] = plan.colours[interval[..., plan.controller[run]], plan.column[run]]
    is_forced = until > frame
    value = np.where(is_forced, forced, value)

    shown = value[..., plan.group]
    warns = plan.is_warning & ~is_forced[..., plan.group]
    shown[warns] = Lamp.YELLOW
    ends = plan.interval_end[interval] - plan.base - into + frame
    next_change = np.minimum(
        ends[..., plan.num_phases > 0].min(axis=-1, initial=NEVER_FRAME),
        np.where(is_forced, until, NEVER_FRAME).min(axis=-1, initial=NEVER_FRAME),
    )
    light = plan.light_of_lane
    if not len(plan.group):
        return Look(shown, np.ones((*shown.shape[:-1], len(light)), dtype=bool), interval, next_change)
    # A light that is dark or unset, or only warns, forbids nothing.
    colour = shown[..., light]
    is_silent = (light < 0) | (colour <= 0) | warns[..., light]
    return Look(shown, is_silent | (colour & plan.pass_of_lane != 0), interval, next_change)


class ShownLights:
    """The state of lights as drivers see it, of a map or of many worlds.

    Attributes:
        plan: of the lights; of many worlds, `light_of_lane` alone is repeated.
        shown, may_enter: as in `Signals`.
    """

    plan: SignalPlan
    shown: IntArray
    may_enter: BoolArray

    def advance(self, frame: int) -> None:
        """Move on to a frame, which is not before the present one."""
        raise NotImplementedError


class Signals(ShownLights):
    """The lights of a map at a frame.

    Attributes:
        frame: the frame that the other attributes are true for.
        shown: (lights,) int64, the sum of the lamps that are lit, or `UNSET`.
        phase: (controllers,) int64, number of the phase.
        may_enter: (lanes,) bool, no light forbids to enter; red and yellow forbid it.
    """

    def __init__(self, plan: SignalPlan, frame: int = 0) -> None:
        """Begin the first phase of all intersections, with no light forced.

        Args:
            frame: the present frame.
        """
        self.plan = plan
        self._origin = np.full(len(plan.controllers), frame, dtype=np.int64)
        self._forced = np.zeros(plan.num_groups, dtype=np.int64)
        self._until = np.full(plan.num_groups, FREE, dtype=np.int64)  # the frame at which it is free again
        self._next_change = NEVER_FRAME
        self.show(frame)

    def advance(self, frame: int) -> None:
        """Move on to a frame, which is not before the present one."""
        if frame < self._next_change:
            self.frame = frame
        else:
            self.show(frame)

    def show(self, frame: int) -> None:
        """Work out all attributes for a frame."""
        now = look_at(self.plan, frame, *self.timing)
        self.frame, self.shown, self.may_enter = frame, now.shown, now.may_enter
        self._interval, self.phase = now.interval, self.plan.interval_phase[now.interval]
        self._next_change = int(now.next_change)

    @property
    def timing(self) -> tuple[IntArray, IntArray, IntArray]:
        """The arguments of `look_at`: all that decides what will be shown; read only."""
        return self._origin, self._forced, self._until

    def next_changes(self) -> IntArray:
        """Return the frame at which each light shows something else, (lights,) int64; `NEVER_FRAME` if none is known.

        The forcing of a light counts as changed when it ends.
        """
        plan = self.plan
        at = np.full(plan.num_groups, NEVER_FRAME, dtype=np.int64)
        run = np.flatnonzero(plan.controller >= 0)
        controller = plan.controller[run]
        interval = self._interval[controller]
        after = plan.time_to_change()[interval, plan.column[run]]
        into = (self.frame - self._origin[controller]) % plan.cycle[controller]
        begun = self.frame - into + plan.interval_start[interval] - plan.base[controller]
        at[run] = np.where(after >= 0, begun + after, NEVER_FRAME)
        is_forced = self._until > self.frame
        at[is_forced] = self._until[is_forced]
        changes = at[plan.group]
        changes[plan.is_warning & ~is_forced[plan.group]] = NEVER_FRAME
        return changes

    # Intersections

    def elapsed(self, controller: int) -> int:
        """Return for how many frames an intersection has been in its phase."""
        return self._into(controller) - int(self.plan.phase_start[self._interval[controller]])

    def remaining(self, controller: int) -> int:
        """Return in how many frames the next phase of an intersection begins, yellow included."""
        return int(self.plan.phase_end[self._interval[controller]]) - self._into(controller)

    def phase_length(self, controller: int, phase: int) -> int:
        """Return how many frames a phase lasts, yellow included.

        Raises:
            IndexError: there is no such phase.
        """
        start, end = self._phase_span(controller, phase)
        return end - start

    def set_phase(self, controller: int, phase: int, elapsed: int = 0) -> None:
        """Set the phase of an intersection, and release all its lights.

        Args:
            controller: row of the controller.
            elapsed: how long the phase has lasted already [frames].

        Raises:
            IndexError: there is no such phase.
            ValueError: the phase does not last that long. Nothing has changed.
        """
        start, end = self._phase_span(controller, phase)
        if not 0 <= elapsed < end - start:
            raise ValueError(f"elapsed: expected 0..{end - start - 1} frames in phase {phase}, got {elapsed}")
        self._origin[controller] = self.frame - start - elapsed
        self._until[self.plan.controller == controller] = FREE
        self.show(self.frame)

    def _into(self, controller: int) -> int:
        """Return the frame of the cycle at which an intersection is."""
        return int((self.frame - self._origin[controller]) % self.plan.cycle[controller])

    def _phase_span(self, controller: int, phase: int) -> tuple[int, int]:
        """Return the frames of the cycle at which a phase begins and ends."""
        plan = self.plan
        if not 0 <= phase < plan.num_phases[controller]:
            raise IndexError(f"{plan.controllers[controller].name} has no phase {phase}")
        base = int(plan.base[controller])
        first = int(plan.interval_start.searchsorted(base))
        interval = first + int(plan.interval_phase[first : first + self._num_intervals(controller)].searchsorted(phase))
        return int(plan.phase_start[interval]), int(plan.phase_end[interval])

    def _num_intervals(self, controller: int) -> int:
        base, cycle = self.plan.base[controller], self.plan.cycle[controller]
        return int(self.plan.interval_start.searchsorted(base + cycle) - self.plan.interval_start.searchsorted(base))

    # Lights

    def force(self, light: int, value: int) -> None:
        """Force a light and all others of its group until the next phase of their intersection begins.

        Args:
            light: row of the light.
            value: a sum of `Lamp`; 0 for dark.
        """
        group = self.plan.group[light]
        controller = int(self.plan.controller[group])
        is_run = controller >= 0 and self.plan.num_phases[controller] > 0
        self._forced[group] = value
        self._until[group] = self.frame + self.remaining(controller) if is_run else NEVER_FRAME
        self.show(self.frame)

    def release(self, light: int) -> None:
        """End the forcing of a light and of its group; `light` is the row of the light."""
        self._until[self.plan.group[light]] = FREE
        self.show(self.frame)

    # The whole of it

    def snapshot(self) -> SignalsSnapshot:
        """Return a copy that `restored` takes; lights that show the same for ever have equal copies."""
        is_forced = self._until > self.frame
        into = (self.frame - self._origin) % self.plan.cycle
        forced, until = np.where(is_forced, self._forced, 0), np.where(is_forced, self._until, FREE)
        return SignalsSnapshot(self.plan, self.frame, self.frame - into, forced, until)

    @classmethod
    def restored(cls, saved: SignalsSnapshot) -> Signals:
        """Return the lights as a snapshot has them; the snapshot can be used again."""
        signals = cls(saved.plan)
        signals._origin, signals._forced, signals._until = (
            column.copy() for column in (saved.origin, saved.forced, saved.until)
        )
        signals.show(saved.frame)
        return signals

    def digest(self) -> bytes:
        """Return bytes that are equal for equal states, and for those alone."""
        is_forced = self._until > self.frame
        forced = np.where(is_forced, self._forced, 0)
        until = np.where(is_forced, self._until, 0)
        into = (self.frame - self._origin) % self.plan.cycle
        return self.plan.digest + into.tobytes() + forced.tobytes() + until.tobytes()


def light_ahead(roads: Roads, plan: SignalPlan, lane: int, s: float, reach: float) -> int | None:
    """Return the light of the next stop line for a vehicle on a lane.

    Where lanes fork it is the nearest stop line on any of them. Of the lanes that begin there, the straightest one
    gives the light: without a known turn it is the main one.

    Args:
        lane: row of the lane of the vehicle.
        s: arc length on the lane [m].
        reach: how far ahead a stop line may be [m].

    Returns:
        The row of the light; None where there is none within reach.
    """
    ahead = [(float(roads.length[lane]) - s, lane)]
    seen = {lane}
    while ahead:
        distance, here = ahead.pop(0)
        if distance > reach:
            return None
        following = roads.successors(here).tolist()
        lit = [other for other in following if plan.light_of_lane[other] >= 0]
        if lit:
            return int(plan.light_of_lane[min(lit, key=lambda other: abs(float(roads.turn[other])))])
        for other in following:
            if other not in seen:
                seen.add(other)
                ahead.append((distance + float(roads.length[other]), other))
        ahead.sort()
    return None
