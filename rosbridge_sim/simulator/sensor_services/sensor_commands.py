"""Commands that move the egos' sensors, and captures of their data.

A sensor keeps its place when a scenario is loaded. Readings are those of the sensor's place, without noise unless the
settings have it (`sensor_noise`).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final

import msgspec

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.graph.participant import Notify, Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.sensor_data.sensor_files import SensorDataStore, boxes_text
from rosbridge_sim.simulator.sensor_rigs.mounted_sensors import MountedSensors
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise
from rosbridge_sim.simulator.sensors.sensor_specs import MAX_LEVER
from rosbridge_sim.simulator.sensors.sensor_table import SENSOR_FRAMES
from rosbridge_sim.world.vehicle.sensor_readings import Mounting, find_boxes

BOX_REACH: Final = 200.0
"""Largest distance of an object in the file of boxes [m], which is the range of good lidars."""

MAX_BOXES: Final = 1_000
"""Largest number of boxes in one file; the nearest ones are kept."""

_FIELDS: Final = ("pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw")

_log = logging.getLogger("rosbridge_sim.morai")


class Sensors(Component):
    """Component of the sensors. The egos keep the sensors' places."""

    def __init__(
        self,
        context: SimulatorContext,
        archive: SensorDataStore | None,
        noise: SensorNoise | None,
        mounted: MountedSensors,
    ) -> None:
        """Keep the sensors' data nowhere yet.

        Args:
            archive: saves captures; None if there is no folder for them.
            noise: errors of all sensors; None for exact readings.
        """
        self._context = context
        self._mounted = mounted
        self._noise = noise
        self._archive = archive

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Subscribe to the topics that move the ego's sensors and save their data."""
        bindings.listen("SensorPosControl", "SensorPosControl", partial(self._move, ego))
        bindings.listen("SaveSensorData", "SaveSensorData", partial(self._save_as_told, ego, bindings))

    def save_state(self) -> PlainData:
        """Return the settings of the noise, so that a snapshot goes on with the same readings."""
        return None if self._noise is None else msgspec.json.encode(self._noise).decode()

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
        """
        if not ego.is_there:
            return
        try:
            self._save(ego, "", "", f"sensor_capture of {service}", partial(_complain, notify, "sensor_capture"))
        except DocumentError as error:
            _complain(notify, "sensor_capture", error)

    # In

    def _move(self, ego: Ego, message: Struct, sender: Participant, now: float) -> None:
        moved = mountings_of(message, tuple(ego.mountings))
        ego.mountings |= moved
        self._context.static_tf.announce(now)
        _log.debug("ego %d: %s moved by %s", ego.index, ", ".join(moved) or "no sensor", sender.name)

    def _save_as_told(
        self, ego: Ego, bindings: SubscribersServices, message: Struct, sender: Participant, _now: float
    ) -> None:
        where = "morai_msgs/SaveSensorData"
        name = message.custom_file_name if message.is_custom_file_name else ""
        if message.is_custom_file_name and not name:
            raise FieldError(f"{where}.custom_file_name: expected a name, as is_custom_file_name says")
        try:
            late = partial(_complain, sender.notifier(), where)
            self._save(ego, message.file_dir, name, bindings.topic("SaveSensorData"), late)
        except DocumentError as error:
            raise FieldError(f"{where}: {error}") from None

    def _save(self, ego: Ego, folder: str, name: str, source: str, complain: Callable[[Exception], None]) -> None:
        """Save the data of an ego's sensors in this frame; that of cameras and lidars has to be drawn before.

        Args:
            folder: see `SensorDataStore.save`.
            name: of the capture; empty for the frame's number.
            source: see `SensorDataStore.save`.
            complain: takes the error if the data cannot be saved after it was drawn.

        Raises:
            DocumentError: the data cannot be saved there, or under that name.
        """
        archive = self._archive
        if archive is None:
            raise DocumentError("this simulator has no folder for sensor data")
        name = name or f"frame_{self._context.world.frame:06d}"
        files = self._files(ego)

        def finish(drawn: Mapping[str, bytes] | Exception, _now: float) -> None:
            if isinstance(drawn, Exception):
                complain(drawn)
                return
            try:
                archive.save(folder, name, {**files, **drawn}, source)
            except DocumentError as error:
                complain(error)

        if not self._mounted.draw_files(ego, finish):
            archive.save(folder, name, files, source)

    def _files(self, ego: Ego) -> Mapping[str, bytes]:
        world = self._context.world
        boxes = find_boxes(world, ego.row, BOX_REACH, MAX_BOXES)
        return {
            **self._mounted.read_files(ego),
            ego.frame_prefix + "BOXES_{}.txt": boxes_text(world, boxes, self._context.egos.unique_id),
        }


def _complain(notify: Notify, where: str, error: Exception) -> None:
    notify("error", f"{where}: {error}")


def mountings_of(message: Struct, frames: Sequence[str] = SENSOR_FRAMES) -> dict[str, Mounting]:
    """Read a SensorPosControl.

    Args:
        message: a generated struct; places in metres, angles in radians, in the frame of the vehicle.
        frames: of the vehicle's sensors, by their numbers.

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
        if not 0 <= index < len(frames):
            known = ", ".join(f"{number} ({name})" for number, name in enumerate(frames))
            raise FieldError(f"{where}.sensor_index: expected {known}, got {index}")
        if frames[index] in moved:
            raise FieldError(f"{where}.sensor_index: {index} is named twice")
        place, angles = ([getattr(message, name)[i] for name in names] for names in (_FIELDS[:3], _FIELDS[3:]))
        if not all(-MAX_LEVER <= figure <= MAX_LEVER for figure in place):
            raise FieldError(f"{where}[{i}]: expected a place within +-{MAX_LEVER:g} m, got {tuple(place)}")
        if not all(map(math.isfinite, angles)):
            raise FieldError(f"{where}[{i}]: expected finite angles, got {tuple(angles)}")
        moved[frames[index]] = Mounting(*place, *angles)
    return moved
