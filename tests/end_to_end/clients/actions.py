"""Roles, each with NAME and TYPE: `perform_over_topics` and `ask_over_topics` (actionlib's of ROS 1), `send` (ROS 2).

The performers count Fibonacci numbers: feedback after each step, and the whole as the result. An order of ENDLESS
stops after the first step and waits to be cancelled. A negative one fails.
"""

from __future__ import annotations

import threading
from typing import Any

import roslibpy
from roslibpy.ros1 import actionlib

from tests.end_to_end.clients.program import PATIENCE, run, say, serve, settle

ENDLESS = 100


def steps_to(order: int) -> list[list[int]]:
    """What is known after each step, [0, 1, 1] and [0, 1, 1, 2] and so on."""
    steps = [[0, 1, 1]]
    while order < ENDLESS and len(steps) < order - 1:
        steps.append([*steps[-1], steps[-1][-1] + steps[-1][-2]])
    return steps


def is_listed(ros: roslibpy.Ros, name: str) -> bool:
    """Whether rosapi knows an action server by that name."""
    service = roslibpy.Service(ros, "/rosapi/action_servers", "rosapi/GetActionServers")
    return name in service.call(roslibpy.ServiceRequest(), timeout=PATIENCE)["action_servers"]


# ROS 1: five topics


def perform_over_topics(ros: roslibpy.Ros, name: str, type_name: str) -> None:
    """Perform until stdin ends."""
    server = actionlib.SimpleActionServer(ros, name, f"{type_name}Action")
    is_cancelled = threading.Event()
    server.on("cancel", lambda *_: is_cancelled.set())

    def work(goal: dict[str, int]) -> None:
        steps = steps_to(goal["order"])
        for sequence in steps:
            server.send_feedback({"sequence": sequence})
        if goal["order"] < ENDLESS:
            server.set_succeeded({"sequence": steps[-1]})
        else:
            assert is_cancelled.wait(PATIENCE), "nobody cancelled"
            server.set_preempted()

    server.start(work)
    settle(ros)
    say(ready=name)
    serve()


def ask_over_topics(ros: roslibpy.Ros, name: str, type_name: str) -> None:
    """One goal to its end, and two that are cancelled after their first feedback: by id, and as all that there are."""
    client = actionlib.ActionClient(ros, name, f"{type_name}Action")  # comes back when it has heard a status

    def follow(order: int, *, by_all: bool = False) -> dict[str, Any]:
        goal = actionlib.Goal(client, roslibpy.Message({"order": order}))
        feedback: list[list[int]] = []
        results: list[list[int]] = []
        is_under_way, has_ended = threading.Event(), threading.Event()
        goal.on("feedback", lambda values: feedback.append(values["sequence"]))
        goal.on("feedback", lambda _: is_under_way.set())
        goal.on("result", lambda values: results.append(values["sequence"]))
        goal.on("result", lambda _: has_ended.set())
        goal.send()
        if order == ENDLESS:
            assert is_under_way.wait(PATIENCE), "no feedback"
            client.cancel() if by_all else goal.cancel()
        # and not goal.wait(): roslib's servers never say by a status that a goal is over
        assert has_ended.wait(PATIENCE), f"no result after {feedback}"
        return {"feedback": feedback, "sequence": results[0]}

    whole, cancelled, by_all = follow(5), follow(ENDLESS), follow(ENDLESS, by_all=True)
    listed = is_listed(ros, name)
    client.dispose()
    settle(ros)
    say(whole=whole, cancelled=cancelled, cancelled_by_all=by_all, is_listed=listed)


# ROS 2: ops of their own


def send(ros: roslibpy.Ros, name: str, type_name: str) -> None:
    """One goal to its end, one that is cancelled after its first feedback, and one that fails."""
    client = roslibpy.ActionClient(ros, name, type_name)

    def follow(order: int) -> dict[str, Any]:
        feedback: list[list[int]] = []
        results: list[dict[str, Any]] = []
        is_under_way = threading.Event()

        def note(values: dict[str, Any]) -> None:
            feedback.append(values["sequence"])
            is_under_way.set()

        goal_id = client.send_goal(roslibpy.Goal({"order": order}), results.append, note, results.append)
        if order == ENDLESS:
            assert is_under_way.wait(PATIENCE), "no feedback"
            client.cancel_goal(goal_id)
        client.wait_goal(goal_id, PATIENCE)
        settle(ros)  # it has stopped waiting before it calls back
        return {"feedback": feedback, "values": results[0]["values"], "status": results[0]["status"].name}

    say(whole=follow(5), cancelled=follow(ENDLESS), failed=follow(-1), is_listed=is_listed(ros, name))


run(perform_over_topics=perform_over_topics, ask_over_topics=ask_over_topics, send=send)
