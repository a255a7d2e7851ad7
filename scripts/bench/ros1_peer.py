"""A node of rospy for `ros1.py`: it publishes pictures, or counts what comes. For Debian's /usr/bin/python3."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import genpy.dynamic
import rospy
from sensor_msgs.msg import CompressedImage, PointCloud2


def say(value: object) -> None:
    """Write a line of JSON."""
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def publish(rate: float, size: int) -> None:
    """Publish pictures until the end."""
    publisher = rospy.Publisher("/picture", CompressedImage, queue_size=10)
    message = CompressedImage(format="jpeg", data=bytes(size))
    say("ready")
    pace = rospy.Rate(rate)
    while not rospy.is_shutdown():
        message.header.stamp = rospy.Time.from_sec(time.time())
        publisher.publish(message)
        pace.sleep()


def count(types: str) -> None:
    """Count what comes, and say it whenever a line comes."""
    name = "morai_msgs/EgoVehicleStatus"
    ego = genpy.dynamic.generate_dynamic(name, Path(types).read_text(encoding="utf-8"))[name]
    counts: dict[str, int] = {}

    def see(topic: str) -> None:
        counts[topic] = counts.get(topic, 0) + 1

    for topic, kind in (("/picture", CompressedImage), ("/cloud", PointCloud2), ("/Ego_topic", ego)):
        rospy.Subscriber(topic, kind, lambda _message, topic=topic: see(topic), buff_size=2**24)
    say("ready")
    for _ in sys.stdin:
        say({"counts": counts, "cpu": time.process_time()})


if __name__ == "__main__":
    rospy.init_node("peer", disable_signals=True)
    if sys.argv[1] == "publish":
        publish(float(sys.argv[2]), int(sys.argv[3]))
    else:
        count(sys.argv[2])
