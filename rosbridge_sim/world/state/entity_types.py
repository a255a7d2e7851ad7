"""Kinds of entities, gears, control modes, bodies, and the bounds of all numbers.

`world` beside it exports those that other rooms use most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Final

MAX_COORDINATE: Final = 1e9
"""Bound of coordinates, and of angles that are wrapped later [m, rad]. It is far beyond any map, and keeps squares and
sums finite for ever."""

MAX_SPEED: Final = 1e3
"""Bound of speeds, far beyond any car [m/s]."""

GRAVITY: Final = 9.80665
"""The standard acceleration of free fall [m/s^2] (CGPM 1901); maps do not give their own."""

MIN_FRICTION_SHARE: Final = 0.1
"""Least friction of the ground relative to a dry one: wet ice (Wong, Theory of Ground Vehicles, table 1.3: 0.1)."""

ROAD_FRICTION: Final = 0.9
"""Friction of dry asphalt: 0.8 to 0.9 at the peak (Wong, Theory of Ground Vehicles, table 1.3)."""

CG_SHARE: Final = 0.37
"""Height of the centre of gravity of a vehicle, as a share of its height: our estimate, usual for passenger cars."""

MIN_LOAD: Final = 0.05
"""Least share of the weight that an axle carries: with less, a car would tip over."""

_POSITIVE: Final = frozenset(
    {"length", "width", "height", "mass", "dynamic_index", "front_stiffness", "rear_stiffness", "grip", "grip_along"}
)


class Kind(IntEnum):
    """Kind of an entity.

    Columns are compared with `int(Kind.EGO)`: numpy takes 10 us to make a number of a member of an enumeration.
    """

    EGO = 0  # driven by commands, moved by the single track model
    VEHICLE = 1
    PEDESTRIAN = 2
    OBSTACLE = 3


class Gear(IntEnum):
    """Gear of a driven row; the numbers are MORAI's."""

    PARK = 1
    REVERSE = 2
    NEUTRAL = 3
    DRIVE = 4


class Mode(IntEnum):
    """Longitudinal control mode of a driven row."""

    PEDALS = 1  # throttle and brake, 0..1
    SPEED = 2  # a speed to reach and hold [m/s]
    ACCEL = 3  # an acceleration to keep [m/s^2]


class Dynamics(IntEnum):
    """Model that moves the driven rows."""

    KINEMATIC = 0  # wheels roll where they point, see `dynamics`
    SINGLE_TRACK = 1  # wheels slip, see `single_track`


