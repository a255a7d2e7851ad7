"""The watch over pairs of boxes by loops in C: which of them may touch, and the list of those that are looked at.

They make the lists that `CollisionDetector` makes, and keep a gap for each pair, not one set for all. What touches is
still judged by arrays, in the few steps in which a pair may.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.contacts.collisions import MAX_PAIRWISE, POSE_YAW, Foreseen, Watch
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.kernels.c_source import BOX_WORDS, PAIR_WORDS
from rosbridge_sim.world.kernels.loop_fields import CompiledLoops, LoopFields
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

_MORE_ROOM: Final = 2
"""Room for so many times as many pairs as there are now."""


class PairKernel:
    """See the head of this file. It lives as long as the detector.

    Args:
        library: the loops.
        world: read only.
        rows: (k,) int64, rows in use in order of their ids.
        foreseen: arrays of the detector, written.
    """

    def __init__(self, library: CompiledLoops, world: WorldRows, rows: IntArray, foreseen: Foreseen) -> None:
        self._do, self._fields, num = library, LoopFields(), len(rows)
        fields, now = self._fields, world.block("x", "z")
        self._yaw, self._at = foreseen.poses[1, POSE_YAW], fields.address
        fields.take_columns(world)
        fields.take(**foreseen._asdict(), now=now, rows=rows, is_car=world.kind[rows] <= int(Kind.VEHICLE))
        of_row = world.world_of_row
        fields.take(world=np.zeros(num, np.int64) if of_row is None else of_row[rows])
        fields.take(unit_x=np.empty_like(self._yaw), unit_y=np.empty_like(self._yaw))
        fields.take(head=np.empty(1 << (2 * num).bit_length(), np.int64), wide=np.empty(num + 1, np.int64))
        fields.take(box=np.empty((num + 1, BOX_WORDS)))
        fields["n"], fields["num_rows"], fields["stride"] = num, world.n, now.strides[0] // 8
        # Small worlds need no cells, one or many: all bodies of each are compared with each other.
        fields["is_small"] = num <= MAX_PAIRWISE or of_row is not None
        fields["num_heads"] = len(fields.arrays["head"])
        self._make_room(4 * num)

    def _make_room(self, num: int) -> None:
        self._fields.take(pairs=np.empty((2, num + 1), np.int64), pair=np.empty((num + 1, PAIR_WORDS)))
        self._fields["most_pairs"] = num + 1

    def watch(self, *, is_due: bool) -> Watch:
        """Take the poses as the step has ended, and return whether a pair may touch, or the list has ended."""
        return Watch(self._do["watch_pairs"](self._at, is_due))

    def list_pairs(self) -> IntArray | None:
        """Return the list for this step and those to come, (2, m) int64; None for a heap, see `near_pairs`."""
        arrays = self._fields.arrays
        np.cos(self._yaw, arrays["unit_x"])
        np.sin(self._yaw, arrays["unit_y"])
        num = self._do["list_pairs"](self._at)
        if num > arrays["pairs"].shape[1]:
            self._make_room(_MORE_ROOM * num)
            num = self._do["list_pairs"](self._at)
        return None if num < 0 else self._fields.arrays["pairs"][:, :num]

    def judge(self, pairs: IntArray) -> bool:
        """Return whether pairs of rows, (2, m) int64, may touch, which are the list from now on."""
        num = pairs.shape[1]
        if num > self._fields.arrays["pairs"].shape[1]:
            self._make_room(_MORE_ROOM * num)
        self._fields.arrays["pairs"][:, :num] = pairs  # usually the same array
        return bool(self._do["judge_pairs"](self._at, num))
