"""Pairs of things that are in one world, where arrays have the things of many worlds."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray, ranges


def pair_in_worlds(world: IntArray, other_world: IntArray) -> tuple[IntArray, IntArray]:
    """Return all pairs of a thing and another one in the same world.

    Args:
        world: (k,) int64, the world of each thing.
        other_world: (m,) int64, the world of each other one.

    Returns:
        (p,) int64, indices of the things, rising, and (p,) int64, indices of the others, rising for each thing.
    """
    order = other_world.argsort(kind="stable")
    ordered = other_world[order]
    first = ordered.searchsorted(world)
    count = ordered.searchsorted(world, side="right") - first
    return np.arange(len(world)).repeat(count), order[ranges(first, count)]
