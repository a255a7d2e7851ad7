"""A node in rclpy beside a server whose patterns of access keep some names from it, as a line of JSON.

Run with the Python that has rclpy, the URL of the server, and the namespace that stands before all names on the graph.
"""

from __future__ import annotations

import json
import os
import sys
from functools import partial

import rclpy
from std_msgs.msg import String
from std_srvs.srv import Trigger

from tests.end_to_end.hostile_of_ros2 import Node, Ros, Web

NAMESPACE = sys.argv[2]


def offer(web: Web) -> None:
    """Subscribe to the topics of the node, and offer it others and services."""
    for name in ("/robot/plan", "/robot/state"):
        web.say("subscribe", topic=name, type="std_msgs/String")
    for name in ("/web/private", "/web/public"):
        web.say("advertise", topic=name, type="std_msgs/String")
    for name in ("/web/secret", "/web/open"):
        web.say("advertise_service", service=name, type="std_srvs/Trigger")


def note(heard: dict[str, str], name: str, message: String) -> None:
    heard[name] = message.data


def main() -> None:
    rclpy.init()
    web, robot = Web(), Node("robot", namespace=NAMESPACE or None)
    heard: dict[str, str] = {}
    publishers = [robot.node.create_publisher(String, NAMESPACE + name, 10) for name in ("/robot/plan", "/robot/state")]
    for name in ("/web/private", "/web/public"):
        robot.node.create_subscription(String, NAMESPACE + name, partial(note, heard, name), 10)

    def answer(_request: Ros, response: Ros) -> Ros:
        response.success = True
        return response

    for name in ("/robot/secret", "/robot/open"):
        robot.node.create_service(Trigger, NAMESPACE + name, answer)
    for name in ("secret", "speed"):
        robot.node.declare_parameter(name, 1)
    offer(web)

    def is_all_there() -> bool:
        for publisher in publishers:
            publisher.publish(String(data="from the node"))
        for name in ("/web/private", "/web/public"):
            web.say("publish", topic=name, msg={"data": "from the client"})
        has_heard = any(one.get("topic") == "/robot/state" for one in web.heard) and "/web/public" in heard
        return has_heard and robot.node.count_services(NAMESPACE + "/web/open") and web.knows_service("/robot/open")

    web.wait_until(is_all_there)
    told = {
        "node heard": sorted(heard),
        "client heard": sorted({one["topic"] for one in web.heard if one["op"] == "publish"}),
        "node sees": [robot.node.count_services(NAMESPACE + name) for name in ("/web/secret", "/web/open")],
        "node sees topics": [robot.node.count_publishers(NAMESPACE + name) for name in ("/web/private", "/web/public")],
        "client calls": [web.call(name) for name in ("/robot/secret", "/robot/open")],
        "parameters": [web.call("/rosapi/get_param", name=f"/robot:{one}") for one in ("secret", "speed")],
        "by its service": web.call("/robot/get_parameters", names=["secret"]),
    }
    sys.stdout.write(json.dumps(told))
    sys.stdout.flush()
    os._exit(0)  # without the threads of the libraries


if __name__ == "__main__":
    main()
