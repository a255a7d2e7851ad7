"""Stop lines: which of them a point has come over, and what the light showed for the lane that it took.

A stop line lies across the end of a lane, from edge to edge, where the map marks one or where a lane begins behind it
that a light controls. Lights differ for the lanes behind one line: straight on may be red while left is green. So the
light of the lane *really taken* counts. While the light is the same for all lanes behind the line, that is known as the
line is passed. Otherwise the line stays *open* until the vehicle is on one of these lanes more clearly than on the
others.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.block_grid import BlockGrid
from rosbridge_sim.world.geometry.planar import BoolArray, ComplexArray, FloatArray, IntArray, in_columns, ranges
from rosbridge_sim.world.roads.roads import LEVEL, Roads
from rosbridge_sim.world.roads.signal_plan import Lamp, SignalPlan
from rosbridge_sim.world.roads.signals import ShownLights

BESIDE_LINE: Final = 0.5
"""A point that passes this far beside a lane's edge has still passed its stop line [m]: half of the car is over it."""

APART: Final = 1.0
"""A lane is the one taken if the front bumper is nearer to its line by this than to any with another light [m]. Drivers
stray from the line of their lane by less, and lanes that turn apart are so far from one another after 5 to 10 m."""

LANE_REACH: Final = 12.0
"""Lanes farther away than this are not taken [m]: three lanes aside, the vehicle has gone elsewhere."""

MAX_BEHIND: Final = 62
"""Lanes behind a line whose lights are told apart: bits of a positive int64. No map has ten."""


