"""Messages of pictures. Bytes stay bytes until a client wants an encoding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.scenery.camera_geometry import CameraModel
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.sensor_data.visible_boxes import VisibleBox
from rosbridge_sim.simulator.sensor_data.vision_messages import optical

BOXES: Final = "rosbridge_sim_msgs/BoundingBoxes"
"""Type of the boxes of what a camera shows."""

_IDENTITY: Final = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


class PictureMessages:
    """Maker of all these messages; generated structs of the types of a store.

    Attributes:
        compressed: `(header, format, data)`: returns a CompressedImage.
        image: `(header, height, width, encoding, is_bigendian, step, data)`: returns an Image.
    """

    def __init__(self, store: Store) -> None:
        self.compressed = maker(store, "sensor_msgs/CompressedImage", "header format data")
        self.image = maker(store, "sensor_msgs/Image", "header height width encoding is_bigendian step data")
        info = store.message("sensor_msgs/CameraInfo").struct_type
        self._info: Any = info
        # ROS 2 has written them small.
        self._names = {name: name if name in info.__struct_fields__ else name.lower() for name in "DKRP"}
        self._point = maker(store, "geometry_msgs/Point", "x y z")
        self._vector = maker(store, "geometry_msgs/Vector3", "x y z")
        self._boxes = maker(store, BOXES, "header boxes")
        self._box = maker(
            store,
            "rosbridge_sim_msgs/BoundingBox",
            "unique_id label left top right bottom visibility center size forward up",
        )

    def camera_info(self, header: Struct, camera: CameraModel, model: str) -> Struct:
        """Return the CameraInfo of a picture."""
        k = camera.matrix.ravel().tolist()
        p = [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0]
        values = {"D": list(camera.distortion), "K": k, "R": _IDENTITY, "P": p}
        return self._info(
            header=header,
            height=camera.height,
            width=camera.width,
            distortion_model=model,
            **{self._names[name]: value for name, value in values.items()},
        )

    def boxes(self, header: Struct, boxes: Sequence[VisibleBox]) -> Struct:
        """Return the BoundingBoxes of a picture."""
        found = []
        for box in boxes:
            centre, size = self._point(*optical(box.centre)), self._vector(*box.size)
            axes = (self._vector(*optical(axis)) for axis in box.axes)
            found.append(self._box(box.uid, box.label, *box.bounds, box.visibility, centre, size, *axes))
        return self._boxes(header, found)
