"""Boxes of pictures as vision_msgs: those of 0.0.1 for ROS 1, and those of 4 for ROS 2."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.sensor_data.visible_boxes import VisibleBox
from rosbridge_sim.world.geometry.planar import Quaternion

DETECTIONS_2D, DETECTIONS_3D = "vision_msgs/Detection2DArray", "vision_msgs/Detection3DArray"
"""Types of the boxes for programs of others."""


class VisionMessages:
    """Maker of these messages; generated structs of the types of a store."""

    def __init__(self, store: Store) -> None:
        self._is_ros2 = store.ros != 1
        make = partial(maker, store)
        last = ("source_img", "source_cloud") if store.ros == 1 else ("id", "id")
        self._arrays = {name: make(name, "header detections") for name in (DETECTIONS_2D, DETECTIONS_3D)}
        self._flat = make("vision_msgs/Detection2D", f"header results bbox {last[0]}")
        self._solid = make("vision_msgs/Detection3D", f"header results bbox {last[1]}")
        self._box_2d = make("vision_msgs/BoundingBox2D", "center size_x size_y")
        self._box_3d = make("vision_msgs/BoundingBox3D", "center size")
        fields = "hypothesis pose" if self._is_ros2 else "id score pose"
        self._result = make("vision_msgs/ObjectHypothesisWithPose", fields)
        self._hypothesis = make("vision_msgs/ObjectHypothesis", "class_id score" if self._is_ros2 else "id score")
        self._header = make("std_msgs/Header", " ".join(store.message("std_msgs/Header").struct_type.__struct_fields__))
        flat = ("vision_msgs/Pose2D", "position theta") if self._is_ros2 else ("geometry_msgs/Pose2D", "x y theta")
        self._pose_2d = make(*flat)
        self._point_2d = make("vision_msgs/Point2D", "x y")
        self._pose = make("geometry_msgs/Pose", "position orientation")
        self._uncertain = make("geometry_msgs/PoseWithCovariance", "pose covariance")
        self._point = make("geometry_msgs/Point", "x y z")
        self._vector = make("geometry_msgs/Vector3", "x y z")
        self._quaternion = make("geometry_msgs/Quaternion", "x y z w")
        self._no_sources = {
            DETECTIONS_2D: store.message("sensor_msgs/Image").struct_type(),
            DETECTIONS_3D: store.message("sensor_msgs/PointCloud2").struct_type(),
        }

    def detections_of(self, type_name: str, header: Struct, boxes: Sequence[VisibleBox]) -> Struct:
        """Return the boxes of a picture, in the optical frame of its camera.

        Args:
            type_name: `DETECTIONS_2D` or `DETECTIONS_3D`.
        """
        fields = {name: getattr(header, name) for name in type(header).__struct_fields__}
        own = self._header(*(fields | {"frame_id": f"{fields['frame_id']}_optical"}).values())
        is_flat = type_name == DETECTIONS_2D
        found = []
        for seen in boxes:
            pose = self._pose(self._point(*optical(seen.centre)), self._quaternion(*_orientation(seen.axes)))
            result = self._result_of(seen.label, self._uncertain(pose, [0.0] * 36))
            last = str(seen.uid) if self._is_ros2 else self._no_sources[type_name]
            if is_flat:
                left, top, right, bottom = seen.bounds
                middle = self._middle(0.5 * (left + right), 0.5 * (top + bottom))
                box = self._box_2d(middle, right - left, bottom - top)
                found.append(self._flat(own, [result], box, last))
            else:
                box = self._box_3d(pose, self._vector(*seen.size))
                found.append(self._solid(own, [result], box, last))
        return self._arrays[type_name](own, found)

    def _result_of(self, label: int, pose: Struct) -> Struct:
        if self._is_ros2:
            return self._result(self._hypothesis(str(label), 1.0), pose)
        return self._result(label, 1.0, pose)

    def _middle(self, x: float, y: float) -> Struct:
        return self._pose_2d(self._point_2d(x, y), 0.0) if self._is_ros2 else self._pose_2d(x, y, 0.0)


def optical(vector: Sequence[float]) -> tuple[float, float, float]:
    """Return a vector of x forward, y left, z up as x right, y down, z ahead."""
    x, y, z = vector
    return -y, -z, x


def _orientation(axes: Sequence[Sequence[float]]) -> Quaternion:
    """Return the rotation from the axes of a box into the optical frame.

    Args:
        axes: directions of its length and of its height in the camera's axes.
    """
    a, c = (optical(axis) for axis in axes)
    b = c[1] * a[2] - c[2] * a[1], c[2] * a[0] - c[0] * a[2], c[0] * a[1] - c[1] * a[0]
    # The columns of the matrix are a, b and c. One of the four squares is 1 or more (Shepperd 1978).
    squares = (
        1.0 + a[0] - b[1] - c[2],
        1.0 - a[0] + b[1] - c[2],
        1.0 - a[0] - b[1] + c[2],
        1.0 + a[0] + b[1] + c[2],
    )
    x, y, z, w = {
        0: (squares[0], a[1] + b[0], a[2] + c[0], b[2] - c[1]),
        1: (a[1] + b[0], squares[1], b[2] + c[1], c[0] - a[2]),
        2: (a[2] + c[0], b[2] + c[1], squares[2], a[1] - b[0]),
        3: (b[2] - c[1], c[0] - a[2], a[1] - b[0], squares[3]),
    }[max(range(4), key=squares.__getitem__)]
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return x / length, y / length, z / length, w / length
