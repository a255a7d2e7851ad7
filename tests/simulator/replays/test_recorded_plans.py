"""Plans of programs in a recording."""

from __future__ import annotations

from rosbridge_sim.simulator.replays.recorded_plans import RecordedPlan


def test_messages_are_found_by_their_times() -> None:
    plan = RecordedPlan("/plan", "nav_msgs/Path", [10, 20, 20, 40], [b"a", b"b", b"c", b"d"], bytes)
    assert plan.between(0, 9) == []
    assert plan.between(9, 20) == [b"a", b"b", b"c"]
    assert plan.between(20, 40) == [b"d"]
    assert (plan.last(9), plan.last(39), plan.last(99)) == ([], [b"c"], [b"d"])
