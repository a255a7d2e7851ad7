"""Drivers and other entities at random places on a map's lanes, most of them near its intersections."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from rosbridge_sim.world.drivers.driver_model import Perception
from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries, EntryQueue
from rosbridge_sim.world.drivers.right_of_way import Requests
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts

NUM_LANES = 6


@dataclass(eq=False)
class Situation:
    """All that right of way is decided from.

    Attributes:
        num_moving: the first so many of `others` move.
    """

    conflicts: LaneConflicts
    drivers: Drivers
    perception: Perception
    requests: Requests
    others: Entries
    num_moving: int

    @property
    def queue(self) -> EntryQueue:
        own = self.drivers
        index, stands = np.arange(len(own.arc)), np.zeros(len(own.arc), dtype=np.bool_)
        entries = Entries(own.lanes[0], own.arc, own.arc - own.rear, own.speed, own.accel, index, stands)
        return EntryQueue(self.conflicts.roads, Entries.join(entries, self.others))


def situation(conflicts: LaneConflicts, seed: int, num: int = 12, few: float = 0.1) -> Situation:
    """A random situation at one intersection.

    Some drivers stand, ask for lanes, have or hold one, each with the probability `few`; others stand or drive on lanes
    before, within and behind it.
    """
    rng = np.random.default_rng(seed)
    roads = conflicts.roads
    with_rivals = _around(conflicts, int(rng.choice(np.isfinite(conflicts.wait_point).nonzero()[0])))

    def onward(lane: int) -> int:
        first, last = conflicts.onward.first[lane : lane + 2]
        return int(rng.choice(conflicts.onward.other[first:last])) if last > first else -1

    focus = set(with_rivals.tolist())
    before = [lane for lane in range(len(roads)) if focus & set(_after(conflicts, lane))]
    behind = [after for lane in focus for after in _after(conflicts, lane)]
    lanes = np.full((NUM_LANES, num), -1, dtype=np.int64)
    lanes[0] = rng.choice(np.array([*before, *before, *with_rivals.tolist()]), num)
    for i in range(1, NUM_LANES):
        lanes[i] = [onward(lane) if lane >= 0 else -1 for lane in lanes[i - 1].tolist()]
    length = rng.choice([4.5, 11.0], num)
    rear = rng.uniform(0.2, 0.3, num) * length
    arc = roads.length[lanes[0]] - rng.choice([3.0, 30.0], num) * rng.uniform(0.0, 1.0, num)
    arc = np.fmax(arc, 0.0)
    ahead = lanes[rng.integers(0, 3, num), np.arange(num)]
    claim = np.where((rng.random(num) < few) & (ahead >= 0), ahead, -1)
    held = np.where(rng.random(num) < few, rng.choice(with_rivals, num), -1)
    exit_lane = np.where(rng.random(num) < 0.6, rng.choice(np.array([*behind, -1]), num), -1)
    figures = {each.name: rng.uniform(0.8, 2.0, num) for each in fields(DriverParameters)}
    speed = rng.choice([0.0, 0.05, 1.0], num) * rng.uniform(0.5, 15.0, num)
    drivers = Drivers(
        *(lanes, arc, speed, np.zeros(num), np.zeros(num, dtype=np.int64), length - rear, rear, length),
        *(rng.permutation(num), claim, held, exit_lane, rng.random(num) < 0.3, DriverParameters(**figures)),
        lateral=rng.uniform(0.5, 3.0, num),
    )
    nothing, no = np.full(num, np.inf), np.zeros(num, dtype=np.bool_)
    lead = np.where(rng.random(num) < 0.5, rng.integers(0, num, num), -1)
    perception = Perception(
        *(np.where(lead >= 0, rng.uniform(0.0, 40.0, num), np.inf), np.zeros(num), np.zeros(num), lead),
        *(np.where(rng.random(num) < 0.2, rng.uniform(0.0, 30.0, num), nothing), nothing.copy(), no, no.copy()),
    )
    has = (rng.random(num) < 0.8) & (lanes[1] >= 0)
    wanted = np.where(has, lanes[1], -1)
    distance = np.where(has, rng.choice([1.5, 12.0, 60.0], num) * rng.uniform(0.2, 1.0, num), np.inf)
    requests = Requests(wanted, np.where(has, lanes[2], -1), distance, has & (rng.random(num) < few))
    num_moving, num_others = int(rng.integers(1, 6)), 9
    lane = np.where(np.arange(num_others) < 3, rng.choice(with_rivals, num_others), rng.choice(before, num_others))
    lane[6:] = rng.choice(behind, 3)
    share = np.where(np.arange(num_others) < 6, rng.choice([0.3, 1.0], num_others), 0.0)
    s = (1.0 - share * rng.uniform(0.0, 1.0, num_others)) * roads.length[lane]
    s[6:] = rng.uniform(0.0, 25.0, 3)
    moves = np.arange(num_others) < num_moving
    others = Entries(
        *(lane, s, s - rng.uniform(1.0, 6.0, num_others)),
        *(np.where(moves, rng.choice([0.4, 0.6, 3.0, 6.0, 14.0], num_others), 0.0), np.zeros(num_others)),
        *(np.full(num_others, -1, dtype=np.int64), ~moves),
    )
    return Situation(conflicts, drivers, perception, requests, others, num_moving)


def _after(conflicts: LaneConflicts, lane: int) -> list[int]:
    first, last = conflicts.onward.first[lane : lane + 2]
    return [int(other) for other in conflicts.onward.other[first:last]]


def _around(conflicts: LaneConflicts, lane: int) -> IntArray:
    """A lane, its rivals, and theirs."""
    found = {lane}
    for _ in range(2):
        _, link = conflicts.rivals.of(np.array(sorted(found)))
        found |= set(conflicts.rivals.other[link].tolist())
    return np.array(sorted(found))
