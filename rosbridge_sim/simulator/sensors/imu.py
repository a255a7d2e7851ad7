"""IMU: orientation, angular velocity and acceleration of an inertial unit.

All values are in the sensor's own frame, except the orientation: that of the sensor in the map (ENU). The acceleration
includes the reaction to gravity, so at rest it points upwards with 9.81 m/s^2 (REP 145).
"""

from __future__ import annotations

from typing import ClassVar

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.simulator.bus.network_settings import USUAL_RATE
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.ego import Ego
from rosbridge_sim.simulator.sensors.sensor import Sensor
from rosbridge_sim.simulator.sensors.sensor_files import imu_text
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise, covariance
from rosbridge_sim.simulator.sensors.sensor_specs import IMU_FRAME, SensorSpec
from rosbridge_sim.world.vehicle.sensor_readings import feel

__all__ = ["Imu", "ImuSpec"]


class ImuSpec(SensorSpec, frozen=True, kw_only=True):
    """The inertial unit; the settings of topics have its rate."""

    kind: ClassVar[str] = "imu"
    is_on_each_ego: ClassVar[bool] = True
    frame_id: ClassVar[str] = IMU_FRAME
    topic: ClassVar[str] = "/imu"
    rate: ClassVar[float] = USUAL_RATE

    @property
    def topics(self) -> list[tuple[str, str]]:
        """Its one topic."""
        return [(self.topic, Imu.type_name)]


class Imu(Sensor):
    """The inertial unit."""

    title: ClassVar[str] = "IMU"
    frame: ClassVar[str] = IMU_FRAME
    topic: ClassVar[str] = "imu"
    type_name: ClassVar[str] = "sensor_msgs/Imu"

    def __init__(self, context: SimulatorContext, noise: SensorNoise | None) -> None:
        """Read nothing yet; see `Sensor`."""
        super().__init__(context, noise)
        store = context.bus.store
        self._make_imu = maker(
            store,
            self.type_name,
            *("header", "orientation", "orientation_covariance"),
            *("angular_velocity", "angular_velocity_covariance"),
            *("linear_acceleration", "linear_acceleration_covariance"),
        )
        self._make_vector = maker(store, "geometry_msgs/Vector3", "x", "y", "z")
        self._make_quaternion = maker(store, "geometry_msgs/Quaternion", "x", "y", "z", "w")

    def read(self, ego: Ego) -> Struct:
        """Return the readings of the inertial unit, in its own frame."""
        reading = feel(self._context.world, ego.row, ego.mountings[self.frame])
        vector, unknown = self._make_vector, [0.0] * 9  # by convention, all zeros mean an unknown covariance
        about_axes = about_rates = about_accel = unknown
        if self._noise is not None:
            reading, imu = self._source(self._noise, ego).feel(reading), self._noise.imu
            about_axes = covariance(imu.roll_pitch.variance, imu.roll_pitch.variance, imu.yaw.variance)
            about_rates = covariance(*[imu.angular_velocity.variance] * 3)
            about_accel = covariance(*[imu.acceleration.variance] * 3)
        return self._make_imu(
            self._header(ego),
            *(self._make_quaternion(*reading.orientation), about_axes),
            *(vector(*reading.angular_velocity), about_rates),
            *(vector(*reading.acceleration), about_accel),
        )

    def read_unless_lost(self, ego: Ego) -> Struct | None:
        """Return the readings; None if the noise of the settings loses them."""
        if self._noise is not None and self._source(self._noise, ego).is_imu_lost():
            return None
        return self.read(ego)

    def file(self, frame: int, message: Struct) -> bytes:
        """Return IMU_*.csv."""
        return imu_text(frame, message)
