"""Parameters of drivers: each driver has its own, by the class of its vehicle and by chance.

The class follows from the size of the vehicle, the chance from the world's seed and the id of the entity. So the
parameters are no state: they are worked out again whenever entities come or go. A self-driving ego is the mean driver
of its class: users know then what to expect, and it does not drive faster than the limit.

Sources. *SUMO*: its vehicle class defaults (passenger, truck, bus, motorcycle, bicycle), for speed factors and
accelerations, and for the headway of cars, with which queues at a light and jams flow as SUMO's do.
*Treiber and Kesting*, Traffic Flow Dynamics (2013), ch. 11 and 14: time gaps near 1 s in cities, comfortable
deceleration 2 m/s^2, politeness 0 to 0.5. *Reymond et al.*, Human Factors 43 (2001): drivers of cars accept a lateral
acceleration of 2 to 3 m/s^2 in usual traffic. Those of buses accept about half, because people stand there.
*Lane changes*: means of 4.0 s (Thiemann, Treiber, Kesting 2008) and 4.6 s (Toledo and Zohar 2007, 1 to 13.3 s) in NGSIM
data. Ours is between them, its spread is cut to 3 to 6 s. Heavy vehicles take longer (Moridpour, Sarvi, Rose 2010).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.chance import bell
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

BICYCLE, MOTORCYCLE, CAR, LIGHT_GOODS, HEAVY = range(5)
"""Classes of vehicles."""

TWO_WHEELER_WIDTH: Final = 1.2
"""A narrower vehicle has two wheels [m]: the narrowest cars have 1.4 m, the widest motorcycles 1 m."""

BICYCLE_WIDTH: Final = 0.7
"""A narrower two-wheeler is a bicycle [m]: handlebars of 0.6 m, those of motorcycles have 0.7 to 0.9 m."""

GOODS_HEIGHT: Final = 1.9
"""A higher vehicle is a van or a light truck [m]: cars, SUVs included, have 1.4 to 1.8 m."""

HEAVY_LENGTH: Final = 7.0
"""A longer vehicle is a bus or a heavy truck [m]: vans end at 6.9 m."""


_TABLE: Final = """
              bicycle            | motorcycle          | car                | light goods        | heavy
