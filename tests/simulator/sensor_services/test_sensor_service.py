"""Mistakes in requests of `/sim/sensors`. What the service does is in `sensors/test_mounted_sensors.py`."""

from __future__ import annotations

import json

import pytest

from tests.simulator.sim_harness import SimHarness


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ({"move": ['{"frame_id": "gps"}'] * 65}, "move: expected at most 64 in one call, got 65"),
        ({"remove": ["gps"] * 65}, "remove: expected at most 64 in one call, got 65"),
        ({"add": "[" + "[]," * 3_000 + "[]]"}, "add: expected at most 5,000 objects, lists and values, got 6,002"),
        (
            {"move": ["[" + "[]," * 3_000 + "[]]"]},
            "move[0]: expected at most 5,000 objects, lists and values, got 6,002",
        ),
    ],
)
def test_request_with_too_much_is_refused_before_it_is_read(request_: dict[str, object], why: str) -> None:
    answer = SimHarness().client().call("/sim/sensors", request_)
    assert json.loads(answer.values.json)["message"] == why  # type: ignore[attr-defined]
