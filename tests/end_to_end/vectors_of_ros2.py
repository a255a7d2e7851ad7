"""The checks of services and actions across the graph of ROS 2: one side is a node in rclpy, the other one a client.

Run with the Python that has rclpy, the URL of a server, the side of the node (`provider` or `caller`), and names of
checks. It writes a line of JSON: name of each check -> what went otherwise, and an empty text if nothing did.

A node has no frames, so `NodeSide` does what a frame asks for, and writes what comes as the frame that it stands for.
It has other types, because the wheels lack those of the checks; a failed call is `success: false` for a node.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final, TypeAlias

import rclpy
import websockets.sync.client
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future
from std_srvs.srv import Empty, SetBool, Trigger
from test_msgs.action import Fibonacci
from test_msgs.srv import BasicTypes

from rosbridge_sim.client import Client
from rosbridge_sim.doctor.check_frames import agrees, write_frame
from tests.vector_player import load_vectors

PATIENCE: Final = 60.0
"""How long what must come is waited for [s]."""

ABSENCE: Final = 2.0
"""Time in which an action that is not listed does not appear [s]."""

TURN: Final = 0.002
"""Time for one thing to do [s]; always the same, because rclpy begins anew with its first task after each other one."""

QUIET: Final = 0.3
"""Time in which nothing more may come [s]."""

Ros: TypeAlias = Any
"""An object of rclpy."""

Frame: TypeAlias = dict[str, Any]

TYPES: Final[dict[str, Ros]] = {
    "test_msgs/BasicTypes": BasicTypes,
    "std_srvs/SetBool": SetBool,
    "std_srvs/Empty": Empty,
    "std_srvs/Trigger": Trigger,
    "test_msgs/Fibonacci": Fibonacci,
}

WORDS: Final = {
    "rospy_tutorials/AddTwoInts": "test_msgs/BasicTypes",
    "rospy_tutorials/srv/AddTwoInts": "test_msgs/srv/BasicTypes",
    "example_interfaces/": "test_msgs/",
    '"a":': '"int64_value":',
    '"b":': '"int32_value":',
    '"sum":': '"int64_value":',
    "field a": "field int64_value",
    "field sum": "field int64_value",
    ".*disconnected": ".*",
    "it has a, b": ".*",
    '"args": [1, 2]': '"args": [false, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1]',
}
"""In the text of a check, and what stands there instead."""

WORDS_OF_A_FAILURE: Final = {
    "rospy_tutorials/AddTwoInts": "std_srvs/SetBool",
    '"args": {"a": 0, "b": 0}': '"args": {}',
    '"args": {"a": 1, "b": 0}': '"args": {}',
    '"args": {"a": 1}': '"args": {}',
    '"sum":': '"success":',
    "int64 for field sum": "bool for field success",
}
"""The same for a node whose call fails, because it needs a type that can say so."""


def adapted(vector: Frame, *, fails_for_node: bool) -> list[Frame]:
    """Return the steps with types that are there, and with fewer fields than these have."""
    text = json.dumps(vector["steps"])
    for old, new in (WORDS_OF_A_FAILURE if fails_for_node else WORDS).items():
        text = text.replace(old, new)
    return [
        {key: _spread(frame) if key[-1] == "<" else frame for key, frame in step.items()} for step in json.loads(text)
    ]


def _spread(frame: Frame) -> Frame:
    return {
        key: {"$has": _without_now(value)} if key in {"args", "values"} and isinstance(value, dict) else value
        for key, value in frame.items()
    }


def _without_now(value: object) -> object:
    if isinstance(value, list):
        return [_without_now(one) for one in value]
    if not isinstance(value, dict):
        return value
    return {"$any": "number"} if "$now" in value else {key: _without_now(one) for key, one in value.items()}


class WireSide:
    """A client of the server."""

    def __init__(self, url: str) -> None:
        self.frames: deque[Frame] = deque()
        self._socket = websockets.sync.client.connect(url, legacy=True)

    def send(self, frame: Frame) -> None:
        self._socket.send(write_frame(frame))

    def look(self) -> None:
        with suppress(TimeoutError):
            while True:
                self.frames.append(json.loads(self._socket.recv(timeout=0)))

    def settle(self) -> None:
        """Wait until the server has carried all frames to their end."""
        self._socket.ping().wait(PATIENCE)

    def close(self) -> None:
        self._socket.close()


class NodeSide:
    """A node that does what frames ask for."""

    def __init__(self, name: str, executor: SingleThreadedExecutor) -> None:
        self.frames: deque[Frame] = deque()
        self.offers: dict[str, Ros] = {}
        self._executor = executor
        self._node = rclpy.create_node(name)
        executor.add_node(self._node)
        self._clients: dict[str, Ros] = {}
        self._answers: dict[str, Callable[[Frame], object]] = {}
        self._nums: Counter[str] = Counter()
        self._goals: dict[str, Ros] = {}
        self._begun: set[str] = set()

    def send(self, frame: Frame) -> None:
        work = getattr(self, f"_{frame['op']}", None)
        if work is not None:
            work(frame)

    def look(self) -> None:
        self._executor.spin_once(timeout_sec=TURN)

    def settle(self) -> None:
        self.look()

    def close(self) -> None:
        for offer in (*self.offers.values(), *self._clients.values()):
            offer.destroy()
        self._executor.remove_node(self._node)
        self._node.destroy_node()

    # As a provider; answers and results come later, so nothing here waits

    def _advertise_service(self, frame: Frame) -> None:
        name, found = frame["service"], TYPES[frame["type"].replace("/srv/", "/")]
        taken: list[Ros] = []

        def take(request: Ros, response: Ros) -> Ros:
            taken.append(request)
            return response

        def keep(response: Ros, header: Ros) -> None:
            call = self._number("service_request", name)
            args = fields_of(taken.pop())
            self.frames.append({"op": "call_service", "service": name, "id": call, "args": args})
            self._answers[call] = lambda values: send(filled(response, values), header)

        service = self.offers[name] = self._node.create_service(found, name, take)
        send, service.send_response = service.send_response, keep

    def _service_response(self, frame: Frame) -> None:
        self._answers[frame["id"]](frame["values"])

    def _unadvertise_service(self, frame: Frame) -> None:
        self._node.destroy_service(self.offers.pop(frame["service"]))

    def _advertise_action(self, frame: Frame) -> None:
        name = frame["action"]

        def begin(goal: Ros) -> None:
            goal_id = self._number("action_goal", name)
            self._goals[goal_id] = goal
            fields = {"action": name, "action_type": frame["type"], "args": fields_of(goal.request), "feedback": True}
            self.frames.append({"op": "send_action_goal", "id": goal_id, **fields})

        def cancel(goal: Ros) -> CancelResponse:
            (goal_id,) = (one for one, known in self._goals.items() if known.goal_id == goal.goal_id)
            self.frames.append({"op": "cancel_action_goal", "id": goal_id, "action": name})
            return CancelResponse.ACCEPT

        self.offers[name] = ActionServer(
            *(self._node, Fibonacci, name, lambda _goal: Fibonacci.Result()),
            handle_accepted_callback=begin,
            cancel_callback=cancel,
        )

    def _unadvertise_action(self, frame: Frame) -> None:
        if frame["action"] in self.offers:
            self.offers.pop(frame["action"]).destroy()

    def _action_feedback(self, frame: Frame) -> None:
        self._goals[frame["id"]].publish_feedback(filled(Fibonacci.Feedback(), frame["values"]))

    def _action_result(self, frame: Frame) -> None:
        def end(goal: Ros) -> Ros:
            status = frame.get("status", 4 if frame.get("result") else 6)
            {4: goal.succeed, 5: goal.canceled, 6: goal.abort}[status]()
            return filled(Fibonacci.Result(), frame.get("values") or {})

        self._goals[frame["id"]].execute(end)

    def _number(self, kind: str, name: str) -> str:
        self._nums[name] += 1
        return f"{kind}:{name}:{self._nums[name]}"

    # As a caller

    def _wait(self, is_so: Callable[[], bool], seconds: float) -> bool:
        end = time.monotonic() + seconds
        while not is_so() and time.monotonic() < end:
            self.look()
        return is_so()

    def _call_service(self, frame: Frame) -> None:
        name = frame["service"]
        answer = {"op": "service_response", "service": name, **({"id": frame["id"]} if "id" in frame else {})}
        found = dict(self._node.get_service_names_and_types()).get(name, [""])
        is_there = self._node.count_services(name) > 0
        if not is_there or not self._wait(self._client(name, found[0]).service_is_ready, PATIENCE):
            self.frames.append({**answer, "values": f"Service {name} does not exist", "result": False})
            return

        def done(future: Future) -> None:
            values = fields_of(future.result())
            is_ok = values.get("success") is not False
            self.frames.append({**answer, "values": values if is_ok else values["message"], "result": is_ok})

        found_class = TYPES[found[0].replace("/srv/", "/")]
        future = self._clients[name].call_async(filled(found_class.Request(), frame.get("args") or {}))
        future.add_done_callback(done)

    def _client(self, name: str, kind: str) -> Ros:
        if name not in self._clients:
            self._clients[name] = self._node.create_client(TYPES[kind.replace("/srv/", "/")], name)
        return self._clients[name]

    def _send_action_goal(self, frame: Frame) -> None:
        name = frame["action"]
        known = {"id": frame["id"]} if "id" in frame else {}
        client = self._clients.setdefault(name, ActionClient(self._node, Fibonacci, name))
        is_listed = self._node.count_services(f"{name}/_action/send_goal") > 0
        is_there = self._wait(client.server_is_ready, PATIENCE if is_listed else ABSENCE)

        def end(values: object, status: int, *, is_ok: bool) -> None:
            fields = {"values": values, "status": status, "result": is_ok}
            self.frames.append({"op": "action_result", "action": name, **fields, **known})

        def report(message: Ros) -> None:
            values = fields_of(message.feedback)
            self.frames.append({"op": "action_feedback", "action": name, "values": values, **known})

        def begin(future: Future) -> None:
            goal = future.result()
            if not goal.accepted:
                self._begun.discard(frame.get("id", ""))
                end("rejected", 0, is_ok=False)
                return
            self._goals[frame.get("id", "")] = goal
            goal.get_result_async().add_done_callback(
                lambda done: end(fields_of(done.result().result), done.result().status, is_ok=True)
            )

        if not is_there:
            end(f"Action {name} does not exist", 0, is_ok=False)
            return
        self._begun.add(frame.get("id", ""))
        goal = filled(Fibonacci.Goal(), frame["args"])
        client.send_goal_async(goal, feedback_callback=report if frame.get("feedback") else None).add_done_callback(
            begin
        )

    def _cancel_action_goal(self, frame: Frame) -> None:
        self._wait(lambda: frame["id"] in self._goals or frame["id"] not in self._begun, PATIENCE)
        if frame["id"] in self._goals:
            self._goals[frame["id"]].cancel_goal_async()


def fields_of(message: Ros) -> Frame:
    """Return the fields of a message that JSON has."""
    values = {name: getattr(message, name) for name in message.get_fields_and_field_types()}
    return {
        name: value if isinstance(value, (int, float, str, bool)) else list(value)
        for name, value in values.items()
        if isinstance(value, (int, float, str, bool)) or hasattr(value, "tolist")
    }


def filled(message: Ros, values: Frame | list[Any]) -> Ros:
    for name, value in values.items() if isinstance(values, dict) else ():
        setattr(message, name, value)
    return message


class Play:
    """A check, played."""

    def __init__(self, url: str, side: str, executor: SingleThreadedExecutor, num: int) -> None:
        self._url = url
        self._side = side
        self._executor = executor
        self._num = num
        self._clients: dict[str, WireSide | NodeSide] = {}
        self._control = Client(url, timeout=PATIENCE)
        self._control.open()

    def play(self, vector: Frame) -> str:
        """Return what went otherwise."""
        frames = [(key, frame) for step in vector["steps"] for key, frame in step.items()]
        providers = {key[0] for key, frame in frames if isinstance(frame, dict) and "advertise_" in frame["op"]}
        fails = any(key[0] not in providers and is_failure(frame) for key, frame in frames)
        steps = adapted(vector, fails_for_node=fails and self._side == "caller")
        try:
            for number, step in enumerate(steps, 1):
                ((key, frame),) = step.items()
                is_node = (key[0] in providers) is (self._side == "provider")
                num = self._count_frames()
                why = self._step(self._client(key[0], is_node=is_node), key, frame)
                if why:
                    return f"step {number}: {why}"
                if is_node and is_call(step) and is_call(*steps[number : number + 1]):
                    self._wait_for_more(num)  # of two nodes either may come first
            return self._left()
        finally:
            for name in list(self._clients):
                self._close(name)
            self._wait_until_known("/add", is_there=False)
            self._wait_until_known("/fib", is_there=False)
            self._control.close()

    def _client(self, name: str, *, is_node: bool) -> WireSide | NodeSide:
        if name not in self._clients:
            self._clients[name] = (
                NodeSide(f"side_{name}_{self._num}", self._executor) if is_node else WireSide(self._url)
            )
        return self._clients[name]

    def _step(self, client: WireSide | NodeSide, key: str, frame: Frame) -> str:
        name, action = key[:-1], key[-1]
        if action == "-":
            offers = client.offers if isinstance(client, NodeSide) else {}
            self._close(name)
            for offer in offers:
                self._wait_until_known(offer, is_there=False)
        elif action == ">":
            client.send(frame)
            for other in self._clients.values():
                other.settle()
            if "advertise_" in frame["op"]:
                is_there = frame["op"].startswith("advertise_")
                self._wait_until_known("/" + (frame.get("service") or frame["action"]).strip("/"), is_there=is_there)
        elif action == "<" and not (isinstance(client, NodeSide) and frame["op"] == "status"):
            end = time.monotonic() + PATIENCE
            while not client.frames and time.monotonic() < end:
                self._look()
            if not client.frames:
                return f"{name} got nothing, expected {frame}"
            got = client.frames.popleft()
            return "" if agrees(frame, got) else f"{name} got {got}, expected {frame}"
        return ""

    def _count_frames(self) -> int:
        return sum(len(client.frames) for client in self._clients.values())

    def _wait_for_more(self, num: int) -> None:
        """Wait until there are more frames than so many."""
        end = time.monotonic() + PATIENCE
        while self._count_frames() <= num and time.monotonic() < end:
            self._look()

    def _look(self) -> None:
        for client in list(self._clients.values()):
            client.look()
        self._executor.spin_once(timeout_sec=TURN)

    def _left(self) -> str:
        end = time.monotonic() + QUIET
        while time.monotonic() < end:
            self._look()
        left = {name: list(client.frames) for name, client in self._clients.items() if client.frames}
        return f"nobody expected {left}" if left else ""

    def _close(self, name: str) -> None:
        self._clients.pop(name).close()

    def _wait_until_known(self, name: str, *, is_there: bool) -> None:
        """Wait until both the server and a node on the graph know, or know no more, who offers a name."""
        end = time.monotonic() + PATIENCE
        while self._is_known(name) is not is_there or (self._side == "caller" and self._is_seen(name) is not is_there):
            assert time.monotonic() < end, f"{name} is {'not ' if is_there else ''}known"
            self._look()

    def _is_known(self, name: str) -> bool:
        services = self._control.call("/rosapi/services")["services"]
        return name in services or name in self._control.call("/rosapi/action_servers")["action_servers"]

    def _is_seen(self, name: str) -> bool:
        return any(OBSERVER.count_services(one) for one in (name, f"{name}/_action/send_goal"))


def is_call(*steps: dict[str, Frame]) -> bool:
    return any(key[-1] == ">" and frame["op"] == "call_service" for step in steps for key, frame in step.items())


def is_failure(frame: Frame) -> bool:
    return isinstance(frame, dict) and frame["op"] == "service_response" and frame.get("result") is False


def main() -> None:
    url, side, *names = sys.argv[1:]
    executor = SingleThreadedExecutor()
    told = {}
    for num, vector in enumerate(load_vectors()):
        if vector["id"] in names:
            try:
                told[vector["id"]] = Play(url, side, executor, num).play(vector)
            except Exception as error:  # noqa: BLE001 - a check that cannot be played is one that went otherwise
                told[vector["id"]] = f"{error!r}"
    sys.stdout.write(json.dumps(told))
    sys.stdout.flush()
    os._exit(0)  # without the threads of the libraries


if __name__ == "__main__":
    rclpy.init()
    OBSERVER = rclpy.create_node("observer")
    main()
