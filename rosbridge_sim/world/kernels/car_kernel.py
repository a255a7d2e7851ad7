"""The driven rows of the single track model, moved by loops in C, to the last bit as by arrays."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.kernels.car_source import car_stages
from rosbridge_sim.world.kernels.loop_fields import CompiledLoops, LoopFields
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.world.vehicle.dynamics import FIRST, LAST


class CarKernel:
    """See the head of this file. It lives until the next `World.touch`.

    Args:
        library: the loops.
        world: written.
        rows: (k,) int64, driven rows.
    """

    def __init__(self, library: CompiledLoops, world: WorldRows, rows: IntArray) -> None:
        stages, now = car_stages(is_stable=world.has_stability_control), world.block(FIRST, LAST)
        fields = self._fields = LoopFields()
        args, found = np.zeros((2, stages.num_args, len(rows)))
        fields.take(now=now, rows=rows, args=args, found=found, kept=np.zeros((stages.num_kept, len(rows))))
        fields["n"], fields["stride"] = len(rows), now.strides[0] // 8
        first = len(car_stages(is_stable=False).bodies) if world.has_stability_control else 0
        self._calls: list[Callable[[], object]] = [partial(library["drive_cars"], fields.address, first)]
        for stage, calls in enumerate(stages.calls, first + 1):
            self._calls += [partial(getattr(np, name), args[begin:end], found[begin:end]) for name, begin, end in calls]
            self._calls.append(partial(library["drive_cars"], fields.address, stage))

    def advance(self) -> None:
        """Move the rows."""
        for call in self._calls:
            call()
