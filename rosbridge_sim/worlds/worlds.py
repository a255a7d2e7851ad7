"""Many worlds without a server: reset, commands, steps, observations, scores; see `Worlds`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.drivers.lane_position import keep_lane
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.many_worlds.world_set import WorldSet
from rosbridge_sim.world.state.commands import command_all, shift
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import DT, Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.worlds.ego_table import EgoTable
from rosbridge_sim.worlds.one_scene import TRAFFIC_INTERVAL, OneScene, SavedScene
from rosbridge_sim.worlds.surroundings import LANE_FIGURES, OTHER_FIGURES, find_lanes, find_lights, find_others

__all__ = ["EGO_FIGURES", "SCORE_FIGURES", "Worlds"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

EGO_FIGURES: Final = (
    *("x", "y", "z", "roll", "pitch", "yaw", "speed", "lateral_speed", "accel", "lateral_accel", "yaw_rate"),
    *("steer", "throttle", "brake", "gear", "centre"),
)
"""Columns that `Worlds.egos` returns."""

SCORE_FIGURES: Final = (
    *("score_distance", "num_collisions", "num_red_lights", "num_stop_lines", "num_lane_invasions"),
    *("off_road_frames", "is_off_road", "time_to_collision", "min_time_to_collision"),
    *("lane_offset", "max_lane_offset", "jerk", "max_jerk", "max_lateral_accel"),
)
"""Columns that `Worlds.scores` returns."""

MAX_BEGINS: Final = 256
"""Beginnings of episodes that are kept, by scenario and seed: 0.1 MB each, with a hundred entities."""

_MODES: Final = {
    frozenset({"throttle", "brake"}): Mode.PEDALS,
    frozenset({"speed"}): Mode.SPEED,
    frozenset({"accel"}): Mode.ACCEL,
}

Commands = Mapping[str, npt.ArrayLike]


class Worlds:
    """Many worlds of driving that move together, without a server, a socket or a thread.

    World w does what `rosbridge-sim --scenario SCENARIO --seed SEED --traffic N --start-mode external` does with the
    seed of w and the same commands, to the bit. Arrays have the shape (num_worlds, num_egos): num_egos is the greatest
    number of egos of any world, and mostly 1. All numbers are SI and radians. Places are in the frame of the map: x
    east, y north, z up; yaw counter-clockwise from east.

    Attributes:
        num_worlds: number of worlds.
        dt: length of a frame [s]: 0.02.

    Args:
        scenario: name of a built-in scenario or path of a file, as for `rosbridge-sim --scenario`, or a scenario that
            was read; or one for each world.
        num_worlds: number of worlds; with a list of scenarios it is the list's length.
        seed: of all chance: one number s for the seeds s, s + 1, ..., or one for each world; not negative.
        traffic: vehicles on the lanes of each world besides those of the scenario: as many as fit, and kept there.
        vehicle: model of the first ego, a name of the catalogue; None for that of the scenario.
        dynamics: model that moves the egos; see `--dynamics`.
        impacts: collisions change motion; see `--impacts`.
        scores: keep the scores of all egos.
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
        vehicle: str | None = None,
        dynamics: Literal["single-track", "kinematic"] = "single-track",
        impacts: bool = False,
        scores: bool = True,
        library: DiskLibrary | None = None,
    ) -> None:
        _check_number("num_worlds", num_worlds)
        names = [scenario] * num_worlds if isinstance(scenario, str | Path | Scenario) else list(scenario)
        if not names:
            raise ValueError("scenario: expected at least one, got none")
        self.num_worlds, self.dt = len(names), DT
        seeds = [seed + i for i in range(self.num_worlds)] if isinstance(seed, int) else list(seed)
        if len(seeds) != self.num_worlds or any(each < 0 for each in seeds):
            raise ValueError(f"seed: expected {self.num_worlds} numbers that are not negative, got {seeds[:8]}")
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
            one = OneScene(world, library, opened[key], traffic, model)
            if scores:
                world.start_scoring()
            self._scenes.append(one)
        self._library = library
        self._names = keys
        self._begins: dict[tuple[str, int], SavedScene] = {}
        self._worlds = [one.world for one in self._scenes]
        self._set = WorldSet(self._worlds)
        self._set.settle()
        self._made: EgoTable | None = None

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
        _check_number("n", n)
        self._set.settle()
        if commands is not None:
            self._command(commands)
        busy = [one for one in self._scenes if one.has_traffic]
        while n > 0:
            part = min([n, *(TRAFFIC_INTERVAL - one.world.frame % TRAFFIC_INTERVAL for one in busy)])
            self._set.advance(part)
            n -= part
            for one in busy:
                if one.world.frame % TRAFFIC_INTERVAL == 0:
                    one.after_frame()
        if busy:
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
        for i, each in zip(which, saved, strict=True):
            self._scenes[i].load(each)
        self._set.settle()

    # -- what is seen

    @property
    def num_egos(self) -> int:
        """The greatest number of egos of a world."""
        return int(self._egos.is_there.shape[1])

    @property
    def has_ego(self) -> BoolArray:
        """Which egos there are, (num_worlds, num_egos) bool."""
        return self._egos.is_there.copy()

    @property
    def frames(self) -> IntArray:
        """Frames since the last reset of each world, (num_worlds,) int64."""
        return np.array([world.frame for world in self._worlds], dtype=np.int64)

    @property
    def seeds(self) -> list[int]:
        """The seeds of the worlds."""
        return [world.seed for world in self._worlds]

    def egos(self) -> dict[str, FloatArray]:
        """Return state and controls of the egos, `EGO_FIGURES`, (num_worlds, num_egos) each; nan where there is none.

        x, y, z [m] of the middle of the rear axle on the ground; roll, pitch, yaw [rad]; speed forward and
        lateral_speed to the left [m/s]; accel forward and lateral_accel to the left [m/s^2]; yaw_rate [rad/s]; steer,
        angle of the front wheels, left positive [rad]; throttle and brake 0..1; gear, a number of `Gear`; centre,
        how far the middle of the box is ahead of the rear axle [m].
        """
        return {name: self._egos.gather(name) for name in EGO_FIGURES}

    def others(self, num: int, out: FloatArray | None = None) -> FloatArray:
        """Return the entities nearest to each ego, the nearest first.

        Args:
            num: entities of each, at least 1.
            out: array to write into, of the shape of the result.

        Returns:
            (num_worlds, num_egos, num, 9) `OTHER_FIGURES`: 1 where there is an entity, else all are 0; place of the
            middle of its box, forward and left [m]; velocity relative to the ego's, forward and left [m/s]; cosine and
            sine of its heading; length and width [m]. All in the frame of the ego.

        Raises:
            ValueError: num is below 1, or `out` has another shape.
        """
        _check_number("num", num)
        found = _out(out, (*self._egos.is_there.shape, num, len(OTHER_FIGURES)))
        for part in self._egos:
            if len(part.rows):
                found[part.world, part.ego] = find_others(part, num)
        return found

    def lanes(self, ahead: Sequence[float] = ()) -> dict[str, FloatArray]:
        """Return where the egos are on their lanes, and where the lanes lead.

        Args:
            ahead: distances along the lane of the places that are wanted [m]. Where lanes fork they are on the one that
                turns least.

        Returns:
            (num_worlds, num_egos) each: `offset` of the middle of the rear axle from the lane's line, left positive
            [m]; `heading` relative to the lane, left positive [rad]; `to_left` and `to_right`, distances of the lane's
            edges, negative beyond them [m]; `speed_limit`, 0 for none [m/s]; `is_on_road`, 1 within the edges of the
            nearest lane, else 0; `s`, arc length on it [m]; `lane`, its row, -1 without one. And `points`
            (num_worlds, num_egos, len(ahead), 2), places in the frame of the ego, forward and left [m]. nan where
            there is no ego.
        """
        distances = np.asarray(ahead, dtype=np.float64)
        if distances.ndim != 1 or not np.isfinite(distances).all():
            raise ValueError(f"ahead: expected finite distances of shape (p,), got shape {distances.shape}")
        shape = self._egos.is_there.shape
        found = {name: np.full(shape, np.nan) for name in LANE_FIGURES}
        found["points"] = np.full((*shape, len(distances), 2), np.nan)
        for part in self._egos:
            if len(part.rows):
                figures, points = find_lanes(part, distances)
                found["points"][part.world, part.ego] = points
                for name, values in figures.items():
                    found[name][part.world, part.ego] = values
        return found

    def lights(self) -> dict[str, FloatArray]:
        """Return the next traffic lights ahead of the egos, on the lanes that turn least, (num_worlds, num_egos) each.

        `distance` to the end of the lane before the light, from the middle of the rear axle, inf for none within five
        lanes [m]; `must_stop`, 1 where the light for the lane behind it is red or yellow, else 0. nan where there is no
        ego.
        """
        found = {name: np.full(self._egos.is_there.shape, np.nan) for name in ("distance", "must_stop")}
        for part in self._egos:
            if len(part.rows):
                may_enter = [self._worlds[i].lights.may_enter for i in part.world.tolist()]
                values = find_lights(part, np.stack(may_enter), self._worlds[part.world[0]].plan.light_of_lane)
                for name, figures in zip(found, values, strict=True):
                    found[name][part.world, part.ego] = figures
        return found

    def scores(self) -> dict[str, FloatArray]:
        """Return the scores of the egos since the last reset, `SCORE_FIGURES`, (num_worlds, num_egos) each.

        They are those of `/sim/score`: distance driven [m], counts, frames off the road, times to collision, now and
        least [s], offset from the lane, now and most [m], jerk [m/s^3], lateral acceleration [m/s^2].
        """
        return {name: self._egos.gather(name) for name in SCORE_FIGURES}

    def contacts(self) -> list[IntArray]:
        """Return for each world the ids of the pairs that touched during the last frame, (m, 2) int64 each."""
        return [world.contacts for world in self._worlds]

    def digests(self) -> list[str]:
        """Return for each world the hash of its state: that of `/sim/state_hash` of a server without scene services."""
        return [world.digest() for world in self._worlds]

    def world(self, number: int) -> World:
        """Return one world, to read; it moves with the others.

        Raises:
            ValueError: there is no such world.
        """
        return self._scene(number).world

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
            world: number of the world.
            model: a name of the catalogue.
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
        found = _find_model(self._library, model)
        if lane is not None and not 0 <= lane < len(one.world.roads):
            raise ValueError(f"lane: expected 0..{len(one.world.roads) - 1}, got {lane}")
        uid = one.scene.add(found, x=x, y=y, z=z, yaw=yaw)
        row = one.world.row(uid)
        one.world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
        if lane is not None:
            keep_lane(one.world, row, lane, s)
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
        self._set.settle()

    def place(
        self, world: int, *, x: float, y: float, z: float = 0.0, yaw: float, speed: float = 0.0, ego: int = 0
    ) -> None:
        """Place an ego of one world somewhere else.

        Args:
            world: number of the world.
            x: reference point, the middle of the rear axle, east [m].
            y: north [m].
            z: up [m].
            yaw: heading [rad].
            speed: along it [m/s].
            ego: which ego.

        Raises:
            ValueError: there is no such world or ego, or a number is out of range. Nothing has moved.
        """
        rows = self._scene(world).world.rows(Kind.EGO)
        if not 0 <= ego < len(rows):
            raise ValueError(f"ego: expected 0..{len(rows) - 1}, got {ego}")
        teleport(self._worlds[world], int(rows[ego]), x=x, y=y, z=z, yaw=yaw, speed=speed)
        self._set.settle()

    # -- internals

    @property
    def _egos(self) -> EgoTable:
        if self._made is None or not self._made.is_true(self._worlds):
            self._made = EgoTable(self._worlds)
        return self._made

    def _scene(self, world: int) -> OneScene:
        if not 0 <= world < self.num_worlds:
            raise ValueError(f"world: expected 0..{self.num_worlds - 1}, got {world}")
        return self._scenes[world]

    def _mask(self, mask: npt.ArrayLike | None) -> BoolArray:
        which = np.ones(self.num_worlds, dtype=bool) if mask is None else np.asarray(mask)
        if which.shape != (self.num_worlds,) or which.dtype != np.bool_:
            raise ValueError(f"mask: expected bool of shape ({self.num_worlds},), got {which.dtype} {which.shape}")
        return which

    def _command(self, commands: Commands) -> None:
        names = frozenset(commands) - {"steering", "gear"}
        if names not in _MODES or "steering" not in commands:
            raise ValueError(
                "commands: expected steering with throttle and brake, with speed or with accel, got"
                f" {', '.join(sorted(commands)) or 'none'}"
            )
        shape = self._egos.is_there.shape
        arrays: dict[str, Any] = {}
        for name, values in commands.items():
            array = np.asarray(values, dtype=np.float64)
            try:
                arrays[name] = np.broadcast_to(array, shape)
            except ValueError:
                raise ValueError(f"{name}: expected an array of shape {shape}, got {array.shape}") from None
            if not np.isfinite(arrays[name][self._egos.is_there]).all():
                raise ValueError(f"{name}: expected finite numbers")
        if "gear" in arrays:
            if not np.isin(arrays["gear"][self._egos.is_there], list(Gear)).all():
                raise ValueError(f"gear: expected numbers within {min(Gear)}..{max(Gear)}")
            self._shift(arrays["gear"])
        for part in self._egos:
            at = part.world, part.ego
            rest = {name: arrays[name][at] for name in names}
            command_all(part.columns, part.rows, mode=_MODES[names], steer=arrays["steering"][at], **rest)

    def _shift(self, gears: FloatArray) -> None:
        """Shift the egos that stand; few do in a step, and each by itself."""
        for i, j in np.argwhere(self._egos.is_there & (self._egos.gather("gear") != gears)).tolist():
            world = self._worlds[i]
            shift(world, int(world.rows(Kind.EGO)[j]), Gear(int(gears[i, j])))
        self._set.settle()


_DYNAMICS: Final = {"single-track": Dynamics.SINGLE_TRACK, "kinematic": Dynamics.KINEMATIC}


def _check_number(name: str, value: object) -> None:
    """Check that an argument is a whole number from 1 on.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name}: expected a whole number from 1 on, got {value!r}")


def _find_model(library: DiskLibrary, name: str) -> Model:
    model = library.catalogue.find(name)
    if model is None:
        raise ValueError(f"model: the catalogue has no {name!r}")
    return model


def _out(out: FloatArray | None, shape: tuple[int, ...]) -> FloatArray:
    """Return zeros, or the caller's array as zeros."""
    if out is None:
        return np.zeros(shape)
    if out.shape != shape:
        raise ValueError(f"out: expected shape {shape}, got {out.shape}")
    out[:] = 0.0
    return out
