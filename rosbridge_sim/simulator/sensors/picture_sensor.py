"""Base of cameras with any lens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple

import msgspec
import numpy as np

from rosbridge_sim.documents.document_model import LenientBool, number_within
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import replace
from rosbridge_sim.scenery.camera_geometry import CameraModel, mount
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.pictures import Channel, PictureChoices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.sensor_data.picture_messages import BOXES, PictureMessages
from rosbridge_sim.simulator.sensor_data.visible_boxes import VisibleBox, find_visible_boxes
from rosbridge_sim.simulator.sensor_data.vision_messages import DETECTIONS_2D, DETECTIONS_3D, VisionMessages
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, Makers, Sight, Sighting
from rosbridge_sim.simulator.sensors.drawn_errors import disturb_picture
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_specs import Cost, Fov, Rate

MAX_SIDE: Final = 8192
"""Longest side of a picture [pixels]: the least of what OpenGL 4.1 promises is 16,384, with room for antialiasing."""

_Side = Annotated[int, number_within(1, MAX_SIDE)]
_Quality = Annotated[int, number_within(1, 100)]
Coefficient = Annotated[float, number_within(-1.0, 1.0)]


class _Form(NamedTuple):
    """Form of a picture: its channel, encoding and topic.

    Attributes:
        channel: the part of a `Picture`.
        encoding: of an Image.
        num_bytes: of a pixel of an Image.
        topic: default one of an Image.
        pack: returns the bytes of an Image, little-endian.
    """

    channel: Channel
    encoding: str
    num_bytes: int
    topic: str
    pack: Callable[[Any], Any]


_FORMS: Final[Mapping[str, _Form]] = {
    "rgb": _Form(Channel.RGB, "rgb8", 3, "/image_raw", lambda shown: shown.rgb),
    "depth": _Form(Channel.DEPTH, "32FC1", 4, "/image", lambda shown: shown.depth.astype("<f4", copy=False)),
    "semantic": _Form(Channel.LABEL, "mono8", 1, "/image_semantic", lambda shown: shown.label),
    "instance": _Form(
        *(Channel.INSTANCE, "mono16", 2, "/image_instance"),
        lambda shown: np.minimum(shown.instance, np.iinfo(np.uint16).max).astype("<u2"),
    ),
}
"""Picture -> its form. `/image` is the topic of MORAI's depth camera; those with a longer name are ours."""

_JPEG_TOPIC: Final = "/image_jpeg/compressed"
"""End of the default topic of a JPEG."""

_INFO, _BOXES = 1, 2
"""Numbers of topics; the picture is 0, and detections follow the boxes."""


class Shot(Sighting, eq=False):
    """A picture.

    Attributes:
        data: JPEG, or the bytes of an Image.
        boxes: None if they were not wanted.
        file: JPEG for a file; empty if it was not wanted.
    """

    data: bytes
    boxes: list[VisibleBox] | None
    file: bytes = b""


