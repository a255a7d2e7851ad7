"""MORAI's own presets of sensors: `SaveFile/Sensor/<release>/<name>.json`.

Places and angles are texts there, in metres and degrees from the middle of the rear axle. Angles are 0 to 360: a pitch
of 355 looks 5 deg up. `cameraFOV` is the horizontal field of view: in saved files `focalLengthpixel` is
width / (2 tan(cameraFOV / 2)). The size of the picture is twice the principal point, which is its exact middle.

What this simulator does not serve becomes a remark, and the rest of the file is used.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Any, Final

from msgspec import Meta

from rosbridge_sim.document_reading import read_document
from rosbridge_sim.documents import Document, DocumentType, KeptAsWritten, Number, Whole
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.sensors.sensor_presets import MAX_SENSORS_BYTES, read_rig
from rosbridge_sim.simulator.sensors.sensor_specs import FRAME_RATE, Rig
from rosbridge_sim.simulator.sensors.sensor_table import MAX_SENSORS

__all__ = ["is_morai_file", "read_morai_sensors"]

_UDP: Final = 1
"""`commType` of native packets over UDP."""

_PICTURES: Final = {0: "rgb"}
"""`cameraType` -> picture; only 0 was found in saved files."""

_LIDARS: Final = {0: "VLP-16"}
"""`lidar3DType` -> model; 0 is a VLP-16 in a saved file."""

_TOPIC: Final = re.compile(r"/?[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*)*")

_Items = Annotated[tuple["_Item", ...], Meta(max_length=4 * MAX_SENSORS)]


class _Vector(Document, frozen=True, kw_only=True):
    x: Number = 0.0
    y: Number = 0.0
    z: Number = 0.0


class _Angles(Document, frozen=True, kw_only=True):
    roll: Number = 0.0
    pitch: Number = 0.0
    yaw: Number = 0.0


class _Ros(Document, frozen=True, kw_only=True):
    Topic: str = ""
    frameID: str = ""  # noqa: N815 - MORAI's name


class _Block(Document, frozen=True, kw_only=True):
    """Values that only some kinds have; keys of other kinds are absent."""

    sensorPeriod: Number | None = None  # noqa: N815 - MORAI's names, here and below
    commType: Whole = 3  # noqa: N815
    rosConfig: _Ros = _Ros()  # noqa: N815
    cameraFOV: Number = 90.0  # noqa: N815
    cameraType: Whole = 0  # noqa: N815
    compressedRatio: Number = 90.0  # noqa: N815
    focalLengthpixel: Number | None = None  # noqa: N815
    principalPoint: KeptAsWritten = None  # noqa: N815
    lidar3DType: Whole = 0  # noqa: N815
    fireDistance: Number = 100.0  # noqa: N815


class _Item(Document, frozen=True, kw_only=True):
    m_TargetUniqueID: Whole = 0  # noqa: N815
    m_SensorUniqueID: Whole = 0  # noqa: N815
    pos: _Vector = _Vector()
    rot: _Angles = _Angles()
    cc: _Block | None = None
    lc: _Block | None = None
    rc: _Block | None = None
    gc: _Block | None = None
    ic: _Block | None = None

    @property
    def block(self) -> _Block:
        """The block of its kind."""
        return self.cc or self.lc or self.rc or self.gc or self.ic or _Block()


class _File(Document, frozen=True, kw_only=True):
    cameraList: _Items = ()  # noqa: N815
    Lidar3DList: _Items = ()
    Lidar2DList: _Items = ()
    RadarList: _Items = ()
    DelphiRadarList: _Items = ()
    UltrasonicList: _Items = ()
    GPSList: _Items = ()
    IMUList: _Items = ()


_DOCUMENT: Final = DocumentType[_File](_File)
_LISTS: Final = ("cameraList", "Lidar3DList", "Lidar2DList", "GPSList", "IMUList", "RadarList", "UltrasonicList")


def is_morai_file(document: object) -> bool:
    """Return whether a JSON document is a preset of MORAI: it has one of its lists."""
    return isinstance(document, dict) and any(name in document for name in _LISTS)


def read_morai_sensors(text: bytes, source: str) -> tuple[Rig, list[str]]:
    """Read a preset of MORAI.

    Args:
        text: JSON.
        source: its name, for errors.

    Returns:
        The rig, and a remark for each thing that is not as the file has it, one line each.

    Raises:
        DocumentError: one line with the place and the mistake.
    """
    file = read_document(_DOCUMENT, text, source, MAX_SENSORS_BYTES)
    reading = _Reading()
    lists: dict[str, Any] = {
        "camera": [reading.camera(item) for item in reading.of_ego("camera", file.cameraList)],
        "lidar3d": [reading.lidar(item) for item in reading.of_ego("3D lidar", file.Lidar3DList)],
        "lidar2d": [
            reading.common(item, "/lidar2D", "lidar2D") for item in reading.of_ego("2D lidar", file.Lidar2DList)
        ],
        "radar": [
            reading.common(item, "/radar", "radar")
            for item in reading.of_ego("radar", (*file.RadarList, *file.DelphiRadarList))
        ],
    }
    if file.UltrasonicList:
        reading.remarks.append(f"ultrasonic sensors are not simulated: {len(file.UltrasonicList)} left out")
    places = {"gps": reading.place("GPS", "/gps", file.GPSList), "imu": reading.place("IMU", "/imu", file.IMUList)}
    document = {kind: each for kind, each in {**places, **lists}.items() if each}
    if not document:
        raise DocumentError(f"{source}: expected sensors, got none")
    return read_rig(document, source), reading.remarks


class _Reading:
    """Reading of one file.

    Attributes:
        remarks: what is not as the file has it.
    """

    def __init__(self) -> None:
        self.remarks: list[str] = []
        self._frames: Counter[str] = Counter()
        self._target: int | None = None

    def of_ego(self, noun: str, items: tuple[_Item, ...]) -> Iterator[_Item]:
        """Yield the sensors of the ego that the first sensor of the file belongs to; every ego gets them."""
        for item in items:
            if self._target is None:
                self._target = item.m_TargetUniqueID
            if item.m_TargetUniqueID == self._target:
                yield item
            else:
                self.remarks.append(
                    f"{noun} {item.m_SensorUniqueID} left out: it belongs to vehicle {item.m_TargetUniqueID},"
                    f" and the others to {self._target}; every ego has the same sensors"
                )

    def place(self, noun: str, topic: str, items: tuple[_Item, ...]) -> dict[str, Any]:
        """Return the place of the GPS or of the IMU; empty if the file has none."""
        found = list(self.of_ego(noun, items))
        if not found:
            return {}
        if len(found) > 1:
            self.remarks.append(f"an ego has one {noun}: {len(found) - 1} left out")
        block = found[0].block
        if block.sensorPeriod is not None and block.sensorPeriod > 0.0:
            flag = f"--rate {topic}={1.0 / block.sensorPeriod:.3g}"
            self.remarks.append(f"the rate of the {noun} is that of the settings: {flag}")
        return _place_of(found[0])

    def camera(self, item: _Item) -> dict[str, Any]:
        """Return the table of a camera."""
        block, found = item.block, self.common(item, "/image_jpeg/compressed", "Camera")
        if block.cameraType not in _PICTURES:
            self.remarks.append(f"{found['frame_id']}: cameraType {block.cameraType} is not known; it sees colours")
        width, height = self._size(block, found["frame_id"])
        quality = min(100, max(1, round(block.compressedRatio)))
        return {**found, "width": width, "height": height, "fov": block.cameraFOV, "quality": quality}

    def _size(self, block: _Block, name: str) -> tuple[int, int]:
        middle = _pair(block.principalPoint)
        if middle is not None:
            return round(2.0 * middle[0]), round(2.0 * middle[1])
        if block.focalLengthpixel is not None and 0.0 < block.cameraFOV < 180.0:  # noqa: PLR2004 - degrees
            width = round(2.0 * block.focalLengthpixel * math.tan(math.radians(0.5 * block.cameraFOV)))
            self.remarks.append(f"{name}: no principalPoint: the picture is {width} x {round(0.75 * width)}")
            return width, round(0.75 * width)
        self.remarks.append(f"{name}: no principalPoint: the picture is 640 x 480")
        return 640, 480

    def lidar(self, item: _Item) -> dict[str, Any]:
        """Return the table of a 3D lidar."""
        block, found = item.block, self.common(item, "/lidar3D", "velodyne")
        model = _LIDARS.get(block.lidar3DType)
        if model is None:
            self.remarks.append(
                f"{found['frame_id']}: which product lidar3DType {block.lidar3DType} is, is not known; it is a VLP-16"
            )
        return {**found, "model": model or "VLP-16", "max_range": block.fireDistance}

    def common(self, item: _Item, topic: str, frame: str) -> dict[str, Any]:
        """Return what the tables of all kinds have."""
        block = item.block
        frame = re.sub(r"[^A-Za-z0-9_.-]", "_", block.rosConfig.frameID.strip("/ ")) or frame
        self._frames[frame] += 1
        if self._frames[frame] > 1:
            self.remarks.append(f"frame {frame} stands there twice: the second one is {frame}-{self._frames[frame]}")
            frame = f"{frame}-{self._frames[frame]}"
        named = block.rosConfig.Topic.strip()
        if block.commType == _UDP:
            self.remarks.append(f"{frame}: its packets over UDP are not served; it publishes {topic}")
        elif _TOPIC.fullmatch(named):
            topic = "/" + named.lstrip("/")
        elif named:
            self.remarks.append(f"{frame}: {named[:80]!r} is not the name of a topic; it publishes {topic}")
        table: dict[str, Any] = {
            "frame_id": frame,
            "topic": topic,
            **_place_of(item),
        }
        if block.sensorPeriod is not None and block.sensorPeriod > 0.0:
            rate = 1.0 / block.sensorPeriod
            table["rate"] = min(FRAME_RATE, float(round(rate)) if abs(rate - round(rate)) < 0.05 else rate)  # noqa: PLR2004 - 0.0333 s is 30 Hz
            if rate > FRAME_RATE + 0.05:
                self.remarks.append(f"{frame}: {rate:g} Hz is more than a world of 50 frames a second has; it is 50 Hz")
        return table


def _place_of(item: _Item) -> dict[str, float]:
    """Return place and angles as our files have them."""
    return {
        **{axis: getattr(item.pos, axis) for axis in "xyz"},
        **{angle: _signed(getattr(item.rot, angle)) for angle in ("roll", "pitch", "yaw")},
    }


def _signed(degrees: float) -> float:
    """Return an angle within [-180, 180)."""
    return (degrees + 180.0) % 360.0 - 180.0


def _pair(value: object) -> tuple[float, float] | None:
    """Return two positive numbers, in any of the forms in which MORAI writes a pair; None if there are none."""
    if isinstance(value, dict):
        value = [value.get("x"), value.get("y")]
    if isinstance(value, str):
        value = value.split(",")
    if not isinstance(value, list) or len(value) != 2:  # noqa: PLR2004 - a pair
        return None
    try:
        x, y = (float(one) for one in value)
    except (TypeError, ValueError):
        return None
    return (x, y) if 0.0 < x < math.inf and 0.0 < y < math.inf else None
