"""The surroundings of egos as arrays: the nearest entities, and the lane."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.drivers.lane_position import find_ahead
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.scoring import LANES_AHEAD, SCORE_LOOPS
from rosbridge_sim.worlds.ego_table import Part

OTHER_FIGURES: Final = ("is_there", "x", "y", "vx", "vy", "cos", "sin", "length", "width")
"""Figures of an entity in the frame of the ego: whether there is one; place of the middle of its box, forward and left
[m]; its velocity relative to that of the ego [m/s]; its direction; its size [m]."""

LANE_FIGURES: Final = ("offset", "heading", "to_left", "to_right", "speed_limit", "is_on_road", "s", "lane")


def find_others(part: Part, num: int) -> FloatArray:
    """Return the entities nearest to egos, the nearest first.

    Args:
        num: entities of each, positive.

    Returns:
        (k, num, 9), `OTHER_FIGURES`; zeros where there are fewer.
    """
    columns, slots, rows = part.columns, part.columns.num_worlds, part.rows
    if SCORE_LOOPS.make is not None and len(columns.roads):
        seen = columns.derived(SCORE_LOOPS.make).see_others(rows, num)
        if seen is not None:
            return seen
    slot = rows % slots
    middle_x, middle_y = (
        columns.x + columns.centre * np.cos(columns.yaw),
        columns.y + columns.centre * np.sin(columns.yaw),
    )
    east = middle_x.reshape(-1, slots)[:, slot] - columns.x[rows]
    north = middle_y.reshape(-1, slots)[:, slot] - columns.y[rows]
    away = np.square(east) + np.square(north)
    away[~columns.alive.reshape(-1, slots)[:, slot]] = np.inf
    away[rows // slots, np.arange(len(rows))] = np.inf
    most = min(num, len(away))
    nearest = (
        np.argpartition(away, most - 1, axis=0)[:most]
        if most < len(away)
        else np.tile(np.arange(most)[:, None], len(rows))
    )
    index = np.arange(len(rows))
    nearest = nearest[np.argsort(away[nearest, index], axis=0, kind="stable"), index]
    is_there = np.isfinite(away[nearest, index])
    other = nearest * slots + slot
    yaw = columns.yaw[rows]
    cos, sin = np.cos(yaw), np.sin(yaw)
    found = np.zeros((len(rows), num, len(OTHER_FIGURES)))
    into = found[:, :most].transpose(2, 1, 0)
    east, north = east[nearest, index], north[nearest, index]
    into[0] = is_there
    into[1], into[2] = east * cos + north * sin, north * cos - east * sin
    turn = columns.yaw[other] - yaw
    speed = columns.speed[other]
    into[5], into[6] = np.cos(turn), np.sin(turn)
    into[3] = speed * into[5] - columns.lateral_speed[other] * into[6] - columns.speed[rows]
    into[4] = speed * into[6] + columns.lateral_speed[other] * into[5] - columns.lateral_speed[rows]
    into[7], into[8] = 2.0 * columns.half_length[other], 2.0 * columns.half_width[other]
    into[:, ~is_there] = 0.0
    return found


def find_lanes(part: Part, ahead: FloatArray) -> tuple[dict[str, npt.NDArray[np.float64]], FloatArray]:
    """Return where egos are on their lanes, and places of the lanes' lines ahead of them.

    Args:
        ahead: (p,) distances along the lanes [m].

    Returns:
        (k,) for each of `LANE_FIGURES`: offset of the middle of the rear axle from the line, left positive [m]; heading
        relative to the lane, left positive [rad]; distances of the edges to the left and to the right, negative beyond
        [m]; speed limit, 0 for none [m/s]; 1 on the road, else 0; arc length on the lane [m]; row of the lane, -1
        without one. And (k, p, 2) places in the frame of the ego, forward and left [m]; beyond a dead end its end.
    """
    columns, rows = part.columns, part.rows
    roads = columns.roads.alone
    if SCORE_LOOPS.make is not None and len(roads):
        looked = columns.derived(SCORE_LOOPS.make).look(rows, ahead, roads.derived(_straight_on))
        if looked is not None:
            return looked
    x, y, yaw, z = columns.x[rows], columns.y[rows], columns.yaw[rows], columns.z[rows]
    points = np.zeros((len(rows), len(ahead), 2))
    places = columns.roads.nearest(x, y, yaw, z)
    figures = {name: np.zeros(len(rows)) for name in LANE_FIGURES}
    figures["lane"][:] = places.lane
    if not len(roads):
        return figures, points
    left, right = roads.beside(places)
    beyond = places.distance - np.abs(places.lateral)
    figures["offset"], figures["s"] = places.lateral, places.s
    figures["heading"] = wrap_angle(yaw - places.yaw)
    figures["to_left"], figures["to_right"] = left, right
    figures["speed_limit"] = roads.speed_limit[places.lane]
    figures["is_on_road"] = ((left >= 0.0) & (right >= 0.0) & (beyond < 1.0)).astype(np.float64)
    if len(ahead):
        lanes = _lanes_ahead(roads, places.lane)
        num = len(ahead)
        at = find_ahead(roads, lanes.repeat(num, axis=1), (places.s[:, None] + ahead).ravel())
        line = roads.at(*at)[0].reshape(len(rows), num, 3)
        east, north = line[..., 0] - x[:, None], line[..., 1] - y[:, None]
        cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
        points[..., 0], points[..., 1] = east * cos + north * sin, north * cos - east * sin
    return figures, points


def find_lights(part: Part, may_enter: BoolArray, light_of_lane: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return where the next lights are straight ahead of egos, and which of them forbid to go on.

    Args:
        may_enter: (k, l) bool, for each ego the lanes of the map that no light forbids now.
        light_of_lane: (l,) int64, the light that each lane obeys; -1 for none.

    Returns:
        (k,) distances of the ends of the lanes before them, inf for none within `LANES_AHEAD` [m]; and (k,) 1 where it
        is red or yellow, else 0.
    """
    columns, rows = part.columns, part.rows
    roads = columns.roads.alone
    distance, must_stop = np.full(len(rows), np.inf), np.zeros(len(rows))
    if not len(roads):
        return distance, must_stop
    places = columns.roads.nearest(columns.x[rows], columns.y[rows], columns.yaw[rows], columns.z[rows])
    lanes, away = _lanes_ahead(roads, places.lane), roads.length[places.lane] - places.s
    for lane in lanes[1:]:
        is_next = (lane >= 0) & (light_of_lane[lane] >= 0) & np.isinf(distance)
        distance = np.where(is_next, away, distance)
        must_stop = np.where(is_next & ~may_enter[np.arange(len(rows)), lane], 1.0, must_stop)
        away = away + np.where(lane >= 0, roads.length[lane], 0.0)
    return distance, must_stop


def _lanes_ahead(roads: Roads, lane: IntArray) -> IntArray:
    """Return lanes and those straight on after them, (1 + LANES_AHEAD, k) int64; -1 beyond a dead end."""
    following = roads.derived(_straight_on)
    lanes = [lane]
    for _ in range(LANES_AHEAD):
        lanes.append(np.where(lanes[-1] >= 0, following[lanes[-1]], -1))
    return np.stack(lanes)


def _straight_on(roads: Roads) -> IntArray:
    """Return for each lane the lane after it that turns least, (l,) int64; -1 at a dead end."""
    onward = roads.derived(LaneConflicts).onward
    found = np.full(len(roads), -1, dtype=np.int64)
    owner = np.arange(len(roads)).repeat(np.diff(onward.first))
    order = np.lexsort((onward.other, np.abs(roads.turn[onward.other]), owner))
    first = order[np.diff(owner[order], prepend=-1) > 0]
    found[owner[first]] = onward.other[first]
    return found
