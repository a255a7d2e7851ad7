"""Cameras whose lens keeps straight lines, or bends them as the plumb bob model has it."""

from __future__ import annotations

from typing import ClassVar

from rosbridge_sim.scenery.camera_geometry import CameraModel
from rosbridge_sim.simulator.sensors.picture_sensor import Coefficient, PictureSpec
from rosbridge_sim.simulator.sensors.sensor_specs import FrameId, TopicName

__all__ = ["CameraSpec"]


class CameraSpec(PictureSpec, frozen=True, kw_only=True):
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
    lens: ClassVar[str] = "plumb_bob"
    jpeg_topic: ClassVar[str] = "/image_jpeg/compressed"
    frame_id: FrameId = "Camera"
    topic: TopicName = jpeg_topic
    distortion: tuple[Coefficient, Coefficient, Coefficient, Coefficient, Coefficient] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def model(self) -> CameraModel:
        """Geometry of the camera."""
        return CameraModel(self.width, self.height, self.fov, self.distortion)