speed_factor  1 0.08 0.85 1.2    | 1.05 0.08 0.85 1.25 | 1 0.08 0.85 1.2    | 1 0.06 0.85 1.15   | 0.95 0.05 0.85 1.05
desired_speed 5 0.7 3 7.5        | 45 0 45 45          | 45 0 45 45         | 40 0 40 40         | 25 0 25 25
headway       1 0.1 0.7 1.4      | 0.9 0.1 0.65 1.2    | 1 0.12 0.7 1.4     | 1.1 0.12 0.75 1.5  | 1.3 0.15 0.9 1.8
accel         0.9 0.1 0.6 1.2    | 2.4 0.2 1.8 2.6     | 2.4 0.15 1.8 2.6   | 1.7 0.15 1.2 2.2   | 1.1 0.08 0.9 1.3
comfort       1.5 0.15 1 2       | 2 0.15 1.5 2.4      | 2 0.15 1.5 2.4     | 1.9 0.15 1.5 2.3   | 1.5 0.1 1.2 1.8
lateral       1.8 0.2 1.2 2.4    | 2.8 0.3 2 3.4       | 2.5 0.25 1.8 3     | 2.2 0.2 1.6 2.8    | 1.4 0.12 1 1.8
reaction      0.3 0.05 0.15 0.45 | 0.3 0.05 0.15 0.45  | 0.3 0.05 0.15 0.45 | 0.3 0.05 0.15 0.45 | 0.3 0.05 0.15 0.45
politeness    0.3 0.1 0 0.6      | 0.3 0.1 0 0.6       | 0.3 0.1 0 0.6      | 0.3 0.1 0 0.6      | 0.3 0.1 0 0.6
change_time   4.4 0.6 3 6        | 4.4 0.6 3 6         | 4.4 0.6 3 6        | 4.4 0.6 3 6        | 5.2 0.4 4.2 6
most_lateral  2.4 0 2.4 2.4      | 3.7 0 3.7 3.7       | 3.25 0 3.25 3.25   | 2.8 0 2.8 2.8      | 1.76 0 1.76 1.76
"""
"""Mean, standard deviation, and bounds of each parameter in each class. The desired speeds are those of riders in calm
traffic, and those of the speed limiters of heavy vehicles in Europe; `most_lateral` is three deviations above the mean
lateral acceleration."""

FIGURES: Final = {
    name: np.array([cell.split() for cell in cells.split("|")], dtype=np.float64).T
    for name, cells in (line.split(None, 1) for line in _TABLE.strip().splitlines()[1:])
}
"""The same, (4, classes) of each parameter."""


@dataclass(frozen=True, slots=True, eq=False)
class DriverParameters:
    """Parameters of drivers; (k,) each.

    Attributes:
        speed_factor: the driver goes this many times the speed limit on a free road.
        desired_speed: the speed that the driver wants where nothing demands a lower one [m/s].
        headway: T of the intelligent driver model, the time gap to the lead vehicle [s].
        accel: its a, the acceleration from standstill on a free road [m/s^2].
        comfort: its b, the comfortable deceleration [m/s^2].
        lateral: comfortable lateral acceleration in bends [m/s^2].
        reaction: time constant with which the acceleration follows what the driver sees [s].
        politeness: of lane changes (MOBIL): weight of the disadvantage of others, 0 for an egoist.
        change_time: duration of a lane change at the usual speed, see `lane_change_motion` [s].
        most_lateral: the most lateral acceleration that a driver accepts, bend and lane change together [m/s^2].
    """

    speed_factor: FloatArray
    desired_speed: FloatArray
    headway: FloatArray
    accel: FloatArray
    comfort: FloatArray
    lateral: FloatArray
    reaction: FloatArray
    politeness: FloatArray
    change_time: FloatArray
    most_lateral: FloatArray

    @classmethod
    def of(cls, world: WorldRows, rows: IntArray) -> DriverParameters:
        """Return the parameters of some rows that follow lanes.

        A driver with a desired speed that was given, as by a scenario, wants that speed, and keeps to the limit.

        Args:
            world: read only.
            rows: (k,) int64.
        """
        kinds = classes_of(2.0 * world.half_length[rows], 2.0 * world.half_width[rows], world.height[rows])
        salt = world.salts(rows)
        varies = np.where(world.kind[rows] == int(Kind.EGO), 0.0, 1.0)
        columns = []
        for question, each in enumerate(fields(cls)):
            mean, deviation, least, most = FIGURES[each.name].take(kinds, axis=1)
            value = mean + deviation * (varies * bell(salt, question))
            columns.append(np.fmin(np.fmax(value, least), most))
        drivers = cls(*columns)
        given = world.desired_speed[rows]
        at = np.isfinite(given)
        drivers.desired_speed[at], drivers.speed_factor[at] = given[at], 1.0
        return drivers

    def take(self, which: IntArray) -> DriverParameters:
        """Return the parameters of some of the drivers; `which` is (m,) int64."""
        return DriverParameters(*(getattr(self, name)[which] for name in FIGURES))


def classes_of(length: FloatArray, width: FloatArray, height: FloatArray) -> IntArray:
    """Return the classes of vehicles of given sizes, (k,) int64; the arguments are (k,) [m]."""
    wide = np.where(length > HEAVY_LENGTH, HEAVY, np.where(height > GOODS_HEIGHT, LIGHT_GOODS, CAR))
    narrow = np.where(width < BICYCLE_WIDTH, BICYCLE, MOTORCYCLE)
    return np.where(width < TWO_WHEELER_WIDTH, narrow, wide).astype(np.int64)
