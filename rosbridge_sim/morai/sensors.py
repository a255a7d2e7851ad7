"""Sensors of the egos: their topics, commands that move them, and captures of their data.

Each ego has these, by their numbers in SensorPosControl:

    0  GPS   /gps   morai_msgs/GPSMessage  frame gps_link
    1  IMU   /imu   sensor_msgs/Imu        frame imu_link

They are in the middle of the rear axle until a client moves them, and keep their place when a scenario is loaded.
Readings are those of the sensor's place, without noise unless the settings have it (`sensor_noise`). They are computed
only for topics with subscribers.

GPS. `latitude` and `longitude` are WGS 84. In the map's projection (mostly UTM), minus `eastOffset` and `northOffset`,
they give the map's x and y. `altitude` has the same zero as the map's heights. `status` is 1 with a fix. It is 0, and
both angles are 0, at a place that the map's projection does not cover.

IMU. All values are in the sensor's own frame, except the orientation: that of the sensor in the map (ENU). The
acceleration includes the reaction to gravity, so at rest it points upwards with 9.81 m/s^2 (REP 145).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from functools import partial
from typing import Final

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.graph.participant import Notify, Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.component import Component
from rosbridge_sim.morai.context import SimulatorContext
from rosbridge_sim.morai.convert import maker
from rosbridge_sim.morai.ego import GPS, IMU, SENSORS, Ego
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices
from rosbridge_sim.morai.maps.georeference import Georeference
from rosbridge_sim.morai.plain_bytes import PlainData
from rosbridge_sim.morai.sensor_files import SensorDataStore, boxes_text, gps_text, imu_text
from rosbridge_sim.morai.sensor_noise import NoiseSource, SensorNoise, covariance
from rosbridge_sim.morai.tf_publisher import frame_prefix
from rosbridge_sim.world.sensors import Mounting, feel, find_boxes, locate

__all__ = ["Sensors", "mountings_of"]

MAX_LEVER: Final = 100.0
"""Largest distance of a sensor from its vehicle's rear axle along each axis [m]; longer than any road train."""

BOX_REACH: Final = 200.0
"""Largest distance of an object in the file of boxes [m], which is the range of good lidars."""

MAX_BOXES: Final = 1_000
"""Largest number of boxes in one file; the nearest ones are kept."""

_FIELDS: Final = ("pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw")

_log = logging.getLogger("rosbridge_sim.morai")


