"""The plan of a map's traffic lights: which there are, what runs them, and what they show at each moment of a cycle.

A *controller* runs an intersection through its phases, over and over. In a phase each of its groups has a colour. A
group whose green does not go on in the next phase then shows yellow for its own time, *after* the phase's duration,
while the others hold their colour; the next phase begins when the longest of these yellows is over. A group that keeps
a part of its green (straight and left, then straight alone) shows yellow beside that part; one that keeps nothing and
whose yellow is short waits at red for the others. People's lights are green within a phase, from a while after its
beginning on, then flash, then are red.

All of that is worked out when the plan is made, as a table of *spells* in which no colour changes. All times are whole
frames. What is lit at a given frame, and who has taken over which light, is `signals`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntFlag
from hashlib import blake2b
from typing import Final

import numpy as np

from rosbridge_sim.world.roads import Roads

__all__ = ["GREENS", "UNSET", "Controller", "Lamp", "Light", "Phase", "SignalPlan", "Walk"]


class Lamp(IntFlag):
    """What is lit, a sum. The numbers are those that clients know."""

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
"""What a light shows that nobody has set: no controller has it."""

FLASH: Final = 25
"""A flashing light is lit for so long and dark for as long: once a second [frames]."""

_RED, _YELLOW, _GREEN = int(Lamp.RED), int(Lamp.YELLOW), int(Lamp.GREEN)


@dataclass(frozen=True, slots=True)
class Light:
    """One traffic light.

    Attributes:
        name: as the map spells it.
        lamps: what it has, a sum of `Lamp`; with YELLOW alone all its lamps are yellow.
        is_pedestrian: for people on foot.
        lanes: rows of the lanes that it serves: they begin at its stop line.
        x, y, z: where it hangs [m].
        yaw: where it looks, against the traffic that it serves [rad].
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
        """All its lamps are yellow: whatever the others of its group show, it asks for care and stops nobody."""
        return self.lamps == _YELLOW


@dataclass(frozen=True, slots=True)
class Phase:
    """One phase: so many frames, at least one, then the yellows; and the colour of each group."""

    duration: int
    colours: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Walk:
    """When the people's lights of a group are green: `before` frames into a phase; then flashing, then red."""

    phase: int
    group: int
    before: int
    green: int
    flashing: int


@dataclass(frozen=True, slots=True)
class Controller:
    """What runs an intersection.

    Attributes:
        name: as the map spells it.
        number: what clients call it by.
        groups: rows of the lights that change together.
        phases: in turn. None: nothing is run, its lights are unset.
        yellow: of each group [frames].
        walks: for the people's lights of its groups. Those of a group that has none are red beside lights for cars,
            and among themselves show the group's colour.
    """

    name: str
    number: int
    groups: tuple[tuple[int, ...], ...]
    phases: tuple[Phase, ...] = ()
    yellow: tuple[int, ...] = ()
    walks: tuple[Walk, ...] = ()


@dataclass(frozen=True, slots=True)
class _Group:
    """Lights that take one value: those of a controller's group, people's lights apart from the others."""

    controller: int
    number: int  # of the controller's group
    is_pedestrian: bool
    is_mixed: bool  # the controller's group has lights of both sorts


