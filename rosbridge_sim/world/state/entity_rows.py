"""Which entity is in which row: ids, names and bodies, and the rows that are free."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.state.entity_types import NO_BODY, Body, Kind
from rosbridge_sim.world.state.row_motion import RowMotion

MAX_UID: Final = 2**31 - 1
"""The greatest id: messages carry ids as int32."""


class EntityRows(RowMotion):
    """The rows of one world by the ids of their entities.

    Attributes:
        names, bodies: of the entities, lists of length n.
    """

    names: list[str]
    bodies: list[Body]
    _rows: dict[int, int]  # uid -> row, in order of spawning
    _next_uid: int

    def row(self, uid: int) -> int:
        """Return the row of an entity.

        Raises:
            KeyError: no entity has this id.
        """
        return self._rows[uid]

    def rows(self, kind: Kind) -> IntArray:
        """Return the rows of a kind in order of spawning, (k,) int64; do not write into the array."""
        return self.derived(_rows_by_kind)[kind]

    def placed(self) -> Iterator[int]:
        """Yield the rows in use in order of spawning."""
        return iter(self._rows.values())

    def __contains__(self, uid: object) -> bool:
        return uid in self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def body_of(self, row: int) -> Body:
        """Return the body of the entity in a row."""
        return self.bodies[row]

    @contextmanager
    def room_for(self, num: int) -> Iterator[None]:
        """Return a context in which `num` entities can be spawned, each in a third of the usual time."""
        num_rows = max(self.n, len(self._rows) + num)
        if num_rows > self._floats.shape[1]:
            self._grow(num_rows)
        self._bind(num_rows)
        try:
            yield
        finally:
            self._trim()
            self.touch()

    # -- internals

    def _allocate(self, n: int) -> None:
        """Take new blocks, with n free rows."""
        self.names, self.bodies = [], []
        super()._allocate(n)

    def _bind(self, n: int) -> None:
        """Set the number of rows."""
        super()._bind(n)
        self.names[n:] = [""] * (n - len(self.names))
        self.bodies[n:] = [NO_BODY] * (n - len(self.bodies))

    def _choose_uid(self, uid: int | None) -> tuple[int, int]:
        """Return the id to give and the next one to hand out after it."""
        if uid is None:
            if self._next_uid > MAX_UID:
                raise ValueError("uid: all ids were given; they begin anew with a reset")
            return self._next_uid, self._next_uid + 1
        if not 0 <= uid <= MAX_UID:
            raise ValueError(f"uid: expected 0..{MAX_UID}, got {uid!r}")
        if uid in self._rows:
            raise ValueError(f"uid: {uid} is in use")
        return int(uid), max(self._next_uid, int(uid) + 1)

    def _trim(self) -> None:
        """Drop the free rows at the end."""
        alive = np.flatnonzero(self.alive)
        self._bind(int(alive[-1]) + 1 if len(alive) else 0)

    def _take_row(self) -> int:
        """Return the first row that is free, after making one if there is none."""
        if len(self._rows) < self.n:
            return int(self.alive.argmin())
        row = self.n
        if row == self._floats.shape[1]:
            self._grow(row + 1)
        self._bind(row + 1)
        return row


def _rows_by_kind(world: EntityRows) -> dict[Kind, IntArray]:
    """Return the rows of each kind, in order of spawning."""
    rows = np.fromiter(world.placed(), dtype=np.int64)
    return {kind: rows[world.kind[rows] == kind] for kind in Kind}
