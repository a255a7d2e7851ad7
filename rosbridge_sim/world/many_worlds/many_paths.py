"""The paths of many worlds in one store, so that one search finds the segments of all entities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.paths import Paths


class ManyPaths(Paths):
    """The stores of some worlds, one after another; read only.

    Attributes:
        first_key: (w,) int64, what is added to the bases of each world.

    Args:
        stores: of the worlds.
    """

    __slots__ = ("first_key",)

    def __init__(self, stores: Sequence[Paths]) -> None:
        super().__init__()
        lengths = np.array([store.next_base for store in stores], dtype=np.int64)
        self.first_key: IntArray = np.cumsum(lengths) - lengths
        used = [(store, key) for store, key in zip(stores, self.first_key.tolist(), strict=True) if store.num]
        if used:
            self.keys = np.concatenate([store.keys + key for store, key in used])
            self.segments = np.concatenate([store.segments for store, _ in used])
        self.num = len(self.keys)
