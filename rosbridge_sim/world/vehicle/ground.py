"""Friction of the ground below driven rows: that of a road, or less beside all roads.

It is looked up only where it counts: every `INTERVAL` steps, for rows whose tyres or brakes use so much of it that the
two kinds of ground differ. Until then a row keeps the last value. On a map without lanes all is road.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.geometry.segment_search import BESIDE
from rosbridge_sim.world.roads.road_places import MAX_EDGE
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.entity_types import ROAD_FRICTION
from rosbridge_sim.world.state.world_rows import WorldRows

OFF_ROAD_FRICTION: Final = 0.6
"""Friction of gravel (Wong, Theory of Ground Vehicles, table 1.3); dry earth has a little more."""

PLACES_AT_ONCE: Final = 1 << 10
"""A search for lanes near places does not look at all places of a larger crowd."""

INTERVAL: Final = 5
"""Steps from one look to the next: a tenth of a second, in which a car at 20 m/s goes half its length."""

NEAR_LIMIT: Final = 3.0
"""A row uses its grip when its acceleration is above this, or its brake pedal could make it so [m/s^2]. It is half of
what the ground beside roads can give: below, the two kinds of ground change the path by a few per cent."""


def find_friction(world: WorldRows, rows: IntArray) -> None:
    """Bring the friction below some rows up to date, if this frame is one for a look.

    Args:
        world: written in place.
        rows: (k,) int64, driven rows.
    """
    if world.frame % INTERVAL or not len(world.roads):
        return
    accel, lateral = world.accel[rows], world.lateral_accel[rows]
    near = (accel * accel + lateral * lateral > NEAR_LIMIT * NEAR_LIMIT).nonzero()[0]
    if len(near):
        those = rows[near]
        is_on = are_on_road(world.roads, world.x[those], world.y[those], world.z[those])
        world.friction[those] = np.where(is_on, ROAD_FRICTION, OFF_ROAD_FRICTION) * world.friction_share


def are_on_road(roads: Roads, x: FloatArray, y: FloatArray, z: FloatArray) -> BoolArray:
    """Return which places are within the edges of any lane.

    Args:
        roads: at least one lane.
        x: (k,) east [m].
        y: (k,) north [m].
        z: (k,) heights; lanes on another level do not count, unless the map is flat [m].
    """
    is_on = np.zeros(len(x), dtype=bool)
    for start in range(0, len(x), PLACES_AT_ONCE):  # nearly always one part
        part = slice(start, start + PLACES_AT_ONCE)
        owner, places = roads.within(x[part], y[part], np.full(len(x[part]), roads.derived(farthest_edge)))
        to_left, to_right = roads.beside(places)
        is_within = (to_left >= 0.0) & (to_right >= 0.0)
        if not roads.is_flat:
            is_within &= roads.are_level(places, z[start + owner])
        is_on[start + owner[is_within]] = True
    return is_on


def farthest_edge(roads: Roads) -> float:
    """Return a distance of chords within which all places of roads lie [m]. A search this narrow is fast."""
    segments = roads.segments
    start, growth = roads.curve[segments.point].T
    bulge = 0.25 * segments.length**2 * np.fmax(np.abs(start), np.abs(start + growth * segments.length))
    return min(float(roads.border.max(initial=0.0) + bulge.max(initial=0.0)) + BESIDE, MAX_EDGE)