@dataclass(frozen=True, slots=True)
class Body:
    """Size and limits of an entity; the defaults are those of a mid-size car (Hyundai Ioniq).

    Sizes count for every kind, the other values for driven rows only.

    Attributes:
        length, width, height: of the bounding box [m].
        wheelbase: from the rear axle to the front axle [m]; 0 for a body without axles.
        front_overhang, rear_overhang: from the axles to the ends of the box [m]. For a pedestrian or an obstacle the
            reference point is the centre, so the wheelbase is 0 and each overhang half the length; see `Body.box`.
        max_steer: greatest angle of the front wheels, to either side [rad].
        max_steer_rate: greatest rate of that angle [rad/s]. 0.6 rad/s takes a second from straight ahead to the stop.
        max_accel: acceleration of full throttle at rest, before drag [m/s^2].
        max_decel: deceleration of the full brake, before drag; in the single track model that of tyres with a
            `grip_along` of 1 [m/s^2].
        rolling: deceleration by rolling resistance, at any speed [m/s^2].
        drag: deceleration by air, engine and gears for each (m/s)^2 [1/m]. With the default, full throttle reaches
            180 km/h at most, and 100 km/h in ten seconds.
        speed_mode_accel, speed_mode_decel: the most that the speed controller asks for [m/s^2].
        mass: with a driver [kg]: 1,375 kg and 75 kg. The dynamics are those of one kilogram, so it counts for
            impacts and for forces that are reported.
        front_load: share of the weight on the front axle at rest. 0.59 is usual for a car with front engine and
            front-wheel drive.
        cg_height: height of the centre of gravity [m]; see `CG_SHARE`.
        dynamic_index: moment of inertia about the vertical axis, divided by mass * (distances of the centre of gravity
            from both axles). It is near 1 for passenger cars (Heydinger et al., NHTSA's measured parameters, SAE
            1999-01-1336).
        front_stiffness, rear_stiffness: cornering stiffness of an axle for each newton of its load [1/rad]. Tyres alone
            have 15 to 25. The steering gives way, so the front is softer: the car understeers by 1.5 degrees of
            steering for each g, usual for a family car (Gillespie, Fundamentals of Vehicle Dynamics, ch. 6).
        grip: friction of the tyres across the wheels, relative to that of the ground (`ROAD_FRICTION` on roads).
        grip_along: the same along the wheels. 1.3 is 1.17 on dry asphalt, as of the tyre of commonroad-vehicle-models
            (p_dx1); across the wheels that tyre has 1.05.
        front_drive: share of the engine's force at the front wheels.
        max_rear_steer: greatest angle of the rear wheels [rad]; 10 degrees is the most of cars in series.
        roll_gain, pitch_gain: angle of the body for each m/s^2 [rad s^2/m]: 4.5 degrees of roll and 2 of pitch for a g,
            within the usual 3 to 7 and 1.5 to 3 of passenger cars.
        launch_accel: acceleration of full throttle from rest, without resistance [m/s^2]. The single track model reads
            it and the values below instead of `max_accel` and `drag`.
        power: of the engine at the wheels, for each kilogram [W/kg].
        top_speed: the engine pulls no further [m/s]; the Ioniq's is 185 km/h. See also `single_track.REVERSE_SPEED`.
        air_drag: deceleration by air for each (m/s)^2, density * cd A / (2 mass) [1/m]; cd A of the Ioniq: 0.53 m^2.
        engine_drag: deceleration by an engine without throttle in D and R [m/s^2]: a car with an automatic gearbox, our
            estimate.
    """

    length: float = 4.47
    width: float = 1.82
    height: float = 1.45
    wheelbase: float = 2.7
    front_overhang: float = 0.88
    rear_overhang: float = 0.89
    max_steer: float = math.radians(36.25)
    max_steer_rate: float = 0.6
    max_accel: float = 3.5
    max_decel: float = 8.5
    rolling: float = 0.12
    drag: float = 0.00135
    speed_mode_accel: float = 3.0
    speed_mode_decel: float = 6.0
    # Not shown by `repr`, and so no part of labels (`labels.label_of`): digests of the kinematic model never change.
    mass: float = field(default=1450.0, repr=False)
    front_load: float = field(default=0.59, repr=False)
    cg_height: float = field(default=0.537, repr=False)
    dynamic_index: float = field(default=1.0, repr=False)
    front_stiffness: float = field(default=14.0, repr=False)
    rear_stiffness: float = field(default=22.0, repr=False)
    grip: float = field(default=1.0, repr=False)
    grip_along: float = field(default=1.3, repr=False)
    front_drive: float = field(default=1.0, repr=False)
    max_rear_steer: float = field(default=math.radians(10.0), repr=False)
    roll_gain: float = field(default=math.radians(4.5) / GRAVITY, repr=False)
    pitch_gain: float = field(default=math.radians(2.0) / GRAVITY, repr=False)
    launch_accel: float = field(default=3.5, repr=False)
    power: float = field(default=49.8, repr=False)
    top_speed: float = field(default=185.0 / 3.6, repr=False)
    air_drag: float = field(default=0.000219, repr=False)
    engine_drag: float = field(default=0.3, repr=False)

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: names the attribute, what was expected and what came.
        """
        for each in fields(self):
            value = getattr(self, each.name)
            is_size = each.name in _POSITIVE
            if not (0.0 <= value <= MAX_COORDINATE) or (is_size and value == 0.0):
                raise ValueError(
                    f"Body.{each.name}: expected a {'positive' if is_size else 'finite'} number >= 0, got {value!r}"
                )
        if not MIN_LOAD <= self.front_load <= 1.0 - MIN_LOAD:
            raise ValueError(f"Body.front_load: expected {MIN_LOAD} to {1.0 - MIN_LOAD}, got {self.front_load!r}")
        if self.front_drive > 1.0:
            raise ValueError(f"Body.front_drive: expected at most 1, got {self.front_drive!r}")
        if self.max_rear_steer >= math.pi / 2:
            raise ValueError(f"Body.max_rear_steer: expected less than pi/2 rad, got {self.max_rear_steer!r}")
        if self.max_steer >= math.pi / 2:
            raise ValueError(f"Body.max_steer: expected less than pi/2 rad, got {self.max_steer!r}")

    @classmethod
    def box(cls, length: float, width: float, height: float) -> Body:
        """Return the body of an entity without axles, whose reference point is its centre; all arguments in [m]."""
        return cls(length, width, height, wheelbase=0.0, front_overhang=length / 2, rear_overhang=length / 2)

    @property
    def centre(self) -> float:
        """Distance from the reference point forward to the centre of the box [m]."""
        return self.length / 2 - self.rear_overhang


NO_BODY: Final = Body()
"""The body of a free row."""
