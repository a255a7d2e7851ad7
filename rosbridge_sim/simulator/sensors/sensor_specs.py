"""Specifications of sensors: what a user chooses of each, with bounds.

A *rig* is the sensors of one ego. Each ego has one GPS and one IMU. Places are in the frame of the vehicle: x forward,
y left of the middle of the rear axle, z up from the ground below it [m]. Angles in specifications are degrees, because
files and MORAI's panels have degrees: roll, pitch (positive is down), yaw (positive is left).

The `frame_id` is the name of a sensor: of its frame in `/tf_static`, in the headers of its messages, and for commands.
Several cameras may publish on one topic; their messages differ in the `frame_id`.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

import msgspec
from msgspec import Meta

from rosbridge_sim.documents import Document, Spelling, number_spelling
from rosbridge_sim.errors import FieldError
from rosbridge_sim.scenery.lidar_models import LIDAR_MODELS
from rosbridge_sim.simulator.bus.network_settings import USUAL_RATE
from rosbridge_sim.simulator.kernel.tf_publisher import BASE, CENTER, MAP
from rosbridge_sim.simulator.sensors.gps import Gps
from rosbridge_sim.simulator.sensors.imu import Imu
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

__all__ = [
    "BOXES",
    "DETECTIONS_2D",
    "DETECTIONS_3D",
    "FRAME_RATE",
    "LIDAR_NAMES",
    "MAX_LEVER",
    "MAX_RAW_BYTES",
    "MAX_SENSORS",
    "PIXEL_BYTES",
    "CameraSpec",
    "FrameSpec",
    "GpsSpec",
    "ImuSpec",
    "Lidar2dSpec",
    "Lidar3dSpec",
    "RadarSpec",
    "Rig",
    "SensorSpec",
    "check_rig",
    "complete",
    "frames_of",
    "is_due",
    "num_due",
    "raw_bytes_of",
    "topics_of",
]

MAX_SENSORS: Final = 32
"""Cameras, lidars and radars of one ego; more than any test vehicle has."""

MAX_SIDE: Final = 8192
"""Longest side of a picture [pixels]: the least of what OpenGL 4.1 promises is 16,384, with room for antialiasing."""

MAX_PIXELS: Final = 8_294_400
"""Pixels of all cameras of one ego together: one picture of 3840 x 2160, or 27 of 640 x 480."""

MAX_RAW_BYTES: Final = 12_000_000
"""Bytes of all raw pictures and points of one ego, where all of them have the same frame, and of those of all egos that
are published in one turn of the server's loop. As JSON they take 2.7 ns a byte (measured), and no client may have to
wait for longer than 50 ms."""

MAX_FOV: Final = 170.0
"""Largest horizontal field of view [deg]: a plane picture of 180 has no width."""

MAX_RAYS: Final = 500_000
"""Rays of a turn of all lidars of one ego together; the largest lidars on the market have 262,144 (128 x 2048)."""

MAX_SCAN: Final = 4_096
"""Ranges of a LaserScan: they are numbers of a text in JSON, 0.1 us each."""

MAX_RINGS: Final = 256
"""Rings of one lidar."""

MAX_RANGE: Final = 1000.0
"""Longest range of a sensor [m]."""

MAX_LEVER: Final = 100.0
"""Largest distance of a sensor from its vehicle's rear axle along each axis [m]; longer than any road train."""

FRAME_RATE: Final = 50.0
"""Frames in a second of simulated time, and so the highest rate [Hz]."""

MIN_RATE: Final = 0.1
"""Lowest rate [Hz]."""

MAX_NAME: Final = 100
"""Longest frame and topic [characters]: the prefix of a further ego is added, and the bus takes 256."""

PIXEL_BYTES: Final = {"rgb": 3, "depth": 4, "semantic": 1, "instance": 2}
"""Picture -> bytes of a pixel of an Image."""

POINT_BYTES: Final = 22
"""Bytes of a point of a PointCloud2."""

LIDAR_NAMES: Final = ("/lidar3D", "/velodyne_points")
"""Two names for the messages of a 3D lidar: MORAI's own, and that of the velodyne driver, which most programs use."""

BOXES: Final = "rosbridge_sim_msgs/BoundingBoxes"
"""Type of the boxes of what a camera shows."""

