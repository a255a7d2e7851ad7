"""Frame, chance, lanes and lights of the world that a row belongs to.

A step works on columns, and never asks how many worlds the rows are of. Here they are all of one world, so the answers
are those of that world. `many_worlds.Batch` has the rows of many worlds, and answers for each row.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.chance import salt_of
from rosbridge_sim.world.state.row_motion import RowMotion

NO_ROUTE: IntArray = np.empty(0, dtype=np.int64)
NO_ROUTE.flags.writeable = False


class RowWorlds(RowMotion):
    """The columns of all entities, with the world of each row.

    Attributes:
        frame: steps done since the last reset; simulated time is frame * 20 ms.
        seed: of all chance in the world; see `chance`.
        world_of_row: (n,) int64, which world a row belongs to; None where all rows are of one world.
    """

    frame: int
    seed: int
    world_of_row: IntArray | None = None

    def frames(self, _rows: IntArray) -> int | IntArray:
        """Return the frame of the world of each row, (k,) int64, or one frame for all."""
        return self.frame

    def salts(self, rows: IntArray) -> npt.NDArray[np.uint64]:
        """Return the `salt_of` the entities in rows, (k,) uint64."""
        return salt_of(self.seed, self.uid[rows])

    def ids(self) -> IntArray:
        """Return numbers that tell all entities of all worlds apart, (n,) int64; rising by world, then by id."""
        return self.uid

    def routes_of(self, rows: IntArray) -> list[IntArray]:
        """Return the routes of rows, in rows of the lanes of `roads`; an empty list if no entity has one."""
        return [self.routes.get(uid, NO_ROUTE) for uid in self.uid[rows].tolist()] if self.routes else []

    def own_lanes(self, _rows: IntArray, lane: IntArray) -> IntArray:
        """Return lanes of the map as lanes of `roads`: of the worlds of rows (k,); -1 stays -1."""
        return lane

    def own_lights(self, _rows: IntArray, light: IntArray) -> IntArray:
        """Return lights of the plan as lights of `signals.shown`: of the worlds of rows (k,); -1 stays -1."""
        return light

    def worlds_of(self, _rows: IntArray, _others: IntArray) -> tuple[IntArray, IntArray] | None:
        """Return the worlds of rows, (k,) int64, and of other rows, (m,) int64; None where all are of one world."""
        return None

    def most_of_world(self, values: FloatArray, _rows: IntArray, _others: IntArray) -> float | FloatArray:
        """Return the greatest of values, at least 0, or for each other row, (m,), the greatest in its world.

        Args:
            values: (k,) of rows.
            _rows: (k,) int64.
            _others: (m,) int64, rows.
        """
        return float(values.max(initial=0.0))

    def path_bases(self, rows: IntArray) -> IntArray:
        """Return the bases of the paths of rows in `paths`, (k,) int64."""
        return self.path_base[rows]
