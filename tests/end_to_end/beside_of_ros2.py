"""A robot's node in rclpy with clients of several kinds beside: a topic and a service each way, as a line of JSON.

Run with the Python that has rclpy, the URL of the server, and the names of clients that others start (`graph.mjs`). It
starts one with roslibpy and one that speaks CBOR by itself.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from typing import Any, TypeAlias

import cbor2
import rclpy
import roslibpy
import websockets.sync.client
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import Trigger
from test_msgs.srv import BasicTypes

from rosbridge_sim.client import Client

URL, *NAMES = sys.argv[1:]
NAMES += ["roslibpy", "cbor"]
SECONDS = 90.0
LINGER = 5.0
"""Time for the last answers to come to clients that others have started [s]."""

Ros: TypeAlias = Any
"""An object of rclpy or roslibpy."""

told: dict[str, Any] = {"heard": {}, "asked": {}, "said": {}}


def wait_until_known(service: str) -> None:
    with Client(URL, timeout=SECONDS) as client:
        while service not in client.call("/rosapi/services")["services"]:
            time.sleep(0.05)


def use_roslibpy() -> None:
    wait_until_known("/robot/tell")
    host, _, port = URL.removeprefix("ws://").strip("/").partition(":")
    ros = roslibpy.Ros(host, int(port))
    ros.run()

    def answer_ask(_request: Ros, response: Ros) -> bool:
        response.update({"success": True, "message": "roslibpy was asked"})
        return True

    roslibpy.Service(ros, "/web/roslibpy/ask", "std_srvs/Trigger").advertise(answer_ask)
    seen: list[str] = []
    roslibpy.Topic(ros, "/robot/text", "std_msgs/String").subscribe(lambda message: seen.append(message["data"]))
    talker = roslibpy.Topic(ros, "/web/roslibpy", "std_msgs/String")
    service = roslibpy.Service(ros, "/robot/tell", "test_msgs/BasicTypes")
    while True:
        talker.publish({"data": "roslibpy \u2713"})
        request = roslibpy.ServiceRequest({"string_value": "roslibpy", "float64_value": 0.1})
        response = service.call(request, timeout=SECONDS)
        if response["bool_value"] and seen:
            told["said"]["roslibpy"] = {
                "text": seen[0],
                "answer": [response["string_value"], response["float64_value"]],
            }
            return


def use_cbor() -> None:
    wait_until_known("/robot/tell")
    with websockets.sync.client.connect(URL) as socket:

        def say(op: str, **fields: object) -> None:
            socket.send(cbor2.dumps({"op": op, **fields}))

        say("advertise_service", service="/web/cbor/ask", type="std_srvs/Trigger")
        say("advertise", topic="/web/cbor", type="std_msgs/String")
        say("subscribe", topic="/robot/text", type="std_msgs/String", compression="cbor")
        text = ""
        tell = {"service": "/robot/tell", "args": {"string_value": "cbor", "float64_value": 0.1}}
        say("call_service", **tell)
        while True:
            frame = socket.recv(timeout=SECONDS)
            got = cbor2.loads(frame) if isinstance(frame, bytes) else json.loads(frame)
            if got["op"] == "publish":
                text = got["msg"]["data"]
            elif got["op"] == "call_service":
                values = {"success": True, "message": "cbor was asked"}
                say("service_response", service=got["service"], id=got["id"], values=values, result=True)
            elif got["values"]["bool_value"] and text:
                answer = [got["values"]["string_value"], got["values"]["float64_value"]]
                told["said"]["cbor"] = {"text": text, "answer": answer}
                return
            else:
                say("publish", topic="/web/cbor", msg={"data": "cbor \u2713"})
                say("call_service", **tell)


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("robot")
    heard, asked = told["heard"], told["asked"]
    answered: set[str] = set()

    def tell(request: Ros, response: Ros) -> Ros:
        name = request.string_value
        response.string_value = f"for {name}"
        response.float64_value = request.float64_value
        response.bool_value = name in heard and name in asked
        if response.bool_value:
            answered.add(name)
        return response

    def hear(name: str) -> None:
        node.create_subscription(String, f"/web/{name}", lambda message: heard.setdefault(name, message.data), 10)

    def ask(name: str) -> None:
        client = clients.pop(name)
        future = client.call_async(Trigger.Request())
        future.add_done_callback(lambda done: asked.setdefault(name, done.result().message))

    node.create_service(BasicTypes, "/robot/tell", tell)
    publisher = node.create_publisher(String, "/robot/text", 10)
    clients = {name: node.create_client(Trigger, f"/web/{name}/ask") for name in NAMES}
    for name in NAMES:
        hear(name)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    for use in (use_roslibpy, use_cbor):
        threading.Thread(target=use, daemon=True).start()
    end = time.monotonic() + SECONDS
    is_over = False
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.02)
        publisher.publish(String(data="robot \u2713"))
        for name in [name for name, client in clients.items() if client.service_is_ready()]:
            ask(name)
        if not is_over and len(answered) == len(NAMES) and len(told["said"]) == 2:
            is_over, end = True, time.monotonic() + LINGER
    sys.stdout.write(json.dumps(told))
    sys.stdout.flush()
    os._exit(0)  # without the threads of the libraries


if __name__ == "__main__":
    main()
