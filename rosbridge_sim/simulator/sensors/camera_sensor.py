"""Cameras whose lens keeps straight lines, or bends them as the plumb bob model has it."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Final

from rosbridge_sim.scenery.camera_geometry import CameraModel
from rosbridge_sim.simulator.sensors.morai_items import Item, Reading
from rosbridge_sim.simulator.sensors.picture_sensor import Coefficient, PictureSpec
from rosbridge_sim.simulator.sensors.sensor_specs import FrameId, TopicName

_COLOURS: Final = 0
"""`cameraType` of colours; no other one was found in files that MORAI has saved."""


class CameraSpec(PictureSpec, frozen=True, kw_only=True):
    """A camera with a plumb bob lens; its depth is the distance along the optical axis [m].

    Attributes, beside those of `PictureSpec`:
        distortion: k1, k2, p1, p2, k3 of the plumb bob model; all 0 for a pinhole.
    """

    kind: ClassVar[str] = "camera"
    morai_noun: ClassVar[str] = "camera"
    morai_lists: ClassVar[tuple[str, ...]] = ("cameraList",)
    lens: ClassVar[str] = "plumb_bob"
    jpeg_topic: ClassVar[str] = "/image_jpeg/compressed"
    frame_id: FrameId = "Camera"
    topic: TopicName = jpeg_topic
    distortion: tuple[Coefficient, Coefficient, Coefficient, Coefficient, Coefficient] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def model(self) -> CameraModel:
        """Geometry of the camera."""
        return CameraModel(self.width, self.height, self.fov, self.distortion)

    def of_morai(self, item: Item, reading: Reading) -> dict[str, Any]:
        """Return the keys of a camera in a file of MORAI; see `SensorSpec.of_morai`."""
        block, found = item.block, super().of_morai(item, reading)
        name, fov = found["frame_id"], block.cameraFOV
        if block.cameraType != _COLOURS:
            reading.remarks.append(f"{name}: cameraType {block.cameraType} is not known; it sees colours")
        width, height = (round(2.0 * side) for side in _pair(block.principalPoint) or (0.0, 0.0))
        if not width:
            width = 640
            if block.focalLengthpixel is not None and 0.0 < fov < 180.0:  # noqa: PLR2004 - degrees
                width = round(2.0 * block.focalLengthpixel * math.tan(math.radians(0.5 * fov)))
            height = round(0.75 * width)
            reading.remarks.append(f"{name}: no principalPoint: the picture is {width} x {height}")
        quality = min(100, max(1, round(block.compressedRatio)))
        return {**found, "width": width, "height": height, "fov": fov, "quality": quality}


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
