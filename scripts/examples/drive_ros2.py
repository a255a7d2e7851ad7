#!/usr/bin/env python3
"""Drive the car along a path from a node of ROS 2, in real time, and print the largest error.

    ./scripts/serve --ros2-domain 7                                         # in one terminal
    export ROS_DOMAIN_ID=7 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST          # in another, with ROS 2
    python scripts/examples/drive_ros2.py scripts/examples/course.txt

The node needs no `morai_msgs`: it reads `/odom` (nav_msgs/Odometry) and commands `/cmd_vel` (geometry_msgs/Twist). It
steers by pure pursuit: it chooses the point of the path a few metres ahead, and drives on the circle that leads there.
The points of the path, `x y z` in metres, are relative to the car at the start, x ahead of it and y to its left.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node

SPEED = 5.0  # [m/s]
AHEAD = 3.0  # distance of the point that the car aims at [m]


class Driver(Node):  # type: ignore[misc] # of a library without types
    """A node that follows a path and then stops."""

    def __init__(self, path: list[tuple[float, float]]) -> None:
        super().__init__("driver")
        self.path = path
        self.start: tuple[float, float, float] | None = None
        self.nearest = 0  # index of the nearest point so far
        self.error = 0.0  # largest distance from the path [m]
        self.is_done = False
        self.commands = self.create_publisher(Twist, "/cmd_vel", 10)
        self.create_subscription(Odometry, "/odom", self.follow, 10)

    def follow(self, odometry: Odometry) -> None:
        """Command the car anew, from where it is."""
        place, axes = odometry.pose.pose.position, odometry.pose.pose.orientation
        yaw = 2.0 * math.atan2(axes.z, axes.w)
        self.start = self.start or (place.x, place.y, yaw)
        x, y = to_frame(self.start, place.x, place.y)  # of the car, in the frame of the path
        ahead = self.path[self.nearest : self.nearest + 10]
        gaps = [math.dist(point, (x, y)) for point in ahead]
        self.nearest += gaps.index(min(gaps))
        self.error = max(self.error, self.distance(x, y))
        command = Twist()
        if self.nearest >= len(self.path) - 2:
            self.is_done = True
        else:
            aim = next(
                (point for point in self.path[self.nearest :] if math.dist(point, (x, y)) > AHEAD), self.path[-1]
            )
            _, left = to_frame((x, y, yaw - self.start[2]), *aim)
            command.linear.x = SPEED
            command.angular.z = SPEED * 2.0 * left / math.dist(aim, (x, y)) ** 2  # the circle through the point
        self.commands.publish(command)

    def distance(self, x: float, y: float) -> float:
        """Return the distance of a point from the pieces of the path beside the nearest point [m]."""
        pieces = zip(self.path, self.path[1:], strict=False)
        return min(piece_distance(a, b, x, y) for a, b in list(pieces)[max(self.nearest - 1, 0) : self.nearest + 1])


def to_frame(pose: tuple[float, float, float], x: float, y: float) -> tuple[float, float]:
    """Return a point relative to a pose: ahead and left of it [m]."""
    east, north, yaw = x - pose[0], y - pose[1], pose[2]
    sin, cos = math.sin(yaw), math.cos(yaw)
    return east * cos + north * sin, north * cos - east * sin


def piece_distance(a: tuple[float, float], b: tuple[float, float], x: float, y: float) -> float:
    """Return the distance of a point from a straight piece [m]."""
    along = ((x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])) / math.dist(a, b) ** 2
    held = min(max(along, 0.0), 1.0)
    return math.dist((x, y), (a[0] + (b[0] - a[0]) * held, a[1] + (b[1] - a[1]) * held))


def read_path(file: str) -> list[tuple[float, float]]:
    """Return the points of a path [m]."""
    rows = [line.partition("#")[0].split() for line in Path(file).read_text().splitlines()]
    return [(float(row[0]), float(row[1])) for row in rows if row]


def main() -> None:
    """Drive, and print the result."""
    rclpy.init()
    driver = Driver(read_path(sys.argv[1]))
    while not driver.is_done:
        rclpy.spin_once(driver)
    print(f"largest error {driver.error:.2f} m")
    driver.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
