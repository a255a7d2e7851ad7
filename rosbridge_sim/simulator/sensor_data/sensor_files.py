"""Files with sensor data: their names and formats.

A capture is a set of text files of one frame under one name:

    GPS_NAME.csv    position of the antenna: a line of names, a line of values, as in `morai_msgs/GPSMessage`
    IMU_NAME.csv    readings of the inertial unit: the same, as in `sensor_msgs/Imu`
    BOXES_NAME.txt  bounding boxes of other objects, the nearest first: a line each, in MORAI's order
    CAMERA_SENSOR_NAME.jpeg  colours of a camera
    LIDAR_SENSOR_NAME.bin    points of a 3D lidar: x, y, z [m] and intensity as little-endian float32

Files of a further ego are in its own folder, `Ego-2/`. Values in CSV files are exact; boxes have four decimals.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol

import numpy as np

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import time_text
from rosbridge_sim.morai.messages.object_lists import UniqueId
from rosbridge_sim.world.state.world import Kind, World
from rosbridge_sim.world.vehicle.sensor_readings import Boxes

_CLASSES: Final = {Kind.EGO: 0, Kind.VEHICLE: 0, Kind.PEDESTRIAN: 1, Kind.OBSTACLE: 2}


class SensorDataStore(Protocol):
    """Store for captures; the shell writes them to the disk."""

    def save(self, folder: str, name: str, files: Mapping[str, bytes], source: str) -> None:
        """Write the files of one capture: all of them, or none.

        Args:
            folder: as a client names it; empty for the default one.
            name: of the capture, from a client or from us. If the name is used already, `NAME_2` and so on is taken.
            files: contents by names; `{}` in a name stands for the capture's name.
            source: the topic or service that asked for it, for the log.

        Raises:
            DocumentError: one line for the client: the folder is not allowed, the name is not valid, the quota is used
                up, or
                the disk reports an error.
        """


def gps_text(frame: int, message: Struct) -> bytes:
    """Return GPS_*.csv of a GPSMessage.

    Args:
        frame: the message's frame; its simulated time [s] is the column `time`.

    Returns:
        UTF-8 text of two lines.
    """
    names = ("latitude", "longitude", "altitude", "eastOffset", "northOffset", "status")
    return _csv(frame, {name: getattr(message, name) for name in names})


def imu_text(frame: int, message: Struct) -> bytes:
    """Return IMU_*.csv of a sensor_msgs/Imu.

    Args:
        frame: the message's frame; its simulated time [s] is the column `time`.

    Returns:
        UTF-8 text of two lines.
    """
    parts = ("orientation", "xyzw"), ("angular_velocity", "xyz"), ("linear_acceleration", "xyz")
    figures = {f"{part}_{axis}": getattr(getattr(message, part), axis) for part, axes in parts for axis in axes}
    return _csv(frame, figures)


def boxes_text(world: World, boxes: Boxes, unique_id: UniqueId) -> bytes:
    """Return BOXES_*.txt: eleven values a line, with a blank between them, and no line of names.

    The values are: class (0 vehicle, 1 pedestrian, 2 object); x, y, z of the box's middle in the frame of the ego, that
    is
    forward, left and up of the middle of its rear axle on the ground [m]; length, width, height [m]; heading relative
    to
    the ego's, counter-clockwise within (-180, 180] [deg]; distance of the middle from the ego's rear axle [m]; speed
    along
    the heading [m/s]; unique_id.

    Args:
        world: read only.
        boxes: the boxes, the nearest first.
        unique_id: returns the id on the wire of the entity in a row of the world.

    Returns:
        UTF-8 text with a line for each box.
    """
    figures = np.column_stack(
        [
            *(boxes.x, boxes.y, boxes.z, boxes.length, boxes.width, boxes.height),
            *(np.degrees(boxes.yaw), boxes.distance, boxes.speed),
        ]
    ).tolist()
    lines = [
        f"{_CLASSES[Kind(world.kind.item(row))]} {' '.join(f'{figure:.4f}' for figure in line)} {unique_id(row)}\n"
        for row, line in zip(boxes.rows.tolist(), figures, strict=True)
    ]
    return "".join(lines).encode()


def _csv(frame: int, figures: Mapping[str, float]) -> bytes:
    names = ",".join(["frame", "time", *figures])
    values = ",".join([str(frame), time_text(frame), *map(repr, figures.values())])
    return f"{names}\n{values}\n".encode()
