"""Demand: places on lanes where vehicles may appear, and whether there is room now.

Other modules decide when a vehicle appears; see `simulator.sim_services.traffic_demand`.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import COMFORT, LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Body, World
from rosbridge_sim.world.state.world_rows import WorldRows

STANDING_SPACING: Final = 12.0
"""From one slot to the next at standstill [m]: a car of 4.7 m, and twice as much again for trucks and lane ends."""

SPACING_TIME: Final = 1.2
"""Slots are farther apart by the way driven in this time [s]: the time gap of the driver model."""

START_SHARE: Final = 0.5
"""Vehicles that appear in slots drive at this share of the safe speed: with less they are run into, with more they
overrun a light that is red at that moment."""

END_MARGIN: Final = 8.0
"""Slots keep this distance from the ends of their lane [m], so that nobody appears with a bumper in a crossing."""

SIGHT: Final = 150.0
"""Vehicles on lanes ahead and behind are looked at up to this distance [m]: 33 m/s are braked to a stop in 140 m
with 4 m/s^2."""

REACTION: Final = 1.5
"""A driver behind a new vehicle brakes after this time at the latest [s], with reserve."""

SHORT_END: Final = 5.0
"""A lane shorter than this that leads nowhere has no room for a vehicle of its own [m]."""

LONG_END: Final = 100.0
"""Traffic also appears on lanes that lead nowhere, if they are longer than this [m]: no bay is."""

BESIDE: Final = 0.3
"""Room to either side of a new vehicle [m]."""

LEVEL: Final = 3.0
"""Entities whose heights differ by more are on another level [m]."""

CHUNK: Final = 256
"""Entities compared with all slots at once: it bounds the memory."""


class LaneSlots(Record, eq=False):
    """Places for vehicles along all lanes on which traffic can drive; get them by `roads.derived(LaneSlots.of)`.

    Attributes:
        lane: (k,) int64, rows of lanes.
        s: (k,) arc lengths of the reference points [m].
        speed: (k,) speed at which a vehicle appears there [m/s].
        x, y, z: (k,) the same places in the map frame [m].
        is_entry: (k,) bool, no lane leads to the lane: traffic comes in there from outside of the map.
    """

    lane: IntArray
    s: FloatArray
    speed: FloatArray
    x: FloatArray
    y: FloatArray
    z: FloatArray
    is_entry: np.ndarray[tuple[int], np.dtype[np.bool_]]

    @staticmethod
    def of(roads: Roads) -> LaneSlots:
        """Return the slots of a map: none within crossings, and none on short lanes that lead nowhere, such as bays.

        The end of a lane may lie in a crossing, where a tight turn passes it.
        """
        conflicts = roads.derived(LaneConflicts)
        has_way = (np.diff(roads.first_successor) > 0) | (roads.length > LONG_END)
        is_free = has_way & (conflicts.wait_point > np.maximum(roads.length - END_MARGIN, 0.0))
        lanes, places, speeds = [], [], []
        for lane in np.flatnonzero(is_free).tolist():
            first, last = int(roads.first[lane]), int(roads.first[lane + 1])
            safe = float(conflicts.safe_speed[first:last].max())
            spacing = STANDING_SPACING + SPACING_TIME * START_SHARE * safe
            # None where the lane still overlaps one that forks from the same place.
            s = np.arange(conflicts.shared[lane] + END_MARGIN, roads.length[lane] - END_MARGIN, spacing)
            limit = np.interp(s, roads.s[first:last], conflicts.safe_speed[first:last])
            lanes.append(np.full(len(s), lane, dtype=np.int64))
            places.append(s)
            speeds.append(START_SHARE * limit)
        if not lanes:
            none, zero = np.zeros(0, dtype=np.int64), np.zeros(0)
            return LaneSlots(none, zero, zero, zero, zero, zero, np.zeros(0, dtype=bool))
        lane_of, s_of = np.concatenate(lanes), np.concatenate(places)
        points = roads.at(lane_of, s_of)[0] if len(lane_of) else np.zeros((0, 3))
        is_led_to = np.zeros(len(roads), dtype=bool)
        is_led_to[roads.successor] = True
        x, y, z = points.T.copy()
        return LaneSlots(lane_of, s_of, np.concatenate(speeds), x, y, z, ~is_led_to[lane_of])


def safe_speed_at(roads: Roads, lane: int, s: float) -> float:
    """Return the speed that the limit and the bends allow at a place [m/s].

    Args:
        lane: row of a lane.
        s: arc length on it [m].
    """
    at = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
    safe = roads.derived(LaneConflicts).safe_speed
    return float(np.interp(np.array([s]), roads.s[at], safe[at])[0])


def keep_clear(world: World, slots: LaneSlots, radius: float) -> BoolArray:
    """Return which slots are clear of all entities, (k,) bool.

    Args:
        world: read only.
        radius: distance from the slot to the nearest part of an entity, at least; more for one that moves [m].
    """
    is_clear = np.ones(len(slots.lane), dtype=bool)
    rows = np.flatnonzero(world.alive)
    reach = world.half_length + np.abs(world.centre) + world.half_width + radius + REACTION * np.abs(world.speed)
    for start in range(0, len(rows), CHUNK):
        part = rows[start : start + CHUNK]
        dx, dy = slots.x[:, None] - world.x[part], slots.y[:, None] - world.y[part]
        near = dx * dx + dy * dy < np.square(reach[part])
        is_clear &= ~(near & (np.abs(slots.z[:, None] - world.z[part]) < LEVEL)).any(axis=1)
    return is_clear


def stand_at_ends(world: WorldRows) -> BoolArray:
    """Return (n,) which rows have stopped on a lane that leads nowhere: at its end, or in a queue before it."""
    length = world.roads.length
    is_last = world.ahead_1 < 0
    # A bumper at the end of a short lane: the vehicle itself is still on the lane before.
    is_last |= (world.ahead_2 < 0) & (length.take(world.ahead_1) < SHORT_END) if len(length) else False
    return np.asarray(world.alive & world.has_lane & is_last & (world.speed == 0.0))


def has_room(world: World, lane: int, s: float, body: Body, speed: float, *, gap: float, time: float) -> bool:
    """Return whether a vehicle can appear on a lane so that nobody has to brake hard.

    Args:
        world: read only.
        lane: row of the lane.
        s: arc length of the reference point [m].
        speed: of the vehicle [m/s].
        gap: room before and behind it, at least [m].
        time: least time to a collision, at the present speeds [s].
    """
    rows = np.flatnonzero(world.alive)
    place, yaw = world.roads.at([lane], [s])
    cos, sin = float(np.cos(yaw[0])), float(np.sin(yaw[0]))
    # Boxes near to the place, whatever they are. Those on no lane are taken to go straight on.
    middle = body.length / 2.0 - body.rear_overhang
    east = world.x[rows] + world.centre[rows] * np.cos(world.yaw[rows]) - place[0, 0]
    north = world.y[rows] + world.centre[rows] * np.sin(world.yaw[rows]) - place[0, 1]
    along, across = east * cos + north * sin - middle, north * cos - east * sin
    turn = world.yaw[rows] - yaw[0]
    half_along = np.abs(np.cos(turn)) * world.half_length[rows] + np.abs(np.sin(turn)) * world.half_width[rows]
    half_across = np.abs(np.sin(turn)) * world.half_length[rows] + np.abs(np.cos(turn)) * world.half_width[rows]
    closing = np.sign(along) * (speed - world.speed[rows] * np.cos(turn)) * ~world.has_lane[rows]
    is_near = np.abs(along) < body.length / 2.0 + half_along + _needed_gap(closing, gap, time)
    is_near &= np.abs(across) < body.width / 2.0 + half_across + BESIDE
    is_near &= np.abs(world.z[rows] - place[0, 2]) < LEVEL
    if is_near.any():
        return False
    # Vehicles that come from behind on lanes, or drive ahead.
    rows = rows[world.has_lane[rows]]
    ahead, behind = _lanes_around(world.roads, lane, s)
    for offsets, sign in ((ahead, 1.0), (behind, -1.0)):
        offset = offsets[world.lane[rows]]
        at = rows[np.isfinite(offset)]
        distance = sign * (offset[np.isfinite(offset)] + world.arc[at])
        half, centre = world.half_length[at], world.centre[at]
        if sign > 0.0:
            free = distance - (half - centre) - (body.length - body.rear_overhang)
            closing = speed - world.speed[at]
        else:
            free = distance - (half + centre) - body.rear_overhang
            closing = world.speed[at] - speed
        if ((distance >= 0.0) & (free < _needed_gap(closing, gap, time))).any():
            return False
    return True


def _needed_gap(closing: FloatArray, gap: float, time: float) -> FloatArray:
    """Return the gap between two vehicles in which the faster one can brake comfortably, (k,) [m].

    Args:
        closing: (k,) by how much the gap shrinks [m/s].
        gap: see `has_room`.
        time: see `has_room`.
    """
    closing = np.fmax(closing, 0.0)
    return np.asarray(gap + closing * max(time, REACTION) + np.square(closing) / (2.0 * COMFORT))


def _lanes_around(roads: Roads, lane: int, s: float) -> tuple[FloatArray, FloatArray]:
    """Return where lanes begin, as seen from a place: those ahead and those behind within `SIGHT`.

    Returns:
        Two (l,) arrays: the distance from the place to the start of each lane, negative behind [m]; NaN for others.
    """
    ahead, behind = np.full(len(roads), np.nan), np.full(len(roads), np.nan)
    ahead[lane] = behind[lane] = -s
    waiting = [lane]
    while waiting:
        here = waiting.pop()
        start = ahead[here] + roads.length[here]
        for other in roads.successors(here).tolist() if start < SIGHT else ():
            if not ahead[other] <= start:
                ahead[other] = start
                waiting.append(other)
    waiting = [lane]
    while waiting:
        here = waiting.pop()
        if behind[here] < -SIGHT:
            continue
        for other in roads.predecessor[roads.successor == here].tolist():
            start = behind[here] - roads.length[other]
            if not behind[other] >= start:
                behind[other] = start
                waiting.append(other)
    return ahead, behind
