"""Rays from egos to the boxes of entities and the borders of the road, as a flat lidar has them."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.block_grid import BlockGrid
from rosbridge_sim.world.geometry.planar import BoolArray, ComplexArray, FloatArray, IntArray, ranges
from rosbridge_sim.world.roads.roads import LEVEL, Roads
from rosbridge_sim.world.vehicle.ground import are_on_road
from rosbridge_sim.worlds.ego_table import Part

RAY_FIGURES: Final = ("distance", "speed")
"""Figures of a ray: distance to the first box or border, the length of the ray if there is none [m]; and the speed at
which that moves away along the ray, seen from the ego, 0 if there is none [m/s]."""

OUTWARDS: Final = 0.3
"""An edge of a lane is a border of the road if this far beyond it there is no other lane [m]."""

END: Final = 2.6
"""The same at the ends of lanes, where places near the edge and up to 2.5 m beyond still count as on the road."""

PIECE: Final = 1.0
"""Edges are looked at in pieces of this length at most [m]: beside a part of an edge there may be another lane."""

GRID_REACH: Final = 64.0
"""Reach of a grid of borders is a multiple of this [m], so that few are made."""


def cast_rays(part: Part, num: int, reach: float) -> FloatArray:
    """Return what rays from the middles of egos meet first.

    Args:
        num: rays of each, at equal angles, the first one forward, the second one to the left of it.
        reach: length of the rays [m].

    Returns:
        (k, num, 2) `RAY_FIGURES`.
    """
    columns, rows = part.columns, part.rows
    angle = columns.yaw[rows][:, None] + np.arange(num) * (2.0 * np.pi / num)
    ray = np.cos(angle) + 1j * np.sin(angle)
    middle = (columns.x + columns.centre * np.cos(columns.yaw)) + 1j * (
        columns.y + columns.centre * np.sin(columns.yaw)
    )
    distance, speed = np.full(ray.shape, reach), np.zeros(ray.shape)
    heading = np.cos(columns.yaw) + 1j * np.sin(columns.yaw)
    velocity = (columns.speed + 1j * columns.lateral_speed) * heading
    own = velocity[rows]

    owner, other = _find_near(part, middle, reach)
    met = _meet_boxes(
        (middle[rows][owner] - middle[other]) * heading[other].conj(),
        ray[owner] * heading[other].conj()[:, None],
        columns.half_length[other],
        columns.half_width[other],
    )
    _take_nearest(distance, owner, met)
    relative = velocity[other] - own[owner]
    best = (met == distance[owner]) & (met < reach)
    pair, which = best.nonzero()
    speed[owner[pair], which] = (relative[pair] * ray[owner[pair], which].conj()).real

    roads = columns.roads.alone
    owner, start, end = roads.derived(_Borders).near(middle[rows], columns.z[rows], reach)
    met = _meet_lines(start - middle[rows][owner], end - start, ray[owner])
    before = distance.copy()
    _take_nearest(distance, owner, met)
    is_border = distance < before
    speed[is_border] = -(own[:, None] * ray.conj()).real[is_border]
    return np.stack([distance, speed], axis=-1)


def _find_near(part: Part, middle: ComplexArray, reach: float) -> tuple[IntArray, IntArray]:
    """Return pairs of egos and other entities whose boxes may be within reach, (p,) each, rising by ego."""
    columns, slots, rows = part.columns, part.columns.num_worlds, part.rows
    slot = rows % slots
    size = np.hypot(columns.half_length, columns.half_width).reshape(-1, slots)[:, slot]
    away = np.abs(middle.reshape(-1, slots)[:, slot] - middle[rows])
    is_near = (away < reach + size) & columns.alive.reshape(-1, slots)[:, slot]
    is_near[rows // slots, np.arange(len(rows))] = False
    owner, place = is_near.T.nonzero()
    return owner, place * slots + slot[owner]


def _meet_boxes(eye: ComplexArray, ray: ComplexArray, half_length: FloatArray, half_width: FloatArray) -> FloatArray:
    """Return the distances at which rays enter boxes, (p, num); inf where they do not.

    Args:
        eye: (p,) where rays begin, in the axes of the box.
        ray: (p, num) unit vectors, likewise.
        half_length: (p,) [m].
        half_width: (p,) [m].
    """
    enters, leaves = np.full(ray.shape, -np.inf), np.full(ray.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for place, step, half in ((eye.real, ray.real, half_length), (eye.imag, ray.imag, half_width)):
            first, last = (-half - place)[:, None] / step, (half - place)[:, None] / step
            enters = np.fmax(enters, np.fmin(first, last))
            leaves = np.fmin(leaves, np.fmax(first, last))
    return np.where((enters <= leaves) & (leaves >= 0.0), np.fmax(enters, 0.0), np.inf)


def _meet_lines(start: ComplexArray, step: ComplexArray, ray: ComplexArray) -> FloatArray:
    """Return the distances at which rays (p, num) meet segments (p,), (p, num); inf where they do not."""
    across = (ray.conj() * step[:, None]).imag
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ((start.conj() * step).imag)[:, None] / across
        share = (start.conj()[:, None] * ray).imag / across
    return np.where((distance >= 0.0) & (share >= 0.0) & (share <= 1.0), distance, np.inf)


def _take_nearest(distance: FloatArray, owner: IntArray, met: FloatArray) -> None:
    """Write the least distances (p, num) of each owner (p,), rising, into `distance` (k, num)."""
    if len(owner):
        first = np.diff(owner, prepend=-1).nonzero()[0]
        least = np.minimum.reduceat(met, first, axis=0)
        distance[owner[first]] = np.minimum(distance[owner[first]], least)


class _Borders:
    """The borders of the road of a map, as segments; get them by `roads.derived(_Borders)`."""

    def __init__(self, roads: Roads) -> None:
        self._grids: dict[int, BlockGrid] = {}
        self._is_flat = roads.is_flat
        parts = [_edges_of(roads, lane) for lane in range(len(roads))]
        if not parts:
            self._start = self._end = np.zeros(0, dtype=complex)
            self._height = np.zeros(0)
            return
        start, end, outwards, height = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        count = np.maximum(np.ceil(np.abs(end - start) / PIECE), 1).astype(np.int64)
        edge = np.arange(len(start)).repeat(count)
        piece = ranges(np.zeros_like(count), count)
        step = ((end - start) / count)[edge]
        first = start[edge] + piece * step
        beyond = first + 0.5 * step + outwards[edge]
        is_border = ~are_on_road(roads, beyond.real, beyond.imag, height[edge])
        # Neighbouring pieces of one edge are one border again.
        goes_on = is_border[1:] & is_border[:-1] & (edge[1:] == edge[:-1])
        begins, ends = is_border.copy(), is_border.copy()
        begins[1:] &= ~goes_on
        ends[:-1] &= ~goes_on
        self._start, self._end, self._height = first[begins], (first + step)[ends], height[edge][begins]

    def near(
        self, place: ComplexArray, height: FloatArray, reach: float
    ) -> tuple[IntArray, ComplexArray, ComplexArray]:
        """Return the borders that can be within reach of places (k,): indices of the places, rising, and both ends."""
        steps = int(np.ceil(reach / GRID_REACH))
        if not len(self._start):
            return np.zeros(0, dtype=np.int64), self._start, self._end
        if steps not in self._grids:
            corners = np.stack([self._start, self._end])
            box = np.stack([corners.real, corners.imag], axis=-1)
            self._grids = {steps: BlockGrid(box.min(axis=0), box.max(axis=0), reach=steps * GRID_REACH)}
        owner, which = self._grids[steps].find(np.column_stack([place.real, place.imag]))
        middle = 0.5 * (self._start[which] + self._end[which])
        half = 0.5 * np.abs(self._end[which] - self._start[which])
        is_near: BoolArray = np.abs(middle - place[owner]) < reach + half
        if not self._is_flat:
            is_near &= np.abs(self._height[which] - height[owner]) < LEVEL
        return owner[is_near], self._start[which[is_near]], self._end[which[is_near]]


def _edges_of(roads: Roads, lane: int) -> tuple[ComplexArray, ComplexArray, ComplexArray, FloatArray]:
    """Return the edges of a lane, and the lines across its ends: both ends, the step outwards, the height."""
    part = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
    line, height = (roads.points[part, :2] * (1.0, 1.0j)).sum(axis=1), roads.points[part, 2]
    direction = np.gradient(line)
    direction /= np.maximum(np.abs(direction), 1e-9)
    left, right = line + 1j * direction * roads.border[part, 0], line - 1j * direction * roads.border[part, 1]
    aside = 0.5j * (direction[1:] + direction[:-1])
    return (
        np.concatenate([left[:-1], right[:-1], left[[0, -1]]]),
        np.concatenate([left[1:], right[1:], right[[0, -1]]]),
        np.concatenate([OUTWARDS * aside, -OUTWARDS * aside, direction[[0, -1]] * np.array([-END, END])]),
        np.concatenate([height[1:], height[1:], height[[0, -1]]]),
    )
