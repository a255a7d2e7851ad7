"""A node of rospy for `ros1.py`: it publishes, counts what comes, or drives. For Debian's /usr/bin/python3."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import genpy.dynamic
import rospy
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import CompressedImage, PointCloud2


def say(value: object) -> None:
    """Write a line of JSON."""
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def publish(topic: str, message: Any, rate: float) -> None:  # noqa: ANN401 - of rospy
    """Publish a message until the end."""
    publisher = rospy.Publisher(topic, type(message), queue_size=10)
    say("ready")
    pace = rospy.Rate(rate)
    while not rospy.is_shutdown():
        message.header.stamp = rospy.Time.from_sec(time.time())
        publisher.publish(message)
        pace.sleep()


def tick(types: str, persistent: str) -> None:
    """Drive in synchronous mode for some ticks, and say how long one takes."""
    texts = json.loads(Path(types).read_text(encoding="utf-8"))

    def service(name: str, short: str) -> rospy.ServiceProxy:
        request, response, md5 = texts[short]
        full = f"morai_msgs/{short}"
        parts = {
            f"_{part.lower()}_class": genpy.dynamic.generate_dynamic(full + part, text)[full + part]
            for part, text in (("Request", request), ("Response", response))
        }
        return rospy.ServiceProxy(
            name, type(short, (), {"_type": full, "_md5sum": md5, **parts}), bool(int(persistent))
        )

    mode, wait, control = (
        service(f"/{name}", short)
        for name, short in (
            ("SyncModeCmd", "MoraiSyncModeCmdSrv"),
            ("SyncModeWaitForTick", "MoraiWaitForTickSrv"),
            ("SyncModeCtrlCmd", "MoraiSyncModeCtrlCmdSrv"),
        )
    )
    start, request, order = mode.request_class(), wait.request_class(), control.request_class()
    start.request.user_id, start.request.start_sync_mode, start.request.time_step = "peer", True, 20
    frame = mode(start).response.frame
    request.request.user_id = "peer"
    order.request.command.longlCmdType, order.request.command.accel = 1, 0.2
    say("ready")
    times = []
    for i in range(500):
        begun = time.perf_counter()
        order.request.frame = request.request.frame = frame + i + 1
        control(order)
        wait(request)
        times.append(time.perf_counter() - begun)
    say({"median": sorted(times)[250]})


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
    what, *words = sys.argv[1:]
    if what == "picture":
        publish("/picture", CompressedImage(format="jpeg", data=bytes(100_000)), 30)
    elif what == "pose":
        publish("/pose", PoseStamped(), 500)
    elif what == "tick":
        tick(*words)
    else:
        count(*words)
