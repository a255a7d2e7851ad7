"""The plan of a map's traffic lights: the lights, their controllers, and what they show at each moment of a cycle.

A *controller* runs an intersection through its phases, again and again. In a phase each of its groups has a colour. A
group whose green does not continue in the next phase then shows yellow for its own time, *after* the duration of the
phase, while the others keep their colour. The next phase begins when the longest of these yellows is over. A group that
keeps a part of its green (straight and left, then straight alone) shows yellow beside that part. A group that keeps
nothing and has a short yellow waits at red for the others. Pedestrian lights are green within a phase, from a given
time after its beginning, then they flash, then they are red.

All of this is worked out when the plan is made, as a table of *intervals* in which no colour changes. All times are
whole frames. What is lit at a given frame, and which lights are forced, is in `signals`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from enum import IntFlag
from functools import reduce
from hashlib import blake2b
from operator import or_
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.roads import Roads


class Lamp(IntFlag):
    """The lamps of a light; a sum of them says which are lit. The numbers are those of MORAI's messages."""

    RED = 1
    YELLOW = 4
    GREEN = 16  # straight ahead
    LEFT = 32
    RIGHT = 64
    U_TURN = 128
    UP_LEFT = 256
    UP_RIGHT = 512
    DOWN_LEFT = 1024
    DOWN_RIGHT = 2048


GREENS: Final = sum(int(lamp) for lamp in Lamp if lamp > Lamp.YELLOW)

UNSET: Final = -1
"""The value of a light that has no controller and is not forced."""

FLASH: Final = 25
"""A flashing light is lit for so long and dark for as long [frames]: one flash a second."""

_RED, _YELLOW, _GREEN = int(Lamp.RED), int(Lamp.YELLOW), int(Lamp.GREEN)


class Light(Record):
    """One traffic light.

    Attributes:
        name: as the map gives it.
        lamps: the lamps that it has, a sum of `Lamp`; with YELLOW alone all its lamps are yellow.
        is_pedestrian: it is for pedestrians.
        lanes: rows of the lanes that it controls: they begin at its stop line.
        x, y, z: position in the map frame [m].
        yaw: direction in which it shows, against the traffic that it controls [rad].
    """

    name: str
    lamps: int = _RED | _YELLOW | _GREEN
    is_pedestrian: bool = False
    lanes: tuple[int, ...] = ()
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0

    @property
    def is_warning(self) -> bool:
        """True if all its lamps are yellow: it then only warns, for any value of its group."""
        return self.lamps == _YELLOW


class Phase(Record):
    """One phase of a controller.

    Attributes:
        duration: without the yellows that follow, at least 1 [frames].
        colours: for each group a sum of `Lamp`.
    """

    duration: int
    colours: tuple[int, ...]


class Walk(Record):
    """The green time of the pedestrian lights of a group in a phase.

    Attributes:
        phase: number of the phase.
        group: number of the group.
        before: from the beginning of the phase to the green, not negative [frames].
        green: how long they are green [frames].
        flashing: how long they flash afterwards; then they are red [frames].
    """

    phase: int
    group: int
    before: int
    green: int
    flashing: int


class Controller(Record):
    """The controller of an intersection.

    Attributes:
        name: as the map gives it.
        number: the number by which clients name it.
        groups: rows of the lights that change together.
        phases: in turn; empty for none, then its lights are unset.
        yellow: for each group [frames].
        walks: for the pedestrian lights of its groups. Without a walk, pedestrian lights are red in a group that also
            has lights for cars, and show the group's colour in one that has none.
    """

    name: str
    number: int
    groups: tuple[tuple[int, ...], ...]
    phases: tuple[Phase, ...] = ()
    yellow: tuple[int, ...] = ()
    walks: tuple[Walk, ...] = ()


class _Group(Record):
    """Lights that show one value: those of a controller's group, pedestrian lights apart from the others."""

    controller: int
    number: int  # of the controller's group
    is_pedestrian: bool
    is_mixed: bool  # the controller's group has lights for pedestrians and for cars


