"""The table of the sensors that each ego has once, GPS and IMU; cameras, lidars and radars are in `sensor_specs`."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.simulator.sensors.gps import Gps
from rosbridge_sim.simulator.sensors.imu import Imu
from rosbridge_sim.simulator.sensors.sensor import Sensor

__all__ = ["SENSORS", "SENSOR_FRAMES"]

SENSORS: Final[tuple[type[Sensor], ...]] = (Gps, Imu)
"""The index is the number of a sensor in SensorPosControl."""

SENSOR_FRAMES: Final = tuple(sensor.frame for sensor in SENSORS)
"""Their coordinate frames, in the same order."""
