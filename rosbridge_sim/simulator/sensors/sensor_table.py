"""The table of the kinds of sensors, and the rigs that are made of them.

A *rig* is the sensors of one ego. Each ego has one GPS and one IMU.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.fisheye_camera import FisheyeSpec
from rosbridge_sim.simulator.sensors.gps import GpsSpec
from rosbridge_sim.simulator.sensors.imu import ImuSpec
from rosbridge_sim.simulator.sensors.lidar_2d import Lidar2dSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.radar import RadarSpec
from rosbridge_sim.simulator.sensors.sensor_specs import MAX_RAYS, Rig, SensorSpec

KINDS: Final[tuple[type[SensorSpec], ...]] = (
    GpsSpec,
    ImuSpec,
    CameraSpec,
    FisheyeSpec,
    Lidar3dSpec,
    Lidar2dSpec,
    RadarSpec,
)
"""A row for each kind. The sensors of a file are numbered in this order, those that each ego has first."""

_ON_EACH_EGO: Final = tuple(kind for kind in KINDS if kind.is_on_each_ego)

SENSOR_FRAMES: Final = tuple(kind().frame_id for kind in _ON_EACH_EGO)
"""Coordinate frames of the sensors that each ego has; the index is the number of a sensor in SensorPosControl."""

MAX_SENSORS: Final = 32
"""Cameras, lidars and radars of one ego; more than any test vehicle has."""

MAX_PIXELS: Final = 8_294_400
"""Pixels of all cameras of one ego together: one picture of 3840 x 2160, or 27 of 640 x 480."""

MAX_RAW_BYTES: Final = 12_000_000
"""Bytes of all raw pictures and points of one ego, where all of them have the same frame, and of those of all egos that
are published in one turn of the server's loop. As JSON they take 2.7 ns a byte (measured), and no client may have to
wait for longer than 50 ms."""


def complete(rig: Rig) -> Rig:
    """Return a rig with the sensors that each ego has, which come first."""
    first = [next((spec for spec in rig if isinstance(spec, kind)), kind()) for kind in _ON_EACH_EGO]
    return *first, *(spec for spec in rig if not spec.is_on_each_ego)


def check_rig(rig: Sequence[SensorSpec]) -> None:
    """Check that an ego can have these sensors together.

    Raises:
        FieldError: a limit is exceeded, or two sensors have one name, or one topic would have two types.
    """
    num = sum(not spec.is_on_each_ego for spec in rig)
    if num > MAX_SENSORS:
        raise FieldError(f"sensors: expected at most {MAX_SENSORS} for an ego, got {num}")
    num_pixels, num_rays, num_bytes = (sum(spec.cost[i] for spec in rig) for i in range(3))
    if num_pixels > MAX_PIXELS:
        raise FieldError(f"cameras: expected at most {MAX_PIXELS:,} pixels for all of an ego, got {num_pixels:,}")
    for spec in rig:
        spec.check()
    if num_rays > MAX_RAYS:
        raise FieldError(f"lidars: expected at most {MAX_RAYS:,} rays a turn for all of an ego, got {num_rays:,}")
    if num_bytes > MAX_RAW_BYTES:
        raise FieldError(
            f"sensors: expected at most {MAX_RAW_BYTES:,} bytes of raw pictures and points in a frame of an ego,"
            f" got {num_bytes:,}"
        )
    _refuse_twice(frame for spec in rig for frame in spec.frames)
    types: dict[str, str] = {}
    for spec in rig:
        for name, type_name in spec.topics:
            other = types.setdefault(name, type_name)
            if other != type_name:
                raise FieldError(
                    f"{spec.frame_id}: topic {name}: expected {other}, as another sensor has, got {type_name}"
                )


def _refuse_twice(frames: Iterable[str]) -> None:
    for frame, num in Counter(frames).items():
        if num > 1:
            raise FieldError(f"frame_id: expected different names, got {frame} {num} times")