DETECTIONS_2D, DETECTIONS_3D = "vision_msgs/Detection2DArray", "vision_msgs/Detection3DArray"
"""Types of the same boxes for programs of others."""

_FRAME_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_TOPIC: Final = re.compile(r"(?:/[A-Za-z][A-Za-z0-9_]*)+")
_TAKEN_FRAMES: Final = frozenset({MAP, BASE, CENTER, Gps.frame, Imu.frame})


def _check_frame(value: str) -> None:
    if len(value) > MAX_NAME or not _FRAME_ID.fullmatch(value):
        raise ValueError("expected letters, digits, _, . and -, at most 100")
    if value in _TAKEN_FRAMES:
        raise ValueError("expected a name that no other frame of the vehicle has")


def _check_topic(value: str) -> None:
    if len(value) > MAX_NAME or not _TOPIC.fullmatch(value):
        raise ValueError("expected the name of a topic, such as /lidar3D, at most 100 characters")


_FrameId = Annotated[str, Spelling(check=_check_frame, schema={"type": "string", "pattern": f"^{_FRAME_ID.pattern}$"})]
_Topic = Annotated[str, Spelling(check=_check_topic, schema={"type": "string", "pattern": f"^{_TOPIC.pattern}$"})]
_Metres = Annotated[float, number_spelling(-MAX_LEVER, MAX_LEVER), Meta(ge=-MAX_LEVER, le=MAX_LEVER)]
_Degrees = Annotated[float, number_spelling(-360.0, 360.0), Meta(ge=-360.0, le=360.0)]
_Rate = Annotated[float, number_spelling(MIN_RATE, FRAME_RATE), Meta(ge=MIN_RATE, le=FRAME_RATE)]
_Range = Annotated[float, number_spelling(0.1, MAX_RANGE), Meta(ge=0.1, le=MAX_RANGE)]
_Near = Annotated[float, number_spelling(0.0, MAX_RANGE), Meta(ge=0.0, le=MAX_RANGE)]
_Fov = Annotated[float, number_spelling(1.0, MAX_FOV), Meta(ge=1.0, le=MAX_FOV)]
_Elevation = Annotated[float, number_spelling(-90.0, 90.0), Meta(ge=-90.0, le=90.0)]
_Side = Annotated[int, number_spelling(1, MAX_SIDE, "integer"), Meta(ge=1, le=MAX_SIDE)]
_Quality = Annotated[int, number_spelling(1, 100, "integer"), Meta(ge=1, le=100)]
_Count = Annotated[int, number_spelling(1, MAX_SCAN, "integer"), Meta(ge=1, le=MAX_SCAN)]
_Index = Annotated[int, number_spelling(0, MAX_RAYS, "integer"), Meta(ge=0, le=MAX_RAYS)]
_Echoes = Annotated[int, number_spelling(1, 1000, "integer"), Meta(ge=1, le=1000)]
_Coefficient = Annotated[float, number_spelling(-1.0, 1.0), Meta(ge=-1.0, le=1.0)]


class PlacedSpec(Document, frozen=True, kw_only=True):
    """Place of a sensor on a vehicle.

    Attributes:
        x, y, z: forward, left and up of the middle of the rear axle on the ground [m].
        roll, pitch, yaw: orientation [deg]; a positive pitch looks down, a positive yaw to the left.
    """

    kind: ClassVar[str] = ""
    x: _Metres = 0.0
    y: _Metres = 0.0
    z: _Metres = 0.0
    roll: _Degrees = 0.0
    pitch: _Degrees = 0.0
    yaw: _Degrees = 0.0

    @property
    def mounting(self) -> Mounting:
        """Place and orientation on the vehicle."""
        return Mounting(self.x, self.y, self.z, *map(math.radians, (self.roll, self.pitch, self.yaw)))


class GpsSpec(PlacedSpec, frozen=True, kw_only=True):
    """The GPS antenna; the settings of topics have its rate."""

    kind: ClassVar[str] = "gps"
    frame_id: ClassVar[str] = Gps.frame
    topic: ClassVar[str] = f"/{Gps.topic}"
    rate: ClassVar[float] = USUAL_RATE


class ImuSpec(PlacedSpec, frozen=True, kw_only=True):
    """The inertial unit; the settings of topics have its rate."""

    kind: ClassVar[str] = "imu"
    frame_id: ClassVar[str] = Imu.frame
    topic: ClassVar[str] = f"/{Imu.topic}"
    rate: ClassVar[float] = USUAL_RATE