class SignalPlan:
    """All lights of a map and how they are run; never changed after it is made.

    Lights are shown by *groups*: the lights of a controller's group, those for people apart from the others; or lights
    that hang together without a controller; or one light alone.

    Attributes:
        lights, controllers: as given.
        group: (lights,) int64, row of each light's group.
        num_groups: of them.
        controller: (groups,) int64, row of what runs each group; -1: nothing.
        is_warning: (lights,) bool, see `Light`.

        light_of_lane: (lanes,) int64, row of the light that tells whether one may enter; -1: none does.
        pass_of_lane: (lanes,) int64, the lamps of which any one lets enter.
        controller_of_lane: (lanes,) int64, row of the intersection that the lane lies in; -1: none.

        cycle: (controllers,) int64, frames until all begins again; 1 where there is nothing to run.
        num_phases: (controllers,) int64.
        base: (controllers,) int64, where each controller's spells begin on the one scale of `spell`.
        spell: (spells,) int64, rising: `base` and the frame of the cycle at which each spell begins.
        spell_end: (spells,) int64, the same for where it ends.
        spell_phase: (spells,) int64.
        phase_start, phase_end: (spells,) int64, frames of the cycle: the phase that the spell belongs to.
        colours: (spells, slots) int64, padded; `slot` (groups,) is the column of a group.

        digest: 16 bytes that stand for all of it.
    """

    __slots__ = (
        "_rows",
        "base",
        "colours",
        "controller",
        "controller_of_lane",
        "controllers",
        "cycle",
        "digest",
        "group",
        "is_warning",
        "light_of_lane",
        "lights",
        "num_groups",
        "num_phases",
        "pass_of_lane",
        "phase_end",
        "phase_start",
        "slot",
        "spell",
        "spell_end",
        "spell_phase",
    )

    def __init__(
        self,
        roads: Roads,
        lights: Sequence[Light] = (),
        controllers: Sequence[Controller] = (),
        *,
        together: Sequence[Sequence[int]] = (),
        passes: Sequence[int] | None = None,
    ) -> None:
        """Work the tables out.

        Args:
            roads: whose lanes the lights serve.
            lights: of the map.
            controllers: of its intersections. A light that two of them name is the first one's.
            together: rows of lights that hang together without a controller.
            passes: for each lane the lamps that let enter it; None: GREEN does, everywhere. Where a lane's light never
                shows any of them, GREEN does too.

        Raises:
            ValueError: a phase without a colour for each group, a yellow missing, a walk that belongs nowhere.
        """
        self.lights, self.controllers = tuple(lights), tuple(controllers)
        self._rows = {light.name: i for i, light in reversed(list(enumerate(self.lights)))}
        self.is_warning = np.array([light.is_warning for light in self.lights], dtype=bool)
        groups = self._form_groups(together)
        self.num_groups = len(groups)
        self.controller = np.array([group.controller for group in groups], dtype=np.int64)
        self._lay_spells(groups)
        self._bind_lanes(roads, passes)
        self.digest = self._hash()

    def light(self, name: str) -> int:
        """The row of the light with this name.

        Raises:
            KeyError: there is no such light.
        """
        return self._rows[name]

    def _form_groups(self, together: Sequence[Sequence[int]]) -> list[_Group]:
        """All groups; each light is in one, the first that claims it."""
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

    def _lay_spells(self, groups: Sequence[_Group]) -> None:
        """Cut each controller's cycle where any colour changes."""
        own: list[list[_Group]] = [[] for _ in self.controllers]
        self.slot = np.zeros(len(groups), dtype=np.int64)
        for row, group in enumerate(groups):
            if group.controller >= 0:
                self.slot[row] = len(own[group.controller])
                own[group.controller].append(group)
        cycles: list[int] = []
        bases: list[int] = []
        spells: list[tuple[int, int, int, int, int]] = []  # begin, end, phase, its begin and end
        colours: list[list[int]] = []
        base = 0
        for controller, mine in zip(self.controllers, own, strict=True):
            borders = _phase_borders(controller)
            lines = [list(_changes(controller, group, borders)) for group in mine]
            cuts = sorted({*borders[:-1], *(at for line in lines for at, _ in line)})
            times = [[at for at, _ in line] for line in lines]
            for at, end in zip(cuts, [*cuts[1:], borders[-1]], strict=True):
                phase = bisect_right(borders, at) - 1
                spells.append((base + at, base + end, phase, borders[phase], borders[phase + 1]))
                colours.append([line[bisect_right(t, at) - 1][1] for line, t in zip(lines, times, strict=True)])
            cycles.append(borders[-1])
            bases.append(base)
            base += borders[-1] + 1  # a frame of nothing between two controllers
        self.cycle, self.base = np.array(cycles, dtype=np.int64), np.array(bases, dtype=np.int64)
        table = np.array(spells, dtype=np.int64).reshape(-1, 5)
        self.spell, self.spell_end, self.spell_phase, self.phase_start, self.phase_end = table.T.copy()
        self.num_phases = np.array([len(controller.phases) for controller in self.controllers], dtype=np.int64)
        self.colours = np.full((len(colours), max(map(len, colours), default=0)), UNSET, dtype=np.int64)
        for row, line in enumerate(colours):
            self.colours[row, : len(line)] = line

    def _bind_lanes(self, roads: Roads, passes: Sequence[int] | None) -> None:
        """Which light and which intersection each lane belongs to."""
        num = len(roads)
        self.pass_of_lane = np.array([_GREEN] * num if passes is None else passes, dtype=np.int64)
        self.light_of_lane = np.full(num, -1, dtype=np.int64)
        self.controller_of_lane = np.full(num, -1, dtype=np.int64)
        ever = [self._ever(row) for row in range(len(self.lights))]
        for row, light in enumerate(self.lights):
            for lane in () if light.is_pedestrian else light.lanes:
                before = int(self.light_of_lane[lane])
                wanted = int(self.pass_of_lane[lane])
                # Of several lights the first that lets one enter at any time.
                if before < 0 or (not ever[before] & wanted and ever[row] & wanted):
                    self.light_of_lane[lane] = row
                if self.controller[self.group[row]] >= 0 and self.controller_of_lane[lane] < 0:
                    self.controller_of_lane[lane] = self.controller[self.group[row]]
        for lane in np.flatnonzero(self.light_of_lane >= 0).tolist():
            if not ever[self.light_of_lane[lane]] & int(self.pass_of_lane[lane]):
                self.pass_of_lane[lane] |= _GREEN
        # Turns without a light of their own, beside others that have one, lie in the same intersection.
        lit = np.flatnonzero(self.controller_of_lane >= 0).tolist()
        inside = {lane: int(self.controller_of_lane[lane]) for lane in lit}
        for lane in range(num):
            beside = roads.successors(lane).tolist()
            known = [inside[other] for other in beside if other in inside]
            for other in beside if known else ():
                if self.controller_of_lane[other] < 0:
                    self.controller_of_lane[other] = known[0]

    def _ever(self, row: int) -> int:
        """All that a light shows at some time; what it could show where nothing runs it."""
        group = self.group[row]
        controller = int(self.controller[group])
        if controller < 0 or not self.num_phases[controller]:
            return int(self.lights[row].lamps)
        base = self.base[controller]
        first, last = self.spell.searchsorted([base, base + self.cycle[controller]]).tolist()
        return int(np.bitwise_or.reduce(self.colours[first:last, self.slot[group]]))

    def _hash(self) -> bytes:
        state = blake2b(repr((self.lights, self.controllers)).encode(), digest_size=16)
        for column in (self.group, self.controller, self.light_of_lane, self.pass_of_lane, self.controller_of_lane):
            state.update(column.tobytes())
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
    """What of a group's green goes on in the next phase; None where it has none or all of it does."""
    colour = controller.phases[phase].colours[group]
    following = controller.phases[(phase + 1) % len(controller.phases)].colours[group]
    return colour & following & GREENS if colour > 0 and colour & ~following & GREENS else None


def _phase_borders(controller: Controller) -> list[int]:
    """Where in the cycle each phase begins, and where the last one ends. A controller without phases has a frame."""
    borders = [0]
    for i, phase in enumerate(controller.phases):
        yellows = (yellow for group, yellow in enumerate(controller.yellow) if _kept(controller, i, group) is not None)
        borders.append(borders[-1] + phase.duration + max(yellows, default=0))
    return borders if controller.phases else [0, 1]


def _changes(controller: Controller, group: _Group, borders: Sequence[int]) -> Iterator[tuple[int, int]]:
    """(frame, colour), rising, of each change that a group makes in a cycle."""
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
    """The same for people's lights in one phase."""
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
    """(frames, colour): dark first, since green goes before."""
    for i in range(0, frames, FLASH):
        yield min(FLASH, frames - i), 0 if i // FLASH % 2 == 0 else _GREEN
