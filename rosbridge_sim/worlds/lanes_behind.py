"""Lanes that a drive reaches after the end of its first lane, for goals."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, IntArray
from rosbridge_sim.world.roads.lane_change_map import LaneNeighbours
from rosbridge_sim.world.state.world import World


def find_lanes_behind(world: World, start: int, wanted: IntArray) -> BoolArray:
    """Return which of the wanted lanes each way from a lane comes to first, and those beside them, (num_lanes,) bool.

    The lane itself and those beside it are left behind only at their ends: a change of lanes leads to none.

    Args:
        start: row of the lane; -1 for none, which leads nowhere.
        wanted: (k,) rows of lanes.
    """
    roads = world.roads.alone
    group = roads.derived(LaneNeighbours).group
    found, known = np.zeros(len(roads), dtype=bool), np.zeros(len(roads), dtype=bool)
    if start >= 0:
        known |= group == group[start]
    waiting, ends = known.nonzero()[0].tolist(), set(wanted.tolist())
    while waiting:
        lane = waiting.pop()
        for each in roads.successor[roads.first_successor[lane] : roads.first_successor[lane + 1]].tolist():
            if not known[each]:
                known[each], found[each] = True, each in ends
                if not found[each]:
                    waiting.append(each)
    found[wanted] |= np.isin(group[wanted], group[found])
    return found
