"""A set of worlds that are moved together, in as few batches as they allow."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from rosbridge_sim.world.many_worlds.batch import MAX_ROWS, PHASES, Batch, OneOfMany
from rosbridge_sim.world.many_worlds.many_roads import most_worlds
from rosbridge_sim.world.step import step

__all__ = ["WorldSet"]


class WorldSet:
    """Worlds that are moved together.

    Attributes:
        worlds: all of them, in the given order.

    Args:
        worlds: see above; none is in another set.
    """

    def __init__(self, worlds: Sequence[OneOfMany]) -> None:
        self.worlds = tuple(worlds)
        self._batches: dict[Hashable, list[Batch]] = {}
        self._alone: list[OneOfMany] = []

    def advance(self, num_frames: int = 1) -> None:
        """Move all worlds by so many frames of 20 ms.

        Args:
            num_frames: positive.
        """
        changed = [world for world in self.worlds if world.has_changed]
        if changed:
            self._place(changed)
        for batches in self._batches.values():
            for batch in batches:
                batch.advance(num_frames)
        for world in self._alone:
            for _ in range(num_frames):
                step(world)
                world.has_changed = False

    def _place(self, changed: list[OneOfMany]) -> None:
        """Put worlds into the batches that they belong to now."""
        wanted: dict[Hashable, list[OneOfMany]] = {}
        for world in changed:
            world.has_changed = False
            key = _key_of(world)
            batch = world.batch
            if batch is None or world.n > MAX_ROWS or key != _key_of_batch(batch):
                wanted.setdefault(key if world.n <= MAX_ROWS else None, []).append(world)
        for key, worlds in wanted.items():
            for world in worlds:
                if world.batch is not None:
                    world.move_to(None, -1)
                    world.has_changed = False
            if key is not None:
                self._fill(self._batches.setdefault(key, []), worlds)
        phases: dict[Hashable, list[Batch]] = {}
        for batches in self._batches.values():
            for batch in batches:
                if any(world is not None for world in batch.worlds):
                    phases.setdefault(_key_of_batch(batch), []).append(batch)
        self._batches = phases
        self._alone = [world for world in self.worlds if world.batch is None]

    @staticmethod
    def _fill(batches: list[Batch], worlds: list[OneOfMany]) -> None:
        """Take worlds into batches with free slots, and into new ones."""
        left = list(worlds)
        most = most_worlds(left[0].roads)
        while left:
            batch = next((each for each in batches if None in each.worlds or 2 * len(each.worlds) <= most), None)
            if batch is None:
                batch = Batch(left[0], min(len(left), most))
                batches.append(batch)
            world = left.pop()
            batch.add(world)
            world.has_changed = False


def _key_of(world: OneOfMany) -> Hashable:
    """Return what must be equal for worlds of one batch."""
    return (
        *(id(world.roads), id(world.plan), world.frame % PHASES, world.dynamics, world.is_creeping),
        *(world.has_stability_control, world.has_impacts, world.is_scoring, world.turn_shares),
    )


def _key_of_batch(batch: Batch) -> Hashable:
    return (
        *(id(batch.map_roads), id(batch.map_plan), batch.frame, batch.dynamics, batch.is_creeping),
        *(batch.has_stability_control, batch.has_impacts, batch.is_scoring, batch.turn_shares),
    )
