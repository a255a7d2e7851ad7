"""Messages of cameras, lidars and radars, from what was seen. Bytes stay bytes until a client wants an encoding."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.sensors.camera_sensor import BOXES, PIXEL_BYTES, CameraSpec
from rosbridge_sim.simulator.sensors.drawing import Cloud, Scan, Shot, VisibleBoxes, model_of
from rosbridge_sim.simulator.sensors.lidar_2d import Lidar2dSpec
from rosbridge_sim.simulator.sensors.lidar_sweep import POINT_TYPE
from rosbridge_sim.simulator.sensors.radar_echoes import RadarEchoes
from rosbridge_sim.simulator.sensors.vision_messages import VisionMessages, optical

__all__ = ["SensorMessages"]

_ENCODINGS: Final = {"rgb": "rgb8", "depth": "32FC1", "semantic": "mono8", "instance": "mono16"}
"""Picture -> encoding of an Image."""

_FLOAT32, _UINT16 = 7, 4
"""Types of a `PointField`."""

_IDENTITY: Final = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


class SensorMessages:
    """Maker of all these messages; generated structs of the types of a store."""

    def __init__(self, store: Store) -> None:
        self._compressed = maker(store, "sensor_msgs/CompressedImage", "header", "format", "data")
        self._image = maker(
            store,
            "sensor_msgs/Image",
            *("header", "height", "width", "encoding", "is_bigendian", "step", "data"),
        )
        info = store.message("sensor_msgs/CameraInfo").struct_type
        self._info: Any = info
        # ROS 2 has written them small.
        self._names = {name: name if name in info.__struct_fields__ else name.lower() for name in "DKRP"}
        self._cloud = maker(
            store,
            "sensor_msgs/PointCloud2",
            *("header", "height", "width", "fields", "is_bigendian", "point_step", "row_step", "data", "is_dense"),
        )
        field = maker(store, "sensor_msgs/PointField", "name", "offset", "datatype", "count")
        assert POINT_TYPE.fields is not None, "it has fields"
        self._fields = [
            field(name, POINT_TYPE.fields[name][1], _UINT16 if name == "ring" else _FLOAT32, 1)
            for name in POINT_TYPE.names or ()
        ]
        self._scan = maker(
            store,
            "sensor_msgs/LaserScan",
            *("header", "angle_min", "angle_max", "angle_increment", "time_increment", "scan_time"),
            *("range_min", "range_max", "ranges", "intensities"),
        )
        self._detections = maker(store, "morai_msgs/RadarDetections", "header", "detections")
        self._detection = maker(
            store, "morai_msgs/RadarDetection", "detection_id", "position", "azimuth", "rangerate", "amplitude"
        )
        self._point = maker(store, "geometry_msgs/Point", "x", "y", "z")
        self._vector = maker(store, "geometry_msgs/Vector3", "x", "y", "z")
        self._store = store
        self._boxes = maker(store, BOXES, "header", "boxes")
        self._box = maker(
            store,
            "rosbridge_sim_msgs/BoundingBox",
            *("unique_id", "label", "left", "top", "right", "bottom", "visibility"),
            *("center", "size", "forward", "up"),
        )

    @cached_property
    def _vision(self) -> VisionMessages:
        return VisionMessages(self._store)

    def picture(self, spec: CameraSpec, header: Struct, shot: Shot) -> Struct:
        """Return the message of a picture: a CompressedImage or an Image."""
        if spec.is_jpeg:
            return self._compressed(header, "jpeg", shot.data)
        step = spec.width * PIXEL_BYTES[spec.picture]
        return self._image(header, spec.height, spec.width, _ENCODINGS[spec.picture], 0, step, shot.data)

    def camera_info(self, spec: CameraSpec, header: Struct) -> Struct:
        """Return the CameraInfo of a picture."""
        camera = model_of(spec)
        k = camera.matrix.ravel().tolist()
        p = [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0]
        values = {"D": list(spec.distortion), "K": k, "R": _IDENTITY, "P": p}
        return self._info(
            header=header,
            height=spec.height,
            width=spec.width,
            distortion_model="plumb_bob",
            **{self._names[name]: value for name, value in values.items()},
        )

    def boxes(self, header: Struct, boxes: VisibleBoxes) -> Struct:
        """Return the BoundingBoxes of a picture."""
        return self._boxes(
            header,
            [
                self._box(
                    boxes.ids[i],
                    boxes.labels[i],
                    *boxes.bounds[i],
                    boxes.visibility[i],
                    self._point(*optical(boxes.centres[i])),
                    self._vector(*boxes.sizes[i]),
                    *(self._vector(*optical(axis)) for axis in boxes.axes[i]),
                )
                for i in range(len(boxes.ids))
            ],
        )

    def detections_of(self, type_name: str, header: Struct, boxes: VisibleBoxes) -> Struct:
        """Return the boxes of a picture as vision_msgs, in the optical frame of the camera."""
        return self._vision.detections_of(type_name, header, boxes)

    def cloud(self, header: Struct, cloud: Cloud) -> Struct:
        """Return the PointCloud2 of a turn."""
        step = POINT_TYPE.itemsize
        return self._cloud(header, 1, cloud.num, self._fields, False, step, step * cloud.num, cloud.data, True)  # noqa: FBT003 - fields of the message

    def scan(self, spec: Lidar2dSpec, header: Struct, scan: Scan) -> Struct:
        """Return the LaserScan of a turn."""
        step = 6.283185307179586 / spec.num_values
        period = 1.0 / spec.rate
        first = -step * spec.ahead
        return self._scan(
            header,
            first,
            first + step * (spec.num_values - 1),
            step,
            period / spec.num_values,
            period,
            spec.min_range,
            spec.max_range,
            scan.ranges,
            scan.intensities,
        )

    def radar(self, header: Struct, echoes: RadarEchoes) -> Struct:
        """Return the RadarDetections of a scan."""
        columns = (echoes.azimuth, echoes.range_rate, echoes.amplitude)
        return self._detections(
            header,
            [
                self._detection(i, self._point(*place), *figures)
                for i, (place, *figures) in enumerate(
                    zip(echoes.position.tolist(), *(column.tolist() for column in columns), strict=True)
                )
            ],
        )
