"""A turn of a lidar: rays of a sensor that moves with its vehicle, and the points and ranges that they give.

The turn ends at the frame of its message. The beam of a column looks at the time t = -T .. 0 before that frame, with T
the time of a turn, from where the sensor was then: the vehicle is taken back along its arc with the speed and yaw rate
of the frame. What the beam meets stands where it is at the frame. Points are in the frame of the sensor at the time of
their beam, as a driver of a real one publishes them, and `time` is t.

Intensities are 0..255 by material, in the scale of Velodyne: up to 100 is diffuse, and above is what reflects back.
Paint on roads is above 50 and asphalt is below, since public programs tell lanes from asphalt by that. Paint and signs
have glass beads, which reflect at any angle; what is diffuse gets darker where the beam grazes it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.camera_geometry import Pose, rotation
from rosbridge_sim.scenery.mesh import Label
from rosbridge_sim.scenery.pictures import Hits
from rosbridge_sim.world.geometry.planar import FloatArray

__all__ = ["POINT_TYPE", "Beams", "Motion", "beams_2d", "beams_3d", "intensities_of", "pack_points", "sweep"]

POINT_TYPE: Final = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": [0, 4, 8, 12, 16, 18],
        "itemsize": 22,
    }
)
"""A point as the velodyne driver publishes it."""

_DIFFUSE: Final = {
    Label.ASPHALT: 14,
    Label.KERB: 35,
    Label.PAVEMENT: 30,
    Label.GROUND: 20,
    Label.BUILDING: 45,
    Label.TREE: 40,
    Label.POLE: 45,
    Label.TRAFFIC_LIGHT: 45,
    Label.VEHICLE: 60,
    Label.MOTORCYCLE: 45,
    Label.BICYCLE: 40,
    Label.PEDESTRIAN: 40,
    Label.OBSTACLE: 60,
}
"""Material -> intensity where the beam is square to it; our estimates."""

_REFLECTING: Final = {
    Label.PAINT_WHITE: 160,
    Label.PAINT_YELLOW: 120,
    Label.PAINT_BLUE: 100,
    Label.CROSSWALK: 160,
    Label.STOP_LINE: 160,
    Label.SIGN: 220,
}
"""Material -> intensity at any angle; our estimates."""

_GRAZING: Final = 0.5
"""Share of the intensity that is left of a diffuse material where a beam grazes it."""


def _table(*parts: dict[Label, int]) -> NDArray[np.float32]:
    table = np.zeros(256, dtype=np.float32)
    for part in parts:
        for label, value in part.items():
            table[label] = value
    table.flags.writeable = False
    return table


_INTENSITY: Final = _table(_DIFFUSE, _REFLECTING)
_IS_REFLECTING: Final = _table(dict.fromkeys(_REFLECTING, 1)) > 0


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """Beams of a turn; (k,) each unless told otherwise, in the order in which they look.

    Attributes:
        directions: (k, 3) unit vectors in the frame of the sensor.
        times: before the end of the turn, not positive [s].
        rings: uint16, from the lowest up.
    """

    directions: FloatArray
    times: FloatArray
    rings: NDArray[np.uint16]


def beams_3d(elevations: FloatArray, num_columns: int, period: float) -> Beams:
    """Return the beams of a lidar that turns clockwise, seen from above, and begins behind.

    Args:
        elevations: of the rings, from the lowest up [rad].
        num_columns: directions of a turn, evenly apart.
        period: of a turn [s].
    """
    azimuth = math.pi - 2.0 * math.pi * np.arange(num_columns) / num_columns
    cos, sin = np.cos(elevations), np.sin(elevations)
    directions = np.stack(
        [np.outer(np.cos(azimuth), cos), np.outer(np.sin(azimuth), cos), np.broadcast_to(sin, (num_columns, len(sin)))],
        axis=-1,
    ).reshape(-1, 3)
    times = period * ((np.arange(num_columns) + 1.0) / num_columns - 1.0)
    rings = np.tile(np.arange(len(elevations), dtype=np.uint16), num_columns)
    return Beams(directions, np.repeat(times, len(elevations)), rings)


def beams_2d(num_values: int, ahead: int, period: float) -> Beams:
    """Return the beams of a level lidar that turns counter-clockwise.

    Args:
        num_values: directions of a turn, evenly apart.
        ahead: index of the one that looks ahead.
        period: of a turn [s].
    """
    angle = 2.0 * math.pi * (np.arange(num_values) - ahead) / num_values
    directions = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(num_values)])
    times = period * ((np.arange(num_values) + 1.0) / num_values - 1.0)
    return Beams(directions, times, np.zeros(num_values, dtype=np.uint16))


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of the vehicle that carries a sensor.

    Attributes:
        vehicle: pose at the end of the turn.
        mounting: of the sensor on it.
        speed: along the heading [m/s].
        yaw_rate: [rad/s].
    """

    vehicle: Pose
    mounting: Pose
    speed: float
    yaw_rate: float


