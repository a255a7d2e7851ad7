"""What of the sensors is saved into files, and how each file is written.

A capture is a set of texts of one frame under one name:

    GPS_NAME.csv    where the antenna is: a line of names, a line of figures, as in `morai_msgs/GPSMessage`
    IMU_NAME.csv    what the inertial unit reads: the same, as in `sensor_msgs/Imu`
    BOXES_NAME.txt  the boxes around others, the nearest first: a line each, in the order that MORAI has

of a further ego in a folder of its own, `Ego-2/`. Figures of CSV files are exact, those of boxes have four decimals.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol

import numpy as np

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.convert import UniqueId, time_text
from rosbridge_sim.world.sensors import Boxes
from rosbridge_sim.world.state import Kind, World

__all__ = ["SensorDataStore", "boxes_text", "gps_text", "imu_text"]

_CLASSES: Final = {Kind.EGO: 0, Kind.VEHICLE: 0, Kind.PEDESTRIAN: 1, Kind.OBSTACLE: 2}


class SensorDataStore(Protocol):
    """Where captures go; the shell writes them to the disk."""

    def save(self, folder: str, name: str, files: Mapping[str, bytes], source: str) -> None:
        """Write the files of one capture: all of them, or none.

        Args:
            folder: as a client names it; empty for the usual one.
            name: of the capture, as a client or we have it. Where it is taken, `NAME_2` and so on serves.
            files: contents by names in which `{}` stands for the capture's.
            source: the topic or service that asked for it, for the log.

        Raises:
            DocumentError: one line for the client: the folder is out of bounds, the name is none, the quota is used up,
                or the disk says no.
        """


def gps_text(frame: int, message: Struct) -> bytes:
    """GPS_*.csv of a GPSMessage; `time` is simulated [s]."""
    names = ("latitude", "longitude", "altitude", "eastOffset", "northOffset", "status")
    return _csv(frame, {name: getattr(message, name) for name in names})


def imu_text(frame: int, message: Struct) -> bytes:
    """IMU_*.csv of a sensor_msgs/Imu; `time` is simulated [s]."""
    parts = ("orientation", "xyzw"), ("angular_velocity", "xyz"), ("linear_acceleration", "xyz")
    figures = {f"{part}_{axis}": getattr(getattr(message, part), axis) for part, axes in parts for axis in axes}
    return _csv(frame, figures)


def boxes_text(world: World, boxes: Boxes, unique_id: UniqueId) -> bytes:
    """BOXES_*.txt: eleven figures a line, with a blank between them, and no line of names.

    Class (0 vehicle, 1 pedestrian, 2 object); x, y, z of the middle in the frame of the ego, that is forward, left and
    up of the middle of its rear axle on the ground [m]; length, width, height [m]; heading against the ego's,
    counter-clockwise within (-180, 180] [deg]; distance of the middle from the ego's rear axle [m]; speed along the
    heading [m/s]; unique_id.
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
