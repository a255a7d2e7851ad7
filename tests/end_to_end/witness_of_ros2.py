"""A node in rclpy that tells which messages it got from a server, and /imu byte for byte, as a line of JSON."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

import rclpy
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, Imu
from visualization_msgs.msg import MarkerArray

PATIENCE = 90.0
NUM_IMU = 100


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("witness")
    raw: list[str] = []
    counts: dict[str, int] = {}
    seen: dict[str, object] = {}

    def count(topic: str, describe: Callable[..., object]) -> Callable[..., None]:
        def hear(message: object) -> None:
            counts[topic] = counts.get(topic, 0) + 1
            seen[topic] = describe(message)

        return hear

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    own = [
        node.create_subscription(Imu, "/imu", lambda data: raw.append(bytes(data).hex()), 1_000, raw=True),
        node.create_subscription(Odometry, "/odom", count("/odom", lambda m: m.child_frame_id), 10),
        node.create_subscription(
            MarkerArray, "/sim/scene/map", count("/sim/scene/map", lambda m: len(m.markers)), latched
        ),
        node.create_subscription(
            MarkerArray, "/sim/scene/objects", count("/sim/scene/objects", lambda m: len(m.markers)), 10
        ),
        node.create_subscription(
            CameraInfo, "/image_jpeg/camera_info", count("/image_jpeg/camera_info", lambda m: [m.width, m.height]), 10
        ),
        node.create_subscription(
            CompressedImage,
            "/image_jpeg/compressed",
            count("/image_jpeg/compressed", lambda m: bytes(m.data[:3]).hex()),
            qos_profile_sensor_data,
        ),
    ]
    end = time.monotonic() + PATIENCE
    while (len(raw) < NUM_IMU or len(counts) < len(own) - 1) and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    sys.stdout.write(json.dumps({"imu": raw, "counts": counts, "seen": seen}))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