def sweep(motion: Motion, beams: Beams, origin: FloatArray) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return where the beams of a turn begin, and where they look.

    Args:
        motion: of the vehicle.
        beams: of the sensor.
        origin: (3,) of the coordinates, in the map frame [m].

    Returns:
        (k, 3) origins, in the map frame minus `origin` [m], and (k, 3) unit directions.
    """
    vehicle, mounting = motion.vehicle, motion.mounting
    times, where = np.unique(beams.times, return_inverse=True)
    turned = vehicle.yaw + motion.yaw_rate * times
    gone = motion.speed * times
    middle = vehicle.yaw + 0.5 * motion.yaw_rate * times
    level = math.cos(vehicle.pitch)
    axes = rotation(np.full(len(times), vehicle.roll), np.full(len(times), vehicle.pitch), turned)
    lever = np.array(mounting[:3])
    place = np.array(vehicle[:3])[:, None] - np.asarray(origin)[:, None]
    place = place + np.stack(
        [gone * level * np.cos(middle), gone * level * np.sin(middle), -gone * math.sin(vehicle.pitch)]
    )
    # Sums instead of matrix products: the bits of those depend on the library behind numpy.
    place = place + (axes * lever[None, :, None]).sum(axis=1)
    own = rotation(*mounting[3:])
    local = (own[None] * beams.directions[:, None, :]).sum(axis=2)
    directions = (axes[:, :, where] * local.T[None]).sum(axis=1)
    return place.T[where].astype(np.float32), np.ascontiguousarray(directions.T, dtype=np.float32)


def intensities_of(hits: Hits, directions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the intensities of hits.

    Args:
        hits: of k rays.
        directions: (k, 3) unit vectors of the rays.

    Returns:
        (k,) 0..255; 0 for a ray that met nothing.
    """
    cos = np.abs((hits.normals * directions).sum(axis=1))
    share = np.where(_IS_REFLECTING[hits.labels], np.float32(1.0), np.float32(_GRAZING) * (np.float32(1.0) + cos))
    return np.asarray(np.round(_INTENSITY[hits.labels] * share), dtype=np.float32)


def pack_points(
    hits: Hits, beams: Beams, directions: NDArray[np.float32], min_range: float, max_range: float
) -> tuple[bytes, int]:
    """Return the points of a turn as bytes of `POINT_TYPE`, and their number.

    Args:
        hits: of the rays of the beams.
        beams: of the sensor.
        directions: (k, 3) of the rays, in the frame of the normals.
        min_range: nearest point [m].
        max_range: farthest point [m].
    """
    found = np.flatnonzero((hits.ranges >= min_range) & (hits.ranges <= max_range))
    ranges = hits.ranges[found].astype(np.float64)
    points = np.zeros(len(found), dtype=POINT_TYPE)
    for i, axis in enumerate("xyz"):
        points[axis] = beams.directions[found, i] * ranges
    points["intensity"] = intensities_of(hits, directions)[found]
    points["ring"] = beams.rings[found]
    points["time"] = beams.times[found]
    return points.tobytes(), len(found)
