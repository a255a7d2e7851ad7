"""`action ...`: the actions of a rosbridge, and goals for them."""

from __future__ import annotations

import asyncio

from rosbridge_sim.cli.tools.text import put, put_json, put_names, render, show
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, words
from rosbridge_sim.cli.tools.topic import types_of_topics
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint

_STATUS = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
"""Word for each number of action_msgs/GoalStatus."""

_SUCCEEDED = 4

_GOAL = "ActionGoal"
"""End of the type of the topic `NAME/goal` of ROS 1."""


async def types_of_actions(bridge: Bridge) -> dict[str, str]:
    """Return action -> type, as far as that is known, else `?`.

    Raises:
        RefusedError: rosapi refuses, or does not exist. The same holds for the other functions here.
        BridgeError: there is no answer.
    """
    names = sorted(words(await bridge.ask("action_servers"), "action_servers"))
    answers = await bridge.ask_all([("action_type", {"action": name}) for name in names])
    kinds = [one.word("type") for one in answers]
    topics = {} if all(kinds) else await types_of_topics(bridge)  # the rosapi of ROS 1 tells no types of actions
    goals = [topics.get(f"{name}/goal", "") for name in names]
    return {
        name: kind or (goal.removesuffix(_GOAL) if goal.endswith(_GOAL) else "?")
        for name, kind, goal in zip(names, kinds, goals, strict=True)
    }


async def _type_of(bridge: Bridge, action: str) -> str:
    actions = await types_of_actions(bridge)
    if action not in actions:
        raise RefusedError(f"no action {safe(action)} here{hint(action, actions)}")
    return actions[action]


async def list_actions(bridge: Bridge, *, has_types: bool, is_count: bool, is_json: bool) -> None:
    """Print all actions.

    Args:
        is_count: print only how many there are.
    """
    actions = await types_of_actions(bridge)
    if is_json and not is_count:
        put_json([{"action": name, "type": kind} for name, kind in actions.items()])
    else:
        put_names(list(actions), list(actions.values()) if has_types else (), is_count=is_count)


async def show_action_type(bridge: Bridge, name: str, *, is_json: bool) -> None:
    """Print the type of an action."""
    kind = await _type_of(bridge, absolute(name))
    show(kind, safe(kind), is_json=is_json)


async def show_action(bridge: Bridge, name: str, *, has_types: bool, is_json: bool) -> None:
    """Print the nodes of an action: clients that use its topics, and servers."""
    action = absolute(name)
    kind = await _type_of(bridge, action)
    answers = await bridge.ask_all(
        [
            ("publishers", {"topic": f"{action}/goal"}),  # of ROS 1, as the last one
            ("subscribers", {"topic": f"{action}/_action/feedback"}),
            ("publishers", {"topic": f"{action}/_action/feedback"}),
            ("publishers", {"topic": f"{action}/status"}),
        ]
    )
    nodes = [{name for key in ("publishers", "subscribers") for name in words(one.fields, key)} for one in answers]
    clients, servers = sorted(nodes[0] | nodes[1]), sorted(nodes[2] | nodes[3])
    if is_json:
        put_json({"action": action, "type": kind, "clients": clients, "servers": servers})
        return
    put(f"Action: {safe(action)}")
    for title, found in (("clients", clients), ("servers", servers)):
        put(f"Action {title}: {len(found)}")
        for one in found:
            put(safe(f"    {one} [{kind}]" if has_types else f"    {one}"))


async def send_goal(
    bridge: Bridge, name: str, type_name: str, goal: Frame, *, has_feedback: bool, is_json: bool
) -> None:
    """Send a goal and print its result; cancel it on Ctrl-C.

    Args:
        type_name: type of the action; empty means the type that rosapi tells.
        is_json: print one line of JSON for each feedback, and for the result.

    Raises:
        RefusedError: there is no such action, the bridge takes no goals, or the goal does not succeed.
    """
    action = absolute(name)
    kind = await _type_of(bridge, action)
    (version,) = await bridge.ask_all([("get_ros_version", {})])
    if not version.is_ok:  # rosbridge_suite of ROS 1 ignores the op
        raise RefusedError(
            f"this rosbridge of ROS 1 has no op for goals; rosbridge-sim topic pub --once {safe(action)}/goal"
            f" {safe(kind)}{_GOAL} '{{goal: ...}}' sends one, and {safe(action)}/result has its result"
        )
    goal_id = await bridge.send(
        "send_action_goal", action=action, action_type=type_name or kind, args=goal, feedback=has_feedback
    )
    if not is_json:
        put(f"Sending goal:\n{_indented(goal)}")
    try:
        while True:
            frame = await bridge.receive()
            assert frame is not None, "a wait without a limit ends with a frame"
            if frame.get("op") == "action_feedback" and frame.get("id") == goal_id:
                values = frame.get("values")
                show({"feedback": values}, f"\nFeedback:\n{_indented(values)}", is_json=is_json)
            elif frame.get("op") == "action_result" and frame.get("id") == goal_id:
                _end(action, frame, is_json=is_json)
                return
            elif frame.get("op") == "status" and frame.get("id") == goal_id and frame.get("level") == "error":
                raise RefusedError(safe(str(frame.get("msg"))))
    except asyncio.CancelledError:
        await bridge.send("cancel_action_goal", action=action, id=goal_id)
        raise


def _end(action: str, frame: Frame, *, is_json: bool) -> None:
    values, number = frame.get("values"), frame.get("status")
    if frame.get("result") is False and isinstance(values, str):
        raise RefusedError(safe(values))
    status = _STATUS[number] if isinstance(number, int) and 0 <= number < len(_STATUS) else "UNKNOWN"
    text = f"\nResult:\n{_indented(values)}\n\nGoal finished with status: {status}"
    show({"result": values, "status": status}, text, is_json=is_json)
    if number != _SUCCEEDED:
        raise RefusedError(f"{safe(action)}: the goal has not succeeded: {status}")


def _indented(value: object) -> str:
    return "\n".join(f"    {line}" for line in render(value).splitlines())