class MountedSpec(PlacedSpec, frozen=True, kw_only=True):
    """Specification of a sensor that an ego may have several of.

    Attributes:
        frame_id: name of the sensor and of its frame.
        topic: where it publishes; a further ego's has the ego's prefix.
        rate: messages a second of simulated time [Hz].
    """

    frame_id: _FrameId
    topic: _Topic
    rate: _Rate = 10.0


_NO_TOPIC: Final = "/{}/compressed".format("image_jpeg")
"""Default topic of a camera; a topic that was given is another object, even if it is equal."""


class CameraSpec(MountedSpec, frozen=True, kw_only=True):
    """A camera with square pixels and the principal point in the middle.

    Attributes:
        width, height: of the picture [pixels].
        fov: horizontal field of view [deg].
        picture: what is seen: colours, distance along the optical axis [m], class, or instance.
        encoding: of colours: `jpeg` gives a CompressedImage, `raw` an Image. The other pictures are always an Image.
        quality: of the JPEG.
        antialiasing: colours have four samples a pixel; without it a processor that draws needs half the time.
        distortion: k1, k2, p1, p2, k3 of the plumb bob model; all 0 for a pinhole.
        detections: publish the boxes as vision_msgs, too.
    """

    kind: ClassVar[str] = "camera"
    frame_id: _FrameId = "Camera"
    topic: _Topic = _NO_TOPIC
    rate: _Rate = 30.0
    width: _Side = 640
    height: _Side = 480
    fov: _Fov = 90.0
    picture: Literal["rgb", "depth", "semantic", "instance"] = "rgb"
    encoding: Literal["jpeg", "raw"] = "jpeg"
    quality: _Quality = 90
    antialiasing: bool = True
    distortion: tuple[_Coefficient, _Coefficient, _Coefficient, _Coefficient, _Coefficient] = (0.0, 0.0, 0.0, 0.0, 0.0)
    detections: bool = False

    def __post_init__(self) -> None:
        """Give another picture than colours a topic of its own, unless it has one."""
        if self.topic is _NO_TOPIC:
            topic = _CAMERA_TOPICS.get((self.picture, self.encoding)) or _CAMERA_TOPICS[self.picture, "raw"]
            msgspec.structs.force_setattr(self, "topic", topic)

    @property
    def is_jpeg(self) -> bool:
        """True if it publishes compressed colours."""
        return self.picture == "rgb" and self.encoding == "jpeg"

    @property
    def num_pixels(self) -> int:
        """Pixels of a picture."""
        return self.width * self.height

    @property
    def base_topic(self) -> str:
        """Topic without the name of the encoding: its other topics are below it."""
        head, _, last = self.topic.rpartition("/")
        return head if head and last.startswith("compressed") else self.topic


_CAMERA_TOPICS: Final[Mapping[tuple[str, str], str]] = {
    ("rgb", "jpeg"): "/image_jpeg/compressed",
    ("rgb", "raw"): "/image_raw",
    ("depth", "raw"): "/image",
    ("semantic", "raw"): "/image_semantic",
    ("instance", "raw"): "/image_instance",
}
"""Picture and encoding -> default topic. `/image` is that of MORAI's depth camera; the last three are ours."""


class Lidar3dSpec(MountedSpec, frozen=True, kw_only=True):
    """A lidar that turns, with one beam for each ring.

    Attributes:
        model: the product, which has the angles of the rings; `own` for `elevations`.
        elevations: angles of the rings from the lowest to the highest [deg], for the model `own`.
        columns: beams of a ring in a turn; 0 for those of the model.
        min_range, max_range: nearest and farthest echo [m].
    """

    kind: ClassVar[str] = "lidar3d"
    frame_id: _FrameId = "velodyne"
    topic: _Topic = "/lidar3D"
    model: Literal["VLP-16", "HDL-32E", "OS1-64", "OS1-128", "own"] = "VLP-16"
    elevations: Annotated[tuple[_Elevation, ...], Meta(max_length=MAX_RINGS)] = ()
    columns: _Index = 0
    min_range: _Near = 0.5
    max_range: _Range = 100.0

    @property
    def num_rings(self) -> int:
        """Number of rings."""
        return len(self.elevations) if self.model == "own" else len(LIDAR_MODELS[self.model].elevations_deg)

    @property
    def num_columns(self) -> int:
        """Beams of a ring in a turn."""
        return self.columns or (1800 if self.model == "own" else LIDAR_MODELS[self.model].columns)


