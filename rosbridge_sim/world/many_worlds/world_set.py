"""A set of worlds that are moved together, in as few batches as they allow. The only world of a set needs none."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray
from rosbridge_sim.world.many_worlds.batch import MAX_ROWS, PHASES, Batch, OneOfMany
from rosbridge_sim.world.many_worlds.many_roads import most_worlds
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.world.step import step


class WorldSet:
    """Worlds that are moved together.

    Attributes:
        worlds: all of them, in the given order.

    Args:
        worlds: see above; none is in another set.
    """

    def __init__(self, worlds: Sequence[OneOfMany]) -> None:
        self.worlds = tuple(worlds)
        self._batches: list[Batch] = []
        self._alone: list[OneOfMany] = []

    def advance(self, num_frames: int = 1) -> None:
        """Move all worlds by so many frames of 20 ms.

        Args:
            num_frames: positive.
        """
        self.settle()
        for batch in self._batches:
            batch.advance(num_frames)
        for world in self._alone:
            for _ in range(num_frames):
                step(world)

    def worlds_with(self, test: Callable[[WorldRows], BoolArray]) -> set[OneOfMany]:
        """Return the worlds in which a test of all rows, (n,), is true for one of them."""
        found = {world for world in self._alone if test(world).any()}
        for batch in self._batches:
            slots = np.unique(test(batch).nonzero()[0] % batch.num_worlds).tolist()
            found.update(world for slot in slots if (world := batch.worlds[slot]) is not None)
        return found

    def settle(self) -> None:
        """Put all worlds into the batches that they belong to now; `advance` does it, too."""
        changed = [world for world in self.worlds if world.has_changed]
        if changed:
            self._place(changed)
        for batch in self._batches:
            batch.bind_rows()

    def _place(self, changed: list[OneOfMany]) -> None:
        """Put worlds into the batches that they belong to now."""
        wanted: dict[Hashable, list[OneOfMany]] = {}
        for world in changed:
            world.has_changed = False
            key = _key_of(world)
            if world.n > MAX_ROWS or len(self.worlds) == 1:
                if world.batch is not None:
                    world.move_to(None, -1)
            elif world.batch is None or key != _key_of(world.batch):
                wanted.setdefault(key, []).append(world)
            else:
                world.batch.look_at(world)
        for key, worlds in wanted.items():
            for world in worlds:
                if world.batch is not None:
                    world.move_to(None, -1)
            self._fill(key, worlds)
            for world in worlds:
                world.has_changed = False
        self._batches = [batch for batch in self._batches if any(world is not None for world in batch.worlds)]
        self._alone = [world for world in self.worlds if world.batch is None]

    def _fill(self, key: Hashable, worlds: list[OneOfMany]) -> None:
        """Take worlds into batches of a key, and into new ones."""
        most = most_worlds(worlds[0].roads)
        left = list(worlds)
        for batch in [each for each in self._batches if _key_of(each) == key]:
            can_double = 2 * batch.num_worlds <= most
            room = batch.worlds.count(None) + can_double * batch.num_worlds
            for world in left[:room]:
                batch.add(world)
            left = left[room:]
        while left:
            batch = Batch(left[0], min(len(left), most))
            self._batches.append(batch)
            for world in left[:most]:
                batch.add(world)
            left = left[most:]


def _key_of(world: WorldRows) -> Hashable:
    """Return what must be equal for worlds of one batch, of such a world or of the batch."""
    return (
        *(world.roads.alone.digest, world.plan.digest, world.frame % PHASES, world.dynamics, world.is_creeping),
        *(world.has_stability_control, world.has_impacts, world.is_scoring, world.turn_shares, world.friction_share),
    )