class SignalPlan:
    """All lights of a map and their cycles; never changed after it is made.

    Lights show the same in *groups*: the lights of a controller's group, those for pedestrians apart from the others;
    or lights that belong together without a controller; or one light alone.

    Attributes:
        lights, controllers: as given.
        group: (lights,) int64, row of each light's group.
        controller: (groups,) int64, row of the controller of each group; -1 for none.
        is_warning: (lights,) bool, see `Light`.

        light_of_lane: (lanes,) int64, row of the light that controls whether one may enter; -1 for none.
        pass_of_lane: (lanes,) int64, a sum of lamps, any of which allows to enter.
        controller_of_lane: (lanes,) int64, row of the intersection that the lane lies in; -1 for none.
        is_before_light: (lanes,) bool, a light controls a lane that begins where this one ends.

        cycle: (controllers,) int64, frames of a whole cycle; 1 for a controller without phases.
        num_phases: (controllers,) int64.
        base: (controllers,) int64, where each controller's intervals begin on the one scale of `interval_start`.
        interval_start: (intervals,) int64, rising: `base` plus the frame of the cycle at which each interval begins.
        interval_end: (intervals,) int64, the same for its end.
        interval_phase: (intervals,) int64, number of the phase that it belongs to.
        phase_start, phase_end: (intervals,) int64, frames of the cycle at which that phase begins and ends.
        colours: (intervals, columns) int64, padded with `UNSET`; `column` (groups,) is the column of each group.

        digest: 16 bytes that stand for all of it.
    """

    def __init__(
        self,
        roads: Roads,
        lights: Sequence[Light] = (),
        controllers: Sequence[Controller] = (),
        *,
        together: Sequence[Sequence[int]] = (),
        passes: Sequence[int] | None = None,
    ) -> None:
        """Work out the tables.

        Args:
            roads: the lanes that the lights control.
            controllers: those of its intersections. A light that two of them name belongs to the first.
            together: rows of lights that belong together without a controller.
            passes: for each lane a sum of the lamps that allow to enter it; None for GREEN everywhere. Where the light
                of a lane never shows any of them, GREEN allows it too.

        Raises:
            ValueError: a phase lacks a colour for a group, a yellow is missing, or a walk names no phase or group.
        """
        self.lights, self.controllers = tuple(lights), tuple(controllers)
        self._rows = {light.name: i for i, light in reversed(list(enumerate(self.lights)))}
        self.is_warning = np.array([light.is_warning for light in self.lights], dtype=bool)
        groups = self._form_groups(together)
        self.num_groups = len(groups)
        self.controller = np.array([group.controller for group in groups], dtype=np.int64)
        self._lay_intervals(groups)
        self._bind_lanes(roads, passes)
        self._time_to_change: IntArray | None = None
        self.digest = self._hash()

    def light(self, name: str) -> int:
        """Return the row of the light with this name.

        Raises:
            KeyError: there is no such light.
        """
        return self._rows[name]

    def with_controllers(self, roads: Roads, controllers: Sequence[Controller]) -> SignalPlan:
        """Return a plan with the same lights on the same roads, and other controllers; errors as for a new plan."""
        free = [group for group in range(self.num_groups) if self.controller[group] < 0]
        together = [np.flatnonzero(self.group == group).tolist() for group in free]
        return SignalPlan(roads, self.lights, controllers, together=together, passes=self.pass_of_lane.tolist())

    def time_to_change(self) -> IntArray:
        """Return the frames from the beginning of each interval to the next change of each column of `colours`.

        Returns:
            (intervals, columns) int64; -1 where the colour never changes.
        """
        if self._time_to_change is None:
            first = self.interval_start.searchsorted(self.base)
            num = self.interval_start.searchsorted(self.base + self.cycle) - first
            length = (self.interval_end - self.interval_start)[:, None]
            table = np.full(self.colours.shape, -1, dtype=np.int64)
            # Backwards through the intervals of all cycles at once; the second round joins the end with the beginning.
            for back in range(2 * int(num.max(initial=0))):
                here, following = first + (-1 - back) % num, first + -back % num
                later = table[following]
                on = np.where(later >= 0, later + length[here], -1)
                table[here] = np.where(self.colours[here] == self.colours[following], on, length[here])
            self._time_to_change = table
        return self._time_to_change

    def lamps_of_group(self, light: int) -> int:
        """Return the lamps that the lights of a light's group have together, a sum of `Lamp`."""
        return reduce(or_, (self.lights[row].lamps for row in np.flatnonzero(self.group == self.group[light])))

    def _form_groups(self, together: Sequence[Sequence[int]]) -> list[_Group]:
        """Return all groups, and set `group`; each light is in the first group that names it."""
        groups: list[_Group] = []
        self.group = np.full(len(self.lights), -1, dtype=np.int64)

        def form(rows: Sequence[int], controller: int = -1, number: int = -1) -> None:
            free = [row for row in dict.fromkeys(rows) if self.group[row] < 0]
            walkers = [row for row in free if self.lights[row].is_pedestrian]
            others = [row for row in free if not self.lights[row].is_pedestrian]
            for part in (others, walkers):
                if part:
                    self.group[part] = len(groups)
                    groups.append(_Group(controller, number, part is walkers, len(part) < len(free)))

        for i, controller in enumerate(self.controllers):
            _check(controller)
            for number, members in enumerate(controller.groups):
                form(members, i, number)
        for others in together:
            form(others)
        for row in range(len(self.lights)):
            form([row])
        return groups

    def _lay_intervals(self, groups: Sequence[_Group]) -> None:
        """Cut each controller's cycle into intervals, wherever any colour changes."""
        own: list[list[_Group]] = [[] for _ in self.controllers]
        self.column = np.zeros(len(groups), dtype=np.int64)
        for row, group in enumerate(groups):
            if group.controller >= 0:
                self.column[row] = len(own[group.controller])
                own[group.controller].append(group)
        cycles: list[int] = []
        bases: list[int] = []
        intervals: list[tuple[int, int, int, int, int]] = []  # start, end, phase, start and end of the phase
        colours: list[list[int]] = []
        base = 0
        for controller, mine in zip(self.controllers, own, strict=True):
            borders = _phase_borders(controller)
            lines = [list(_changes(controller, group, borders)) for group in mine]
            cuts = sorted({*borders[:-1], *(at for line in lines for at, _ in line)})
            times = [[at for at, _ in line] for line in lines]
            for at, end in zip(cuts, [*cuts[1:], borders[-1]], strict=True):
                phase = bisect_right(borders, at) - 1
                intervals.append((base + at, base + end, phase, borders[phase], borders[phase + 1]))
                colours.append([line[bisect_right(t, at) - 1][1] for line, t in zip(lines, times, strict=True)])
            cycles.append(borders[-1])
            bases.append(base)
            base += borders[-1] + 1  # an unused frame between two controllers
        self.cycle, self.base = np.array(cycles, dtype=np.int64), np.array(bases, dtype=np.int64)
        table = np.array(intervals, dtype=np.int64).reshape(-1, 5)
        self.interval_start, self.interval_end, self.interval_phase, self.phase_start, self.phase_end = table.T.copy()
        self.num_phases = np.array([len(controller.phases) for controller in self.controllers], dtype=np.int64)
        self.colours = np.full((len(colours), max(map(len, colours), default=0)), UNSET, dtype=np.int64)
        for row, line in enumerate(colours):
            self.colours[row, : len(line)] = line

    def _bind_lanes(self, roads: Roads, passes: Sequence[int] | None) -> None:
        """Find the light and the intersection that each lane belongs to."""
        num = len(roads)
        self.pass_of_lane = np.array([_GREEN] * num if passes is None else passes, dtype=np.int64)
        self.light_of_lane = np.full(num, -1, dtype=np.int64)
        self.controller_of_lane = np.full(num, -1, dtype=np.int64)
        ever = [self._ever(row) for row in range(len(self.lights))]
        for row, light in enumerate(self.lights):
            for lane in () if light.is_pedestrian else light.lanes:
                before = int(self.light_of_lane[lane])
                wanted = int(self.pass_of_lane[lane])
                # Of several lights take the first that allows to enter at any time.
                if before < 0 or (not ever[before] & wanted and ever[row] & wanted):
                    self.light_of_lane[lane] = row
                if self.controller[self.group[row]] >= 0 and self.controller_of_lane[lane] < 0:
                    self.controller_of_lane[lane] = self.controller[self.group[row]]
        for lane in np.flatnonzero(self.light_of_lane >= 0).tolist():
            if not ever[self.light_of_lane[lane]] & int(self.pass_of_lane[lane]):
                self.pass_of_lane[lane] |= _GREEN
        self.is_before_light = np.bincount(roads.predecessor, self.light_of_lane[roads.successor] >= 0, num) > 0.0
        # Turns without a light, beside others that have one, lie in the same intersection.
        lit = np.flatnonzero(self.controller_of_lane >= 0).tolist()
        inside = {lane: int(self.controller_of_lane[lane]) for lane in lit}
        for lane in range(num):
            beside = roads.successors(lane).tolist()
            known = [inside[other] for other in beside if other in inside]
            for other in beside if known else ():
                if self.controller_of_lane[other] < 0:
                    self.controller_of_lane[other] = known[0]

    def _ever(self, row: int) -> int:
        """Return the sum of all lamps that a light ever shows; without a controller, of all that it has."""
        group = self.group[row]
        controller = int(self.controller[group])
        if controller < 0 or not self.num_phases[controller]:
            return int(self.lights[row].lamps)
        base = self.base[controller]
        first, last = self.interval_start.searchsorted([base, base + self.cycle[controller]]).tolist()
        return int(np.bitwise_or.reduce(self.colours[first:last, self.column[group]]))

    def _hash(self) -> bytes:
        state = blake2b(repr((self.lights, self.controllers)).encode(), digest_size=16)
        for table in (self.group, self.controller, self.light_of_lane, self.pass_of_lane, self.controller_of_lane):
            state.update(table.tobytes())
        return state.digest()