class PictureSpec(DrawnSpec, frozen=True, kw_only=True):
    """A camera with square pixels and the principal point in the middle, with any lens.

    Attributes:
        width, height: of the picture [pixels].
        fov: horizontal field of view [deg].
        picture: what is seen: colours, distance [m], class, or instance.
        encoding: of colours: `jpeg` gives a CompressedImage, `raw` an Image. The other pictures are always an Image.
        quality: of the JPEG.
        antialiasing: colours have four samples a pixel; without it a processor that draws needs half the time.
        distortion: coefficients of the lens.
        detections: publish the boxes as vision_msgs, too.

        lens: name of the distortion model in CameraInfo.
        jpeg_topic: default topic of a JPEG; a topic that was given is another object, even if it is equal.
    """

    is_picture: ClassVar[bool] = True
    maker: ClassVar[Literal["", "pictures", "rays"]] = "pictures"
    noise_key: ClassVar[str] = "camera"
    lens: ClassVar[str]
    jpeg_topic: ClassVar[str]
    rate: Rate = 30.0
    width: _Side = 640
    height: _Side = 480
    fov: Fov = 90.0
    picture: Literal["rgb", "depth", "semantic", "instance"] = "rgb"
    encoding: Literal["jpeg", "raw"] = "jpeg"
    quality: _Quality = 90
    antialiasing: LenientBool = True
    distortion: tuple[float, ...] = ()
    detections: LenientBool = False

    def __post_init__(self) -> None:
        """Give another picture than a JPEG a topic of its own, unless it has one."""
        if self.topic is self.jpeg_topic:
            above = self.jpeg_topic.removesuffix(_JPEG_TOPIC)
            topic = above + (_JPEG_TOPIC if self.is_jpeg else _FORMS[self.picture].topic)
            msgspec.structs.force_setattr(self, "topic", topic)

    @property
    def model(self) -> CameraModel:
        """Geometry of the camera; `model_of` keeps it."""
        raise NotImplementedError

    @property
    def is_jpeg(self) -> bool:
        """True if it publishes compressed colours."""
        return self.picture == "rgb" and self.encoding == "jpeg"

    @property
    def cost(self) -> Cost:
        """Pixels, and bytes of a raw picture."""
        num = self.width * self.height
        return Cost(num, num_bytes=0 if self.is_jpeg else num * _FORMS[self.picture].num_bytes)

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
    def file_name(self) -> str:
        """Name of its file in a capture; see `SensorSpec.file_name`."""
        return f"CAMERA_{self.frame_id}_{{}}.jpeg"

    def see(self, sight: Sight, static: Mesh, job: DrawingJob, makers: Makers) -> Shot:
        """Return the picture and its boxes; see `DrawnSpec.see`."""
        camera, pose, form = model_of(self), mount(sight.motion.vehicle, sight.motion.mounting), _FORMS[self.picture]
        channels, has_boxes = form.channel, any(sight.wanted[_BOXES:])
        if has_boxes:
            channels |= Channel.INSTANCE | Channel.DEPTH | Channel.LABEL
        if sight.is_for_file:
            channels |= Channel.RGB
        choices = PictureChoices(job.weather, sight.carrier, channels, self.antialiasing)
        picture = makers.pictures().render(static, job.frame, camera, pose, choices)
        if sight.errors is not None and picture.rgb is not None:
            chance = sight.errors.generator(self.frame_id)
            picture = replace(picture, rgb=disturb_picture(picture.rgb, sight.errors.noise.camera, chance))
        jpeg = b""
        if self.is_jpeg or sight.is_for_file:
            assert picture.rgb is not None, "it was asked for"
            jpeg = makers.encode_jpeg(picture.rgb, self.quality)
        data = jpeg if self.is_jpeg else form.pack(picture).tobytes()
        boxes = find_visible_boxes(job.frame, camera, pose, picture, sight.carrier) if has_boxes else None
        return Shot(data, boxes, jpeg if sight.is_for_file else b"")

    def read(self, shared: SensorContext, ego: Ego, number: int) -> Struct | None:
        """Return the CameraInfo, which needs no picture; see `SensorSpec.read`."""
        if number != _INFO:
            return None
        return shared.once(PictureMessages).camera_info(shared.header(ego, self.frame_id), model_of(self), self.lens)

    def show(self, shared: SensorContext, number: int, header: Struct, result: Sighting) -> Struct | None:
        """Return the message of a picture on one of the topics; see `DrawnSpec.show`."""
        assert isinstance(result, Shot), "it is of this kind"
        make, form = shared.once(PictureMessages), _FORMS[self.picture]
        if number == 0 and self.is_jpeg:
            return make.compressed(header, "jpeg", result.data)
        if number == 0:
            step = self.width * form.num_bytes
            return make.image(header, self.height, self.width, form.encoding, 0, step, result.data)
        if number == _INFO or result.boxes is None:
            return None
        if number == _BOXES:
            return make.boxes(header, result.boxes)
        return shared.once(VisionMessages).detections_of(self.topics[number][1], header, result.boxes)


@lru_cache(maxsize=8)  # 100 MB each at most, with distortion
def model_of(spec: PictureSpec) -> CameraModel:
    """Return the geometry of a camera."""
    return spec.model
