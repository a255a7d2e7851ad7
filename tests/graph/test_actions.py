"""Cancelling of goals through the service of ROS 2, by the rules of action_msgs/CancelGoal."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import Policy, Rule
from tests.graph.bus_fixture import Wire, make_bus

SERVICE = "/fib/_action/cancel_goal"
UUIDS = tuple(f"{i}{'0' * 7}-0000-4000-8000-{'0' * 12}" for i in range(1, 4))
UNKNOWN = "9" * 8 + UUIDS[0][8:]
NONE, REJECTED, UNKNOWN_GOAL, TERMINATED = range(4)


class Runs:
    """Three goals of two clients, accepted at 10, 20 and 30 s, and a third client that cancels."""

    def __init__(self, policy: Policy | None = None) -> None:
        self.bus: Bus = make_bus()
        self.provider, self.first, self.second = (Wire(self.bus) for _ in range(3))
        self.other = Wire(self.bus) if policy is None else Wire(self.bus, policy)
        self.provider.says(op="advertise_action", action="/fib", type="example_interfaces/Fibonacci")
        for i, (uuid, sender) in enumerate(zip(UUIDS, (self.first, self.second, self.first), strict=True)):
            self.bus.stamp_ns = (i + 1) * 10 * 10**9
            sender.says(op="send_action_goal", action="/fib", args={"order": 1}, id=f"goal:{uuid}")
        self.provider.hears()

    def cancel(self, uuid: str = "", seconds: int = 0) -> tuple[int, list[int]]:
        """Return the code of the answer, and the stamps of the goals in it [s], which the provider is asked to end."""
        goal_id = {"uuid": list(bytes.fromhex(uuid.replace("-", "")))} if uuid else {}
        answer = self.other.calls(SERVICE, goal_info={"goal_id": goal_id, "stamp": {"secs": seconds}})["values"]
        stamps = [info["stamp"]["secs"] for info in answer["goals_canceling"]]
        asked = [int(frame["id"].rpartition(":")[2]) * 10 for frame in self.provider.hears()]
        assert asked == stamps
        return answer["return_code"], stamps

    def end(self, number: int) -> None:
        end = {"id": f"action_goal:/fib:{number}", "values": {"sequence": []}, "status": 5, "result": True}
        self.provider.says(op="action_result", action="/fib", **end)


@pytest.mark.parametrize(
    ("uuid", "seconds", "code", "stamps"),
    [
        ("", 0, NONE, [10, 20, 30]),
        ("", 20, NONE, [10, 20]),
        ("", 9, REJECTED, []),
        (UUIDS[1], 0, NONE, [20]),
        (UUIDS[2], 10, NONE, [10, 30]),
        (UUIDS[0], 5, NONE, [10]),
        (UNKNOWN, 0, UNKNOWN_GOAL, []),
        (UNKNOWN, 10, NONE, [10]),
    ],
)
def test_id_and_stamp_choose_the_goals(uuid: str, seconds: int, code: int, stamps: list[int]) -> None:
    assert Runs().cancel(uuid, seconds) == (code, stamps)


def test_ended_goal_is_told_from_an_unknown_one() -> None:
    runs = Runs()
    runs.end(2)
    assert runs.cancel(UUIDS[1]) == (TERMINATED, [])
    assert runs.cancel() == (NONE, [10, 30])
    assert runs.cancel() == (REJECTED, [])


def test_two_goals_never_share_an_id() -> None:
    runs = Runs()
    runs.second.says(op="send_action_goal", action="/fib", args={}, id=f"again:{UUIDS[0]}")
    runs.second.says(op="send_action_goal", action="/fib", args={}, id="0" * 8 + "-0000-0000-0000-" + "0" * 12)
    goals = runs.bus.actions.by_name["/fib"].goals
    assert len({goal.uuid for goal in goals}) == len(goals) == 5
    assert all(len(goal.uuid) == 16 and any(goal.uuid) for goal in goals)


@pytest.mark.parametrize("denied", ["/fib", SERVICE])
def test_client_without_the_right_to_the_action_cancels_nothing(denied: str) -> None:
    runs = Runs(Policy(service=Rule(deny=(denied,))))
    answer: dict[str, Any] = runs.other.calls(SERVICE)
    assert answer["result"] is False
    assert runs.provider.hears() == []
