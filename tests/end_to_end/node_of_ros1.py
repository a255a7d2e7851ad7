"""Real nodes of ROS 1 for `test_ros1.py`, in rospy of Debian: `/usr/bin/python3 node_of_ros1.py WHAT TYPES ARGUMENTS`.

Each prints lines of JSON with what it saw. `TYPES` is a file with definitions: `morai_msgs` is not built there.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import genpy.dynamic
import rospy
import std_srvs.srv
from sensor_msgs.msg import CompressedImage, Image, Imu, PointCloud2
from std_msgs.msg import String

TYPES = json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))


def message_type(name: str) -> Any:  # noqa: ANN401 - a class of rospy
    """The class of a message, made from its definition."""
    return genpy.dynamic.generate_dynamic(name, TYPES["messages"][name])[name]


def service_type(name: str) -> Any:  # noqa: ANN401 - a class of rospy
    """The class of a service, as genpy makes it at build time."""
    request, response, md5 = TYPES["services"][name]
    parts = {
        f"_{part.lower()}_class": genpy.dynamic.generate_dynamic(name + part, text)[name + part]
        for part, text in (("Request", request), ("Response", response))
    }
    return type(name.rpartition("/")[2], (), {"_type": name, "_md5sum": md5, **parts})


def tell(value: object) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def drive() -> None:
    """Drive along a straight line in synchronous mode by services; then die without a word."""
    rospy.init_node("planner")
    command = rospy.ServiceProxy("/SyncModeCmd", service_type("morai_msgs/MoraiSyncModeCmdSrv"))
    tick = rospy.ServiceProxy("/SyncModeWaitForTick", service_type("morai_msgs/MoraiWaitForTickSrv"), persistent=True)
    control = rospy.ServiceProxy("/SyncModeCtrlCmd", service_type("morai_msgs/MoraiSyncModeCtrlCmdSrv"))
    egos: list[Any] = []
    stamps: list[int] = []
    rospy.Subscriber("/Ego_topic", message_type("morai_msgs/EgoVehicleStatus"), egos.append)
    rospy.Subscriber("/imu", Imu, lambda imu: stamps.append(imu.header.stamp.to_nsec()))
    command.wait_for_service(60)
    start = command.request_class()
    start.request.user_id, start.request.start_sync_mode, start.request.time_step = "planner", True, 20
    begun = command(start)
    wait_for(lambda: "/rosbridge_sim" in connected("/imu") and "/rosbridge_sim" in connected("/Ego_topic"))
    request = tick.request_class()
    request.request.user_id = "planner"
    speeds = []
    for i in range(200):
        request.request.frame = begun.response.frame + i + 1
        order = control.request_class()
        order.request.frame = request.request.frame
        order.request.command.longlCmdType, order.request.command.accel = 1, 0.8
        control(order)
        answer = tick(request).response
        speeds.append(answer.vehicle_status.velocity.x)
    wait_for(lambda: len(egos) >= 200 and len(stamps) >= 200)
    steps = {after - before for before, after in zip(stamps[-200:], stamps[-199:])}  # noqa: B905 - Python of Debian
    tell({"frames": answer.frame - begun.response.frame, "speeds": speeds, "steps": sorted(steps), "egos": len(egos)})
    os.kill(os.getpid(), signal.SIGKILL)


def connected(topic: str) -> list[str]:
    """Names of the nodes that a topic of ours is connected with."""
    info = rospy.impl.registration.get_topic_manager().get_pub_sub_info()
    return [one[1] if not one[1].startswith("http") else "/rosbridge_sim" for one in info if one[4] == topic]


def wait_for(condition: Any) -> None:  # noqa: ANN401 - a function
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def count() -> None:
    """Count pictures and clouds until the last ones, whose frame is `last`."""
    rospy.init_node("counter")
    counts = dict.fromkeys(("/picture", "/cloud"), 0)
    last = threading.Semaphore(0)

    def see(topic: str, message: Any) -> None:  # noqa: ANN401 - a message of rospy
        counts[topic] += 1
        if message.header.frame_id == "last":
            last.release()

    types = {"raw": Image, "jpeg": CompressedImage}
    rospy.Subscriber("/picture", types[sys.argv[3]], lambda message: see("/picture", message), buff_size=2**24)
    rospy.Subscriber("/cloud", PointCloud2, lambda message: see("/cloud", message), buff_size=2**24)
    tell("ready")
    assert last.acquire(timeout=60)
    assert last.acquire(timeout=60)
    tell(counts)


def serve() -> None:
    """Publish a latched text, say back what comes, and offer two services, until a text `end` comes."""
    rospy.init_node("server")
    out = rospy.Publisher("/echo", String, queue_size=10)
    status = rospy.Publisher("/status", String, queue_size=1, latch=True)
    status.publish("here")
    end = threading.Event()

    def hear(text: String) -> None:
        wait_for(out.get_num_connections)  # rospy drops what it publishes before somebody is connected
        out.publish(f"heard {text.data}")
        if text.data == "end":
            end.set()

    def switch(request: Any) -> object:  # noqa: ANN401 - a request of rospy
        if request.data:
            return std_srvs.srv.SetBoolResponse(success=True, message="on")
        raise rospy.ServiceException("it cannot be switched off")

    rospy.Subscriber("/say", String, hear)
    rospy.Service("/switch", std_srvs.srv.SetBool, switch)
    rospy.Service("/sleep", std_srvs.srv.Empty, lambda _: time.sleep(3600))
    rospy.set_param("/server/speed", 1.5)
    tell("ready")
    assert end.wait(60)
    wait_for(lambda: rospy.get_param("/from_client", None) == [1, 2])
    trigger = rospy.ServiceProxy("/trigger", std_srvs.srv.Trigger)
    trigger.wait_for_service(60)
    answers = [trigger().message]
    try:
        trigger()
    except rospy.ServiceException as error:
        answers.append(str(error))
    tell(answers)


if __name__ == "__main__":
    {"drive": drive, "count": count, "serve": serve}[sys.argv[1]]()
