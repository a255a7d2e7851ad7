"""Many worlds without a server: reset, commands, steps, observations, scores; see `Worlds`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal, Self

import numpy as np
import numpy.typing as npt

from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.kernels.backend import start_kernels
from rosbridge_sim.simulator.scene.load import FoundMap
from rosbridge_sim.simulator.sim_services.traffic_demand import COUNT_INTERVAL
from rosbridge_sim.world.demand import stand_at_ends
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.geometry.planar import BoolArray
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.many_worlds.world_set import WorldSet
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Dynamics, Kind
from rosbridge_sim.worlds.argument_checks import check_number
from rosbridge_sim.worlds.drivable_worlds import EGO_FIGURES, SCORE_FIGURES, Commands
from rosbridge_sim.worlds.one_scene import TRAFFIC_INTERVAL, OneScene, SavedScene
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

__all__ = ["EGO_FIGURES", "SCORE_FIGURES", "Worlds"]

MAX_BEGINS: Final = 256
"""Beginnings of episodes that are kept, by scenario and seed: 0.1 MB each, with a hundred entities."""


class Worlds(SteppedWorlds):
    """Many worlds of driving that move together, without a server, a socket or a thread.

    World w does what `rosbridge-sim --scenario SCENARIO --seed SEED --traffic N --start-mode external` does with the
    seed of w and the same commands, to the bit. Arrays have the shape (num_worlds, num_egos): num_egos is the greatest
    number of egos of any world, and mostly 1. All numbers are SI and radians. Places are in the frame of the map: x
    east, y north, z up; yaw counter-clockwise from east. `copy.deepcopy` and `pickle` give worlds that go on as these
    do, to the bit.

    Attributes:
        num_worlds: number of worlds.
        dt: length of a frame [s]: 0.02.

    Args:
        scenario: name of a built-in scenario or path of a file, as for `rosbridge-sim --scenario`, or a scenario that
            was read; or one for each world.
        num_worlds: number of worlds; with a list of scenarios it is the list's length.
        seed: of all chance: one number s for the seeds s, s + 1, ..., or one for each world; not negative.
        traffic: vehicles on the lanes of each world besides those of the scenario: as many as fit, and kept there.
        egos: number of egos of each world. All begin where the scenario has its first one: `place` the further ones
            before the first step.
        vehicle: model of the first ego, a name of the catalogue; None for that of the scenario.
        dynamics: model that moves the egos; see `--dynamics`.
        impacts: collisions change motion; see `--on-collision`.
        library: has scenarios, maps and models; one that is kept saves reading them again for the next worlds. None for
            a new one.

    Raises:
        ValueError: an argument is out of range; the text names it.
        DocumentError: there is no such scenario, or it cannot be used.
    """

    def __init__(
        self,
        scenario: str | Path | Scenario | Sequence[str | Path | Scenario],
        num_worlds: int = 1,
        *,
        seed: int | Sequence[int] = 0,
        traffic: int = 0,
        egos: int = 1,
        vehicle: str | None = None,
        dynamics: Literal["single-track", "kinematic"] = "single-track",
        impacts: bool = False,
        scores: bool = True,
        library: DiskLibrary | None = None,
    ) -> None:
        check_number("num_worlds", num_worlds)
        check_number("traffic", traffic, 0)
        start_kernels()
        names = [scenario] * num_worlds if isinstance(scenario, str | Path | Scenario) else list(scenario)
        if not names:
            raise ValueError("scenario: expected at least one, got none")
        num = len(names)
        seeds = [seed + i for i in range(num)] if isinstance(seed, int) else list(seed)
        if len(seeds) != num or any(each < 0 for each in seeds):
            raise ValueError(f"seed: expected {num} numbers that are not negative, got {seeds[:8]}")
        if library is None:
            library = DiskLibrary()
        opened: dict[str, Scenario] = {}
        keys = [f"#{i}" if isinstance(name, Scenario) else f"{name}" for i, name in enumerate(names)]
        for key, name in zip(keys, names, strict=True):
            if key not in opened:
                opened[key] = name if isinstance(name, Scenario) else library.opening_scenario(key)
        model = None if vehicle is None else _find_model(library, vehicle)
        self._scenes = []
        for key, number in zip(keys, seeds, strict=True):
            world = OneOfMany(number, Dynamics(_DYNAMICS[dynamics]), has_impacts=impacts)
            one = OneScene(world, library, opened[key], traffic, model, num_egos=egos)
            if scores:
                world.start_scoring()
            self._scenes.append(one)
        self._names = keys
        self._options: dict[str, Any] = {
            "scenario": [opened[key] for key in keys],
            "traffic": traffic,
            "egos": egos,
            "vehicle": vehicle,
            "dynamics": dynamics,
            "impacts": impacts,
            "scores": scores,
            "library": library,
        }
        self._traffic: _ManyTraffics | None = None
        self._begins: dict[tuple[str, int], SavedScene] = {}
        super().__init__([one.world for one in self._scenes])
        self._set = WorldSet(self._worlds)
        self._set.settle()

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a copy that continues as these worlds do, to the bit. It shares the library with its maps."""
        del memo
        return self._go_on(self._options, self._names, self.seeds, self.save())

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments for a pickle: scenarios, states and the places of the library. Maps are read again."""
        states = [(to_plain(each.world), each.next_uid, each.traffic) for each in self.save()]
        return self._go_on, (self._options, self._names, self.seeds, states)

    @classmethod
    def _go_on(
        cls, options: dict[str, Any], names: list[str], seeds: list[int], states: Sequence[SavedScene | tuple[Any, ...]]
    ) -> Self:
        """Return worlds that were copied or pickled."""
        worlds = cls(**options, seed=seeds)
        worlds._names = names
        saved = []
        for own, state in zip(worlds.save(), states, strict=True):
            if not isinstance(state, SavedScene):
                plain, next_uid, traffic = state
                world = from_plain(plain, own.world.roads, own.world.signals.plan)
                state = replace(own, world=world, next_uid=next_uid, traffic=traffic)  # noqa: PLW2901
            saved.append(state)
        worlds.load(saved)
        return worlds

    # -- motion

    def step(self, commands: Commands | None = None, n: int = 1) -> None:
        """Command the egos and move all worlds.

        A command holds until the next one. Commands of worlds with fewer egos than others are not read.

        Args:
            commands: arrays that broadcast to (num_worlds, num_egos): `steering`, the angle of the front wheels, left
                positive [rad], and either `throttle` and `brake` 0..1, or `speed` [m/s], or `accel` [m/s^2], which
                count in the direction of the gear; and, if wanted, `gear`, a number of `Gear`, which an ego that stands
                shifts to. None for those of before.
            n: frames of 20 ms, at least 1.

        Raises:
            ValueError: an array has another shape or holds a number that is not finite, there are other names, or n is
                below 1. Nothing has moved.
        """
        check_number("n", n)
        self._set.settle()
        if commands is not None:
            self.command(commands)
        if self._traffic is None:
            self._traffic = _ManyTraffics(self._scenes)
        traffic = self._traffic
        while n > 0:
            part = traffic.frames_to_look(n)
            self._set.advance(part)
            n -= part
            if traffic.count(part):
                traffic.look(self._set.worlds_with(stand_at_ends))
        self._set.settle()

    def reset(self, mask: npt.ArrayLike | None = None, seeds: Sequence[int | None] | None = None) -> None:
        """Begin the scenario of some worlds again, at frame 0. The others stay as they are.

        Args:
            mask: (num_worlds,) bool, which worlds; None for all.
            seeds: for each world its new seed, or None for the present one; those of worlds that are not reset are not
                read. None for the present seeds.

        Raises:
            ValueError: an argument has another length, or a seed is negative. Nothing has changed.
        """
        which = self._mask(mask)
        self._traffic = None
        numbers: Sequence[int | None] = [None] * self.num_worlds if seeds is None else seeds
        if len(numbers) != self.num_worlds or any(number is not None and number < 0 for number in numbers):
            raise ValueError(f"seeds: expected {self.num_worlds} numbers that are not negative, or None")
        for i in which.nonzero()[0].tolist():
            one, number = self._scenes[i], numbers[i]
            chosen = one.world.seed if number is None else int(number)
            begin = self._begins.get((self._names[i], chosen))
            if begin is None:
                one.reset(chosen)
                if len(self._begins) >= MAX_BEGINS:
                    self._begins.pop(next(iter(self._begins)))
                self._begins[self._names[i], chosen] = one.save()
            else:  # to spawn all entities takes ten times as long
                one.load(begin)
        self._set.settle()

    def save(self, mask: npt.ArrayLike | None = None) -> list[SavedScene]:
        """Return copies of some worlds, for `load`; `mask` is (num_worlds,) bool, None for all."""
        return [self._scenes[i].save() for i in self._mask(mask).nonzero()[0].tolist()]

    def load(self, saved: Sequence[SavedScene], mask: npt.ArrayLike | None = None) -> None:
        """Become what was saved. A copy may be loaded any number of times, and into any world of the same scenario.

        Args:
            saved: one for each world that is loaded.
            mask: (num_worlds,) bool, which worlds; None for all.

        Raises:
            ValueError: there are more or fewer copies than worlds, or something else. Nothing has changed.
        """
        which = self._mask(mask).nonzero()[0].tolist()
        if len(which) != len(saved):
            raise ValueError(f"saved: expected {len(which)} copies, got {len(saved)}")
        if not all(isinstance(each, SavedScene) for each in saved):
            raise ValueError("saved: expected copies from `save`")
        self._traffic = None
        for i, each in zip(which, saved, strict=True):
            self._scenes[i].load(each)
        self._set.settle()

    def map_of(self, number: int) -> FoundMap:
        """Return the map of one world, with its name.

        Raises:
            ValueError: there is no such world.
        """
        return self._scene(number).scene.found_map

    # -- the population

    def spawn(
        self,
        world: int,
        model: str,
        *,
        x: float = 0.0,
        y: float = 0.0,
        z: float = 0.0,
        yaw: float = 0.0,
        speed: float = 0.0,
        lane: int | None = None,
        s: float = 0.0,
    ) -> int:
        """Add an object to one world, and return its id.

        Args:
            x: east [m].
            y: north [m].
            z: up; on a map with hills it chooses between a bridge and the road below it [m].
            yaw: heading [rad].
            speed: along the heading [m/s].
            lane: row of a lane, for a vehicle that follows the lanes from there; x, y, z and yaw are not read then.
            s: arc length on the lane [m].

        Raises:
            ValueError: there is no such world, model or lane, or a number is out of range. Nothing has changed.
        """
        one = self._scene(world)
        found = _find_model(self._options["library"], model)
        if lane is not None and not 0 <= lane < len(one.world.roads):
            raise ValueError(f"lane: expected 0..{len(one.world.roads) - 1}, got {lane}")
        uid = one.scene.add(found, x=x, y=y, z=z, yaw=yaw)
        row = one.world.row(uid)
        one.world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
        if lane is not None:
            keep_lanes(one.world, [LaneStart(row, lane, s)])
        self._set.settle()
        return uid

    def remove(self, world: int, uid: int) -> None:
        """Remove an object from one world.

        Raises:
            ValueError: there is no such world or object, or it is an ego.
        """
        one = self._scene(world)
        if uid not in one.world or one.world.kind[one.world.row(uid)] == Kind.EGO:
            raise ValueError(f"uid: expected an object that is no ego, got {uid}")
        one.world.remove(uid)
        self._traffic = None
        self._set.settle()

    def place(
        self, world: int, *, x: float, y: float, z: float = 0.0, yaw: float, speed: float = 0.0, ego: int = 0
    ) -> None:
        """Place an ego of one world somewhere else.

        Args:
            x: reference point, the middle of the rear axle, east [m].
            y: north [m].
            z: up [m].
            yaw: heading [rad].
            speed: along it [m/s].

        Raises:
            ValueError: there is no such world or ego, or a number is out of range. Nothing has moved.
        """
        rows = self._scene(world).world.rows(Kind.EGO)
        if not 0 <= ego < len(rows):
            raise ValueError(f"ego: expected 0..{len(rows) - 1}, got {ego}")
        teleport(self._worlds[world], int(rows[ego]), x=x, y=y, z=z, yaw=yaw, speed=speed)
        self._set.settle()

    # -- internals

    def _scene(self, world: int) -> OneScene:
        if not 0 <= world < self.num_worlds:
            raise ValueError(f"world: expected 0..{self.num_worlds - 1}, got {world}")
        return self._scenes[world]

    def _settle(self) -> None:
        self._set.settle()

    def _mask(self, mask: npt.ArrayLike | None) -> BoolArray:
        which = np.ones(self.num_worlds, dtype=bool) if mask is None else np.asarray(mask)
        if which.shape != (self.num_worlds,) or which.dtype != np.bool_:
            raise ValueError(f"mask: expected bool of shape ({self.num_worlds},), got {which.dtype} {which.shape}")
        return which


class _ManyTraffics:
    """The traffic of many worlds: which of them must be asked whether vehicles come and go.

    It lives until a world is reset or loaded, or loses an object.
    """

    def __init__(self, scenes: Sequence[OneScene]) -> None:
        self._scenes = [one for one in scenes if one.traffic.is_active]
        self._frames = np.array([one.world.frame for one in self._scenes], dtype=np.int64)
        self._index = {one.world: i for i, one in enumerate(self._scenes)}
        self._must_ask: BoolArray = np.ones(len(self._scenes), dtype=bool)

    def frames_to_look(self, most: int) -> int:
        """Return the number of frames until one of them must be asked, at most `most`."""
        return min(most, int((TRAFFIC_INTERVAL - self._frames % TRAFFIC_INTERVAL).min(initial=most)))

    def count(self, num_frames: int) -> bool:
        """Count frames that all worlds have moved by; return whether some are due for a look."""
        self._frames += num_frames
        return bool(np.count_nonzero(self._frames % TRAFFIC_INTERVAL == 0))

    def look(self, arrived: set[OneOfMany]) -> None:
        """Let vehicles come and go where that is due; `arrived` are the worlds with one at the end of its road."""
        is_asked = self._must_ask.copy()
        is_asked[[self._index[world] for world in arrived if world in self._index]] = True
        is_asked &= self._frames % TRAFFIC_INTERVAL == 0
        for i in is_asked.nonzero()[0].tolist():
            one = self._scenes[i]
            one.after_frame()
            self._must_ask[i] = not (one.traffic.is_settled and self._frames[i] % COUNT_INTERVAL == 0)


_DYNAMICS: Final = {"single-track": Dynamics.SINGLE_TRACK, "kinematic": Dynamics.KINEMATIC}


def _find_model(library: DiskLibrary, name: str) -> Model:
    model = library.catalogue.find(name)
    if model is None:
        raise ValueError(f"model: the catalogue has no {name!r}")
    return model
