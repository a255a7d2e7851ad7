"""Cameras: their options, topics and cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal

import msgspec
from msgspec import Meta

from rosbridge_sim.documents import number_spelling
from rosbridge_sim.simulator.sensors.sensor_specs import Fov, FrameId, MountedSpec, Rate, TopicName

__all__ = ["BOXES", "DETECTIONS_2D", "DETECTIONS_3D", "PIXEL_BYTES", "CameraSpec"]

MAX_SIDE: Final = 8192
"""Longest side of a picture [pixels]: the least of what OpenGL 4.1 promises is 16,384, with room for antialiasing."""

PIXEL_BYTES: Final = {"rgb": 3, "depth": 4, "semantic": 1, "instance": 2}
"""Picture -> bytes of a pixel of an Image."""

BOXES: Final = "rosbridge_sim_msgs/BoundingBoxes"
"""Type of the boxes of what a camera shows."""

DETECTIONS_2D, DETECTIONS_3D = "vision_msgs/Detection2DArray", "vision_msgs/Detection3DArray"
"""Types of the same boxes for programs of others."""

_Side = Annotated[int, number_spelling(1, MAX_SIDE, "integer"), Meta(ge=1, le=MAX_SIDE)]
_Quality = Annotated[int, number_spelling(1, 100, "integer"), Meta(ge=1, le=100)]
_Coefficient = Annotated[float, number_spelling(-1.0, 1.0), Meta(ge=-1.0, le=1.0)]

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
    is_drawn: ClassVar[bool] = True
    is_picture: ClassVar[bool] = True
    frame_id: FrameId = "Camera"
    topic: TopicName = _NO_TOPIC
    rate: Rate = 30.0
    width: _Side = 640
    height: _Side = 480
    fov: Fov = 90.0
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

    @property
    def topics(self) -> list[tuple[str, str]]:
        """The picture, its CameraInfo, its boxes, and these as vision_msgs if they are chosen."""
        kind = "sensor_msgs/CompressedImage" if self.is_jpeg else "sensor_msgs/Image"
        beside = [("camera_info", "sensor_msgs/CameraInfo"), ("boxes", BOXES)]
        if self.detections:
            beside += [("detections_2d", DETECTIONS_2D), ("detections_3d", DETECTIONS_3D)]
        return [(self.topic, kind), *((f"{self.base_topic}/{name}", type_name) for name, type_name in beside)]

    @property
    def raw_bytes(self) -> int:
        """Bytes of a raw picture; 0 for a JPEG."""
        return 0 if self.is_jpeg else self.num_pixels * PIXEL_BYTES[self.picture]


_CAMERA_TOPICS: Final[Mapping[tuple[str, str], str]] = {
    ("rgb", "jpeg"): "/image_jpeg/compressed",
    ("rgb", "raw"): "/image_raw",
    ("depth", "raw"): "/image",
    ("semantic", "raw"): "/image_semantic",
    ("instance", "raw"): "/image_instance",
}
"""Picture and encoding -> default topic. `/image` is that of MORAI's depth camera; the last three are ours."""
