"""Fisheye cameras: the place in the picture grows with the angle from the optical axis."""

from __future__ import annotations

from typing import Annotated, ClassVar

from rosbridge_sim.documents.document_model import number_within
from rosbridge_sim.errors import FieldError
from rosbridge_sim.scenery.camera_geometry import MAX_FISHEYE_FOV, FisheyeModel
from rosbridge_sim.simulator.sensors.picture_sensor import Coefficient, PictureSpec
from rosbridge_sim.simulator.sensors.sensor_specs import FrameId, TopicName

_WideFov = Annotated[float, number_within(1.0, MAX_FISHEYE_FOV)]


class FisheyeSpec(PictureSpec, frozen=True, kw_only=True):
    """A camera with a fisheye lens: equidistant projection, with the distortion of `cv2.fisheye`.

    It sees up to 90 deg from its axis, or half of `fov` if that is more; what lies beyond is black. Its depth is the
    distance from the camera [m].

    Attributes, beside those of `PictureSpec`:
        fov: horizontal field of view without distortion [deg]; the focal length is width / fov, with fov in radians.
        distortion: k1, k2, k3, k4 of the polynomial of Kannala and Brandt.
    """

    kind: ClassVar[str] = "fisheye"
    lens: ClassVar[str] = "equidistant"
    jpeg_topic: ClassVar[str] = "/fisheye/image_jpeg/compressed"
    frame_id: FrameId = "Fisheye"
    topic: TopicName = jpeg_topic
    fov: _WideFov = 180.0
    distortion: tuple[Coefficient, Coefficient, Coefficient, Coefficient] = (0.0, 0.0, 0.0, 0.0)

    @property
    def model(self) -> FisheyeModel:
        """Geometry of the camera."""
        return FisheyeModel(self.width, self.height, self.fov, self.distortion)

    def check(self) -> None:
        """Check that each place in the picture shows one direction; see `SensorSpec.check`."""
        if not self.model.is_one_to_one:
            raise FieldError(
                f"{self.frame_id}.distortion: expected coefficients with which the distance from the middle of the"
                f" picture grows with the angle, up to {self.model.reach_deg:g} deg; got {list(self.distortion)}"
            )