class Sensors(Component):
    """Component of the sensors. The egos keep the sensors' places."""

    def __init__(
        self, context: SimulatorContext, archive: SensorDataStore | None, noise: SensorNoise | None = None
    ) -> None:
        """Keep the sensors' data nowhere yet.

        Args:
            context: of the simulator.
            archive: saves captures; None if there is no folder for them.
            noise: errors of all sensors; None for exact readings.
        """
        self._context = context
        self._noise = noise
        self._archive = archive
        self._globe = Georeference()
        context.hooks.on_reset.append(self._reset)
        store = context.bus.store
        self._make_gps = maker(
            store,
            "morai_msgs/GPSMessage",
            *("header", "latitude", "longitude", "altitude", "eastOffset", "northOffset", "status"),
        )
        self._make_imu = maker(
            store,
            "sensor_msgs/Imu",
            *("header", "orientation", "orientation_covariance"),
            *("angular_velocity", "angular_velocity_covariance"),
            *("linear_acceleration", "linear_acceleration_covariance"),
        )
        self._make_vector = maker(store, "geometry_msgs/Vector3", "x", "y", "z")
        self._make_quaternion = maker(store, "geometry_msgs/Quaternion", "x", "y", "z", "w")

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:
        """Publish the ego's GPS and IMU."""
        publishers.add(prefix + "gps", "morai_msgs/GPSMessage", partial(self._gps, ego), is_sampled=True)
        publishers.add(prefix + "imu", "sensor_msgs/Imu", partial(self._imu_unless_lost, ego), is_sampled=True)

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Subscribe to the topics that move the ego's sensors and save their data."""
        bindings.listen("SensorPosControl", "SensorPosControl", partial(self._move, ego))
        bindings.listen("SaveSensorData", "SaveSensorData", partial(self._save_as_told, ego, bindings))

    def _reset(self) -> None:
        """Put the sensors back where they were at the start."""
        for ego in self._context.egos:
            ego.mountings = dict.fromkeys(SENSORS, Mounting())

    def save_state(self) -> PlainData:
        """Return the settings of the noise, so that a snapshot goes on with the same readings."""
        return None if self._noise is None else self._noise.model_dump_json()

    def load_state(self, data: PlainData, now: float) -> None:  # noqa: ARG002 - the settings do not change
        """Check that the snapshot was made with the same noise; there is no other state.

        Raises:
            ValueError: it was not.
        """
        if data != self.save_state():
            raise ValueError("expected a snapshot with the same --sensor-noise")

    def capture(self, ego: Ego, notify: Notify, service: str) -> None:
        """Save the data of an ego's sensors in this frame, under the frame's number. An error is sent to the caller.

        Args:
            ego: the ego; one that was removed is ignored.
            notify: sends a status to the client that called the service.
            service: the service's name.
        """
        if not ego.is_there:
            return
        try:
            self._save(ego, "", "", f"sensor_capture of {service}")
        except DocumentError as error:
            notify("error", f"sensor_capture: {error}")

    # Out

    def _header(self, ego: Ego, sensor: str) -> Struct:
        return self._context.convert.header(self._context.world.frame, frame_prefix(ego) + sensor)

    def _gps(self, ego: Ego) -> Struct:
        road_map = self._context.scene.road_map
        x, y, z = locate(self._context.world, ego.row, ego.mountings[GPS])
        has_fix = True
        if self._noise is not None:
            read = self._source(self._noise, ego).locate((x, y, z))
            has_fix, (x, y, z) = read is not None, read or (x, y, z)
        east, north, up = road_map.origin
        place = self._globe.locate(road_map, x, y) if has_fix else None
        latitude, longitude = place or (0.0, 0.0)
        return self._make_gps(
            self._header(ego, GPS), latitude, longitude, z + up, east, north, 0 if place is None else 1
        )

    def _imu(self, ego: Ego) -> Struct:
        reading = feel(self._context.world, ego.row, ego.mountings[IMU])
        vector, unknown = self._make_vector, [0.0] * 9  # by convention, all zeros mean an unknown covariance
        about_axes = about_rates = about_accel = unknown
        if self._noise is not None:
            reading, imu = self._source(self._noise, ego).feel(reading), self._noise.imu
            about_axes = covariance(imu.roll_pitch.variance, imu.roll_pitch.variance, imu.yaw.variance)
            about_rates = covariance(*[imu.angular_velocity.variance] * 3)
            about_accel = covariance(*[imu.acceleration.variance] * 3)
        return self._make_imu(
            self._header(ego, IMU),
            *(self._make_quaternion(*reading.orientation), about_axes),
            *(vector(*reading.angular_velocity), about_rates),
            *(vector(*reading.acceleration), about_accel),
        )

    def _imu_unless_lost(self, ego: Ego) -> Struct | None:
        if self._noise is not None and self._source(self._noise, ego).is_imu_lost():
            return None
        return self._imu(ego)

    def _source(self, noise: SensorNoise, ego: Ego) -> NoiseSource:
        world = self._context.world
        return NoiseSource(noise, world.seed, world.uid.item(ego.row), world.frame)

    # In

    def _move(self, ego: Ego, message: Struct, sender: Participant, now: float) -> None:
        moved = mountings_of(message)
        ego.mountings |= moved
        self._context.static_tf.announce(now)
        _log.debug("ego %d: %s moved by %s", ego.index, ", ".join(moved) or "no sensor", sender.name)

    def _save_as_told(
        self, ego: Ego, bindings: SubscribersServices, message: Struct, _sender: Participant, _now: float
    ) -> None:
        where = "morai_msgs/SaveSensorData"
        name = message.custom_file_name if message.is_custom_file_name else ""
        if message.is_custom_file_name and not name:
            raise FieldError(f"{where}.custom_file_name: expected a name, as is_custom_file_name says")
        try:
            self._save(ego, message.file_dir, name, bindings.topic("SaveSensorData"))
        except DocumentError as error:
            raise FieldError(f"{where}: {error}") from None

    def _save(self, ego: Ego, folder: str, name: str, source: str) -> None:
        """Save the data of an ego's sensors in this frame.

        Raises:
            DocumentError: the data cannot be saved there, or under that name.
        """
        if self._archive is None:
            raise DocumentError("this simulator has no folder for sensor data")
        self._archive.save(folder, name or f"frame_{self._context.world.frame:06d}", self._files(ego), source)

    def _files(self, ego: Ego) -> Mapping[str, bytes]:
        world = self._context.world
        prefix, frame = frame_prefix(ego), world.frame
        boxes = find_boxes(world, ego.row, BOX_REACH, MAX_BOXES)
        return {
            prefix + "GPS_{}.csv": gps_text(frame, self._gps(ego)),
            prefix + "IMU_{}.csv": imu_text(frame, self._imu(ego)),
            prefix + "BOXES_{}.txt": boxes_text(world, boxes, self._context.egos.unique_id),
        }


def mountings_of(message: Struct) -> dict[str, Mounting]:
    """Read a SensorPosControl.

    Args:
        message: a generated struct; places in metres, angles in radians, in the frame of the vehicle.

    Returns:
        The new places of the sensors that it names, by the sensors' frames.

    Raises:
        FieldError: lists of different lengths, an unknown sensor, a sensor named twice, or a number that is not finite
            or
            out of range. No part of the message is used.
    """
    where = "morai_msgs/SensorPosControl"
    indices = message.sensor_index
    for name in _FIELDS:
        num = len(getattr(message, name))
        if num != len(indices):
            raise FieldError(f"{where}.{name}: expected {len(indices)} entries as sensor_index has, got {num}")
    moved: dict[str, Mounting] = {}
    for i, index in enumerate(indices):
        if not 0 <= index < len(SENSORS):
            known = ", ".join(f"{number} ({name})" for number, name in enumerate(SENSORS))
            raise FieldError(f"{where}.sensor_index: expected {known}, got {index}")
        if SENSORS[index] in moved:
            raise FieldError(f"{where}.sensor_index: {index} is named twice")
        place, angles = ([getattr(message, name)[i] for name in names] for names in (_FIELDS[:3], _FIELDS[3:]))
        if not all(-MAX_LEVER <= figure <= MAX_LEVER for figure in place):
            raise FieldError(f"{where}[{i}]: expected a place within +-{MAX_LEVER:g} m, got {tuple(place)}")
        if not all(map(math.isfinite, angles)):
            raise FieldError(f"{where}[{i}]: expected finite angles, got {tuple(angles)}")
        moved[SENSORS[index]] = Mounting(*place, *angles)
    return moved
