"""A node in rclpy that tells what it sees of a server, as a line of JSON; run with the Python that has rclpy."""

from __future__ import annotations

import json
import sys
import time

import rclpy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, NavSatFix

SECONDS = 5.0


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("judge")
    stamps: list[int] = []
    num_fixes = num_clocks = 0

    def hear_imu(message: Imu) -> None:
        stamps.append(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec)

    def hear_fix(_message: NavSatFix) -> None:
        nonlocal num_fixes
        num_fixes += 1

    def hear_clock(_message: Clock) -> None:
        nonlocal num_clocks
        num_clocks += 1

    own = [
        node.create_subscription(Imu, "/imu", hear_imu, 1_000),
        node.create_subscription(NavSatFix, "/fix", hear_fix, 10),
        node.create_subscription(Clock, "/clock", hear_clock, 10),
    ]
    end = time.monotonic() + 120.0
    while len(stamps) < 50 * SECONDS and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    (publisher,) = node.get_publishers_info_by_topic("/imu")
    (subscription,) = node.get_subscriptions_info_by_topic("/imu")
    sys.stdout.write(
        json.dumps(
            {
                "stamps": stamps,
                "num_fixes": num_fixes,
                "num_clocks": num_clocks,
                "nodes": sorted(f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces()),
                "node_of_imu": publisher.node_name,
                "is_hash_ours": publisher.topic_type_hash == subscription.topic_type_hash,
                "types": dict(node.get_topic_names_and_types()),
                "num_own": len(own),
            }
        )
    )
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