class Lidar2dSpec(MountedSpec, frozen=True, kw_only=True):
    """A lidar with one level ring; a message is a LaserScan of a full turn.

    Attributes:
        num_values: ranges of a turn.
        ahead: index of the range that looks ahead; the angle grows to the left with the index.
        min_range, max_range: nearest and farthest echo [m].
    """

    kind: ClassVar[str] = "lidar2d"
    frame_id: _FrameId = "lidar2D"
    topic: _Topic = "/lidar2D"
    num_values: _Count = 360
    ahead: _Index = 180
    min_range: _Near = 0.1
    max_range: _Range = 30.0


class RadarSpec(MountedSpec, frozen=True, kw_only=True):
    """A radar with a wide beam for what is near and a narrow beam for what is far.

    The defaults are our choice, of the class of a car's 77 GHz radar with two beams.

    Attributes:
        near_range, far_range: of the two beams [m].
        near_fov, far_fov: horizontal angles of the beams, left and right together [deg].
        vertical_fov: vertical angle of both [deg].
        max_echoes: largest number of echoes in a message; the nearest are kept.
    """

    kind: ClassVar[str] = "radar"
    frame_id: _FrameId = "radar"
    topic: _Topic = "/radar"
    rate: _Rate = 20.0
    near_range: _Range = 60.0
    far_range: _Range = 174.0
    near_fov: _Fov = 90.0
    far_fov: _Fov = 20.0
    vertical_fov: _Fov = 10.0
    max_echoes: _Echoes = 64


FrameSpec: TypeAlias = GpsSpec | ImuSpec
"""Sensors that each ego has one of. Their messages are published with the frame."""

SensorSpec: TypeAlias = FrameSpec | CameraSpec | Lidar3dSpec | Lidar2dSpec | RadarSpec

Rig: TypeAlias = tuple[SensorSpec, ...]
"""The sensors of an ego, in the order of their numbers; `complete` adds a GPS and an IMU that nobody has moved."""


def complete(rig: Rig) -> Rig:
    """Return a rig with GPS and IMU, which are number 0 and 1."""
    gps = next((spec for spec in rig if isinstance(spec, GpsSpec)), GpsSpec())
    imu = next((spec for spec in rig if isinstance(spec, ImuSpec)), ImuSpec())
    return gps, imu, *(spec for spec in rig if not isinstance(spec, FrameSpec))


def is_due(rate: float, frame: int) -> bool:
    """Return whether a message of a rate belongs to a frame, as for all topics of the simulator.

    At 30 Hz these are the frames 2, 4, 5, 7, 9, 10, ...: 40 or 20 ms apart.

    Args:
        rate: at most `FRAME_RATE` [Hz].
        frame: of the world.
    """
    return num_due(rate, frame, 1) > 0


def num_due(rate: float, frame: int, num_frames: int) -> int:
    """Return how many messages of a rate belong to the last frames up to one; see `is_due`."""
    up, down = _step(rate)
    return frame * up // down - (frame - num_frames) * up // down


@lru_cache(maxsize=64)
def _step(rate: float) -> tuple[int, int]:
    """Return the messages of a frame, as a fraction."""
    step = Fraction(rate).limit_denominator(10_000) / int(FRAME_RATE)
    return step.numerator, step.denominator


def topics_of(spec: SensorSpec) -> list[tuple[str, str]]:
    """Return the topics of a sensor, each with its type.

    Of a camera they are the picture, its CameraInfo, its boxes, and these as vision_msgs if they are chosen; of a lidar
    all names of its one message.
    """
    if isinstance(spec, FrameSpec):
        return [(spec.topic, Gps.type_name if isinstance(spec, GpsSpec) else Imu.type_name)]
    if isinstance(spec, CameraSpec):
        kind = "sensor_msgs/CompressedImage" if spec.is_jpeg else "sensor_msgs/Image"
        beside = [("camera_info", "sensor_msgs/CameraInfo"), ("boxes", BOXES)]
        if spec.detections:
            beside += [("detections_2d", DETECTIONS_2D), ("detections_3d", DETECTIONS_3D)]
        return [(spec.topic, kind), *((f"{spec.base_topic}/{name}", type_name) for name, type_name in beside)]
    if isinstance(spec, Lidar3dSpec):
        names = LIDAR_NAMES if spec.topic in LIDAR_NAMES else (spec.topic,)
        return [(name, "sensor_msgs/PointCloud2") for name in names]
    if isinstance(spec, Lidar2dSpec):
        return [(spec.topic, "sensor_msgs/LaserScan")]
    return [(spec.topic, "morai_msgs/RadarDetections")]


