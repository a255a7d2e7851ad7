"""The egos of one world or of many, judged by loops in C, to the last bit as by arrays.

Rare things stay with numpy: contacts, stop lines that may be passed, and pairs that may meet within the horizon. The
loops find these, a few too many, and arrays judge them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.contacts.collisions import POSE_X, POSE_Y, CollisionDetector
from rosbridge_sim.world.contacts.time_to_collision import find_times_of_pairs, find_times_to_collision
from rosbridge_sim.world.geometry.planar import ComplexArray, FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.geometry.segment_cells import AROUND
from rosbridge_sim.world.geometry.segment_search import SegmentSearch
from rosbridge_sim.world.kernels import c_source
from rosbridge_sim.world.kernels.c_source import CELL_PLACES, CELL_WORDS, FOR_EGOS, MORE_PAIRS, NO_ROOM
from rosbridge_sim.world.kernels.loop_fields import CompiledLoops, LoopFields
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.stop_lines import StopLines
from rosbridge_sim.world.scoring import Before, Edges, count_contacts, judge_lines
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.world.vehicle.ground import farthest_edge

MAX_SEGMENTS: Final = 1 << 20
"""Segments of cells that are kept, 8 MB; then all are found anew."""


def measures_alike(library: CompiledLoops) -> bool:
    """Return whether distances by the C library have the bits of numpy's: the loops need those."""
    fields, num = LoopFields(), 1000
    fields.make(FOR_EGOS, num)
    rng, found = np.random.default_rng(0), fields.arrays
    found["to_left"][:], found["to_right"][:] = rng.normal(size=(2, num)) * 10.0 ** rng.integers(-3, 3, (2, num))
    fields["n"] = num
    library["measure"](fields.address)
    return bool((found["lateral_below"] == np.hypot(found["to_left"], found["to_right"])).all())


class _Cells:
    """The segments of a map by cell, as loops keep them; see `SegmentCells`, and `scores.c`.

    All arrays are as large as they may become: the system gives their memory when it is first written to.

    Attributes:
        arrays: of the structure.
    """

    def __init__(self, roads: Roads) -> None:
        low, high, first, size = SegmentSearch(roads.segments, len(roads)).blocks
        self.arrays: dict[str, npt.NDArray[Any]] = {
            "block_low": low,
            "block_high": high,
            "block_first": first,
            "block_size": size,
            "block_away": np.zeros(len(first)),
            "kept_cost": np.zeros(MAX_SEGMENTS),
            "cells": np.zeros(CELL_PLACES * CELL_WORDS, dtype=np.int64),
            "cell_segment": np.zeros(MAX_SEGMENTS, dtype=np.int64),
            "used": np.zeros(2, dtype=np.int64),
        }
        self._roads = roads

    def fill(self, fields: LoopFields) -> None:
        """Give a structure all that a search for lanes needs."""
        roads = self._roads
        fields.copy(roads, c_source.OF_ROADS)
        fields.copy(roads.segments, c_source.OF_SEGMENTS, "segment_")
        fields.take(**self.arrays)
        fields["num_points"], fields["is_flat"] = len(roads.points), roads.is_flat
        fields["num_blocks"], fields["cell_room"] = len(self.arrays["block_first"]), MAX_SEGMENTS

    def search(self, address: int, loop: Callable[[int], int]) -> int:
        """Run a loop that looks for lanes, with the structure at an address; return its answer."""
        found = loop(address)
        if found == NO_ROOM:  # begin anew
            self.arrays["cells"][:] = self.arrays["used"][:] = 0
            found = loop(address)
        return found


def _yaws_below(fields: LoopFields) -> FloatArray:
    """Return the directions of lanes at the places that a loop has found [rad]."""
    yaw: FloatArray = fields.arrays["yaw_below"]
    return wrap_angle(yaw + np.arctan(fields.arrays["slope_below"])) if fields["num_curved"] else yaw