def _check(controller: Controller) -> None:
    num = len(controller.groups)
    if any(len(phase.colours) != num or phase.duration < 1 for phase in controller.phases):
        raise ValueError(f"{controller.name}: a phase lasts a frame or more and has a colour for each of {num} groups")
    if controller.phases and len(controller.yellow) != num:
        raise ValueError(f"{controller.name}: there is a yellow for each of {num} groups")
    for walk in controller.walks:
        if not (0 <= walk.phase < len(controller.phases) and 0 <= walk.group < num):
            raise ValueError(f"{controller.name}: a walk belongs to one of its phases and groups")
        if min(walk.before, walk.green, walk.flashing) < 0:
            raise ValueError(f"{controller.name}: a walk has no negative times")


def _kept(controller: Controller, phase: int, group: int) -> int | None:
    """Return the part of a group's green that continues in the next phase; None where it has none, or all continues."""
    colour = controller.phases[phase].colours[group]
    following = controller.phases[(phase + 1) % len(controller.phases)].colours[group]
    return colour & following & GREENS if colour > 0 and colour & ~following & GREENS else None


def _phase_borders(controller: Controller) -> list[int]:
    """Return the frames of the cycle at which each phase begins, and the end of the last one; [0, 1] without phases."""
    borders = [0]
    for i, phase in enumerate(controller.phases):
        yellows = (yellow for group, yellow in enumerate(controller.yellow) if _kept(controller, i, group) is not None)
        borders.append(borders[-1] + phase.duration + max(yellows, default=0))
    return borders if controller.phases else [0, 1]


