"""The crossings of the paths that pedestrians have, kept in arrays while actors come and go.

At each change of a scene the crossings of all its pedestrians are asked for at once. So they lie end to end in a table,
and each path has a number in it: of 20,000 pedestrians it takes 10 ms, where 20,000 small arrays would take 50 ms.

A table never changes. With a new path there is a new table, so a rehearsal in another thread may use it as well: at
worst one of the two looks at a path again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from rosbridge_sim.records import Record, asdict
from rosbridge_sim.world.geometry.planar import IntArray, ranges
from rosbridge_sim.world.people.crossings import Crossings, find_crossings
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World

MAX_KNOWN: Final = 24_000
"""Paths whose crossings are kept: more than a full scene has entities, so those in use stay. A path takes 0.5 kB, and
0.2 to 1 ms to look at."""

FARTHEST: Final = 0.9
"""Greatest distance at which a pedestrian walks to the right of its path [m]: within a crosswalk of 3 m."""

_Key = tuple[bytes, bytes]
"""Digests of the plan of the lights and of the path."""


class _Table(Record, eq=False):
    """The crossings of all known paths, end to end.

    Attributes:
        numbers: of the paths, the oldest first.
        count: (p,) int64, how many crossings the path with a number has.
        crossings: of all of them, in the order of the numbers.
    """

    numbers: dict[_Key, int]
    count: IntArray
    crossings: Crossings

    def of(self, numbers: IntArray) -> tuple[IntArray, Crossings]:
        """Return how many crossings paths have, and all these end to end."""
        count = self.count[numbers]
        rows = ranges((np.cumsum(self.count) - self.count)[numbers], count)
        all_of = self.crossings
        return count, Crossings(*(column[rows] for column in asdict(all_of).values()))


_NO_ROWS: Final = np.empty(0, dtype=np.int64)
_NO_CROSSINGS: Final = Crossings(np.empty(0), np.empty(0), _NO_ROWS, np.empty((0, 4)))


class KnownCrossings:
    """The crossings of the paths that were looked at, on some roads."""

    def __init__(self, _roads: Roads) -> None:
        self._table = _Table({}, _NO_ROWS, _NO_CROSSINGS)

    def of(self, worlds: Sequence[World], uids: Sequence[int]) -> tuple[IntArray, Crossings]:
        """Return the crossings of the paths of entities.

        Returns:
            How many each has, (k,) int64, and all of them end to end.
        """
        pairs = list(zip(worlds, uids, strict=True))
        keys = [(world.plan.digest, world.paths.content_of(uid)) for world, uid in pairs]
        table = self._table
        numbers = list(map(table.numbers.get, keys))
        if None in numbers:
            missing = {key: pair for key, pair, number in zip(keys, pairs, numbers, strict=True) if number is None}
            table = self._table = _extend(_make_room(table, len(missing), set(keys)), missing)
            numbers = [table.numbers[key] for key in keys]
        return table.of(np.array(numbers, dtype=np.int64))


def _extend(table: _Table, missing: dict[_Key, tuple[World, int]]) -> _Table:
    """Return a table with more paths: the entities that have them, by key."""
    found = [find_crossings(world.paths.of(uid), world.roads, world.plan, FARTHEST) for world, uid in missing.values()]
    parts = [table.crossings, *found]
    return _Table(
        {**table.numbers, **{key: len(table.count) + i for i, key in enumerate(missing)}},
        np.append(table.count, [len(each.start) for each in found]),
        Crossings(
            *(np.concatenate(columns) for columns in zip(*(asdict(each).values() for each in parts), strict=True))
        ),
    )


def _make_room(table: _Table, num: int, in_use: set[_Key]) -> _Table:
    """Return a table without the oldest paths that are not in use, if there is no room for so many more."""
    surplus = len(table.numbers) + num - MAX_KNOWN
    if surplus <= 0:
        return table
    unused = [key for key in table.numbers if key not in in_use]
    gone = set(unused[: surplus + MAX_KNOWN // 8])
    kept = {key: number for key, number in table.numbers.items() if key not in gone}
    count, crossings = table.of(np.array(list(kept.values()), dtype=np.int64))
    return _Table(dict(zip(kept, range(len(kept)), strict=True)), count, crossings)