class _Look:
    """The lanes below some egos and ahead of them; see `scoring.Loops.look`.

    Attributes:
        rows: (k,) int64.
        ahead: (p,) [m].
    """

    def __init__(
        self, library: CompiledLoops, world: WorldRows, rows: IntArray, ahead: FloatArray, straight_on: IntArray
    ) -> None:
        self.rows, self.ahead = rows, ahead
        roads, num = world.roads.alone, len(rows)
        self._do, self._world, self._roads, self._cells = library, world, roads, roads.derived(_Cells)
        self._fields = fields = LoopFields()
        self._cells.fill(fields)
        fields.take_columns(world)
        fields.make(FOR_EGOS, num)
        self._cosine, self._sine, self._points = np.zeros(num), np.zeros(num), np.zeros((num, len(ahead), 2))
        fields.take(rows=rows, straight_on=straight_on, ahead=ahead, points_ahead=self._points)
        fields.take(cosine=self._cosine, sine=self._sine)
        fields["n"], fields["num_ahead"] = num, len(ahead)

    def find(self) -> tuple[dict[str, FloatArray], FloatArray] | None:
        """Return what `surroundings.find_lanes` returns; None if arrays must find it."""
        fields, yaw = self._fields, self._world.yaw[self.rows]
        np.cos(yaw, self._cosine)
        np.sin(yaw, self._sine)
        if self._cells.search(fields.address, self._do["look_at_lanes"]):
            return None
        arrays = fields.arrays
        lane = arrays["lane_below"]
        figures = {
            "offset": arrays["lateral_below"],
            "heading": wrap_angle(yaw - _yaws_below(fields)),
            "to_left": arrays["to_left"],
            "to_right": arrays["to_right"],
            "speed_limit": self._roads.speed_limit[lane],
            "is_on_road": arrays["is_on"],
            "s": arrays["s_below"],
            "lane": lane,
        }
        return figures, self._points


class _Others:
    """The entities nearest to some egos; see `scoring.Loops.see_others`.

    Attributes:
        rows: (k,) int64.
        num: entities of each.
    """

    def __init__(self, library: CompiledLoops, world: WorldRows, rows: IntArray, num: int) -> None:
        self.rows, self.num = rows, num
        self._do, self._yaw, self._fields = library, world.yaw, LoopFields()
        fields, size = self._fields, num * len(rows)
        fields.take_columns(world)
        fields.make(c_source.FOR_OTHERS, size)
        self._seen = np.zeros((len(rows), num, c_source.NUM_FIGURES))
        fields.take(rows=rows, seen=self._seen, cosine=np.zeros(world.n), sine=np.zeros(world.n))
        fields["n"], fields["num_seen"] = len(rows), num
        fields["num_rows"], fields["num_worlds"] = world.n, world.num_worlds

    def find(self) -> FloatArray | None:
        """Return what `surroundings.find_others` returns; None if arrays must find it."""
        arrays, at = self._fields.arrays, self._fields.address
        np.cos(self._yaw, arrays["cosine"])
        np.sin(self._yaw, arrays["sine"])
        if self._do["find_others"](at):
            return None
        np.cos(arrays["turn_by"], arrays["turn_cosine"])
        np.sin(arrays["turn_by"], arrays["turn_sine"])
        self._do["describe_others"](at)
        return self._seen.copy()


