"""Rigs of sensors that the user chooses: presets by name, and a file of ours.

A file of ours is a table with a list for each kind of sensor (`[[camera]]`, `[[lidar3d]]`, ...), and a table each for
the places of `[gps]` and `[imu]`. The sensors are numbered in the order of the kinds in `sensor_table`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta

from rosbridge_sim.documents.document_model import DocumentType, Table
from rosbridge_sim.documents.document_reading import learn_mistakes, parse_json, read_values
from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.fisheye_camera import FisheyeSpec
from rosbridge_sim.simulator.sensors.lidar_2d import Lidar2dSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.radar import RadarSpec
from rosbridge_sim.simulator.sensors.sensor_specs import Rig, SensorSpec
from rosbridge_sim.simulator.sensors.sensor_table import KINDS, MAX_SENSORS, check_rig

MAX_SENSORS_BYTES: Final = 1 << 20
"""Longest file [bytes]; MORAI writes about 2 kB for a sensor."""

_CAMERA: Final = CameraSpec(x=1.8, z=2.0, pitch=7.0)
"""640 x 480, 90 deg, at the place of the camera of MORAI-EDU's lane programs (sensor_params.json): (1.8, 0, 2.0), 7 deg
down. Most public programs take 90 deg as horizontal; those lane programs see more, see `_LANE_CAMERA`."""

_LIDAR: Final = Lidar3dSpec(x=2.0, z=1.28)
"""Lidar of MORAI-EDU's programs: (2, 0, 1.25), level (ex_calib_velodyne.py), and 3 cm higher: some of them keep what is
above -1.25 m, others what is above -1.3 m, and mean all but the road, or the road as well."""

_LANE_CAMERA: Final = CameraSpec(x=1.8, z=2.0, pitch=7.0, fov=math.degrees(2.0 * math.atan(640 / 480)))
"""Camera of MORAI-EDU's lane programs: their 90 deg (`ENGINE: UNITY`) are vertical, so the focal length is 240 pixels
(lane_fitting.py), and the picture is 106.26 deg wide."""

_CALIBRATION: Final = (CameraSpec(x=1.8, z=2.0), Lidar3dSpec(x=2.0, z=1.25))
"""Camera and lidar of MORAI-EDU's example of calibration (ex_calib_velodyne.py): both level, 90 deg horizontal."""

MAX_PARTS: Final = 5_000
"""Objects, lists and values in the JSON of sensors; 32 sensors with all their keys have 1,100. Each takes 1 to 5 us."""

PRESETS: Final[Mapping[str, Rig]] = {
    "none": (),
    "camera": (_CAMERA,),
    "lidar": (_LIDAR,),
    "teaching": (_CAMERA, _LIDAR),
    "lane-detection": (_LANE_CAMERA,),
    "calibration": _CALIBRATION,
    "fisheye": (FisheyeSpec(x=3.8, z=0.7, pitch=10.0),),
    "all": (
        _CAMERA,
        CameraSpec(frame_id="Camera-depth", picture="depth", topic="/image", x=1.8, z=2.0, pitch=7.0),
        _LIDAR,
        Lidar2dSpec(x=3.8, z=0.5),
        RadarSpec(x=3.8, z=0.5),
    ),
}
"""Rigs by name. The fisheye, and the level lidar and the radar of `all`, are at the front bumper of a usual car."""


_MANY: Final = Meta(max_length=MAX_SENSORS)
SensorList: Final[Any] = msgspec.defstruct(
    "SensorList",
    [
        (kind.kind, *((kind | None, None) if kind.is_on_each_ego else (Annotated[tuple[kind, ...], _MANY], ())))  # type: ignore[valid-type] # of the table
        for kind in KINDS
    ],
    bases=(Table,),
    namespace={"__doc__": "The sensors of an ego, by kind."},
    module=__name__,
    frozen=True,
    kw_only=True,
)

SENSOR_FILE: Final = DocumentType[Any](SensorList)


def read_rig(document: Mapping[str, Any], source: str, *, is_quick: bool = False) -> Rig:
    """Read a file of ours.

    Args:
        source: its name, for errors.
        is_quick: see `read_values`; `learn_rig_mistakes` is what to call then.

    Raises:
        DocumentError: one line with the place, what was expected, and what came; or an ego cannot have these sensors
            together.
        MistakeNotReadyError: see `is_quick`.
    """
    sensors = read_values(SENSOR_FILE, document, source, is_quick=is_quick)
    rig: list[SensorSpec] = []
    for kind in KINDS:
        found = getattr(sensors, kind.kind)
        rig += found if isinstance(found, tuple) else () if found is None else (found,)
    try:
        check_rig(rig)
    except FieldError as error:
        raise DocumentError(f"{source}: {error}") from None
    return tuple(rig)


def document_of(spec: SensorSpec, **changes: object) -> dict[str, Any]:
    """Return a file of ours with one sensor."""
    values = msgspec.to_builtins(spec) | changes
    return {spec.kind: values if spec.is_on_each_ego else [values]}


def text_of(spec: SensorSpec) -> str:
    """Return a file of ours with one sensor, as JSON."""
    return json.dumps(document_of(spec))


def read_rig_text(text: str, where: str, *, is_quick: bool = False) -> Rig:
    """Read the JSON of a file of ours.

    Args:
        text: JSON.
        where: its name, for errors.
        is_quick: see `read_rig`.

    Raises:
        DocumentError: it is no such text.
        MistakeNotReadyError: see `is_quick`.
    """
    return read_rig(parse_object(text, where), where, is_quick=is_quick)


def learn_rig_mistakes() -> None:
    """Make what words the mistakes of these files; see `learn_mistakes`."""
    learn_mistakes(SENSOR_FILE)


def parse_object(text: str, where: str) -> dict[str, Any]:
    """Return a JSON object.

    Args:
        text: JSON.
        where: its name, for errors.

    Raises:
        DocumentError: it is none.
    """
    num = sum(map(text.count, "[{,"))
    if num > MAX_PARTS:
        raise DocumentError(f"{where}: expected at most {MAX_PARTS:,} objects, lists and values, got {num:,}")
    values = parse_json(text.encode(), where, MAX_SENSORS_BYTES)
    if not isinstance(values, dict):
        raise DocumentError(f"{where}: expected a JSON object, got {text[:40]!r}")
    return values