def _changes(controller: Controller, group: _Group, borders: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield (frame, colour) of each change of a group in a cycle, in rising order."""
    if not controller.phases:
        yield 0, UNSET
    walks = [walk for walk in controller.walks if walk.group == group.number]
    for i, phase in enumerate(controller.phases):
        start, end = borders[i], borders[i + 1]
        colour = phase.colours[group.number]
        if group.is_pedestrian and (walks or group.is_mixed):
            yield from _walk([walk for walk in walks if walk.phase == i], start, end)
            continue
        yield start, colour
        kept = _kept(controller, i, group.number)
        stop = start + phase.duration
        if kept is None or stop == end:
            continue
        yellow = 0 if group.is_pedestrian else controller.yellow[group.number]
        if yellow:
            yield stop, kept | _YELLOW
        if stop + yellow < end:
            yield stop + yellow, kept or _RED


def _walk(walks: Sequence[Walk], start: int, end: int) -> Iterator[tuple[int, int]]:
    """Yield the same for pedestrian lights in one phase."""
    yield start, _RED
    at = start
    for walk in sorted(walks, key=lambda walk: walk.before):
        at = max(at, start + walk.before)
        for lit, colour in ((walk.green, _GREEN), *_flashes(walk.flashing)):
            if lit and at < end:
                yield at, colour
                at += lit
        if at < end:
            yield at, _RED


def _flashes(frames: int) -> Iterator[tuple[int, int]]:
    """Yield (frames, colour) of a flashing light: dark first, because green comes before."""
    for i in range(0, frames, FLASH):
        yield min(FLASH, frames - i), 0 if i // FLASH % 2 == 0 else _GREEN