class StopLines:
    """The ends of all lanes of a map; get it by `roads.derived(StopLines)`. Lights say which are stop lines."""

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        last = roads.first[1:] - 1
        place, yaw = roads.at(np.arange(len(roads)), roads.length) if len(roads) else (np.zeros((0, 3)), np.zeros(0))
        self._end = place[:, 0] + 1j * place[:, 1]
        self._height = place[:, 2]
        self._ahead = np.cos(yaw) + 1j * np.sin(yaw)
        self._left, self._right = (roads.border[last] + BESIDE_LINE).T
        corners = np.stack([self._end + 1j * self._left * self._ahead, self._end - 1j * self._right * self._ahead])
        box = np.stack([corners.real, corners.imag], axis=-1)
        self._low, self._high = box.min(axis=0), box.max(axis=0)
        self._lines: tuple[BoolArray, IntArray, BlockGrid] | None = None

    def find_passed(
        self, signals: ShownLights, first: ComplexArray, last: ComplexArray, heading: ComplexArray, z: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the stop lines that points have come over in the lanes' direction, at most one for each point.

        Returns indices of the points, rising, and the lanes that end at the lines; (m,) int64 each.

        Args:
            first: (k,) places before the step, east + i north [m].
            last: (k,) places after it [m].
            heading: (k,) unit vectors; who comes over a line backwards has not passed it.
            z: (k,) heights; a line on another level is not passed [m].
        """
        lines, grid = self._lines_of(signals.plan)
        if not len(lines):
            return lines, lines
        index, line = grid.find(in_columns(last.real, last.imag))
        lane = lines[line]
        if not self._roads.is_flat:
            is_level = np.abs(self._height[lane] - z[index]) < LEVEL
            index, lane = index[is_level], lane[is_level]
        if not len(index):
            return index, lane
        into = self._ahead[lane].conj()
        before, after = (first[index] - self._end[lane]) * into, (last[index] - self._end[lane]) * into
        at = ((before.real <= 0.0) & (after.real > 0.0) & ((heading[index] * into).real > 0.0)).nonzero()[0]
        if not len(at):
            return index[at], lane[at]
        index, lane, before, after = index[at], lane[at], before[at], after[at]
        share = before.real / (before.real - after.real)
        beside = before.imag + share * (after.imag - before.imag)
        at = ((beside <= self._left[lane]) & (beside >= -self._right[lane])).nonzero()[0]
        index, lane = index[at], lane[at]
        order = np.lexsort((lane, np.abs(beside[at]), index))
        best = order[np.diff(index[order], prepend=-1).nonzero()[0]]
        return index[best], lane[best]

    def lines_of(self, plan: SignalPlan) -> FloatArray:
        """Return the places of stop lines and unit vectors ahead, (k, 4) east, north, east, north.

        Args:
            plan: says which lanes end before a light.
        """
        lines, _ = self._lines_of(plan)
        end, ahead = self._end[lines], self._ahead[lines]
        return np.stack([end.real, end.imag, ahead.real, ahead.imag], axis=-1)

    def _lines_of(self, plan: SignalPlan) -> tuple[IntArray, BlockGrid]:
        """Return the lanes that end at stop lines, (k,) int64, and a grid of these ends; kept for one plan."""
        before_light = plan.is_before_light
        if self._lines is None or self._lines[0] is not before_light:
            lines = (self._roads.is_stop | before_light).nonzero()[0]
            self._lines = before_light, lines, BlockGrid(self._low[lines], self._high[lines])
        return self._lines[1:]


def find_red_lanes(roads: Roads, signals: ShownLights, lane: IntArray, first: IntArray) -> tuple[IntArray, IntArray]:
    """Return the lanes behind stop lines that show red now.

    A light forbids a lane if its red lamp is lit and none that allows this lane. Yellow forbids nothing here: it is for
    those who cannot stop.

    Args:
        lane: (m,) int64, rows of the lanes that end at the lines.
        first: (m,) int64, where in `signals.shown` the lights begin that count.

    Returns:
        (m,) int64, a sum of 2^i for the i-th of `Roads.successors` that is forbidden; and (m,) int64, the same sum if
        all were.
    """
    start = roads.first_successor[lane]
    count = np.minimum(roads.first_successor[lane + 1] - start, MAX_BEHIND)
    behind = roads.successor[ranges(start, count)]
    bit = np.left_shift(1, ranges(np.zeros_like(count), count))
    plan = signals.plan
    red = np.zeros(len(lane), dtype=np.int64)
    if len(plan.lights):
        light = plan.light_of_lane[behind]
        shown = signals.shown[light + first.repeat(count)]
        is_red = (light >= 0) & (shown > 0) & (shown & Lamp.RED != 0) & (shown & plan.pass_of_lane[behind] == 0)
        np.add.at(red, np.arange(len(lane)).repeat(count), np.where(is_red, bit, 0))
    return red, np.left_shift(1, count) - 1


def settle(
    roads: Roads, line: IntArray, red: IntArray, place: ComplexArray, is_last: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Find out which lane was taken behind open stop lines.

    Args:
        line: (m,) int64, rows of the lanes that end at the lines.
        red: (m,) int64, the lanes behind it that were red; see `find_red_lanes`.
        place: (m,) middles of the front bumpers, east + i north [m].
        is_last: (m,) bool, this must be decided now.

    Returns:
        (m,) bool, it is decided, and (m,) bool, a red lane was taken. Of vehicles that are on none of the lanes any
        more, or have gone back behind the line, it is decided that they have taken none.
    """
    num = len(line)
    owner, near = roads.within(place.real.copy(), place.imag.copy(), np.full(num, LANE_REACH))
    start = roads.first_successor[line]
    count = np.minimum(roads.first_successor[line + 1] - start, MAX_BEHIND)
    pair_line, pair_lane = np.arange(num).repeat(count), roads.successor[ranges(start, count)]
    is_red = np.right_shift(red.repeat(count), ranges(np.zeros_like(count), count)) & 1 == 1
    # Distances of the lanes behind each line, from the list of all lanes near each place; both lists are sorted alike.
    key = owner * len(roads) + near.lane
    order = key.argsort(kind="stable")
    wanted = pair_line * len(roads) + pair_lane
    at = np.minimum(key[order].searchsorted(wanted), max(len(key) - 1, 0))
    distance = np.full(len(wanted), np.inf)
    if len(key):
        is_found = key[order][at] == wanted
        distance[is_found] = near.distance[order][at][is_found]
    to_red, to_free = np.full(num, np.inf), np.full(num, np.inf)
    np.minimum.at(to_red, pair_line[is_red], distance[is_red])
    np.minimum.at(to_free, pair_line[~is_red], distance[~is_red])
    is_gone = np.isinf(to_red) & np.isinf(to_free)
    is_decided = is_gone | is_last | (to_red + APART < to_free) | (to_free + APART < to_red)
    return is_decided, is_decided & (to_red < to_free)
