"""A robot's node in rclpy beside clients of a server: actions both ways and parameters, as a line of JSON.

Run with the Python that has rclpy, and the URL of the server.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, TypeAlias

import rclpy
import websockets.sync.client
from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.parameter import Parameter
from test_msgs.action import Fibonacci

from rosbridge_sim.client import Client, ClientError

URL = sys.argv[1]
FIBONACCI = [0, 1, 1, 2, 3, 5]

Ros: TypeAlias = Any
"""An object of rclpy."""


def wait_until(is_so: Callable[[], object], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.02)


class Wire:
    """A client that speaks the protocol as it is."""

    def __init__(self) -> None:
        self.socket = websockets.sync.client.connect(URL)

    def say(self, op: str, **fields: object) -> None:
        self.socket.send(json.dumps({"op": op, **fields}))

    def hear(self, *ops: str) -> dict[str, Any]:
        """Return the next frame of one of some ops."""
        while True:
            frame: dict[str, Any] = json.loads(self.socket.recv(timeout=30.0))
            if frame["op"] in ops:
                return frame

    def send_goal(self, order: int, goal_id: str) -> None:
        fields = {"action": "/fibonacci", "action_type": "test_msgs/Fibonacci", "args": {"order": order}}
        self.say("send_action_goal", id=goal_id, feedback=True, **fields)


def run_goal(goal: Ros) -> Fibonacci.Result:
    for i in range(1, max(2, goal.request.order)):
        if goal.is_cancel_requested:
            goal.canceled()
            return Fibonacci.Result()
        goal.publish_feedback(Fibonacci.Feedback(sequence=FIBONACCI[: i + 1]))
        time.sleep(0.05)
    goal.succeed()
    return Fibonacci.Result(sequence=FIBONACCI[: goal.request.order + 1])


def send_goals_to_node(told: dict[str, Any], cancelled: threading.Event) -> None:
    wire = Wire()
    wire.send_goal(5, "a")
    assert wire.hear("action_feedback")["values"]["sequence"] == FIBONACCI[:2]
    end = wire.hear("action_result")
    wire.send_goal(-1, "b")
    rejected = wire.hear("action_result")
    wire.send_goal(10_000, "c")
    wire.hear("action_feedback")
    wire.say("cancel_action_goal", id="c", action="/fibonacci")
    told["web to node"] = [
        [end["values"]["sequence"], end["result"], end["status"]],
        rejected["values"],
        wire.hear("action_result")["status"],
    ]
    cancelled.clear()
    wire.send_goal(10_000, "d")
    wire.hear("action_feedback")
    wire.socket.close()
    told["has cancelled the goal of a client that left"] = cancelled.wait(10.0)


def send_goals_to_client(node: Ros, told: dict[str, Any]) -> None:
    wire = Wire()
    wire.say("advertise_action", action="/web_fibonacci", type="test_msgs/Fibonacci")
    client = ActionClient(node, Fibonacci, "/web_fibonacci")
    assert client.wait_for_server(30.0)
    seen: list[list[int]] = []

    def hear_feedback(message: Ros) -> None:
        seen.append(list(message.feedback.sequence))

    def done(future: Ros) -> Ros:
        wait_until(future.done)
        return future.result()

    def accepted() -> tuple[Ros, str]:
        future = client.send_goal_async(Fibonacci.Goal(order=2), feedback_callback=hear_feedback)
        goal_id = wire.hear("send_action_goal")["id"]
        return done(future), goal_id

    def end(goal_id: str, status: int) -> None:
        fields = {"action": "/web_fibonacci", "id": goal_id}
        wire.say("action_result", values={"sequence": [0, 1, 1]}, status=status, result=True, **fields)

    goal, goal_id = accepted()
    future = goal.get_result_async()
    for i in range(5):
        wire.say("action_feedback", action="/web_fibonacci", id=goal_id, values={"sequence": [0, i]})
    # Status and feedback are two topics, and rclpy drops the feedback that it reads after the last status.
    wait_until(lambda: len(seen) >= 5)
    end(goal_id, 4)
    result = done(future)
    told["feedback"] = seen
    cancelled, cancelled_id = accepted()
    response = cancelled.cancel_goal_async()
    assert wire.hear("cancel_action_goal")["id"] == cancelled_id
    end(cancelled_id, 5)
    two = [accepted(), accepted()]
    third = done(client.send_goal_async(Fibonacci.Goal(order=2)))
    told["node to web"] = [
        [list(result.result.sequence), result.status],
        [bool(done(response).goals_canceling), done(cancelled.get_result_async()).status],
        third.accepted,
    ]
    for _, one in two:
        end(one, 4)
    wire.socket.close()


def refuse_one(parameters: list[Parameter]) -> SetParametersResult:
    is_wrong = any(one.name == "speed" and one.value > 100.0 for one in parameters)
    return SetParametersResult(successful=not is_wrong, reason="the node says no" if is_wrong else "")


def use_parameters() -> dict[str, Any]:
    with Client(URL, timeout=20.0) as client:

        def ask(service: str, /, **args: object) -> dict[str, Any]:
            return client.call(service, args)

        def why_not(service: str, /, **args: object) -> str:
            try:
                ask(service, **args)
            except ClientError as error:
                return str(getattr(error, "reason", error))
            return "it was allowed"

        def get(name: str) -> str:
            return str(ask("/rosapi/get_param", name=name)["value"])

        told: dict[str, Any] = {"read": [get(f"/robot:{name}") for name in ("speed", "flag", "text", "gaits")]}
        ask("/rosapi/set_param", name="/robot:speed", value="2")
        ask("/rosapi/set_param", name="/robot:gaits", value="[3,4]")
        told["set"] = [get("/robot:speed"), get("/robot:gaits")]
        names = ask("/rosapi/get_param_names")["names"]
        told["names"] = [name for name in names if name.startswith("/robot:") and "service" not in name]
        told["exists"] = [ask("/rosapi/has_param", name=f"/robot:{name}")["exists"] for name in ("speed", "none")]
        told["unset"] = ask("/rosapi/get_param", name="/robot:none")["successful"]
        told["refused"] = why_not("/rosapi/set_param", name="/robot:speed", value="1000.0")
        told["denied"] = why_not("/rosapi/get_param", name="/robot:secret")
        told["denied by another way"] = why_not("/robot/get_parameters", names=["secret"])
        return told


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("robot")
    cancelled = threading.Event()

    def cancel(_goal: Ros) -> CancelResponse:
        cancelled.set()
        return CancelResponse.ACCEPT

    def judge(request: Fibonacci.Goal) -> GoalResponse:
        return GoalResponse.ACCEPT if request.order >= 0 else GoalResponse.REJECT

    ActionServer(
        *(node, Fibonacci, "/fibonacci", run_goal),
        goal_callback=judge,
        cancel_callback=cancel,
        callback_group=ReentrantCallbackGroup(),
    )
    for name, value in (("speed", 1.5), ("flag", True), ("text", "slow"), ("gaits", [1, 2]), ("secret", "x")):
        node.declare_parameter(name, value)
    node.add_on_set_parameters_callback(refuse_one)
    executor = MultiThreadedExecutor(4)
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    told: dict[str, Any] = {}
    with Client(URL, timeout=20.0) as client:
        wait_until(lambda: "/fibonacci" in client.call("/rosapi/action_servers", {})["action_servers"])
        told["listed"] = [
            client.call("/rosapi/action_type", {"action": "/fibonacci"})["type"],
            "/robot" in client.call("/rosapi/nodes", {})["nodes"],
        ]
    send_goals_to_node(told, cancelled)
    send_goals_to_client(node, told)
    told["parameters"] = use_parameters()
    sys.stdout.write(json.dumps(told))
    sys.stdout.flush()
    os._exit(0)  # without the threads of the libraries


if __name__ == "__main__":
    main()
