"""Kinds of entities, gears, control modes, bodies, and the bounds of all numbers.

`state` re-exports these names; import them from there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Final

__all__ = ["MAX_COORDINATE", "MAX_SPEED", "Body", "Gear", "Kind", "Mode"]

MAX_COORDINATE: Final = 1e9
"""Bound of coordinates, and of angles that are wrapped later [m, rad]. It is far beyond any map, and keeps squares and
sums finite for ever."""

MAX_SPEED: Final = 1e3
"""Bound of speeds, far beyond any car [m/s]."""


class Kind(IntEnum):
    """Kind of an entity."""

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
        max_decel: deceleration of the full brake, before drag [m/s^2].
        rolling: deceleration by rolling resistance, at any speed [m/s^2].
        drag: deceleration by air, engine and gears for each (m/s)^2 [1/m]. With the default, full throttle reaches
            180 km/h at most, and 100 km/h in ten seconds.
        speed_mode_accel, speed_mode_decel: the most that the speed controller asks for [m/s^2].
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

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: names the attribute, what was expected and what came.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            is_size = field.name in {"length", "width", "height"}
            if not (0.0 <= value <= MAX_COORDINATE) or (is_size and value == 0.0):
                raise ValueError(
                    f"Body.{field.name}: expected a {'positive' if is_size else 'finite'} number >= 0, got {value!r}"
                )
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
