"""Contacts among pedestrians and obstacles, which `World.contacts` does not have: for stories that ask for them."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.contacts.collisions import TOUCHING
from rosbridge_sim.world.geometry.planar import IntArray, do_boxes_meet, in_columns, ranges
from rosbridge_sim.world.state.world import Kind, World


def find_without_cars(world: World) -> IntArray:
    """Return the pairs of pedestrians and obstacles whose boxes overlap now, as in `collisions`.

    Args:
        world: read only.

    Returns:
        (m, 2) int64, ids, the lower first, in rising order.
    """
    rows = (world.alive & (world.kind > int(Kind.VEHICLE))).nonzero()[0]
    heading = np.cos(world.yaw[rows]) + 1j * np.sin(world.yaw[rows])
    middle = world.x[rows] + 1j * world.y[rows] + heading * world.centre[rows]
    half = np.maximum(in_columns(world.half_length[rows], world.half_width[rows]) - 0.5 * TOUCHING, 0.0)
    # By their western ends, each with all that begin before its eastern end.
    reach = np.hypot(half[:, 0], half[:, 1])
    order = (middle.real - reach).argsort(kind="stable")
    west, east = (middle.real - reach)[order], (middle.real + reach)[order]
    here = np.arange(len(rows))
    count = west.searchsorted(east, side="right") - here - 1
    pairs = order[np.stack([here.repeat(count), ranges(here + 1, count)])]
    apart = middle[pairs[1]] - middle[pairs[0]]
    low = world.z[rows]
    top = low + world.height[rows] - TOUCHING
    is_hit = do_boxes_meet(apart, apart, heading[pairs], half[pairs])
    is_hit &= (low[pairs] < top[pairs[::-1]]).all(axis=0)
    return np.unique(np.sort(world.uid[rows][pairs[:, is_hit]], axis=0).T, axis=0)