def frames_of(spec: SensorSpec) -> list[str]:
    """Return the frames of a sensor: its own, and that of a camera's picture."""
    return [spec.frame_id, f"{spec.frame_id}_optical"] if isinstance(spec, CameraSpec) else [spec.frame_id]


def check_rig(rig: Sequence[SensorSpec]) -> None:
    """Check that an ego can have these sensors together.

    Raises:
        FieldError: a limit is exceeded, or two sensors have one name, or one topic would have two types.
    """
    num = sum(not isinstance(spec, FrameSpec) for spec in rig)
    if num > MAX_SENSORS:
        raise FieldError(f"sensors: expected at most {MAX_SENSORS} for an ego, got {num}")
    cameras = [spec for spec in rig if isinstance(spec, CameraSpec)]
    num_pixels = sum(spec.num_pixels for spec in cameras)
    if num_pixels > MAX_PIXELS:
        raise FieldError(f"cameras: expected at most {MAX_PIXELS:,} pixels for all of an ego, got {num_pixels:,}")
    for spec in rig:
        _check(spec)
    num_rays = sum(map(_num_rays, rig))
    if num_rays > MAX_RAYS:
        raise FieldError(f"lidars: expected at most {MAX_RAYS:,} rays a turn for all of an ego, got {num_rays:,}")
    num_bytes = sum(map(raw_bytes_of, rig))
    if num_bytes > MAX_RAW_BYTES:
        raise FieldError(
            f"sensors: expected at most {MAX_RAW_BYTES:,} bytes of raw pictures and points in a frame of an ego,"
            f" got {num_bytes:,}"
        )
    _refuse_twice(frame for spec in rig for frame in frames_of(spec))
    types: dict[str, str] = {}
    for spec in rig:
        for name, type_name in topics_of(spec):
            other = types.setdefault(name, type_name)
            if other != type_name:
                raise FieldError(
                    f"{spec.frame_id}: topic {name}: expected {other}, as another sensor has, got {type_name}"
                )


def _check(spec: SensorSpec) -> None:
    where = spec.frame_id
    if isinstance(spec, Lidar3dSpec):
        if (spec.model == "own") != bool(spec.elevations):
            raise FieldError(f"{where}.elevations: expected angles for model 'own', and none for any other model")
        if any(high <= low for low, high in zip(spec.elevations, spec.elevations[1:], strict=False)):
            raise FieldError(f"{where}.elevations: expected angles that grow, from the lowest to the highest")
    if isinstance(spec, Lidar2dSpec) and spec.ahead >= spec.num_values:
        raise FieldError(f"{where}.ahead: expected an index below num_values = {spec.num_values}, got {spec.ahead}")
    if isinstance(spec, Lidar2dSpec | Lidar3dSpec) and spec.min_range >= spec.max_range:
        raise FieldError(
            f"{where}.min_range: expected less than max_range = {spec.max_range:g}, got {spec.min_range:g}"
        )


def _num_rays(spec: SensorSpec) -> int:
    if isinstance(spec, Lidar3dSpec):
        return spec.num_rings * spec.num_columns
    return spec.num_values if isinstance(spec, Lidar2dSpec) else 0


def raw_bytes_of(spec: SensorSpec) -> int:
    """Return the bytes of a raw picture or of all points of a turn; 0 for a sensor that has neither."""
    if isinstance(spec, CameraSpec):
        return 0 if spec.is_jpeg else spec.num_pixels * PIXEL_BYTES[spec.picture]
    return POINT_BYTES * _num_rays(spec) if isinstance(spec, Lidar3dSpec) else 0


def _refuse_twice(frames: Iterable[str]) -> None:
    for frame, num in Counter(frames).items():
        if num > 1:
            raise FieldError(f"frame_id: expected different names, got {frame} {num} times")
