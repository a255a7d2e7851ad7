"""A hostile node in rclpy, and what a client of the server gets meanwhile, as a line of JSON.

Run with the Python that has rclpy, and the URL of the server.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Final, TypeAlias

import rclpy
import websockets.sync.client
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.action import ActionServer
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Int32, String
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

URL: Final = sys.argv[1]
PATIENCE: Final = 60.0

Ros: TypeAlias = Any
"""An object of rclpy."""


class Web:
    """A client of the server."""

    def __init__(self) -> None:
        self.heard: list[dict[str, Any]] = []
        self._socket = websockets.sync.client.connect(URL, compression=None, max_size=None, legacy=True)
        self._num = 0

    def say(self, op: str, **fields: object) -> None:
        self._socket.send(json.dumps({"op": op, **fields}))

    def call(self, service: str, timeout: float = PATIENCE, **args: object) -> Any:  # noqa: ANN401 - values of any service
        """Return the answer of a service, or the reason of its failure."""
        self._num += 1
        self.say("call_service", service=service, args=args, id=str(self._num), timeout=timeout)
        while True:
            frame: dict[str, Any] = json.loads(self._socket.recv(timeout=PATIENCE))
            if frame.get("id") == str(self._num) and frame["op"] == "service_response":
                return frame["values"]
            self.heard.append(frame)

    def wait_until(self, is_so: Callable[[], object]) -> None:
        end = time.monotonic() + PATIENCE
        while not is_so():
            assert time.monotonic() < end
            self.call("/rosapi/get_time")
            time.sleep(0.02)

    def knows_service(self, name: str) -> bool:
        return name in self.call("/rosapi/services")["services"]


class Node:
    """A node with a thread of its own."""

    def __init__(self, name: str, **options: object) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node: Ros = rclpy.create_node(name, context=self.context, **options)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._is_over.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        self.node.destroy_node()
        self.context.shutdown()


def flood(told: dict[str, Any], web: Web) -> None:
    """Large pictures and small numbers as fast as they go, with a thousand topics that come at once."""
    one = Node("flood")
    picture, number = CompressedImage(format="jpeg", data=bytes(1_000_000)), Int32()
    pictures = one.node.create_publisher(CompressedImage, "/flood/picture", 10)
    numbers = one.node.create_publisher(Int32, "/flood/number", 10)
    web.say("subscribe", topic="/flood/number", type="std_msgs/Int32", queue_length=10)
    web.say("subscribe", topic="/flood/picture", type="sensor_msgs/CompressedImage", queue_length=1)
    web.wait_until(lambda: numbers.get_subscription_count() and pictures.get_subscription_count())
    is_over = threading.Event()

    def publish() -> None:
        while not is_over.is_set():
            for _ in range(50):
                number.data += 1
                numbers.publish(number)
            pictures.publish(picture)

    thread = threading.Thread(target=publish)
    thread.start()
    many = [one.node.create_publisher(String, f"/flood/many/t{i}", 1) for i in range(1_000)]

    def has_many() -> bool:
        topics = web.call("/rosapi/topics")["topics"]
        num = told["many"] = sum(name.startswith("/flood/many/") for name in topics)
        return bool(num > len(many) - 10)

    web.wait_until(has_many)
    web.wait_until(lambda: sum(one.get("topic") == "/flood/number" for one in web.heard) > 100)
    is_over.set()
    thread.join()
    web.say("unsubscribe", topic="/flood/number")
    web.say("unsubscribe", topic="/flood/picture")
    one.close()
    web.wait_until(lambda: not any("/flood/" in name for name in web.call("/rosapi/topics")["topics"]))


def change_types(told: dict[str, Any], web: Web) -> None:
    """A topic whose type is another one each time, with a subscription of the client all along."""
    web.say("subscribe", topic="/changing", type="std_msgs/Int32")
    for _ in range(5):
        for kind, data in ((String, "text"), (Int32, 7)):
            one = Node("changing")  # anew, because rclpy lets no topic of a program change its type
            publisher = one.node.create_publisher(kind, "/changing", 10)
            for _ in range(10):
                publisher.publish(kind(data=data))
                time.sleep(0.01)
            one.close()
    web.say("unsubscribe", topic="/changing")
    web.wait_until(lambda: "/changing" not in web.call("/rosapi/topics")["topics"])
    one = Node("changing")
    publisher = one.node.create_publisher(Int32, "/changing", 10)
    tries = 0

    def has_come() -> bool:
        """Publish. Subscribe again at times: a node that the graph still lists may have brought the other type back."""
        nonlocal tries
        if tries % 100 == 0:
            web.say("unsubscribe", topic="/changing")
            web.say("subscribe", topic="/changing", type="std_msgs/Int32")
        tries += 1
        publisher.publish(Int32(data=8))
        return any(frame.get("msg") == {"data": 8} for frame in web.heard)

    web.wait_until(has_come)
    told["types"] = sorted({type(one["msg"]["data"]).__name__ for one in web.heard if one.get("topic") == "/changing"})
    one.close()


def answer_late(told: dict[str, Any], web: Web) -> None:
    """A service that answers after the deadline of its calls; a later call gets its own answer."""
    one = Node("late")
    numbers: list[int] = []
    pause = [0.8]

    def answer(_request: Ros, response: Ros) -> Ros:
        numbers.append(len(numbers))
        response.message = str(numbers[-1])
        time.sleep(pause[0])
        return response

    one.node.create_service(Trigger, "/late", answer)
    web.wait_until(lambda: web.knows_service("/late"))
    told["late"] = [web.call("/late", timeout=0.2) for _ in range(3)]
    pause[0] = 0.0
    told["after late"] = web.call("/late")["message"] == str(numbers[-1])
    one.close()


def keep_parameters(told: dict[str, Any], web: Web) -> None:
    """A node whose parameter services never answer, and one that has far too many names."""
    mute = Node("mute", start_parameter_services=False)
    mute.node.create_service(ListParameters, "/mute/list_parameters", lambda _request, _response: time.sleep(600))
    mute.node.create_service(GetParameters, "/mute/get_parameters", lambda _request, response: response)
    huge = Node("huge", start_parameter_services=False)

    def answer(_request: Ros, response: Ros) -> Ros:
        response.result.names = [f"name_{i}" for i in range(200_000)]
        return response

    huge.node.create_service(ListParameters, "/huge/list_parameters", answer)
    good = Node("good")
    good.node.declare_parameter("speed", 1)
    web.wait_until(lambda: all(web.knows_service(f"/{one}/list_parameters") for one in ("mute", "huge", "good")))
    names = web.call("/rosapi/get_param_names")["names"]
    told["names"] = ["/good:speed" in names, len(names) < 10_000]
    told["unread"] = web.call("/rosapi/get_param", name="/huge:x")["successful"]
    huge.close()
    good.close()


def die_in_a_goal(told: dict[str, Any], web: Web) -> None:
    """A node that is killed while it carries out a goal."""
    victim = subprocess.Popen([sys.executable, __file__, URL, "dying"])
    web.wait_until(lambda: "/dying" in web.call("/rosapi/action_servers")["action_servers"])
    fields = {"action": "/dying", "action_type": "test_msgs/Fibonacci", "args": {"order": 3}}
    web.say("send_action_goal", id="goal", feedback=True, **fields)
    web.wait_until(lambda: any(one["op"] == "action_feedback" for one in web.heard))
    victim.kill()
    web.wait_until(lambda: any(one["op"] == "action_result" for one in web.heard))
    (end,) = (one for one in web.heard if one["op"] == "action_result")
    told["dead"] = [end["values"], end["result"]]


def carry_out_no_goal() -> None:
    def run(goal: Ros) -> Ros:
        goal.publish_feedback(Fibonacci.Feedback(sequence=[1]))
        time.sleep(600)

    node = rclpy.create_node("dying")
    ActionServer(node, Fibonacci, "/dying", run)
    rclpy.spin(node)


def main() -> None:
    rclpy.init()
    if len(sys.argv) > 2:
        carry_out_no_goal()
    web = Web()
    told: dict[str, Any] = {}
    for attack in (change_types, answer_late, keep_parameters, die_in_a_goal, flood):
        begin = time.monotonic()
        attack(told, web)
        sys.stderr.write(f"{attack.__name__}: {time.monotonic() - begin:.1f} s\n")
    told["alive"] = web.call("/rosapi/get_time") != {}
    sys.stdout.write(json.dumps(told))
    sys.stdout.flush()
    os._exit(0)  # without the threads of the libraries


if __name__ == "__main__":
    main()