class ScoreKernel:
    """See the head of this file. It lives until the next `World.touch`.

    Args:
        library: the loops.
        world: written.
    """

    def __init__(self, library: CompiledLoops, world: WorldRows) -> None:
        self._do, self._world, self._fields = library, world, LoopFields()
        self._at = self._fields.address
        self._rows = rows = world.rows(Kind.EGO)
        roads, fields, num = world.roads.alone, self._fields, len(rows)
        self._cells, edges = roads.derived(_Cells), roads.derived(Edges)
        self._is_fit = farthest_edge(roads) <= AROUND
        fields.take_columns(world)
        self._cells.fill(fields)
        fields.take(
            rows=rows,
            edge_reach=np.array([farthest_edge(roads)]),
            edges_from=edges.first,
            edges_to=edges.last,
            left_lane=roads.left,
            right_lane=roads.right,
            controller=world.signals.plan.controller_of_lane,
            lines=roads.derived(StopLines).lines_of(world.signals.plan),
        )
        fields.make(FOR_EGOS, num)
        room = 2 * num + MORE_PAIRS
        self._pairs = np.zeros(room, np.int64), np.zeros((2, room), np.int64)
        self._poses = world.derived(CollisionDetector).poses
        self._angle, self._cosine, self._sine = (np.zeros(3 * num) for _ in range(3))
        fields.take(angle=self._angle, cosine=self._cosine, sine=self._sine)
        fields.take(poses=self._poses, across=np.zeros(num))
        fields.take(pair_ego=self._pairs[0], pair_row=self._pairs[1])
        fields["n"], fields["num_rows"], fields["num_worlds"] = num, world.n, world.num_worlds
        fields["num_lines"] = len(fields.arrays["lines"])
        self._look: _Look | None = None
        self._others: _Others | None = None

    def judge(self, before: Before) -> bool:
        """See `scoring.judge`; False if a place is too far away, or roads are too wide, for cells."""
        do, at, fields = self._do, self._at, self._fields
        fields.take(before_accel=before.accel, before_uid=before.uid)
        fields["num_before"] = len(before.uid)
        do["list_headings"](at)
        np.cos(self._angle, self._cosine)
        np.sin(self._angle, self._sine)
        found = self._cells.search(at, do["judge_egos"]) if self._is_fit else c_source.WITH_ARRAYS
        if found == c_source.NEAR_EDGES:
            self._measure_across()
            found = do["judge_egos"](at)
        if found < 0:
            return False
        count_contacts(self._world, self._rows, before.contacts)
        if found & 1:
            self._judge_lines()
        if found > 1:
            self._judge_meetings(found >> 1)
        return True

    def _headings(self) -> tuple[ComplexArray, ComplexArray]:
        """Return the directions of the egos as the step began and as it ended, (k,) each."""
        start, end, _ = (self._cosine + 1j * self._sine).reshape(3, -1)
        return start, end

    def _measure_across(self) -> None:
        """Work out how far boxes reach across their lanes, as `scoring._judge_lanes` does."""
        world, rows, fields = self._world, self._rows, self._fields
        turned = self._headings()[1] * np.exp(-1j * _yaws_below(fields))
        along, across = np.abs(turned.imag) * world.half_length[rows], np.abs(turned.real) * world.half_width[rows]
        np.add(along, across, fields.arrays["across"])
        fields["has_across"] = True

    def _judge_lines(self) -> None:
        """Count stop lines and red lights passed."""
        world, rows = self._world, self._rows
        start, end = self._headings()
        reach = world.half_length[rows] + world.centre[rows]
        places = self._poses[:, POSE_X, rows] + 1j * self._poses[:, POSE_Y, rows]
        judge_lines(world, rows, (places[0] + reach * start, places[1] + reach * end), end)

    def look(
        self, rows: IntArray, ahead: FloatArray, straight_on: IntArray
    ) -> tuple[dict[str, FloatArray], FloatArray] | None:
        """See `scoring.Loops`."""
        look = self._look
        if look is None or look.rows is not rows or look.ahead.tobytes() != ahead.tobytes():
            look = self._look = _Look(self._do, self._world, rows, ahead, straight_on)
        return look.find()

    def see_others(self, rows: IntArray, num: int) -> FloatArray | None:
        """See `scoring.Loops`."""
        others = self._others
        if others is None or others.rows is not rows or others.num != num:
            others = self._others = _Others(self._do, self._world, rows, num)
        return others.find()

    def _judge_meetings(self, num: int) -> None:
        """Bring the times to collision up to date; there are so many pairs that may meet."""
        world, rows, (egos, pairs) = self._world, self._rows, self._pairs
        if num > len(egos):
            times = find_times_to_collision(world, rows)
        else:
            times = find_times_of_pairs(world, len(rows), egos[:num], pairs[:, :num])
        world.time_to_collision[rows] = times
        world.min_time_to_collision[rows] = np.fmin(world.min_time_to_collision[rows], times)
