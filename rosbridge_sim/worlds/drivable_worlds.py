"""Worlds as drivers see and command them, whatever moves them: egos, lanes, other entities, scores, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.followers.self_driving import change_lane, start_self_driving
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.roads.lane_change_map import LEFT, RIGHT
from rosbridge_sim.world.state.commands import command_all, shift
from rosbridge_sim.world.state.entity_arrays import FLOATS, INTS
from rosbridge_sim.world.state.world import DT, Gear, Kind, Mode, World
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.worlds.argument_checks import broadcast, check_number, make_out
from rosbridge_sim.worlds.ego_table import EgoTable, Part
from rosbridge_sim.worlds.occupancy import GRID_FIGURES, find_grids, num_cells
from rosbridge_sim.worlds.rays import RAY_FIGURES, cast_rays
from rosbridge_sim.worlds.surroundings import LANE_FIGURES, OTHER_FIGURES, find_lanes, find_lights, find_others

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

_SCORES: Final = FLOATS[FLOATS.index("score_distance") : FLOATS.index("max_lateral_accel") + 1]
_COUNTS: Final = INTS[INTS.index("off_road_frames") : INTS.index("num_lane_invasions") + 1]
"""Neighbouring columns with most of these."""

_MODES: Final = {
    frozenset({"throttle", "brake"}): Mode.PEDALS,
    frozenset({"speed"}): Mode.SPEED,
    frozenset({"accel"}): Mode.ACCEL,
}

Commands = Mapping[str, npt.ArrayLike]
"""Name -> values of all egos; see `Worlds.step`."""


class DrivableWorlds:
    """Worlds whose egos are seen and commanded as arrays. How they move is another matter, see `Worlds`.

    Attributes:
        num_worlds: number of worlds.
        dt: length of a frame [s]: 0.02.
    """

    def __init__(self, worlds: Sequence[OneOfMany]) -> None:
        self.num_worlds, self.dt = len(worlds), DT
        self._worlds = list(worlds)
        self._made: EgoTable | None = None

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

    def egos(self, names: Sequence[str] = EGO_FIGURES) -> dict[str, FloatArray]:
        """Return state and controls of the egos, (num_worlds, num_egos) each; nan where there is none.

        Args:
            names: those of `EGO_FIGURES` that are wanted.

        Returns:
            x, y, z [m] of the middle of the rear axle on the ground; roll, pitch, yaw [rad]; speed forward and
            lateral_speed to the left [m/s]; accel forward and lateral_accel to the left [m/s^2]; yaw_rate [rad/s];
            steer, angle of the front wheels, left positive [rad]; throttle and brake 0..1; gear, a number of `Gear`;
            centre, how far the middle of the box is ahead of the rear axle [m].

        Raises:
            ValueError: there is no such figure.
        """
        if not set(names) <= set(EGO_FIGURES):
            raise ValueError(f"names: expected those of {', '.join(EGO_FIGURES)}, got {', '.join(names)}")
        egos = self._egos
        return {name: egos.gather(name) for name in names}

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
        check_number("num", num)
        return self._gather((num, len(OTHER_FIGURES)), lambda part: find_others(part, num), out)

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
        egos = self._egos
        shape = egos.is_there.shape
        if egos.whole is not None:
            figures, points = find_lanes(egos.whole, distances)
            found = {name: values.astype(np.float64).reshape(shape) for name, values in figures.items()}
            return {**found, "points": points.reshape(*shape, len(distances), 2).copy()}
        found = dict(zip(LANE_FIGURES, np.full((len(LANE_FIGURES), *shape), np.nan), strict=True))
        found["points"] = np.full((*shape, len(distances), 2), np.nan)
        for part in egos:
            if len(part.rows):
                figures, points = find_lanes(part, distances)
                found["points"][part.world, part.ego] = points
                for name, values in figures.items():
                    found[name][part.world, part.ego] = values
        return found

    def rays(self, num: int, reach: float) -> FloatArray:
        """Return what flat rays around the egos meet first: boxes of entities, or borders of the road.

        Args:
            num: rays of each ego, at equal angles, the first one forward, the second one to the left of it.
            reach: length of the rays, which begin in the middle of the box [m].

        Returns:
            (num_worlds, num_egos, num, 2) `RAY_FIGURES`: distance, `reach` where there is nothing [m]; and the speed at
            which it moves away along the ray, seen from the ego [m/s].

        Raises:
            ValueError: num is below 1, or the reach is not a positive number.
        """
        check_number("num", num)
        if not 0.0 < reach < np.inf:
            raise ValueError(f"reach: expected a positive number, got {reach!r}")
        return self._gather((num, len(RAY_FIGURES)), lambda part: cast_rays(part, num, reach))

    def grids(self, size: float, step: float) -> FloatArray:
        """Return square grids around the egos, in their axes; see `occupancy.find_grids`.

        Args:
            size: side of the square, with the middle of the rear axle in its middle [m].
            step: side of a cell [m].

        Returns:
            (num_worlds, num_egos, 4, n, n) `GRID_FIGURES`: 1 where an entity is; its velocity relative to the ego's,
            forward and left [m/s]; 1 where the road is. The last axes count from the back forwards, and from the right
            to the left.

        Raises:
            ValueError: the cells are not positive, or more than 256 a side.
        """
        num = num_cells(size, step)
        return self._gather((len(GRID_FIGURES), num, num), lambda part: find_grids(part, size, step))

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
        egos = self._egos
        found = egos.gather_run(_SCORES, WorldRows.block) | egos.gather_run(_COUNTS, WorldRows.int_block)
        found["is_off_road"] = egos.gather("is_off_road")
        return {name: found[name] for name in SCORE_FIGURES}

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
        if not 0 <= number < self.num_worlds:
            raise ValueError(f"world: expected 0..{self.num_worlds - 1}, got {number}")
        return self._worlds[number]

    def command(self, commands: Commands) -> None:
        """Command the egos from the next frame on.

        Args:
            commands: as for `Worlds.step`.

        Raises:
            ValueError: an array has another shape or holds a number that is not finite, or there are other names.
                Nothing has changed.
        """
        names = frozenset(commands) - {"steering", "gear"}
        if names not in _MODES or "steering" not in commands:
            raise ValueError(
                "commands: expected steering with throttle and brake, with speed or with accel, got"
                f" {', '.join(sorted(commands)) or 'none'}"
            )
        arrays: dict[str, FloatArray] = {}
        egos = self._egos
        for name, values in commands.items():
            arrays[name] = broadcast(name, values, egos.is_there.shape)
            if np.count_nonzero(egos.is_there & ~np.isfinite(arrays[name])):
                raise ValueError(f"{name}: expected finite numbers")
        if "gear" in arrays:
            if not np.isin(arrays["gear"][egos.is_there], list(Gear)).all():
                raise ValueError(f"gear: expected numbers within {min(Gear)}..{max(Gear)}")
            self._shift(arrays["gear"])
        for part in self._egos:
            at = part.world, part.ego
            rest = {name: arrays[name][at] for name in names}
            command_all(part.columns, part.rows, mode=_MODES[names], steer=arrays["steering"][at], **rest)

    def drive_itself(self, desired_speed: npt.ArrayLike) -> BoolArray:
        """Have egos drive themselves, as other vehicles do: along the lanes, with gaps, lights and right of way.

        They do so until they are placed elsewhere or their world is reset. Commands of `step` do not reach them then.

        Args:
            desired_speed: array that broadcasts to (num_worlds, num_egos), speed that the driver wants; limits, bends
                and other traffic make it slower [m/s]. nan for egos that stay as they are.

        Returns:
            (num_worlds, num_egos) bool, which egos drive themselves now; an ego without a lane near it does not.

        Raises:
            ValueError: the array has another shape, or a speed is negative. Nothing has changed.
        """
        wanted = self._broadcast("desired_speed", desired_speed)
        if (wanted < 0.0).any():
            raise ValueError("desired_speed: expected numbers from 0 on, or nan")
        for i, j in np.argwhere(self._egos.is_there & ~np.isnan(wanted)).tolist():
            world = self._worlds[i]
            row = int(world.rows(Kind.EGO)[j])
            if not world.has_lane[row]:
                start_self_driving(world, row, desired_speed=float(wanted[i, j]))
            elif world.desired_speed[row] != wanted[i, j]:
                world.desired_speed[row] = wanted[i, j]
                world.touch()
        self._settle()
        return self._egos.gather("has_lane") > 0.0

    def change_lanes(self, side: npt.ArrayLike) -> BoolArray:
        """Have egos that drive themselves change to the lane beside theirs, whether it is free or not.

        Args:
            side: array that broadcasts to (num_worlds, num_egos): positive for the left, negative for the right, 0 for
                none.

        Returns:
            (num_worlds, num_egos) bool, which egos begin to; those without a lane there, and those that are changing
            lanes already, do not.

        Raises:
            ValueError: the array has another shape. Nothing has changed.
        """
        sides = self._broadcast("side", side)
        begins = np.zeros(sides.shape, dtype=bool)
        for i, j in np.argwhere(self._egos.is_there & (sides != 0.0)).tolist():
            world = self._worlds[i]
            row = int(world.rows(Kind.EGO)[j])
            if world.has_lane[row]:
                begins[i, j] = change_lane(world, row, LEFT if sides[i, j] > 0.0 else RIGHT)
        self._settle()
        return begins

    def _shift(self, gears: FloatArray) -> None:
        """Shift the egos that stand; few do in a step, and each by itself."""
        for i, j in np.argwhere(self._egos.is_there & (self._egos.gather("gear") != gears)).tolist():
            world = self._worlds[i]
            shift(world, int(world.rows(Kind.EGO)[j]), Gear(int(gears[i, j])))
        self._settle()

    def _gather(
        self, shape: tuple[int, ...], find: Callable[[Part], FloatArray], out: FloatArray | None = None
    ) -> FloatArray:
        """Return what `find` returns for the egos of each part, (num_worlds, num_egos, *shape); 0 without an ego."""
        egos = self._egos
        shape = (*egos.is_there.shape, *shape)
        if out is None and egos.whole is not None:
            return find(egos.whole).reshape(shape)
        found = make_out(out, shape)
        for part in egos:
            if len(part.rows):
                found[part.world, part.ego] = find(part)
        return found

    def _broadcast(self, name: str, values: npt.ArrayLike) -> FloatArray:
        return broadcast(name, values, self._egos.is_there.shape)

    def _settle(self) -> None:
        """Take note that egos have changed; for worlds that move together."""

    @property
    def _egos(self) -> EgoTable:
        if self._made is None or not self._made.is_true(self._worlds):
            self._made = EgoTable(self._worlds)
        return self._made
