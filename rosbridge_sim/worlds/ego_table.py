"""The egos of many worlds as arrays (num_worlds, num_egos): where their rows are, and how columns are gathered."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, IntArray
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

_NUM_CHANGES: Final = attrgetter("num_changes")


class Part(Record, eq=False):
    """The egos whose rows are in one set of columns.

    Attributes:
        columns: a batch, or a world that is alone.
        rows: (k,) int64, rows of the egos there.
        world, ego: (k,) int64, their places in the arrays.
    """

    columns: WorldRows
    rows: IntArray
    world: IntArray
    ego: IntArray


class EgoTable:
    """The egos of some worlds.

    Attributes:
        is_there: (num_worlds, num_egos) bool, the world has so many egos.
        parts: where their columns are.
        whole: the only one of these, if all egos are there: then its arrays have the order of the egos; else None.
    """

    def __init__(self, worlds: Sequence[OneOfMany]) -> None:
        egos = [world.rows(Kind.EGO) for world in worlds]
        num = max((len(rows) for rows in egos), default=0)
        self.is_there: BoolArray = np.zeros((len(worlds), num), dtype=bool)
        found: dict[int, tuple[WorldRows, list[tuple[int, int, int]]]] = {}
        for i, (world, rows) in enumerate(zip(worlds, egos, strict=True)):
            columns: WorldRows = world if world.batch is None else world.batch
            slot = 0 if world.batch is None else world.slot
            places = found.setdefault(id(columns), (columns, []))[1]
            for j, row in enumerate(rows.tolist()):
                self.is_there[i, j] = True
                places.append((row * columns.num_worlds + slot, i, j))
        self.parts = [
            Part(columns, *np.array(places, dtype=np.int64).reshape(-1, 3).T.copy())
            for columns, places in found.values()
        ]
        self.whole = self.parts[0] if len(self.parts) == 1 and self.is_there.all() else None
        if self.whole is not None:
            self._rows: IntArray = self.whole.rows.reshape(self.is_there.shape)
        self._seen = list(map(_NUM_CHANGES, worlds))

    def is_true(self, worlds: Sequence[OneOfMany]) -> bool:
        """Return whether the rows are still where they were."""
        return self._seen == list(map(_NUM_CHANGES, worlds))

    def __iter__(self) -> Iterator[Part]:
        return iter(self.parts)

    def gather(self, name: str) -> npt.NDArray[np.float64]:
        """Return a column of the egos, (num_worlds, num_egos) float64; nan where there is no ego."""
        if self.whole is not None:
            column: npt.NDArray[Any] = getattr(self.whole.columns, name)
            return column.take(self._rows).astype(np.float64, copy=False)
        values = np.full(self.is_there.shape, np.nan)
        for part in self.parts:
            values[part.world, part.ego] = getattr(part.columns, name)[part.rows]
        return values

    def gather_run(
        self, names: Sequence[str], block_of: Callable[[WorldRows, str, str], npt.NDArray[Any]]
    ) -> dict[str, npt.NDArray[np.float64]]:
        """Return neighbouring columns by name, each as `gather` does.

        Args:
            block_of: `WorldRows.block` for floats, `WorldRows.int_block` for whole numbers.
        """
        if self.whole is None:
            return {name: self.gather(name) for name in names}
        block = block_of(self.whole.columns, names[0], names[-1]).take(self._rows, axis=1)
        return dict(zip(names, block.astype(np.float64, copy=False), strict=True))
