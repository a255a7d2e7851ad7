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
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.records import Record
from rosbridge_sim.scenery.camera_geometry import Pose, rotation
from rosbridge_sim.scenery.mesh import Label
from rosbridge_sim.scenery.pictures import Hits, Weather
from rosbridge_sim.world.geometry.planar import FloatArray

POINT_TYPE: Final = np.dtype(
    [*((name, "<f4") for name in ("x", "y", "z", "intensity")), ("ring", "<u2"), ("time", "<f4")]
)
"""A point as the velodyne driver publishes it, without gaps: 22 bytes."""

DIGITS: Final = 5
"""Places of points are rounded to so many digits of a metre. Then a level lidar at 1.25 m has a level road at -1.25 m,
to the bit. Otherwise rounding would lift a quarter of its points above that, and programs would keep these."""

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

_DARKEST: Final = _GRAZING * min(_DIFFUSE.values())
"""Lowest intensity."""

FADING: Final = frozenset({Weather.RAIN, Weather.FOG})
"""Weathers in which echoes are lost; dusk and night are dark for cameras alone."""


def _table(*parts: dict[Label, int]) -> NDArray[np.float32]:
    table = np.zeros(256, dtype=np.float32)
    for part in parts:
        for label, value in part.items():
            table[label] = value
    table.flags.writeable = False
    return table


_INTENSITY: Final = _table(_DIFFUSE, _REFLECTING)
_IS_REFLECTING: Final = _table(dict.fromkeys(_REFLECTING, 1)) > 0


class Beams(Record, eq=False):
    """Beams of a turn; (k,) each unless told otherwise, in the order in which they look.

    Attributes:
        directions: (k, 3) unit vectors in the frame of the sensor.
        times: before the end of the turn, not positive [s].
        rings: uint16, from the lowest up.
        rings_per_column: number of beams one after the other that look at the same time.
    """

    directions: FloatArray
    times: FloatArray
    rings: NDArray[np.uint16]
    rings_per_column: int


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
    return Beams(directions, np.repeat(times, len(elevations)), rings, len(elevations))


def beams_2d(num_values: int, ahead: int, period: float) -> Beams:
    """Return the beams of a level lidar that turns counter-clockwise.

    Args:
        num_values: directions of a turn, evenly apart.
        period: of a turn [s].
    """
    angle = 2.0 * math.pi * (np.arange(num_values) - ahead) / num_values
    directions = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(num_values)])
    times = period * ((np.arange(num_values) + 1.0) / num_values - 1.0)
    return Beams(directions, times, np.zeros(num_values, dtype=np.uint16), 1)


class Motion(Record):
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
        beams: of the sensor.
        origin: (3,) of the coordinates, in the map frame [m].

    Returns:
        (k, 3) origins, in the map frame minus `origin` [m], and (k, 3) unit directions.
    """
    vehicle, mounting = motion.vehicle, motion.mounting
    rings = beams.rings_per_column
    times = beams.times[::rings]
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
    # Sums instead of matrix products: the bits of those depend on the library behind numpy. Each axis is a row of its
    # own, (columns, rings), because sums over an axis of three take five times as long.
    place = place + (axes * lever[None, :, None]).sum(axis=1)
    own = rotation(*mounting[3:])
    x, y, z = np.ascontiguousarray(beams.directions.T).reshape(3, len(times), rings)
    local = [row[0] * x + row[1] * y + row[2] * z for row in own]
    directions = np.empty((len(beams.times), 3), dtype=np.float32)
    for i, row in enumerate(axes[..., None]):
        directions[:, i] = (row[0] * local[0] + row[1] * local[1] + row[2] * local[2]).ravel()
    return np.repeat(place.T.astype(np.float32), rings, axis=0), directions


class Echoes(Record, eq=False):
    """Echoes of the rays of a turn; (k,) float32 each.

    Attributes:
        ranges: [m]; inf for a ray without an echo.
        intensities: 0..255; 0 for a ray that met nothing.
        slants: cosines between the rays and the normals of what they met.
    """

    ranges: NDArray[np.float32]
    intensities: NDArray[np.float32]
    slants: NDArray[np.float32]


def echoes_of(hits: Hits, directions: NDArray[np.float32]) -> Echoes:
    """Return the echoes of hits in clear air.

    Args:
        directions: (k, 3) unit vectors of the rays.
    """
    (a, b, c), (x, y, z) = hits.normals.T, directions.T
    cos = np.abs(a * x + b * y + c * z)
    share = np.where(_IS_REFLECTING[hits.labels], np.float32(1.0), np.float32(_GRAZING) * (np.float32(1.0) + cos))
    return Echoes(hits.ranges, np.asarray(np.round(_INTENSITY[hits.labels] * share), dtype=np.float32), cos)


def fade(echoes: Echoes, extinction: float, max_range: float) -> Echoes:
    """Return the echoes that come through fog or rain.

    The lidar equation has the power of an echo at the range r as  c i exp(-2 a r) / r^2,  with the reflectivity i of
    what was met (here its intensity) and the extinction a of the air (Rasshofer, Spies and Spies 2011, "Influences of
    weather phenomena on automotive laser radar systems"). a is that of visible light, because drops are larger than
    both wavelengths (Kim, McArthur and Korevaar 2001, for visibilities below 500 m). An echo is lost if it is weaker
    than that of `_DARKEST` at the longest range in clear air, which is the weakest that is seen there.

    Args:
        extinction: a [1/m].
        max_range: longest range of the lidar [m].
    """
    ranges = np.maximum(np.where(np.isfinite(echoes.ranges), echoes.ranges, np.float32(max_range)), np.float32(0.1))
    strengths = echoes.intensities * np.exp(np.float32(-2.0 * extinction) * ranges)
    is_lost = strengths < np.float32(_DARKEST / (max_range * max_range)) * ranges * ranges
    return Echoes(np.where(is_lost, np.float32(np.inf), echoes.ranges), np.round(strengths), echoes.slants)


def pack_points(echoes: Echoes, beams: Beams, min_range: float, max_range: float) -> tuple[bytes, int]:
    """Return the points of a turn as bytes of `POINT_TYPE`, and their number.

    Args:
        beams: of the sensor.
        min_range: nearest point [m].
        max_range: farthest point [m].
    """
    found = np.flatnonzero((echoes.ranges >= min_range) & (echoes.ranges <= max_range))
    ranges = echoes.ranges[found].astype(np.float64)
    points = np.zeros(len(found), dtype=POINT_TYPE)
    for i, axis in enumerate("xyz"):
        points[axis] = np.round(beams.directions[found, i] * ranges, DIGITS)
    points["intensity"] = echoes.intensities[found]
    points["ring"] = beams.rings[found]
    points["time"] = beams.times[found]
    return points.tobytes(), len(found)
