"""Echoes of a radar, from the boxes of the entities around it.

An echo comes from the point of an entity's box nearest to the radar, at half of its height. It is there if the point is
in one of the two beams and the echo is strong enough. All lengths in metres, with R the distance of the point.

*Cross-section.* s [dB over 1 m^2] = s_class + 10 lg(w / width) + 10 lg(visible), where w is how wide the box looks from
the radar (its width from the front, its length from the side). s_class is that of the front or rear at 77 GHz: 10 for a
car, -8 for a pedestrian, -3 for a bicycle, 0 for an obstacle, and 20 for a vehicle that is longer than 6 m. These are
our estimates: what is published scatters by 10 dB, with the model and with the angle.

*Occlusion.* `visible` is the share of the box's angle that no nearer box covers, in steps of `_BIN`. Radar sees beneath
and past vehicles, but this model lets nothing through; an echo with less than `MIN_VISIBLE` is lost.

*Strength.* amplitude [dB] = s + 40 lg(range of the beam / R) - 10: the radar equation, over the limit at which a car is
just seen at the end of the beam. An echo below 0 is lost: a pedestrian is seen up to 0.35 of the range.

*Range rate.* The velocity of the point along the line of sight, minus that of the radar, both with the turning of their
vehicles. It is positive when the distance grows.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np

from rosbridge_sim.documents.document_model import number_within
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.sensors.sensor_specs import Fov, MountedSpec, Range
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, Quaternion, Vector, chain, quaternion, rotate
from rosbridge_sim.world.state.world import Kind, World
from rosbridge_sim.world.vehicle.sensor_readings import Mounting, locate

_CLASS: Final = {Kind.EGO: 10.0, Kind.VEHICLE: 10.0, Kind.PEDESTRIAN: -8.0, Kind.OBSTACLE: 0.0}
_BICYCLE: Final = -3.0
_LONG: Final = 20.0
"""Cross-sections from the front [dB over 1 m^2]; see the head of this file."""

_LONG_FROM: Final = 6.0
"""Length from which a vehicle counts as a lorry or a bus [m]; a large car has 5.5 m."""

_NARROW: Final = 1.0
"""Width below which a vehicle counts as a bicycle [m]."""

_LIMIT: Final = 10.0
"""Cross-section that is just seen at the end of a beam [dB over 1 m^2]: that of a car."""

_BIN: Final = math.radians(0.25)
"""Step of the angles in which boxes hide each other; a car at 174 m covers two of them."""

MIN_VISIBLE: Final = 0.1
"""Least share of a box that must be visible for an echo."""

MAX_COMPARED: Final = 300
"""Boxes that may hide each other or give echoes, the nearest first; the others are out of sight in any such crowd."""

_Echoes = Annotated[int, number_within(1, 1000)]

_UNITS: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class RadarBeams(MountedSpec, frozen=True, kw_only=True):
    """Options of a radar; see `RadarSpec`."""

    near_range: Range = 60.0
    far_range: Range = 174.0
    near_fov: Fov = 90.0
    far_fov: Fov = 20.0
    vertical_fov: Fov = 10.0
    max_echoes: _Echoes = 64


class RadarEchoes(Record):
    """Echoes of one scan, the nearest first; (k,) float64 each unless noted.

    Attributes:
        rows: int64, rows of the entities; -1 for clutter (`drawn_errors`).
        position: (k, 3) places of the points in the frame of the radar [m].
        distance: from the radar [m].
        azimuth: direction, positive to the left [rad].
        range_rate: change of the distance [m/s].
        amplitude: strength over the limit of detection [dB].
    """

    rows: IntArray
    position: FloatArray
    distance: FloatArray
    azimuth: FloatArray
    range_rate: FloatArray
    amplitude: FloatArray


def find_echoes(world: World, row: int, mounting: Mounting, spec: RadarBeams) -> RadarEchoes:
    """Return the echoes of all other entities.

    Args:
        world: read only.
        row: row of the vehicle with the radar.
    """
    here = locate(world, row, mounting)
    axes = _axes(world, row, mounting)
    reach = max(spec.near_range, spec.far_range)
    others = _nearest(world, row, here, reach)
    feet = _Footprints(world, others, here)
    x, y = feet.nearest_points()
    away = np.stack([x, y, world.z[others] + 0.5 * world.height[others] - here[2]])
    distance = np.maximum(np.sqrt(np.square(away).sum(axis=0)), 1e-3)
    columns = np.array([rotate(axes, unit) for unit in _UNITS])
    seen = (columns[:, :, None] * away).sum(axis=1)  # no matmul: its bits depend on the library behind it
    azimuth = np.arctan2(seen[1], seen[0])
    elevation = np.arctan2(seen[2], np.hypot(seen[0], seen[1]))
    visible, shown_width = feet.sight(distance)
    section = _cross_sections(world, others)
    section += 10.0 * np.log10(shown_width / np.maximum(2.0 * feet.half_width, 0.05))
    section += 10.0 * np.log10(np.maximum(visible, 1e-6))
    amplitude = np.full(len(others), -np.inf)
    in_height = np.abs(elevation) <= 0.5 * math.radians(spec.vertical_fov)
    for beam_range, fov in ((spec.near_range, spec.near_fov), (spec.far_range, spec.far_fov)):
        inside = in_height & (np.abs(azimuth) <= 0.5 * math.radians(fov)) & (distance <= beam_range)
        strength = section + 40.0 * np.log10(beam_range / distance) - _LIMIT
        amplitude = np.where(inside, np.maximum(amplitude, strength), amplitude)
    east, north = _relative_velocities(world, row, others, here, (x, y))
    rate = (east * x + north * y) / distance
    found = np.flatnonzero((amplitude >= 0.0) & (visible >= MIN_VISIBLE))
    found = found[np.argsort(distance[found], kind="stable")][: spec.max_echoes]
    return RadarEchoes(
        others[found], seen[:, found].T.copy(), distance[found], azimuth[found], rate[found], amplitude[found]
    )


def own_velocity(world: World, row: int, mounting: Mounting) -> FloatArray:
    """Return the velocity of a radar over the ground, (3,) in its own frame: forward, left, up [m/s].

    Args:
        world: read only.
        row: row of the vehicle with the radar.
    """
    east, north = _velocity(world, row, locate(world, row, mounting))
    axes = _axes(world, row, mounting)
    return np.array([east * x + north * y for x, y, _ in (rotate(axes, unit) for unit in _UNITS)])


def _axes(world: World, row: int, mounting: Mounting) -> Quaternion:
    """Return the orientation of a radar in the map."""
    own = quaternion(*(array.item(row) for array in (world.roll, world.pitch, world.yaw)))
    return chain(own, mounting.orientation)


def _velocity(world: World, row: int, here: Vector) -> tuple[float, float]:
    """Return the velocity of a place on a vehicle to the east and to the north [m/s]."""
    yaw, speed, turn = world.yaw.item(row), world.speed.item(row), world.yaw_rate.item(row)
    x, y = here[0] - world.x.item(row), here[1] - world.y.item(row)
    return speed * math.cos(yaw) - turn * y, speed * math.sin(yaw) + turn * x


def _nearest(world: World, row: int, here: Vector, reach: float) -> IntArray:
    """Return the rows of the nearest other entities in reach, the nearest first."""
    others = np.flatnonzero(world.alive)
    others = others[others != row]
    apart = np.hypot(world.x[others] - here[0], world.y[others] - here[1])
    size = np.hypot(world.half_length[others] + np.abs(world.centre[others]), world.half_width[others])
    order = np.argsort(apart, kind="stable")
    order = order[(apart <= reach + size)[order]]
    found: IntArray = others[order[:MAX_COMPARED]]
    return found


def _cross_sections(world: World, rows: IntArray) -> FloatArray:
    kind = world.kind[rows]
    section = np.zeros(len(rows))
    for each, figure in _CLASS.items():
        section[kind == each] = figure
    is_vehicle = (kind == Kind.VEHICLE) | (kind == Kind.EGO)
    section[is_vehicle & (2.0 * world.half_length[rows] > _LONG_FROM)] = _LONG
    section[is_vehicle & (2.0 * world.half_width[rows] < _NARROW)] = _BICYCLE
    return section


class _Footprints:
    """Boxes in the plane of the map, relative to the radar.

    Attributes:
        x, y: their middles [m].
        half_length, half_width: [m].
    """

    def __init__(self, world: World, rows: IntArray, here: Vector) -> None:
        self._cos, self._sin = np.cos(world.yaw[rows]), np.sin(world.yaw[rows])
        self.half_length, self.half_width = world.half_length[rows], world.half_width[rows]
        self.x = world.x[rows] + world.centre[rows] * self._cos - here[0]
        self.y = world.y[rows] + world.centre[rows] * self._sin - here[1]

    def nearest_points(self) -> tuple[FloatArray, FloatArray]:
        """Return x and y of the point of each box that is nearest to the radar [m]."""
        cos, sin = self._cos, self._sin
        ahead = np.clip(-self.x * cos - self.y * sin, -self.half_length, self.half_length)
        left = np.clip(self.x * sin - self.y * cos, -self.half_width, self.half_width)
        return self.x + ahead * cos - left * sin, self.y + ahead * sin + left * cos

    def sight(self, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the visible share of each box, and how wide it looks [m].

        Args:
            distance: of the boxes; the nearer one hides the farther one [m].
        """
        along, across = np.array([1.0, 1.0, -1.0, -1.0])[:, None], np.array([1.0, -1.0, 1.0, -1.0])[:, None]
        corner_x = along * self.half_length * self._cos - across * self.half_width * self._sin
        corner_y = along * self.half_length * self._sin + across * self.half_width * self._cos
        middle = np.arctan2(self.y, self.x)
        # Angles of the corners from the direction of the middle, so that none of them is on both sides of +-pi.
        turned = np.arctan2(self.y + corner_y, self.x + corner_x) - middle
        turned = (turned + math.pi) % (2.0 * math.pi) - math.pi
        low, high = middle + turned.min(axis=0), middle + turned.max(axis=0)
        shown_width = 2.0 * np.abs(np.cos(middle) * corner_y - np.sin(middle) * corner_x).max(axis=0)
        num_bins = round(2.0 * math.pi / _BIN)
        whole = (1 << num_bins) - 1
        firsts = np.floor(low / _BIN).astype(np.int64)
        counts = np.maximum(np.ceil(high / _BIN).astype(np.int64) - firsts, 1)
        covered = 0  # a bit for each bin: an array for each of 300 boxes doubles the time of a whole reading
        hidden = [0] * len(distance)
        starts, nums = (firsts % num_bins).tolist(), counts.tolist()
        for i in np.argsort(distance, kind="stable").tolist():
            bins = ((1 << nums[i]) - 1) << starts[i]
            bins, over = bins & whole, bins >> num_bins  # those past the end of the turn are at its begin
            hidden[i] = (covered & bins).bit_count() + (covered & over).bit_count()
            covered |= bins | over
        return 1.0 - np.array(hidden) / counts, shown_width


def _relative_velocities(
    world: World, row: int, others: IntArray, here: Vector, point: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the velocities of points of the others as the radar sees them: to the east and to the north [m/s]."""
    own_east, own_north = _velocity(world, row, here)
    yaw, speed, turn = world.yaw[others], world.speed[others], world.yaw_rate[others]
    x, y = point[0] + here[0] - world.x[others], point[1] + here[1] - world.y[others]
    return (speed * np.cos(yaw) - turn * y - own_east, speed * np.sin(yaw) + turn * x - own_north)
