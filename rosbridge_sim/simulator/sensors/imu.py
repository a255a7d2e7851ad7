"""IMU: orientation, angular velocity and acceleration of an inertial unit.

All values are in the sensor's own frame, except the orientation: that of the sensor in the map (ENU). The acceleration
includes the reaction to gravity, so at rest it points upwards with 9.81 m/s^2 (REP 145).
"""

from __future__ import annotations

from typing import ClassVar

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.sensor_data.sensor_files import imu_text
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_noise import covariance
from rosbridge_sim.simulator.sensors.sensor_specs import IMU_FRAME, EgoSensorSpec
from rosbridge_sim.world.vehicle.sensor_readings import feel


class _Maker:
    """Maker of the messages of all inertial units of a simulator."""

    def __init__(self, store: Store) -> None:
        self.make = maker(
            store,
            ImuSpec.type_name,
            "header orientation orientation_covariance angular_velocity angular_velocity_covariance "
            "linear_acceleration linear_acceleration_covariance",
        )
        self.vector = maker(store, "geometry_msgs/Vector3", "x y z")
        self.quaternion = maker(store, "geometry_msgs/Quaternion", "x y z w")


class ImuSpec(EgoSensorSpec, frozen=True, kw_only=True):
    """The inertial unit; the settings of topics have its rate."""

    kind: ClassVar[str] = "imu"
    morai_noun: ClassVar[str] = "IMU"
    morai_lists: ClassVar[tuple[str, ...]] = ("IMUList",)
    frame_id: ClassVar[str] = IMU_FRAME
    topic: ClassVar[str] = "/imu"
    type_name: ClassVar[str] = "sensor_msgs/Imu"
    file_name: ClassVar[str] = "IMU_{}.csv"

    as_text = staticmethod(imu_text)

    def read(self, shared: SensorContext, ego: Ego, number: int = 0) -> Struct | None:  # noqa: ARG002 - it has one topic
        """Return the readings, in the frame of the unit; None if the noise of the settings loses them."""
        errors = shared.errors(ego)
        return None if errors is not None and errors.is_imu_lost() else self.measure(shared, ego)

    def measure(self, shared: SensorContext, ego: Ego) -> Struct:
        """Return the readings, in the frame of the unit."""
        make = shared.once(_Maker)
        reading = feel(shared.simulator.world, ego.row, ego.mountings[self.frame_id])
        about_axes = about_rates = about_accel = [0.0] * 9  # by convention, all zeros mean an unknown covariance
        errors = shared.errors(ego)
        if errors is not None:
            reading, imu = errors.feel(reading), errors.noise.imu
            about_axes = covariance(imu.roll_pitch.variance, imu.roll_pitch.variance, imu.yaw.variance)
            about_rates = covariance(*[imu.angular_velocity.variance] * 3)
            about_accel = covariance(*[imu.acceleration.variance] * 3)
        return make.make(
            shared.header(ego, self.frame_id),
            *(make.quaternion(*reading.orientation), about_axes),
            *(make.vector(*reading.angular_velocity), about_rates),
            *(make.vector(*reading.acceleration), about_accel),
        )
