"""The driving example in lock step, which tells the stamps of all that it saw, as a line of JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import rclpy
from nav_msgs.msg import Odometry

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "examples"))
from drive_ros2 import Driver, read_path


class Witness(Driver):
    """The driver, which notes the stamps."""

    def __init__(self, path: list[tuple[float, float]]) -> None:
        super().__init__(path)
        self.stamps: list[int] = []

    def follow(self, odometry: Odometry) -> None:
        self.stamps.append(odometry.header.stamp.sec * 1_000_000_000 + odometry.header.stamp.nanosec)
        super().follow(odometry)


def main() -> None:
    rclpy.init()
    witness = Witness(read_path(sys.argv[1]))
    while not witness.is_done:
        rclpy.spin_once(witness)
    sys.stdout.write(json.dumps({"error": witness.error, "stamps": witness.stamps}))
    witness.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
