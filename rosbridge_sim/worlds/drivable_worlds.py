"""Worlds as drivers see and command them, whatever moves them: egos, lanes, other entities, scores, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.state.commands import command_all, shift
from rosbridge_sim.world.state.world import DT, Gear, Kind, Mode, World
from rosbridge_sim.worlds.ego_table import EgoTable
from rosbridge_sim.worlds.surroundings import LANE_FIGURES, OTHER_FIGURES, find_lanes, find_lights, find_others

__all__ = ["EGO_FIGURES", "SCORE_FIGURES", "Commands", "DrivableWorlds", "check_number"]

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

    Args:
        worlds: the worlds.
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
        check_number("num", num)
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
        self._settle()

    def _settle(self) -> None:
        """Take note that egos have changed; for worlds that move together."""

    @property
    def _egos(self) -> EgoTable:
        if self._made is None or not self._made.is_true(self._worlds):
            self._made = EgoTable(self._worlds)
        return self._made


def check_number(name: str, value: object) -> None:
    """Check that an argument is a whole number from 1 on.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name}: expected a whole number from 1 on, got {value!r}")


def _out(out: FloatArray | None, shape: tuple[int, ...]) -> FloatArray:
    """Return zeros, or the caller's array as zeros."""
    if out is None:
        return np.zeros(shape)
    if out.shape != shape:
        raise ValueError(f"out: expected shape {shape}, got {out.shape}")
    out[:] = 0.0
    return out
