"""The parts of services by rclpy that need no rclpy. `end_to_end/test_rclpy.py` has real nodes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace

import pytest

from rosbridge_sim.shell.ros2.rclpy_services import ANSWERS_PER_PERIOD, Pacer, refusal_of


def test_a_burst_of_answers_is_spread_and_a_single_one_goes_at_once() -> None:
    timers: list[Callable[[], None]] = []
    done: list[int] = []
    pacer = Pacer(lambda _delay, work: timers.append(work))
    for i in range(2 * ANSWERS_PER_PERIOD + 1):
        pacer.do(partial(done.append, i))
    counts = [len(done)]
    while timers:
        timers.pop()()
        counts.append(len(done))
    assert counts == [ANSWERS_PER_PERIOD, 2 * ANSWERS_PER_PERIOD, *[2 * ANSWERS_PER_PERIOD + 1] * 2]
    pacer.do(partial(done.append, -1))
    assert done[-1] == -1


@pytest.mark.parametrize(
    ("response", "told"),
    [
        ({"success": False, "message": ""}, {"success": False, "message": "why"}),
        ({"success": False, "status_message": ""}, {"success": False, "status_message": "why"}),
        ({"success": False}, {"success": False}),
        ({"success": 0, "message": ""}, None),
        ({"message": ""}, None),
    ],
)
def test_a_failed_call_becomes_a_response_where_its_type_can_say_so(
    response: dict[str, object], told: dict[str, object] | None
) -> None:
    refusal = refusal_of(SimpleNamespace(**response), "why")
    assert (None if refusal is None else vars(refusal)) == told
